"""Name that written code imports: `isp.colour.colour_fit` under its earlier path."""

from isp.colour.colour_fit import fit_colours

__all__ = ["fit_colours"]
