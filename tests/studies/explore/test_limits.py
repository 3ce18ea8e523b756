"""Defaults and limits of everything that the page may send, one by one; what is kept, and what asks for a render."""

from dataclasses import fields, replace
from itertools import product
from math import nextafter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from explore_sample import small_transport
from refusal import refusal

from isp.processors.catalogue import PROCESSORS, libraries
from isp.processors.piecewise import takes
from render.illuminants import illuminant_names
from render.spectrum import VISIBLE_NM
from sensor.cfa import MOSAICS
from sensor.exposure import RULES
from sensor.presets import preset_names
from studies.explore import messages, server, views
from studies.explore import source as source_module
from studies.explore.controls import MOST_POINTS, WIDEST, Controls, Lamp, controls_from, mosaics_of, to_json
from studies.explore.memo import Memo
from studies.explore.messages import MOST_CHARACTERS, MOST_DROPS, MOST_FILES, MOST_OF_A_PAGE, first_message
from studies.explore.slow import MOST_SUMS, is_slow
from studies.explore.source import RenderOptions, of_transport, open_source
from studies.explore.views import VIEWS
from studies.study.study import WHITE_BALANCES

# Default, least and most of each number, as the page and `rodcone.explorer_view` take it.
NUMBERS: dict[str, tuple[float | None, float, float]] = {
    "level_cd_m2": (25.0, 1e-6, 1e9), "exposure_s": (0.066, 1e-9, 1e4), "gain": (None, 1.0, 1024.0),
    "iso": (None, 1e-6, 1e9), "seed": (0, 0, 2**31), "exposure_number": (0, 0, 2**31), "frames": (1, 1, 64),
    "flicker_depth": (0.0, 0.0, 1.0), "flicker_hz": (100.0, 0.1, 1e6), "row_time_us": (None, -1e5, 1e5),
}  # fmt: skip
OTHERS: dict[str, Any] = {
    "lamps": {}, "reference_light": "D65", "exposure": "auto:information", "sensor": "low_noise", "mosaic": "rgbw",
    "lens": {}, "lens_table": "own", "pixel": {}, "bits": None, "shot_noise": True, "processor": "ple", "settings": {},
    "white_balance": "as-shot",
}  # fmt: skip
OPTIONS: dict[str, tuple[float | None, float, float]] = {
    "size": (None, 16, 2048), "spp": (None, 1, 1 << 16), "band_nm": (20.0, 1.0, 100.0), "seed": (0, 0, 2**31),
}  # fmt: skip


def beyond(value: float, towards: float) -> float:
    """The next whole number, or the next number of any kind."""
    if isinstance(value, int):
        return value + (1 if towards > value else -1)
    return nextafter(value, towards)


@pytest.mark.parametrize(("kind", "numbers"), [(Controls, NUMBERS), (RenderOptions, OPTIONS)])
def test_each_number_has_its_default_and_its_two_limits(kind: Any, numbers: dict[str, Any]) -> None:
    for name, (default, least, most) in numbers.items():
        assert getattr(kind(), name) == default, name
        for value in (least, most):
            assert getattr(kind(**{name: value}), name) == value, name
        for end, towards in ((least, -np.inf), (most, np.inf)):
            refusal(kind, **{name: beyond(end, towards)}, match=f"{name}: ")
    others = OTHERS if kind is Controls else {"render": False, "trust_scene": False, "define": (), "force": False}
    assert {field.name for field in fields(kind)} == {*numbers, *others}, "a field without a line here"
    for name, default in others.items():
        assert getattr(kind(), name) == default, name


@pytest.mark.parametrize("absent", ["", "bm3d"])
def test_processors_are_offered_whose_libraries_are_all_there(absent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "find_spec", lambda name: None if name == absent else name)
    offered = first_message(of_transport(small_transport()), ())["processors"]
    assert set(offered) == {name for name in PROCESSORS if absent not in libraries(name)}
    assert (len(offered) < len(PROCESSORS)) == bool(absent)


def test_ports_go_to_the_last_that_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any other is refused in a line, and never comes to the system's own words, which name no remedy."""
    bound: list[int] = []

    class Socket:
        def bind(self, address: tuple[str, int]) -> None:
            bound.append(address[1])

        def __getattr__(self, name: str) -> Any:
            return lambda *_: None

    monkeypatch.setattr(server.socket, "socket", lambda *_: Socket())
    for port in (0, 65_535):
        server.listen(port)
    for port in (-1, 65_536):
        refusal(server.listen, port, match="port: .* is outside 0 to 65535")
    assert bound == [0, 65_535]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_no_browser_reads_is_never_sent(value: float) -> None:
    """JavaScript's JSON has no NaN: a message that held one would end the page's connection without a word."""
    with pytest.raises(ValueError, match="JSON"):
        server.packed({"facts": [{"snr_db": value}]}, ())


