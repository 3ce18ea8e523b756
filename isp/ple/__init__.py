"""Piecewise linear estimation: every channel at every pixel from a mosaic, by a prior over patches."""
