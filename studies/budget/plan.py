"""The error budget of a study: what its pictures have to hold, and what the sensor's noise hides."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from render.engine import render
from render.spectrum import Spectrum, fine_bands
from render.transport import Transport
from rodcone.errors import InputError
from rodcone.progress import Step
from sensor.burst import merged_sensor
from sensor.config import LensConfig
from sensor.exposure import AUTO, amplified, at_level_s
from sensor.presets import preset, vary
from studies.budget.bands import counts, groups_of, wide_bands
from studies.budget.choice import choose
from studies.budget.ledger import KERNEL, PilotNoise, Plan, Weighed, ledger, weigh
from studies.budget.terms import LENS_TERMS, SHAKE, effects, horizontal_view_deg, shake_effect
from studies.study.gain import at_gain
from studies.study.levels import parse_exposure
from studies.study.lit_scene import OpenedScene, level_luminance, lux_per_cd_m2, open_all, under, white_spectrum
from studies.study.model import ImageModel, in_bands, unit_exposure_s
from studies.study.scene_source import open_radiance_file
from studies.study.study import OWN, Study, conditions, mosaics, most_spp

PILOT_SIDE = 64  # pixels of a pilot's longer side; at fewer pixels a picture is no smoother, so no effect is smaller
PILOT_SEED = 1 << 32  # added to the study's seed: the pilot is no part of a render, and the cache keeps them apart
PILOT_SPP = 128
REFERENCE_SAMPLES = 4  # times what the study allows: the reference's noise is then at most half of the plan's

Groups = Mapping[int, Sequence[NDArray[np.intp]]]


@dataclass(frozen=True)
class Pilot:
    """A scene rendered small with few samples, in fine bands, and the choices of wider ones. A picture file is one."""

    opened: OpenedScene
    transport: Transport
    groups: Groups

    @property
    def rendered(self) -> bool:
        """Whether it is a render, and no picture file."""
        return self.opened.scene is not None


def plan(study: Study, *, cache: str | Path | None = None, step: Step | None = None) -> Plan:
    """Compute a study's error budget on pilot renders and choose the cheapest model within it.

    Parameters
    ----------
    study : Study
        `budget` holds the shares, `lens` what the lens does in full, `render.spp` the most samples. They are those of
        the unbiased light: what a denoiser leaves isn't known before the render.
    cache : str or Path, optional
        Folder of renders.
    step : callable, optional
        Called with what is being done and the share that is done; a notebook shows a bar for each pilot's render.

    Returns
    -------
    Plan
        The same for the same study, whatever the machine's speed. Picture files have no entry in `renders`.

    Raises
    ------
    InputError
        For a scene that can't be opened or rendered, or sensors of one size, whose pixels aren't the pilots'.
    """
    if study.sensor_side_um is not None:
        raise InputError(
            f"sensor_side_um: {study.sensor_side_um:g} can't be planned; allowed: sweep --as-stated; add it, or leave "
            "sensor_side_um out"
        )
    renders, images, ledgers = {}, {}, []
    opened_scenes = open_all(study)
    for index, opened in enumerate(opened_scenes.values()):
        if step:
            step(f"pilot of {opened.choice.source}", index / len(opened_scenes))
        pilot = make_pilot(opened, study, None if cache is None else Path(cache))
        rows = list(_weigh_all(pilot, study))
        sizes = {count: len(groups) for count, groups in pilot.groups.items()}
        choice = choose(rows, sizes, study.budget, most_spp(study, opened.choice) if pilot.rendered else 0)
        if pilot.rendered:
            fine = pilot.transport.wavelength_nm, pilot.transport.width_nm
            wide = wide_bands(*fine, pilot.groups[choice.count])
            renders[opened.choice] = in_bands(wide, choice.spp, study.render.denoise)
        for row in rows:
            left_out = choice.left_out[row.condition]
            lens = full_lens(study, preset(row.condition.sensor).lens, opened)
            without = {field: 0.0 for name, field in LENS_TERMS.items() if name in left_out}
            images[row.condition] = ImageModel(replace(lens, **without), exact=KERNEL not in left_out)
            ledgers.append(ledger(row, choice.count, choice.spp, left_out))
    shares = {row.condition: row.share for row in sorted(ledgers, key=lambda row: row.share)}  # the worst mosaic's
    return Plan(renders=renders, images=images, shares=shares, ledgers=tuple(ledgers))


def reference_plan(study: Study) -> Plan:
    """Model everything: fine bands, four times the samples that the study allows, the whole lens, the exact readout."""
    renders, images = {}, {}
    for opened in open_all(study).values():
        if opened.scene is not None:
            fine = fine_bands(_spectra(opened, study), study.render.range_nm)
            spp = min(REFERENCE_SAMPLES * most_spp(study, opened.choice), 1 << 16)
            renders[opened.choice] = in_bands(fine, spp)
        for condition in conditions(study, opened.choice):
            images[condition] = ImageModel(full_lens(study, preset(condition.sensor).lens, opened))
    return Plan(renders=renders, images=images)


def make_pilot(opened: OpenedScene, study: Study, cache: Path | None = None) -> Pilot:
    """Render a scene's pilot.

    A picture file is its own pilot, and keeps its bands.
    """
    if opened.scene is None:
        transport = open_radiance_file(opened.choice.source, opened.white)[0]
        single = [np.array([band]) for band in range(transport.wavelength_nm.size)]
        return Pilot(opened, transport, {len(single): single})
    nm, width_nm = fine_bands(_spectra(opened, study), study.render.range_nm)
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
    return Pilot(opened, transport, {count: groups_of(width_nm, count) for count in counts(width_nm)})


def full_lens(study: Study, lens: LensConfig, opened: OpenedScene) -> LensConfig:
    """Lens of the reference: what the study states, then what the sensor's own has, then a good lens in the scene."""
    view = 0.0 if opened.scene is None else horizontal_view_deg(opened.scene.geometry["sensor"], opened.size)
    whole = replace(
        lens,
        diffraction=lens.diffraction or 1.0,  # an ideal aperture
        veiling_glare=lens.veiling_glare or 0.01,  # a good photographic lens by the index of ISO 9358
        horizontal_view_deg=lens.horizontal_view_deg or view,
    )
    return study.lens.on(whole)


