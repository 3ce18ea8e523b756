"""Level of a scene: mean luminance of what is no light, or illuminance on the reference plane, each with its error.

A lamp in view is thousands of times brighter than what it lights, and a few of its pixels would set the level. So the
light that the camera sees directly is left out of the sum of light, and the part of the picture that it covers is left
out of the area: the ratio needs no threshold, and has the same expectation at any size of one aspect ratio.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
class PassMeans:
    """Means over each pass of a render, from which levels are computed, at unit spectral emission.

    Attributes
    ----------
    spp : (pass,) int64
        Samples a pixel: the weights of the passes.
    uncovered : (pass,) float64
        Part of the picture in which no light is seen directly.
    radiance : (pass, group, band) float64
        Mean over the picture, without the light that is seen directly.
    """

    spp: NDArray[np.int64]
    uncovered: Floats
    radiance: Floats

    def mean_radiance(self) -> Floats:
        """Mean radiance of what is no light, shape (group, band).

        Raises
        ------
        InputError
            Where lights fill the picture.
        """
        uncovered = float(self.spp @ self.uncovered) / float(self.spp.sum())
        if uncovered <= 0:
            raise InputError(
                "luminance_cd_m2: every pixel sees a light directly; give illuminance_lux or powers instead"
            )
        return np.average(self.radiance, axis=0, weights=self.spp) / uncovered

    def luminance_level(self, weights: Floats) -> Level:
        """Mean luminance of what is no light.

        Parameters
        ----------
        weights : (group, band) float64
            Luminance of a radiance of 1 times the emission.
        """
        value = float((weights * self.mean_radiance()).sum())
        if self.spp.size < 2 or value <= 0:
            return Level(value, None)
        # Standard error of a ratio of sums over passes (linearised; Cochran, "Sampling Techniques", 2.11).
        share = self.spp / self.spp.sum()
        off = (self.radiance * weights).sum(axis=(1, 2)) - value * self.uncovered
        variance = float(share @ off**2) / (self.spp.size - 1)
        return Level(value, float(np.sqrt(variance)) / float(share @ self.uncovered) / value)


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

    def level(self, weights: Floats) -> Level:
        """Illuminance; `weights` as of `PassMeans.luminance_level`."""
        value, flat = float((weights * self.mean).sum()), weights.ravel()
        if value <= 0:
            return Level(value, None)
        return Level(value, float(np.sqrt(flat @ self.covariance @ flat)) / value)
