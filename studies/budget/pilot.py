"""A pilot: a scene rendered small, from which the errors of every possible model are found."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.engine import render
from render.error_estimates import Halves
from render.geometry import horizontal_view_deg
from render.radiance_files.photo import SURFACES
from render.spectrum import Spectrum, fine_bands
from render.transport import Transport
from rodcone.types import Floats
from sensor.burst import merged_sensor
from sensor.config import LensConfig
from sensor.exposure import AUTO, amplified, at_level_s
from sensor.presets import preset, vary
from studies.budget.bands import band_groups
from studies.budget.effects import SHAKE, find_effects, shake_effect
from studies.budget.scaled_effects import PilotNoise, ScaledEffects, scale_effects
from studies.study.gain import at_gain
from studies.study.levels import parse_exposure
from studies.study.lit_scene import OpenedScene, level_luminance, lux_per_cd_m2, under, white_spectrum
from studies.study.model import unit_exposure_s
from studies.study.scene_source import open_radiance_file
from studies.study.study import OWN, Study, conditions, most_spp, study_mosaics

PILOT_SIDE = 64  # pixels of a pilot's longer side; at fewer pixels no effect is smaller, because detail is coarser
FILE_SIDE = 128  # pixels of the longer side of a picture file's pilot, which costs no render
PILOT_SEED = 1 << 32  # added to the study's seed, so that pilots share no samples with renders, nor files in the cache
PILOT_SPP = 128


@dataclass(frozen=True)
class Pilot:
    """A scene rendered small with few samples, in fine bands, or a picture file of fewer pixels.

    Attributes
    ----------
    opened : OpenedScene
    transport : Transport
    groups : mapping of int to sequence of index arrays
        The fine bands that make each wide one, by each number of wide bands that a model may have.
    """

    opened: OpenedScene
    transport: Transport
    groups: Mapping[int, Sequence[NDArray[np.intp]]]

    @property
    def rendered(self) -> bool:
        """Return whether the pilot is a render, rather than a picture file."""
        return self.opened.scene is not None


def make_pilot(opened: OpenedScene, study: Study, counts: Iterable[int], cache: Path | None = None) -> Pilot:
    """Render a scene's pilot, and group its fine bands into wide ones, for each number in `counts`.

    A picture file keeps its own bands; if it is larger than `FILE_SIDE`, whole blocks of pixels are averaged into one.
    """
    if opened.scene is None:
        transport = open_radiance_file(opened.choice.source, opened.white, opened.choice.spectra or SURFACES)[0]
        transport = _in_blocks(transport, -(-max(transport.counts.shape) // FILE_SIDE))
        single = [np.array([band]) for band in range(transport.wavelength_nm.size)]
        return Pilot(opened, transport, {len(single): single})
    nm, width_nm = reference_bands(opened, study)
    scale = min(1.0, PILOT_SIDE / max(opened.size))
    size = max(1, round(opened.size[0] * scale)), max(1, round(opened.size[1] * scale))
    transport = render(
        opened.scene,
        size,
        wavelength_nm=nm,
        width_nm=width_nm,
        seed=study.render.seed + PILOT_SEED,
        max_spp=min(most_spp(study, opened.choice), PILOT_SPP),
        cache=cache,
    )
    return Pilot(opened, transport, {count: band_groups(width_nm, count) for count in counts})


def _in_blocks(transport: Transport, side: int) -> Transport:
    """Average blocks of `side` x `side` pixels into one; blocks at the far borders are smaller.

    The means from which levels are computed stay those of the whole picture.
    """
    if side == 1:
        return transport
    starts = [np.arange(0, length, side) for length in transport.counts.shape]

    def sums(planes: NDArray[Any]) -> NDArray[Any]:
        return np.add.reduceat(np.add.reduceat(planes, starts[0], axis=-2), starts[1], axis=-1)

    pixels = sums(np.ones(transport.counts.shape, np.float32))

    def halves(whole: Halves) -> Halves:
        return Halves(sums(whole.mean) / pixels, sums(whole.difference) / pixels)

    return replace(
        transport,
        light=halves(transport.light),
        variance=sums(transport.variance) / pixels**2,
        coverage=halves(transport.coverage),
        seen=tuple(halves(group) for group in transport.seen),
        counts=sums(transport.counts),
    )


def reference_bands(opened: OpenedScene, study: Study) -> tuple[Floats, Floats]:
    """Return centres and widths of the finest bands [nm], with a band for each line of a lamp that lights the scene."""
    own_spectra: list[Spectrum] = []
    if opened.scene is not None:
        own_spectra = [group.spectrum for group in opened.scene.groups.values()]
    given = [white_spectrum(opened, name) for name in study.spectra if name != OWN]
    return fine_bands([*own_spectra, *given], study.render.range_nm)


def full_lens(study: Study, lens: LensConfig, opened: OpenedScene) -> LensConfig:
    """Return the reference's lens: the study's, else the sensor's own, else a good lens in the scene."""
    view = 0.0
    if opened.scene is not None and not (study.lens.table or lens.table):  # a table states its own falloff
        view = horizontal_view_deg(opened.scene.geometry["sensor"], opened.size)
    whole = replace(
        lens,
        diffraction=lens.diffraction or 1.0,  # 1 is the diffraction of an ideal aperture
        veiling_glare=lens.veiling_glare or 0.01,  # a good photographic lens, by the index of ISO 9358
        horizontal_view_deg=lens.horizontal_view_deg or view,
    )
    return study.lens.on(whole)


