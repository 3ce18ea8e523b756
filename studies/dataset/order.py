"""Settings of a data set that its study doesn't have; checks of what samples can't hold and of the room on the disk."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Annotated

from render.radiance_files.radiance_source import extent_of
from rodcone.digests import digest
from rodcone.errors import InputError, require_absent, require_fields, require_keys
from sensor.config import SensorConfig
from sensor.presets import preset, vary
from sensor.readings.resolve import chip_readings, several
from studies.budget.ledger import Plan
from studies.dataset.sample import TRUTH
from studies.study.lit_scene import OpenedScene
from studies.study.study import SceneChoice, Study, study_mosaics

_SCENES = 0, 100_000, "give a number of scenes"
_BYTES = {"rgb": 12, "xyz": 12, "depth": 4, "normals": 12, "ids": 4, "mosaic_e": 4}  # [bytes per pixel]
_SAMPLE_BYTES = 20_000  # the heads of a sample's files, and its facts
# Part of the progress bar for the renders: they take 97 % of the time of the frozen list, less with few samples per
# pixel.
RENDERS = 0.9


@dataclass(frozen=True, kw_only=True)
class SetOrder:
    """Settings of a data set beside its study.

    Attributes
    ----------
    generated : int
        Number of drawn tables under a softbox, beside the study's own scenes.
    seed : int
        Seed of the drawn scenes.
    truth : str
        Planes of truth in a sample, joined by commas; raw frame and facts are always there.
    shards : int
        Number of tar files, at least one for each split that has scenes.
    crop : int, optional
        Side of the parts that frames are cut into [pixels], without the rest at right and below; whole frames by
        default.
    diorama : int, optional
        Number of drawn streets, rooms and tables by day, dusk and night.
    """

    generated: Annotated[int, _SCENES] = 0
    seed: int = 0
    truth: str = ",".join(TRUTH)
    shards: Annotated[int, (1, 100_000, "give a number of files")] = 64
    crop: Annotated[int | None, (16, 8192, "give the side of a part in pixels")] = None
    diorama: Annotated[int | None, _SCENES] = None

    def __post_init__(self) -> None:
        require_fields(self)
        require_keys("truth", self.planes, TRUTH)

    @property
    def planes(self) -> tuple[str, ...]:
        """Return the names of the planes of truth, from `studies.dataset.sample.TRUTH`."""
        return tuple(name.strip() for name in self.truth.split(","))

    @property
    def drawn_scenes(self) -> tuple[SceneChoice, ...]:
        """Return the scenes that are drawn at random; each has a hash of the seed and a counter for its name."""
        counts = {"generated": self.generated, "diorama": self.diorama or 0}
        hashes = ((family, digest([self.seed, index])[:12]) for family in counts for index in range(counts[family]))
        return tuple(SceneChoice("-".join(drawn)) for drawn in hashes)


def check_cameras(study: Study, order: SetOrder) -> None:
    """Raise `InputError` for what a sample can't hold: frames of several readings, or parts that would cut a tile."""
    require_absent(
        "in a data set, whose frames are single ones at a scene's own pixels",
        frames=None if study.frames == (1,) else list(study.frames),
        sensor_side_um=study.sensor_side_um,
        shake=study.lens.shake,
        flicker=study.flicker or None,
        moments=next((scene.moments for scene in study.scenes if scene.moments), None),
    )
    for name in study.sensors:
        sensor = preset(name)
        if sensor.sites > 1 or several(chip_readings(sensor, exposure_s=0.0)):
            raise InputError(
                f"sensors: {name!r} bins or merges readings; allowed in a data set: pixels read once; leave it out"
            )
    for sensor in _cameras(study):
        tile = len(sensor.cfa), len(sensor.cfa[0])
        if order.crop and (order.crop % tile[0] or order.crop % tile[1]):
            raise InputError(
                f"crop: {order.crop} cuts the tile of {tile[0]}x{tile[1]} pixels; allowed: its multiples; give "
                f"{order.crop - order.crop % max(tile)}"
            )


def bytes_needed(study: Study, plan: Plan, scenes: Iterable[OpenedScene], order: SetOrder) -> float:
    """Return the most bytes that a set needs, together with the renders and frames from which it is made."""
    total = 0.0
    conditions = len(study.spectra) * len(study.levels) * len(study.exposures) * len(study.seeds)
    for opened in scenes:
        if opened.scene is None:
            (pixels, _, _), groups, bands = extent_of(opened.choice.source), 1, 0
        else:
            pixels = prod(opened.size)
            groups = len(opened.scene.groups)
            bands = len(plan.renders[opened.choice].wavelength_nm)
        total += 3 * 4 * plan.samples_a_side(opened.choice) ** 2 * pixels * bands * groups
        for sensor in _cameras(study):
            by = {**_BYTES, "channels_e": 4 * len(sensor.channels), "shares": 4 * groups}
            of_sample = pixels * (2 + sum(by[name] for name in order.planes)) + _SAMPLE_BYTES
            total += conditions * of_sample + len(study.spectra) * 4 * pixels * (20 + len(sensor.channels))
    return total


def require_room(needed: float, out: Path) -> None:
    """Raise `InputError` if a set needs more bytes than its folder's files and the disk's free room have together."""
    held = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    free = shutil.disk_usage(out).free
    if needed - held > free:
        raise InputError(
            f"out: the set needs about {(needed - held) / 1e9:.3g} GB more; allowed: {free / 1e9:.3g} GB, which is "
            f"free at {out}; make room, or ask for less by --truth, levels or seeds"
        )


def _cameras(study: Study) -> list[SensorConfig]:
    return [vary(preset(name), mosaic) for name in study.sensors for mosaic in study_mosaics(study)]
