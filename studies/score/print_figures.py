"""Figures like those that camera testers publish: dynamic range in stops, colours in bits, low-light speed, PDR.

They follow the published definitions, but per pixel. The testers scale them to a print of 8 megapixels, which isn't
possible here, because a sensor file states no number of pixels. None of them is a tester's own score.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from math import isfinite, log2, log10, nan, pi

import numpy as np

from rodcone.types import Floats
from sensor.config import MOST_GAIN
from sensor.photodiodes import with_gain
from sensor.raw import RawImage
from sensor.readings.best_estimate import merged_variance, seams
from sensor.readings.resolve import several
from studies.photograph.snr import electrons_at_snr, snr
from studies.score.even_field import EvenField
from studies.score.figure import Definition, Merit, not_measured
from studies.score.noise_figures import SATURATED_PERCENT, light_for, ratio_at
from studies.study.gain import ISO_SATURATION_LUX_S

GREY_SHARE = 0.18  # share of saturation at which the low-light speed's ratio is measured
LEAST_DB, LEAST_STOPS, LEAST_BITS = 30.0, 9.0, 18.0  # what the low-light speed requires
WHITE_SHARE = 0.9  # share of saturation up to which colours are counted; above it noise is clipped
NODES = (10, 4)  # nodes of the integral up to the first seam between merged readings, and in each part beyond a seam
LADDER = (0.9, 0.95, 1.0, 1.05, 1.1)  # factors on the computed gain; the margin is measured at each
CONFUSION_UM, PDR_RATIO = 22.0, 20.0  # circle on a sensor of 36 x 24 mm, and the SNR in it


def print_figures(field: EvenField, words: str) -> Iterator[Definition]:
    """Define the figures of an even field's channel, and those of the three channels that distinguish colours."""
    like = "like a test house's"
    stops = Merit(
        "print.landscape",
        "dynamic range in stops, down to a ratio of 1",
        "EV",
        f"{like} landscape score",
        f"{words}; per pixel, no print size",
        _stops(field, 1.0),
    )
    yield _of_range(field, 1.0, stops)
    colours = Merit(
        "print.portrait",
        "colours that noise lets tell apart",
        "bits",
        f"{like} portrait score",
        f"{', '.join(_colours(field))}, raw, neutral scale up to {100 * WHITE_SHARE:.0f} % of saturation; per pixel, "
        "no print size",
        _bits(field),
    )
    if len(_colours(field)) < 3:
        yield Definition((replace(colours, computed=nan, missing="the camera tells no colours"),), not_measured)
    else:
        yield Definition((colours,), lambda rng: [_measured_bits(field, rng)])
    yield _low_light(field, like, words)
    pixels = pi / 4 * (CONFUSION_UM / field.sensor.pixel.pitch_um) ** 2
    pdr = Merit(
        "print.pdr",
        "photographic dynamic range",
        "EV",
        "like PDR: down to a ratio of 20 in the circle of confusion",
        f"{words}; {CONFUSION_UM:g} um, {pixels:.1f} pixels, as if they filled 36 x 24 mm",
        _stops(field, PDR_RATIO / pixels**0.5),
    )
    yield _of_range(field, PDR_RATIO / pixels**0.5, pdr)


def _of_range(field: EvenField, ratio: float, merit: Merit) -> Definition:
    if not isfinite(merit.computed):
        return Definition(
            (replace(merit, computed=nan, missing=f"no light reaches a ratio of {ratio:.3g}"),), not_measured
        )
    return Definition((merit,), lambda rng: [_measured_stops(field, ratio, rng)])


def _low_light(field: EvenField, like: str, words: str) -> Definition:
    """Define the highest speed, set by the gain, at which SNR, dynamic range and bits of colour are all sufficient."""
    colour = f", {LEAST_BITS:g} bits of colour" if len(_colours(field)) == 3 else ""
    merit = Merit(
        "print.sports",
        "highest speed with a ratio of 30 dB at 18 %",
        "ISO",
        f"{like} sports score",
        f"{words}; saturation-based speed by gain, with {LEAST_STOPS:g} EV of range{colour}; per pixel, no print size",
        nan,
    )
    base = ISO_SATURATION_LUX_S * field.electrons_per_cd_m2 / field.lux_s_per_cd_m2 / field.sensor.top_e
    if field.sensor.chip.readings or field.sensor.chip.channels:
        missing = "readings have gains of their own, and no common one"
    elif min(_margins(_at(field, 1.0))) < 0:
        names = ("ratio", "range", "colours")
        least = names[int(np.argmin(_margins(_at(field, 1.0))))]
        missing = f"at gain 1 its {least} is less already"
    else:
        missing = ""
    if missing:
        return Definition((replace(merit, missing=missing),), not_measured)
    gain = _most_gain(field)
    binding = int(np.argmin(_margins(_at(field, gain))))

    def measure(rng: np.random.Generator) -> list[float]:
        margins = [_measured_margin(_at(field, gain * x), binding, rng) for x in LADDER]
        slope, middle = np.polyfit(np.log(LADDER), margins, 1)
        found = np.clip(-middle / slope, np.log(LADDER[0]), np.log(LADDER[-1]))
        return [base * gain * float(np.exp(found))]

    return Definition((replace(merit, computed=base * gain),), measure)


