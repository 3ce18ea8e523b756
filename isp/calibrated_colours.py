"""Name that written code imports: `isp.colour.calibrated_colours` under its earlier path."""

from isp.colour.calibrated_colours import fit_of_calibration

__all__ = ["fit_of_calibration"]
