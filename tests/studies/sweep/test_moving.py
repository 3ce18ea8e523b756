"""A study's scene that moves: what each exposure takes of its times, its truth, its keys, its cost, and refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from builders import transport_of
from refusal import refusal

from render.transport import Transport
from rodcone.memory import memory
from sensor.optics import form_image
from sensor.presets import low_noise, preset_file
from sensor.response import expected_electrons
from studies.dataset.order import SetOrder, check_cameras
from studies.photograph.moments import centred_shares, rolling_moments
from studies.study.cost import another_s, averaged_s, pace, render_seconds
from studies.study.lit_scene import OpenedScene, open_all
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.study.study_file import read_study
from studies.sweep import moving as moving_module
from studies.sweep.cost import estimate_cost
from studies.sweep.database import open_results
from studies.sweep.prepare import Job, known_cells, scene_cells

NM, WIDTH = np.array([430.0, 530.0, 630.0, 730.0]), np.full(4, 100.0)
SIDE, TIMES, MIDDLE = 16, 4, 100.0
BALL = """<scene version="3.0.0">
  <default name="time_s" value="0"/>
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
    </film></sensor>
  <shape type="sphere"><float name="radius" value="0.2"/>
    <transform name="to_world"><translate x="$time_s" z="5"/></transform></shape>
  <emitter type="constant"/>
</scene>"""


def study_of(folder: Path, **changes: Any) -> Study:
    """A ball at four times of 0.4 s, exposed for all of it and for its quarter."""
    (folder / "ball.xml").write_text(BALL)
    made = Study(
        (SceneChoice(str(folder / "ball.xml"), moments=TIMES),),
        ("1cd/m2",),
        exposures=("400ms", "100ms"),
        processors=("bayer",),
        render=RenderLimits(spp=8, band_nm=100.0),
    )
    return replace(made, **changes)


def light(opened: OpenedScene, value: float, spp: float = 8) -> Transport:
    """A picture as bright all over."""
    assert opened.scene is not None
    values = np.full((len(opened.scene.groups), NM.size, SIDE, SIDE), value, np.float32)
    return transport_of(values, opened.scene.groups, NM, WIDTH, spp=int(spp))


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, int, int]]:
    """Place of the ball, samples and seed of each render: light of 1, 2, 3 and 4 at the times, of 100 at the middle."""
    asked: list[tuple[float, int, int]] = []

    def make(opened: OpenedScene, study: Study, model: Any, *_: Any, **__: Any) -> tuple[Transport, tuple[str, ...]]:
        assert opened.scene is not None
        (ball,) = (x for x in opened.scene.geometry.values() if isinstance(x, dict) and x.get("type") == "sphere")
        place_m = float(np.array(ball["to_world"])[0, 3])
        asked.append((place_m, model.spp, study.render.seed))
        value = MIDDLE if place_m == pytest.approx(0.2) else 1.0 + round((place_m - 0.05) / 0.1)
        return light(opened, value, model.spp), ()

    monkeypatch.setattr(moving_module, "make_transport", make)
    return asked


def test_an_exposure_lies_in_the_middle_of_the_longest_and_takes_its_times() -> None:
    """By closed form: the whole takes all alike; a quarter of four times two halves and their neighbours' rims."""
    sensor = low_noise()
    assert centred_shares(sensor, 4, 0.4, 0.4, 4) == pytest.approx(np.full((4, 4), 0.25))
    for count in (3, 4, 16):
        shares = centred_shares(sensor, 2, 0.1, 0.4, count)
        assert shares.sum(axis=0) == pytest.approx([1.0, 1.0])
        assert shares == pytest.approx(shares[::-1])
    # Of a part of each step about the middle of two times a share x goes over to the other: all is 1/2 each.
    assert centred_shares(sensor, 1, 0.1, 0.4, 4)[:, 0] == pytest.approx([0, 0.5, 0.5, 0])
    # Half a step about a time itself leaves 1/8 to its neighbours: the tent's mean over half of its half is 7/8.
    assert centred_shares(sensor, 1, 0.05, 0.3, 3)[:, 0] == pytest.approx([1 / 16, 7 / 8, 1 / 16])
    rolling = replace(sensor, row_time_us=1e4)  # 30 ms from the first row to the last
    longest = centred_shares(rolling, 4, 0.37, 0.4, 8)
    assert longest == pytest.approx(rolling_moments(rolling, 4, 0.37, 8)[1])
    assert centred_shares(rolling, 4, 0.1, 0.4, 8) == pytest.approx(centred_shares(rolling, 4, 0.1, 0.4, 8)[::-1, ::-1])


