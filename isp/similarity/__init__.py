"""How alike patches are: the plane that guides eq. (5), what noise makes of a distance, how far to trust it."""
