"""Cells of a study. A cell is one picture: all that decides it, its key, and the random streams of its noise."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isp.colour.colour_fit import ColourFit
from rodcone.digests import digest, rounded
from sensor.flicker.waveform import Waveform
from studies.study.levels import parse_exposure, parse_level
from studies.study.render_facts import RenderFacts
from studies.study.study import Condition, label
from studies.sweep.frames import UnitFrame
from studies.sweep.provenance import Provenance


@dataclass(frozen=True)
class RenderRecord:
    """A render as a sweep keeps it.

    Attributes
    ----------
    content : str
        Hash of the radiance.
    facts : RenderFacts
    brightest_share : float or None
        Monte Carlo variance over the sensor's own noise variance in the study's brightest light; None unless the study
        states a `RenderLimits.noise_share`.
    notes : tuple of str
        Notes on what had to be assumed about the scene, and on parts that ran in NumPy for want of a backend.
    """

    content: str
    facts: RenderFacts
    brightest_share: float | None
    notes: tuple[str, ...]


def render_text(record: RenderRecord) -> str:
    """Return as JSON what a row says about its render in one column; some facts have columns of their own."""
    facts = asdict(record.facts)
    for column in ("variant", "seconds", "spp", "bands"):
        del facts[column]
    return json.dumps({**facts, "brightest_share": record.brightest_share, "notes": record.notes})


@dataclass(frozen=True)
class Cell:
    """Picture that is to be made. It is sent to a worker by pickle, with paths in place of arrays.

    Attributes
    ----------
    key : str
        Hash of all that decides the picture.
    condition : Condition
    processor : str
    seed : int
    luminance_cd_m2 : float
        Mean scene luminance.
    illuminance_lux : float or None
        Illuminance of the reference plane; None without one.
    exposure_s : float
    frame : UnitFrame
        Frame whose sensor has the processor's mosaic and the modelled lens.
    made_by : Provenance
        Provenance in the process that runs the sweep; a worker with other versions or engines refuses the cell.
    colours : ColourFit or None
        Fit of the processor's colours under the scene's light; None until the cell has to be made.
    white_cd_m2 : float
        Luminance shown as white.
    pictures : Path
        Folder that the picture goes to, under the hash of its content.
    render : RenderRecord
        The render, for the row.
    budget_share : float or None
        Share of the noise variance that a plan predicts for its approximations.
    flicker : Waveform or None
        Waveform of all lamps; None where they are steady.
    """

    key: str
    condition: Condition
    processor: str
    seed: int
    luminance_cd_m2: float
    illuminance_lux: float | None
    exposure_s: float
    frame: UnitFrame
    made_by: Provenance
    colours: ColourFit | None
    white_cd_m2: float
    pictures: Path
    render: RenderRecord
    budget_share: float | None = None
    flicker: Waveform | None = None

    @property
    def fit(self) -> ColourFit:
        """Return the colours of a cell that is made."""
        if self.colours is None:
            raise ValueError("a cell that is made has colours")
        return self.colours

    @property
    def kind(self) -> tuple[str, Condition]:
        """Return the cell's processor and condition: cells of one kind differ by seed alone, and share preparations."""
        return self.processor, self.condition


def labels(condition: Condition) -> dict[str, Any]:
    """Return the values of a condition as rows name them: a file by its name, without its folder."""
    files = {name: label(getattr(condition, name)) for name in ("spectrum", "sensor")}
    return vars(condition) | {"scene": condition.scene.label, **files}


def stated_columns(cell: Cell) -> dict[str, Any]:
    """Return the columns of a cell's row that are known before its picture is made."""
    facts = cell.render.facts
    columns = {
        "key": cell.key,
        "render": render_text(cell.render),
        "processor": label(cell.processor),
        "seed": cell.seed,
        "luminance_cd_m2": cell.luminance_cd_m2,
        "illuminance_lux": cell.illuminance_lux,
        "exposure_s": cell.exposure_s,
        "gain_factor": cell.frame.sensor.gain,
        "lens": json.dumps(vars(cell.frame.sensor.lens)),
        "spp": facts.spp,
        "bands": facts.bands,
        "render_s": facts.seconds,
        "budget_share": cell.budget_share,
        "variant": cell.made_by.variant,
        "versions": cell.made_by.versions,
    }
    return labels(cell.condition) | columns


def cell_keys(
    condition: Condition,
    processor: str,
    seeds: Sequence[int],
    frame: str,
    luminance_cd_m2: float,
    exposure_s: float,
    made_by: Provenance,
    flicker: Waveform | None = None,
) -> list[str]:
    """Return the key of each seed's cell, the hash of its place in the study and of all that its picture is made from.

    The place in the study decides the noise. The processor's colours aren't hashed, because they follow from the sensor
    and the light of the frame.
    """
    lamps: list[object] = [] if flicker is None else [flicker]
    place = rounded([labels(condition), processor])
    made_from = rounded([frame, luminance_cd_m2, exposure_s, made_by, *lamps])
    return [digest([*place, seed, *made_from]) for seed in seeds]


def device_stream(sensor: str, mosaic: str, seed: int) -> np.random.Generator:
    """Return the random stream of a chip's fixed patterns.

    They belong to the sensor, its mosaic and the seed, and don't depend on the exposure.
    """
    return _stream("device", label(sensor), mosaic, seed)


def exposure_stream(condition: Condition, mosaic: str, seed: int) -> np.random.Generator:
    """Return the random stream of one exposure's noise; processors of the same mosaic develop the same exposure.

    The stream depends on names and values alone, not on their order in the study: one more level leaves the noise of
    the others unchanged. All automatic exposures share a stream: where their rules choose the same time, the picture is
    the same.
    """
    names = labels(condition)
    value, unit = parse_level(condition.level)
    exposure = parse_exposure(condition.exposure)
    return _stream("exposure", names["scene"], names["spectrum"], value, unit, exposure, names["sensor"], mosaic, seed)


def shake_stream(seed: int) -> np.random.Generator:
    """Return the random stream of the hand's paths, the same for every camera, light and exposure time of a seed."""
    return _stream("shake", seed)


def flicker_stream(seed: int) -> np.random.Generator:
    """Return the random stream of the moment in the lamps' cycle at which a seed's exposures start.

    It is the same for every camera.
    """
    return _stream("flicker", seed)


def _stream(*parts: object) -> np.random.Generator:
    return np.random.default_rng(int(digest(list(parts)), 16))