def _spectra(opened: OpenedScene, study: Study) -> list[Spectrum]:
    """Every spectrum that the scene is lit by."""
    own_spectra = [group.spectrum for group in opened.scene.groups.values()] if opened.scene else []
    return own_spectra + [white_spectrum(opened, name) for name in study.spectra if name != OWN]


def _weigh_all(pilot: Pilot, study: Study) -> Iterator[Weighed]:
    """Weigh each condition and mosaic of one scene."""
    rng = np.random.default_rng([study.render.seed, PILOT_SEED])
    for spectrum in study.spectra:
        lit = under(pilot.transport, spectrum)
        lux = lux_per_cd_m2(lit, study.levels)
        noise, radiance = _pilot_noise(pilot, lit), lit.relight(luminance_cd_m2=1.0)
        for name in study.sensors:
            auto_s = unit_exposure_s(radiance, preset(name).undivided)
            for mosaic in mosaics(study):
                sensor = vary(preset(name), mosaic).undivided  # a pilot is coarser anyway
                lens = full_lens(study, sensor.lens, pilot.opened)
                sensor = replace(sensor, lens=lens)
                of_any_time = effects(lit, sensor, lens, pilot.groups, rng)
                for condition in conditions(study, pilot.opened.choice):
                    if (condition.spectrum, condition.sensor) == (spectrum, name):
                        level = level_luminance(condition.level, lux)
                        exposure_s, camera = parse_exposure(condition.exposure), at_gain(sensor, condition.gain)
                        if exposure_s is None:
                            wish_s = at_level_s(auto_s, level, AUTO, sensor) * sensor.gain / camera.gain
                            exposure_s, camera = amplified(camera, wish_s, study.longest_exposure_s)
                        sensor_effects = of_any_time
                        if lens.shake_um:
                            shake = shake_effect(lit, sensor, lens, exposure_s, rng)
                            sensor_effects = replace(of_any_time, lens={**of_any_time.lens, SHAKE: shake})
                        together = merged_sensor(camera, condition.frames), exposure_s * condition.frames
                        yield weigh(condition, mosaic, together[0], sensor_effects, level, together[1], noise)


def _pilot_noise(pilot: Pilot, lit: Transport) -> PilotNoise:
    """Monte Carlo noise of the pilot; a picture file states none."""
    if not pilot.rendered:
        return PilotNoise(spp=0, half_spp=1, level=0.0)
    fewer = lit.coverage.mean.size / (pilot.opened.size[0] * pilot.opened.size[1])
    error = lit.level().relative_error or 0.0
    return PilotNoise(spp=lit.spp, half_spp=lit.spp / 2, level=error**2 * lit.spp * fewer)
