"""A raw file developed into a picture for the screen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.colour.calibrated_colours import fit_of_calibration, neutral_under
from isp.colour.encoding import encode
from isp.crosstalk import is_undone
from isp.picture import Picture
from isp.processors.catalogue import default_processor
from isp.processors.own import processor_of, require_consent
from render.illuminants import illuminant
from rodcone.display import brief
from rodcone.errors import InputError, require_range, unknown
from rodcone.types import Floats
from sensor.burst import merged_raw
from sensor.calibration import ColourCalibration
from sensor.raw import RawImage
from sensor.raw_files.brightness import stops_to_white
from sensor.raw_files.raw_file import open_raw
from studies.study.scene_source import asked_size
from studies.study.study import AS_SHOT, WHITE_BALANCES, default_balance

# Broad lights, whose neutral a raw file's matrices for A and D65 predict well: for the presets within 1 % in R, G and B
# and within 6 % in W. Under lamps with emission bands B is up to 26 % off, and W by a factor of two.
BROAD = ("A", "D50", "D55", "D65", "D75", "moonlight", "sunlight")


@dataclass(frozen=True)
class Developed:
    """Encoded picture (h, w, 3) in [0, 1], and facts for JSON: the raw file's, and the settings of its development."""

    encoded: NDArray[np.float64]
    facts: dict[str, Any]

    __repr__ = brief


def develop(
    raw: RawImage,
    calibration: ColourCalibration | None = None,
    *,
    processor: str | None = None,
    white_balance: str | None = None,
    trust_code: bool = False,
) -> Picture:
    """Develop a raw image into a linear picture.

    Parameters
    ----------
    raw : RawImage
    calibration : ColourCalibration, optional
        Colours of the camera, as `studies.photograph.camera.calibrate` fits them; the raw image's own by default.
    processor : str, optional
        Of `isp.processors.catalogue.PROCESSORS`, or ``mine.py:develop`` (`isp.processors.own.processor_of`). Left out,
        ``ple`` for every mosaic, so that two cameras are developed by one method; ``any_mosaic`` for a tile that it
        doesn't take (`isp.processors.catalogue.default_processor`). The paper's pair go by their names:
        ``interleaved`` removes noise, ``bayer`` doesn't.
    white_balance : str, optional
        ``as-shot``: the calibration's neutral; an illuminant such as ``D65``: its neutral, from the calibration's
        matrices; or ``gray-world`` as in the paper, with the as-shot neutral where the picture is too dark for that.
        Left out, as shot, and Gray World for ``interleaved_paper``, to whose method it belongs.
    trust_code : bool
        Consent to run ``mine.py``, which may do all that its user may.

    Raises
    ------
    InputError
        For an unknown name, a file of one's own without consent, a raw image without colours, or a mosaic that the
        processor doesn't know.
    """
    name = processor or default_processor(raw.cfa)
    require_consent("isp", name, trust_code)
    raw = raw if calibration is None else replace(raw, colour=calibration)
    colour = raw.colour
    if colour is None:
        raise InputError(
            "raw: it holds no colour calibration; allowed: one beside it; give calibrate(sensor, illuminant('D65')) too"
        )
    colours = fit_of_calibration(colour, raw.channels, raw.channel_mixing if is_undone(raw.crosstalk) else None)
    software = processor_of(name)
    response = _asked_neutral(colour, white_balance or default_balance(name))
    return software.develop(raw, colours, neutral=colour.neutral, balance=response)


def _asked_neutral(colour: ColourCalibration, white_balance: str) -> Floats | None:
    """Return the camera's response to a neutral under the requested light; None if Gray World is to find it."""
    if white_balance in WHITE_BALANCES:
        return colour.neutral if white_balance == AS_SHOT else None
    try:
        light = illuminant(white_balance)
    except InputError:
        raise unknown("white_balance", white_balance, (*WHITE_BALANCES, *BROAD, "temperature such as 3000K")) from None
    if white_balance not in BROAD and not white_balance.endswith("K"):
        raise InputError(
            f"white_balance: {white_balance!r} has bands that a raw file's matrices don't know; allowed: "
            f"{', '.join((*WHITE_BALANCES, *BROAD))}, temperature such as 3000K; give it to capture instead"
        )
    return neutral_under(colour, light)


