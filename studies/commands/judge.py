"""The command `rodcone judge`."""

from dataclasses import asdict
from math import isfinite
from pathlib import Path

from rodcone.csv_file import csv_text
from rodcone.files import write_files
from studies.commands.console import print_json, print_table, require_place
from studies.commands.sweep import Workers
from studies.dataset.judge import Score, judge_page
from studies.dataset.judge import judge as judge_pictures
from studies.metrics.metric import DECIDING


def judge(
    pictures: Path,
    /,
    *,
    of: Path,
    name: str | None = None,
    out: Path | None = None,
    workers: int | None = None,
    json: bool = False,
) -> None:
    """Measure developed pictures of a set against its truth, beside the project's own; prints a table.

    Parameters
    ----------
    pictures
        Folder of KEY.png, KEY.tif or KEY.npy by the keys of the set's manifest, encoded sRGB in which white is 1.
    of
        Folder that rodcone dataset made; if rodcone sweep developed the same study there, its figures are shown too.
    name
        Name of whoever made the pictures; the folder's name by default.
    out
        File with every metric: a page (.html) or a table (.csv).
    workers
        Processes on this machine, one for each core by default.
    json
        Print one JSON object instead of the table.
    """
    require_place(out, ".html", ".csv")
    with Workers(workers=workers).runner() as runner:
        head, scores = judge_pictures(pictures, of, name or pictures.resolve().name, runner)
    if out is not None:
        write_files({out: _csv(scores) if out.suffix.lower() == ".csv" else judge_page(head, scores)})
    if json:
        print_json({"set": head, "scores": [asdict(score) for score in scores]})
        return
    columns = ("camera", "level", "developed by", "scenes", *(metric.name for metric in DECIDING))
    print_table(columns, [_row(score) for score in scores], words=3)


def _row(score: Score) -> tuple[str, ...]:
    figures = [
        " ± ".join(f"{of[x.key]:.{x.digits + 1}f}" for of in (score.means, score.halves) if isfinite(of[x.key]))
        for x in DECIDING
    ]
    return score.camera, score.level, score.developer, str(score.scenes or ""), *figures


def _csv(scores: list[Score]) -> str:
    head = ("camera", "level", "luminance_cd_m2", "developer", "scenes")
    figures = [score.means | {f"{key}_half": half for key, half in score.halves.items()} for score in scores]
    places = [[getattr(score, name) for name in head] for score in scores]
    return csv_text((*head, *figures[0]), [[*x, *y.values()] for x, y in zip(places, figures, strict=True)])
