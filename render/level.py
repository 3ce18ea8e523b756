"""Level of a scene: mean luminance of what is no light, or illuminance on the reference plane, each with its error.

A lamp in view is thousands of times brighter than what it lights, and a few of its pixels would set the level. So the
light that the camera sees directly is left out of the sum of light, and the part of the picture that it covers is left
out of the area: the ratio needs no threshold, and has the same expectation at any size of one aspect ratio.
"""

from dataclasses import dataclass

import numpy as np

from rodcone.display import brief
from rodcone.errors import InputError
from rodcone.types import Floats


@dataclass(frozen=True)
class Level:
    """A mean over the picture or the reference plane, and its standard error.

    Attributes
    ----------
    value : float
        Mean luminance [cd m^-2], or illuminance [lux].
    relative_error : float or None
        Monte Carlo standard error over the value; None where it isn't known.
    """

    value: float
    relative_error: float | None


@dataclass(frozen=True)
class SceneMeans:
    """Means over the picture of what is no light, from which levels are computed, at unit spectral emission.

    Attributes
    ----------
    radiance : (group, band) float64
        Light that isn't seen directly, over all of the picture.
    uncovered : float
        Part of the picture in which no light is seen directly.
    covariance : (group x band + 1, group x band + 1) float64
        Of the Monte Carlo errors of `radiance` and, last, of `uncovered`.
    """

    radiance: Floats
    uncovered: float
    covariance: Floats

    __repr__ = brief

    def mean_radiance(self) -> Floats:
        """Mean radiance of what is no light, shape (group, band).

        Raises
        ------
        InputError
            Where lights fill the picture.
        """
        if self.uncovered <= 0:
            raise InputError(
                "luminance_cd_m2: every pixel sees a light directly; give illuminance_lux or powers instead"
            )
        return np.asarray(self.radiance / self.uncovered)

    def luminance_level(self, weights: Floats) -> Level:
        """Mean luminance of what is no light.

        Parameters
        ----------
        weights : (group, band) float64
            Luminance of a radiance of 1 times the emission.
        """
        value = float((weights * self.mean_radiance()).sum())
        if value <= 0:
            return Level(value, None)
        # Standard error of a ratio (linearised; Cochran, "Sampling Techniques", 2.11).
        off = np.append(weights.ravel(), -value)
        return Level(value, float(np.sqrt(max(float(off @ self.covariance @ off), 0.0))) / self.uncovered / value)


@dataclass(frozen=True)
class Irradiance:
    """Irradiance on the reference plane at unit spectral emission.

    Attributes
    ----------
    mean : (group, band) float64
    covariance : (group x band, group x band) float64
        Of the means' Monte Carlo errors.
    """

    mean: Floats
    covariance: Floats

    __repr__ = brief

    def level(self, weights: Floats) -> Level:
        """Illuminance; `weights` as of `SceneMeans.luminance_level`."""
        value = float((weights * self.mean).sum())
        flat = weights.ravel()
        if value <= 0:
            return Level(value, None)
        return Level(value, float(np.sqrt(max(float(flat @ self.covariance @ flat), 0.0))) / value)
