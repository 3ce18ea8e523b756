"""Figures of signal and noise on even fields: speeds, dynamic range, signal-to-noise ratios, light for a ratio.

The signal is the raw signal of a single channel. Some standards want the developed picture's luminance instead; their
`Merit.conditions` state this choice.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import isfinite, log10, nan, pi, sqrt

import numpy as np

from rodcone.types import Floats
from scenes.oecf import BRIGHTEST, grey_scale
from sensor.config import SensorConfig
from sensor.pixel import bent_e
from sensor.readings.resolve import several
from studies.metrics.truth import GREY, named_light
from studies.photograph.snr import electrons_at_snr, snr
from studies.score.even_field import EvenField, even_field
from studies.score.figure import Definition, Merit
from studies.study.gain import ISO_SATURATION_LUX_S

ISO_NOISE_LUX_S = 10.0  # the noise-based speed is this over the exposure that has the required signal-to-noise ratio
REFERENCE_SHARE = 0.13  # share of the saturation luminance at which ISO 15739 measures the signal-to-noise ratio
RAMP_TOP = 0.65  # light of the grey scale's brightest patch, as a share of saturation
# Light of the 12 patches of ISO 14524's grey scale, whose contrast is 100, over the saturation light.
RAMP: Floats = RAMP_TOP / BRIGHTEST * np.array(grey_scale(12, 100.0))
# This percentile of an overexposed field's samples is the saturation value. The mean would be lower, because noise
# leaves half of the samples below the converter's top value.
SATURATED_PERCENT = 95.0
LADDER = (0.94, 0.97, 1.0, 1.03, 1.06)  # factors on the computed light; a figure is measured at each
SNR1S = ("3200 K", 1 / 60, 1.4)  # colour temperature, exposure time and f-number of SNR1s


Named = tuple[Merit, Callable[[float], float]]  # a figure without its value, and a function from luminance to value


def noise_figures(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Iterator[Definition]:
    """Define the figures of one channel's samples under a light and an exposure time."""
    field = even_field(sensor, named_light(light, sensor.window_nm), exposure_s, channel)
    words = field_words(field, light)
    at_saturation = field.headroom_e / field.electrons_per_cd_m2
    yield _conversion(field, light)

    def noise_speed(ratio: int, quality: str) -> Named:
        name = f"iso_12232.noise_speed_{ratio}"
        title = f"noise-based speed, S/N {ratio}, {quality}"
        stated = Merit(name, title, "ISO", "ISO 12232:2019, 6.3: 10 / H", words, nan)
        return stated, lambda luminance: ISO_NOISE_LUX_S / (luminance * field.lux_s_per_cd_m2)

    snr10 = Merit(
        "snr10.lux",
        "SNR10: light for a ratio of 10",
        "lux",
        "maker's figure: illuminance of an 18 % grey card",
        f"{words}, f/{sensor.lens.f_number:g}",
        nan,
    )
    yield _light_for_ratio(field, 40.0, [noise_speed(40, "first excellent")])
    yield _light_for_ratio(field, 10.0, [noise_speed(10, "first acceptable"), (snr10, lambda cd_m2: cd_m2 * pi / GREY)])
    yield _snr1s(sensor, channel)
    yield from _iso_15739(field, words, at_saturation)


def _conversion(field: EvenField, light: str) -> Definition:
    """Define slope and gamma of the opto-electronic conversion, and the speed that follows from the slope."""
    e_per_lux_s = field.electrons_per_cd_m2 / field.lux_s_per_cd_m2
    scale = (
        f"{field.channel}, raw, a grey scale of {len(RAMP)} patches from {100 * RAMP[-1]:.2g} to {100 * RAMP[0]:.0f} % "
        f"of saturation, {light}, a dark frame subtracted"
    )
    expected = response_figures(field, _expected_e(field, RAMP * field.headroom_e))
    slope = Merit(
        "oecf.slope", "slope of the opto-electronic conversion", "e-/(lux s)", "ISO 14524", scale, expected[0]
    )
    gamma = Merit(
        "oecf.gamma",
        "gamma of the opto-electronic conversion",
        "1",
        "ISO 14524: slope of log signal over log exposure",
        f"{scale}; 1 of a straight response",
        expected[1],
    )
    speed = Merit(
        "iso_12232.saturation_speed",
        "saturation-based speed",
        "ISO",
        "ISO 12232:2019, 6.2: 78 / H",
        f"{field_words(field, light)}; the mean reads the converter's top, no half stop taken off",
        _saturation_speed(field, e_per_lux_s),
    )

    def measure_response(rng: np.random.Generator) -> tuple[float, float, float]:
        found, bend = response_figures(field, _measured_e(field, rng))
        return found, bend, _saturation_speed(field, found * e_per_lux_s / expected[0])

    return Definition((slope, gamma, speed), measure_response)


