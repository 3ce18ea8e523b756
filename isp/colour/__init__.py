"""From camera channels to colour."""

from isp.colour.camera_colour import encode_srgb, fit_matrix

__all__ = ["encode_srgb", "fit_matrix"]
