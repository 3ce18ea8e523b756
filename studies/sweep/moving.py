"""The light of a scene that moves: a render at each of several times, and their average over an exposure."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from render.transport import Transport
from rodcone.digests import digest, digest_bytes
from rodcone.types import Progress
from sensor.config import SensorConfig
from studies.photograph.moments import centred_shares, rolling_average
from studies.study.lit_scene import OpenedScene, make_transport
from studies.study.model import RenderModel
from studies.study.study import SPP, Study

_MOMENT = 0x7473  # part of the seeds at the times, so that the render at the middle has other random paths
_LEAST_SHARE = 1e-9  # a time with this share of a row's exposure or less doesn't count, because that is rounding


@dataclass(frozen=True)
class MovingLight:
    """A moving scene's light at its times, each rendered once and kept in the folder of renders.

    Attributes
    ----------
    opened : OpenedScene
        A scene that moves.
    study : Study
    model : RenderModel
        How each time is rendered.
    cache : Path
    samples : int
        Samples of the light along each side of a pixel.
    """

    opened: OpenedScene
    study: Study
    model: RenderModel
    cache: Path
    samples: int

    def middle(self, progress: Progress) -> tuple[Transport, tuple[str, ...]]:
        """Render the scene at the middle of all exposures, with as many samples as all times have together."""
        model = replace(self.model, spp=min(self.model.spp * len(self.opened.moving), SPP[1]))
        return make_transport(self.opened, self.study, model, self.cache, progress, samples=self.samples)

    def at(self, number: int, progress: Progress) -> Transport:
        """Render the scene at one of its times, with paths of its own, or read that render."""
        limits = self.study.render
        seed = int(np.random.default_rng([limits.seed, _MOMENT, number]).integers(2**31))
        study = replace(self.study, render=replace(limits, seed=seed, reference=False))
        opened = replace(self.opened, scene=self.opened.moving[number])
        return make_transport(opened, study, self.model, self.cache, progress, samples=self.samples)[0]

    def content(self, middle: Transport, progress: Progress) -> tuple[str, float]:
        """Render all times; return a hash of their light with the middle's, and the seconds of all renders."""
        found = [_digest(middle)]
        seconds = middle.seconds
        count = len(self.opened.moving)
        for number in range(count):
            light = self.at(number, part_of(progress, number, count))
            found.append(_digest(light))
            seconds += light.seconds
        return digest(found), seconds

    def exposed(self, sensor: SensorConfig, exposure_s: float, middle: Transport) -> Transport:
        """Average the light over an exposure of a sensor, for each row with its own shares of the times.

        The average has the level of the render at the middle. Times that no row's exposure reaches aren't read.
        """
        opened, samples = self.opened, self.samples
        shares = centred_shares(sensor, opened.size[0], exposure_s, opened.whole_s, len(opened.moving))
        taken = np.flatnonzero((shares > _LEAST_SHARE).any(axis=1))

        def each() -> Iterator[Transport]:
            for number in taken.tolist():
                yield self.at(number, lambda share, error: None)

        mean = rolling_average(each(), np.repeat(shares[taken], samples, axis=1))
        return replace(mean, scene_means=middle.scene_means, meter=middle.meter)


def part_of(progress: Progress, number: int, count: int) -> Progress:
    """Return a progress for one of `count` equal parts, which reports to `progress` as a part of the whole."""
    return lambda share, error: progress((number + share) / count, error)


def _digest(transport: Transport) -> str:
    return digest_bytes(np.ascontiguousarray(transport.radiance).data)
