"""Estimate a model's cost from stated nanoseconds of one core per pixel, so that every machine makes the same plan.

Only their ratios count. `still_life` at 256x256 takes 1690, 2370 and 4410 ns per pixel and sample in 8, 16 and 40
bands: 85 ns per band, and as much as 12 bands to trace a path.
"""

from collections.abc import Iterable

from studies.budget.effects import KERNEL, LENS_TERMS
from studies.budget.ledger import Plan
from studies.study.study import SceneChoice

BANDS_AT_ONCE = 4  # The renderer computes four bands at a time; other numbers cost as much as the next multiple.
TRACING_BANDS = 12
SAMPLE_BAND_NS = 85.0
# Nanoseconds per pixel and band of each effect of the lens, and per pixel of the exact readout, on the same picture.
LENS_BAND_NS = {"diffraction": 55.0, "veiling glare": 4.5, "cos^4": 0.7, "camera shake": 10.0}
EXACT_NS = 40.0


def render_ns(bands: int, spp: int) -> float:
    """Return the time that a render takes [ns per pixel]."""
    return (-(-bands // BANDS_AT_ONCE) * BANDS_AT_ONCE + TRACING_BANDS) * spp * SAMPLE_BAND_NS


def image_ns(bands: int, modelled: Iterable[str]) -> float:
    """Return the time that the modelled effects of lens and readout take [ns per pixel]."""
    return sum(EXACT_NS if name == KERNEL else LENS_BAND_NS[name] * bands for name in modelled)


def cost_over_reference(plan: Plan, reference: Plan, scene: SceneChoice) -> float:
    """Return the estimated time of a scene's render and images over the time that the reference's would take."""
    planned_ns, reference_ns = (_scene_ns(model, plan, scene) for model in (plan, reference))
    return planned_ns / reference_ns


def _scene_ns(model: Plan, plan: Plan, scene: SceneChoice) -> float:
    """Return the time of a model's render and of the image for each row of the plan's ledger [ns per pixel]."""
    render = model.renders[scene]
    bands = len(render.width_nm)
    images_ns = []
    for row in plan.ledgers:
        if row.condition.scene == scene:
            image = model.images[row.condition]
            modelled = [name for name, field in LENS_TERMS.items() if getattr(image.lens, field)]
            images_ns.append(image_ns(bands, [*modelled, KERNEL] if image.exact else modelled))
    return render_ns(bands, render.spp) + sum(images_ns)
