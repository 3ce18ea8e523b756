"""A plan: how each scene is rendered, and which terms of the lens each condition's image holds."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rodcone.brief import brief
from sensor.presets import preset
from studies.budget.ledger import Ledger, ledger_html
from studies.study.model import ImageModel, RenderModel
from studies.study.study import Condition, SceneChoice, Study, conditions


@dataclass(frozen=True)
class Plan:
    """Models of a study's scenes and conditions, and the share of the noise variance that each is predicted to add.

    `ledgers` holds what that is made of, a row a condition and mosaic.
    """

    renders: Mapping[SceneChoice, RenderModel]
    images: Mapping[Condition, ImageModel]
    shares: Mapping[Condition, float] = field(default_factory=dict)
    ledgers: tuple[Ledger, ...] = ()

    __repr__ = brief

    def _repr_html_(self) -> str:
        if not self.ledgers:
            return f"<p>Plan without a budget: renders {len(self.renders)}, images {len(self.images)}</p>"
        return ledger_html(self.ledgers)


def as_stated(study: Study) -> Plan:
    """Plan without a budget: bands and samples as the study states, lenses as the study and its sensors state."""
    low, high = study.render.range_nm
    edges = np.linspace(low, high, max(1, round((high - low) / study.render.band_nm)) + 1)
    centres, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    render = RenderModel(tuple(centres.tolist()), tuple(widths.tolist()), study.render.spp, study.render.denoise)
    lenses = {name: study.lens.on(preset(name).lens) for name in study.sensors}
    images = {condition: ImageModel(lenses[condition.sensor]) for condition in conditions(study)}
    return Plan(renders=dict.fromkeys(study.scenes, render), images=images)
