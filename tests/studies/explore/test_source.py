"""What the command opens: scenes and files; and what it refuses before anything is rendered."""

from pathlib import Path

import numpy as np
import pytest
from command_line import check_refusals
from explore_sample import ran

import rodcone as public
from studies.explore.answers import python_of
from studies.explore.chain import photograph
from studies.explore.controls import Controls, Lamp
from studies.explore.memo import go_on
from studies.explore.source import FIRST_SIDE, RenderOptions, open_source
from studies.photograph.picture_file import to_png


def test_a_scene_is_shown_small_first_and_then_whole():
    states = open_source("flat_field", RenderOptions(size=136, spp=2, band_nm=100.0)).states(go_on)
    first, last = next(states), next(states)
    assert (first.transport.coverage.mean.shape, first.last) == ((FIRST_SIDE, FIRST_SIDE), False)
    assert (last.transport.coverage.mean.shape, last.last) == ((136, 136), True)
    assert last.transport.wavelength_nm.size == 4
    assert next(states, None) is None


def test_a_file_of_radiance_is_photographed_as_it_is(tmp_path: Path):
    radiance = public.render("flat_field", (16, 20), wavelength_nm=np.arange(400.0, 780.0, 40.0), spp=2).relight()
    path = tmp_path / "seen.exr"
    public.write_exr(radiance, path)
    source = open_source(str(path), RenderOptions())
    (state,) = source.states(go_on)
    assert source.groups == {next(iter(state.transport.groups)): True}
    assert photograph(state.transport, Controls()).picture.shape == (16, 20, 3)
    picture = ran(python_of(state.code, Controls()))["picture"]
    assert np.array_equal(picture, photograph(state.transport, Controls()).picture)


def test_reflectances_take_other_lamps_and_the_copied_python_opens_them(tmp_path: Path):
    path = tmp_path / "seen.png"
    rng = np.random.default_rng(1)
    path.write_bytes(to_png(rng.integers(50, 200, (16, 20, 3), np.uint8)))
    source = open_source(str(path), RenderOptions())
    (state,) = source.states(go_on)
    assert source.groups == {"light": False}
    shot, own = (photograph(state.transport, Controls(lamps=lamps)) for lamps in ({"light": Lamp("A")}, {}))
    assert np.array_equal(ran(python_of(state.code, Controls()))["picture"], own.picture)
    assert not np.array_equal(own.exposed.light.spectrum, shot.exposed.light.spectrum)


def test_bad_input_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("no_such_scene", "scene"), ("still_life --size 4", "size: 4"), ("still_life --size 100000", "size: 100000"),
        ("nothing.exr", "nothing.exr"), ("study.toml", "study.toml"), ("nothing.xml", "nothing.xml"),
        ("still_life --spp 0", "spp: 0"), ("still_life --band-nm nan", "band"), ("still_life --band-nm 0", "band"),
        ("still_life --seed -1", "seed: -1"), ("still_life --trust-scene --no-browser", "trust-scene"),
        ("still_life --port 70000", "port: 70000"), ("still_life --port -1", "port: -1"),
    )  # fmt: skip
    check_refusals("explore", rows, tmp_path)
