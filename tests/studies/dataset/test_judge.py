"""Pictures judged by a set's truth: closed forms, a sweep's own figures, mistakes recognised, bad input in a line."""

import csv
import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy
import sweep_sample as SAMPLE
import tifffile
from command_line import call
from PIL import Image
from refusal import refusal

from rodcone.colour_spaces import decode_srgb, encode_srgb
from rodcone.digests import digest_inputs
from sensor.presets import low_noise, preset, preset_file, vary
from studies.dataset import judge as judge_module
from studies.dataset.judge import MEASURED, Score, expected, judge, read_picture, scores, scores_of_sweep
from studies.dataset.make_set import make_set
from studies.dataset.order import SetOrder
from studies.dataset.shards import read_shard
from studies.design.expect import expect
from studies.pages import report_text as text
from studies.photograph.picture_file import write_picture
from studies.study.study import SceneChoice, Study
from studies.sweep.export import read_rows
from studies.sweep.workers import InThisProcess, run

HERE = partial(run, executor=InThisProcess())
SIGMA = 0.02
SCENES = 3


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a set of three pictures at two levels by Bayer, and of a sweep of the same study.

    The sensor is a file of one's own, for which nothing is computed in closed form: that takes a second.
    """
    folder = tmp_path_factory.mktemp("judged")
    shutil.copy(preset_file("low_noise"), folder / "mine.toml")
    return made(folder, str(folder / "mine.toml"))


def made(folder: Path, sensor: str) -> Path:
    scenes = []
    for index in range(SCENES):
        path = SAMPLE.picture(folder / f"scene{index}.exr", (16, 20 + 2 * index))
        scenes.append(SceneChoice(str(path), "E"))
    study = Study(tuple(scenes), ("1cd/m2", "25cd/m2"), sensors=(sensor,), processors=("bayer",))
    make_set(study, folder / "out", SetOrder(truth="rgb", shards=2), "rodcone dataset", HERE)
    SAMPLE.swept(study, folder / "out")
    return folder / "out"


def truths(out: Path) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    samples = (sample for path in (out / "set").glob("*.tar") for sample in read_shard(path))
    return {facts["key"]: (encode_srgb(arrays["rgb"].astype(float)), facts) for arrays, facts in samples}


def noisy(out: Path, folder: Path, change: Callable[[np.ndarray], np.ndarray] = lambda picture: picture) -> Path:
    """The truth with white noise of `SIGMA`, then what somebody does to it by mistake."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    for key, (truth, _) in sorted(truths(out).items()):
        picture = np.clip(truth + SIGMA * rng.standard_normal(truth.shape), 0, 1)
        np.save(folder / f"{key}.npy", np.clip(change(picture), 0, 1))
    return folder


def of(scores: list[Score], developer: str) -> list[Score]:
    return [score for score in scores if score.developer == developer]


def test_white_noise_has_the_psnr_of_its_sigma_and_students_interval(out: Path, tmp_path: Path) -> None:
    folder = noisy(out, tmp_path / "mine")
    head, scores = judge(folder, out, "mine", HERE)
    assert head["samples"] == 2 * SCENES
    by_level: dict[str, list[float]] = {}
    for key, (truth, facts) in truths(out).items():
        error = np.load(folder / f"{key}.npy") - truth
        by_level.setdefault(facts["level"], []).append(-10 * np.log10((error**2).mean()))
    for score in of(scores, "mine"):
        values = np.array(by_level[score.level])
        assert score.scenes == SCENES
        assert score.means["psnr_db"] == pytest.approx(values.mean(), abs=1e-9)
        # 16 x 20 pixels of three colours: one standard error of the variance is 4.5 %, 0.2 dB
        assert score.means["psnr_db"] == pytest.approx(-20 * np.log10(SIGMA), abs=0.6)
        interval = scipy.stats.t.interval(0.95, SCENES - 1, values.mean(), scipy.stats.sem(values))
        assert score.halves["psnr_db"] == pytest.approx((interval[1] - interval[0]) / 2, rel=1e-9)
        assert set(score.means) == {metric.key for metric in MEASURED}


