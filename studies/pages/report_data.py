"""Values that a report shows: `report_sweep` makes them from a sweep's rows, `report` writes them into a page."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rodcone.types import Floats
from sensor.config import SensorConfig
from studies.metrics.confidence import half_width
from studies.sweep.row import Row


@dataclass(frozen=True)
class ReportScene:
    """A scene by name, and its size in pixels."""

    name: str
    height: int
    width: int


@dataclass(frozen=True)
class ReportLevel:
    """A light level by name, and the source of its luminance."""

    name: str
    source: str


@dataclass(frozen=True)
class ReportSensor:
    """A sensor by name, and its numbers; None for a sensor file that is no longer there."""

    name: str
    config: SensorConfig | None


@dataclass(frozen=True)
class ReportRender:
    """Facts of a scene's render and the error that it reached; None where they aren't known.

    Attributes
    ----------
    relative_mc_error : float
        Relative Monte Carlo error of the scene under its own lights.
    """

    scene: str
    spp: float | None = None
    bands: int | None = None
    seconds: float | None = None
    integrator: str | None = None
    stopped_by: str | None = None
    relative_mc_error: float | None = None


@dataclass(frozen=True)
class ReportCell:
    """One camera's picture in one condition, over all seeds.

    Attributes
    ----------
    level : int
        Index of the light level.
    camera : str
    luminance_cd_m2, illuminance_lux : float or None
        The level in both units.
    rows : tuple of Row or None
        A row for each seed, in the study's order; None for a row that isn't made yet.
    picture : str or None
        Name among the page's pictures; None if the page leaves the picture out.
    """

    level: int
    camera: str
    luminance_cd_m2: float | None
    illuminance_lux: float | None
    rows: tuple[Row | None, ...]
    picture: str | None

    @property
    def first(self) -> Row | None:
        """Return the row of the first seed, whose picture, exposure, electrons, engines and times the page shows."""
        return self.rows[0]

    def samples(self, key: str) -> Floats:
        """Return a figure of every seed's row, (seed,); all are NaN if one is unknown or not finite."""
        if key not in self._known:
            values = np.array([getattr(row, key, None) for row in self.rows], dtype=np.float64)
            self._known[key] = values if np.isfinite(values).all() else np.full_like(values, np.nan)
        return self._known[key]

    @cached_property
    def _known(self) -> dict[str, Floats]:
        """Return the figures that were computed already, kept here because a page asks for each a hundred times."""
        return {}

    def mean(self, key: str) -> float:
        """Return the mean of a figure over the seeds; NaN if it is unknown for one of them."""
        return float(self.samples(key).mean())

    def half(self, key: str) -> float:
        """Return half the width of the mean's 95 % interval; NaN for one seed too."""
        return float(half_width(self.samples(key)))

    @property
    def substitution(self) -> float | None:
        """Return the share of the seeds in which W replaced the luminance; None if it is unknown for one of them."""
        states = [row.substitution for row in self.rows if row and row.substitution is not None]
        return sum(states) / len(states) if len(states) == len(self.rows) else None

    @property
    def balance(self) -> dict[str, str]:
        """Return how each channel was balanced; ``calibrated`` if the balance fell back to that for any seed."""
        balances = [json.loads(row.balance) for row in self.rows if row]
        fallen = {channel: how for balance in balances for channel, how in balance.items() if how == "calibrated"}
        return (balances[0] if self.first else {}) | fallen


@dataclass(frozen=True)
class ReportData:
    """Content of a report, except the pictures' bytes.

    Attributes
    ----------
    rodcone, name, title : str
        Version of rodcone, the study's name, and the report's title.
    compare : tuple of str
        The two cameras that are compared at first; empty if the study names none.
    scenes ... seeds
        Axes of the study.
    cells : tuple of ReportCell
        A cell for each scene, spectrum, sensor, exposure, white balance, level and camera; the last varies fastest.
    truths : tuple of str or None
        Name of the noise-free picture of each scene under each spectrum; None if it isn't made yet.
    stages : mapping of str to float
        Seconds by stage.
    environment, configuration : mapping of str to str
        Versions and engines that made the numbers, and the study's settings.
    left_out : tuple of str
        Effects that the model leaves out, each as ``effect: cost``.
    notes : tuple of str
        Notes on what fell back or is missing.
    pictures_left_out : str
        A sentence on the pictures that aren't in the page; empty where all are.
    looked_at : (int, int)
        Column and row of the first picture that the loupe shows at first.
    denoised : bool
        Whether the pictures show denoised light.
    """

    rodcone: str
    name: str
    title: str
    scenes: tuple[ReportScene, ...]
    spectra: tuple[str, ...]
    sensors: tuple[ReportSensor, ...]
    exposures: tuple[str, ...]
    balances: tuple[str, ...]
    levels: tuple[ReportLevel, ...]
    cameras: tuple[str, ...]
    seeds: tuple[int, ...]
    cells: tuple[ReportCell, ...]
    truths: tuple[str | None, ...]
    renders: tuple[ReportRender, ...]
    stages: Mapping[str, float]
    environment: Mapping[str, str]
    configuration: Mapping[str, str]
    exposure_rule: str
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    pictures_left_out: str = ""
    looked_at: tuple[int, int] = (0, 0)
    compare: tuple[str, ...] = ()
    denoised: bool = False

    @property
    def by_group(self) -> list[tuple[ReportCell, ...]]:
        """Return the cells by group: all levels and cameras of one scene, spectrum, sensor, exposure and balance."""
        count = len(self.cameras) * len(self.levels)
        return [self.cells[start : start + count] for start in range(0, len(self.cells), count)]
