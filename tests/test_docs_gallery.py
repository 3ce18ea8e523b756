"""The galleries say what the catalogues say, and have a picture of every scene."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isp.processors.catalogue import PROCESSORS
from render import illuminants
from scenes import catalogue
from sensor import cfa, presets

DOCS = Path(__file__).resolve().parent.parent / "docs"
sys.path.insert(0, str(DOCS))

import gallery  # noqa: E402

MOST_BYTES = 1 << 20  # of all that the galleries hold


def test_a_page_is_what_its_command_writes() -> None:
    for name, made in gallery.PAGES.items():
        assert (gallery.FOLDER / name).read_text("utf-8") == made(), f"{name}: run python docs/gallery.py"


def test_every_name_of_the_catalogues_is_shown() -> None:
    pages = {name: (gallery.FOLDER / name).read_text("utf-8") for name in gallery.PAGES}
    assert tuple(gallery.SHOWN) == catalogue.scene_names()
    assert all(f"## {name}\n" in pages["scenes.md"] for name in catalogue.scene_names())
    assert all(f"| `{name}` |" in pages["lights.md"] for name in illuminants.illuminant_names())
    assert all(
        f">{name}</text>" in (gallery.FOLDER / "lights.svg").read_text("utf-8")
        for name in illuminants.illuminant_names()
    )
    assert all(f"| `{name}` |" in pages["processors.md"] for name in PROCESSORS)
    assert all(
        (gallery.FOLDER / f"processor_{name}.webp").is_file() for name in PROCESSORS if name not in gallery.UNSHOWN
    )
    assert all(f"| `{name}` |" in pages["sensors.md"] for name in (*presets.preset_names(), *cfa.mosaics()))


def test_pictures_are_there_and_small_and_show_something() -> None:
    sizes = [path.stat().st_size for path in gallery.FOLDER.iterdir()]
    assert sum(sizes) < MOST_BYTES
    for name in catalogue.scene_names():
        with Image.open(gallery.FOLDER / f"{name}.webp") as picture:
            assert picture.format == "WEBP"
            assert picture.width == 320
            grey = np.asarray(picture.convert("L"))
        assert np.percentile(grey, 99) > 20, f"{name} is dark"
        assert name in ("flat_field", "furnace") or np.ptp(np.percentile(grey, [5, 95])) > 30, f"{name} is empty"


def test_one_response_stands_for_all_presets() -> None:
    first, *others = (presets.preset(name).responses.curves for name in presets.preset_names())
    for other in others:
        for channel, curve in first.items():
            np.testing.assert_array_equal(curve.values, other[channel].values)


@pytest.mark.slow
def test_a_picture_is_what_its_commands_make(tmp_path: Path) -> None:
    gallery.photograph("slanted_edge", tmp_path)
    made, kept = (Image.open(folder / "slanted_edge.webp") for folder in (tmp_path, gallery.FOLDER))
    difference = np.abs(np.asarray(made, dtype=float) - np.asarray(kept, dtype=float))
    assert difference.mean() < 2  # of 255: WebP's own loss, and a renderer that rounds otherwise