def test_a_sweeps_pictures_are_judged_as_the_sweep_measured_them(out: Path, tmp_path: Path) -> None:
    """All but what eight bits lose; and its own figures stand beside them."""
    rows = read_rows(out)
    for row in rows:
        (key,) = [
            key for key, (_, facts) in truths(out).items() if (facts["scene"], facts["level"]) == (row.scene, row.level)
        ]
        shutil.copy(out / "pictures" / row.picture, tmp_path / f"{key}.png")
    _, scores = judge(tmp_path, out, "copied", HERE)
    assert len(of(scores, "copied")) == len(of(scores, "bayer")) == 2
    for copied, own in zip(of(scores, "copied"), of(scores, "bayer"), strict=True):
        assert own.means["psnr_db"] == pytest.approx(
            np.mean([row.psnr_db for row in rows if row.level == own.level]), abs=1e-9
        )
        for key, bound in (
            ("psnr_db", 0.05),
            ("ssim", 0.01),
            ("flip_mean", 0.005),
            ("delta_e_median", 0.3),
            ("pu21_psnr_db", 0.5),
        ):
            assert copied.means[key] == pytest.approx(own.means[key], abs=bound)


def test_white_balances_and_bursts_of_a_sweep_are_not_averaged(out: Path) -> None:
    rows = [vars(row) for row in read_rows(out)]
    grey = [row | {"white_balance": "gray-world", "psnr_db": row["psnr_db"] - 1} for row in rows]
    burst = [row | {"frames": 4, "psnr_db": 99.0} for row in rows]
    plain, both = scores_of_sweep(rows + burst), scores_of_sweep(rows + grey)
    shot, world = of(both, "bayer, as-shot"), of(both, "bayer, gray-world")
    for alone, first, second in zip(of(plain, "bayer"), shot, world, strict=True):
        assert alone.means == first.means
        assert first.means["psnr_db"] - second.means["psnr_db"] == pytest.approx(1)


def test_samples_of_a_scene_are_averaged_before_scenes_are(out: Path) -> None:
    """Scene a has three samples of 10, 20 and 30, scene b one of 40: the mean is 30, of two scenes."""
    (row, *_) = [vars(row) for row in read_rows(out)]
    values = (("a", 10.0), ("a", 20.0), ("a", 30.0), ("b", 40.0))
    (score,) = scores([row | {"scene": scene, "psnr_db": db, "mosaic": "bayer"} for scene, db in values], "mine")
    assert (score.scenes, score.means["psnr_db"]) == (2, 30.0)
    assert score.halves["psnr_db"] == pytest.approx(12.7062 * 10.0, rel=1e-5)


def test_the_closed_form_is_asked_for_each_conditions_own_camera_light_and_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(
        judge_module, "expect", lambda *asks: asked.append(asks) or [SimpleNamespace(psnr_db=20.0 + len(asked))]
    )
    line = {"sensor": "low_noise", "mosaic": "cmyw", "spectrum": "own", "level": "5cd/m2", "exposure": "20ms"}
    lines = [
        line | {"luminance_cd_m2": 5.0},
        line | {"luminance_cd_m2": 90.0, "level": "90cd/m2", "sensor": "table1_output", "exposure": "auto:W"},
        line | {"luminance_cd_m2": 5.0, "sensor": "mine.toml"},
    ]
    told = expected([*lines, lines[0]], "mine")
    assert [asks for _, *asks in asked] == [[[5.0], "D65", 0.02], [[90.0], "D65", "auto:W"]]
    for (sensor, *_), name in zip(asked, ("low_noise", "table1_output"), strict=True):
        assert digest_inputs(sensor) == digest_inputs(vary(preset(name), "cmyw"))
    assert [(x.camera, x.level, x.luminance_cd_m2, x.scenes, x.means["psnr_db"]) for x in told] == [
        ("low_noise, cmyw, own, 20ms", "5cd/m2", 5.0, 0, 21.0),
        ("table1_output, cmyw, own, auto:W", "90cd/m2", 90.0, 0, 22.0),
    ]
    assert all(np.isnan(value) for x in told for key, value in x.means.items() if key != "psnr_db")
    asked.clear()
    own = line | {"luminance_cd_m2": 5.0, "sensor": "low_noise_rgbw.toml", "mosaic": "own"}
    assert [len(expected([own], study)) for study in ("mine", "benchmark")] == [0, 1]
    assert digest_inputs(asked[0][0]) == digest_inputs(preset(str(judge_module.SENSORS / "low_noise_rgbw.toml")))


