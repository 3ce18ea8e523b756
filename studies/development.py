"""A raw file developed into a picture for the screen."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.colour import encode_srgb, luminance_of_srgb
from render.errors import InputError, require_range, unknown
from sensor.dng import is_bayer
from sensor.raw_files import read_raw
from studies.camera import CAMERAS

WHITE_BALANCES = ("gray-world", "as-shot")
WHITE_PERCENTILE, WHITE_AT = 99.0, 0.9  # the demo's rule, here on the picture's own luminance


@dataclass(frozen=True)
class Developed:
    """Encoded sRGB (h, w, 3) in [0, 1], and what was decided on the way, as JSON holds it."""

    encoded: NDArray[np.float64]
    facts: dict[str, Any]


def develop_file(
    path: Path, isp: str | None = None, ev: float | None = None, white_balance: str = WHITE_BALANCES[0]
) -> Developed:
    """Read a raw file and develop it with its own colour calibration.

    The colour matrix is the file's, fitted under the light that its as-shot neutral stands for.

    Parameters
    ----------
    isp : str, optional
        ``interleaved`` or ``bayer``; by the mosaic where left out.
    ev : float, optional
        Brightness in stops: at 0 green's full well is white. Left out, the 99th percentile of the picture's luminance
        comes to 90 % of white, which noise raises in the deepest dark; for looking, not for measuring.
    white_balance : str
        ``gray-world`` as in the paper, with the file's as-shot neutral where the picture is too dark for that; or
        ``as-shot``, that neutral in any case.

    Raises
    ------
    InputError
        For a file that can't be read, holds no colours, or whose mosaic the pipeline doesn't know.
    """
    if isp is not None and isp not in CAMERAS:
        raise unknown("isp", isp, CAMERAS)
    if white_balance not in WHITE_BALANCES:
        raise unknown("white_balance", white_balance, WHITE_BALANCES)
    if ev is not None:
        require_range("ev", ev, -40.0, 40.0, "give stops")
    raw = read_raw(path)
    if raw.colour is None:
        raise InputError(f"{path}: it holds no colour calibration; allowed: a camera with R, G and B; capture with one")
    name = isp or ("bayer" if is_bayer(raw.cfa) else "interleaved")
    neutral = raw.colour.neutral
    fixed = neutral if white_balance == "as-shot" else None
    picture = CAMERAS[name][1](raw, raw.colour.to_srgb, neutral=neutral, balance=fixed)
    full_e = (raw.white_dn - raw.black_dn) * raw.gain_e_per_dn
    linear = picture.rgb / full_e
    stops = _stops(linear) if ev is None else ev
    facts = {
        "raw": str(path),
        "isp": name,
        "engine": picture.engine,
        "ev": stops,
        "balance": dict(picture.balance),
        "snr": picture.snr,
        "substitution": picture.substituted,
        "saturated": float(raw.saturated.mean()),
    }
    return Developed(encode_srgb(linear * 2.0**stops), facts)


def _stops(linear: NDArray[np.float64]) -> float:
    """Stops that bring the 99th percentile of luminance to 90 % of white; 0 for a picture without light."""
    bright = float(np.percentile(luminance_of_srgb(linear), WHITE_PERCENTILE))
    return float(np.log2(WHITE_AT / bright)) if bright > 0 else 0.0
