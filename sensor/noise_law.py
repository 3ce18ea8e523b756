"""Variance of a sample as a function of its mean: one formula for shot noise, dark noise, fixed offsets and PRNU."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Number: TypeAlias = float | NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NoiseLaw:
    """Variance of samples whose light has the mean e: shot e + dark_e^2 + fixed_e^2 + (prnu e)^2.

    Each field is a number, or an array of one for each sample.

    Attributes
    ----------
    shot : float or array
        Variance of shot noise per electron of the mean. It is 1 for Poisson counts, and more if a sample is scaled up
        from fewer electrons.
    dark_e : float or array
        Standard deviation of the temporal noise that light doesn't change [e-].
    fixed_e : float or array
        Standard deviation over pixels of the fixed offsets [e-].
    prnu : float or array
        Standard deviation over pixels of the relative response.
    """

    shot: Number = 0.0
    dark_e: Number = 0.0
    fixed_e: Number = 0.0
    prnu: Number = 0.0

    def variance(self, electrons: NDArray[np.floating]) -> NDArray[Any]:
        """Return the variance of samples with these means [e-^2], in the shape and type of `electrons`."""
        variance = self.prnu * electrons
        variance *= variance
        variance += self.shot * electrons
        variance += self.dark_e**2 + self.fixed_e**2
        return np.asarray(variance)

    def slope(self, electrons: NDArray[np.floating]) -> NDArray[Any]:
        """Return the derivative of `variance` by the mean [e-]."""
        return np.asarray(self.shot + 2 * self.prnu**2 * electrons)

    def over(self, share: float) -> "NoiseLaw":
        """Return the law of samples that are divided by `share`, as a function of the quotient's mean."""
        return NoiseLaw(self.shot / share, self.dark_e / share, self.fixed_e / share, self.prnu)


def total(laws: Iterable[NoiseLaw]) -> NoiseLaw:
    """Return the law of the sum of independent noises, whose laws hold numbers."""
    laws = tuple(laws)
    dark_e, fixed_e, prnu = (hypot(*(getattr(law, name) for law in laws)) for name in ("dark_e", "fixed_e", "prnu"))
    return NoiseLaw(sum(law.shot for law in laws), dark_e, fixed_e, prnu)
