"""What commands print, write and ask for: table, JSON and file hold one computation's numbers, each in its own place.

What is computed has tests of its own; here a stand-in gives numbers of which no two are alike.
"""

import csv
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy
import sweep_sample as SAMPLE
from command_line import call
from matplotlib.figure import Figure
from PIL import Image

from rodcone.progress import duration
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.presets import preset, vary
from studies.commands import dataset as dataset_command
from studies.commands import expect as expect_command
from studies.commands import plot as plot_command
from studies.commands import reference as reference_command
from studies.commands import score as score_command
from studies.commands import table as table_command
from studies.dataset.order import SetOrder
from studies.design.expect import ExpectedError
from studies.score.figure import Merit
from studies.score.over_light import AtLight
from studies.score.sharpness import edge_coverage
from studies.study.study_file import DEMO_STUDY, read_study


def printed(*words: object) -> str:
    code, out, err = call(words)
    assert code == 0, err
    return out


def lines_of(out: str) -> list[list[str]]:
    return [line.split() for line in out.splitlines()]


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))


def _encoded(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def test_mtf_tells_a_pixels_own_response_of_an_edge_in_a_region(tmp_path: Path) -> None:
    """sin(pi f) / (pi f) along both axes at 5 degrees, 0.5 at 0.604; around the region there is noise."""
    rng, side = np.random.default_rng(2), 64
    linear = rng.uniform(0.0, 1.0, (side + 9, side + 20, 3))
    # three colours rise together, so their luminance is in proportion to each
    linear[5 : side + 5, 13 : side + 13] = (0.1 + 0.8 * edge_coverage(side))[..., None] * [1.0, 0.7, 0.9]
    for name, values in (("coded", _encoded(linear)), ("linear", linear)):
        Image.fromarray(np.rint(255 * values).astype(np.uint8)).save(tmp_path / f"{name}.png")
    angle = np.radians(5.0)
    region = ("--roi", 13, 5, side, side)
    for name, option in (("coded", ()), ("linear", ("--linear",))):
        words = ("mtf", tmp_path / f"{name}.png", *option, *region)
        told = json.loads(printed(*words, "--json", "-o", tmp_path / "response.csv"))
        frequency, mtf = np.array(told["frequency_cycles_per_px"]), np.array(told["mtf"])
        wanted = np.sinc(frequency * np.cos(angle)) * np.sinc(frequency * np.sin(angle))
        assert told["mtf50_cycles_per_px"] == pytest.approx(0.6042, abs=0.01)
        assert abs(told["angle_deg"]) == pytest.approx(5.0, abs=0.05)
        assert (frequency[0], frequency[-1]) == (0.0, pytest.approx(1.0, abs=0.02))
        assert np.abs(mtf - wanted)[frequency < 0.6].max() < 0.02
        rows = read_csv(tmp_path / "response.csv")
        assert [(float(row["cycles_per_px"]), float(row["mtf"])) for row in rows] == list(
            zip(frequency, mtf, strict=True)
        )
        head, *table = lines_of(printed(*words))
        assert head == ["figure", "unit", "value"]
        at = {x: f"{np.interp(x, frequency, mtf):.4f}" for x in (0.125, 0.25, 0.5)}
        assert table == [
            ["MTF50", "cycles/px", f"{told['mtf50_cycles_per_px']:.4f}"],
            *(["MTF", "at", f"{x:g}", "cycles/px", "1", value] for x, value in at.items()),
            ["angle", "of", "the", "edge", "degrees", f"{told['angle_deg']:.2f}"],
        ]


MERITS = [
    Merit("a.one", "first", "e-", "ISO 1", "bright", 1.5, measured=1.375, low=1.25, high=1.75),
    Merit("a.two", "second", "dB", "ISO 2", "dim", 10.0, measured=12.0, low=11.0, high=13.0),
    Merit("a.three", "third", "lux", "ISO 3", "dark", 5.0, measured=6.0),
]
CURVE = [AtLight(0.5, -3.25, -3.5, 0.125, 0.0625, 8.5, 9.5), AtLight(20.0, 31.5, 30.25, 0.75, 0.875, 2.5, 2.25)]


def test_score_asks_for_the_lens_and_light_that_are_typed_and_tells_each_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Any, ...]] = []

    def stand_in(result: Any) -> Callable[..., Any]:
        return lambda sensor, *rest, **_: asked.append((sensor, *rest)) or result

    monkeypatch.setattr(score_command, "merits_of", stand_in(MERITS))
    monkeypatch.setattr(score_command, "over_light", stand_in(CURVE))
    names = ("low_noise", "table1_output")
    words = ("score", *names, "--light", "A", "--exposure", "20ms", "--f-number", 4, "--diffraction", 0.5, "--seed", 3)
    only = ("--only", "snr10,a.one", "--only", "b", "--gain", 2)
    told = json.loads(printed(*words, *only, "--json", "-o", tmp_path / "sheet.csv"))
    for name, (sensor, *rest) in zip(names, asked, strict=True):
        assert rest == ["A", 0.02, ["snr10", "a.one", "b"], 3]
        assert sensor.gain == 2.0
        assert (sensor.lens.f_number, sensor.lens.diffraction) == (4.0, 0.5)
        assert sensor.pixel == preset(name).pixel
    agree = [True, False, None]
    assert list(told) == list(names)
    for of in told.values():
        assert [one["agrees"] for one in of] == agree
        assert [(one["computed"], one["measured"], one["low"], one["high"]) for one in of] == [
            (1.5, 1.375, 1.25, 1.75),
            (10.0, 12.0, 11.0, 13.0),
            (5.0, 6.0, None, None),
        ]
    rows = read_csv(tmp_path / "sheet.csv")
    assert [row["sensor"] for row in rows] == [name for name in names for _ in MERITS]
    for row, one in zip(rows, MERITS * 2, strict=True):
        assert {key: row[key] for key in ("name", "title", "unit", "standard")} == {
            key: getattr(one, key) for key in ("name", "title", "unit", "standard")
        }
        assert [float(row[key]) for key in ("computed", "measured")] == [one.computed, one.measured]
    out = lines_of(printed(*words, *only))
    assert [out[0], out[5]] == [["low_noise"], ["table1_output"]]
    assert out[2:5] == out[7:10] == [
        ["first", "e-", "1.5", "1.375", "1.25", "1.75", "ISO", "1"],
        ["second", "dB", "10", "12", "11", "13", "ISO", "2"],
        ["third", "lux", "5", "6", "—", "—", "ISO", "3"],
    ]  # fmt: skip
    assert out[10][:4] == ["2", "of", "4", "closed"]
    asked.clear()
    swept = json.loads(printed(*words, "--sweep", "--json", "-o", tmp_path / "curve.csv"))
    assert [rest for _, *rest in asked] == [["A", 0.02, 3]] * 2
    assert swept == {name: [asdict(row) for row in CURVE] for name in names}
    rows = read_csv(tmp_path / "curve.csv")
    assert [(row["sensor"], float(row["lux"]), float(row["measured_accuracy"])) for row in rows] == [
        (name, row.lux, row.measured_accuracy) for name in names for row in CURVE
    ]
    _, *table = lines_of(printed(*words, "--sweep"))
    assert table[:2] == [
        ["low_noise", "0.5", "-3.25", "-3.5", "0.125", "0.0625", "8.5", "9.5"],
        ["low_noise", "20", "31.5", "30.25", "0.75", "0.875", "2.5", "2.25"],
    ]


