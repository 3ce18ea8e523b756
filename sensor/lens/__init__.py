"""What a lens does to light beyond an ideal one: light that it scatters."""
