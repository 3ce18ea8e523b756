"""Raw files by the ending of their name: own digital negatives, TIFF with a sidecar, and other cameras' files."""

from pathlib import Path
from typing import Any

from rodcone.errors import InputError
from rodcone.files import require_ending
from sensor.cfa import Tile
from sensor.raw import RawImage
from sensor.raw_files.dng import is_in_dng, is_own, read_dng, write_dng
from sensor.raw_files.photograph import read_photograph
from sensor.raw_files.raw_tiff import read_tiff, write_tiff

PICTURES = (".png", ".jpg", ".jpeg", ".webp")
ENDINGS = (".dng", ".tif", ".tiff")


def check_ending(path: Path, tile: Tile) -> None:
    """Raise `InputError` where a mosaic can't be written under this name."""
    require_ending(path, *ENDINGS, what="raw file")
    if path.suffix.lower() == ".dng" and not is_in_dng(tile):
        raise InputError(
            f"raw file: {str(path)!r} can't hold the mosaic {tile}; allowed as DNG: Bayer, 2x2 RGBW, quads of both; "
            f"write {path.with_suffix('.tif').name}"
        )


def write_raw(raw: RawImage, path: str | Path, *, frame: int | None = None) -> tuple[Path, ...]:
    """Write a raw file; return the paths of what was written, the picture first.

    Parameters
    ----------
    raw : RawImage
    path : str or Path
    frame : int, optional
        Number of the exposure in a burst, which a .dng notes.

    Raises
    ------
    InputError
        For another ending than ``.dng``, ``.tif`` or ``.tiff``, or a raw image that the format can't hold.
    OSError
        Where the folder is missing or can't be written.
    """
    path = Path(path)
    check_ending(path, raw.cfa)
    return (write_dng(raw, path, frame=frame),) if path.suffix.lower() == ".dng" else write_tiff(raw, path)


def read_raw(path: str | Path) -> RawImage:
    """Read a raw file.

    A file that `write_raw` wrote gives its raw image bit for bit; another camera's is read by
    `photograph.read_photograph`.

    Raises
    ------
    InputError
        As `open_raw`.
    """
    return open_raw(path)[0]


def open_raw(path: str | Path) -> tuple[RawImage, dict[str, Any]]:
    """Read a raw file; for another camera's, also return what had to be estimated or assumed.

    Raises
    ------
    InputError
        For a file that is missing, damaged, changed, or that LibRaw doesn't read as a Bayer mosaic.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a raw file")
    if path.suffix.lower() in PICTURES:
        raise InputError(f"{path}: it is a picture, developed already; allowed: raw files; give the one it is made of")
    if path.suffix.lower() in ENDINGS[1:]:
        return read_tiff(path), {}
    if path.suffix.lower() == ENDINGS[0] and is_own(path):
        return read_dng(path), {}
    return read_photograph(path)
