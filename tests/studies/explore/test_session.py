"""One explorer's thread: a render that fails, pages that take over from one another."""

import io
import json
import pickle
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import check_refusals
from explore_sample import BANDS, ran, small_transport
from refusal import refusal
from scipy.io import savemat

import rodcone as public
from isp.settings import PAPER
from rodcone.errors import InputError
from scenes.catalogue import load
from scenes.levels import DEMO_LEVELS
from sensor.lens.table import read_lens, shipped
from sensor.photodiodes import with_gain
from sensor.presets import low_noise, preset, preset_file, vary
from sensor.raw_files.raw_file import read_raw
from sensor.readout import noise_variance
from studies.explore import chain
from studies.explore.answers import noise_share, python_of
from studies.explore.chain import expose_scene, photograph
from studies.explore.controls import (
    LENS,
    MOST_POINTS,
    PIXEL,
    SETTINGS,
    WIDEST,
    Controls,
    Lamp,
    controls_from,
    options_of,
)
from studies.explore.memo import Memo, never_cancel
from studies.explore.messages import KINDS, first_message, is_superseded_by, read_message, read_views, write_dropped
from studies.explore.session import Session
from studies.explore.slow import begin, stand_in
from studies.explore.source import FIRST_SIDE, RenderOptions, RenderState, of_transport, open_source
from studies.explore.views import histogram, pixel
from studies.photograph.picture_file import to_png
from studies.study.gain import iso_speed


class Page:
    """What one page is sent."""

    def __init__(self) -> None:
        self.headers: list[dict[str, Any]] = []
        self.buffers: list[Any] = []
        self.came = threading.Condition()

        self.send = self._take  # one value: a method is another at each look

    def _take(self, header: dict[str, Any], buffers: Any) -> None:
        with self.came:
            self.headers.append(header)
            self.buffers.append(buffers)
            self.came.notify_all()

    def wait(self, kind: str, number: int | None) -> dict[str, Any]:
        """The answer of that kind and number, once it is there."""

        def found() -> list[dict[str, Any]]:
            return [each for each in self.headers if (each["kind"], each.get("number")) == (kind, number)]

        with self.came:
            # Minutes, which are waited only where the answer is lost: a loaded machine may take many seconds.
            assert self.came.wait_for(found, 300), self.headers
            return found()[-1]

    def ask(self, session: Session, kind: str, number: int, **more: Any) -> dict[str, Any]:
        """The answer to a question."""
        session.take(message(kind, number, **more), self.send)
        return self.wait(kind, number)


def connected(session: Session) -> Page:
    """A page that asks a session."""
    page = Page()
    session.connect(page.send)
    return page


QUICK = {"processor": "interleaved"}  # a camera whose picture is there at once


def message(kind: str, number: int, **more: Any) -> str:
    shown = {"cameras": [QUICK], "views": [[0, "picture"]]} if kind == "show" else {}
    return json.dumps({"kind": kind, "number": number} | shown | more)


def test_another_scene_is_shown_and_one_that_is_not_offered_is_refused():
    page, other = Page(), public.render("color_checker", (16, 24), spp=4, **BANDS)
    session = Session(of_transport(small_transport()), {"chart": lambda: replace(of_transport(other), title="chart")})
    session.connect(page.send)
    assert page.ask(session, "show", 1)["size"] == [40, 48]
    session.take(message("scene", 2, name="charts"), page.send)
    assert "did you mean 'chart'?" in page.wait("error", 2)["message"]
    header = page.ask(session, "scene", 3, name="chart")
    assert (header["title"], header["scenes"], header["groups"]) == (
        "chart",
        ["chart"],
        dict.fromkeys(other.groups, False),
    )
    assert page.ask(session, "show", 4)["size"] == [16, 24]
    session.close()


