"""How alike two patches are: the plane that guides eq. (5), what noise alone makes of a distance, how far to trust it."""
