"""What is asked of a data set beside its study, what its samples can hold, and the room that it takes."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Annotated, Any

from render.radiance_files.radiance_source import extent_of
from rodcone.digests import digest
from rodcone.errors import InputError, require_absent, require_fields, require_keys, require_whole
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.dataset.sample import PLANES
from studies.study.lit_scene import OpenedScene
from studies.study.study import SceneChoice, Study, mosaics

MOST_GENERATED = 100_000
_BYTES = {"rgb": 12, "xyz": 12, "depth": 4, "normals": 12, "ids": 4, "mosaic_e": 4}  # a pixel; others by channel, group
_SAMPLE_BYTES = 20_000  # heads of its files, and its facts
GB = 1e9


@dataclass(frozen=True)
class SetOrder:
    """What is asked of a set beside its study.

    Attributes
    ----------
    planes : tuple of str
        Truth that goes into a sample, of `studies.dataset.sample.PLANES`.
    shards : int
        Number of files, at least one for each split that has scenes.
    crop : int or None
        Side of the parts that a frame is cut into [pixels]; what is left at its right and lower edge is left out. None
        for whole frames.
    """

    planes: tuple[str, ...] = tuple(PLANES)
    shards: Annotated[int, (1, 100_000, "give a number of files")] = 64
    crop: Annotated[int | None, (16, 8192, "give the side of a part in pixels")] = None

    def __post_init__(self) -> None:
        require_keys("truth", self.planes, PLANES)
        require_fields(self)


def drawn_scenes(count: int, seed: int, family: str = "generated") -> tuple[SceneChoice, ...]:
    """Scenes drawn by one of `scenes.catalog.DRAWN`, their hashes counted from a seed."""
    require_whole(family, count, 0, MOST_GENERATED, "give a number of scenes")
    return tuple(SceneChoice(f"{family}-{digest([seed, index])[:12]}") for index in range(count))


def check_cameras(study: Study, order: SetOrder) -> None:
    """Raise `InputError` for what a sample can't hold: raw frames of other than one reading, a tile that parts cut."""
    require_absent(
        "in a data set, whose frames are single ones at a scene's own pixels",
        frames=None if study.frames == (1,) else list(study.frames),
        sensor_side_um=study.sensor_side_um,
        shake=study.lens.shake,
    )
    for name in study.sensors:
        if preset(name).chip.sites > 1 or preset(name).chip.readings:
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


def bytes_needed(
    study: Study, renders: Mapping[SceneChoice, Any], scenes: Mapping[SceneChoice, OpenedScene], order: SetOrder
) -> float:
    """Bytes of a set with the renders and frames that it is made from, at most."""
    total = 0.0
    conditions = len(study.spectra) * len(study.levels) * len(study.exposures) * len(study.seeds)
    for choice, opened in scenes.items():
        if opened.scene is None:
            (pixels, _, _), groups, bands = extent_of(choice.source), 1, 0
        else:
            pixels, groups, bands = prod(opened.size), len(opened.scene.groups), len(renders[choice].wavelength_nm)
        total += 3 * 4 * pixels * bands * groups
        for sensor in _cameras(study):
            by = {**_BYTES, "channels_e": 4 * len(sensor.channels), "shares": 4 * groups}
            of_sample = pixels * (2 + sum(by[name] for name in order.planes)) + _SAMPLE_BYTES
            total += conditions * of_sample + len(study.spectra) * 4 * pixels * (20 + len(sensor.channels))
    return total


def require_room(needed: float, out: Path) -> None:
    """Raise `InputError` where the disk has less room than a set needs beyond what is in its folder already."""
    held = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    free = shutil.disk_usage(out).free
    if needed - held > free:
        raise InputError(
            f"out: the set needs about {(needed - held) / GB:.3g} GB more; allowed: {free / GB:.3g} GB, which is "
            f"free at {out}; make room, or ask for less by --truth, levels or seeds"
        )


def _cameras(study: Study) -> list[SensorConfig]:
    return [vary(preset(name), mosaic) for name in study.sensors for mosaic in mosaics(study)]
