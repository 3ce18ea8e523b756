"""What is modelled: how each scene is rendered, and which terms of the lens each condition's image holds."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sensor.config import LensConfig, SensorConfig
from studies.plan_ledger import Ledger
from studies.study import Condition, SceneChoice, Study, conditions


@dataclass(frozen=True)
class RenderModel:
    """How one scene is rendered for all of its conditions: band centres and widths [nm], samples a pixel."""

    wavelength_nm: tuple[float, ...]
    width_nm: tuple[float, ...]
    spp: int


@dataclass(frozen=True)
class ImageModel:
    """Terms of the lens, as `sensor.config.LensConfig` has them (0: left out), and the readout.

    `exact` reads out in NumPy; otherwise `sensor.lanes.read_frame` does in single precision.
    """

    diffraction: float
    veiling_glare: float
    horizontal_view_deg: float
    exact: bool = True


@dataclass(frozen=True)
class Plan:
    """Models of a study's scenes and conditions, and the share of the noise variance that each is predicted to add.

    `ledgers` holds what that is made of, a row a condition and mosaic.
    """

    renders: Mapping[SceneChoice, RenderModel]
    images: Mapping[Condition, ImageModel]
    shares: Mapping[Condition, float] = field(default_factory=dict)
    ledgers: tuple[Ledger, ...] = ()

    def _repr_html_(self) -> str:
        from studies.plan_report import plan_html  # late: it reads this type

        return plan_html(self)


def modelled(sensor: SensorConfig, model: ImageModel) -> SensorConfig:
    """Sensor whose lens has the model's terms."""
    lens = replace(
        sensor.lens,
        diffraction=model.diffraction,
        veiling_glare=model.veiling_glare,
        horizontal_view_deg=model.horizontal_view_deg,
    )
    return replace(sensor, lens=lens)


def as_stated(study: Study, lenses: Mapping[str, LensConfig]) -> Plan:
    """Plan without a budget: bands and samples as the study states, lenses as the sensors state."""
    low, high = study.render.range_nm
    edges = np.linspace(low, high, max(1, round((high - low) / study.render.band_nm)) + 1)
    render = RenderModel(
        tuple(((edges[1:] + edges[:-1]) / 2).tolist()), tuple(np.diff(edges).tolist()), study.render.spp
    )
    images = {}
    for condition in conditions(study):
        lens = lenses[condition.sensor]
        images[condition] = ImageModel(lens.diffraction, lens.veiling_glare, lens.horizontal_view_deg)
    return Plan(dict.fromkeys(study.scenes, render), images)