def test_pictures_of_every_format_are_read_as_what_they_hold(tmp_path: Path) -> None:
    """Eight bits, sixteen, floats that overshoot by a hundredth; upper case and both spellings of TIFF."""
    rng = np.random.default_rng(2)
    whole = rng.integers(0, 256, (4, 5, 3)).astype(np.uint8)
    deep = rng.integers(0, 65_536, (4, 5, 3)).astype(np.uint16)
    Image.fromarray(whole).save(tmp_path / "a.PNG", format="PNG")
    for name in ("a.tif", "a.tiff"):
        tifffile.imwrite(tmp_path / name, deep, photometric="rgb")
        np.testing.assert_array_equal(read_picture(tmp_path / name, (4, 5)), deep / 65_535)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.PNG", (4, 5)), whole / 255)
    Image.fromarray(whole).save(tmp_path / "b.png", format="GIF")
    refusal(read_picture, tmp_path / "b.png", (4, 5), match="b.png: it is no picture of this set")
    assert {".png", ".tif", ".tiff", ".npy"} == set(judge_module.ENDINGS)
    for value, shown in ((-0.0099, 0.0), (1.0099, 1.0), (-0.0101, None), (1.0101, None)):
        np.save(tmp_path / "a.npy", np.where(np.arange(60).reshape(4, 5, 3) == 7, value, 0.5))
        if shown is None:
            refusal(read_picture, tmp_path / "a.npy", (4, 5), match="values from .*; allowed: 0 to 1, 1 is white")
        else:
            assert read_picture(tmp_path / "a.npy", (4, 5))[0, 2, 1] == shown


def test_a_mistake_is_told_from_three_decibels_on() -> None:
    """By the mean over the pictures; the mistake that would undo most is named."""
    mistakes = list(judge_module._MISTAKES)
    for index, words in enumerate(mistakes):
        gains = [0.5 * (number == (index + 1) % 5) + 3.0 * (number == index) for number in range(5)]
        for more, told in ((-0.1, False), (0.1, True)):
            rows = [
                {"psnr_db": psnr, "mistakes": {x: psnr + gain + more for x, gain in zip(mistakes, gains, strict=True)}}
                for psnr in (10.0, 30.0)
            ]
            if told:
                shown = f"they look {words} \\(PSNR 23.1 dB after that, 20.0 dB as they are\\)"
                refusal(judge_module._check_encoding, rows, match=shown)
            else:
                judge_module._check_encoding(rows)


def test_the_page_has_a_table_of_every_metric_for_each_camera() -> None:
    keys = [metric.key for metric in MEASURED]
    means = {key: 3.0 + index / 8 for index, key in enumerate(keys)}
    halves = {key: 0.5 + index / 8 for index, key in enumerate(keys)}
    own = Score("low_noise, bayer", "25cd/m2", "mine", 25.0, 4, means, halves)
    nothing = dict.fromkeys(keys, np.nan)
    told = Score("table1, rgbw", "1cd/m2", "expect, D65", 1.0, 0, nothing | {"psnr_db": 21.5}, nothing)
    page = judge_module.judge_page({"name": "a set", "rodcone": "9.8", "identity": "00ff"}, [own, told])
    assert "Pictures of a set" in page
    assert "rodcone 9.8" in page
    assert "set 00ff" in page
    assert page.count('<img class="chart" src="data:image/svg+xml') == 2
    first, second = page.split("<section")[1:]
    for part, score in ((first, own), (second, told)):
        assert f">{score.camera}</h2>" in part
        assert f"<td>{score.developer}</td>" in part
        for metric in MEASURED:
            assert f">{metric.name}</th>" in part
    for metric in MEASURED:
        mean, half = (text.fixed(of[metric.key], metric.digits) for of in (means, halves))
        assert f">{mean} ± {half}</td>" in first
    assert second.count(">—</td>") == len(keys)  # all but PSNR, and the number of scenes
    assert "21.5</td>" in second


