"""Cells of a study: one picture each, with all that decides it, a key of that, and random streams by coordinates."""

import json
from dataclasses import asdict, astuple, dataclass
from pathlib import Path

import numpy as np

from isp.colour.colour_fit import ColourFit
from rodcone.digests import digest
from sensor.config import SensorConfig
from studies.metrics.truth import Light
from studies.study.levels import parse_level
from studies.study.lit_scene import RenderFacts
from studies.study.study import Condition, label, parse_exposure
from studies.sweep.provenance import Provenance


@dataclass(frozen=True)
class Coordinates:
    """Place of a cell in its study, as the user wrote it; files by their own names."""

    scene: str
    spectrum: str
    level: str
    exposure: str
    sensor: str
    processor: str
    seed: int


@dataclass(frozen=True)
class RenderRecord:
    """A render as a sweep keeps it.

    Attributes
    ----------
    content : str
        Hash of the radiance.
    facts : RenderFacts
    brightest_share : float or None
        Monte Carlo share in the brightest light, for a study that asks for one (`RenderLimits.noise_share`).
    notes : tuple of str
        What had to be assumed of the scene, and what fell back.
    """

    content: str
    facts: RenderFacts
    brightest_share: float | None
    notes: tuple[str, ...]


def render_text(record: RenderRecord) -> str:
    """What a row holds of a render beside columns of its own, as JSON."""
    facts = asdict(record.facts)
    for column in ("variant", "seconds", "spp", "bands"):
        del facts[column]
    return json.dumps({**facts, "brightest_share": record.brightest_share, "notes": record.notes})


@dataclass(frozen=True)
class Cell:
    """One picture to make. It travels to its worker as it is; arrays travel as paths.

    Attributes
    ----------
    key : str
        Hash of all that decides the picture.
    at : Coordinates
    luminance_cd_m2 : float
        Mean scene luminance.
    illuminance_lux : float or None
        On the reference plane; None without one.
    exposure_s : float
    sensor : SensorConfig
        With the processor's mosaic and the lens that is modelled.
    made_by : Provenance
        Of the process that asks; one that can't make it so refuses.
    colours : ColourFit
        Of the processor's balanced planes, under the scene's light.
    light : Light
    white_cd_m2 : float
        Luminance shown as white.
    electrons, half_difference, truth : Path
        As `studies.sweep.frames.Frame` holds them.
    pictures : Path
        Folder that the picture goes to, under the hash of its content.
    render : RenderRecord
        For the ledger.
    budget_share : float or None
        Share of the noise variance that a plan predicts for its approximations.
    """

    key: str
    at: Coordinates
    luminance_cd_m2: float
    illuminance_lux: float | None
    exposure_s: float
    sensor: SensorConfig
    made_by: Provenance
    colours: ColourFit
    light: Light
    white_cd_m2: float
    electrons: Path
    half_difference: Path
    truth: Path
    pictures: Path
    render: RenderRecord
    budget_share: float | None = None


def coordinates(condition: Condition, processor: str, seed: int) -> Coordinates:
    """Coordinates of a condition's cell, files under their names."""
    scene, sensor = label(condition.scene.source), label(condition.sensor)
    return Coordinates(scene, condition.spectrum, condition.level, condition.exposure, sensor, processor, seed)


def cell_key(
    at: Coordinates,
    frame: str,
    luminance_cd_m2: float,
    exposure_s: float,
    colours: ColourFit,
    made_by: Provenance,
) -> str:
    """Key of a cell: its coordinates, which seed its noise, and all that its picture is made from."""
    return digest([astuple(at), frame, luminance_cd_m2, exposure_s, colours, made_by])


def device_stream(at: Coordinates, mosaic: str) -> np.random.Generator:
    """Stream of a chip's fixed patterns: they belong to the sensor, its mosaic and the seed, not to the exposure."""
    return _stream("device", at.sensor, mosaic, at.seed)


def exposure_stream(at: Coordinates, mosaic: str) -> np.random.Generator:
    """Stream of one exposure's noise; processors of the same mosaic develop the same exposure.

    It depends on names and values alone, not on their places in the study: another level more leaves the others' noise.
    """
    value, unit = parse_level(at.level)
    exposure = parse_exposure(at.exposure)
    return _stream("exposure", at.scene, at.spectrum, value, unit, exposure, at.sensor, mosaic, at.seed)


def _stream(*parts: object) -> np.random.Generator:
    return np.random.default_rng(int(digest(list(parts)), 16))