def scaled_effects_of(pilot: Pilot, study: Study) -> Iterator[ScaledEffects]:
    """Yield the errors of every possible model for each condition and mosaic of the pilot's scene."""
    rng = np.random.default_rng([study.render.seed, PILOT_SEED])
    for spectrum in study.spectra:
        lit = under(pilot.transport, spectrum)
        lux = lux_per_cd_m2(lit, study.levels)
        noise = _pilot_noise(pilot, lit)
        radiance = lit.relight(luminance_cd_m2=1.0)
        for name in study.sensors:
            camera_alone = study.lens.behind(preset(name))
            auto_s = unit_exposure_s(radiance, camera_alone.undivided)
            for mosaic in study_mosaics(study):
                sensor = vary(camera_alone, mosaic).undivided  # the pilot's pixels are coarser than photodiodes anyway
                lens = full_lens(study, sensor.lens, pilot.opened)
                sensor = replace(sensor, lens=lens)
                of_any_time = find_effects(lit, sensor, lens, pilot.groups, rng)
                for condition in conditions(study, pilot.opened.choice):
                    if (condition.spectrum, condition.sensor) != (spectrum, name):
                        continue
                    level = level_luminance(condition.level, lux)
                    exposure_s = parse_exposure(condition.exposure)
                    camera = at_gain(sensor, condition.gain)
                    if exposure_s is None:
                        wanted_s = at_level_s(auto_s, level, AUTO, sensor) * sensor.gain / camera.gain
                        exposure_s, camera = amplified(camera, wanted_s, study.longest_exposure_s)
                    effects = of_any_time
                    if lens.shake_um:
                        shake = shake_effect(lit, sensor, lens, exposure_s, rng)
                        effects = replace(of_any_time, lens={**of_any_time.lens, SHAKE: shake})
                    burst = merged_sensor(camera, condition.frames)
                    burst_s = exposure_s * condition.frames
                    yield scale_effects(condition, mosaic, burst, effects, level, burst_s, noise)


def _pilot_noise(pilot: Pilot, lit: Transport) -> PilotNoise:
    """Return the Monte Carlo noise of the pilot; none is known for a picture file."""
    if not pilot.rendered:
        return PilotNoise(spp=0, half_spp=1, level=0.0)
    fewer = lit.coverage.mean.size / (pilot.opened.size[0] * pilot.opened.size[1])
    error = lit.level().relative_error or 0.0
    return PilotNoise(spp=lit.spp, half_spp=lit.spp / 2, level=error**2 * lit.spp * fewer)
