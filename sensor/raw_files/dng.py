"""A Bayer or RGBW mosaic, 2x2 or quad, as a digital negative: DNG 1.4, uncompressed, one CFA image.

Samples are whole numbers of 16 bits, or single-precision floats. Floats are multiplied by a power of two, which loses
nothing, so that the white level lies between 32 768 and 65 535: converters take levels of 16 bits alone.

Tags and their meaning: Adobe, "Digital Negative (DNG) Specification", version 1.4.0.0, 2012. What they can't hold
exactly (most have rationals of 32 bits) is repeated in DNGPrivateData, as JSON behind ``rodcone`` and a zero byte.
Reading takes the calibration from there, and refuses a file whose public levels and mosaic disagree with it.
"""

import struct
from dataclasses import replace
from datetime import datetime
from fractions import Fraction
from math import ceil, isclose, log2
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rodcone.errors import InputError
from rodcone.files import replacing
from sensor.cfa import Tile, is_bayer, is_rgbw, plain
from sensor.raw import RawImage
from sensor.raw_files.brightness import stops_to_white
from sensor.raw_files.raw_json import parse_json, raw_image, raw_to_json
from sensor.raw_files.tiff import (
    CFA,
    COMPRESSION,
    EXIF,
    STRIP_OFFSETS,
    Tags,
    Values,
    read_mosaic,
    read_tags,
    text,
    write_mosaic,
)

PRIVATE = b"rodcone\0"
PRIVATE_DATA = 50740
MAKER = 271
MAKE = "rodcone"
CFA_REPEAT, CFA_PATTERN, BLACK_LEVEL, WHITE_LEVEL = 33421, 33422, 50714, 50717
OPCODES = 51008  # OpcodeList1: what is done to the samples as read
EXPOSURE_TIME, F_NUMBER, ISO = 33434, 33437, 34855
BASELINE_EXPOSURE, IMAGE_NUMBER = 50730, 37393
LEAST_BYTES = 100_000  # RawTherapee 5.9 doesn't accept a smaller file as a raw file
CROPPED_PX = 2  # pixels cropped on each side for interpolation; Adobe's DNG SDK warns of fewer
_COMPARED = {
    CFA_REPEAT: "CFARepeatPatternDim",
    CFA_PATTERN: "CFAPattern",
    BLACK_LEVEL: "BlackLevel",
    WHITE_LEVEL: "WhiteLevel",
    OPCODES: "OpcodeList1",
    EXPOSURE_TIME: "ExposureTime",
    F_NUMBER: "FNumber",
    ISO: "PhotographicSensitivity",
}
_NEAR = {EXPOSURE_TIME: 0.1, F_NUMBER: 0.05}  # relative differences: Adobe's writer rounds to values marked on cameras
_COLOURS = {"R": 0, "G": 1, "B": 2, "W": 6}  # numbers of CFAPattern and CFAPlaneColor; 6 is white
_ILLUMINANT_A, _ILLUMINANT_D65 = 17, 21  # EXIF LightSource
_LARGEST = 2**31 - 1  # largest numerator and denominator of a rational


def write_dng(raw: RawImage, path: Path, *, frame: int | None = None, written: datetime | None = None) -> Path:
    """Write a digital negative, and return its path.

    LibRaw, and programs built on it, open frames whose sides have at least 22 pixels. BlackLevel is a whole number,
    because raw converters truncate fractions; `read_dng` restores the exact one.

    Parameters
    ----------
    raw : RawImage
    path : Path
    frame : int, optional
        Number of the exposure in a burst (ImageNumber).
    written : datetime, optional
        Date that is written into the file; by default the present time.

    Raises
    ------
    InputError
        For another mosaic, a camera without colour calibration, or levels that DNG can't hold.
    OSError
        Where the folder is missing or can't be written.
    """
    tags = dng_tags(raw)
    moment = _moment_tags(written or datetime.now(), frame)
    dn = raw.dn * np.float32(_sample_scale(raw)) if raw.dn.dtype.kind == "f" else raw.dn
    with replacing(path) as (part,):
        write_mosaic(part, dn, CFA, tags, {**exif_tags(raw), **moment}, LEAST_BYTES)
    return path


