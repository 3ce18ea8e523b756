"""Keep a page's pictures in the repository: `python docs/pictures.py PAGE RAN FOLDER`.

RAN is the folder in which docs/run_page.py ran the page. Each picture of FOLDER that the page shows is made from the
picture of that name there: PNG becomes WebP, SVG stays. FOLDER/made.txt keeps the digest of the page's commands. While
it is theirs the pictures stay as they are, so that a build of the site changes no tracked file; remove it to have them
made anew.
"""

import re
import sys
from hashlib import sha256
from pathlib import Path

from PIL import Image
from run_page import blocks

QUALITY = 85  # of WebP: 128 to 256 pixels of noise take 20 to 40 kB, a third of the lossless form
SHOWN = re.compile(r"\]\(\.\./pictures/(\w+)/(\w+\.(?:webp|svg))\)")
MADE = "made.txt"


def digest(text: str) -> str:
    """Digest of a page's commands, in order."""
    return sha256(
        "\n".join(f"{block.language} {block.title}\n{block.code}" for block in blocks(text)).encode()
    ).hexdigest()


def shown(text: str) -> list[str]:
    """File names of the kept pictures that a page shows, each once."""
    return list(dict.fromkeys(name for _, name in SHOWN.findall(text)))


def is_kept(text: str, folder: Path) -> bool:
    """Return whether a folder holds every picture that a page shows, made by the page's present commands."""
    made = folder / MADE
    current = made.is_file() and made.read_text("utf-8").strip() == digest(text)
    return current and all((folder / name).is_file() for name in shown(text))


def keep(page: Path, ran: Path, folder: Path) -> None:
    """Write a page's pictures and its digest into `folder`; nothing where it shows none, or its commands made them."""
    text = page.read_text("utf-8")
    if not shown(text) or is_kept(text, folder):
        return
    folder.mkdir(parents=True, exist_ok=True)
    for name in shown(text):
        if name.endswith(".svg"):
            (folder / name).write_bytes((ran / name).read_bytes())
        else:
            with Image.open((ran / name).with_suffix(".png")) as picture:
                picture.convert("RGB").save(folder / name, quality=QUALITY, method=6)
    (folder / MADE).write_text(f"{digest(text)}\n", "utf-8")


if __name__ == "__main__":
    keep(*map(Path, sys.argv[1:]))
