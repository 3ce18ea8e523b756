"""What the command opens: scenes, files, studies; and what it refuses before anything is rendered."""

from pathlib import Path

import numpy as np
import pytest

import rodcone as public
from studies.commands.cli import main
from studies.explore.chain import photograph
from studies.explore.source import FIRST_SIDE, RenderOptions, open_source
from studies.explore.written import python_of


def test_a_scene_is_shown_small_first_and_then_whole():
    states = open_source("flat_field", RenderOptions(size=136, spp=2, band_nm=100.0)).states()
    first, last = next(states), next(states)
    assert (first.transport.coverage.shape, first.last) == ((FIRST_SIDE, FIRST_SIDE), False)
    assert (last.transport.coverage.shape, last.last) == ((136, 136), True)
    assert last.transport.wavelength_nm.size == 4
    assert next(states, None) is None


def test_a_file_of_radiance_is_photographed_as_it_is(tmp_path: Path):
    radiance = public.render("flat_field", (16, 20), wavelength_nm=np.arange(400.0, 780.0, 40.0), spp=2).relight()
    path = tmp_path / "seen.exr"
    public.write_exr(path, radiance)
    source = open_source(str(path), RenderOptions())
    (state,) = source.states()
    assert source.groups == {next(iter(state.transport.groups)): True}
    assert photograph(state.transport, source.controls).picture.shape == (16, 20, 3)
    names: dict[str, object] = {}
    exec(python_of(state.code, source.controls), names)
    assert np.array_equal(names["picture"], photograph(state.transport, source.controls).picture)  # type: ignore[arg-type]


def test_a_study_is_where_the_page_begins(tmp_path: Path):
    path = tmp_path / "study.toml"
    path.write_text(
        'scenes = ["still_life"]\nspectra = ["A"]\nlevels = ["3cd/m2", "100cd/m2"]\nexposures = ["5ms"]\n'
        'sensors = ["table1_output"]\nprocessors = ["bayer"]\nseeds = [3]\n'
        "[render]\nsize = 32\nspp = 2\nband_nm = 80\n[lens]\nveiling_glare = 0.02\n",
        "utf-8",
    )
    source = open_source(str(path), RenderOptions())
    own = source.controls
    assert (own.level_cd_m2, own.exposure, own.exposure_s, own.seed) == (3.0, "time", 0.005, 3)
    assert (own.sensor, own.mosaic, own.processor) == ("table1_output", "bayer", "bayer")
    assert dict(own.lens) == {"diffraction": 1.0, "veiling_glare": 0.02}
    assert own.lamps["softbox"].spectrum == "A"
    assert (source.size, source.spp) == (32, 2)


@pytest.mark.parametrize(
    "arguments",
    [
        ["no_such_scene"], ["still_life", "--size", "4"], ["still_life", "--size", "100000"], ["nothing.exr"],
        ["nothing.toml"], ["nothing.xml"], ["still_life", "--spp", "0"], ["still_life", "--band-nm", "nan"],
        ["still_life", "--band-nm", "0"], ["still_life", "--seed", "-1"], ["still_life", "--trust-scene"],
        ["still_life", "--port", "70000"], ["still_life", "--port", "-1"],
    ],
)  # fmt: skip
def test_bad_input_ends_with_one_line(arguments, capsys):
    if arguments[-1] == "--trust-scene":
        arguments = [*arguments, "--no-browser"]
    with pytest.raises(SystemExit) as caught:
        main(["explore", *arguments])
    assert caught.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.strip().splitlines()) == 1
