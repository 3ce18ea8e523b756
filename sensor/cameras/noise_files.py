"""Read a pixel's noise from a file that photographers have: a DNG with a NoiseProfile."""

from math import sqrt
from pathlib import Path

from rodcone.errors import InputError
from sensor.cameras.numbers import PixelNumbers, SourcedValue, bits_of
from sensor.raw_files.photograph import read_noise_profile
from sensor.raw_files.raw_file import open_raw

_UNTOLD = {
    "pitch_um": "not told: needed; sensor width over pixels across",
    "fill_factor": "not told: needed; 1 for a chip with microlenses whose quantum efficiency is the whole pixel's",
    "dsnu_e": "not told by one photograph: needed; rodcone characterise --from measures it",
    "prnu": "not told by one photograph: needed; rodcone characterise --from measures it",
    "dark_current_e_per_s": "not told; its shot noise at the photograph's exposure is in read_noise_e",
}


def dng_numbers(path: Path) -> PixelNumbers:
    """Read a pixel's full well and dark noise from a digital negative's NoiseProfile.

    The profile (DNG 1.4 specification, tag 51041) states the variance S x + O of a signal x from black (0) to white
    (1). White is therefore 1 / S electrons, and a dark pixel's noise sqrt(O) / S electrons. That holds at the exposure
    index of the photograph; at a lower index the photodiode may hold more.

    Raises
    ------
    InputError
        For a file that can't be read, or one without a profile.
    """
    raw, _ = open_raw(path)
    profile = read_noise_profile(path, 1.0)  # for a full scale of 1 DN, so its gain is the electrons of white
    if profile is None:
        raise InputError(
            f"noise: {str(path)!r} has no NoiseProfile of use; allowed: a .dng that has one; measure the camera's own: "
            "rodcone characterise --from FLAT.dng FLAT.dng --dark DARK.dng DARK.dng"
        )
    at = f"at ISO {raw.iso:g}" if raw.iso is not None else "at the photograph's exposure index, which it doesn't tell"
    source_note = f"NoiseProfile of {path.name}, {at}"
    white_e = profile.gain_e_per_dn
    rounding_e = white_e / (raw.white_dn - raw.black_dn) / sqrt(12)
    read_e = profile.dark_noise_e
    words = "sqrt(O) / S"
    if read_e > rounding_e:
        read_e = sqrt(read_e**2 - rounding_e**2)
        words = f"sqrt(O) / S, less {rounding_e:.3g} e- of rounding"
    pixel = {
        "full_well_e": SourcedValue(white_e, f"electrons at white, 1 / S; {source_note}; the photodiode may hold more"),
        "read_noise_e": SourcedValue(read_e, f"{words}; {source_note}"),
    }
    settings = {"bits": bits_of(raw.white_dn, raw.black_dn, path.name)}
    if raw.black_dn == int(raw.black_dn):
        settings["black_level_dn"] = SourcedValue(raw.black_dn, f"BlackLevel of {path.name}")
    return PixelNumbers(source_note, pixel, settings, _UNTOLD, cfa=raw.cfa)
