"""Wavelengths that a study renders, and whether its lights are known there."""

from render.illuminants import illuminant, lines_nm
from render.spectrum import VISIBLE_NM
from rodcone.errors import InputError

LOWEST_NM, HIGHEST_NM = 300.0, 1100.0  # of `render.spectrum.flat`, black bodies and the sun's table
LEAST_RANGE_NM = 100.0  # the widest band that `RenderLimits.band_nm` takes
# A light whose table ends short of the bands, at no more than this share of its peak, is taken as dark from there on;
# white LEDs of the CIE end at 780 nm with 0.6 to 5 %.
_RUN_OUT = 0.01


def check_known(spectrum: str, range_nm: tuple[float, float]) -> None:
    """Raise `InputError` for an unknown light, or one not known as far as a study renders beyond 380-780 nm."""
    light = illuminant(spectrum)
    if range_nm[0] >= VISIBLE_NM[0] and range_nm[1] <= VISIBLE_NM[1]:
        return
    ends = zip(light.wavelength_nm[[0, -1]], light.values[[0, -1]], (range_nm[0], -range_nm[1]), (1, -1), strict=True)
    short = [nm for nm, value, asked, sign in ends if sign * nm > asked and value > _RUN_OUT * light.values.max()]
    if short or lines_nm(spectrum):
        raise InputError(
            f"spectra: {spectrum!r} is known over {light.wavelength_nm[0]:g}-{light.wavelength_nm[-1]:g} nm, and "
            f"render.range_nm asks for {range_nm[0]:g}-{range_nm[1]:g} nm; allowed: sunlight, moonlight, temperatures "
            "such as 2856K, LEDs that have run out there such as LED-B5; take one of them"
        )


def check_range(range_nm: tuple[float, ...]) -> None:
    """Raise `InputError` for a range of wavelengths that no study renders."""
    if len(range_nm) != 2 or not LOWEST_NM <= range_nm[0] < range_nm[1] <= HIGHEST_NM:
        raise InputError(
            f"render.range_nm: {list(range_nm)!r} is not allowed; give [shortest, longest] within "
            f"{LOWEST_NM:g} to {HIGHEST_NM:g} nm, where lights are known"
        )
    if range_nm[1] - range_nm[0] < LEAST_RANGE_NM:
        raise InputError(f"render.range_nm: {list(range_nm)!r} is less than {LEAST_RANGE_NM:g} nm; widen it")