def read_dng(path: Path) -> RawImage:
    """Read a digital negative that `write_dng` wrote, or that Adobe's converter made of one without compression.

    Raises
    ------
    InputError
        For a file that is missing, damaged, of another camera, or was changed since.
    """
    dn, tags = read_mosaic(path, CFA, (PRIVATE_DATA, EXIF, *_COMPARED))
    _, content = tags.get(PRIVATE_DATA, ("B", b""))
    if not isinstance(content, bytes) or not content.startswith(PRIVATE):
        raise InputError(
            f"{path}: its DNGPrivateData holds no calibration in electrons; allowed: files that `rodcone capture` wrote"
        )
    raw = raw_image(parse_json(content[len(PRIVATE) :], str(path)), dn, str(path))
    if not is_in_dng(raw.cfa):
        raise InputError(f"{path}: its calibration has the mosaic {raw.cfa}; allowed: an unchanged file; write it anew")
    # Files of version 0.1 have floats without a scale, and a BlackLevel with a fraction.
    earlier: dict[int, list[tuple[str, Values]]] = {
        BLACK_LEVEL: [("2I", rational(raw.black_dn)), ("2I", rational(round(raw.black_dn)))],
        WHITE_LEVEL: [("I", (int(raw.white_dn),))],
    }
    expected = {**dng_tags(raw), **exif_tags(raw)}
    for code, name in _COMPARED.items():
        of_file = tags.get(code)
        allowed = [expected.get(code), *earlier.get(code, [])]
        if not any(_agree(of_file, each, _NEAR.get(code, 1e-6)) for each in allowed):
            stated, right = ("missing" if x is None else tuple(x[1][:8]) for x in (of_file, allowed[0]))
            raise InputError(
                f"{path}: {name} is {stated}, the calibration says {right}; allowed: an unchanged file; write it anew"
            )
    scaled = dn.dtype.kind == "f" and _agree(tags.get(WHITE_LEVEL), expected[WHITE_LEVEL])
    exact: Any = dn / np.float32(_sample_scale(raw)) if scaled else dn
    return replace(raw, dn=exact)


def _agree(one: tuple[str, Values] | None, other: tuple[str, Values] | None, relative: float = 1e-6) -> bool:
    """Return whether two tags are equal, rationals within a relative difference."""
    if one is None or other is None or "2I" not in (one[0], other[0]):
        return (one and one[1]) == (other and other[1])
    (a, b), (c, d) = (tuple(x[1]) if len(x[1]) == 2 else (0, 0) for x in (one, other))
    return b > 0 and d > 0 and isclose(a / b, c / d, rel_tol=relative, abs_tol=1e-9)


def _sample_scale(raw: RawImage) -> float:
    """Return the power of two by which floats are multiplied in the file."""
    return 2.0 ** -ceil(log2(max(raw.white_dn, 1.0) / 65_535)) if raw.dn.dtype.kind == "f" else 1.0


def is_in_dng(tile: Tile) -> bool:
    """Return whether a mosaic can be written as DNG: Bayer, 2x2 RGBW, or one of these with 2x2 pixels for each."""
    return is_bayer(plain(tile)) or is_rgbw(plain(tile))


def is_own(path: Path) -> bool:
    """Return whether a file is a mosaic that rodcone wrote with `write_dng`: uncompressed, in strips.

    One that another program has compressed since then is read by LibRaw instead.
    """
    try:
        with path.open("rb") as file:
            tags = read_tags(file, (MAKER, COMPRESSION, STRIP_OFFSETS), str(path))
            plain_strips = tags.get(COMPRESSION, ("", ()))[1] == (1,) and STRIP_OFFSETS in tags
            return tags.get(MAKER) == text(MAKE) and plain_strips
    except (InputError, OSError):
        return False


