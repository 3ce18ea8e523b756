"""Keys and random streams of cells: by coordinates, so that what a study also asks for changes nothing."""

from dataclasses import replace

import numpy as np

from rodcone.digests import digest
from studies.study.study import Condition, SceneChoice
from studies.sweep.cells import cell_key, device_stream, exposure_stream
from studies.sweep.provenance import Provenance

AT = Condition(SceneChoice("still_life"), "own", "25cd/m2", "10ms", "low_noise")


def draws(stream: np.random.Generator) -> list[int]:
    return [int(x) for x in stream.integers(0, 2**63, 4)]


def test_a_stream_is_the_same_for_the_same_coordinates_and_writing() -> None:
    assert draws(exposure_stream(AT, "rgbw", 0)) == draws(exposure_stream(AT, "rgbw", 0))
    spelt = replace(AT, level="25.0 cd/m2", exposure="0.01s")
    assert draws(exposure_stream(AT, "rgbw", 0)) == draws(exposure_stream(spelt, "rgbw", 0))


def test_streams_are_those_of_the_first_release() -> None:
    """The digests of the coordinates as a row names them; another order or spelling would draw other pictures."""
    named = replace(AT, scene=SceneChoice("/a/desk.exr", "A"), sensor="/b/mine.toml")
    exposed = digest(["exposure", "desk.exr", "own", 25.0, "cd/m2", 0.01, "mine.toml", "rgbw", 7])
    chip = digest(["device", "mine.toml", "rgbw", 7])
    assert draws(exposure_stream(named, "rgbw", 7)) == draws(np.random.default_rng(int(exposed, 16)))
    assert draws(device_stream("/b/mine.toml", "rgbw", 7)) == draws(np.random.default_rng(int(chip, 16)))


def test_a_key_changes_with_each_thing_that_decides_a_picture() -> None:
    made_by = Provenance("llvm_ad_spectral", "llvm", "numpy", "{}")
    given = (AT, "bayer", 0, "frame", 25.0, 0.01, made_by)
    others = (replace(AT, level="1lux"), "interleaved", 1, "other", 25.1, 0.011)
    keys = [cell_key(*given)]
    for place, other in enumerate(others):
        changed = list(given)
        changed[place] = other
        keys.append(cell_key(*changed))  # type: ignore[arg-type]
    for field in ("variant", "readout_engine", "development_engine", "versions"):
        keys.append(cell_key(*given[:-1], replace(made_by, **{field: "another"})))  # type: ignore[arg-type]
    assert len(set(keys)) == 1 + 6 + 4
    assert cell_key(*given) == keys[0]
