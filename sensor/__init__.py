"""From radiance to raw data: optics, colour filter arrays, noise, readout, presets."""
