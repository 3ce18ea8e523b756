"""Spectral OpenEXR files: absolute radiance in float32, with a preview that any viewer shows.

The layout is that of Fichet, Pacanowski and Wilkie, "An OpenEXR Layout for Spectral Images", Journal of Computer
Graphics Techniques 10(3), 2021: one channel per wavelength, ``S0.<number>nm`` with a decimal comma for radiance, ``S1``
to ``S3`` for the rest of the Stokes vector, ``T`` for reflectance. Facts for which the layout has no place are
attributes whose names begin with ``rodcone``.
"""

import contextlib
import errno
import io
import re
import warnings
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from render.illuminants import unit_luminance
from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import (
    MOST_EXPANSION,
    bands_between,
    require_extent,
    require_file,
    require_reflectances,
)
from render.spectrum import Spectrum, band_widths, row_blocks, tristimulus
from rodcone.colour_spaces import XYZ_TO_SRGB_ROUNDED
from rodcone.errors import InputError, in_place, one_line, read_errors, require_range
from rodcone.file_keys import require_known
from rodcone.files import replacing
from rodcone.types import Floats

VERSION = "1.0"
LAYOUT_UNITS = "W.m^-2.sr^-1"  # what the layout prescribes, though its values are spectral: per nm
TRUE_UNITS = "W.m^-2.sr^-1.nm^-1"
UNITS, OWN_UNITS, BANDS = "emissiveUnits", "rodconeUnits", "rodconeBands_nm"
LAMP = "rodconeLamp"  # points nm:value of the lamp's spectrum, up to a factor; linear between them, 0 outside
_MEASUREMENT = ("lensTransmission", "cameraResponse")  # curves of the camera that took the picture; they aren't undone
_SPECTRAL = re.compile(r"(S[0-3]|T)\.([0-9]*,?[0-9]*(?:[Ee][+-]?[0-9]+)?)(\w{,2}(?:m|Hz)(?:\..*)?)")


def channel_name(wavelength_nm: float) -> str:
    """Name a radiance channel; all names are equally long, so that alphabetical order is the order of wavelength."""
    require_range("wavelength_nm", wavelength_nm, 1.0, 9999.0, "OpenEXR channel names hold 1 to 9999 nm")
    number = f"{wavelength_nm:011.6f}".replace(".", ",")
    return f"S0.{number}nm"


def spectral_channels(names: Iterable[str]) -> tuple[bool, dict[str, float]]:
    """Return whether a picture holds reflectance, and its spectral channels' wavelengths [nm] in increasing order.

    Channels of radiance are ``S0``, channels of reflectance ``T``. S1 to S3 and other channels are left out.

    Raises
    ------
    InputError
        If there are none or both, or two have the same wavelength.
    """
    names = list(names)
    matches = {name: match for name in names if (match := _SPECTRAL.fullmatch(name))}
    kinds = {match[1] for match in matches.values()} & {"S0", "T"}
    if not kinds:
        shown = ", ".join(sorted(names)[:8]) + (", ..." if len(names) > 8 else "")
        raise InputError(f"it has the channels {shown}; allowed: spectral ones such as S0.550,0nm; save it as spectral")
    if len(kinds) > 1:
        raise InputError("it holds radiance (S0 channels) and reflectance (T); allowed: one; save them apart")
    nm = {name: _to_nm(name, match) for name, match in matches.items() if match[1] in kinds}
    ordered = dict(sorted(nm.items(), key=lambda item: item[1]))
    if len(set(ordered.values())) < len(ordered):
        raise InputError(f"two of the channels {', '.join(ordered)} have one wavelength; allowed: one each; remove one")
    return "T" in kinds, ordered


def _to_nm(name: str, match: re.Match[str]) -> float:
    """Read the wavelength in a channel's name; the layout's other units are refused."""
    _, number, unit = match.groups()
    try:
        nm = float(number.replace(",", "."))
    except ValueError:
        nm = np.nan
    if unit != "nm" or not 0 < nm < np.inf:
        raise InputError(f"channel {name!r} has no wavelength in nm; allowed: names such as S0.550,0nm; rename it")
    return nm


def write_pairs(first: Floats, second: Floats) -> str:
    """Write pairs of numbers, such as centres and widths of bands, as text that reads back to the same float64."""
    return ";".join(f"{a!r}:{b!r}" for a, b in zip(first.tolist(), second.tolist(), strict=True))