def test_a_sensor_that_was_dropped_makes_the_pictures_of_its_file(tmp_path, monkeypatch):
    text = preset_file("low_noise").read_text("utf-8").replace("full_well_e = 15000", "full_well_e = 3000")
    text += '\n[responses]\ncsv = "curves.csv"\nrange_nm = [400, 700]\nquantum_efficiency = "included"\n'
    files = {"chip.toml": text, "curves.csv": "wavelength_nm,R,G,B,W\n400,.1,.1,.5,.6\n700,.5,.2,.1,.7\n"}
    for name, content in files.items():
        (tmp_path / name).write_text(content, "utf-8")
    page, session = Page(), Session(of_transport(small_transport()))
    session.connect(page.send)
    header = page.ask(session, "sensor", 1, files=files)
    camera = {"sensor": header["sensor"]} | QUICK
    assert header["terms"]["pixel"]["full_well_e"] == 3000
    python = page.ask(session, "show", 2, cameras=[camera])["python"][0]
    session.close()
    assert not Path(header["sensor"]).exists()
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(
        python.replace("transport = ...", "from explore_sample import small_transport\ntransport = small_transport()"),
        names,
    )
    assert names["picture"].tobytes() == page.buffers[-1][0]


@pytest.mark.thorough
def test_the_renders_noise_is_that_of_independent_renders():
    """Beside half the mean squared difference of two renders: both are noisy, within a factor of 1.5."""
    controls = Controls(exposure="time", exposure_s=0.02)
    renders = [public.render("still_life_outdoor", (40, 48), spp=16, seed=seed, **BANDS) for seed in range(2)]
    memos = [Memo(), Memo()]
    first, second = (expose_scene(transport, controls, memo) for transport, memo in zip(renders, memos, strict=True))
    own_e2 = noise_variance(first.expected_e, first.sensor, first.exposure_s)
    inside = np.maximum(first.expected_e, second.expected_e) < first.sensor.pixel.full_well_e
    wanted = ((first.expected_e - second.expected_e)[inside] ** 2).mean() / 2 / own_e2[inside].mean()
    share = noise_share(first, controls, memos[0])
    assert wanted / 1.5 < share < wanted * 1.5
    assert noise_share(first, replace(controls, frames=4), memos[0]) == pytest.approx(4 * share)


def test_a_render_with_more_noise_than_the_sensor_is_told_on_the_page_and_once_on_stderr(capsys):
    page = Page()
    session = Session(of_transport(public.render("cornell_box", (24, 24), spp=4, **BANDS)))
    session.connect(page.send)
    for number, level in enumerate((100.0, 50.0, 1e-4), 1):
        camera = {"level_cd_m2": level}
        page.ask(session, "histogram", number, cameras=[camera])
    session.close()
    notes = [header["noise_note"] for header in page.headers]
    assert [note.startswith("the render's noise has ") for note in notes] == [True, True, False]
    assert capsys.readouterr().err == f"rodcone: {notes[0]}\n"


def test_a_bursts_share_of_the_renders_noise_is_the_frames_times_that_of_one():
    """The sensor's noise of four frames has four times one frame's variance, an error of the light sixteen times."""
    controls = Controls(exposure="time", exposure_s=0.005)
    exposed = expose_scene(small_transport(), controls, Memo())
    one, four = (noise_share(exposed, replace(controls, frames=frames), Memo()) for frames in (1, 4))
    assert one > 0
    assert four == pytest.approx(4 * one)


def test_what_is_told_of_two_cameras_is_each_ones_own(session):
    cameras = [
        {"exposure": "time", "exposure_s": time_s, "level_cd_m2": level} | QUICK
        for time_s, level in ((0.002, 5.0), (0.02, 900.0))
    ]
    told = connected(session).ask(session, "show", 1, cameras=cameras, views=[[1, "raw"], [0, "raw"]])
    assert [facts["exposure_s"] for facts in told["facts"]] == [0.002, 0.02]
    assert told["facts"][0]["saturated"] < 0.1
    assert told["facts"][1]["saturated"] > 0.3
    assert [each["controls"]["level_cd_m2"] for each in told["cameras"]] == [5.0, 900.0]
    assert ["0.02" in python for python in told["python"]] == [True, False]
    transport = small_transport()
    assert (told["spp"], told["render_error"]) == (transport.spp, transport.relative_mc_error)


