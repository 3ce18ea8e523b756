"""Speed against error: the front, what is measured, and the page."""

import json
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from command_line import call, check_refusals
from hypothesis import given
from hypothesis import strategies as st

from scenes.catalogue import load
from sensor.presets import preset
from studies.commands.bench import _print_stage
from studies.pages.speed_page import LEAST_SHARE, bench_page
from studies.speed.points import Times, Timing, front, stage_json, time_calls
from studies.speed.stages import STAGES, Bench, stages

TINY = Bench(
    scene="flat_field", size=16, picture=32, bands=(4, 40), samples=(32, 64), neighbourhoods=(5, 7), patches=(1, 3)
)


def point(seconds: float, error_e: float, name: str = "x") -> Timing:
    return Timing(name, Times(seconds, seconds, 2 * seconds), error_e)


def stage(*points: Timing) -> dict[str, Any]:
    return stage_json("bands", "How many?", "the last", 10.0, points, points[-1].times)


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

    made = time_calls({"a": lambda: call("a", 9.0, 1.0, 5.0, 2.0), "b": lambda: call("b", 8.0, 3.0, 3.0, 4.0)}, 3)
    assert calls == ["a", "b"] * 4
    assert made == {"a": (7, Times(9.0, 2.0, 20.0)), "b": (8, Times(8.0, 3.0, 30.0))}
    assert time_calls({"once": lambda: call("c", 6.0)}, 0) == {"once": (9, Times(6.0, 6.0, 60.0))}


def test_ratios_stand_beside_seconds() -> None:
    made = stage(point(1.0, 5.0), point(4.0, 0.0))
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
def measured() -> list[dict[str, Any]]:
    return list(stages(TINY, load(TINY.scene), preset(TINY.sensor)))


NUMBERS = {
    "choice": "7 bands", "seconds": 0.0125, "time_over_reference": 0.25, "processor_s": 1.5,
    "processor_over_reference": 0.75, "first_s": 3.25, "error_e": 2.5, "share_of_noise_variance": 0.0637,
    "on_front": True,
}  # fmt: skip


def test_every_number_of_a_choice_stands_in_page_and_table_with_its_factor_and_unit(capsys) -> None:
    small = NUMBERS | {"choice": "all", "share_of_noise_variance": LEAST_SHARE / 2, "on_front": False}
    facts = {"name": "bands", "question": "How many?", "reference": "40 bands", "reference_s": 0.05,
             "reference_processor_s": 2.0, "noise_e": 12.5, "points": [NUMBERS, small]}  # fmt: skip
    results = {"rodcone": "1", "settings": {"scene": "s", "sensor": "p"}, "machine": {"processor": "P", "cores": 2}}
    page = unescape(bench_page(results | {"environment": {}, "stages": [facts]})).replace("\N{NO-BREAK SPACE}", " ")
    assert "Reference: 40 bands; it takes 50 ms, 2 s of processor time. The sensor's own noise is 12.5 e⁻." in page
    rows = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", page)]
    assert list(zip(*rows, strict=True)) == [
        ("Choice", "7 bands", "all"), ("Time", "12.5 ms", "12.5 ms"), ("Over the reference's", "0.25", "0.25"),
        ("Processor", "1.5 s", "1.5 s"), ("Over the reference's", "0.75", "0.75"), ("First call", "3.25 s", "3.25 s"),
        ("Error, e⁻", "2.5", "2.5"), ("Share of the noise variance", "6.4 %", "under 0.001 %"),
        ("Front", "on the front", ""),
    ]  # fmt: skip
    _print_stage(facts)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert " ".join(lines[2]) == "reference: 40 bands, 0.05 s, processor 2 s; sensor noise 12.5 e-"
    assert lines[4] == ["*7", "bands", "0.0125", "0.25", "1.5", "0.75", "2.5", "6.4%"]


@pytest.mark.thorough
def test_the_command_writes_page_and_json(tmp_path, monkeypatch, measured):
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
