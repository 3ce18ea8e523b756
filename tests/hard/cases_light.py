"""Hard cases of light: from starlight to the sun's glint, 10^8 between neighbours, the ends of single precision."""

from dataclasses import replace

import numpy as np
from hard.case import Case, Margin, Situation, low_noise, worse, worst_of
from hard.chain import CAMERAS, develop, expected, shoot
from hard.invariants_raw import bias
from hard.light import (
    BANDS_NM,
    GLINT_CD_M2,
    SIDE,
    STARLIGHT_CD_M2,
    at_level,
    checkerboard,
    cropped,
    even,
    planar,
    planes_of,
    scaled_to,
    times,
    with_glint,
    with_planes,
)

from isp.interleaved.reconstruction import reconstruct
from render.radiance import SpectralRadiance
from sensor.cfa import channel_map
from sensor.config import LensConfig, SensorConfig
from sensor.presets import table1_pixel

MIDDLE = SIDE // 2


def _lens(**terms: float) -> SensorConfig:
    return replace(low_noise(), lens=LensConfig(2.8, **terms))


def _quiet() -> SensorConfig:
    """No noise but the light's own, in steps of a quarter of an electron: every one counts."""
    sensor = low_noise()
    pixel = replace(sensor.pixel, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0, full_well_e=65_535 / 4)
    return replace(sensor, pixel=pixel, bits=16)


def _even_light(mean_e: float) -> Situation:
    return Situation(scaled_to(even(1.0), low_noise(), 0.01, mean_e))


def _one_pixel(inside: float, outside: float) -> SpectralRadiance:
    pattern = np.full((SIDE, SIDE), outside)
    pattern[MIDDLE, MIDDLE] = inside
    return times(even(1.0), pattern)


def _dim_alone(situation: Situation) -> Margin:
    """Dim pixels expect what they expect alone."""
    dim = checkerboard(1) == 1.0
    both = expected(situation)[dim]
    alone = expected(replace(situation, radiance=times(situation.radiance, 1.0 * dim)))[dim]
    return worst_of(both - alone, 1e-6 * alone, "e⁻")


def _glint_alone(situation: Situation) -> Margin:
    """No other pixel changes."""
    others = np.ones(situation.radiance.shape)
    others[MIDDLE, MIDDLE] = 0.0
    both = expected(situation)[others > 0]
    alone = expected(replace(situation, radiance=times(situation.radiance, others)))[others > 0]
    return worst_of(both - alone, 1e-6 * alone + 1e-12, "e⁻")


def _light_kept(situation: Situation) -> Margin:
    """The lens loses no light.

    The frame's sum behind one filter is that of the lens without the term.
    """
    sharp = replace(situation.sensor, lens=LensConfig(situation.sensor.lens.f_number), cfa=("W",))
    spread = replace(situation.sensor, cfa=("W",))
    with_term = expected(replace(situation, sensor=spread)).sum()
    without = expected(replace(situation, sensor=sharp)).sum()
    return worst_of(with_term - without, 1e-6 * without, "e⁻")


def _all_saturated(situation: Situation) -> Margin:
    """All pixels saturated, highlights neutral.

    All but 1e-3 of them.
    """
    margins = []
    for name in CAMERAS:
        made = develop(shoot(situation, name), situation)
        margins.append(worst_of(1.0 - made.raw.saturated.mean(), 1e-3, "of the pixels"))
        means = made.automatic.rgb.mean(axis=(0, 1))
        margins.append(worst_of(np.ptp(means), 0.05 * means.mean(), "e⁻ between colours"))
    return worse(*margins)


def _dark(situation: Situation) -> Margin:
    """Not one electron.

    None is expected, none is drawn.
    """
    drawn = [np.abs(shoot(situation, name).electrons).max() for name in CAMERAS]
    return worst_of(max(*drawn, expected(situation).max()), 1e-9, "e⁻")


def _finer() -> SpectralRadiance:
    """The middle of the scene with the glint, every pixel as 4 x 4 samples."""
    half = cropped(with_glint(at_level(5e3), MIDDLE, MIDDLE), (MIDDLE, MIDDLE))
    return with_planes(half, np.kron(planes_of(half), np.ones((1, 4, 4), dtype=np.float32)))


def _white_of_a_flat_field(situation: Situation) -> Margin:
    """W without bias over 48 frames.

    The mean of the reconstructed W is that of W's samples.
    """
    names = channel_map(situation.sensor.cfa, situation.shape)
    errors = []
    for seed in range(48):
        raw = shoot(situation, "interleaved", 300 + seed)
        estimate = reconstruct(raw)[..., raw.channels.index("W")].astype(np.float64)
        errors.append(estimate.mean() - raw.electrons[names == "W"].mean())
    return bias(np.array(errors), 1.0)


def _exactly(level_e: float) -> Situation:
    return Situation(scaled_to(even(1.0), _quiet(), 0.01, level_e), _quiet())


