"""Photographs to train the network of `isp.processors.corrected` on: which they are, and their folder out of clones.

    git clone https://github.com/OWNER/NAME CLONES/OWNER/NAME       (each repository of net_photographs.toml; bare does)
    python benchmarks/net_photographs.py CLONES out/photographs

`net_photographs.toml` lists them by repository and commit, with licence, author and the SHA-256 of the file. Every
licence lets weights that were trained on the photographs be the project's own; those by CC BY and CC BY-SA want credit.
None of them judges anything, and none is drawn, of one colour, or a near copy of a photograph that judges.

The folder holds PNG in 8-bit sRGB, upright, each reduced by a power of two so that no side is longer than `LONGEST`.
What has no clone is left out and named.
"""

import argparse
import io
import subprocess
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
from PIL import Image, ImageCms, ImageOps

from rodcone.colour_spaces import decode_srgb
from rodcone.errors import InputError
from rodcone.types import Floats

LIST = Path(__file__).with_suffix(".toml")
LONGEST = 4000  # pixels
ONE_HELD_IN = 10


@dataclass(frozen=True)
class NetPhotograph:
    """A photograph in a commit of a git repository."""

    name: str
    repository: str
    commit: str
    path: str
    licence: str
    author: str
    sha256: str


def listed() -> list[NetPhotograph]:
    """Return the photographs of the list."""
    return [
        NetPhotograph(repository=source["repository"], commit=source["commit"], **{"author": "", **photograph})
        for source in tomllib.loads(LIST.read_text("utf-8"))["source"]
        for photograph in source["photographs"]
    ]


def is_held(name: str) -> bool:
    """Return whether a photograph is left out of training, to validate on: one in ten, by its name alone."""
    return int(sha256(name.encode()).hexdigest(), 16) % ONE_HELD_IN == 0


def read_original(clones: Path, photograph: NetPhotograph) -> bytes:
    """Read a photograph's file out of its clone.

    Raises
    ------
    InputError
        The clone or its commit is absent, or the file isn't the one that is listed.
    """
    clone = clones / photograph.repository
    place = f"{photograph.commit}:{photograph.path}"
    found = subprocess.run(["git", "-C", clone, "cat-file", "blob", place], capture_output=True, check=False)
    if found.returncode or sha256(found.stdout).hexdigest() != photograph.sha256:
        raise InputError(f"{clone}: it lacks {place}; clone the whole repository there")
    return found.stdout


def upright_srgb(content: bytes, longest: int = LONGEST) -> Image.Image:
    """Decode a file as 8-bit sRGB, reduced by the least power of two that fits."""
    image: Image.Image = Image.open(io.BytesIO(content))
    step = 1 << max(0, (max(image.size) - 1) // longest).bit_length()
    width, height = (size // step for size in image.size)
    image.draft("RGB", (width, height))  # JPEG's decoder reduces by itself, and reads the less
    profile = image.info.get("icc_profile")
    image = ImageOps.exif_transpose(image).convert("RGB")
    image = image.reduce(max(1, max(image.size) // max(width, height)))
    if profile:
        image = ImageCms.profileToProfile(image, io.BytesIO(profile), ImageCms.createProfile("sRGB")) or image
    return image


def mean_of_squares(linear: Floats, step: int) -> Floats:
    """Average squares of `step` pixels a side; what is left over at the right and the bottom is cut off."""
    height, width = (size // step for size in linear.shape[:2])
    squares = linear[: height * step, : width * step].reshape(height, step, width, step, -1)
    return np.asarray(squares.mean(axis=(1, 3)))


def read_linear(folder: Path) -> Iterator[tuple[str, Floats]]:
    """Read a folder's photographs one by one: name and linear sRGB (h, w, 3), 0 to 1."""
    for path in sorted(folder.glob("*.png")):
        yield path.stem, _LINEAR[np.asarray(Image.open(path).convert("RGB"))]


def write_folder(clones: Path, folder: Path, longest: int) -> None:
    """Write the photographs, and say how many of each repository are absent."""
    folder.mkdir(parents=True, exist_ok=True)
    absent: dict[str, list[str]] = {}
    for photograph in listed():
        try:
            image = upright_srgb(read_original(clones, photograph), longest)
        except InputError as error:
            absent.setdefault(photograph.repository, []).append(str(error))
            continue
        image.save(folder / f"{photograph.name}.png", compress_level=3)
    for repository, errors in absent.items():
        print(f"{repository}: {len(errors)} photographs are left out; {errors[0]}")


_LINEAR = decode_srgb(np.arange(256) / 255.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clones", type=Path, help="folder with clones as OWNER/NAME")
    parser.add_argument("folder", type=Path, help="to write")
    parser.add_argument("--longest", type=int, default=LONGEST, help="side of a photograph at most [pixels]")
    given = parser.parse_args()
    write_folder(given.clones, given.folder, given.longest)


if __name__ == "__main__":
    main()
