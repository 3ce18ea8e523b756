"""Every stage of the chain, measured one after the other."""

from collections.abc import Iterator

from scenes.catalog import load
from sensor.presets import preset
from studies.speed.camera_choices import by_lens, by_readout, by_reconstruction, camera_of
from studies.speed.points import Stage
from studies.speed.render_choices import by_bands, by_samples
from studies.speed.setup import Bench

STAGES = 6


def stages(bench: Bench) -> Iterator[Stage]:
    """Measure one stage after the other."""
    scene, sensor = load(bench.scene), preset(bench.sensor)
    finest, made = by_bands(bench, scene, sensor)
    yield made
    yield by_samples(bench, scene, sensor)
    camera = camera_of(bench, scene, sensor, finest)
    yield by_lens(bench, camera)
    yield by_readout(bench, camera)
    yield from by_reconstruction(bench, camera)
