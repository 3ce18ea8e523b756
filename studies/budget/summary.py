"""Write a paragraph for each scene: what its plan leaves out, which error that makes, and how much time it saves."""

from collections import Counter
from collections.abc import Sequence

from studies.budget.costs import cost_over_reference
from studies.budget.effects import KERNEL, LENS_TERMS
from studies.budget.ledger import MONTE_CARLO, Ledger, Plan, condition_words, share_text
from studies.study.model import RenderModel
from studies.study.study import AUTOMATIC, SceneChoice, Study, most_spp


def summary(study: Study, plan: Plan, reference: Plan) -> tuple[str, ...]:
    """Write the paragraph of each scene."""
    return tuple(_paragraph(study, plan, reference, scene) for scene in study.scenes)


def _paragraph(study: Study, plan: Plan, reference: Plan, scene: SceneChoice) -> str:
    rows = [row for row in plan.ledgers if row.condition.scene == scene]
    sentences = [*_rendered_with(study, plan, scene), _left_out(rows), *_cost(study, rows)]
    if scene in plan.renders:
        whole = reference.renders[scene]
        sentences.append(
            f"Render and lens take about {cost_over_reference(plan, reference, scene):.2g} of the time of the "
            f"reference, which has {_bands(whole)} and {whole.spp} samples per pixel and models every effect."
        )
        sentences += _too_few_samples(study, plan.renders[scene].spp, rows)
    return f"{scene.label}: {' '.join(sentences)}"


def _rendered_with(study: Study, plan: Plan, scene: SceneChoice) -> list[str]:
    """Say how many bands and samples per pixel the scene's render has, or that it keeps the picture file's bands."""
    automatic = study.budget.model == AUTOMATIC
    model = "the cheapest model within the budget" if automatic else f"the starting point {study.budget.model!r}"
    if scene not in plan.renders:
        return [f"{model} keeps the bands of the picture file."]
    render = plan.renders[scene]
    return [f"{model} renders {_bands(render)} with {render.spp} samples per pixel."]


def _bands(render: RenderModel) -> str:
    """Say how many bands there are, and how wide: ``20 bands of 20 nm``."""
    widths = sorted({round(width, 1) for width in render.width_nm})
    wide = f"{widths[0]:g}" if len(widths) == 1 else f"{widths[0]:g} to {widths[-1]:g}"
    return f"{len(render.width_nm)} bands of {wide} nm"


def _left_out(rows: Sequence[Ledger]) -> str:
    """Say which effects are left out, and in how many conditions."""
    every = len({row.condition for row in rows})
    missing = {(row.condition, term.name) for row in rows for term in row.terms if not term.modelled}
    times = Counter(name for _, name in missing)
    by_times: dict[int, list[str]] = {}
    for name in (*LENS_TERMS, KERNEL):
        if times[name]:
            by_times.setdefault(times[name], []).append("exact readout" if name == KERNEL else name)
    if not by_times:
        return "It leaves no effect of lens or readout out."
    words = [f"{_listed(names)} in {_of(count, every)}" for count, names in sorted(by_times.items())]
    return f"It leaves out {', and '.join(words)}."


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if names[1:] else names[0]


def _of(count: int, every: int) -> str:
    if every == 1:
        return "the one condition"
    return f"all {every} conditions" if count == every else f"{count} of {every} conditions"


def _cost(study: Study, rows: Sequence[Ledger]) -> list[str]:
    """Say how large the error is in the worst condition, and which terms it consists of."""
    worst = max(rows, key=lambda row: row.share)
    parts = sorted((term for term in worst.terms if not term.modelled), key=lambda term: -term.share)
    made_of = f"{parts[0].name} ({share_text(parts[0].share)}) and {parts[1].name} ({share_text(parts[1].share)})"
    kept = "within" if worst.share <= study.budget.total else "above"
    return [
        f"This adds at most {_share(worst.share)} the sensor's own noise variance, {kept} the budget of "
        f"{share_text(study.budget.total)}.",
        f"The error is largest under {' '.join(condition_words(worst)[1:])}, where the largest parts are {made_of}.",
    ]


def _share(share: float) -> str:
    text = share_text(share)
    return f"{text[:-1]} times" if text.endswith("x") else f"{text} of"


def _too_few_samples(study: Study, spp: int, rows: Sequence[Ledger]) -> list[str]:
    """Say how many samples would be enough if Monte Carlo noise exceeds its share of the budget."""
    share = max(term.share for row in rows for term in row.terms if term.name == MONTE_CARLO)
    if share <= study.budget.monte_carlo:
        return []
    needed = float(f"{spp * share / study.budget.monte_carlo:.2g}")
    allowed = share_text(study.budget.monte_carlo)
    return [
        f"Monte Carlo noise exceeds its share of {allowed}: {needed:.0f} samples per pixel "
        f"would keep it, and the study allows {most_spp(study, rows[0].condition.scene)}."
    ]