def test_a_lamp_has_its_default_and_its_limits() -> None:
    assert Lamp() == Lamp("own", 1.0, ())
    for power in (0.0, 1e9):
        assert controls_from({"lamps": {"sun": {"power": power}}}).lamps["sun"].power == power
    for power in (-1e-9, nextafter(1e9, np.inf)):
        refusal(controls_from, {"lamps": {"sun": {"power": power}}}, match="power: ")


def test_the_first_message_holds_everything_that_the_page_offers() -> None:
    source = replace(of_transport(small_transport()), title="a room", notes=("one", "two"), groups={"sun": True})
    said = first_message(source, ("one scene", "another"))
    assert {name: said[name] for name in ("title", "groups", "assumed", "scenes")} == {
        "title": "a room", "groups": {"sun": True}, "assumed": ["one", "two"], "scenes": ["one scene", "another"],
    }  # fmt: skip
    assert said["controls"] == to_json(Controls())
    assert said["illuminants"] == list(illuminant_names())
    assert said["rules"] == [*RULES, "time"]
    assert said["white_balances"] == list(WHITE_BALANCES)
    assert said["views"] == list(VIEWS)
    assert list(said["sensors"]) == list(preset_names())
    assert set(said["processors"]) <= set(PROCESSORS)
    assert {name for name in PROCESSORS if not libraries(name)} <= set(said["processors"])
    for name, told in said["processors"].items():
        assert (told["slow"], told["source"]) == (is_slow(name), PROCESSORS[name].source)
        assert bool(told["settings"]) == (name in ("interleaved", "interleaved_paper"))
    assert set(said) == {
        *("title", "controls", "groups", "illuminants", "rules", "white_balances", "levels", "scenes", "sensors"),
        *("processors", "mosaics", "views", "assumed", "lenses"),
    }


def test_eight_results_are_kept_of_each_stage_and_the_one_longest_unused_goes() -> None:
    checks: list[int] = []
    made: list[tuple[str, int]] = []
    memo = Memo(lambda: checks.append(len(made)))

    def make(stage: str, key: int) -> int:
        made.append((stage, key))
        return 10 * key

    for stage in ("a", "b"):
        for key in range(8):
            assert memo.of(stage, key, make, stage, key) == 10 * key
    assert (len(made), len(checks)) == (16, 16), "nobody asks twice, nor before a stage that isn't run"
    assert memo.of("a", 0, make, "a", 0) == 0  # used again: 1 is now the oldest
    assert memo.of("a", 8, make, "a", 8) == 80
    assert (memo.kept("a", 1), memo.kept("a", 0), memo.kept("b", 1)) == (None, 0, 10)
    assert memo.kept("c", 1) is None
    assert made[16:] == [("a", 8)]
    memo.keep("c", 5, "five")
    memo.keep("c", 5, "cinq")
    assert memo.kept("c", 5) == "cinq"
    assert memo.of("c", 5, make, "c", 5) == "cinq"


def test_each_option_that_asks_for_a_render_does_so_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shipped light is of the catalogue's scenes, in even bands: without --render, --spp and --seed."""
    found = open_source("color_checker", RenderOptions(size=256, band_nm=20.0))
    (state,) = found.states(lambda: None)
    assert state.last
    assert "rodcone.load_transport('color_checker', size=(170, 256))" in state.code
    assert found.title == "color_checker"
    assert "rendered before" in found.notes[0]
    assert found.groups == dict.fromkeys(state.transport.groups, False)
    for options in ({"render": True}, {"spp": 64}, {"seed": 1}, {"band_nm": 40.0}, {"size": 250}):
        source = open_source("color_checker", RenderOptions(**{"size": 256} | options))
        assert not any("rendered before" in note for note in source.notes), options