def test_expect_asks_for_what_is_typed_and_tells_each_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """500 lux on surfaces that give back 18 % are 500 x 0.18 / pi cd/m2."""
    asked: list[tuple[Any, ...]] = []
    names = [field.name for field in fields(ExpectedError)]

    def stand_in(sensor: SensorConfig, *choices: Any) -> list[ExpectedError]:
        asked.append((sensor, *choices))
        first = 10.0 * len(asked)
        return [ExpectedError(*(first + 0.25 * i + level for i in range(len(names)))) for level in (0, 100)]

    monkeypatch.setattr(expect_command, "expect_errors", stand_in)
    words = ("expect", "low_noise", "table1_output", "--mosaic", "bayer", "--level", "2cd/m2", "--level", "500lux")
    more = ("--light", "A", "--prior", "photographs", "--blur", "--exposure", "20ms")
    told = json.loads(printed(*words, *more, "--json", "-o", tmp_path / "errors.csv"))
    for name, (sensor, levels, *rest) in zip(("low_noise", "table1_output"), asked, strict=True):
        assert sensor == vary(preset(name), "bayer")
        assert levels == pytest.approx([2.0, 500 * 0.18 / pi])
        assert rest == ["A", 0.02, "photographs", True]
    wanted = {
        f"{name} bayer": [
            {key: first + 0.25 * i + level for i, key in enumerate(names)} for level in (0, 100)
        ]
        for name, first in (("low_noise", 10.0), ("table1_output", 20.0))
    }  # fmt: skip
    assert told == wanted
    rows = read_csv(tmp_path / "errors.csv")
    assert [(row["camera"], {key: float(row[key]) for key in names}) for row in rows] == [
        (camera, row) for camera, of in wanted.items() for row in of
    ]
    asked.clear()
    table = lines_of(printed(*words))
    assert asked[0][2:] == ("D65", "auto:information", "drawn", False)
    psnr, colour = names.index("psnr_db"), names.index("colour")
    assert table[1][-2:] == [f"{10 + 0.25 * psnr + level:.2f}" for level in (0, 100)]
    assert table[2][-2:] == ["+10.00", "+10.00"]
    assert [row[-2:] for row in table[4:]] == [
        [f"{first + 0.25 * colour + level:.2f}" for level in (0, 100)] for first in (10, 20)
    ]