def dng_tags(raw: RawImage) -> Tags:
    """Return the tags of the first directory, without those that describe the TIFF itself.

    NoiseProfile is N(x)^2 = S x + O for x from black (0) to white (1), the same for all channels unless some are read
    with a time, density or gain of their own. S is the shot noise, 1 / full scale in electrons, with what the columns'
    gains make of light beside dark current; O is the dark noise; PRNU grows with x^2 and doesn't fit the form.
    LinearResponseLimit is where the well begins to clip (`RawImage.saturation_e`). WhiteLevel is one for all channels:
    converters clip what a channel of its own time, density or gain holds beyond it. BaselineExposure is
    `stops_to_white`, less what converters brighten already, because they scale the channel that responds most to a
    neutral to 1, whereas rodcone scales green to 1.

    Raises
    ------
    InputError
        For another mosaic, a camera without colour calibration, or levels that DNG can't hold.
    """
    if raw.colour is None:
        raise InputError("colour: the raw image holds no colour calibration, which a DNG needs; write a .tif instead")
    if raw.black_dn < 0 or raw.white_dn != int(raw.white_dn):
        raise InputError(
            f"levels: black {raw.black_dn!r} and white {raw.white_dn!r} don't fit a DNG; "
            "allowed: black of 0 or more, a whole white; write a .tif instead"
        )
    colour, (height, width) = raw.colour, raw.shape
    scale = _sample_scale(raw)
    is_float = raw.dn.dtype.kind == "f"
    tags: dict[int, tuple[str, Values]] = {
        254: ("I", (0,)),  # NewSubfileType: the full picture
        MAKER: text(MAKE),
        272: text(raw.camera),
        274: ("H", (1,)),  # Orientation: upright
        CFA_REPEAT: ("H", (len(raw.cfa), len(raw.cfa[0]))),
        CFA_PATTERN: ("B", bytes(_COLOURS[channel] for row in raw.cfa for channel in row)),
        50706: ("B", bytes((1, 4, 0, 0))),  # DNGVersion
        # DNGBackwardVersion: all that is newer may be skipped, but for floating point.
        50707: ("B", bytes((1, 4 if is_float else 1, 0, 0))),
        50708: text(f"rodcone {raw.camera}"),  # UniqueCameraModel
        50710: ("B", bytes(_COLOURS[channel] for channel in raw.channels)),  # CFAPlaneColor
        50711: ("H", (1,)),  # CFALayout: a rectangle
        BLACK_LEVEL: ("2I", rational(round(raw.black_dn * scale))),
        WHITE_LEVEL: ("I", (round(raw.white_dn * scale),)),
        BASELINE_EXPOSURE: ("2i", rational(stops_to_white(raw) - log2(colour.neutral.max()))),
        50728: ("2I", rational(colour.neutral / colour.neutral.max())),  # AsShotNeutral
        50721: ("2i", rational(colour.xyz_to_camera_a)),  # ColorMatrix1, for illuminant A
        50722: ("2i", rational(colour.xyz_to_camera_d65)),  # ColorMatrix2, for D65
        50778: ("H", (_ILLUMINANT_A,)),  # CalibrationIlluminant1
        50779: ("H", (_ILLUMINANT_D65,)),  # CalibrationIlluminant2
        50964: ("2i", rational(colour.camera_to_xyz_a)),  # ForwardMatrix1
        50965: ("2i", rational(colour.camera_to_xyz_d65)),  # ForwardMatrix2
        50734: ("2I", rational(min(max(raw.saturation_e / raw.full_well_e, 0.0), 1.0))),  # LinearResponseLimit
        50829: ("I", (0, 0, height, width)),  # ActiveArea
        51041: ("d", _noise_profile(raw)),  # NoiseProfile
    }
    if min(height, width) > 2 * CROPPED_PX:
        tags[50719] = ("I", (CROPPED_PX, CROPPED_PX))  # DefaultCropOrigin: column, row
        tags[50720] = ("I", (width - 2 * CROPPED_PX, height - 2 * CROPPED_PX))  # DefaultCropSize
    if colour.neutral.size == 4:  # a fourth plane asks for a way back to three: W carries no colour here
        tags |= dict.fromkeys((50725, 50726), ("2i", rational(np.eye(3, 4))))  # ReductionMatrix1, 2
    if raw.defects is not None and is_bayer(raw.cfa):
        # Opcode FixBadPixelsList of DNG 1.3, chapter 6: big-endian, optional for readers; for Bayer only.
        phase = ("RG", "GR", "GB", "BG").index(raw.cfa[0])
        parameters = struct.pack(">3I", phase, len(raw.defects), 0) + raw.defects.astype(">u4").tobytes()
        tags[OPCODES] = ("U", struct.pack(">IIIII", 1, 5, 0x01030000, 1, len(parameters)) + parameters)
    tags[PRIVATE_DATA] = ("B", PRIVATE + raw_to_json(raw).encode("ascii"))
    return dict(sorted(tags.items()))


def _noise_profile(raw: RawImage) -> tuple[float, ...]:
    """Return S and O of `dng_tags`: one pair for all channels, or one per channel if some have noise of their own."""
    noise = [raw.noise_of(name) for name in raw.channels[: None if raw.channel_noise else 1]]
    full_e = raw.full_well_e
    return tuple(part for x in noise for part in (x.shot / full_e, (x.dark_noise_e / full_e) ** 2))


def exif_tags(raw: RawImage) -> Tags:
    """Return the tags of the exposure (Exif 2.3, CIPA DC-008)."""
    tags: dict[int, tuple[str, Values]] = {
        EXPOSURE_TIME: ("2I", rational(raw.exposure_s)),
        36864: ("U", b"0230"),  # ExifVersion
    }
    if raw.f_number is not None:
        tags[F_NUMBER] = ("2I", rational(raw.f_number))
    if raw.iso is not None:
        tags[ISO] = ("H", (min(max(round(raw.iso), 1), 65_535),))
    return tags


def _moment_tags(written: datetime, frame: int | None) -> Tags:
    """Return the tags of the exposure's number in a burst, and of its date, taken as the time of writing."""
    date = written.strftime("%Y:%m:%d %H:%M:%S")
    tags: dict[int, tuple[str, Values]] = {
        36867: text(date),  # DateTimeOriginal
        36868: text(date),  # DateTimeDigitized
        37521: text(f"{written.microsecond // 1000:03d}"),  # SubSecTimeOriginal
    }
    if frame is not None:
        tags[IMAGE_NUMBER] = ("I", (frame,))
    return tags


def rational(values: ArrayLike) -> Values:
    """Return numerators and denominators of the nearest fractions that fit 32 bits, row by row."""
    pairs: list[int] = []
    for value in np.ravel(np.asarray(values, dtype=np.float64)):
        nearest = Fraction(float(value)).limit_denominator(max(int(_LARGEST / max(abs(value), 1.0)), 1))
        pairs += [nearest.numerator, nearest.denominator]
    return tuple(pairs)