def test_the_chart_has_each_developers_means_intervals_and_a_dotted_line_of_what_is_expected() -> None:
    def score(developer: str, light: float, psnr_db: float, half_db: float, scenes: int = 4) -> Score:
        return Score("a", f"{light:g}cd/m2", developer, light, scenes, {"psnr_db": psnr_db}, {"psnr_db": half_db})

    told = [score("mine", 0.05, 18.0, 1.5), score("expect, D65", 0.05, 17.0, np.nan, 0), score("mine", 25.0, 31.0, 0.5),
            score("expect, D65", 25.0, 33.0, np.nan, 0), score("bayer", 25.0, 29.0, 2.0)]  # fmt: skip
    (axes,) = judge_module.psnr_chart(told).axes
    wanted = {
        "mine": ([0.05, 25.0], [18.0, 31.0], [1.5, 0.5], "-"),
        "expect, D65": ([0.05, 25.0], [17.0, 33.0], [0.0, 0.0], ":"),
        "bayer": ([25.0], [29.0], [2.0], "-"),
    }
    assert len(axes.containers) == len(wanted)
    colours = []
    for drawn, (developer, (light, values, halves, style)) in zip(axes.containers, wanted.items(), strict=True):
        line, _, (bars,) = drawn.lines
        assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == (light, values), developer
        assert [np.ptp(bar[:, 1]) / 2 for bar in bars.get_segments()] == pytest.approx(halves)
        assert line.get_linestyle() == style
        assert {cap.get_markersize() for cap in drawn.lines[1]} == {6.0}  # 3 points on either side
        colours.append(line.get_color())
        (name,) = [text for text in axes.texts if text.get_text() == developer]
        assert name.get_color() == line.get_color()
    assert len(set(colours)) == 3
    words = "PSNR, dB, mean over scenes and its 95 % interval"
    assert (axes.get_xscale(), axes.get_xlabel(), axes.get_title(loc="left") or axes.get_title()) == (
        *("log", "cd/m²"),
        words,
    )


def test_the_truth_itself_has_an_infinite_score() -> None:
    """Two scenes of it: their mean is infinite, and no interval is told; nothing is warned of."""
    row = dict.fromkeys((metric.key for metric in MEASURED), 1.0) | dict.fromkeys(judge_module._PLACE, "a")
    rows = [row | {"scene": scene, "luminance_cd_m2": 4.0, "psnr_db": np.inf} for scene in "ab"]
    (score,) = scores(rows, "mine")
    assert score.means["psnr_db"] == np.inf
    assert not np.isfinite(score.halves["psnr_db"])


@pytest.mark.thorough
def test_the_closed_form_stands_beside_sensors_of_this_package(tmp_path: Path) -> None:
    out = made(tmp_path, "low_noise")
    _, scores = judge(noisy(out, tmp_path / "mine"), out, "mine", HERE)
    dark, light = of(scores, "expect, D65")
    # Bayer under D65 at the set's levels, as the command computes it
    errors = expect(low_noise("bayer"), [1.0, 25.0], "D65")
    assert [dark.means["psnr_db"], light.means["psnr_db"]] == pytest.approx([error.psnr_db for error in errors])
    assert np.isnan(dark.means["ssim"])
    assert dark.scenes == 0
    # behind filters of its own, of which the tile alone doesn't tell
    line = {"sensor": "low_noise", "mosaic": "cmyw", "tile": ["CM", "YW"], "spectrum": "own", "level": "5cd/m2"}
    line |= {"luminance_cd_m2": 5.0, "exposure": "20ms"}
    (score,) = expected([line], "mine")
    (error,) = expect(vary(low_noise(), "cmyw"), [5.0], "D65", 0.02)
    assert score.means["psnr_db"] == pytest.approx(error.psnr_db)
    # a file of one's own is not the frozen list's of the same name
    of_file = line | {"sensor": "low_noise_rgbw.toml", "mosaic": "own"}
    assert [len(expected([of_file], study)) for study in ("mine", "benchmark")] == [0, 1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (decode_srgb, "look linear values; encode them as sRGB"),
        (encode_srgb, "look encoded twice"),
        (lambda picture: picture[..., ::-1], "look blue in red's place"),
        (lambda picture: picture[::-1], "look upside down"),
        (lambda picture: picture[:, ::-1], "look mirrored"),
    ],
)
def test_a_wrong_encoding_is_recognised(change: Any, words: str, out: Path, tmp_path: Path) -> None:
    refusal(judge, noisy(out, tmp_path / "mine", change), out, "mine", HERE, match=words)


def test_tiff_of_16_bits_and_arrays_are_read_alike(out: Path, tmp_path: Path) -> None:
    arrays = noisy(out, tmp_path / "arrays")
    files = tmp_path / "files"
    files.mkdir()
    for path in arrays.glob("*.npy"):
        write_picture(np.load(path), files / f"{path.stem}.tif", bits=16)
    (_, first), (_, second) = judge(arrays, out, "mine", HERE), judge(files, out, "mine", HERE)
    for one, other in zip(of(first, "mine"), of(second, "mine"), strict=True):
        assert one.means["psnr_db"] == pytest.approx(other.means["psnr_db"], abs=0.01)


