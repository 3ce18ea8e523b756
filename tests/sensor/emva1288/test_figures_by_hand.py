"""Every figure of a characterisation counted once more from the frames that its bench took, and its plan."""

from dataclasses import replace
from math import erfc, exp, hypot, log10, pi, sqrt
from typing import Any

import numpy as np
import pytest
from refusal import refusal

from sensor.config import LensConfig, SensorConfig
from sensor.emva1288 import estimators as emva
from sensor.emva1288.characterise import ExposurePlan, characterise, configured, measure_camera, plan_for
from sensor.emva1288.from_frames import figures_of_frames
from sensor.emva1288.photon_transfer import Transfer, light_bench
from sensor.pixel import PixelConfig
from sensor.presets import preset

PIXEL = PixelConfig(
    pitch_um=2.2, fill_factor=0.9, full_well_e=9000.0, read_noise_e=12.0, dsnu_e=20.0, prnu=0.03,
    dark_current_e_per_s=4000.0, column_gain_spread=0.02, column_offset_e=25.0, hot_pixel_share=0.05,
    hot_pixel_dark_current_e_per_s=40_000.0,
)  # fmt: skip
SENSOR = SensorConfig(PIXEL, LensConfig(2.8), bits=14, black_level_dn=400.0)
PLAN = ExposurePlan(np.linspace(500.0, 9900.0, 20), 0.02, 5, (0.0, 0.02, 0.05))
SHAPE = (24, 36)


def by_columns(image: np.ndarray) -> tuple[float, float]:
    """Variance of what columns share, and the standard error of the variance of their means."""
    of_means = image.mean(axis=0).var(ddof=1)
    return of_means - image.var(axis=0, ddof=1).mean() / len(image), of_means * sqrt(2 / (image.shape[1] - 1))


def root(variance: float, error: float) -> tuple[float, float]:
    """Standard deviation and its error, from those of the variance."""
    value = sqrt(max(variance, 0.0))
    return value, error / (2 * value) if variance > 3 * error else sqrt(error)


def electrons(variance: float, error: float, gain: tuple[float, float]) -> tuple[float, float]:
    value, of_value = root(variance / gain[0] ** 2, error / gain[0] ** 2)
    return value, hypot(of_value, value * gain[1] / gain[0])


