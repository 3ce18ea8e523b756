"""Noise from what photographers have: a DNG's NoiseProfile, and darktable's noise profiles."""

import json
from collections.abc import Iterator, Mapping
from math import isfinite, sqrt
from pathlib import Path
from typing import Any

from rodcone.errors import InputError, one_line, require_range, unknown
from rodcone.files import read_bounded
from sensor.cameras.numbers import PixelNumbers, Sourced, bits_of
from sensor.raw_files.noise_profile import read_noise_profile
from sensor.raw_files.raw_file import open_raw

MOST_BYTES = 1 << 24  # of darktable's file: 1.7 MB
_UNTOLD = {
    "pitch_um": "not told: needed; sensor width over pixels across",
    "fill_factor": "not told: needed; 1 for a chip with microlenses whose quantum efficiency is the whole pixel's",
    "dsnu_e": "not told by one photograph: needed; rodcone characterise --from measures it",
    "prnu": "not told by one photograph: needed; rodcone characterise --from measures it",
    "dark_current_e_per_s": "not told; its shot noise at the photograph's exposure is in read_noise_e",
}


def dng_numbers(path: Path) -> PixelNumbers:
    """Pixel from a digital negative's NoiseProfile (DNG 1.4 specification, tag 51041): N(x)^2 = S x + O.

    x goes from black to white, so white is 1 / S electrons and a dark pixel's noise sqrt(O) / S. That holds at the
    exposure index of the photograph; the photodiode may hold more at a lower one.

    Raises
    ------
    InputError
        For a file that can't be read, or one without a profile.
    """
    raw, _ = open_raw(path)
    profile = read_noise_profile(path, 1.0)  # of full scale 1: its gain is all of white's electrons
    if profile is None:
        raise InputError(
            f"noise: {str(path)!r} has no NoiseProfile of use; allowed: a .dng that has one; measure the camera's own: "
            "rodcone characterise --from FLAT.dng FLAT.dng --dark DARK.dng DARK.dng"
        )
    at = f"at ISO {raw.iso:g}" if raw.iso is not None else "at the photograph's exposure index, which it doesn't tell"
    source_note = f"NoiseProfile of {path.name}, {at}"
    white_e = profile.gain_e_per_dn
    rounding_e = white_e / (raw.white_dn - raw.black_dn) / sqrt(12)
    read_e, words = profile.dark_noise_e, "sqrt(O) / S"
    if read_e > rounding_e:
        read_e, words = sqrt(read_e**2 - rounding_e**2), f"sqrt(O) / S, less {rounding_e:.3g} e- of rounding"
    pixel = {
        "full_well_e": Sourced(white_e, f"electrons at white, 1 / S; {source_note}; the photodiode may hold more"),
        "read_noise_e": Sourced(read_e, f"{words}; {source_note}"),
    }
    settings = {"bits": bits_of(raw.white_dn, raw.black_dn, path.name)}
    if raw.black_dn == int(raw.black_dn):
        settings["black_level_dn"] = Sourced(raw.black_dn, f"BlackLevel of {path.name}")
    return PixelNumbers(source_note, pixel, settings, _UNTOLD, cfa=raw.cfa)


def darktable_numbers(path: Path, camera: str, iso: float | None, white_e: float | None) -> PixelNumbers:
    """Pixel from a user's own copy of darktable's ``noiseprofiles.json`` (GPL): variance a x + b, x 1 at white.

    The profiles were measured on pictures that darktable had demosaicked, which averages pixels: 1 / a is several times
    the electrons that a pixel can hold (docs/decisions/0046). So a profile tells the shape of the noise, and its scale
    has to come from elsewhere: with `white_e` electrons at white, averaging keeps the share k = a `white_e` of the
    variance, and the read noise is sqrt(b / k) `white_e`. Without it no electrons are told.

    Parameters
    ----------
    camera : str
        Maker and model, as in ``Nikon D850``.
    iso : float or None
        Exposure index; None for the lowest that the camera has.

    Raises
    ------
    InputError
        For a file that can't be read, a camera or an exposure index that it doesn't have.
    """
    cameras = _darktable(path)
    if camera not in cameras:
        raise unknown("camera", camera, cameras)
    profiles = cameras[camera]
    iso = min(profiles) if iso is None else iso
    if iso not in profiles:
        raise InputError(
            f"iso: {iso:g} is unknown for {camera}; allowed: {', '.join(f'{x:g}' for x in sorted(profiles))}"
        )
    a, b = profiles[iso]
    source_note = f"darktable's noise profile of {camera} at ISO {iso:g}, green: a = {a:.6g}, b = {b:.6g}"
    scale = f"not told: 1 / a = {1 / a:.4g} is of a demosaicked picture, not of a pixel; give --white-e"
    words = {**_UNTOLD, "full_well_e": scale, "read_noise_e": scale}
    if white_e is None:
        return PixelNumbers(source_note, left_out=words)
    require_range("white-e", white_e, 1.0, 1e12, "give the electrons at which the camera reads white at this ISO")
    pixel = {"full_well_e": Sourced(white_e, f"electrons at white at ISO {iso:g}, as given by --white-e")}
    if b > 0:
        pixel["read_noise_e"] = Sourced(
            sqrt(b * white_e / a), f"sqrt(b / k) of white, k = a * {white_e:g} = {a * white_e:.3g}; {source_note}"
        )
    else:
        words["read_noise_e"] = f"not told: b = {b:.3g} is not above 0; needed"
    return PixelNumbers(source_note, pixel, left_out=words)


def _darktable(path: Path) -> dict[str, dict[float, tuple[float, float]]]:
    """Green's a and b by exposure index, by camera."""
    try:
        held = json.loads(read_bounded(path, MOST_BYTES).decode("utf-8"))
        return {name: profiles for name, profiles in _each_camera(held) if profiles}
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"noise: {str(path)!r} can't be read ({type(error).__name__}: {one_line(error)}); allowed: a .dng, an EMVA "
            "report as .toml, or darktable's noiseprofiles.json; give one"
        ) from error


def _each_camera(held: Mapping[str, Any]) -> Iterator[tuple[str, dict[float, tuple[float, float]]]]:
    for maker in held["noiseprofiles"]:
        for model in maker["models"]:
            profiles: dict[float, tuple[float, float]] = {}
            for entry in model["profiles"]:
                iso, a, b = float(entry["iso"]), float(entry["a"][1]), float(entry["b"][1])
                if not entry.get("skip") and all(map(isfinite, (iso, a, b))) and 1e-12 < a < 1:
                    profiles.setdefault(iso, (a, b))  # the first of several measurements
            yield f"{maker['maker']} {model['model']}", profiles