def _remove(folder: Path, key: str) -> None:
    (folder / f"{key}.npy").unlink()


def _rename(folder: Path, key: str) -> None:
    (folder / f"{key}.npy").rename(folder / "holiday.npy")


def _sixteen(folder: Path, key: str) -> None:
    write_picture(np.load(folder / f"{key}.npy"), folder / f"{key}.png", bits=16)
    (folder / f"{key}.png").rename(folder / f"{key}.PNG")
    _remove(folder, key)


def _put(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path, str], None]:
    return lambda folder, key: np.save(folder / f"{key}.npy", change(np.load(folder / f"{key}.npy")))


BAD = {
    "missing": (_remove, "pictures: 1 are missing, such as"),
    "unknown": (_rename, "pictures: 'holiday' is no key of the set; allowed: such as 'scene0"),
    "size": (_put(lambda x: x[:-1]), r"shape \(15, 20, 3\); allowed: \(16, 20, 3\)"),
    "grey": (_put(lambda x: x[..., 0]), r"shape \(16, 20\); allowed: \(16, 20, 3\)"),
    "to 255": (_put(lambda x: 255 * x), "values from .* to .*; allowed: 0 to 1, 1 is white"),
    "NaN": (_put(lambda x: np.where(x > x.mean(), np.nan, x)), "not finite"),
    "whole numbers": (_put(lambda x: (255 * x).astype(np.int32)), "values of type int32"),
    "cut": (lambda folder, key: (folder / f"{key}.npy").write_bytes(b"\x93NUMPY"), "it is no picture of this set"),
    "twice": (lambda folder, key: (folder / f"{key}.png").touch(), r"npy' and '.*png' are of one key; allowed: one"),
    "16 bits": (_sixteen, "16 bits a channel, of which its reader keeps 8; write a TIFF or an array"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_pictures_are_told_in_a_line(case: str, out: Path, tmp_path: Path) -> None:
    spoil, words = BAD[case]
    folder = noisy(out, tmp_path / "mine")
    spoil(folder, min(truths(out)))
    refusal(judge, folder, out, "mine", HERE, match=words)


def test_a_set_that_cannot_judge_is_told_in_a_line(out: Path, tmp_path: Path) -> None:
    pictures = noisy(out, tmp_path / "mine")
    (tmp_path / "empty").mkdir()
    refusal(judge, tmp_path / "empty", out, "mine", HERE, match=r"holds none; allowed: \.png")
    refusal(judge, pictures, tmp_path, "mine", HERE, match="no manifest of a set")
    copy = tmp_path / "copy"
    shutil.copytree(out / "set", copy / "set")
    shard = next((copy / "set").glob("*.tar"))
    shard.write_bytes(shard.read_bytes()[:-5000])
    refusal(
        judge, pictures, copy, "mine", HERE, match=f"{shard.name} isn't what was written; run rodcone dataset again"
    )
    text = (copy / "set" / "manifest.jsonl").read_text()
    text = text[: text.rindex('{"kind": "shard"')]
    made = text.count('{"kind": "sample"')
    (copy / "set" / "manifest.jsonl").write_text(text)
    assert 0 < made < 2 * SCENES
    refusal(
        judge, pictures, copy, "mine", HERE, match=f"of: {made} of {2 * SCENES} samples are made; run rodcone dataset"
    )
    (copy / "set" / "manifest.jsonl").write_text(text.replace('"planes": ["rgb"]', '"planes": []'))
    refusal(judge, pictures, copy, "mine", HERE, match="was made without rgb")


def test_the_command_writes_table_csv_json_and_page(out: Path, tmp_path: Path) -> None:
    folder = noisy(out, tmp_path / "mine")
    words = ("judge", str(folder), "--of", str(out), "--workers", "1")
    code, table, _ = call([*words, "-o", tmp_path / "scores.csv"])
    assert code == 0
    assert "mine" in table
    assert "bayer" in table
    rows = list(csv.DictReader((tmp_path / "scores.csv").read_text().splitlines()))
    told = json.loads(call([*words, "--json", "-o", tmp_path / "page.html"])[1])
    assert len(told["scores"]) == len(rows) == 2 * 2
    for row, score in zip(rows, told["scores"], strict=True):
        assert float(row["psnr_db"]) == pytest.approx(score["means"]["psnr_db"])
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "<script" not in page
    assert f"{told['scores'][0]['means']['psnr_db']:.1f}" in page
