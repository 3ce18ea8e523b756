"""A plan in words: what was chosen, why, and the ledger as a table and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from html import escape
from typing import Any

from rich.table import Table

from studies.budget.choice import image_ns, render_ns
from studies.budget.ledger import KERNEL, MONTE_CARLO, Ledger, Term
from studies.budget.model_plan import Plan
from studies.budget.terms import LENS_TERMS
from studies.study.study import SceneChoice, Study, label


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
    """The worse mosaic of each condition, a term a column: share of the noise variance, in brackets if modelled."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in _head(plan):
        table.add_column(name, justify="left" if name == "condition" else "right", overflow="fold")
    for condition in plan.images:
        rows = [row for row in plan.ledgers if row.condition == condition]
        table.add_row(*_cells(max(rows, key=lambda row: row.share)))
    return table


def plan_html(plan: Plan) -> str:
    """The ledger as a table for a notebook: a row a condition and mosaic, a column a term."""
    if not plan.ledgers:
        return f"<p>Plan of {len(plan.renders)} renders and {len(plan.images)} images, without a budget</p>"
    head = "".join(f"<th>{escape(name)}</th>" for name in _head(plan))
    rows = ("".join(f"<td>{escape(text)}</td>" for text in _cells(row)) for row in plan.ledgers)
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in (head, *rows))}</table>"


def _head(plan: Plan) -> list[str]:
    return ["condition", "noise, e-", "off, e-", "together", *(term.name for term in plan.ledgers[0].terms)]


def _cells(row: Ledger) -> list[str]:
    of = row.condition
    condition = (label(of.scene.source), of.spectrum, of.level, f"{row.exposure_s * 1e3:.3g}ms", of.sensor, row.mosaic)
    terms = [f"({_percent(term.share)})" if term.modelled else _percent(term.share) for term in row.terms]
    return [" ".join(condition), f"{row.noise_e:.3g}", f"{row.rms_e:.2g}", _percent(row.share), *terms]


def reasons(study: Study, plan: Plan, reference: Plan) -> Iterator[str]:
    """One line for each thing that was chosen, with why."""
    budget = study.budget
    yield (
        f"Budget: {_percent(budget.total)} of the sensor's own noise variance, {_percent(budget.monte_carlo)} of it "
        "for Monte Carlo noise. Shares are upper estimates from a pilot render; in brackets, what is modelled would "
        "cost if it were left out."
    )
    for scene, model in plan.renders.items():
        widths = sorted({round(width, 1) for width in model.width_nm})
        wide = f"{widths[0]:g}" if len(widths) == 1 else f"{widths[0]:g} to {widths[-1]:g}"
        noise = worst(plan, scene, MONTE_CARLO)
        yield (
            f"{label(scene.source)}: {len(model.width_nm)} bands of {wide} nm, {model.spp} samples a pixel; render and "
            f"lens cost about {cost_over_reference(plan, reference, scene):.2g} of the reference's"
        )
        if noise.share > budget.monte_carlo:
            wanted = model.spp * noise.share / budget.monte_carlo
            yield (
                f"{label(scene.source)}: Monte Carlo noise reaches {_percent(noise.share)} in the worst condition; "
                f"{wanted:.2g} samples would keep the aim, and render.spp allows {study.render.spp}"
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
                kept = [name for name, field in LENS_TERMS.items() if getattr(image.lens, field)]
                cost += image_ns(bands, [*kept, KERNEL] if image.exact else kept)
        costs.append(cost)
    return costs[0] / costs[1]


def _percent(share: float) -> str:
    """Share as per cent, from ten times on as a factor."""
    if share >= 10:
        return f"{share:.0f}x"
    return f"{100 * share:.3g}%" if share >= 1e-5 else "0%"