def test_a_negative_holds_the_exposure_that_is_shown_and_a_burst_is_refused(session: Session, tmp_path: Path) -> None:
    camera = {"exposure": "time", "exposure_s": 0.004, "level_cd_m2": 40.0, "seed": 3} | QUICK
    exposed = expose_scene(small_transport(), Controls(**camera), Memo())  # type: ignore[arg-type]
    page = connected(session)
    assert page.ask(session, "dng", 1, cameras=[camera | {"frames": 1}])["name"] == "explored.dng"
    (content,) = page.buffers[-1]
    (tmp_path / "explored.dng").write_bytes(content)
    raw = read_raw(tmp_path / "explored.dng")
    np.testing.assert_array_equal(raw.dn, exposed.raw.dn)
    assert (raw.exposure_s, raw.black_dn, raw.cfa) == (0.004, exposed.raw.black_dn, exposed.raw.cfa)
    for number in (2, 3):
        session.take(message("dng", number, cameras=[camera | {"frames": number}]), page.send)
        assert "dng: a merged burst is no raw file; allowed: 1 frame" in page.wait("error", number)["message"]


def test_a_pixels_figures_and_a_histogram_are_those_of_the_frame_that_is_asked_for(session: Session) -> None:
    camera = {"exposure": "time", "exposure_s": 0.004, "level_cd_m2": 40.0, "seed": 3} | QUICK
    exposed = expose_scene(small_transport(), Controls(**camera), Memo())  # type: ignore[arg-type]
    page = connected(session)
    for number, (row, column) in enumerate(((3, 31), (38, 7)), 1):
        told = page.ask(session, "pixel", number, cameras=[camera], row=row, column=column)
        assert json.dumps(told["pixel"]) == json.dumps(pixel(exposed, row, column))
        assert f"pixel {row} {column}" in told["python"]
    told = page.ask(session, "histogram", 9, cameras=[camera])
    assert json.dumps(told["histogram"]) == json.dumps(histogram(exposed.raw))


def test_the_page_is_told_every_sensors_and_processors_own_terms():
    said = first_message(of_transport(small_transport()))
    names = {"lens": LENS, "pixel": PIXEL}
    for name, terms in said["sensors"].items():
        sensor = preset(name)
        assert (terms["bits"], terms["gain"]) == (sensor.bits, sensor.gain), name
        for part, keys in names.items():
            assert terms[part] == {key: getattr(getattr(sensor, part), key) for key in keys}, name
        assert terms["iso"] == iso_speed(with_gain(sensor, 1.0))
        assert terms["tile"] == list(sensor.cfa)
        assert terms["row_time_us"] == sensor.row_time_us
        assert set(terms) == {"lens", "pixel", "bits", "gain", "row_time_us", "iso", "tile"}
    assert {name: lens["text"].rsplit("f/")[1] for name, lens in said["lenses"].items()} == {
        name: f"{read_lens(name).f_number:.3g}" for name in shipped()
    }
    offered = {name for processor in said["processors"].values() for name in processor["mosaics"]}
    assert offered - set(said["mosaics"]) == {"own"}
    for name, mosaic in said["mosaics"].items():
        assert mosaic["tile"] == list(vary(low_noise(), name).cfa), name
        assert mosaic["text"]
    paper = said["processors"]["interleaved_paper"]["settings"]
    assert paper == {name: getattr(PAPER, name) for name in SETTINGS} != said["processors"]["interleaved"]["settings"]
    assert said["levels"] == {level.name: pytest.approx(level.luminance_cd_m2, rel=1e-3) for level in DEMO_LEVELS}
    assert said["groups"] == dict.fromkeys(small_transport().groups, False)


@pytest.mark.parametrize("good_states", [0, 1])
def test_a_render_that_fails_is_told_and_asked_for_once(good_states):
    failed, once = 0, threading.Event()

    class Failing(Iterator[RenderState]):
        def __init__(self, _: Callable[[], None]) -> None:
            self.left = good_states

        def __next__(self) -> RenderState:
            nonlocal failed
            if self.left:
                self.left -= 1
                return RenderState(small_transport(), "", False)
            failed += 1
            once.set()
            raise InputError("wall: it has no material") if failed == 1 else StopIteration

    page = Page()
    session = Session(replace(of_transport(small_transport()), states=Failing))
    session.connect(page.send)
    page.ask(session, "hello", 1)
    assert once.wait(20)
    for number in (2, 3):
        session.take(message("show", number), page.send)
        if good_states:
            assert "it has no material" in page.wait("show", number)["notes"][-1]
        else:
            assert "it has no material" in page.wait("error", number)["message"]
    session.close()
    assert failed == 1