def field_words(field: EvenField, light: str) -> str:
    """Return the conditions under which an even field's figures are measured, in words."""
    return (
        f"{field.channel}, raw samples of one pixel, {light}, {field.exposure_s * 1e3:.4g} ms, fixed patterns included"
    )


def _iso_15739(field: EvenField, words: str, at_saturation: float) -> Iterator[Definition]:
    reference = REFERENCE_SHARE * at_saturation
    reference_e = np.array([reference * field.electrons_per_cd_m2])
    ratio = float(snr(reference_e, field.sensor, field.exposure_s, field.channel)[0])
    grey = Merit(
        "iso_15739.snr_18",
        "total signal-to-noise ratio of 18 % grey",
        "dB",
        "ISO 15739:2023, 6.3: at 13 % of the saturation luminance",
        words,
        20 * log10(ratio),
    )
    span = Merit(
        "iso_15739.dynamic_range",
        "dynamic range",
        "dB",
        "ISO 15739:2023, 6.4: saturation over the dark's temporal noise",
        f"{field.channel}, raw, {field.exposure_s * 1e3:.4g} ms, noise of frames without light",
        20 * log10(field.headroom_e / field.temporal_dark_e),
    )
    yield Definition((grey,), lambda rng: [20 * log10(ratio_at(field, reference, rng))])
    yield Definition((span,), lambda rng: [20 * log10(_measured_range(field, rng))])


def _saturation_speed(field: EvenField, e_per_lux_s: float) -> float:
    return ISO_SATURATION_LUX_S * e_per_lux_s / field.headroom_e


def response_figures(field: EvenField, read_e: Floats) -> tuple[float, float]:
    """Return the slope of the grey scale's readings over light [e-/(lux s)], and the slope between their logarithms."""
    lux_s = RAMP * field.headroom_e / field.electrons_per_cd_m2 * field.lux_s_per_cd_m2
    slope = np.polyfit(lux_s, read_e, 1)[0]
    gamma = np.polyfit(np.log(lux_s), np.log(np.maximum(read_e, 1e-9)), 1)[0]
    return float(slope), float(gamma)


def _expected_e(field: EvenField, collected_e: Floats) -> Floats:
    """Return the noise-free readings of photo-electrons, less that of the dark; they differ for a bent response."""
    if several(field.readings):
        return collected_e
    (reading,) = field.readings
    pixel = reading.sensor.pixel
    share = reading.share
    dark_e = pixel.dark_current_e_per_s * reading.exposure_s
    read_e: Floats = (bent_e(collected_e * share + dark_e, pixel) - bent_e(dark_e, pixel)) / share
    return read_e


def _measured_e(field: EvenField, rng: np.random.Generator) -> Floats:
    """Measure a chip's mean readings of the grey scale's patches, less its mean reading in the dark."""
    chip = field.draw_chip(rng)
    light = (0.0, *(RAMP * field.headroom_e / field.electrons_per_cd_m2).tolist())
    means_e: Floats = np.array([field.samples_e(field.shoot(x, chip, rng)).mean() for x in light])
    return np.asarray(means_e[1:] - means_e[0])


def ratio_at(field: EvenField, luminance: float, rng: np.random.Generator) -> float:
    """Measure the ratio of mean to standard deviation of one frame's samples, on a fresh chip."""
    samples = field.samples_e(field.shoot(luminance, field.draw_chip(rng), rng))
    return float(samples.mean() / samples.std(ddof=1))


