"""The command `rodcone develop`."""

import json as notation
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def develop(
    raw: Path,
    /,
    *,
    out: Annotated[Path | None, Parameter(name=["--out", "-o"])] = None,
    isp: str | None = None,
    bits: int = 8,
    ev: float | None = None,
    white_balance: str = "gray-world",
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Develop a raw file of `rodcone capture` into a PNG in sRGB; prints its path.

    Parameters
    ----------
    raw
        Raw file: .dng, or .tif with its .json beside it.
    out
        Picture to write; the raw file's name with .png by default.
    isp
        Pipeline: interleaved (RGBW) or bayer; by the mosaic in the file where left out.
    bits
        Of each channel: 8 or 16.
    ev
        Brightness in stops, at 0 a full well is white; by default the 99th percentile of the picture's luminance is
        shown at 90 % of white.
    white_balance
        gray-world, as in the paper, or as-shot: what capture's --white-balance set, as raw converters do.
    json
        Print one JSON object with the path and what was decided instead of the path.
    """
    from render.errors import InputError
    from render.files import check_place, replacing
    from studies.development import develop_file
    from studies.png import to_png

    if not raw.name:
        raise InputError(f"raw: {str(raw)!r} is a folder; give the path of a raw file")
    picture = raw.with_suffix(".png") if out is None else out
    if picture.suffix.lower() != ".png":
        raise InputError(f"out: {str(picture)!r} has another ending; allowed: .png; rename it")
    if bits not in (8, 16):
        raise InputError(f"bits: {bits!r} is not allowed; give 8 or 16")
    check_place(picture)
    developed = develop_file(raw, isp, ev, white_balance)
    content = to_png(developed.encoded, bits)
    with replacing(picture) as (place,):
        place.write_bytes(content)
    print(notation.dumps({"path": str(picture), **developed.facts}) if json else picture)