@pytest.fixture
def session() -> Iterator[Session]:
    made = Session(of_transport(small_transport()))
    yield made
    made.close()


# What is under way ends, or waits, where nobody needs it any more

BURST = {"cameras": [{"frames": 64, "processor": "bayer", "mosaic": "bayer"}]}


@pytest.fixture
def interrupted(session, monkeypatch):
    """Make a session in which something happens at the third frame that is read out; the frames' count so far."""
    frames: list[None] = []

    def at_third(happens: Callable[[], None]) -> list[None]:
        expose = chain.expose

        def counted(*arguments: Any, **options: Any) -> Any:
            frames.append(None)
            if len(frames) == 3:
                happens()
            return expose(*arguments, **options)

        monkeypatch.setattr(chain, "expose", counted)
        return frames

    return at_third


def test_a_burst_ends_for_a_newer_picture(session, interrupted):
    page = connected(session)
    frames = interrupted(lambda: session.take(message("show", 2), page.send))
    session.take(message("show", 1, **BURST), page.send)
    page.wait("show", 2)
    assert len(frames) == 3 + 1
    assert [each["number"] for each in page.headers] == [2]


def test_a_burst_ends_where_its_page_was_closed_and_not_where_another_was(session, interrupted):
    page, goes_on, there = connected(session), [], threading.Event()

    def closed() -> None:
        try:
            for left in (Page(), page):
                session.disconnect(left.send)
                session._check()
                goes_on.append(left is page)
        finally:
            there.set()

    frames = interrupted(closed)
    session.take(message("show", 1, **BURST), page.send)
    assert there.wait(30)
    assert goes_on == [False]
    connected(session).ask(session, "show", 2)
    assert len(frames) == 3 + 1
    assert page.headers == [{"kind": "taken over"}]


@pytest.mark.parametrize("kind", ["dng", "histogram"])
def test_a_file_or_a_figure_lets_a_picture_go_first(session, interrupted, kind):
    page = connected(session)
    interrupted(lambda: session.take(message("show", 3, cameras=[{"seed": 3} | QUICK]), page.send))
    for number in (1, 2):
        page.ask(session, "show", number, cameras=[{"seed": number} | QUICK])
    session.take(message(kind, 4, cameras=[{"seed": 9} | QUICK]), page.send)
    page.wait(kind, 4)
    assert [each["kind"] for each in page.headers] == ["show", "show", "show", kind]


@pytest.fixture
def endless():
    """A render whose second state never comes: it looks up between its runs for ever."""

    def states(between_runs: Callable[[], None]) -> Iterator[RenderState]:
        yield RenderState(small_transport(), "", False)
        while True:
            between_runs()

    made = Session(
        replace(of_transport(small_transport()), states=states), {"chart": lambda: of_transport(small_transport())}
    )
    yield made
    made.close()


def test_a_render_lets_pictures_go_first_and_ends_for_another_scene(endless):
    """And with the session: without it the fixture would never end."""
    page = connected(endless)
    for number in (1, 2, 3):
        assert page.ask(endless, "show", number)["last"] is False
    page.ask(endless, "scene", 4, name="chart")
    assert page.ask(endless, "show", 5)["last"] is True


@pytest.mark.thorough
def test_a_render_that_answered_between_its_runs_has_the_bits_of_one_go():
    source = open_source("still_life_outdoor", RenderOptions(size=32, spp=64, band_nm=100.0))

    def states(between_runs: Callable[[], None]) -> Iterator[RenderState]:
        photographed.append(chain.photograph(small_transport(), Controls(seed=len(photographed))))
        return source.states(lambda: photographed.append(chain.photograph(small_transport(), Controls())))

    photographed: list[Any] = []
    (*_, alone), (*_, answered) = source.states(lambda: None), states(lambda: None)
    assert len(photographed) > 2
    assert np.array_equal(alone.transport.radiance, answered.transport.radiance)


INTERLEAVED = Controls(processor="interleaved")
WIDE = {"neighbourhood": 41.0, "patch": 9.0}


