"""A check of the error budget: the planned model's expected electrons against the reference's."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.transport import Transport
from sensor.kernel.kernel import expected_electrons_single
from sensor.optics import form_image
from sensor.presets import preset
from sensor.response import electrons_per_irradiance, expected_electrons
from sensor.variations import vary
from studies.budget.ledger import LEVEL, MONTE_CARLO, Ledger, Plan
from studies.study.lit_scene import level_luminance, lux_per_cd_m2, make_transport, open_all, photographed, under
from studies.study.model import ImageModel
from studies.study.study import Study

REFERENCE_SEED = 1 << 33  # added to the study's: the reference's render is independent of plan and pilot

Step = Callable[[str, float], None]


@dataclass(frozen=True)
class CheckedCondition:
    """Prediction and measurement of one condition and mosaic: RMS of the difference over pixels below saturation [e-].

    The prediction holds the reference's own Monte Carlo noise, which no model of it leaves out.
    """

    ledger: Ledger
    predicted_e: float
    measured_e: float


@dataclass(frozen=True)
class BudgetCheck:
    """All of a study's conditions, and the seconds that the renders of each model took."""

    rows: tuple[CheckedCondition, ...]
    planned_s: float
    reference_s: float

    @property
    def covered(self) -> float:
        """Share of the conditions in which the prediction is at least what was measured."""
        return float(np.mean([row.predicted_e >= row.measured_e for row in self.rows]))

    @property
    def median_ratio(self) -> float:
        """Median of predicted over measured, where anything was measured."""
        return float(np.median([row.predicted_e / row.measured_e for row in self.rows if row.measured_e > 0]))


def check_json(check: BudgetCheck) -> dict[str, Any]:
    """Totals, and prediction and measurement of each condition."""
    rows = [
        asdict(row.ledger.condition)
        | {"mosaic": row.ledger.mosaic, "predicted_e": row.predicted_e, "measured_e": row.measured_e}
        for row in check.rows
    ]
    totals = {"conditions": len(rows), "covered": check.covered, "median_ratio": check.median_ratio}
    return totals | {"planned_s": check.planned_s, "reference_s": check.reference_s, "rows": rows}


def check_plan(
    study: Study, planned: Plan, reference: Plan, *, cache: Path, step: Step = lambda what, share: None
) -> BudgetCheck:
    """Render both models with independent seeds and compare expected electrons; no sensor noise.

    Parameters
    ----------
    planned, reference : Plan
        Of this study: `studies.budget.plan.plan` and `reference_plan`.
    cache : Path
        Folder of renders.
    """
    rows: list[CheckedCondition] = []
    seconds = {"planned": 0.0, "reference": 0.0}
    for choice, opened in open_all(study).items():
        transports = {}
        for name, model, offset in (("planned", planned, 0), ("reference", reference, REFERENCE_SEED)):
            step(f"{choice.source}, {name}", len(rows) / len(planned.ledgers))
            render = model.renders.get(choice)
            transports[name], _ = make_transport(opened, study, render, cache, lambda *_: None, seed_offset=offset)
            seconds[name] += transports[name].seconds
        spp_over_reference = planned.renders[choice].spp / reference.renders[choice].spp if opened.scene else 0.0
        for row in planned.ledgers:
            if row.condition.scene == choice:
                expected = model_electrons(transports["planned"], row, planned.images[row.condition])
                true = model_electrons(transports["reference"], row, reference.images[row.condition])
                below = true < preset(row.condition.sensor).pixel.full_well_e * row.condition.frames
                measured = float(np.sqrt(np.mean((expected - true)[below] ** 2))) if below.any() else 0.0
                # The reference has noise of its own, of its samples and of its level.
                rms_e = {term.name: term.rms_e for term in row.terms}
                square = row.rms_e**2 + rms_e[MONTE_CARLO] ** 2 * spp_over_reference + rms_e[LEVEL] ** 2
                rows.append(CheckedCondition(row, predicted_e=float(np.sqrt(square)), measured_e=measured))
    return BudgetCheck(tuple(rows), planned_s=seconds["planned"], reference_s=seconds["reference"])


def model_electrons(transport: Transport, row: Ledger, model: ImageModel) -> NDArray[np.float64]:
    """Expected electrons (h, w) of a condition and mosaic under a model of render, lens and readout."""
    condition = row.condition
    lit = under(transport, condition.spectrum)
    level = level_luminance(condition.level, lux_per_cd_m2(lit, [condition.level]))
    sensor = replace(vary(preset(condition.sensor), row.mosaic).undivided, lens=model.lens)
    image = form_image(photographed(lit, level), sensor)
    if model.exact:
        return expected_electrons(image, sensor, row.exposure_s)
    weights = electrons_per_irradiance(sensor, image.wavelength_nm, image.widths_nm, row.exposure_s)
    return expected_electrons_single(image.values, weights, sensor).astype(np.float64)
