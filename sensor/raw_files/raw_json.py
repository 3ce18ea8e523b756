"""The exact calibration of a raw image as JSON: every number comes back bit for bit."""

import json
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_keys
from sensor.calibration import ChannelNoise, ColourCalibration, NoiseStep
from sensor.raw import RawImage

FORMAT = "rodcone raw image"
VERSION = 1
KEYS = tuple(field.name for field in fields(RawImage) if field.name != "dn")
_OPTIONAL = ("defects", "noise_steps", "channel_noise", "dark_current_e", "crosstalk")  # left out where there are none
_LONGEST_KEY = 400  # characters of an unknown key in a message: a damaged file may hold a mebibyte there
MOST_BYTES = 1 << 20  # most bytes of the text; the calibration of sixteen channels takes some 5 kB


def raw_to_json(raw: RawImage, **more: object) -> str:
    """Return as JSON all that a raw image holds besides its pixels, and the keys of `more`.

    Numbers are the shortest decimals that read back as the same float64. A key of `_OPTIONAL` is left out where it has
    no value.

    Raises
    ------
    InputError
        Where the list of defective pixels is too long to be read back.
    """
    calibration: dict[str, Any] = {key: getattr(raw, key) for key in KEYS}
    if raw.colour is not None:
        calibration["colour"] = {key: value.tolist() for key, value in asdict(raw.colour).items()}
    calibration["defects"] = defects = [] if raw.defects is None else raw.defects.tolist()
    for key in ("noise_steps", "channel_noise"):
        calibration[key] = [asdict(x) for x in calibration[key]]
    calibration = {key: value for key, value in calibration.items() if value or key not in _OPTIONAL}
    content = {"format": FORMAT, "version": VERSION, **more, **calibration}
    text = json.dumps(content, allow_nan=False, default=float)
    if len(text) > MOST_BYTES:
        raise InputError(
            f"defects: {len(defects)} pixels don't fit a raw file; allowed: a calibration of {MOST_BYTES} bytes; "
            "list fewer"
        )
    return text


def parse_json(text: bytes, name: str, more: tuple[str, ...] = ()) -> dict[str, Any]:
    """Parse a calibration that `raw_to_json` wrote, and check its keys: `KEYS` and `more`.

    Raises
    ------
    InputError
        For a text that is no JSON object, of another format or version, or has other keys.
    """
    try:
        calibration = json.loads(text.decode())
    except (ValueError, RecursionError):  # no UTF-8, no JSON, or brackets nested too deep
        calibration = None
    if (
        not isinstance(calibration, dict)
        or calibration.get("format") != FORMAT
        or calibration.get("version") != VERSION
    ):
        raise InputError(
            f"{name}: its calibration is not that of a raw image; allowed: {FORMAT!r}, version {VERSION}; write it anew"
        )
    require_keys(
        f"{name}: calibration", (key[:_LONGEST_KEY] for key in calibration), ("format", "version", *KEYS, *more)
    )
    missing = [key for key in (*KEYS, *more) if key not in calibration and key not in _OPTIONAL]
    if missing:
        raise InputError(f"{name}: its calibration lacks {', '.join(missing)}; write the file anew")
    return calibration


def raw_image(calibration: dict[str, Any], dn: NDArray[np.uint16], name: str) -> RawImage:
    """Make a raw image from its pixels and its calibration, as `parse_json` returns it.

    Raises
    ------
    InputError
        For a value of the wrong type or out of its range; the message begins with `name`.
    """
    try:
        structured = {
            "colour": None if calibration["colour"] is None else ColourCalibration(**calibration["colour"]),
            "noise_steps": tuple(NoiseStep(**step) for step in calibration.get("noise_steps", ())),
            "channel_noise": tuple(ChannelNoise(**noise) for noise in calibration.get("channel_noise", ())),
        }
        return RawImage(dn, **{key: calibration[key] for key in KEYS if key in calibration} | structured)
    except (InputError, TypeError) as error:  # TypeError: keys of a part that it lacks or doesn't know
        raise InputError(f"{name}: {error}; give what rodcone wrote") from None