def _most_gain(field: EvenField) -> float:
    """Return the largest gain at which no margin of `_margins` is negative, found by bisection."""
    low, high = 0.0, log2(MOST_GAIN / LADDER[-1])
    for _ in range(24):
        middle = (low + high) / 2
        low, high = (middle, high) if min(_margins(_at(field, 2**middle))) >= 0 else (low, middle)
    return float(2**low)


def _at(field: EvenField, gain: float) -> EvenField:
    return replace(field, sensor=with_gain(field.sensor, max(gain, 1.0)))


def _margins(field: EvenField) -> list[float]:
    """Return by how many dB, stops and (for three colours) bits a camera exceeds what the low-light speed requires."""
    grey_e = np.array([GREY_SHARE * field.headroom_e])
    ratio = float(snr(grey_e, field.sensor, field.exposure_s, field.channel)[0])
    margins = [20 * log10(ratio) - LEAST_DB, _stops(field, 1.0) - LEAST_STOPS]
    return [*margins, _bits(field) - LEAST_BITS] if len(_colours(field)) == 3 else margins


def _measured_margin(field: EvenField, which: int, rng: np.random.Generator) -> float:
    if which == 0:
        return 20 * log10(ratio_at(field, GREY_SHARE * field.headroom_e / field.electrons_per_cd_m2, rng)) - LEAST_DB
    return _measured_stops(field, 1.0, rng) - LEAST_STOPS if which == 1 else _measured_bits(field, rng) - LEAST_BITS


def _stops(field: EvenField, ratio: float) -> float:
    electrons = electrons_at_snr(ratio, field.sensor, field.exposure_s, field.channel)
    return log2(field.headroom_e / electrons) if isfinite(electrons) else float("-inf")


def _measured_stops(field: EvenField, ratio: float, rng: np.random.Generator) -> float:
    """Measure the range in stops: the reading of an overexposed field over that of a field with the given SNR."""
    about = electrons_at_snr(ratio, field.sensor, field.exposure_s, field.channel) / field.electrons_per_cd_m2
    found = light_for(lambda x: ratio_at(field, x, rng), ratio, about)
    bright = field.shoot(1.3 * field.headroom_e / field.electrons_per_cd_m2, field.draw_chip(rng), rng)
    top_e = float(np.percentile(field.samples_e(bright), SATURATED_PERCENT))
    return log2(top_e / (found * field.electrons_per_cd_m2))


def _colours(field: EvenField) -> Sequence[str]:
    """Return the three channels that distinguish colours; none if there are fewer, or one gets no light."""
    return field.sensor.channels[:3] if len(field.means_e) >= 3 and np.all(field.means_e[:3] > 0) else ()


def _white_cd_m2(field: EvenField) -> float:
    """Return the luminance [cd/m^2] at which the first of the three channels to fill is full to `WHITE_SHARE`."""
    channels = (replace(field, channel=name) for name in _colours(field))
    return min(WHITE_SHARE * one.headroom_e / one.electrons_per_cd_m2 for one in channels)


def _bits(field: EvenField) -> float:
    """Return the bits of colour: log2 of the product of three integrals, each of 1 / noise over a channel's signal.

    A matrix that mixes the channels cancels in that product. With the signal s = t u^2, where t is the signal of white,
    each integral is that of 2 t u / noise over u from 0 to 1.
    """
    return _bits_of(field, _noise_e)


def _noise_e(field: EvenField, luminance_cd_m2: float) -> float:
    electrons = np.array([luminance_cd_m2 * field.electrons_per_cd_m2])
    readings = field.readings
    variance = merged_variance(electrons, readings) if several(readings) else readings[0].law.variance(electrons)
    return float(np.sqrt(variance[0]))


def _measured_bits(field: EvenField, rng: np.random.Generator) -> float:
    frames: dict[float, RawImage] = {}

    def noise_e(one: EvenField, luminance_cd_m2: float) -> float:
        if luminance_cd_m2 not in frames:
            frames[luminance_cd_m2] = field.shoot(luminance_cd_m2, field.draw_chip(rng), rng)
        return float(one.samples_e(frames[luminance_cd_m2]).std(ddof=1))

    return _bits_of(field, noise_e)


def _steps(field: EvenField, top_e: float) -> Floats:
    """Return values of u from 0 to 1 between which noise doesn't jump; it jumps at the seams of merged readings."""
    handovers_e = seams(field.readings).handover_e[:-1] if several(field.readings) else np.empty(0)
    return np.unique([0.0, *np.sqrt(np.clip(handovers_e / top_e, 0.0, 1.0)), 1.0])


def _bits_of(field: EvenField, noise_e: Callable[[EvenField, float], float]) -> float:
    if len(_colours(field)) < 3:
        return nan
    white_cd_m2 = _white_cd_m2(field)
    bits = 0.0
    for name in _colours(field):
        one = replace(field, channel=name)
        top_e = white_cd_m2 * one.electrons_per_cd_m2
        total = 0.0
        for number, (start, end) in enumerate(pairwise(_steps(one, top_e).tolist())):
            nodes, weights = np.polynomial.legendre.leggauss(NODES[min(number, 1)])
            places = (start + end) / 2 + (end - start) / 2 * nodes
            noise: Floats = np.array([noise_e(one, u**2 * white_cd_m2) for u in places.tolist()])
            total += (end - start) / 2 * float(weights @ (2 * top_e * places / noise))
        bits += log2(total)
    return bits
