"""The command `rodcone develop`: raw files as a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isp.ple.tables import one_frame
from rodcone.errors import InputError
from rodcone.files import check_place
from studies.commands.console import print_result
from studies.photograph.develop import develop_file
from studies.photograph.picture_file import check_picture_file, default_path, write_picture


@dataclass(frozen=True, kw_only=True)
class DevelopOrder:
    """Settings by which raw files are developed into a picture.

    Attributes
    ----------
    out : Path, optional
        Picture to write, .png or .tif; the raw file's name with .png by default.
    isp : str, optional
        Processor: ple by default, one method for every mosaic (any_mosaic where the tile has other channels than R, G,
        B and W, or another size than 1, 2 or 4 pixels). rodcone list processors names them all; of the paper's pair
        interleaved removes noise, and bayer doesn't.
        Or a function in a Python file of your own, mine.py:develop, with --trust-code; or FILE.whl:bayer_net.
    bits : int
        Bits per channel: 8 or 16.
    ev : float, optional
        Brightness in stops; at 0 a full well is white. By default the exposure's 99th percentile of luminance is shown
        at 90 % of white, by every processor alike.
    white_balance : str, optional
        Illuminant, such as D65, under which grey is shown as grey; as-shot for the one that capture or the camera set,
        as raw converters do; or gray-world, found in the picture as in the paper. By default as-shot, and gray-world
        for interleaved_paper.
    height : int, optional
        Pixels of the picture, at most the raw file's; with one of height and width the other keeps the proportions.
    width : int, optional
        Pixels; as height.
    encoding : str
        Colours of the picture: srgb, or display-p3 for screens with a wider gamut.
    trust_code : bool
        Run the Python file that --isp names, which may do all that you may.
    """

    out: Path | None = None
    isp: str | None = None
    bits: int = 8
    ev: float | None = None
    white_balance: str | None = None
    height: int | None = None
    width: int | None = None
    encoding: str = "srgb"
    trust_code: bool = False


DEFAULT = DevelopOrder()


def develop(
    raw: Path, /, *more: Path, order: Annotated[DevelopOrder, Parameter(name="*")] = DEFAULT, json: bool = False
) -> None:
    """Develop a raw file of `rodcone capture`, or any camera's with a Bayer mosaic, into a picture, and print its path.

    Parameters
    ----------
    raw
        Raw file: .dng, or .tif with its .json beside it; or a camera's, such as .nef, .cr2 or .dng, which needs
        pip install 'rodcone[photographs]'.
    more
        Further raw files of the same camera and scene, such as capture --frames writes: all are merged, then developed.
    json
        Print one JSON object with the path and the choices made instead of the path.
    """
    if not raw.name:
        raise InputError(f"raw: {str(raw)!r} is a folder; give the path of a raw file")
    for path in more:
        if path.suffix.lower() == ".png":
            raise InputError(f"raw: {str(path)!r} is a picture; allowed: raw files; to write it give --out {path}")
    choices = vars(order).copy()
    out, bits = choices.pop("out"), choices.pop("bits")
    picture = default_path(raw) if out is None else out
    check_picture_file(picture, bits, order.encoding)
    check_place(picture)
    with one_frame():
        developed = develop_file((raw, *more), **choices)
    write_picture(developed.encoded, picture, bits, order.encoding)
    print_result(picture, {"path": str(picture), **developed.facts}, json=json)
