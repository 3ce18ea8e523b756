"""The page of a camera beside its opponents: Markdown, with the figure as SVG in a file of its own."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rodcone.files import replacing
from studies.pages import duels_text as text
from studies.pages.drawing import to_svg
from studies.pages.duels import Case, cases_of, is_ranked, opponents_of
from studies.pages.duels_figure import description, figure_of
from studies.pages.report_text import percent
from studies.sweep.row import Row


def write_page(rows: Sequence[Row], study: Mapping[str, Any], folder: Path, out: Path, camera: str) -> None:
    """Write page and figure, both or neither.

    Parameters
    ----------
    rows : sequence of Row
    study : mapping
        The study as the ledger's last run notes it.
    folder : Path
        Of the sweep, for the page's own command.
    out : Path
        Ends in ``.md``; the figure goes beside it, ending in ``.svg``.
    camera : str
        Whose leads and losses the page tells.

    Raises
    ------
    InputError
        For a sweep with a part missing, one seed, or without the camera.
    OSError
        Where the files can't be written.
    """
    cases = cases_of(rows)
    figure = out.with_suffix(".svg")
    drawing = figure_of(cases, camera)
    page = page_of(cases, study, folder, out, camera, figure.name if drawing else None)
    with replacing(*([out, figure] if drawing else [out])) as places:
        places[0].write_text(page, "utf-8")
        if drawing:
            places[1].write_text(to_svg(drawing), "utf-8")


def page_of(
    cases: Sequence[Case], study: Mapping[str, Any], folder: Path, out: Path, camera: str, figure: str | None
) -> str:
    """Markdown of the page; parameters as `write_page`."""
    groups, short = text.groups_of(cases), text.in_short(cases, camera)
    others = opponents_of(cases, camera)[1:]
    ranked = any(is_ranked(case, camera) for case in cases)
    nowhere = "Nowhere, beyond the scatter over seeds." if ranked else "Nothing is ranked."
    lost = text.loss_table(cases, camera)
    told = [
        f"# {text.code(camera)} beside its opponents",
        f"    rodcone sweep STUDY.toml -o {folder} --as-stated\n    rodcone opponents {folder} -o {out.name}",
        facts_sentence(cases, study),
        "## In short",
        "\n".join(f"- {sentence}" for sentence in short),
        f"![{description(cases, camera)}]({figure})" if figure else "",
        "## Won, level and lost",
        "\n".join(text.duel_table(cases, camera)),
        f"Conditions by the outcome of the 95 % interval over seeds. {text.scatter_sentence(cases, camera)} Times are "
        f"medians over all pictures, in units of {text.code(camera)}'s, on the machine of the sweep.",
        "## Who is best at which light",
        "\n".join(f"- {sentence}" for sentence in text.best_lines(cases, camera)),
        f"## {text.code(camera)} beside each of the others" if others else "",
        "\n".join(f"- {text.beside(cases, camera, name)}" for name in others),
        f"## Where {text.code(camera)} loses",
        "\n".join(lost) if lost else nowhere,
        "## Every condition",
        *(
            f"### {text.group_text(group, groups)}\n\n"
            + "\n".join(text.level_table([case for case in cases if case.group == group], camera))
            for group in groups
        ),
        f"Means over seeds; the best of each column in bold. {monte_carlo_sentence(cases)}",
    ]
    return "\n\n".join(part for part in told if part) + "\n"


def facts_sentence(cases: Sequence[Case], study: Mapping[str, Any]) -> str:
    """Say what the numbers come from."""
    rows = next(iter(cases[0].rows.values()))
    size = study.get("render", {}).get("size")
    of_size = f", {size} pixels on the longer side" if size else ""
    groups = text.groups_of(cases)
    parts = [
        f"{name}{'' if len(set(values)) == 1 else 's'} {', '.join(text.code(value) for value in dict.fromkeys(values))}"
        for name, values in (
            ("scene", [group.scene for group in groups]),
            ("spectrum", [group.spectrum for group in groups]) if {g.spectrum for g in groups} != {"own"} else ("", []),
            ("sensor", [group.sensor for group in groups]),
            ("exposure", [group.exposure for group in groups]),
        )
        if values
    ]
    seeds = ", ".join(str(row.seed) for row in rows)
    code = text.code(json.loads(rows[0].versions)["rodcone"])
    return (
        f"Study {text.code(str(study.get('name', 'study')))}: {'; '.join(parts)}; seeds {seeds}{of_size}; rodcone "
        f"{code}. Pictures are measured against the noise-free truth at the known exposure scale."
    )


def monte_carlo_sentence(cases: Sequence[Case]) -> str:
    """Say how much noise of the render the truth may hold."""
    worst = max((row.mc_share, case.level) for case in cases for rows in case.rows.values() for row in rows)
    return (
        f"The render's own noise, which counts as texture, has at most {percent(worst[0])} of the sensor's variance "
        f"(at {text.level_text(worst[1])})."
    )