def test_dataset_makes_what_is_typed_and_keeps_the_command_that_makes_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    SAMPLE.picture(tmp_path / "scene.exr")
    Path("a study.toml").write_text('scenes = ["scene.exr"]\nlevels = ["1cd/m2"]\nprocessors = ["bayer"]\n', "utf-8")
    asked: list[Any] = []

    def stand_in(study: Any, out: Path, order: SetOrder, command: str, *_: Any) -> dict[str, Any]:
        asked[:] = [study, out, order, command]
        return {"folder": "made/set", "samples": 7}

    monkeypatch.setattr(dataset_command, "make_set", stand_in)
    words = ("dataset", "a study.toml", "--set", "seeds=3", "-o", "made", "--workers", 1)
    order = {"seed": 5, "truth": "rgb,xyz", "shards": 2, "crop": 16, "diorama": 1}
    typed = [word for name, value in order.items() for word in (f"--{name}", value)]
    told = json.loads(printed(*words, *typed, "--json"))
    assert told == {"folder": "made/set", "samples": 7}
    study, out, kept, command = asked
    assert (study.seeds, str(out), len(study.scenes)) == ((0, 1, 2), "made", 2)
    assert study.scenes[1].source.startswith("diorama-")
    assert vars(kept) == {"generated": 0} | order
    assert command == (
        "rodcone dataset 'a study.toml' --set seeds=3 --generated 0 --seed 5 --truth rgb,xyz --shards 2 --crop 16 "
        "--diorama 1"
    )
    assert printed(*words).split() == ["made/set"]


@dataclass(frozen=True)
class _Chance:
    chance: float = 0.25