def develop_file(
    path: str | Path | Sequence[str | Path],
    isp: str | None = None,
    ev: float | None = None,
    white_balance: str | None = None,
    encoding: str = "srgb",
    *,
    height: int | None = None,
    width: int | None = None,
    trust_code: bool = False,
) -> Developed:
    """Read a raw file and develop it with its own colour calibration.

    The colour matrix is the file's own, fitted under the light of its as-shot neutral. For a file of a real camera it
    is LibRaw's matrix for daylight.

    Parameters
    ----------
    path : path, or sequence of them
        Frames of a burst or bracket are merged (`sensor.burst.merged_raw`) before they are developed.
    isp, trust_code
        As `processor` and `trust_code` in `develop`.
    ev : float, optional
        Brightness in stops: at 0 green's full well is white. Left out, `sensor.raw_files.brightness.stops_to_white`
        chooses it so that the exposure's 99th percentile of luminance is 90 % of white, which suits viewing, not
        measuring.
    white_balance : str, optional
        As in `develop`.
    encoding : str
        Name in `isp.colour.encoding.ENCODINGS`.
    height, width : int, optional
        Size of the picture in pixels, at most the raw file's. Each pixel is the mean of the linear light on its area.
        If only one of the two is given, the picture keeps its proportions.

    Raises
    ------
    InputError
        For a file that can't be read, holds no colours, or whose mosaic the pipeline doesn't know.
    """
    if ev is not None:
        require_range("ev", ev, -40.0, 40.0, "give stops")
    paths = [path] if isinstance(path, str | Path) else list(path)
    opened = [open_raw(file) for file in paths]
    raw = merged_raw([frame for frame, _ in opened])
    file_facts = opened[0][1]
    if raw.colour is None:
        raise InputError(
            f"{paths[0]}: it holds no colour calibration; allowed: what rodcone capture notes; capture anew"
        )
    picture = develop(raw, processor=isp, white_balance=white_balance, trust_code=trust_code)
    stops = stops_to_white(raw) if ev is None else ev
    size = _size(picture.rgb, height, width)
    facts = {
        "raw": str(paths[0]) if len(paths) == 1 else [str(file) for file in paths],
        "isp": isp or default_processor(raw.cfa),
        "engine": picture.engine,
        "ev": stops,
        "balance": dict(picture.balance),
        "snr": picture.snr,
        "substitution": picture.substituted,
        "saturated": float(raw.saturated.mean()),
        "defects": 0 if raw.defects is None else len(raw.defects),
        "encoding": encoding,
        **file_facts,
    }
    if size != raw.shape:
        from skimage.transform import resize_local_mean  # imported late: it takes as long as a small picture

        scaled = np.asarray(resize_local_mean(picture.rgb / raw.full_well_e, size, channel_axis=-1))
        return Developed(encode(scaled, encoding, gain=2.0**stops), facts)
    return Developed(encode(picture.rgb, encoding, white=raw.full_well_e, gain=2.0**stops), facts)


def _size(linear: NDArray[np.float64], height: int | None, width: int | None) -> tuple[int, int]:
    """Return the requested height and width of the picture; raise `InputError` if they exceed the raw file's."""
    raw_size = linear.shape[0], linear.shape[1]
    size = asked_size(raw_size, height, width)
    if size[0] > raw_size[0] or size[1] > raw_size[1]:
        raise InputError(
            f"height, width: {size} is more than the raw file's {raw_size}; allowed: as many or fewer; give less"
        )
    return size
