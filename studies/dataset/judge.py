"""Judge anyone's developed pictures of a data set against its truth, by every metric, with intervals over scenes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from isp.processors.catalogue import NAMED
from rodcone.colour_spaces import decode_srgb, encode_srgb
from rodcone.errors import InputError, read_errors
from rodcone.optional import quietly_imported
from sensor.presets import preset, preset_names, vary
from studies.dataset.shards import Lines, Runner, Shard, is_intact, read_manifest, read_shard, shards_of
from studies.design.expect import expect
from studies.metrics.appearance import appearance, picture_quality, psnr_db, true_picture
from studies.metrics.confidence import half_width
from studies.metrics.metric import METRICS, ON_TARGETS
from studies.pages import report_text as text
from studies.pages.page import svg_address, write_out
from studies.pages.plots import CHART, COLOURS, STYLE, blank, name_at_ends, plain_ticks, svg_text
from studies.study.levels import parse_exposure
from studies.sweep.database import FILE
from studies.sweep.export import read_rows
from studies.sweep.prepare import SET

MEASURED = tuple(metric for metric in METRICS if metric not in ON_TARGETS)
EXPECTED_UNDER = "D65"
FROZEN_LIST = "benchmark"
SENSORS = Path(__file__).parents[1] / "configs" / "sensors"
ENDINGS = (".png", ".tif", ".tiff", ".npy")
_OVERSHOOT = 0.01  # values of an array may lie outside 0 to 1 by this much
# Common mistakes, each with a function that undoes it. Pictures are refused if such a function brings them nearer to
# the truth by `_NEARER_DB`.
_MISTAKES: Mapping[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "linear values; encode them as sRGB": encode_srgb,
    "encoded twice; encode them once": decode_srgb,
    "blue in red's place; write R, G, B": lambda picture: picture[..., ::-1],
    "upside down": lambda picture: picture[::-1],
    "mirrored": lambda picture: picture[:, ::-1],
}
_NEARER_DB = 3.0
_PLACE = ("sensor", "mosaic", "spectrum", "exposure", "level")  # a condition's camera, then its level

Row = dict[str, Any]


@dataclass(frozen=True)
class Score:
    """Means over the scenes of a condition, and half their 95 % intervals, by metric.

    Attributes
    ----------
    camera : str
        Sensor, mosaic, light and exposure.
    level : str
    developer : str
        Whoever made the pictures; the project's own processors go by their names.
    luminance_cd_m2 : float
    scenes : int
    means, halves : dict of str to float
    """

    camera: str
    level: str
    developer: str
    luminance_cd_m2: float
    scenes: int
    means: dict[str, float]
    halves: dict[str, float]


def judge(pictures: Path, out: Path, developer: str, runner: Runner) -> tuple[Row, list[Score]]:
    """Score developed pictures of a set, and the pictures of those processors that the set's own sweep has used.

    Return the first line of the set's manifest, and the scores.

    Parameters
    ----------
    pictures : Path
        Folder of files named ``KEY.png``, ``.tif`` or ``.npy`` by the set's keys: encoded sRGB in which white is 1. The
        pictures of one level and camera are either all there or all missing.
    out : Path
        Folder of `studies.dataset.make_set.make_set`.
    developer : str
        Name of whoever made the pictures.
    runner : callable
        As in `make_set`.

    Raises
    ------
    InputError
        For pictures that are missing, unknown, of another size or in another encoding, and for an incomplete set.
    """
    manifest = read_manifest(out / SET)
    if "rgb" not in manifest[0]["planes"]:
        raise InputError(f"of: {out} was made without rgb; allowed: a set with it; make one with --truth rgb")
    samples = [line for line in manifest if line["kind"] == "sample"]
    if len(samples) < manifest[0]["samples"]:
        raise InputError(f"of: {len(samples)} of {manifest[0]['samples']} samples are made; run rodcone dataset again")
    files = _pictures_of(pictures, samples)
    shards = shards_of(out / SET, manifest)
    for shard in shards:
        if not is_intact(shard):
            raise InputError(f"of: {shard.path.name} isn't what was written; run rodcone dataset again")
    tasks = [shard for shard in shards if any(line["key"] in files for line in shard.lines[1:])]
    rows = [row for judged in runner(tasks, make=partial(judge_shard, files)) for row in judged.lines[1:]]
    _check_encoding(rows)
    result = scores(rows, developer)
    at = {(score.camera, score.level) for score in result}
    scenes = {line["scene"] for line in samples}
    swept = [vars(row) for row in read_rows(out) if row.scene in scenes] if (out / FILE).is_file() else []
    result += [score for score in scores_of_sweep(swept) if (score.camera, score.level) in at]
    result += expected([line for line in samples if _condition(line) in at], manifest[0]["name"])
    return manifest[0], sorted(result, key=lambda score: (score.camera, score.luminance_cd_m2))


def _condition(row: Row) -> tuple[str, str]:
    """Return the name of a row's camera, and its light level."""
    *camera, level = (row[name] for name in _PLACE)
    return ", ".join(camera), level