@pytest.mark.parametrize(
    ("size", "spp", "steps"),
    [
        (128, 16, [(128, 16)]), (128, 17, [(128, 16), (128, 17)]), (129, 16, [(64, 16), (129, 16)]),
        (129, 17, [(64, 16), (129, 16), (129, 17)]), (256, None, [(64, 16), (256, 16), (256, 64)]),
    ],
)  # fmt: skip
def test_a_render_is_shown_by_fewer_pixels_and_fewer_samples_first(
    size: int, spp: int | None, steps: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over 128 pixels first 64, over 16 samples first 16; each goes on with the samples that its size has."""
    asked: list[dict[str, Any]] = []
    between: list[int] = []

    def render(scene: Any, film: tuple[int, int], progress: Any, **options: Any) -> Any:
        asked.append({"film": film} | options)
        progress(0.5, None)
        return f"transport {len(asked)}"

    monkeypatch.setattr(source_module, "render", render)
    options = RenderOptions(size=size, spp=spp, seed=7, band_nm=50.0)
    states = list(open_source("flat_field", options).states(lambda: between.append(1)))
    assert [(x["film"], x["spp"]) for x in asked] == [((side, side), count) for side, count in steps]
    assert [state.last for state in states] == [False] * (len(steps) - 1) + [True]
    assert [state.transport for state in states] == [f"transport {n}" for n in range(1, len(steps) + 1)]
    assert len(between) == len(steps)
    before: dict[Any, str] = {}
    for number, (one, state) in enumerate(zip(asked, states, strict=True), 1):
        assert one["resume"] == before.get(one["film"])
        before[one["film"]] = f"transport {number}"
        assert one["seed"] == 7
        assert np.ptp(one["width_nm"]) < 1e-9
        assert (one["wavelength_nm"].size, one["wavelength_nm"][0]) == (8, VISIBLE_NM[0] + 25.0)
        assert f"rodcone.render(scene, {one['film']!r}, spp={one['spp']}, seed=7, **bands)" in state.code
        assert "edges_nm = np.linspace(380.0, 780.0, 9)" in state.code


def test_bands_are_as_near_the_width_asked_for_as_a_whole_number_of_them_allows() -> None:
    """400 nm: of 20 nm 20 bands, of 30 nm 13, of 1 nm 400; never under four."""
    for band_nm, count in ((20.0, 20), (30.0, 13), (1.0, 400), (100.0, 4), (80.0, 5)):
        nm, width = source_module._bands(RenderOptions(band_nm=band_nm))
        assert (nm.size, width.sum(), nm[0] - width[0] / 2) == (count, pytest.approx(400.0), pytest.approx(380.0))


def test_what_a_scene_file_is_opened_with_is_in_its_python(tmp_path: Path) -> None:
    path = tmp_path / "room.xml"
    path.write_text(
        '<scene version="3.0.0"><default name="power" value="1"/><sensor type="perspective"/><shape type="sphere">'
        '<transform name="to_world"><translate z="4"/></transform></shape>'
        '<emitter type="constant"><spectrum name="radiance" value="$power"/></emitter></scene>',
        "utf-8",
    )
    for trusted, defined in product((False, True), ((), ("power=2",))):
        source = open_source(str(path), RenderOptions(size=16, spp=1, trust_scene=trusted, define=defined))
        code = next(iter(source.states(lambda: None))).code
        assert ("trust=True" in code) == trusted
        assert ("define={'power': '2'}" in code) == bool(defined)


def test_each_processor_is_offered_the_mosaics_that_it_develops() -> None:
    """One of a tile of its own; one on the backend all of R, G, B and W; `ple` and `any_mosaic` what they take."""
    known = {name: set("".join(tile)) for name, tile in MOSAICS.items()}
    for name, processor in PROCESSORS.items():
        offered = mosaics_of(processor)
        if processor.mosaic == "own":
            wanted = {x for x, tile in MOSAICS.items() if name != "ple" or takes(tile)} | {"own"}
        elif processor.mosaic == "rgbw" and processor.on_backend:
            wanted = {x for x, letters in known.items() if letters == set("RGBW")}
        else:
            wanted = {processor.mosaic}
        assert set(offered) == wanted, name
        assert len(offered) == len(wanted)
    assert {"rgbw", "rgbw_4x4"} <= set(mosaics_of(PROCESSORS["interleaved"]))


def test_a_connection_is_read_at_the_pace_that_is_stated() -> None:
    """400 messages a second, 4 million characters a second, a second's worth at once."""
    assert (server.MOST_A_SECOND, server.MOST_CHARACTERS_A_SECOND, server.BURST_S) == (400, 4_000_000, 1.0)
    assert (server.HOST, MOST_CHARACTERS, MOST_OF_A_PAGE, MOST_FILES, MOST_DROPS) == ("127.0.0.1", 200_000, 40, 8, 100)
    assert (MOST_POINTS, WIDEST, MOST_SUMS) == (2000, 41, 65_536 * 4000)
    assert (views.MOST_SIGMAS, views.MOST_LUMINANCE_ERROR, views.MOST_DELTA_E, views.MOST_SNR_DB) == (4, 0.25, 10, 40)
    assert (views.BINS, views.LEAST_E) == (80, 0.5)
