"""Several readings of one exposure: gains, times and parts of a pixel, their joint noise and their merge."""
