"""Speeds of ISO 12232 for a camera with its tone curve: standard output sensitivity and recommended exposure index.

Both are measured on one channel's samples, encoded by the sRGB curve with the top of the range as white. A camera with
another tone curve has another standard output sensitivity.
"""

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from rodcone.colour_spaces import decode_srgb, encode_srgb
from sensor.config import METERED_SHARE
from studies.metrics.truth import GREY
from studies.photograph.snr import snr
from studies.score.even_field import EvenField
from studies.score.figure import Definition, Merit
from studies.score.noise_figures import ISO_NOISE_LUX_S, light_for

OUTPUT = 118 / 255  # 8-bit sRGB value that defines standard output sensitivity
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(21)


def output_speeds(field: EvenField, words: str) -> Iterator[Definition]:
    """Define both speeds of an even field's channel."""
    saturation_cd_m2 = field.headroom_e / field.electrons_per_cd_m2
    at_output = float(brentq(lambda x: mean_output(field, x) - OUTPUT, 0.02 * saturation_cd_m2, 0.6 * saturation_cd_m2))

    def speed(luminance: float) -> float:
        return ISO_NOISE_LUX_S / (luminance * field.lux_s_per_cd_m2)

    def measure_output(rng: np.random.Generator) -> list[float]:
        # In logarithms, the decoded output over light is a straight line. The encoded one isn't; its bend would lower
        # the speed by a share of 5e-5.
        found = light_for(lambda x: decoded(_measured_output(field, x, rng)), decoded(OUTPUT), at_output)
        return [speed(found)]

    output = Merit(
        "iso_12232.standard_output_sensitivity",
        "standard output sensitivity (SOS)",
        "ISO",
        "ISO 12232:2019, 6.4: 10 / H at an sRGB value of 118",
        f"{words}; sRGB curve, the converter's top is white, no tone curve, means before rounding to 8 bits",
        speed(at_output),
    )
    yield Definition((output,), measure_output)

    white_e = METERED_SHARE * field.sensor.metered_well_e(field.channel)
    white_cd_m2 = white_e / field.electrons_per_cd_m2

    def measure_index(rng: np.random.Generator) -> list[float]:
        read_e = field.samples_e(field.shoot(white_cd_m2, field.draw_chip(rng), rng)).mean()
        return [speed(GREY * white_cd_m2) * float(read_e / white_e)]

    index = Merit(
        "iso_12232.recommended_exposure_index",
        "recommended exposure index (REI)",
        "ISO",
        "ISO 12232:2019, 6.5: 10 / H of the exposure that the maker recommends",
        f"{words}; recommended is rodcone's automatic exposure: a perfect white reads "
        f"{100 * METERED_SHARE:.0f} % of the well, H is that of 18 % grey",
        speed(GREY * white_cd_m2),
    )
    yield Definition((index,), measure_index)


def mean_output(field: EvenField, luminance_cd_m2: float) -> float:
    """Return the mean sRGB value of samples of a luminance; noise lowers it, because the sRGB curve is concave."""
    mean_e = luminance_cd_m2 * field.electrons_per_cd_m2
    noise_e = mean_e / float(snr(np.array([mean_e]), field.sensor, field.exposure_s, field.channel)[0])
    shown = encode_srgb((mean_e + noise_e * NODES) / field.headroom_e)
    return float(WEIGHTS @ shown / WEIGHTS.sum())


def decoded(value: float) -> float:
    """Return the linear light of an sRGB value."""
    return float(decode_srgb(np.array(value)))


def _measured_output(field: EvenField, luminance_cd_m2: float, rng: np.random.Generator) -> float:
    samples = field.samples_e(field.shoot(luminance_cd_m2, field.draw_chip(rng), rng))
    return float(encode_srgb(samples / field.headroom_e).mean())