def test_reference_asks_for_samples_by_the_share_so_far_and_certifies_each_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The share at one level is 600 over samples and luminance; 512 samples are the first step, and the most added."""
    study, renders, kept = read_study(DEMO_STUDY), [], []
    luminances = [level.luminance_cd_m2 for level in DEMO_LEVELS if level.name in study.levels]
    assert len(luminances) == len(study.levels)

    def render(scene: Any, size: Any, **asked: Any) -> SimpleNamespace:
        renders.append((size, asked))
        spp = asked["max_spp"]
        return SimpleNamespace(spp=float(spp), seconds=spp / 4, stopped_by="samples", relative_mc_error=3 / spp)

    def share(transport: Any, sensor: SensorConfig, luminance_cd_m2: float, longest_s: float) -> float:
        assert longest_s == study.longest_exposure_s
        assert sensor.lens == study.lens.on(preset(study.sensors[0]).lens)
        return 600.0 / transport.spp / luminance_cd_m2

    stubs = {"render": render, "render_share": share, "halves_agree": lambda _: _Chance(),
             "save_reference": lambda path, transport, facts: kept.append((path, transport, facts))}  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(reference_command, name, stub)
    worst = 600.0 / min(luminances)  # over samples
    until = worst / 900
    code, out, err = call(
        ["reference", "flat_field", "--size", 32, "--until", until, "--max-seconds", "90s", "--out", tmp_path]
    )
    assert code == 0
    steps = [asked["max_spp"] for _, asked in renders]
    assert steps == [512, int(min(1024, 512 * 1.05 * (worst / 512) / until + 1))]
    (size, first), (_, second) = renders
    assert size == (32, 32)
    assert (first["resume"], second["resume"]) == (None, kept[0][1])
    assert (first["seed"], first["max_seconds"]) == (reference_command.SEED, 90.0)
    assert str(kept[0][0]) == out.strip()
    for spp, (_, _, facts) in zip(steps, kept, strict=True):
        assert facts["share"] == pytest.approx(worst / spp)
        assert facts["samples"] == spp
        shares = facts["shares"][study.sensors[0]]
        assert sorted(shares.values()) == pytest.approx(sorted(600.0 / spp / x for x in luminances))
        assert (facts["relative_mc_error"], facts["halves"]) == (3 / spp, {"chance": 0.25})
        assert facts["command"] == "rodcone reference flat_field --size 32"
    left_s = 128 * (1.05 * (worst / 512) / until - 1)
    told = [line for line in err.splitlines() if "samples a pixel" in line]
    assert told == [
        f"rodcone: 512 samples a pixel: {worst / 512:.3g} of the sensor's variance in 95 % of pixels; about "
        f"{duration(left_s)} more to {until:g}",
        f"rodcone: {steps[1]} samples a pixel: {worst / steps[1]:.3g} of the sensor's variance in 95 % of pixels",
    ]


def test_table_tells_the_mean_over_seeds_and_students_interval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the chosen cells alone, by the axes and figures that are typed, with three digits."""
    psnr = {"1cd/m2": (20.0, 21.0, 24.0), "25cd/m2": (30.0, 30.5, 31.5)}
    rows = [
        SAMPLE.row(processor, seed, level=level, psnr_db=db + 5 * (processor == "ple"), mean_electrons='{"W": 40.0}')
        for processor in ("bayer", "ple")
        for level, values in psnr.items()
        for seed, db in enumerate(values)
    ]
    monkeypatch.setattr(table_command, "read_rows", lambda folder: rows if folder == tmp_path else [])
    out = printed(
        "table", tmp_path, "--by", "processor,level", "--show", "psnr_db,electrons_W", "--where", "processor=ple"
    )  # fmt: skip
    head, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in out.splitlines())
    assert [head[0], head[1], head[2].replace("\\", ""), head[3].replace("\\", "")] == [
        "processor",
        "level",
        "psnr_db",
        "electrons_W",
    ]
    assert len(lines) == 2
    for (level, values), line in zip(psnr.items(), lines, strict=True):
        mean = np.mean(values) + 5
        low, high = scipy.stats.t.interval(0.95, 2, mean, scipy.stats.sem(values))
        assert line == ["ple", level, f"{mean:.1f} ± {(high - low) / 2:.1f}", "40.0"]


def test_plot_draws_the_metric_lines_and_cells_that_are_typed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(plot_command, "read_rows", lambda folder: [folder])
    monkeypatch.setattr(plot_command, "panels", lambda *asks: asked.append(asks) or ["a panel"])
    monkeypatch.setattr(plot_command, "metric_figure", lambda *asks: asked.append(asks) or Figure((1, 1)))
    out = tmp_path / "a.svg"
    words = ("--metric", "flip_mean", "--by", "sensor", "--first", "low_noise", "--where", "level=10lux")
    assert printed("plot", tmp_path, "-o", out, *words).strip() == str(out)
    (rows, metric, by, where, first), (parts, drawn) = asked
    assert (rows, by, where, first) == ([tmp_path], "sensor", {"level": "10lux"}, "low_noise")
    assert metric.key == drawn.key == "flip_mean"
    assert parts == ["a panel"]
    assert "<svg" in out.read_text("utf-8")