def read_bands(channels: Mapping[str, float], header: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Return the band centres and widths [nm] of a file's spectral channels.

    They are those of rodcone's own attribute, if it fits the channels. Otherwise `bands_between` derives them from the
    wavelengths in the names. A `UserWarning` names what has to be assumed.

    Raises
    ------
    InputError
        For a single band without a stated width.
    """
    stated = header.get(BANDS)
    if stated is not None:
        bands = _parsed(str(stated))
        if bands is not None and [channel_name(centre) for centre in bands[0]] == list(channels):
            return bands
        warnings.warn(f"the attribute {BANDS} doesn't fit the channels and is left aside", stacklevel=3)
    nm = np.array(list(channels.values()))
    if nm.size == 1:
        raise InputError(
            f"one band at {nm[0]:g} nm has no width; allowed: two bands or more, or the attribute {BANDS}; "
            f"add it, such as '{nm[0]:.1f}:10.0'"
        )
    return bands_between(nm)


def _parsed(text: str) -> tuple[Floats, Floats] | None:
    """Parse centres and widths; return None for text of another form."""
    try:
        centres, widths = _pairs(text)
        return centres, band_widths(centres, widths)
    except ValueError:  # InputError is one
        return None


def _pairs(text: str) -> tuple[Floats, Floats]:
    first, second = np.array([[float(part) for part in pair.split(":")] for pair in text.split(";")]).T
    return first, second


def _lamp(header: Mapping[str, Any]) -> Spectrum | None:
    """Return the lamp that the header states, or None; warn (`UserWarning`) of text that is no spectrum."""
    if LAMP not in header:
        return None
    try:
        lamp = Spectrum(*_pairs(str(header[LAMP])))
    except ValueError:
        lamp = None
    if lamp is None or not lamp.values.any():
        warnings.warn(f"the attribute {LAMP} is no spectrum and is left aside", stacklevel=3)
        return None
    return lamp


def check_units(header: Mapping[str, Any], channels: Iterable[str]) -> None:
    """Raise `InputError` for units that aren't spectral radiance; a `UserWarning` names what is assumed."""
    stated = header.get(OWN_UNITS, header.get(UNITS))
    if stated is None:
        warnings.warn(f"it states no {UNITS}: {TRUE_UNITS} is assumed", stacklevel=3)
    elif stated not in (LAYOUT_UNITS, TRUE_UNITS):
        raise InputError(f"its units are {stated!r}; allowed: {LAYOUT_UNITS} or {TRUE_UNITS}; convert it")
    present = [name for name in (*_MEASUREMENT, *channels) if name in header]
    if present:
        warnings.warn(f"the camera described by {', '.join(present)} is not undone", stacklevel=3)


ERROR, SCENE, PREVIEW = "rodconeRelativeMcError", "rodconeScene", "rodconePreview"
PREVIEW_PERCENTILE, PREVIEW_AT = 99.0, 0.9
PREVIEW_TEXT = (
    "R, G, B: linear sRGB (Rec. 709, D65) of CIE 1931 XYZ, cut at 0 and 65504, not adapted to the light; "
    "1 is whiteLuminance cd/m^2, of which the 99th percentile of luminance reaches 0.9"
)
_MAGIC = b"\x76\x2f\x31\x01"
_HALF_MAX = 65504.0
_FLOAT = np.finfo(np.float32)
MOST_ASPECT = 1e-3  # largest difference from 1 of a pixel's width over its height
MOST_TILE_BYTES = 64 << 20  # largest size of one tile in any file: 1024 x 1024 pixels in 16 channels


def write_exr(radiance: SpectralRadiance, path: str | Path, *, scene: str = "") -> None:
    """Write radiance as a spectral OpenEXR file; it appears whole or not at all.

    Channels are float32 with lossless PIZ compression. Half floats aren't used, because absolute radiance at night is
    below their smallest number. Radiance in float32, band centres, widths and the lamp read back bit by bit.

    Parameters
    ----------
    radiance : SpectralRadiance
        Values of float64 are rounded to float32: those under 1e-45 become 0.
    path : path
    scene : str
        Name to keep with the picture.

    Raises
    ------
    InputError
        For a value over float32's 3.4e38, a wavelength outside 1-9999 nm, or centres less than 1e-6 nm apart.
    OSError
        Where the file can't be written.
    """
    path = Path(path)
    if radiance.values.max() > _FLOAT.max:
        raise InputError(f"{path}: radiance {radiance.values.max():g} is over float32's {_FLOAT.max:g}; scale it down")
    names = [channel_name(nm) for nm in radiance.wavelength_nm]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: band centres less than 1e-6 nm apart have no names of their own; merge those bands")
    preview, white_cd_m2 = _preview(radiance)
    lamp = radiance.light  # a constant spectrum isn't written, because coloured light has it too, and it has no lines
    channels = {name: np.ascontiguousarray(radiance.values[:, :, k], np.float32) for k, name in enumerate(names)}
    channels |= dict(zip("RGB", preview, strict=True))
    header = {
        "compression": OpenEXR.PIZ_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "spectralLayoutVersion": VERSION,
        UNITS: LAYOUT_UNITS,
        OWN_UNITS: TRUE_UNITS,
        BANDS: write_pairs(radiance.wavelength_nm, radiance.widths_nm),
        ERROR: repr(float(radiance.relative_mc_error)),
        "whiteLuminance": white_cd_m2,
        PREVIEW: PREVIEW_TEXT,
        **({SCENE: scene} if scene else {}),
        **(
            {LAMP: write_pairs(lamp.wavelength_nm, lamp.values)} if lamp is not None and np.ptp(lamp.values) > 0 else {}
        ),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as (place,):
        try:
            OpenEXR.File(header, channels).write(str(place))
        except RuntimeError as error:
            raise OSError(errno.EIO, one_line(error), str(path)) from error


def _preview(radiance: SpectralRadiance) -> tuple[NDArray[np.float32], float]:
    """Return linear sRGB (3, h, w), and the luminance [cd m^-2] at which it is 1."""
    xyz = tristimulus(radiance.values, radiance.wavelength_nm, radiance.widths_nm, radiance.light)
    white = float(np.percentile(xyz[:, :, 1], PREVIEW_PERCENTILE)) / PREVIEW_AT or 1.0
    white = float(np.clip(white, _FLOAT.tiny, _FLOAT.max))
    preview = np.empty((3, *radiance.shape), np.float32)
    for rows in row_blocks(radiance.shape):
        preview[:, rows] = np.moveaxis(np.clip(xyz[rows] / white @ XYZ_TO_SRGB_ROUNDED.T, 0.0, _HALF_MAX), -1, 0)
    return preview, white


def exr_holds_reflectance(path: str | Path) -> bool:
    """Return whether a spectral OpenEXR file holds reflectances, by its header.

    Raises
    ------
    InputError
        As `read_exr` for a file that holds no spectral picture.
    """
    require_file(Path(path))
    with in_place(str(path)), _damage():
        header = _part(Path(path), header_only=True).header
        return spectral_channels(channel.name for channel in header["channels"])[0]


def read_exr_lamp(path: str | Path) -> Spectrum | None:
    """Return the lamp behind a file of radiance, scaled to 1 cd/m^2; None if it states none.

    Raises
    ------
    InputError
        As `read_exr` for a file that is no OpenEXR.
    """
    require_file(Path(path))
    with in_place(str(path)), _damage():
        header = _part(Path(path), header_only=True).header
        reflectance, _ = spectral_channels(channel.name for channel in header["channels"])
        lamp = None if reflectance else _lamp(header)
    return None if lamp is None else unit_luminance(lamp)


def read_exr(path: str | Path) -> SpectralRadiance:
    """Read a spectral OpenEXR file of any program; reflectances are returned as the values of a `SpectralRadiance`.

    S0 or T channels may stand in any order, in half or float, with or without a preview. A `UserWarning` names what has
    to be assumed. Polarisation (S1 to S3) is left out, because S0 is the radiance. If the picture is smaller than its
    frame, only the part that it fills is read.

    Parameters
    ----------
    path : path
        File of at most 32768 pixels a side, 4096 channels and 8 GiB of pixels.

    Returns
    -------
    SpectralRadiance
        float32, (h, w, band) over band-planar memory.

    Raises
    ------
    InputError
        If there is no file, or no spectral OpenEXR in it; if it holds both radiance and reflectance, deep data, several
        parts, subsampled channels, pixels that aren't square, or an environment map; if over 1 % of its reflectances
        exceed 1, its size exceeds the limits, it is damaged, or a value is negative or not finite.
    """
    path = Path(path)
    size = require_file(path)
    with in_place(str(path)), _damage():
        header = _part(path, header_only=True).header
        reflectance, bands = spectral_channels(channel.name for channel in header["channels"])
        require_known("OpenEXR attribute", {key: header[key] for key in header if key not in bands})
        _check_geometry(header)
        if not reflectance:
            check_units(header, bands)
        centres, widths = read_bands(bands, header)
        error = float(header.get(ERROR, 0.0))
        height, width = _extent(header, size)
        planes = _planes(path, list(bands), (height, width))
        values = np.moveaxis(planes, 0, -1)
        if reflectance:
            require_reflectances(values)
        lamp = None if reflectance else _lamp(header)
        return SpectralRadiance(values, wavelength_nm=centres, relative_mc_error=error, width_nm=widths, light=lamp)


def _damage() -> AbstractContextManager[None]:
    return read_errors("its header is damaged", "save it again", (KeyError, TypeError, ValueError, OverflowError))


def _check_geometry(header: Mapping[str, Any]) -> None:
    """Raise `InputError` for a picture that isn't flat or has no square pixels."""
    aspect = float(header.get("pixelAspectRatio", 1.0))
    if abs(aspect - 1.0) > MOST_ASPECT:
        raise InputError(f"pixelAspectRatio: {aspect:g} is not allowed; give square pixels, 1; scale it")
    if "envmap" in header:
        raise InputError("envmap: it is an environment map, of all directions; allowed: a picture; render one with it")


def _extent(header: dict[str, Any], file_bytes: int) -> tuple[int, int]:
    """Return height and width, or raise `InputError` if all channels would need more memory than is allowed."""
    kind, channels = header["type"], header["channels"]
    if kind not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise InputError(f"it holds deep data ({kind}); allowed: one value a pixel; flatten it")
    if any((channel.xSampling, channel.ySampling) != (1, 1) for channel in channels):
        raise InputError("it has subsampled channels; allowed: a value for every pixel; save it at full resolution")
    (left, top), (right, bottom) = ([int(n) for n in corner] for corner in header["dataWindow"])
    height, width = bottom - top + 1, right - left + 1
    require_extent(height, width, len(channels), file_bytes)
    if kind == OpenEXR.tiledimage:  # the library allocates a whole tile, however small the picture
        across, down = int(header["tiles"].xSize), int(header["tiles"].ySize)
        if across * down * len(channels) * _FLOAT.dtype.itemsize > max(MOST_TILE_BYTES, MOST_EXPANSION * file_bytes):
            raise InputError(f"its tiles have {across} x {down} pixels, far more than it holds; save it again")
    return height, width


def _planes(path: Path, names: list[str], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Read the pixels of the named channels, shape (band, h, w)."""
    channels = _part(path, header_only=False).channels
    planes = np.empty((len(names), *shape), dtype=np.float32)
    for plane, name in zip(planes, names, strict=True):
        pixels = channels.pop(name).pixels  # removed, so that its memory is freed
        if pixels.dtype not in (np.float16, np.float32) or pixels.shape != shape:
            raise InputError(
                f"channel {name!r} is {pixels.dtype} of {pixels.shape}; allowed: half or float; convert it"
            )
        plane[:] = pixels
    return planes


def _part(path: Path, *, header_only: bool) -> Any:
    """Read the file's single part. The library raises errors of many types, or prints one and returns no part."""
    with path.open("rb") as file:
        if file.read(4) != _MAGIC:
            raise InputError("it is no OpenEXR file; allowed: spectral OpenEXR; convert it")
    said = io.StringIO()
    failure = read_errors("OpenEXR can't read it", "save it again", Exception)
    with failure, contextlib.redirect_stdout(said):
        parts = OpenEXR.File(str(path), separate_channels=True, header_only=header_only).parts
    if not parts:  # printed as "Warning: ... for part 0 - reason"
        reason = " ".join(said.getvalue().rpartition(" - ")[2].split())
        raise InputError(f"OpenEXR can't read it ({reason}); save it again")
    if len(parts) > 1:
        raise InputError(f"it has {len(parts)} parts; allowed: one; save the spectral one by itself")
    return parts[0]
