"""Level of a scene: mean luminance of all but the lights, or illuminance on the reference plane, each with its error.

A visible lamp is thousands of times brighter than what it lights, so that a few of its pixels would set the level. The
sum of light therefore leaves out light that the camera sees directly, and the area leaves out the part of the picture
that this light covers. Their ratio needs no threshold, and its expectation doesn't depend on the picture's size.
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
    """Means over the picture from which levels are computed, at unit spectral emission.

    Attributes
    ----------
    radiance : (group, band) float64
        Mean of the light that isn't seen directly, over the whole picture.
    uncovered : float
        Part of the picture in which no light is seen directly.
    covariance : (group x band + 1, group x band + 1) float64
        Covariance of the Monte Carlo errors of `radiance` and, last, of `uncovered`.
    """

    radiance: Floats
    uncovered: float
    covariance: Floats

    __repr__ = brief

    def mean_radiance(self) -> Floats:
        """Compute the mean radiance of the part of the picture that shows no light, shape (group, band).

        Raises
        ------
        InputError
            If lights fill the picture.
        """
        if self.uncovered <= 0:
            raise InputError(
                "luminance_cd_m2: every pixel sees a light directly; give illuminance_lux or powers instead"
            )
        return np.asarray(self.radiance / self.uncovered)

    def luminance_level(self, weights: Floats) -> Level:
        """Compute the mean luminance of the part of the picture that shows no light.

        Parameters
        ----------
        weights : (group, band) float64
            Luminance of a transport of 1 in each group and band.
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
        Covariance of the means' Monte Carlo errors.
    """

    mean: Floats
    covariance: Floats

    __repr__ = brief

    def level(self, weights: Floats) -> Level:
        """Compute the illuminance; `weights` are those of `SceneMeans.luminance_level`."""
        value = float((weights * self.mean).sum())
        flat = weights.ravel()
        if value <= 0:
            return Level(value, None)
        return Level(value, float(np.sqrt(max(float(flat @ self.covariance @ flat), 0.0))) / value)
