"""A plan in words: what was chosen, why, and the ledger as a table and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rich.table import Table

from studies.budget.choice import image_ns, render_ns
from studies.budget.ledger import (
    KERNEL,
    LEAST_SHOWN,
    MONTE_CARLO,
    Plan,
    Term,
    condition_words,
    figures,
    percent,
    term_names,
)
from studies.budget.terms import LENS_TERMS
from studies.study.study import SceneChoice, Study, most_spp

LEVEL = 2  # place of the level in a condition's words


def plan_json(study: Study, plan: Plan, reference: Plan) -> dict[str, Any]:
    """Everything that a plan holds, as JSON takes it."""
    images = {
        condition: {field: getattr(model.lens, field) for field in LENS_TERMS.values()} | {"exact": model.exact}
        for condition, model in plan.images.items()
    }
    return {
        "study": study.name,
        "budget": asdict(study.budget),
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
    """The worse mosaic of each condition, a term a column: share of the noise variance, in brackets if modelled.

    Narrow: what all conditions have in common is the title, conditions of the same figures share a line, and terms that
    are under `LEAST_SHOWN` everywhere are named below.
    """
    worse = [max((x for x in plan.ledgers if x.condition == of), key=lambda row: row.share) for of in plan.images]
    words = [condition_words(row) for row in worse]
    varies = [len({line[i] for line in words}) > 1 for i in range(len(words[0]))]
    names = term_names(worse)
    large = {term.name for row in worse for term in row.terms if term.share >= LEAST_SHOWN}
    title = " ".join(words[0][i] for i in range(len(words[0])) if not varies[i] and i != LEVEL)
    columns, left_out = [x for x in names if x in large], ", ".join(x for x in names if x not in large)
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


def reasons(study: Study, plan: Plan, reference: Plan) -> Iterator[str]:
    """One line for each thing that was chosen, with why."""
    budget = study.budget
    yield (
        f"Budget: {percent(budget.total)} of the sensor's own noise variance, {percent(budget.monte_carlo)} of it "
        "for Monte Carlo noise. Shares are upper estimates from a pilot render; in brackets, what is modelled would "
        "cost if it were left out."
    )
    for scene, model in plan.renders.items():
        widths = sorted({round(width, 1) for width in model.width_nm})
        wide = f"{widths[0]:g}" if len(widths) == 1 else f"{widths[0]:g} to {widths[-1]:g}"
        noise = worst(plan, scene, MONTE_CARLO)
        yield (
            f"{scene.label}: {len(model.width_nm)} bands of {wide} nm, {model.spp} samples a pixel; render and "
            f"lens cost about {cost_over_reference(plan, reference, scene):.2g} of the reference's"
        )
        if noise.share > budget.monte_carlo:
            wanted = model.spp * noise.share / budget.monte_carlo
            yield (
                f"{scene.label}: Monte Carlo noise reaches {percent(noise.share)} in the worst condition; "
                f"{wanted:.2g} samples would keep the aim, and spp allows {most_spp(study, scene)}"
            )


def worst(plan: Plan, scene: SceneChoice, name: str) -> Term:
    """Largest term of a name over a scene's conditions."""
    terms = [term for row in plan.ledgers if row.condition.scene == scene for term in row.terms if term.name == name]
    return max(terms, key=lambda term: term.share)


def cost_over_reference(plan: Plan, reference: Plan, scene: SceneChoice) -> float:
    """Estimated time of a scene's render and of all its images, over that of the reference."""
    costs = []
    for model in (plan, reference):
        render = model.renders[scene]
        bands = len(render.width_nm)
        cost = render_ns(bands, render.spp)
        for row in plan.ledgers:
            if row.condition.scene == scene:
                image = model.images[row.condition]
                modelled = [name for name, field in LENS_TERMS.items() if getattr(image.lens, field)]
                cost += image_ns(bands, [*modelled, KERNEL] if image.exact else modelled)
        costs.append(cost)
    return costs[0] / costs[1]
