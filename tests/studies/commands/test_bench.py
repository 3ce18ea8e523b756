"""Speed against error: the front, what is measured, and the page."""

import json
from pathlib import Path

import pytest
from command_line import call, check_refusals
from hypothesis import given
from hypothesis import strategies as st

from scenes.catalog import load
from sensor.presets import preset
from studies.speed.points import Measured, Stage, Times, front, stage_json, timed
from studies.speed.stages import STAGES, Bench, stages

TINY = Bench(
    scene="flat_field", size=16, picture=32, bands=(4, 40), samples=(32, 64), neighbourhoods=(5, 7), patches=(1, 3)
)


def point(seconds: float, error_e: float, name: str = "x") -> Measured:
    return Measured(name, Times(seconds, seconds, 2 * seconds), error_e)


def stage(*points: Measured) -> Stage:
    return Stage("bands", "How many?", "the last", 10.0, points, points[-1].times)


@given(st.lists(st.tuples(st.integers(1, 6), st.integers(0, 6)), min_size=1, max_size=12))
def test_the_front_is_the_set_of_undominated_choices(pairs: list[tuple[int, int]]) -> None:
    best = [pair for pair, on_front in zip(pairs, front(pairs), strict=True) if on_front]
    undominated = {
        one for one in pairs if not any(other != one and other[0] <= one[0] and other[1] <= one[1] for other in pairs)
    }
    assert sorted(best) == sorted(undominated)


def test_calls_take_turns_the_first_does_not_count_and_the_median_does(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, calls = [0.0], []
    monkeypatch.setattr("studies.speed.points.time.perf_counter", lambda: clock[0])
    monkeypatch.setattr("studies.speed.points.time.process_time", lambda: 10 * clock[0])

    def call(name: str, *seconds: float) -> int:
        clock[0] += seconds[calls.count(name)]
        calls.append(name)
        return len(calls)

    made = timed({"a": lambda: call("a", 9.0, 1.0, 5.0, 2.0), "b": lambda: call("b", 8.0, 3.0, 3.0, 4.0)}, 3)
    assert calls == ["a", "b"] * 4
    assert made == {"a": (7, Times(9.0, 2.0, 20.0)), "b": (8, Times(8.0, 3.0, 30.0))}
    assert timed({"once": lambda: call("c", 6.0)}, 0) == {"once": (9, Times(6.0, 6.0, 60.0))}


def test_ratios_stand_beside_seconds() -> None:
    made = stage_json(stage(point(1.0, 5.0), point(4.0, 0.0)))
    assert [each["time_over_reference"] for each in made["points"]] == [0.25, 1.0]
    assert [each["share_of_noise_variance"] for each in made["points"]] == [0.25, 0.0]
    assert all(each["on_front"] for each in made["points"])


def test_bad_input_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    rows = (
        ("--scene still_live", "did you mean 'still_life'?"),
        ("--sensor lownoise", "did you mean 'low_noise'?"),
        ("--level 500lux", "level"),
        ("--size 8", "size: 8"),
    )
    check_refusals(f"bench -o {tmp_path / 'out'}", rows, tmp_path)


@pytest.fixture(scope="module")
def measured() -> list[Stage]:
    return list(stages(TINY, load(TINY.scene), preset(TINY.sensor)))


@pytest.mark.thorough
def test_the_command_writes_page_and_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: list[Stage]
) -> None:
    asked = []
    monkeypatch.setattr(
        "studies.commands.bench.stages", lambda task, scene, sensor: asked.append(task.samples) or iter(measured)
    )
    written = tmp_path / "new"
    options = ["--scene", "flat_field", "--samples", "16", "--samples", "64"]
    code, out, _ = call(["bench", "-o", written, *options])
    assert (code, asked) == (0, [(16, 64)])
    assert all(word in out for word in ("processor:", "cores:", "drjit:", "ratio", "*40 bands", "bench.html"))
    facts = json.loads((written / "bench.json").read_text())
    assert len(facts["stages"]) == STAGES
    assert facts["machine"]["cores"] >= 1
    assert (written / "bench.html").read_text().lstrip().lower().startswith("<!doctype html>")