def test_every_figure_is_counted_once_more_from_the_frames() -> None:
    """Value and error of each, by formulas written here; the frames are told apart by their light and time."""
    bench, frames = light_bench(SENSOR, SHAPE, 4, exact=True), []

    def expose(light_e: float, exposure_s: float) -> Any:
        frames.append((light_e, exposure_s, bench(light_e, exposure_s)))
        return frames[-1][2]

    found = measure_camera(expose, PLAN, SENSOR)
    top_e = SENSOR.top_e
    taken = iter(frames)

    def stack(count: int, light_e: float) -> np.ndarray:
        rows = [next(taken) for _ in range(count)]
        assert {(light, time) for light, time, _ in rows} == {(light_e, 0.02)}
        return np.array([dn for *_, dn in rows], dtype=float)

    dark, bright, full = stack(5, 0.0), stack(5, 0.5 * top_e), stack(2, 2 * top_e)
    pairs = np.array([stack(2, light) for light in PLAN.light_e])
    series = {time: [next(taken)[2].astype(float) for _ in range(2)] for time in PLAN.dark_times_s}
    assert next(taken, None) is None

    # Means, temporal and spatial variances
    dark_dn, bright_dn = dark.mean(axis=0), bright.mean(axis=0)
    dark_dn2, bright_dn2 = (x.var(axis=0, ddof=1).mean() for x in (dark, bright))
    spatial = {name: x.mean(axis=0).var() - v / 5 for name, x, v in (("d", dark, dark_dn2), ("b", bright, bright_dn2))}
    means = pairs.mean(axis=(1, 2, 3))
    variances = (pairs[:, 0] - pairs[:, 1]).var(axis=(1, 2)) / 2
    saturation_e = PLAN.light_e[np.argmax(variances)]
    assert found.saturation_e == saturation_e
    used = PLAN.light_e <= 0.7 * saturation_e
    signal, excess = means[used] - dark_dn.mean(), variances[used] - dark_dn2
    power, pixels = (signal**2).sum(), dark_dn.size
    of_dark = 2 * (signal.sum() * dark_dn2) ** 2 / (pixels * 4)
    gain_error = sqrt(2 * ((signal * variances[used]) ** 2).sum() / pixels + of_dark) / power
    gain = (signal @ excess / power, gain_error)
    middle = (PLAN.light_e >= 0.05 * saturation_e) & (PLAN.light_e <= 0.95 * saturation_e)
    x, y = PLAN.light_e[middle], means[middle] - dark_dn.mean()
    start, slope = np.linalg.lstsq(np.column_stack([1 / x, np.ones(x.size)]), y / x, rcond=None)[0]
    linear = y / (start + slope * x) - 1

    # Dark current of each pixel by a line over time, and the pixels beyond six robust deviations
    times = np.array(PLAN.dark_times_s)
    lines = np.polyfit(times, np.array([np.mean(series[time], axis=0).ravel() for time in times]), 1)[0]
    median = np.median(lines)
    hot = lines > median + 6 * 1.4826 * np.median(np.abs(lines - median))
    rest, above = lines[~hot] / gain[0], lines[hot] / gain[0]
    assert 5 < hot.sum() < 100
    relative = gain[1] / gain[0]
    current = rest.mean(), hypot(rest.std() / sqrt(rest.size), rest.mean() * relative)
    share = hot.mean(), sqrt(hot.mean() * (1 - hot.mean()) / hot.size)
    over = above.mean() - current[0]
    over_error = hypot(above.std() / sqrt(above.size), over * relative)

    # The figures
    def of_columns(*images: np.ndarray) -> float:
        squares = sum(sign * ((x - x.mean()) ** 2).mean(axis=0) for sign, x in zip((1, -1), images, strict=False))
        return float(np.std(squares, ddof=1) / sqrt(SHAPE[1]))

    lit = bright_dn.mean() - dark_dn.mean()
    gains_dn2, gains_error = by_columns(bright_dn - dark_dn)
    columns = root(gains_dn2 / lit**2, gains_error / lit**2)
    dark_e = 0.02 * (current[0] + share[0] * over)
    full_e = (full.mean() - dark_dn.mean()) / gain[0] + dark_e
    sigma_e = hypot(sqrt(dark_dn2 + spatial["d"]) / gain[0], columns[0] * full_e)
    a = (PIXEL.full_well_e - top_e) / sigma_e
    full_e += sigma_e * (exp(-(a**2) / 2) / sqrt(2 * pi) - a * erfc(a / sqrt(2)) / 2)
    threshold_e = sqrt(dark_dn2) / gain[0] + 0.5
    wanted = {
        "gain": gain,
        "dark noise": electrons(dark_dn2 - 1 / 12, dark_dn2 * sqrt(2 / (pixels * 4)), gain),
        "DSNU": electrons(spatial["d"], of_columns(dark_dn), gain),
        "PRNU": root((spatial["b"] - spatial["d"]) / lit**2, of_columns(bright_dn, dark_dn) / lit**2),
        "column offsets": electrons(*by_columns(dark_dn), gain),
        "column gains": columns,
        "dark current": current,
        "hot pixels": share,
        "their dark current": (over, over_error),
        "full well": (full_e, full_e * relative),
        "saturation": (saturation_e, 0.0),
        "threshold": (threshold_e, 0.0),
        "dynamic range": (20 * log10(saturation_e / threshold_e), 0.0),
        "greatest SNR": (10 * log10(saturation_e), 0.0),
        "linearity error": (np.abs(linear).mean(), 0.0),
    }
    told = {x.name: (x.measured, x.error) for x in found.figures}
    assert told == {name: pytest.approx(pair, rel=1e-9) for name, pair in wanted.items()}
    assert found.linearity_share[middle] == pytest.approx(linear, abs=1e-12)
    assert np.isnan(found.linearity_share[~middle]).all()
    assert found.dark_mean_dn == pytest.approx(dark_dn.mean())
    assert (found.dark_variance_dn2, found.gain_dn_per_e) == pytest.approx((dark_dn2, gain[0]))
    assert found.snr == pytest.approx((means - dark_dn.mean()) / np.sqrt(variances))
    # the drawing has the same points
    axes = found.plot()
    points, shot, dashed = axes.lines[1], axes.lines[0], axes.lines[2]
    signal_e, noise_e = (means - dark_dn.mean()) / gain[0], np.sqrt(variances) / gain[0]
    assert points.get_xdata() == pytest.approx(signal_e)
    assert points.get_ydata() == pytest.approx(noise_e)
    assert shot.get_ydata() == pytest.approx(np.sqrt(shot.get_xdata()))
    assert (shot.get_xdata()[0], shot.get_xdata()[-1]) == pytest.approx((signal_e.min(), signal_e.max()))
    assert dashed.get_ydata() == pytest.approx(np.full(2, sqrt(dark_dn2) / gain[0]))


