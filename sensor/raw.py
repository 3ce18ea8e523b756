"""The raw image: what a camera's software is given, and nothing of the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.errors import InputError, require_range
from sensor.cfa import Tile, check_covers, check_tile

# A saturated pixel reads white - 4 sigma_dark or more, give or take half a DN, with probability 1 - 3.2e-5.
SATURATION_SIGMAS = 4.0


@dataclass(frozen=True)
class RawImage:
    """One exposure as read out, with the calibration that a DNG's tags and noise profile would hold.

    Attributes
    ----------
    dn : (h, w) uint16
        Mosaic in digital numbers.
    cfa : tuple of str
        Tile of letters, row 0 first.
    black_dn, white_dn : float
        Reading of no light, and of a full well.
    gain_e_per_dn : float
        Electrons per digital number.
    read_noise_e, dsnu_e : float
        Standard deviations of the temporal and the fixed dark noise [e-].
    prnu : float
        Standard deviation of the pixels' relative response.
    exposure_s : float
        Exposure time [s].
    """

    dn: NDArray[np.uint16]
    cfa: Tile
    black_dn: float
    white_dn: float
    gain_e_per_dn: float
    read_noise_e: float
    dsnu_e: float
    prnu: float
    exposure_s: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "cfa", check_tile(self.cfa))
        check_covers(self.cfa, np.shape(self.dn))
        require_range("gain_e_per_dn", self.gain_e_per_dn, 1e-12, 1e12, "give electrons per digital number")
        if not self.black_dn < self.white_dn:
            raise InputError(
                f"black_dn: {self.black_dn!r} is not under white_dn {self.white_dn!r}; swap or correct them"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.dn.shape[0], self.dn.shape[1]

    @property
    def dark_noise_e(self) -> float:
        """Standard deviation of a dark pixel [e-]: read noise, DSNU and quantisation (1/sqrt(12) DN)."""
        return float(np.sqrt(self.read_noise_e**2 + self.dsnu_e**2 + self.gain_e_per_dn**2 / 12))

    @property
    def electrons(self) -> NDArray[np.float64]:
        """Mosaic in electrons above black, shape (h, w), float64; negative where noise took it under black."""
        return (np.asarray(self.dn, dtype=np.float64) - self.black_dn) * self.gain_e_per_dn

    @property
    def saturation_e(self) -> float:
        """Level from which a pixel counts as saturated [e-]: noise comes after the well clips (design, section 4)."""
        full_e = (self.white_dn - self.black_dn) * self.gain_e_per_dn
        return full_e - SATURATION_SIGMAS * self.dark_noise_e - self.gain_e_per_dn / 2

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """Where the pixel counts as saturated, shape (h, w)."""
        return self.electrons >= self.saturation_e
