"""Python that the explorer writes: it makes the same bits."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from explore_sample import GAUSSIAN, RENDER, ran, random_controls, small_transport
from refusal import refusal

import rodcone as public
from studies.explore.answers import python_of
from studies.explore.chain import photograph
from studies.explore.controls import Controls, Lamp
from studies.explore.memo import go_on
from studies.explore.source import GIVEN, RenderOptions, of_transport, open_source
from studies.explore.views import VIEWS, histogram, pixel

ROOM = """<scene version="3.0.0">
  <sensor type="perspective"/><shape type="sphere"><transform name="to_world"><translate z="4"/></transform></shape>
  <emitter type="constant"><spectrum name="radiance" filename="../$lamp.spd"/></emitter>
</scene>
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize("view", [*VIEWS])
def test_the_python_of_a_view_makes_its_bits(view):
    controls = random_controls(random.Random(view))
    shot = photograph(small_transport(), controls)
    assert np.array_equal(ran(python_of(RENDER, controls, view))["picture"], VIEWS[view](shot))


@pytest.mark.thorough
def test_the_python_of_figures_makes_their_numbers():
    lamps = {"sun": Lamp("A", 3.0), "sky": Lamp(table=GAUSSIAN)}
    controls = replace(random_controls(random.Random(7)), lamps=lamps)
    exposed = photograph(small_transport(), controls).exposed
    assert ran(python_of(RENDER, controls, "histogram"))["figure"] == histogram(exposed.raw)
    assert ran(python_of(RENDER, controls, "pixel 3 5"))["figure"] == pixel(exposed, 3, 5)


@pytest.mark.thorough
def test_the_python_of_a_source_makes_its_transport():
    source = open_source("still_life", RenderOptions(size=20, spp=20, band_nm=80.0))
    states = list(source.states(go_on))
    assert [state.last for state in states] == [False, True]
    for state in states:
        names = ran(python_of(state.code, Controls()))
        assert np.array_equal(names["transport"].radiance, state.transport.radiance)


def test_the_python_of_a_file_opens_it_with_what_it_names_anywhere(tmp_path: Path):
    path = tmp_path / "room" / "room.xml"
    path.parent.mkdir()
    path.write_text(ROOM, "utf-8")
    (tmp_path / "lamp.spd").write_text("300 1\n900 2\n", "utf-8")
    options = RenderOptions(size=16, spp=1, band_nm=100.0, trust_scene=True, define=("lamp=lamp",))
    (state,) = open_source(str(path), options).states(go_on)
    names = ran(python_of(state.code, Controls()))
    lit, wanted = (each.relight().values for each in (names["transport"], state.transport))
    assert np.array_equal(lit, wanted)


def test_a_wrong_view_or_control_is_refused_in_one_line():
    for view, controls, words in (
        ("pictures", {}, "did you mean 'picture'"),
        ("pixel 3", {}, "pixel ROW COLUMN"),
        ("pixel 3 500", {}, "column: 500"),
        ("raw", {"level_cd_m": 3.0}, "level_cd_m2"),
        ("raw", {"lamps": {"sun": {"spectrum": 3}}}, "lamps"),
        ("raw", {"lens": 1j}, "lens"),
    ):
        refusal(public.explorer_view, small_transport(), view, **controls, match=rf"\A.*{words}.*\Z")


def test_a_transports_python_says_that_it_was_given():
    (state,) = of_transport(small_transport()).states(go_on)
    assert state.code == GIVEN
    assert "transport = ..." in python_of(state.code, Controls())