def _measured_range(field: EvenField, rng: np.random.Generator) -> float:
    """Measure the dynamic range: saturation over the dark noise, both in electrons.

    The dark noise is the standard deviation of the difference of two dark frames over the root of 2.
    """
    chip = field.draw_chip(rng)
    dark = [field.samples_e(field.shoot(0.0, chip, rng)) for _ in range(2)]
    bright = field.samples_e(field.shoot(1.3 * field.headroom_e / field.electrons_per_cd_m2, chip, rng))
    top_e = np.percentile(bright, SATURATED_PERCENT)
    return float((top_e - np.mean(dark)) / (np.std(dark[0] - dark[1], ddof=1) / 2**0.5))


def _light_for_ratio(field: EvenField, ratio: float, figures: Sequence[Named]) -> Definition:
    """Define figures of the light at which a pixel reaches a ratio, each as a function of the luminance."""
    luminance = electrons_at_snr(ratio, field.sensor, field.exposure_s, field.channel) / field.electrons_per_cd_m2
    reached = isfinite(luminance)
    reason = "" if reached else f"no light reaches a ratio of {ratio:g}: PRNU is in the way, or the well is full before"
    merits = [
        replace(merit, computed=of_light(luminance) if reached else nan, missing=reason) for merit, of_light in figures
    ]

    def measure(rng: np.random.Generator) -> list[float]:
        found = light_for(lambda x: ratio_at(field, x, rng), ratio, luminance)
        return [of_light(found) for _, of_light in figures]

    return Definition(tuple(merits), measure)


def light_for(measured_at: Callable[[float], float], goal: float, about_cd_m2: float) -> float:
    """Return the light [cd/m^2] at which a figure is `goal`, from measurements at the steps of `LADDER`.

    A line through the figure's logarithm over that of the light is solved for the goal. The ladder around `about_cd_m2`
    is so narrow that the figure is straight on it, even where a merge passes from one reading to another. The result
    lies within the ladder.
    """
    light = np.log(np.array(LADDER))
    figures = np.log([measured_at(about_cd_m2 * x) for x in LADDER])
    slope, at_middle = np.polyfit(light, figures - np.log(goal), 1)
    if slope <= 0:
        return about_cd_m2 * LADDER[0 if at_middle > 0 else -1]
    return about_cd_m2 * float(np.exp(np.clip(-at_middle / slope, light[0], light[-1])))


def _snr1s(sensor: SensorConfig, channel: str) -> Definition:
    """Define Sony's SNR1s: the illuminance in which the signal of 18 % grey equals its temporal noise."""
    lamp, exposure_s, f_number = SNR1S
    seen = replace(sensor, lens=replace(sensor.lens, f_number=f_number, magnification=0.0))
    field = even_field(seen, named_light(lamp, sensor.window_nm), exposure_s, channel)

    def measure(rng: np.random.Generator) -> list[float]:
        chip = field.draw_chip(rng)
        dark = [field.samples_e(field.shoot(0.0, chip, rng)) for _ in range(2)]
        lit_cd_m2 = 0.3 * field.headroom_e / field.electrons_per_cd_m2
        per_cd_m2 = (field.samples_e(field.shoot(lit_cd_m2, chip, rng)).mean() - np.mean(dark)) / lit_cd_m2
        return [_equal_to_noise_e(float(np.std(dark[0] - dark[1], ddof=1)) / 2**0.5) * pi / GREY / float(per_cd_m2)]

    merit = Merit(
        "snr1s.lux",
        "SNR1s: light for a temporal ratio of 1",
        "lux",
        "Sony's SNR1s: signal over the root of signal and squared dark noise",
        f"{channel}, raw, {lamp}, 18 % grey, f/{f_number:g}, 1/60 s, no matrix",
        _equal_to_noise_e(field.temporal_dark_e) * pi / GREY / field.electrons_per_cd_m2,
    )
    return Definition((merit,), measure)


def _equal_to_noise_e(dark_e: float) -> float:
    """Return the electrons n that equal their temporal noise: n / sqrt(n + d^2) = 1 at (1 + sqrt(1 + 4 d^2)) / 2."""
    return (1 + sqrt(1 + 4 * dark_e**2)) / 2