def test_what_takes_seconds_has_a_stand_in_while_it_is_at_work_where_it_can_be_ended():
    for controls, pixels, shown in [
        (INTERLEAVED, 2048**2, INTERLEAVED),
        (replace(INTERLEAVED, settings=WIDE), 64**2, replace(INTERLEAVED, settings=WIDE)),
        (replace(INTERLEAVED, settings=WIDE), 256**2, INTERLEAVED),
        (Controls(processor="interleaved_paper", settings=WIDE), 256**2, Controls(processor="interleaved_paper")),
        (Controls(), 64**2, Controls(processor="any_mosaic")),
        (Controls(mosaic="bayer"), 64**2, Controls(processor="any_mosaic", mosaic="bayer")),
        (Controls(processor="bayer_bm3d", mosaic="bayer"), 64**2, Controls(processor="any_mosaic", mosaic="bayer")),
    ]:
        assert stand_in(controls, pixels) == shown, (controls, pixels, shown)


def test_a_slow_processors_result_is_shown_where_its_stand_in_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its task is the development of the very exposure; the picture, its facts and Python are then its own."""
    begun: list[tuple[str, Any, Callable[[Any], None]]] = []
    there = threading.Event()

    def begin(name: str, development: Any, report: Callable[[Any], None]) -> Callable[[], None]:
        begun.append((name, development, report))
        there.set()
        return lambda: None

    monkeypatch.setattr("studies.explore.session.begin", begin)
    controls = Controls(seed=4, exposure="time", exposure_s=0.004)
    camera = {"seed": 4, "exposure": "time", "exposure_s": 0.004}
    session = Session(of_transport(small_transport()))
    page = connected(session)
    first = page.ask(session, "show", 1, cameras=[camera])["cameras"][0]
    assert (first["controls"]["processor"], first["waiting_for"]) == ("any_mosaic", controls.processor)
    assert there.wait(30)
    ((name, development, report),) = begun
    wanted = chain.development_of(expose_scene(small_transport(), controls, Memo()), controls, Memo())
    assert name == controls.processor
    assert pickle.dumps((development.args, development.keywords)) == pickle.dumps((wanted.args, wanted.keywords))
    with page.came:
        sent = len(page.headers)
    quick = photograph(small_transport(), replace(controls, processor="any_mosaic"))
    linear, picture = quick.linear, quick.developed
    report((linear / 2, picture))
    with page.came:
        assert page.came.wait_for(lambda: len(page.headers) > sent, 300)
        last = page.headers[-1]
    session.close()
    told = last["cameras"][0]
    assert (told["controls"]["processor"], told["waiting_for"]) == (controls.processor, None)
    assert last["facts"][0]["snr_db"] == picture.snr_db
    assert page.buffers[-1][0] == chain.to_bytes(linear / 2).tobytes()
    assert len(begun) == 1


def test_a_slow_processor_that_is_cancelled_ends_and_does_not_begin_again(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, ended, there = [], [], threading.Event()

    def begin(name: str, *_: Any) -> Callable[[], None]:
        begun.append(name)
        there.set()
        return lambda: ended.append(name)

    monkeypatch.setattr("studies.explore.session.begin", begin)
    session = Session(of_transport(small_transport()))
    page = connected(session)
    page.ask(session, "show", 1, cameras=[{}])
    assert there.wait(30)
    page.ask(session, "hello", 2)  # answered once the beginning is over
    page.ask(session, "cancel", 3)
    waits, before = session._left_to_do(), list(ended)
    session.close()
    assert begun == before == [Controls().processor]
    assert waits is None


def test_a_connection_that_was_taken_over_is_not_listened_to(session):
    old, new = Page(), Page()
    session.connect(old.send)
    old.ask(session, "show", 1)
    session.connect(new.send)
    old.wait("taken over", None)
    session.take(message("show", 2), old.send)
    session.take(message("hello", 3), old.send)
    new.ask(session, "show", 1)
    assert [each["number"] for each in new.headers] == [1]
    assert [each.get("number") for each in old.headers] == [1, None]


def test_a_picture_that_stays_as_it_is_is_sent_to_a_page_once(session):
    """The truth of another exposure is the same; a page that comes later is sent it anew."""
    first, second = Page(), Page()
    views: list[Any] = [[0, "picture"], [0, "truth"]]
    for page in (first, second):
        session.connect(page.send)
        for number in (1, 2):
            page.ask(session, "show", number, cameras=[{"exposure_number": number} | QUICK], views=views)
        lengths = [[len(each) for each in buffers] for buffers in page.buffers if buffers]
        assert lengths == [[40 * 48 * 3] * 2, [40 * 48 * 3, 0]]
    session.take(message("show", 3, cameras=[{"exposure_number": 2} | QUICK], views=views[::-1]), page.send)
    second.wait("show", 3)
    assert [len(each) for each in second.buffers[-1]] == [40 * 48 * 3] * 2
    assert second.buffers[-1][1] == second.buffers[-2][0]


def test_what_another_page_asked_is_not_answered_to_the_new_one():
    """Neither what waits for the first picture nor, at the next state of the render, what was shown."""
    go = [threading.Event(), threading.Event()]

    def states(_: Callable[[], None]) -> Iterator[RenderState]:
        for number, event in enumerate(go):
            assert event.wait(30)
            yield RenderState(small_transport(), "", number == 1)

    old, new = Page(), Page()
    session = Session(replace(of_transport(small_transport()), states=states))
    session.connect(old.send)
    session.take(message("show", 1), old.send)
    session.connect(new.send)
    for event in go:
        event.set()
    new.ask(session, "histogram", 2, cameras=[{}])
    session.close()
    assert [each["kind"] for each in new.headers] == ["histogram"]


def test_an_isetcam_scene_is_judged_under_the_light_of_the_page(tmp_path):
    """Its own illuminant has no name there, and the note doesn't say that it counts."""
    nm = np.arange(400.0, 701.0, 10.0)
    lamp = {"data": {"photons": 1e15 * nm}, "spectrum": {"wave": nm}}
    savemat(tmp_path / "a.mat", {"photons": np.full((16, 16, nm.size), 1e15), "wave": nm, "illuminant": lamp})
    notes = open_source(str(tmp_path / "a.mat"), RenderOptions()).notes
    (note,) = notes
    assert note.endswith("its colours are judged under D65; give another light where that isn't so")