def test_every_configured_figure_is_its_formula_by_hand() -> None:
    """In 20 ms 80 e- of dark current, and 800 in one pixel of twenty: 120 in the mean."""
    at = configured(SENSOR, 0.02)
    noise_e = sqrt(12.0**2 + 120.0)
    threshold_e = sqrt(noise_e**2 + SENSOR.gain_e_per_dn**2 / 12) + 0.5
    assert at == {
        name: pytest.approx(value, rel=1e-12)
        for name, value in {
            "gain": (2**14 - 1 - 400) / 9000.0,
            "dark noise": noise_e,
            "DSNU": sqrt(20.0**2 + 25.0**2 + 0.05 * 0.95 * 800.0**2 + (0.02 * 120.0) ** 2),
            "PRNU": hypot(0.03, 0.02),
            "column offsets": hypot(25.0, 0.02 * 120.0),
            "column gains": 0.02,
            "dark current": 4000.0,
            "hot pixels": 0.05,
            "their dark current": 40_000.0,
            "full well": 9000.0,
            "saturation": 9000.0,
            "threshold": threshold_e,
            "dynamic range": 20 * log10(9000.0 / threshold_e),
            "greatest SNR": 10 * log10(9000.0),
            "linearity error": 0.0,
        }.items()
    }
    for none in ({"hot_pixel_share": 0.0}, {"hot_pixel_dark_current_e_per_s": 0.0}):
        other = configured(replace(SENSOR, pixel=replace(PIXEL, **none)), 0.02)
        assert (other["hot pixels"], other["their dark current"]) == (0.0, 0.0)


def test_a_plan_has_even_levels_past_the_well_dim_ones_and_times_that_fill_a_third() -> None:
    plan = plan_for(SENSOR, 0.03)
    even = 1.1 * 9000.0 * np.arange(1, 56) / 55
    assert plan.light_e[7:] == pytest.approx(even)
    assert plan.light_e[:8] == pytest.approx(np.geomspace(0.9, even[0], 8))
    assert (plan.exposure_s, plan.frames) == (0.03, 32)
    assert plan.dark_times_s == pytest.approx(np.arange(6) / 5 * 0.3 * 9000.0 / 44_000.0)
    still = replace(SENSOR, pixel=replace(PIXEL, dark_current_e_per_s=0.0, hot_pixel_dark_current_e_per_s=0.0))
    assert plan_for(still).dark_times_s[-1] == 1.0
    slow = replace(SENSOR, pixel=replace(PIXEL, dark_current_e_per_s=1e-4, hot_pixel_dark_current_e_per_s=0.0))
    assert plan_for(slow).dark_times_s[-1] == 1e6
    assert plan_for(SENSOR).exposure_s == 0.01


def test_what_a_reader_has_to_know_of_a_characterisation_is_said() -> None:
    notes = characterise(SENSOR, (16, 16), seed=2**31, exact=True).notes
    assert notes[0] == "light is set in electrons: quantum efficiency is 1"
    assert notes[-1] == "frames were drawn by numpy"
    assert len(notes) == 3
    refusal(characterise, SENSOR, (15, 16), match="height: 15")
    refusal(characterise, SENSOR, (16, 15), match="width: 15")
    refusal(characterise, SENSOR, (16, 16), 2**31 + 1, match="seed: ")
    refusal(characterise, SENSOR, (16, 16), exposure_s=1.1e6, match="exposure_s: ")
    assert "sensor: 2 readings of a pixel" in refusal(characterise, preset("dual_gain"))


