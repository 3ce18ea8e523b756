"""Name that written code imports: `studies.photograph.calibrate` under its earlier path."""

from studies.photograph.calibrate import calibrate

__all__ = ["calibrate"]
