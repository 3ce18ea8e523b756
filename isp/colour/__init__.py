"""From camera channels to colour."""

from isp.colour.colour_fit import fit_matrix
from rodcone.colour_spaces import encode_srgb

__all__ = ["encode_srgb", "fit_matrix"]