# What the command opens: scenes and files; and what it refuses before anything is rendered.


def test_a_scene_is_shown_small_first_and_then_whole():
    states = open_source("flat_field", RenderOptions(size=136, spp=2, band_nm=100.0)).states(never_cancel)
    first, last = next(states), next(states)
    assert (first.transport.coverage.mean.shape, first.last) == ((FIRST_SIDE, FIRST_SIDE), False)
    assert (last.transport.coverage.mean.shape, last.last) == ((136, 136), True)
    assert last.transport.wavelength_nm.size == 4
    assert next(states, None) is None


def _bands(transport: Any) -> dict[str, Any]:
    return {"wavelength_nm": transport.wavelength_nm, "width_nm": transport.width_nm}


def test_the_python_of_a_render_has_its_samples_and_its_seed():
    options = RenderOptions(size=16, spp=2, seed=5, band_nm=100.0)
    (state,) = open_source("flat_field", options).states(lambda: None)
    assert "rodcone.render(scene, (16, 16), spp=2, seed=5, **bands)" in state.code
    transport = state.transport
    assert (transport.spp, transport.coverage.mean.shape) == (2.0, (16, 16))
    assert (transport.width_nm == 100.0).all()
    ours = public.render(load("flat_field"), (16, 16), spp=2, seed=5, **_bands(transport))
    assert np.array_equal(transport.radiance, ours.radiance)


def test_a_file_of_radiance_is_photographed_as_it_is(tmp_path: Path):
    radiance = public.render("flat_field", (16, 20), wavelength_nm=np.arange(400.0, 780.0, 40.0), spp=2).relight()
    path = tmp_path / "seen.exr"
    public.write_exr(radiance, path)
    source = open_source(str(path), RenderOptions())
    (state,) = source.states(never_cancel)
    assert source.groups == {next(iter(state.transport.groups)): True}
    assert photograph(state.transport, Controls()).picture.shape == (16, 20, 3)
    picture = ran(python_of(state.code, Controls()))["picture"]
    assert np.array_equal(picture, photograph(state.transport, Controls()).picture)