def test_a_stack_that_rounding_hides_is_told_from_one_that_it_does_not() -> None:
    """Under 0.24 DN^2 the dark noise is less than 0.4 DN, which is 0.4 / K electrons."""
    quiet = SensorConfig(PixelConfig(2.2, 0.9, 15_000.0, 1.5, 1.0, 0.01), LensConfig(2.8), bits=10)
    found = characterise(quiet, (16, 16), exact=True)
    assert found.dark_variance_dn2 < 0.24
    (note,) = (x for x in found.notes if "rounding" in x)
    assert note == (
        f"the dark's variance, {found.dark_variance_dn2:.3f} DN^2, is under 0.24: rounding hides the "
        f"dark noise, which is less than {0.4 / found.gain_dn_per_e:.3g} e-, and moves DSNU"
    )


def test_the_gains_error_counts_the_darks_once_and_its_line_needs_four_of_them() -> None:
    light = np.arange(100.0, 1000.0, 100.0)
    for gain in (0.02, 0.03):
        series = Transfer(light, 20 + 0.5 * light, 4.0 + gain * 0.5 * light)
        dark = emva.Stack(np.full((8, 10), 20.0), 4.0, 6)
        used = light <= 700.0
        signal, power = 0.5 * light[used], np.sum((0.5 * light[used]) ** 2)
        of_points = np.sum((signal * series.variance_dn2[used]) ** 2) * 2 / 80
        error = sqrt(of_points + (signal.sum() * 4.0) ** 2 * 2 / (80 * 5)) / power
        told = emva.gain(series, dark, 1000.0) if gain > 4 * error else None
        assert told == (None if told is None else (pytest.approx(gain), pytest.approx(error)))
        assert told is not None or "shows no shot noise" in refusal(emva.gain, series, dark, 1000.0)


def frame(mean: float, seed: int, spread: float = 3.0, shape: tuple[int, int] = (64, 64)) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.rint(mean + spread * rng.standard_normal(shape)).astype(np.uint16)


@pytest.mark.parametrize(("kind", "edge"), [("flat", 1023), ("dark", 0)])
@pytest.mark.parametrize("clipped", [4, 5])
def test_a_frame_may_clip_a_thousandth_of_its_pixels(kind: str, edge: int, clipped: int) -> None:
    """Of 4096 pixels four are under a thousandth, five over it."""
    flats = [frame(500.0 if number < 2 else 250.0, number, 12.0 if number < 2 else 9.0) for number in range(4)]
    darks = [frame(50.0, number, 2.0) for number in range(4, 6)]
    (flats if kind == "flat" else darks)[1].ravel()[:clipped] = edge
    if clipped == 4:
        assert figures_of_frames(flats, darks, ("W",), 1023.0).frames == (2, 2, 2)
    else:
        said = refusal(figures_of_frames, flats, darks, ("W",), 1023.0)
        assert f"{kind} frame 2: 0.12% of its pixels read {edge} DN, where they are clipped; allowed: 0.1%" in said


def test_noise_of_the_blocks_is_no_unevenness() -> None:
    """Four standard errors of a block's mean to each side are taken off what the blocks differ by."""
    flats, darks = [frame(500.0, n, 25.0) for n in range(2)], [frame(50.0, n, 2.0) for n in range(2, 4)]
    slope = np.repeat([-7.0, -3.0, 3.0, 7.0], 16)
    flats = [np.rint(x + slope).astype(np.uint16) for x in flats]
    note = figures_of_frames(flats, darks, ("W",), 1023.0).notes[0]
    mean = np.mean(flats, axis=0)
    blocks = mean.reshape(4, 16, 4, 16).swapaxes(1, 2).reshape(16, -1)
    beyond = np.ptp(blocks.mean(axis=1)) - 8 * np.mean(blocks.std(axis=1) / 16)
    uneven = beyond / (mean.mean() - np.mean(darks))
    assert 0.005 < uneven < 0.03
    assert note == f"the flat frames are even within {uneven:.1%} from the darkest part to the brightest"