LIGHT_CASES = (
    Case("starlight", "1e-4 cd/m² for 66 ms", lambda: Situation(at_level(STARLIGHT_CD_M2), exposure_s=0.066)),
    Case(
        "starlight_table1",
        "1e-4 cd/m² for 66 ms, read noise 153 e⁻ and DSNU 200 e⁻",
        lambda: Situation(at_level(STARLIGHT_CD_M2), table1_pixel(), 0.066),
    ),
    Case("starlight_1h", "1e-4 cd/m² for an hour", lambda: Situation(at_level(STARLIGHT_CD_M2), exposure_s=3600.0)),
    Case("moonlight_table1", "0.036 cd/m² for 66 ms", lambda: Situation(at_level(0.036), table1_pixel(), 0.066)),
    Case("one_photon", "0.01 e⁻ a pixel, a pixel without noise", lambda: _exactly(0.01)),
    Case("even_2_e", "an even field, 2 e⁻ a pixel and 6 in W", lambda: _even_light(2.0), _white_of_a_flat_field),
    Case("under_30_e", "29.9 e⁻: the last mean drawn from a table", lambda: _exactly(29.9)),
    Case("over_30_e", "30.1 e⁻: the first mean drawn as a quantile", lambda: _exactly(30.1)),
    Case("at_the_well", "every pixel's mean near the full well", lambda: _exactly(14_000.0)),
    Case("daylight", "20 000 cd/m² for 1/8000 s", lambda: Situation(at_level(2e4), exposure_s=1 / 8000)),
    Case(
        "sun_glint",
        "one pixel of 1e9 cd/m² in a scene of 5000",
        lambda: Situation(with_glint(at_level(5e3), MIDDLE, MIDDLE), exposure_s=1e-3),
        _glint_alone,
    ),
    Case(
        "glint_by_starlight",
        "one pixel of 1e9 cd/m² in a scene of 1e-4: 10^13 in a frame",
        lambda: Situation(with_glint(at_level(STARLIGHT_CD_M2), MIDDLE, MIDDLE), exposure_s=0.066),
        _glint_alone,
    ),
    Case(
        "glint_with_glare",
        "one pixel of 1e9 cd/m² in a scene of 5000, 1 % of veiling glare",
        lambda: Situation(with_glint(at_level(5e3), MIDDLE, MIDDLE), _lens(veiling_glare=0.01), 1e-4),
        _light_kept,
    ),
    Case(
        "glint_with_diffraction",
        "one pixel of 1e9 cd/m² in a scene of 5000, diffraction at f/2.8",
        lambda: Situation(with_glint(at_level(5e3), MIDDLE, MIDDLE), _lens(diffraction=1.0), 1e-4),
        _light_kept,
    ),
    Case(
        "glint_with_diffraction_4",
        "the same on 32 × 32 pixels, each imaged from 4 × 4 samples",
        lambda: Situation(_finer(), _lens(diffraction=1.0), 1e-4, samples_per_pixel=4),
        _light_kept,
    ),
    Case(
        "glint_out_of_focus",
        "one pixel of 1e9 cd/m² in a scene of 5000, a disc of 20 µm",
        lambda: Situation(with_glint(at_level(5e3), MIDDLE, MIDDLE), _lens(defocus_um=20.0), 1e-4),
        _light_kept,
    ),
    Case(
        "neighbours_1e8",
        "each pixel 10^8 times its neighbours, or a 10^8th",
        lambda: Situation(times(even(1e-2), checkerboard(1))),
        _dim_alone,
    ),
    Case(
        "neighbours_1e8_tiles",
        "each tile of the mosaic 10^8 times its neighbours, or a 10^8th",
        lambda: Situation(times(even(1e-2), checkerboard(2))),
    ),
    Case(
        "neighbours_1e8_crosstalk",
        "10^8 between neighbours, 5 % of crosstalk to each of four",
        lambda: Situation(
            times(even(1e-4), checkerboard(1)), replace(low_noise(), pixel=replace(low_noise().pixel, crosstalk=0.05))
        ),
    ),
    Case(
        "neighbours_1e8_diffraction",
        "10^8 between tiles, diffraction at f/2.8",
        lambda: Situation(times(even(1e-2), checkerboard(2)), _lens(diffraction=1.0)),
        _light_kept,
    ),
    Case("all_black", "no light at all", lambda: Situation(even(0.0))),
    Case("all_black_table1", "no light, 153 e⁻ of read noise", lambda: Situation(even(0.0), table1_pixel())),
    Case("all_black_quiet", "no light on a sensor without dark noise", lambda: Situation(even(0.0), _quiet()), _dark),
    Case("all_saturated", "1e9 cd/m² everywhere", lambda: Situation(even(GLINT_CD_M2)), _all_saturated),
    Case(
        "half_saturated",
        "black on the left, 1e9 cd/m² on the right",
        lambda: Situation(times(even(GLINT_CD_M2), 1.0 * (np.indices((SIDE, SIDE))[1] >= MIDDLE))),
    ),
    Case("one_lit_pixel", "one pixel of 1000 cd/m² in the dark", lambda: Situation(_one_pixel(1e3, 0.0))),
    Case("one_black_pixel", "one black pixel in 100 cd/m²", lambda: Situation(_one_pixel(0.0, 100.0))),
    Case(
        "largest_number",
        "radiance of 1e38, single precision ends at 3e38",
        lambda: Situation(planar(np.ones((SIDE, SIDE)), np.full(BANDS_NM.shape, 1e38))),
    ),
    Case(
        "large_number",
        "radiance of 1e22",
        lambda: Situation(planar(np.ones((SIDE, SIDE)), np.full(BANDS_NM.shape, 1e22))),
    ),
    Case(
        "smallest_number",
        "radiance of 1e-45, single precision's smallest",
        lambda: Situation(planar(np.ones((SIDE, SIDE)), np.full(BANDS_NM.shape, 1e-45))),
    ),
)
