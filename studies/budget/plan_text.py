"""A plan's ledger as a table for a terminal and as JSON."""

from dataclasses import asdict
from typing import Any

from rich.table import Table

from studies.budget.costs import cost_over_reference
from studies.budget.effects import LENS_TERMS
from studies.budget.ledger import LEAST_SHOWN, MONTE_CARLO, Plan, Term, condition_words, figures, term_names
from studies.study.study import SceneChoice, Study

LEVEL = 2  # index of the level in `studies.budget.ledger.condition_words`
TABLE_LEGEND = (
    "Each figure is a share of the sensor's own noise variance: an upper estimate from a small pilot render. A figure "
    "in brackets is of an effect that is modelled, and tells what leaving it out would cost."
)


def plan_json(study: Study, plan: Plan, reference: Plan) -> dict[str, Any]:
    """Return everything that a plan holds, in types that JSON has."""
    images = {
        condition: {field: getattr(model.lens, field) for field in LENS_TERMS.values()} | {"exact": model.exact}
        for condition, model in plan.images.items()
    }
    return {
        "study": study.name,
        "budget": asdict(study.budget),
        "summary": list(plan.summary),
        "renders": [
            {
                "scene": asdict(scene),
                **asdict(model),
                "monte_carlo_share": worst(plan, scene, MONTE_CARLO).share,
                "cost_over_reference": cost_over_reference(plan, reference, scene),
            }
            for scene, model in plan.renders.items()
        ],
        "conditions": [asdict(row) | {"image": images[row.condition]} for row in plan.ledgers],
    }


def plan_table(plan: Plan) -> Table:
    """Return a table with a row for the worse mosaic of each condition, and each term's share of the noise variance.

    A share in brackets belongs to an effect that is modelled. The table is narrow: its title holds what all conditions
    have in common, conditions with the same figures share a line, and a line below names the terms that are under
    `LEAST_SHOWN` everywhere.
    """
    worse = [max((x for x in plan.ledgers if x.condition == of), key=lambda row: row.share) for of in plan.images]
    words = [condition_words(row) for row in worse]
    varies = [len({line[i] for line in words}) > 1 for i in range(len(words[0]))]
    names = term_names(worse)
    large = {term.name for row in worse for term in row.terms if term.share >= LEAST_SHOWN}
    title = " ".join(words[0][i] for i in range(len(words[0])) if not varies[i] and i != LEVEL)
    columns = [x for x in names if x in large]
    left_out = ", ".join(x for x in names if x not in large)
    table = Table(
        box=None, padding=(0, 1, 0, 0), pad_edge=False, header_style="bold", title=title, title_justify="left"
    )
    table.caption = f"under {100 * LEAST_SHOWN:g}% everywhere: {left_out}" if left_out else None
    table.caption_justify = "left"
    table.add_column("light", overflow="fold", min_width=17)
    for name in ("noise, e-", "off, e-", "sum", *columns):
        table.add_column(name.replace(" ", "\n"), justify="right", no_wrap=True)
    lines: dict[tuple[str, ...], list[str]] = {}
    for row, line in zip(worse, words, strict=True):
        rest = " ".join(word for i, word in enumerate(line) if varies[i] and i != LEVEL)
        lines.setdefault((rest, *figures(row, columns)), []).append(row.condition.level)
    above = ""
    for (rest, *cells), levels in lines.items():
        if rest != above:
            table.add_row(f"[bold]{rest}")
        above = rest
        table.add_row(", ".join(dict.fromkeys(levels)), *cells)
    return table


def worst(plan: Plan, scene: SceneChoice, name: str) -> Term:
    """Return the largest of the terms called `name` over a scene's conditions."""
    terms = [term for row in plan.ledgers if row.condition.scene == scene for term in row.terms if term.name == name]
    return max(terms, key=lambda term: term.share)
