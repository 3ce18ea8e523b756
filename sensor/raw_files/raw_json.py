"""The exact calibration of a raw image as JSON: every number comes back bit for bit."""

import json
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_keys
from sensor.calibration import ColourCalibration
from sensor.raw import RawImage

FORMAT = "rodcone raw image"
VERSION = 1
KEYS = tuple(field.name for field in fields(RawImage) if field.name != "dn")
_OPTIONAL = ("f_number", "iso")
_MAY_LACK = ("defects",)  # keys that a file without them leaves out
_NUMBERS = (
    *("black_dn", "white_dn", "gain_e_per_dn", "read_noise_e", "dsnu_e", "prnu", "exposure_s", "column_gain_spread"),
    *_OPTIONAL,
)
_MOST_TOLD = 400  # characters of a message: a damaged file may hold a mebibyte where a name should stand
MOST_BYTES = 1 << 20  # of the text: sixteen channels' calibration takes some 5 kB


def to_json(raw: RawImage, **more: Any) -> str:
    """Everything of a raw image but its pixels; `more` are keys of the file format's own.

    Python writes the shortest decimals that read back as the same float64.

    Raises
    ------
    InputError
        Where the list of defective pixels is too long to be read back.
    """
    calibration: dict[str, Any] = {key: getattr(raw, key) for key in KEYS}
    if raw.colour is not None:
        calibration["colour"] = {key: value.tolist() for key, value in asdict(raw.colour).items()}
    defects = calibration.pop("defects")
    if defects is not None:
        calibration["defects"] = defects.tolist()
    content = {"format": FORMAT, "version": VERSION, **more, **calibration}
    text = json.dumps(content, allow_nan=False, default=float)
    if len(text) > MOST_BYTES:
        raise InputError(
            f"defects: {0 if defects is None else len(defects)} pixels don't fit a raw file; allowed: a calibration of "
            f"{MOST_BYTES} bytes; list fewer"
        )
    return text


def parse_json(text: bytes, name: str, more: tuple[str, ...] = ()) -> dict[str, Any]:
    """Calibration as `to_json` wrote it, its keys checked: `KEYS` and `more`.

    Raises
    ------
    InputError
        For a text that is too long, no JSON object, of another format or version, or has other keys.
    """
    try:
        held = json.loads(text.decode()) if len(text) <= MOST_BYTES else None
    except (ValueError, RecursionError):  # no UTF-8, no JSON, or brackets nested too deep
        held = None
    if not isinstance(held, dict) or held.get("format") != FORMAT or held.get("version") != VERSION:
        raise InputError(
            f"{name}: its calibration is not that of a raw image; allowed: {FORMAT!r}, version {VERSION}; write it anew"
        )
    require_keys(f"{name}: calibration", (key[:_MOST_TOLD] for key in held), ("format", "version", *KEYS, *more))
    missing = [key for key in (*KEYS, *more) if key not in held and key not in _MAY_LACK]
    if missing:
        raise InputError(f"{name}: its calibration lacks {', '.join(missing)}; write the file anew")
    return held


def raw_image(held: dict[str, Any], dn: NDArray[np.uint16], name: str) -> RawImage:
    """Raw image from its pixels and its calibration as `parse_json` gives it.

    Raises
    ------
    InputError
        For a value of the wrong type or out of its range; `name` stands in front.
    """
    try:
        for key in _NUMBERS:
            if not _is_number(held[key]) and not (held[key] is None and key in _OPTIONAL):
                raise InputError(f"{key}: {held[key]!r} is not a number of 64 bits; correct it")
        if not isinstance(held["engine"], str):
            raise InputError(f"engine: {held['engine']!r} is not a text; correct it")
        if not isinstance(held["cfa"], list):
            raise InputError(f"cfa: {held['cfa']!r} is not a list of rows; give rows of letters")
        colour = held["colour"]
        if colour is not None:
            names = {field.name for field in fields(ColourCalibration)}
            if not isinstance(colour, dict) or set(colour) != names:
                raise InputError(f"colour: allowed is null, or an object of {', '.join(sorted(names))}; correct it")
            colour = ColourCalibration(**colour)
        return RawImage(dn, **{key: held[key] for key in KEYS if key != "colour" and key in held}, colour=colour)
    except InputError as error:
        told = str(error)
        told = told if len(told) <= _MOST_TOLD else f"{told[:_MOST_TOLD]} ..."
        raise InputError(f"{name}: {told}") from None


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or (type(value) is int and abs(value) < 1 << 63)
