"""Photographs of real cameras as raw images: any Bayer raw that LibRaw reads (extra `photographs`, library `rawpy`).

A raw image has one black level, one white level and a noise model in electrons. A camera's file has a black level for
each channel, and says nothing about noise unless it is a digital negative with the tag NoiseProfile (DNG 1.4
specification, tag 51041).
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance_files.file_checks import require_file
from rodcone.colour_spaces import D50_XYZ, SRGB_TO_XYZ, adapt_to_d65
from rodcone.errors import InputError, one_line
from rodcone.optional import optional_library
from rodcone.types import Floats
from sensor.calibration import ColourCalibration
from sensor.cfa import channel_map, is_bayer
from sensor.raw import RawImage
from sensor.raw_files.dng_levels import directories, dng_levels
from sensor.raw_files.noise_estimate import NoiseEstimate, estimate_noise

NOISE_PROFILE = 51041


def read_noise_profile(path: Path, full_dn: float) -> NoiseEstimate | None:
    """Read gain and dark noise from the noise profile; None if the file has none, or one that is out of range.

    The profile states the variance S x + O of a signal x from black (0) to white (1). So the full scale is 1 / S
    electrons, and the standard deviation of a dark pixel is sqrt(O) of the full scale. If a file states S and O per
    channel, their means are taken.

    Parameters
    ----------
    full_dn : float
        White level above black [DN].
    """
    values = _profile(path)
    if values.size < 2 or values.size % 2 or not np.all(np.isfinite(values)):
        return None
    with np.errstate(over="ignore"):
        slope, offset = values.reshape(-1, 2).mean(axis=0)
    if not (1e-9 < slope < 1.0 and 0.0 <= offset < 1.0):
        return None
    return NoiseEstimate(float(1.0 / slope / full_dn), float(np.sqrt(offset) / slope))


def _profile(path: Path) -> Floats:
    """Read the NoiseProfile tag of the first picture in the file that has one; empty if none has."""
    for tags in directories(path, (NOISE_PROFILE,)):
        form, values = tags.get(NOISE_PROFILE, ("", ()))
        if form == "d":
            return np.array(values)
    return np.empty(0)


EXTRA = "photographs"
# What is assumed where neither the file nor the frame tells: a pixel of a present-day camera.
ASSUMED_FULL_WELL_E, ASSUMED_DARK_NOISE_E = 30_000.0, 3.0
MOST_DN = 65_535  # of 16-bit samples
# Of a file's bytes, at 2 a pixel. Lossless JPEG spends a bit or more on a pixel: it swells 16 times at most.
MOST_EXPANSION = 200
# Linear sRGB to XYZ adapted to D50.
_SRGB_TO_D50 = np.linalg.inv(adapt_to_d65(np.eye(3), D50_XYZ).T) @ SRGB_TO_XYZ


def read_photograph(path: Path) -> tuple[RawImage, dict[str, Any]]:
    """Read a camera's raw file and turn it upright; also return what had to be estimated or assumed.

    Returns
    -------
    RawImage
        It has one black level, the largest in the file; samples with a lower one are shifted up. A digital negative's
        own tags state black for each row and column; for other files LibRaw states it for each channel. Both
        illuminants of the calibration have the same matrix, LibRaw's for the camera in daylight.
    dict
        ``reader``; ``noise``: where gain and dark noise come from (``profile of the file``, ``estimated from the
        frame`` or ``assumed``); ``gain_e_per_dn``, ``dark_noise_e``; ``as_shot``: ``file``, ``daylight`` where the file
        has no balance, or ``none``; ``colour_matrix``: ``LibRaw``, or ``none`` where the camera's own colours are
        taken for sRGB.

    Raises
    ------
    InputError
        Without `rawpy`, for a file that LibRaw can't read, or a mosaic that isn't Bayer.
    """
    rawpy = optional_library("rawpy", EXTRA)
    size = require_file(path)
    try:
        with rawpy.imread(str(path)) as opened:
            # A header may claim more pixels than its file can hold, and LibRaw would allocate memory for all of them.
            height, width = int(opened.sizes.raw_height), int(opened.sizes.raw_width)
            if 2 * height * width > MOST_EXPANSION * size:
                raise InputError(f"{path}: {size} bytes can't hold the {height} x {width} pixels that it declares")
            return _raw_image(opened, path, f"LibRaw {'.'.join(map(str, rawpy.libraw_version))}")
    except (rawpy.LibRawError, rawpy.NotSupportedError) as error:
        first = error.args[0] if error.args else ""
        reason = " ".join((first.decode("utf-8", "replace") if isinstance(first, bytes) else str(first)).split())
        raise InputError(
            f"{path}: LibRaw can't read it ({reason}); allowed: raw files of cameras that LibRaw knows, or of rodcone"
        ) from None
    except InputError:
        raise
    except (ValueError, TypeError, IndexError, OverflowError, NotImplementedError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"{path}: what LibRaw reads of it is no photograph ({one_line(error)}); it is damaged, copy it again"
        ) from error


def _raw_image(opened: Any, path: Path, reader: str) -> tuple[RawImage, dict[str, Any]]:
    # mosaic
    if opened.raw_image is None or opened.raw_image_visible.ndim != 2:
        raise InputError(f"{path}: it holds no mosaic, but whole pixels; allowed: Bayer raw files; take another file")
    names = opened.color_desc.decode("ascii", "replace")
    indices = np.asarray(opened.raw_colors_visible)
    levels = dng_levels(path, opened.raw_image.shape)  # a library moves margins, and the pattern's phase with them
    samples = opened.raw_image_visible
    if levels is not None:
        indices = np.asarray(opened.raw_colors)[levels.area]
        samples = opened.raw_image[levels.area]
    if names != "RGBG" or indices.max() > 3:
        raise InputError(f"{path}: its colours are {names!r}; allowed: Bayer's R, G and B; take another file")
    colours = np.array(list(names))[indices]
    if levels is not None and np.any(channel_map(levels.tile, samples.shape) != colours):
        raise InputError(
            f"{path}: its CFAPattern is {levels.tile}, LibRaw reads {tuple(''.join(row[:2]) for row in colours[:2])}; "
            "allowed: files that both read alike; save it anew with a DNG converter"
        )
    sites = _turned(colours, opened.sizes.flip)
    tile = tuple("".join(row[:2]) for row in sites[:2])
    if not is_bayer(tile) or np.any(channel_map(tile, (sites.shape[0], sites.shape[1])) != sites):
        raise InputError(
            f"{path}: its mosaic begins with {tuple(''.join(row[:6]) for row in sites[:2])} and is not Bayer's; "
            "allowed: Bayer raw files, no X-Trans; take another file"
        )

    # levels
    of_channels = np.array(opened.black_level_per_channel, dtype=np.float64)
    black = of_channels[indices] if levels is None else levels.black_dn  # of each pixel [DN]
    white = float(opened.white_level if levels is None or levels.white_dn is None else levels.white_dn)
    top = float(np.ceil(black.max()))
    if not 0 <= top < white <= MOST_DN:
        raise InputError(f"{path}: black {black.max():g} is not under white {white:g}; it is damaged or no photograph")
    dn = np.clip(samples + np.rint(top - black), 0, white)  # at most half a DN off, where black has a fraction
    upright = _turned(dn.astype(np.uint16), opened.sizes.flip)

    # noise and colours
    full_dn = white - top
    noise = read_noise_profile(path, full_dn)
    source = "profile of the file"
    if noise is None:
        noise = estimate_noise(upright.astype(np.float64) - top, full_dn)
        source = "estimated from the frame"
    if noise is None:
        noise = NoiseEstimate(ASSUMED_FULL_WELL_E / full_dn, ASSUMED_DARK_NOISE_E)
        source = "assumed"
    colour, facts = _colour(opened)
    raw = RawImage(
        dn=upright,
        cfa=tile,
        black_dn=top,
        white_dn=white,
        gain_e_per_dn=noise.gain_e_per_dn,
        read_noise_e=noise.dark_noise_e,
        dsnu_e=0.0,
        prnu=0.0,
        exposure_s=float(opened.other.shutter_speed),
        camera="photograph",
        f_number=_positive(opened.other.aperture, 0.1),
        iso=_positive(opened.other.iso_speed, 1.0),
        colour=colour,
    )
    told = {"noise": source, "gain_e_per_dn": noise.gain_e_per_dn, "dark_noise_e": raw.dark_noise_e}
    return raw, {"reader": reader, **told, **facts}


def _turned(frame: NDArray[Any], flip: int) -> NDArray[Any]:
    """Turn a frame upright. LibRaw's `flip`: 1 mirrors the columns, 2 the rows, 4 then swaps the two."""
    rows, columns = (slice(None, None, -1 if flip & bit else 1) for bit in (2, 1))
    turned = frame[rows, columns]
    return np.ascontiguousarray(turned.T if flip & 4 else turned)


