"""A photograph whose bands are made one at a time gives the raw file of all bands together, to the bit."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from render.radiance_files import radiance_source
from sensor.raw_files.raw_file import read_raw
from studies.photograph.shot import Order, take


@pytest.mark.filterwarnings("ignore:.*of the pixels have colours")
def test_a_large_photographs_raw_file_is_that_of_all_bands_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (40, 64, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    order = Order(tmp_path / "a.png", tmp_path / "whole.dng", level="5cd/m2", light=("A",))
    whole = take(order)
    monkeypatch.setattr(radiance_source, "MOST_WHOLE_BYTES", 0)
    made = take(Order(tmp_path / "a.png", tmp_path / "made.dng", level="5cd/m2", light=("A",)))
    assert np.array_equal(read_raw(made.paths[0]).dn, read_raw(whole.paths[0]).dn)
    assert made.facts["exposure_s"] == whole.facts["exposure_s"]
    assert made.notes == whole.notes