def test_reflectances_take_other_lamps_and_the_copied_python_opens_them(tmp_path: Path):
    path = tmp_path / "seen.png"
    rng = np.random.default_rng(1)
    path.write_bytes(to_png(rng.integers(130, 170, (16, 20, 3), np.uint8)))
    source = open_source(str(path), RenderOptions())
    (state,) = source.states(never_cancel)
    assert source.groups == {"light": False}
    shot, own = (photograph(state.transport, Controls(lamps=lamps)) for lamps in ({"light": Lamp("A")}, {}))
    assert np.array_equal(ran(python_of(state.code, Controls()))["picture"], own.picture)
    assert not np.array_equal(own.exposed.light.spectrum, shot.exposed.light.spectrum)


def test_up_to_four_views_are_read_each_of_a_camera_that_is_there() -> None:
    views = [[0, "truth"], [1, "picture"], [0, "picture"], [1, "truth"]]
    for count in range(1, 5):
        assert read_views(views[:count], 2) == [tuple(pair) for pair in views[:count]]
    wrong = ([], [*views, [0, "truth"]], [[2, "truth"]], [[-1, "truth"]], [[True, "truth"]], [[0, "holiday"]], [0, 1])
    for value in (*wrong, [[0, "truth", 1]], {"0": "truth"}, "truth", None):
        refusal(read_views, value, 2, match=r"give up to four of \[camera, view\], cameras from 0")
    refusal(read_views, [[1, "truth"]], 1, match=r"views: \[1, 'truth'\] is not allowed")


def test_a_messages_limits_are_kept_to_the_unit() -> None:
    """200 000 characters, a page's name of 40, numbers up to 2^53 - all of them whole in JSON -, two cameras."""
    text = '{"kind": "hello", "number": 1}'
    assert read_message(text.ljust(200_000)) == {"kind": "hello", "number": 1}
    refusal(read_message, text.ljust(200_001), match="message: 200001 characters; allowed: 200000")
    assert read_message(json.dumps({"kind": "hello", "number": 1, "page": "p" * 40}))["page"] == "p" * 40
    refusal(read_message, json.dumps({"kind": "hello", "number": 1, "page": "p" * 41}), match="allowed: 40 characters")
    for number in (0, 2**53):
        assert read_message(json.dumps({"kind": "hello", "number": number}))["number"] == number
    for number in (-1, 2**53 + 1):
        refusal(read_message, json.dumps({"kind": "hello", "number": number}), match="number: ")
    for count in (1, 2):
        asked = {"kind": "histogram", "number": 1, "cameras": [{}] * count}
        assert read_message(json.dumps(asked)) == asked
    for count in (0, 3):
        asked = {"kind": "histogram", "number": 1, "cameras": [{}] * count}
        refusal(read_message, json.dumps(asked), match="send one or two")


def test_each_kind_of_message_has_its_own_keys_and_all_of_them() -> None:
    keys = {
        "hello": (), "cancel": (), "scene": ("name",), "sensor": ("files",), "show": ("cameras", "views"),
        "pixel": ("cameras", "row", "column"), "histogram": ("cameras",), "dng": ("cameras",),
    }  # fmt: skip
    assert {kind: tuple(of) for kind, of in KINDS.items()} == keys
    for kind, of in keys.items():
        whole = {"kind": kind, "number": 3} | {key: [{}] if key == "cameras" else 0 for key in of}
        assert read_message(json.dumps(whole)) == whole
        for key in of:
            short = {name: value for name, value in whole.items() if name != key}
            refusal(read_message, json.dumps(short), match=f"message: '{key}' is missing")
        refusal(read_message, json.dumps(whole | {"more": 1}), match="more")


def test_a_newer_message_of_its_kind_and_any_of_a_kind_before_goes_first() -> None:
    kinds = list(KINDS)
    for own, mine in enumerate(kinds):
        for other, theirs in enumerate(kinds):
            for number in (4, 5, 6):
                pending = {"kind": theirs, "number": number}
                first = number > 5 if own == other else other < own
                assert is_superseded_by({"kind": mine, "number": 5}, pending) is first, (mine, pending)