def _colour(opened: Any) -> tuple[ColourCalibration, dict[str, str]]:
    """Return the colour calibration from LibRaw's matrix and white balance, and where these stem from.

    The matrix leads from the camera's channels to sRGB, for daylight; the balance is the as-shot one if it is known.
    """
    matrix = np.array(opened.color_matrix, dtype=np.float64)[:, :3]
    sums = matrix.sum(axis=1, keepdims=True)
    regular = bool(np.all(np.isfinite(matrix)) and np.all(sums > 0) and np.linalg.cond(matrix) < 1e6)
    to_srgb = matrix / sums if regular and not np.array_equal(matrix, np.eye(3)) else np.eye(3)
    daylight = _neutral(opened.daylight_whitebalance)
    shot = _neutral(opened.camera_whitebalance)
    neutral = shot if shot is not None else daylight if daylight is not None else np.ones(3)
    from_xyz = np.linalg.inv(SRGB_TO_XYZ @ to_srgb) * (neutral if daylight is None else daylight)[:, None]
    back = _SRGB_TO_D50 @ to_srgb
    facts = {
        "as_shot": "file" if shot is not None else "daylight" if daylight is not None else "none",
        "colour_matrix": "none" if np.array_equal(to_srgb, np.eye(3)) else "LibRaw",
    }
    calibration = ColourCalibration(
        neutral=neutral,
        to_srgb=to_srgb,
        xyz_to_camera_a=from_xyz,
        xyz_to_camera_d65=from_xyz,
        camera_to_xyz_a=back,
        camera_to_xyz_d65=back,
    )
    return calibration, facts


def _neutral(gains: Any) -> Floats | None:
    """Return R, G and B of a neutral, green 1, from white balance factors; None where these aren't known."""
    factors = np.array(gains[:3], dtype=np.float64)
    if factors.shape != (3,) or not np.all(np.isfinite(factors) & (factors > 0)):
        return None
    return np.asarray(factors[1] / factors)


def _positive(value: float, least: float) -> float | None:
    return float(value) if np.isfinite(value) and value >= least else None
