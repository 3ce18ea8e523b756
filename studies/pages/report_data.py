"""What a report shows, as values: made from a sweep's rows by `report_sweep`, shown by `report`."""

from collections.abc import Mapping
from dataclasses import dataclass

from sensor.config import SensorConfig
from studies.sweep.row import Row


@dataclass(frozen=True)
class ReportScene:
    """A scene by name, and its size in pixels."""

    name: str
    height: int
    width: int


@dataclass(frozen=True)
class ReportLevel:
    """A light level by name, and where its number comes from."""

    name: str
    source: str


@dataclass(frozen=True)
class ReportSensor:
    """A sensor by name, and its numbers; None for a sensor file that is no longer there."""

    name: str
    config: SensorConfig | None


@dataclass(frozen=True)
class ReportRender:
    """How a scene was rendered and the error that it reached; None where that isn't known.

    Attributes
    ----------
    relative_mc_error : float
        Of the scene under its own lights.
    brightest_share : float
        Largest share of the sensor's noise variance, in the brightest light.
    """

    scene: str
    spp: float | None = None
    bands: int | None = None
    seconds: float | None = None
    variant: str | None = None
    integrator: str | None = None
    stopped_by: str | None = None
    relative_mc_error: float | None = None
    brightest_share: float | None = None


@dataclass(frozen=True)
class ReportCell:
    """One camera's picture in one condition, over all seeds.

    Attributes
    ----------
    group : str
        Title of its sensor and whatever else varies.
    level : int
        Index of the light level.
    camera : str
    luminance_cd_m2, illuminance_lux : float or None
        The level in both units.
    first : Row or None
        The first seed's row: exposure, electrons, engines and times are its.
    figures : mapping of str to float
        Means over the seeds; None where a figure is unknown for a seed.
    intervals : mapping of str to (float, float)
        The means' 95 % intervals, with two seeds or more.
    by_seed : mapping of str to tuple of float
        The figures of each seed, in the study's order; without those that are unknown or not finite for one of them.
    substitution : float or None
        Share of the seeds in which W stood for luminance.
    balance : mapping of str to str
        How each channel was balanced; ``calibrated`` if it fell back for any seed.
    picture : str or None
        Among the page's pictures; None where the page leaves it out.
    """

    group: str
    level: int
    camera: str
    luminance_cd_m2: float | None
    illuminance_lux: float | None
    first: Row | None
    figures: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float]]
    by_seed: Mapping[str, tuple[float, ...]]
    substitution: float | None
    balance: Mapping[str, str]
    picture: str | None


@dataclass(frozen=True)
class ReportData:
    """Everything that a report shows but the pictures' bytes.

    Attributes
    ----------
    rodcone, name, title : str
        Version of rodcone, the study's name, and the report's title.
    scenes ... seeds
        Axes of the study.
    cells : tuple of ReportCell
        One for each scene, spectrum, sensor, exposure, white balance, level and camera, in this order.
    truths : tuple of str or None
        The noise-free picture of each scene under each spectrum; None where it isn't made yet.
    stages : mapping of str to float
        Seconds by stage.
    environment, configuration : mapping of str to str
        What made the numbers, and what the study asked for.
    left_out : tuple of str
        What the model leaves out, each ``effect: cost``.
    notes : tuple of str
        What fell back or is missing.
    pictures_left_out : str
        Which pictures aren't in the page; empty where all are.
    looked_at : (int, int)
        Column and row of the first picture that the loupe shows at first.
    denoised : bool
        Whether the light is.
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
    denoised: bool = False

    @property
    def conditions(self) -> list[tuple[ReportCell, ...]]:
        """The cells by condition: one of each camera."""
        return _parted(self.cells, len(self.cameras))

    @property
    def by_group(self) -> list[tuple[ReportCell, ...]]:
        """The cells by group: all levels and cameras of one scene, spectrum, sensor, exposure and balance."""
        return _parted(self.cells, len(self.cameras) * len(self.levels))

    @property
    def by_scene(self) -> list[tuple[ReportCell, ...]]:
        """The cells by scene."""
        return _parted(self.cells, len(self.cells) // len(self.scenes))


def _parted(cells: tuple[ReportCell, ...], count: int) -> list[tuple[ReportCell, ...]]:
    return [cells[start : start + count] for start in range(0, len(cells), count)]
