"""Keys and random streams of cells: by coordinates, so that what a study also asks for changes nothing."""

from dataclasses import replace

import numpy as np
import pytest

from isp.colour.colour_fit import ColourFit
from studies.study.study import Condition, SceneChoice
from studies.sweep.cells import Coordinates, cell_key, coordinates, device_stream, exposure_stream
from studies.sweep.provenance import Provenance

AT = Coordinates("still_life", "own", "25cd/m2", "10ms", "low_noise", "interleaved", 0)


def draws(stream: np.random.Generator) -> list[int]:
    return [int(x) for x in stream.integers(0, 2**63, 4)]


def test_a_stream_is_the_same_for_the_same_coordinates_and_writing() -> None:
    assert draws(exposure_stream(AT, "rgbw")) == draws(exposure_stream(AT, "rgbw"))
    spelt = replace(AT, level="25.0 cd/m2", exposure="0.01s")
    assert draws(exposure_stream(AT, "rgbw")) == draws(exposure_stream(spelt, "rgbw"))


@pytest.mark.parametrize(
    "change",
    [
        {"scene": "flat_field"},
        {"spectrum": "A"},
        {"level": "25lux"},
        {"exposure": "auto"},
        {"sensor": "table1_output"},
        {"seed": 1},
    ],
)
def test_each_coordinate_gives_an_exposure_noise_of_its_own(change: dict[str, object]) -> None:
    other = replace(AT, **change)  # type: ignore[arg-type]
    assert draws(exposure_stream(AT, "rgbw")) != draws(exposure_stream(other, "rgbw"))


def test_processors_of_one_mosaic_develop_the_same_exposure() -> None:
    other = replace(AT, processor="another")
    assert draws(exposure_stream(AT, "rgbw")) == draws(exposure_stream(other, "rgbw"))
    assert draws(exposure_stream(AT, "rgbw")) != draws(exposure_stream(AT, "bayer"))


def test_fixed_patterns_belong_to_sensor_mosaic_and_seed_alone() -> None:
    elsewhere = replace(AT, scene="flat_field", spectrum="A", level="1lux", exposure="1s", processor="another")
    assert draws(device_stream(AT, "rgbw")) == draws(device_stream(elsewhere, "rgbw"))
    assert draws(device_stream(AT, "rgbw")) != draws(device_stream(AT, "bayer"))
    assert draws(device_stream(AT, "rgbw")) != draws(device_stream(replace(AT, seed=1), "rgbw"))
    assert draws(device_stream(AT, "rgbw")) != draws(device_stream(replace(AT, sensor="x"), "rgbw"))
    assert draws(device_stream(AT, "rgbw")) != draws(exposure_stream(AT, "rgbw"))


def test_a_key_changes_with_each_thing_that_decides_a_picture() -> None:
    fit = ColourFit(("R", "G", "B"), np.ones(3), np.eye(3), np.eye(3))
    other_fit = replace(fit, mean=np.array([1.0, 1.0, np.nextafter(1.0, 2.0)]))
    made_by = Provenance("llvm_ad_spectral", "llvm", "numpy", "{}")
    given = (AT, "frame", 25.0, 0.01, fit, made_by)
    others = (replace(AT, seed=1), "other", 25.1, 0.011, other_fit)
    keys = [cell_key(*given)]
    for place, other in enumerate(others):
        changed = list(given)
        changed[place] = other
        keys.append(cell_key(*changed))  # type: ignore[arg-type]
    for field in ("variant", "readout_engine", "development_engine", "versions"):
        keys.append(cell_key(*given[:-1], replace(made_by, **{field: "another"})))  # type: ignore[arg-type]
    assert len(set(keys)) == 1 + 5 + 4
    assert cell_key(*given) == keys[0]


def test_coordinates_name_files_without_their_folder() -> None:
    condition = Condition(SceneChoice("/a/desk.exr"), "own", "1cd/m2", "auto", "/b/mine.toml")
    made = coordinates(condition, "bayer", 7)
    assert made == Coordinates("desk.exr", "own", "1cd/m2", "auto", "mine.toml", "bayer", 7)
