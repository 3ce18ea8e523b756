"""One of several readings of a pixel in one exposure."""

from collections.abc import Sequence
from dataclasses import dataclass

from rodcone.brief import brief
from rodcone.errors import InputError, require_range, require_whole, unknown

MERGED, SWITCHED = "merged", "switched"  # what is done with several readings
MOST_READINGS = 8


@dataclass(frozen=True)
class Reading:
    """A reading: another gain, another time, or another part of the pixel.

    Readings of one photodiode and one time are of the same charge, so of one shot noise.

    Attributes
    ----------
    read_noise_e, dsnu_e, full_well_e : float
        As `sensor.config.PixelConfig` has them, in electrons of this reading's own charge.
    light_share : float
        Share of the pixel's light, and of its dark current, that the photodiode collects.
    time_share : float
        Share of the exposure time, the longest's 1.
    photodiode : str
        Which one: readings of another have other shot noise and another PRNU.
    """

    read_noise_e: float
    dsnu_e: float
    full_well_e: float
    light_share: float = 1.0
    time_share: float = 1.0
    photodiode: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        limits = {
            "read_noise_e": (0.0, 1e9, "give electrons, 0 for none"),
            "dsnu_e": (0.0, 1e9, "give electrons, 0 for none"),
            "full_well_e": (1.0, 1e12, "give electrons"),
            "light_share": (1e-6, 1.0, "give the photodiode's share of the pixel's light"),
            "time_share": (1e-6, 1.0, "give a share of the exposure time, the longest's 1"),
        }
        for name, (low, high, fix) in limits.items():
            require_range(name, getattr(self, name), low, high, fix)
        if not isinstance(self.photodiode, str):
            raise InputError(f"photodiode: {self.photodiode!r} is not a name; allowed: a name in quotes; write so")

    @property
    def share(self) -> float:
        """Share of the whole pixel's electrons in the whole exposure that this charge holds."""
        return self.light_share * self.time_share

    @property
    def charge(self) -> tuple[str, float]:
        """What readings of the same charge have in common: photodiode and time."""
        return self.photodiode, self.time_share


def check_readings(readings: Sequence[Reading], readout: str) -> None:
    """Raise `InputError` for readings that no pixel has, or a readout that they can't have."""
    if readout not in (MERGED, SWITCHED):
        raise unknown("readout", readout, (MERGED, SWITCHED))
    if not readings:
        if readout == SWITCHED:
            raise InputError(f"readout: {SWITCHED!r} without readings; allowed: with two or more; add [[readings]]")
        return
    require_whole("readings", len(readings), 2, MOST_READINGS, "give two or more, or describe the one in [pixel]")
    lights = {x.photodiode: x.light_share for x in readings}
    if any(lights[x.photodiode] != x.light_share for x in readings) or sum(lights.values()) > 1 + 1e-9:
        raise InputError(
            f"light_share: {[x.light_share for x in readings]} of the photodiodes {[x.photodiode for x in readings]}; "
            "allowed: one share for each photodiode, 1 together; name photodiodes apart, or correct their shares"
        )
    times = [x.time_share for x in readings]
    if max(times) != 1.0:
        raise InputError(
            f"time_share: {times}; allowed: shares of the longest time, one of 1; divide by {max(times):g}"
        )
    if readout == SWITCHED and {x.share for x in readings} != {1.0}:
        raise InputError(f"readout: {SWITCHED!r} between shares of light or time; allowed: gains; write {MERGED!r}")
