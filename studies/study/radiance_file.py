"""A study of a spectral picture file in place of a rendered scene."""

import warnings
from collections.abc import Iterable
from pathlib import Path

from render.illuminants import illuminant
from render.radiance_files.file_checks import require_file
from render.radiance_files.photo import EXTENSIONS
from render.radiance_files.radiance_source import is_reflectance, load_picture
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.errors import InputError, require_range
from studies.study.levels import parse_level

LIGHT = "D65"  # what sRGB takes for white, where nothing tells the light of the picture


def check_radiance_file(path: str | Path, levels: Iterable[str]) -> None:
    """Raise `InputError` for a file that isn't there, or a level in lux, which has no plane to be measured on."""
    require_file(Path(path))
    for level in levels:
        if parse_level(level)[1] == "lux":
            raise InputError(f"level: {level!r} needs a reference plane, which a picture file hasn't; give it in cd/m2")


def open_radiance_file(path: str | Path, light: str | None) -> tuple[Transport, Spectrum, list[str]]:
    """Transport of a picture file, the light that its colours are judged under, and what had to be assumed.

    Raises
    ------
    InputError
        As `load_picture`, for a picture of fewer than 16 or more than 4096 pixels a side, or an unknown light.
    """
    spectrum = illuminant(light or LIGHT)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        transport = load_picture(path, spectrum)
    name = Path(path).name
    for side in transport.counts.shape:
        require_range(f"{name}: side", side, 16, 4096, "a study takes such sides in pixels; crop or scale it")
    assumed = [f"{name}: {warning.message}" for warning in caught]
    if light is None:
        use = "it is lit by" if is_reflectance(path) else "its colours are judged under"
        assumed.append(f"{name}: {use} {LIGHT}; give another light where that isn't so")
    if Path(path).suffix.lower() in EXTENSIONS:
        assumed.append(
            f"{name}: a photograph doesn't tell spectra; each colour stands for the reflectance that the basis of "
            "Mallett and Yuksel (2019) gives it"
        )
    if transport.relative_mc_error:
        assumed.append(
            f"{name}: it was rendered with noise of {transport.relative_mc_error:.1%} of the value in a pixel and "
            "band; pictures of it hold that beside the sensor's noise, and no Monte Carlo share counts it"
        )
    return transport, spectrum, assumed