def expected(samples: Lines, study: str) -> list[Score]:
    """Compute the expected PSNR (`studies.design.expect`) of each condition whose sensor is a preset or frozen file.

    A frozen file is one of the study `FROZEN_LIST`.
    """
    known = {name: name for name in preset_names()}
    if study == FROZEN_LIST:  # because the sensor files of other studies may share these names
        known |= {path.name: str(path) for path in SENSORS.glob("*.toml")}
    conditions = {_condition(line): line for line in samples if line["sensor"] in known}
    nothing = {metric.key: math.nan for metric in MEASURED}
    result = []
    for (camera, level), line in conditions.items():
        light = line["luminance_cd_m2"]
        exposure = parse_exposure(line["exposure"]) or line["exposure"]
        sensor = vary(preset(known[line["sensor"]]), line["mosaic"])  # with the filters of the mosaic
        error = expect(sensor, [light], EXPECTED_UNDER, exposure)[0]
        means = nothing | {"psnr_db": error.psnr_db}
        result.append(Score(camera, level, f"expect, {EXPECTED_UNDER}", light, 0, means, nothing))
    return result


def judge_shard(files: Mapping[str, Path], shard: Shard) -> Shard:
    """Measure a shard's pictures: return it with a row of figures in place of each sample's line.

    `files` are the pictures by their samples' keys; samples without a picture have no row. A row's ``mistakes`` are the
    PSNRs that the picture would have if each of the common mistakes were undone.
    """
    rows = []
    for arrays, facts in read_shard(shard.path):
        if facts["key"] in files:
            truth = true_picture(arrays["rgb"].astype(np.float64))
            encoded = read_picture(files[facts["key"]], truth.encoded.shape[:2])
            figures = vars(picture_quality(encoded, truth))
            figures |= vars(appearance(decode_srgb(encoded), truth, facts["white_cd_m2"]))
            mistakes = {x: psnr_db(np.clip(undo(encoded), 0, 1), truth.encoded) for x, undo in _MISTAKES.items()}
            place = {name: facts[name] for name in ("scene", "luminance_cd_m2", *_PLACE)}
            rows.append({**place, **figures, "mistakes": mistakes})
    return replace(shard, lines=[shard.lines[0], *rows])


