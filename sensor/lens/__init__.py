"""What a real lens does beyond an ideal one: falloff, scattered light, defocus, and lenses described by data."""