def test_as_many_files_and_sensors_are_taken_as_are_allowed(tmp_path: Path) -> None:
    """Eight files of one sensor; a hundred sensors, each in a folder of the next number."""
    toml = preset_file("low_noise").read_text("utf-8")
    tables = {f"table {n}.csv": "wavelength_nm,value\n400,1\n" for n in range(8)}
    for number in range(98):
        (tmp_path / str(number)).mkdir()
    path, sensor = write_dropped({"mine.toml": toml, **dict(list(tables.items())[:7])}, tmp_path)
    assert path == tmp_path / "98" / "mine.toml"
    assert sensor == preset(path)
    assert len(list(path.parent.iterdir())) == 8
    refusal(write_dropped, {"mine.toml": toml, **tables}, tmp_path, match="that it names, 8")
    assert write_dropped({"mine.toml": toml}, tmp_path)[0] == tmp_path / "99" / "mine.toml"
    refusal(write_dropped, {"mine.toml": toml}, tmp_path, match="sensor: 100 were dropped; allowed: 100")


def test_settings_stand_in_from_half_a_second_of_sums_on() -> None:
    """Pixels times 21 x 21 neighbours times a patch of 3: 65 536 pixels times 4 000 are the limit."""
    wide = Controls(processor="interleaved", settings={"neighbourhood": 21, "patch": 3})
    most = 65_536 * 4_000 // (21**2 * 3)
    assert stand_in(wide, most) == wide
    assert stand_in(wide, most + 1) == replace(wide, settings={})


def test_settings_and_tables_have_their_limits() -> None:
    for name, values, beyond in (("neighbourhood", (3, WIDEST), WIDEST + 2), ("patch", (1, 9), 11)):
        for value in values:
            own = Controls(processor="interleaved", settings={name: value})
            assert getattr(options_of(own)["settings"], name) == value
        refusal(lambda: Controls(processor="interleaved", settings={name: beyond}), match=f"settings.{name}: {beyond}")  # noqa: B023
    points = [[380.0 + n / 10, 1.0] for n in range(MOST_POINTS + 1)]
    lamps = [{"lamps": {"sun": {"table": points[:count]}}} for count in (MOST_POINTS, MOST_POINTS + 1)]
    assert len(controls_from(lamps[0]).lamps["sun"].table) == MOST_POINTS
    refusal(controls_from, lamps[1], match=f"{MOST_POINTS + 1} points; allowed: {MOST_POINTS}")


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


def test_memory_is_given_back_once_in_so_many_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    turns: list[int] = []
    session = Session(of_transport(small_transport()))
    monkeypatch.setattr("studies.explore.session.TRIM_AFTER", 3)
    monkeypatch.setattr("studies.explore.session.release_memory", lambda: turns.append(session._turns))
    page, first = connected(session), session._turns
    for number in range(8):
        page.ask(session, "show", number)
    last = session._turns
    session.close()
    assert turns == [turn for turn in range(first + 1, last + 1) if turn % 3 == 0]
    assert len(turns) >= 2


def test_an_answer_brings_eight_notes_at_most(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order of their words, each once."""

    def noted(message: dict[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        for number in range(12, 2, -1):
            for _ in range(2):
                warnings.warn(f"note {number:02}", stacklevel=1)
        return {}, []

    page = connected(session)
    monkeypatch.setattr(session, "_answer", noted)
    assert page.ask(session, "histogram", 1, cameras=[QUICK])["notes"] == [
        f"note {number:02}" for number in range(3, 11)
    ]


def test_a_slow_processor_is_at_work_in_a_process_that_reads_its_task(monkeypatch: pytest.MonkeyPatch) -> None:
    """The child is Python with one line of code; run here, that line develops what it is given."""
    came = threading.Event()
    told: list[Any] = []

    class Child:
        returncode = 0

        def __init__(self, arguments: list[str], **_: Any) -> None:
            self.arguments = arguments

        def communicate(self, task: bytes) -> tuple[bytes, None]:
            program, option, code = self.arguments
            assert (program, option) == (sys.executable, "-c")
            given, taken = io.BytesIO(task), io.BytesIO()
            monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=given))
            monkeypatch.setattr(sys, "stdout", SimpleNamespace(buffer=taken))
            exec(code, {})
            return taken.getvalue(), None

    monkeypatch.setattr("studies.explore.slow.subprocess.Popen", Child)
    begin("bm3d", partial(divmod, 17, 5), lambda result: told.append(result) or came.set())
    assert came.wait(30)
    assert told == [(3, 2)]
