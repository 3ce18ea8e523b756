"""Light that the project ships: what is taken by default, its averages over blocks, and what asks for a render."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call
from refusal import refusal

import rodcone as public
from render.illuminants import illuminant
from render.loader import Film
from render.reference import SHIPPED, find_reference, ready_light
from scenes.catalogue import load
from studies.commands import cli
from studies.commands import render as render_command
from studies.explore.memo import never_cancel
from studies.explore.source import RenderOptions, open_source
from studies.photograph import shot
from studies.photograph.ready_light import BANDS, find_ready

SHIPPED_AT = {
    "color_checker": (340, 512),
    "night_street": (256, 256),
    "siemens_star": (512, 512),
    "still_life": (512, 512),
}


def film(size: tuple[int, int]) -> Film:
    scene = load("color_checker")
    return Film(size, *BANDS, max_depth=scene.max_depth, rr_depth=scene.rr_depth)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", SHIPPED_AT)
def test_a_scene_with_light_of_its_own_is_found_at_its_size_without_one_asked_for(name: str) -> None:
    scene = load(name)
    ready = find_ready(scene, scene.size, None, [group.spectrum for group in scene.groups.values()])
    assert ready is not None
    assert ready.size == SHIPPED_AT[name]
    assert ready.transport.light.mean.shape[1:] == (20, *ready.size)
    assert "rendered before with" in ready.line


def test_the_package_stays_small() -> None:
    assert sum(path.stat().st_size for path in SHIPPED.glob("*.npz")) < 25e6


def test_a_smaller_size_is_the_mean_over_blocks_with_the_samples_of_all() -> None:
    scene = load("color_checker")
    whole, half = (ready_light(scene, film(size)).transport for size in ((340, 512), (170, 256)))
    assert find_reference(scene, film((170, 256))) is None  # no file of that size

    def blocks(planes: np.ndarray) -> np.ndarray:
        return planes.reshape(*planes.shape[:-2], 170, 2, 256, 2)

    np.testing.assert_allclose(half.light.mean, blocks(whole.light.mean).mean(axis=(-3, -1)), rtol=1e-5)
    assert np.array_equal(half.counts, blocks(whole.counts).sum(axis=(-3, -1)))
    # The mean of four pixels' errors, of independent paths: a quarter of the mean variance, in all 20 bands together.
    error = blocks(whole.light.difference.sum(axis=1)).mean(axis=(-3, -1))
    most = float(np.abs(error).max())
    np.testing.assert_allclose(half.light.difference.sum(axis=1), error, rtol=1e-3, atol=1e-5 * most)
    ratio = half.variance.mean(dtype=np.float64) / whole.variance.mean(dtype=np.float64)
    assert ratio == pytest.approx(0.25, rel=0.2)
    assert half.relight().luminance().mean() == pytest.approx(whole.relight().luminance().mean(), rel=1e-5)


def test_a_scene_that_measures_sharpness_is_rendered_within_its_pixels_whatever_light_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = load("color_checker")
    ready = find_ready(scene, scene.size, None, [group.spectrum for group in scene.groups.values()])
    monkeypatch.setattr(shot, "find_ready", lambda *_: ready)  # as if `rodcone reference slanted_edge` had been run
    edge, chart = (shot.check(shot.Order(name, height=32, width=32)) for name in ("slanted_edge", "color_checker"))
    assert (edge.ready, edge.samples, edge.cost.size) == (None, 2, (64, 64))
    assert (chart.ready, chart.samples) == (ready, 1)


def test_a_size_that_no_file_is_a_multiple_of_and_a_lamp_of_lines_ask_for_a_render() -> None:
    scene = load("color_checker")
    own = [group.spectrum for group in scene.groups.values()]
    assert find_ready(scene, scene.size, (100, 151), own) is None
    assert find_ready(scene, scene.size, None, [illuminant("sodium_low")]) is None


def test_capture_takes_it_and_says_so_and_numbers_or_render_ask_for_a_render(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shot, "render", lambda *_, **__: pytest.fail("rendered"))
    code, out, err = call(["capture", "color_checker", "-o", "shot.tif", "--json"])
    assert (code, json.loads(out)["size"]) == (0, [340, 512])
    assert "light: color_checker-340x512x20-" in err
    small = json.loads(call(["capture", "color_checker", "-o", "s.tif", "--size", "256", "--json"])[1])
    assert small["size"] == [170, 256]
    for numbers in (["--spp", "4"], ["--render"], ["--size", "33"]):
        with pytest.raises(pytest.fail.Exception, match="rendered"):
            call(["capture", "color_checker", "-o", "shot.tif", *numbers])


def test_render_takes_it_too_and_each_limit_of_a_render_asks_for_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(render_command, "render_transport", lambda *_, **__: pytest.fail("rendered"))
    code, out, err = call(["render", "color_checker", "-o", "small.exr", "--width", "128", "--light", "A", "--json"])
    facts = json.loads(out)
    assert (code, facts["size"]) == (0, [85, 128])
    assert facts["integrator"].startswith("reference light")
    assert "light: color_checker-340x512x20-" in err
    limits = ["--spp 4", "--noise 0.1", "--max-seconds 1", "--max-depth 2", "--seed 1", "--cache kept", "--denoise"]
    for numbers in ("--render", "--bands 380:780:40", "--width 33", "--light sodium_low", *limits):
        with pytest.raises(pytest.fail.Exception, match="rendered"):
            call(["render", "color_checker", "-o", "small.exr", *numbers.split()])


def test_the_explorer_takes_it_and_its_python_opens_the_same_light() -> None:
    source = open_source("color_checker", RenderOptions(size=128))
    (state,) = source.states(never_cancel)
    assert state.last
    assert "--render renders it anew" in source.notes[0]
    names: dict[str, Any] = {}
    exec("import rodcone\n" + state.code, names)
    assert np.array_equal(names["transport"].radiance, state.transport.radiance)
    for options in ({"spp": 2}, {"seed": 1}, {"render": True}, {"band_nm": 100.0}):
        states = open_source("color_checker", RenderOptions(size=128, **options))
        assert "rodcone.render(" in next(states.states(never_cancel)).code


def test_a_scenes_light_goes_by_its_name() -> None:
    transport = public.load_transport("color_checker", size=128)
    assert transport.light.mean.shape == (1, 20, 85, 128)
    assert public.load_transport("siemens_star").light.mean.shape == (1, 20, 512, 512)
    refusal(public.load_transport, "color_checker", size=100, match=r"100 pixels is there.*rodcone\.render\('color_ch")
    refusal(public.load_transport, "metamers", match=r"no light of metamers is there already; allowed: color_checker")
    refusal(public.load_transport, "seen.exr", size=64, match="size: 64 for 'seen.exr'")


def test_a_render_is_kept_where_what_follows_it_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """By the same command the light is there, and nothing of it stays once the file is written."""
    monkeypatch.chdir(tmp_path)
    for command, name in (("capture", "shot.tif"), ("render", "seen.exr")):
        arguments = [command, "flat_field", *["--height", "8", "--width", "8", "--spp", "2"], "-o", name]
        with monkeypatch.context() as patch:
            for module, written in ((shot, "write_with_bayer"), (render_command, "write_exr")):
                patch.setattr(module, written, lambda *_, **__: full())
            code, _, err = call(arguments)
            assert (code, err.count(f"the render is kept in .{name}.render")) == (cli.BAD_INPUT, 1)
        with monkeypatch.context() as patch:
            patch.setattr("render.engine._render", lambda *_: full())
            assert call(arguments)[0] == 0
        assert not list(tmp_path.glob(".*"))


def full() -> None:
    raise MemoryError("Unable to allocate 3.00 GiB")


@pytest.mark.parametrize("name", ["jit_malloc(): out of memory! Could not allocate 8589934592 bytes of host memory."])
def test_memory_that_dr_jit_has_no_more_of_is_one_line(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError(name)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("render.engine._render", fail)
    code, _, err = call(["capture", "flat_field", "-o", "shot.tif", "--size", "8", "--spp", "2"])
    assert code == cli.BAD_INPUT
    assert err.splitlines()[-1].startswith(f"rodcone: memory: it ran out ({name}); take a smaller picture")
    assert not list(tmp_path.iterdir())


def test_memory_that_runs_out_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def full(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 3.00 GiB")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shot, "imaged_electrons", full)
    code, _, err = call(["capture", "color_checker", "-o", "shot.tif", "--size", "256"])
    assert code == cli.BAD_INPUT
    assert err.splitlines()[-1].startswith("rodcone: memory: it ran out (Unable to allocate 3.00 GiB); take a smaller")
