"""Raw files of flat and dark frames: the preset that they give, and files that don't belong together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

from sensor.cameras.frames import frame_numbers, measure_files
from sensor.cameras.numbers import preset_text
from sensor.capture import expose
from sensor.config_file import read_sensor
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw_files.raw_file import write_raw

SENSOR = replace(low_noise("rgbw"), pixel=replace(low_noise().pixel, read_noise_e=3.0, dsnu_e=2.0))


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> tuple[list[Path], list[Path]]:
    folder, shape = tmp_path_factory.mktemp("frames"), (96, 128)
    device, rng = draw_device(SENSOR, shape, np.random.default_rng(1)), np.random.default_rng(2)
    found = []
    for name, light_e, count in (("flat", 8000.0, 3), ("dark", 0.0, 3)):
        paths = [folder / f"{name}{index}.tif" for index in range(count)]
        for path in paths:
            write_raw(expose(np.full(shape, light_e), SENSOR, 0.01, device, rng, exact=True), path)
        found.append(paths)
    return found[0], found[1]


def test_the_preset_holds_what_was_configured_every_number_with_its_interval(files, tmp_path):
    flats, darks = files
    figures = measure_files(flats, darks, None)
    text = preset_text("Mine.", frame_numbers(figures, flats), None, "")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("[pixel]", "[pixel]\npitch_um = 2.2\nfill_factor = 0.9"), "utf-8")
    found = read_sensor(path)
    # three frames of 96 x 128 pixels know each within a few per cent, at four standard errors
    assert found.pixel.full_well_e == pytest.approx(SENSOR.pixel.full_well_e, rel=0.05)
    assert found.pixel.read_noise_e == pytest.approx(3.0, rel=0.05)
    assert found.pixel.dsnu_e == pytest.approx(2.0, rel=0.08)
    assert found.pixel.prnu == pytest.approx(0.01, rel=0.06)
    assert (found.bits, found.cfa) == (14, SENSOR.cfa)
    assert abs(found.black_dn - SENSOR.black_dn) <= 1
    for key in ("full_well_e", "read_noise_e", "dsnu_e", "prnu"):
        line = next(line for line in text.splitlines() if line.startswith(key))
        assert "95 %" in line
    for key in ("pitch_um", "fill_factor", "dark_current_e_per_s"):
        assert f"# {key} =   # not told by" in text


def test_files_that_do_not_belong_together_are_refused_by_name(files, tmp_path):
    flats, darks = files
    refusal(measure_files, [flats[0], flats[0]], darks, None, match="a file is given twice")
    other = replace(SENSOR, bits=12)
    raw = expose(np.full((96, 128), 8000.0), other, 0.01, draw_device(other, (96, 128), np.random.default_rng(1)),
                 np.random.default_rng(3), exact=True)  # fmt: skip
    write_raw(raw, tmp_path / "other.tif")
    refusal(measure_files, [*flats, tmp_path / "other.tif"], darks, None, match=r"other\.tif: white_dn is 4095")
    refusal(measure_files, darks, flats, None, match=r"flat frames: dark0\.tif")
    refusal(measure_files, [tmp_path / "absent.dng"], darks, None, match="there is no such file")
    refusal(measure_files, flats[:1] * 1000, darks[:1], None, match="1001 files")