def read_picture(path: Path, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Read a picture file as encoded values from 0 to 1, (h, w, 3).

    Raises
    ------
    InputError
        For a file that can't be read, that has another size, or whose values lie outside 0 to 1.
    """
    # A damaged file may raise any exception.
    with read_errors(f"{path}: it is no picture of this set", "write it again", Exception):
        ending = path.suffix.lower()
        if ending == ".npy":
            values = np.load(path, allow_pickle=False)
        elif ending == ".png":
            if path.read_bytes()[24:25] == b"\x10":
                raise ValueError("16 bits a channel, of which its reader keeps 8; write a TIFF or an array")
            with Image.open(path, formats=("PNG",)) as image:
                values = np.asarray(image)
        else:
            values = quietly_imported("tifffile").imread(path)
        if values.shape != (*shape, 3):
            raise ValueError(f"shape {values.shape}; allowed: {(*shape, 3)}")
        if values.dtype.kind == "u":
            return np.asarray(values / np.iinfo(values.dtype).max, dtype=np.float64)
        if values.dtype.kind != "f" or not np.isfinite(values).all():
            raise ValueError(f"values of type {values.dtype}, or not finite; allowed: finite floats from 0 to 1")
        if values.min() < -_OVERSHOOT or values.max() > 1 + _OVERSHOOT:
            raise ValueError(f"values from {values.min():.3g} to {values.max():.3g}; allowed: 0 to 1, 1 is white")
    return np.asarray(np.clip(values, 0, 1), dtype=np.float64)


def scores(rows: Sequence[Row], developer: str) -> list[Score]:
    """Return the scores of each condition, with intervals over its scenes.

    The samples of a scene are averaged first, because only different scenes are independent of each other.
    """
    conditions: dict[tuple[str, str], dict[str, list[Row]]] = {}
    for row in rows:
        conditions.setdefault(_condition(row), {}).setdefault(row["scene"], []).append(row)
    keys = [metric.key for metric in MEASURED]
    result = []
    for (camera, level), by_scene in conditions.items():
        luminance = float(np.mean([x[0]["luminance_cd_m2"] for x in by_scene.values()]))
        figures = np.array([[np.mean([row[key] for row in x]) for x in by_scene.values()] for key in keys])
        with np.errstate(invalid="ignore"):  # the truth itself has an infinite PSNR
            means, halves = (dict(zip(keys, x.tolist(), strict=True)) for x in (figures.mean(1), half_width(figures)))
        result.append(Score(camera, level, developer, luminance, len(by_scene), means, halves))
    return result


def scores_of_sweep(rows: Sequence[Row]) -> list[Score]:
    """Return the scores of each processor from those cells of a sweep that have a single frame, not a burst.

    If the sweep has several white balances, each of them is scored separately.
    """
    single = [row for row in rows if row["processor"] in NAMED and row["frames"] == 1]
    several = len({row["white_balance"] for row in single}) > 1
    developers: dict[str, list[Row]] = {}
    for row in single:
        name = f"{row['processor']}, {row['white_balance']}" if several else row["processor"]
        developers.setdefault(name, []).append(row | {"mosaic": NAMED[row["processor"]].mosaic})
    return [score for name, its_rows in developers.items() for score in scores(its_rows, name)]


def _pictures_of(folder: Path, samples: Lines) -> dict[str, Path]:
    """Find the picture files by the set's keys; refuse a condition that has only some of its pictures."""
    files: dict[str, Path] = {}
    for path in sorted(path for path in folder.glob("*") if path.suffix.lower() in ENDINGS):
        also = files.setdefault(path.stem, path).name
        if also != path.name:
            raise InputError(f"pictures: {also!r} and {path.name!r} are of one key; allowed: one; remove the other")
    keys = {line["key"] for line in samples}
    if unknown := sorted(files.keys() - keys):
        raise InputError(f"pictures: {unknown[0]!r} is no key of the set; allowed: such as {min(keys)!r}; rename it")
    if not files:
        raise InputError(f"pictures: {folder} holds none; allowed: {', '.join(ENDINGS)}, named such as {min(keys)!r}")
    begun = {_condition(line) for line in samples if line["key"] in files}
    missing = [line["key"] for line in samples if _condition(line) in begun and line["key"] not in files]
    if missing:
        raise InputError(
            f"pictures: {len(missing)} are missing, such as {missing[0]!r}; allowed: all of a level and camera, or "
            "none; add them"
        )
    return files


def _check_encoding(rows: Sequence[Row]) -> None:
    psnr = np.mean([row["psnr_db"] for row in rows])
    undone = {words: np.mean([row["mistakes"][words] for row in rows]) for words in _MISTAKES}
    words = max(undone, key=lambda words: undone[words])
    if undone[words] > psnr + _NEARER_DB:
        raise InputError(
            f"pictures: they look {words} (PSNR {undone[words]:.1f} dB after that, {psnr:.1f} dB as they are); "
            "allowed: encoded sRGB, R, G, B, upright"
        )


def judge_page(head: Mapping[str, Any], scores: Sequence[Score]) -> str:
    """Return the scores of `judge` as a self-contained page: per camera a chart of PSNR over light, and all metrics."""
    by_camera = {camera: list(lines) for camera, lines in groupby(scores, key=lambda score: score.camera)}
    charts = {camera: svg_address(svg_text(psnr_chart(x))) for camera, x in by_camera.items()}
    return write_out("judge.html.j2", head=head, cameras=by_camera, charts=charts, metrics=MEASURED, text=text)


@rc_context(STYLE)
def psnr_chart(scores: Sequence[Score]) -> Figure:
    """Draw each developer's PSNR over luminance with its interval; the expected PSNR is a line without an interval."""
    figure = blank(*CHART)
    axes = figure.subplots()
    ends = []
    for index, developer in enumerate(dict.fromkeys(score.developer for score in scores)):
        line = [score for score in scores if score.developer == developer]
        colour = COLOURS[index % len(COLOURS)]
        values = np.array([score.means["psnr_db"] for score in line])
        halves = np.nan_to_num([score.halves["psnr_db"] for score in line])
        light = [score.luminance_cd_m2 for score in line]
        axes.errorbar(light, values, halves, color=colour, capsize=3, linestyle="-" if line[0].scenes else ":")
        ends.append((developer, float(values[-1]), colour))
    axes.set(title="PSNR, dB, mean over scenes and its 95 % interval", xlabel="cd/m²", xscale="log")
    plain_ticks(axes)
    name_at_ends(axes, ends)
    return figure
