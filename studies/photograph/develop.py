"""A raw file developed into a picture for the screen."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.colour.calibrated_colours import fit_of_calibration
from isp.colour.encoding import encode
from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import luminance_of_srgb
from rodcone.errors import InputError, require_range, unknown
from sensor.calibration import ColourCalibration
from sensor.cfa import channels, is_bayer
from sensor.raw import RawImage
from sensor.raw_files.raw_file import open_raw
from studies.metrics.truth import WHITE_AT, WHITE_PERCENTILE  # the demo's rule, here on the picture's own luminance
from studies.study.study import AS_SHOT, GRAY_WORLD, WHITE_BALANCES


@dataclass(frozen=True)
class Developed:
    """Encoded picture (h, w, 3) in [0, 1], and what was decided on the way, as JSON holds it."""

    encoded: NDArray[np.float64]
    facts: dict[str, Any]


def mosaic_processor(raw: RawImage) -> str:
    """Processor that the paper has for a raw image's mosaic."""
    return "bayer" if is_bayer(raw.cfa) else "interleaved"


def develop(
    raw: RawImage,
    calibration: ColourCalibration | None = None,
    *,
    processor: str | None = None,
    white_balance: str = GRAY_WORLD,
) -> Picture:
    """Develop a raw image into a linear picture.

    Parameters
    ----------
    raw : RawImage
    calibration : ColourCalibration, optional
        Colours of the camera, as `studies.photograph.calibrate.calibrate` fits them; the raw image's own by default.
    processor : str, optional
        Of `isp.processors.catalogue.PROCESSORS`; ``bayer`` or ``interleaved``, by the mosaic, where left out.
    white_balance : str
        ``gray-world`` as in the paper, with the as-shot neutral where the picture is too dark for that; or ``as-shot``,
        that neutral in any case.

    Raises
    ------
    InputError
        For an unknown name, a raw image without colours, or a mosaic that the processor doesn't know.
    """
    name = processor or mosaic_processor(raw)
    for what, value, allowed in (("isp", name, PROCESSORS), ("white_balance", white_balance, WHITE_BALANCES)):
        if value not in allowed:
            raise unknown(what, value, allowed)
    colour = calibration or raw.colour
    if colour is None:
        raise InputError(
            "raw: it holds no colour calibration; allowed: one of a camera with R, G and B; give "
            "calibrate(sensor, illuminant('D65')) as well"
        )
    colours = fit_of_calibration(colour, channels(raw.cfa))
    fixed = colour.neutral if white_balance == AS_SHOT else None
    return PROCESSORS[name].develop(raw, colours, neutral=colour.neutral, balance=fixed)


def develop_file(
    path: Path, isp: str | None = None, ev: float | None = None, white_balance: str = GRAY_WORLD, encoding: str = "srgb"
) -> Developed:
    """Read a raw file and develop it with its own colour calibration.

    The colour matrix is the file's, fitted under the light that its as-shot neutral stands for; of a camera's file,
    LibRaw's for daylight.

    Parameters
    ----------
    isp : str, optional
        Of `isp.processors.catalogue.PROCESSORS`; ``bayer`` or ``interleaved``, by the mosaic, where left out.
    ev : float, optional
        Brightness in stops: at 0 green's full well is white. Left out, the 99th percentile of the picture's luminance
        comes to 90 % of white, which noise raises in the deepest dark; for looking, not for measuring.
    white_balance : str
        ``gray-world`` as in the paper, with the file's as-shot neutral where the picture is too dark for that; or
        ``as-shot``, that neutral in any case.
    encoding : str
        Of `isp.colour.encoding.ENCODINGS`.

    Raises
    ------
    InputError
        For a file that can't be read, holds no colours, or whose mosaic the pipeline doesn't know.
    """
    if ev is not None:
        require_range("ev", ev, -40.0, 40.0, "give stops")
    raw, file_facts = open_raw(path)
    if raw.colour is None:
        raise InputError(f"{path}: it holds no colour calibration; allowed: a camera with R, G and B; capture with one")
    picture = develop(raw, processor=isp, white_balance=white_balance)
    linear = picture.rgb / raw.full_well_e
    stops = _stops(linear) if ev is None else ev
    facts = {
        "raw": str(path),
        "isp": isp or mosaic_processor(raw),
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
    return Developed(encode(linear * 2.0**stops, encoding), facts)


def _stops(linear: NDArray[np.float64]) -> float:
    """Stops that bring the 99th percentile of luminance to 90 % of white; 0 for a picture without light."""
    bright = float(np.percentile(luminance_of_srgb(linear), WHITE_PERCENTILE))
    return float(np.log2(WHITE_AT / bright)) if bright > 0 else 0.0
