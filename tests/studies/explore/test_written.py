"""Python and studies that the explorer writes: the Python makes the same bits, the study is read and asks the same."""

import ast
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from explore_sample import GAUSSIAN, RENDER, random_controls, small_transport

import rodcone as public
from rodcone.errors import InputError
from sensor.presets import preset
from studies.explore.chain import photograph
from studies.explore.controls import Controls, Lamp
from studies.explore.equipment import camera_of
from studies.explore.memo import go_on
from studies.explore.source import RenderOptions, of_choice, of_transport, open_source
from studies.explore.views import VIEWS, histogram, pixel
from studies.explore.written import GIVEN, python_of, study_of
from studies.study.study import RenderLimits, SceneChoice
from studies.study.study_file import read_study

ROOM = """<scene version="3.0.0">
  <sensor type="perspective"/><shape type="sphere"><transform name="to_world"><translate z="4"/></transform></shape>
  <emitter type="constant"><spectrum name="radiance" filename="../lamp.spd"/></emitter>
</scene>
"""


def ran(code: str) -> dict[str, object]:
    """Names that copied Python makes, which imports what a user has: rodcone, NumPy, the standard library."""
    names: dict[str, object] = {}
    nodes = list(ast.walk(ast.parse(code)))
    modules = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    modules |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    assert modules <= {"rodcone", "numpy", "dataclasses"}, code
    exec(code, names)
    return names


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
        assert np.array_equal(names["transport"].radiance, state.transport.radiance)  # type: ignore[attr-defined]


@pytest.mark.parametrize("extend", [None, "hold"])
@pytest.mark.parametrize("own", [False, True])
def test_the_python_of_a_scene_opens_it_with_its_options(own: bool, extend: str | None, tmp_path: Path):
    """A scene of a file with what it names anywhere, one of the catalogue in another light; both may hold ends."""
    path = tmp_path / "room" / "room.xml"
    path.parent.mkdir()
    path.write_text(ROOM, "utf-8")
    (tmp_path / "lamp.spd").write_text("300 1\n900 2\n", "utf-8")
    choice = SceneChoice(str(path), extend=extend) if own else SceneChoice("color_checker", "A", extend)
    (state,) = of_choice(choice, RenderOptions(size=16, spp=1, band_nm=100.0, trust=own)).states(go_on)
    names = ran(python_of(state.code, Controls()))
    assert names["scene"].extend == extend  # type: ignore[attr-defined]
    lit, wanted = (each.relight().values for each in (names["transport"], state.transport))  # type: ignore[attr-defined]
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
        with pytest.raises(InputError, match=rf"\A.*{words}.*\Z"):
            public.explorer_view(small_transport(), view, **controls)


def test_a_transports_python_says_that_it_was_given():
    (state,) = of_transport(small_transport()).states(go_on)
    assert state.code == GIVEN
    assert "transport = ..." in python_of(state.code, Controls())


def test_a_study_asks_the_same(tmp_path: Path):
    controls = Controls(
        lamps={"softbox": Lamp("A")},
        level_cd_m2=0.0123,
        exposure="time",
        exposure_s=0.0125,
        lens={"f_number": 4.0, "diffraction": 1.0},
        pixel={"read_noise_e": 0.25, "crosstalk": 0.03},
        bits=12,
        mosaic="bayer",
        processor="bayer",
        seed=7,
        frames=4,
    )
    limits = RenderLimits(96, 40.0, 16, seed=5, range_nm=(400.0, 720.0))
    for name, text in study_of(SceneChoice("still_life"), limits, controls).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    study = read_study(tmp_path / "study.toml")
    assert (study.spectra, study.levels, study.seeds) == (("A",), ("0.0123cd/m2",), (7,))
    assert (study.processors, study.frames, study.render) == (("bayer",), (4,), limits)
    own, asked = preset(study.sensors[0], "bayer"), camera_of(controls)
    assert (own.pixel, own.bits, own.lens.f_number) == (asked.pixel, asked.bits, 4.0)
    again = open_source(str(tmp_path / "study.toml"), RenderOptions())
    assert again.controls.level_cd_m2 == controls.level_cd_m2
    assert again.controls.exposure_s == pytest.approx(controls.exposure_s, rel=1e-12)
    assert camera_of(again.controls).lens == asked.lens
    assert again.controls.lamps == controls.lamps
    assert (again.controls.frames, again.render) == (4, limits)


@pytest.mark.parametrize(
    ("scene", "coloured", "controls"),
    [
        (SceneChoice("color_checker", light="A", chart="chart.csv"), False, Controls()),
        (SceneChoice("scene.xml", extend="hold"), False, Controls()),
        (SceneChoice('two\nlines, "\\, \x7f.xml'), False, Controls()),
        (SceneChoice("radiance.exr", light="A"), True, Controls(reference_light="A")),
        (SceneChoice("still_life"), False, Controls(lamps={"softbox": Lamp("lamp.csv")})),
    ],
)
def test_a_study_names_the_scene_with_its_options_and_files_by_their_whole_path(scene, coloured, controls, tmp_path):
    def placed(name: str) -> str:
        return str(tmp_path / name) if "." in name else name

    (tmp_path / "lamp.csv").write_text("wavelength_nm,power\n400,1\n700,1\n", "utf-8")
    chart = None if scene.chart is None else placed(scene.chart)
    scene = replace(scene, source=placed(scene.source), chart=chart)
    controls = replace(controls, lamps={name: Lamp(placed(each.spectrum)) for name, each in controls.lamps.items()})
    files = study_of(scene, RenderLimits(96), controls, coloured)
    (tmp_path / "study.toml").write_text(files["study.toml"], "utf-8")
    study = read_study(tmp_path / "study.toml")
    assert study.scenes == (scene,)
    assert study.spectra == (tuple(each.spectrum for each in controls.lamps.values()) or ("own",))


def test_what_a_study_can_not_say_is_refused():
    for controls, words in (
        (Controls(mosaic="rgbw_4x4"), "mosaic 'rgbw_4x4'"),
        (Controls(reference_light="A"), "reference_light 'A'"),
        (Controls(lamps={"softbox": Lamp(power=2.0)}), "one spectrum for all"),
        (Controls(settings={"sigma_s": 2.0}), "no settings of a processor"),
        (Controls(shot_noise=False), "without shot noise"),
    ):
        with pytest.raises(InputError, match=words):
            study_of(SceneChoice("still_life"), RenderLimits(96), controls, coloured=True)