def test_a_scene_is_opened_at_the_times_of_the_longest_exposure(tmp_path: Path) -> None:
    def opened(**changes: Any) -> OpenedScene:
        (found,) = open_all(study_of(tmp_path, **changes)).values()
        return found

    def place_m(scene: Any) -> float:
        (ball,) = (x for x in scene.geometry.values() if isinstance(x, dict) and x.get("type") == "sphere")
        return float(np.array(ball["to_world"])[0, 3])

    found = opened()
    assert [place_m(scene) for scene in found.moving] == pytest.approx([0.05, 0.15, 0.25, 0.35])
    assert (place_m(found.scene), found.whole_s) == (pytest.approx(0.2), 0.4)
    choice = study_of(tmp_path).scenes[0]
    assert choice.label == "ball.xml, at 4 times"
    still = opened(scenes=(replace(choice, moments=None),))
    assert (still.moving, still.whole_s, place_m(still.scene)) == ((), 0.0, 0.0)
    sensor = tmp_path / "rolling.toml"
    sensor.write_text("row_time_us = 10000.0\n" + preset_file("low_noise").read_text("utf-8"), "utf-8")
    rolling = opened(sensors=(str(sensor),))
    assert rolling.whole_s == pytest.approx(0.4 + 15 * 0.01)
    others = [opened(scenes=(replace(choice, moments=5),)), opened(exposures=("300ms",)), still, rolling]
    assert len({found.identity, *(x.identity for x in others)}) == 5
    file = tmp_path / "study.toml"
    file.write_text('scenes = [{source = "walker", moments = 3}]\nlevels = ["1lux"]\nexposures = ["1/4"]\n')
    assert read_study(file).scenes[0].moments == 3


def test_a_cell_sees_its_own_exposure_s_mean_and_the_truth_of_the_middle(
    tmp_path: Path, rendered: list[tuple[float, int, int]]
) -> None:
    """The mean of 1 to 4 is 2.5 for the whole and its quarter; as bright as the middle would be, 1/40 of its light."""
    study = study_of(tmp_path)
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        assert known_cells(job, opened) is None
        cells = scene_cells(job, opened, lambda *_: None)
        again = known_cells(job, opened)
        assert again is not None
        assert [cell.key for cell in again] == [cell.key for cell in cells]
    first = [asked for asked in rendered if asked[0] != pytest.approx(0.2)][:TIMES]
    assert rendered[0] == (pytest.approx(0.2), TIMES * 8, 0)
    assert [place_m for place_m, *_ in first] == pytest.approx([0.05, 0.15, 0.25, 0.35])
    assert {spp for _, spp, _ in first} == {8}
    assert len({0, *(seed for *_, seed in first)}) == 1 + TIMES
    read = [round(10 * place_m + 0.5) for place_m, *_ in rendered[1 + TIMES :]]
    assert read == [1, 2, 3, 4, 2, 3], "of the shorter one only the times that it sees"
    whole, quarter = cells
    assert whole.frame.key != quarter.frame.key
    assert whole.frame.truth == quarter.frame.truth
    assert np.load(whole.frame.truth).std() < 1e-6
    sensor = whole.frame.sensor
    bright_e = expected_electrons(form_image(light(opened, MIDDLE).relight(luminance_cd_m2=1.0), sensor), sensor, 1.0)
    for cell in cells:
        assert np.load(cell.frame.electrons) == pytest.approx(2.5 / MIDDLE * bright_e, rel=1e-5)
    facts = whole.render.facts
    assert (facts.spp, facts.seconds) == (8.0, 1.0 + TIMES)


def test_the_estimate_counts_every_time_and_the_middle(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    still = replace(study, scenes=(replace(study.scenes[0], moments=None),))

    def of(each: Study) -> Any:
        return estimate_cost(each, SAMPLE.stated(each), open_all(each), workers=1, kept=0)

    alone, many = of(still), of(study)
    assert (alone.renders, many.renders) == (1, 1 + TIMES)
    bands, pixels = len(SAMPLE.stated(study).renders[study.scenes[0]].wavelength_nm), SIDE**2
    render_s, of_light = render_seconds(pixels, bands, 1, 8), (pixels, bands, 1)
    shared_s = 7e-7 * pixels * bands  # of one more exposure's frames
    more_s = TIMES * (another_s(*of_light) + 2 * averaged_s(*of_light)) + shared_s
    assert many.seconds - alone.seconds == pytest.approx((2 * TIMES - 1) * render_s + pace() * more_s)
    assert many.bytes == memory(*of_light, 1, spp=8, held=2).total


def test_what_a_study_of_motion_can_not_say_is_refused(tmp_path: Path) -> None:
    def refused(match: str, **changes: Any) -> None:
        refusal(study_of, tmp_path, **changes, match=match)

    refused("exposures: 'auto' beside scene ball.xml, at 4 times, which moves; allowed: times", exposures=("auto",))
    refused(r"frames: \[1, 4\] beside scene", frames=(1, 4))
    for name, value in {"noise_share": 0.03, "max_seconds": 1.0, "denoise": True}.items():
        words = name.replace("_", "-")
        refused(f"render.{words}: {value} beside scene", render=replace(RenderLimits(), **{name: value}))
    refused("sensor staggered: moments: the camera reads some charge after a part", sensors=("low_noise", "staggered"))
    refused("sensor low_noise: flicker: beside moments = 4.* 5 Hz swings by 100%", flicker="pwm@5Hz:0.5")
    study_of(tmp_path, flicker="metal_halide@100Hz")  # the longest exposure's quarter is ten periods
    (tmp_path / "scene.exr").touch()
    picture = study_of(tmp_path, scenes=(SceneChoice(str(tmp_path / "scene.exr"), moments=2),))
    refusal(open_all, picture, match="moments: 2 for .*scene.exr, a picture without surfaces")
    still = study_of(tmp_path, scenes=(SceneChoice("still_life", moments=2),))
    refusal(open_all, still, match="moments: scene still_life doesn't move")
    refusal(SceneChoice, "walker", moments=0, match="moments: 0")
    refusal(check_cameras, study_of(tmp_path), SetOrder(), match="moments: 4 in a data set")
