"""Measure the designs that the paper argues against (section 2).

Sato 1983 and Kijima 2007 use W as the luminance, even where W is full. Gindele & Gallagher 2002 use the colours there.
Yamagami 1994 gives W and the colours one sensitivity, by a neutral density or by complementary filters.
"""

from collections.abc import Mapping
from itertools import product

import numpy as np
import scipy

from isp.planes import tent
from isp.processors.catalogue import NAMED
from isp.processors.fusion import MATCHED_RADIUS, tent_means
from rodcone.colour_spaces import SRGB_TO_XYZ
from sensor.cfa import MOSAICS, Tile, mask
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.readout import noise_variance, read_out
from studies.metrics.truth import named_light
from studies.paper.claims import Claim, judge_claim
from studies.paper.numbers import MOONLIGHT_CD_M2
from studies.paper.setup import READINGS, Camera, Setup, decibels, develop_view, exposures, table1_sensor, view
from studies.paper.white_in_low_light import LOW_CD_M2
from studies.paper.white_partly_full import BRIGHT_CD_M2, PITCH_UM, measure_bright
from studies.photograph.camera import colour_fit
from studies.photograph.snr import channel_e, electrons_at_snr

GINDELE = "rgbw_gindele_published"
DESIGNS = ("rgbw_sato_published", "rgbw_kijima_published", GINDELE)  # judged where W is full
MATCHED = ("rgbw_nd", "cmyw")  # Yamagami's mosaics
CMYW, RGBW = "cmyw_yamagami_published", "rgbw_sato_published"  # their colours are compared
HOW = ("closed form", "read out")
EXPOSURE_S, FLAT_SIDE = 0.020, 256  # exposure time and side of the even fields
WHITE_E = 1e4  # electrons of the W pixel with which combined colour samples are compared
COLOUR_LIGHTS = {"moonlight": MOONLIGHT_CD_M2, "low light": LOW_CD_M2, "25 cd/m²": 25.0}


def range_db(sensor: SensorConfig) -> tuple[float, float]:
    """Return the dynamic range [dB], by formula and as measured on frames that are read out.

    It is the light that fills the most sensitive colour over the light in which W's SNR is 1. On frames the first is
    the light in which half of the pixels are full, and the second follows from W's SNR in the computed light.
    """
    light = named_light("D65")
    names = sensor.channels
    per_cd_m2 = channel_e(sensor, light, 1.0, EXPOSURE_S)
    white = per_cd_m2[names.index("W")]
    colour = per_cd_m2[[name != "W" for name in names]].max()
    dark_cd_m2 = electrons_at_snr(1.0, sensor, EXPOSURE_S) / white
    full_cd_m2 = sensor.pixel.full_well_e / colour
    rng = np.random.default_rng(0)
    shape = (FLAT_SIDE, FLAT_SIDE)
    device = draw_device(sensor, shape, rng)
    # In the dark the SNR is proportional to the light. So the luminance with an SNR of 1 follows from the SNR that is
    # measured at the computed luminance.
    dark_e = read_out(np.full(shape, dark_cd_m2 * white), sensor, device, EXPOSURE_S, rng).electrons
    measured_cd_m2 = dark_cd_m2 * float(dark_e.std() / dark_e.mean())
    steps = full_cd_m2 * np.linspace(0.9, 1.1, 21)
    full = [read_out(np.full(shape, step * colour), sensor, device, EXPOSURE_S, rng).saturated.mean() for step in steps]
    return decibels(full_cd_m2 / dark_cd_m2), decibels(float(np.interp(0.5, full, steps)) / measured_cd_m2)


def colour_noise(reading: str, processor: str, luminance_cd_m2: float) -> tuple[float, float]:
    """Return the colour noise of an even grey field, by formula and as measured on frames that are read out.

    It is the standard deviation of linear sRGB after its luminance is subtracted. The grey has the value 1.
    """
    sensor = Camera(reading, processor).sensor
    light = named_light("D65")
    colours = NAMED[processor].colours
    electrons = channel_e(sensor, light, luminance_cd_m2, EXPOSURE_S)[[sensor.channels.index(x) for x in colours]]
    matrix = colour_fit(sensor, NAMED[processor], light).matrix(colours) / electrons
    chroma = (np.eye(3) - SRGB_TO_XYZ[1]) @ matrix  # sRGB without its luminance
    variance = noise_variance(electrons, sensor, EXPOSURE_S)
    rng = np.random.default_rng(0)
    shape = (FLAT_SIDE, FLAT_SIDE)
    fields = [
        read_out(np.full(shape, mean_e), sensor, draw_device(sensor, shape, rng), EXPOSURE_S, rng).electrons
        for mean_e in electrons
    ]
    measured = np.einsum("ij,jhw->ihw", chroma, np.stack(fields)).var(axis=(1, 2)).mean()
    return float(np.sqrt((chroma**2 @ variance).mean())), float(np.sqrt(measured))


def ranges_lost_db(reading: str) -> Mapping[str, float]:
    """Return the dynamic range of RGBW less that of each mosaic in `MATCHED` [dB], by formula and as read out."""
    whole = range_db(table1_sensor(reading))
    return {
        f"{reading}, {mosaic}, {how}": ours - theirs
        for mosaic in MATCHED
        for how, ours, theirs in zip(HOW, whole, range_db(table1_sensor(reading, mosaic)), strict=True)
    }


def colour_noise_ratios(reading: str) -> Mapping[str, float]:
    """Return the colour noise of C, M, Y over that of R, G, B, for each light, by formula and as read out."""
    ratios = dict[str, float]()
    for name, level in COLOUR_LIGHTS.items():
        theirs, ours = (colour_noise(reading, design, level) for design in (CMYW, RGBW))
        ratios |= {f"{reading}, {name}, {how}": a / b for how, a, b in zip(HOW, theirs, ours, strict=True)}
    return ratios


def gathered(tile: Tile) -> Mapping[str, tuple[float, float]]:
    """Return for each colour the light of Kijima's combined sample over that of a W pixel.

    The first number is computed, the second is derived from shot noise in frames that are read out.
    """
    per_cd_m2 = channel_e(table1_sensor("table1_output"), named_light("D65"), 1.0, 1.0)
    weights = np.outer(tent(MATCHED_RADIUS), tent(MATCHED_RADIUS))
    shape = (FLAT_SIDE, FLAT_SIDE)
    rng = np.random.default_rng(0)
    lights = dict[str, tuple[float, float]]()
    for channel, mean_e in zip("RGB", WHITE_E * per_cd_m2[:3] / per_cd_m2[3], strict=True):
        sites = mask(tile, channel, shape).astype(np.float64)
        total, squares = (scipy.ndimage.convolve(sites, kernel, mode="wrap") for kernel in (weights, weights**2))
        samples = 1 / float((squares / total**2).mean())  # number of samples whose plain mean has the same noise
        combined = tent_means(rng.poisson(mean_e, shape).astype(np.float64), tile, channel)[8:-8, 8:-8]
        lights[channel] = samples * mean_e / WHITE_E, float(combined.mean() ** 2 / combined.var()) / WHITE_E
    return lights


def claims_early(
    bright: Mapping[str, Mapping[str, float]],
    lost_db: Mapping[str, float],
    noise_ratios: Mapping[str, float],
    lights: Mapping[str, Mapping[str, tuple[float, float]]],
) -> tuple[Claim, ...]:
    """Judge the claims about the earlier designs.

    Parameters
    ----------
    bright : mapping
        By design and reading, the correlation of the luminance with the truth's where W is full and no colour is, in
        Figure 5's light.
    lost_db, noise_ratios : mapping
        `ranges_lost_db` and `colour_noise_ratios` of both readings.
    lights : mapping
        `gathered` by the tile's name.
    """
    fused = {
        f"{name}, {reading}": value
        for name, values in bright.items()
        for reading, value in values.items()
        if name != GINDELE
    }
    shares = {
        f"{channel}, {tile}, {how}": value
        for tile, of_tile in lights.items()
        for channel, values in of_tile.items()
        for how, value in zip(HOW, values, strict=True)
    }
    return (
        judge_claim(29, fused),
        judge_claim(30, bright[GINDELE]),
        judge_claim(31, lost_db, ms=EXPOSURE_S * 1e3),
        judge_claim(32, noise_ratios),
        judge_claim(33, shares),
    )


def section_2(setup: Setup) -> tuple[Claim, ...]:
    """Compute what the claims of section 2 need, and judge them."""
    subject = view(setup, "still_life", BRIGHT_CD_M2)
    bright: dict[str, dict[str, float]] = {name: {} for name in DESIGNS}
    for name, reading in product(DESIGNS, READINGS):
        camera = Camera(reading, name, PITCH_UM)
        raw = exposures(camera, subject, "66ms")[0]
        bright[name][reading] = measure_bright(raw, develop_view(camera, raw, subject)[0], subject).result_correlation
    lost_db, ratios = (
        {name: value for reading in READINGS for name, value in of(reading).items()}
        for of in (ranges_lost_db, colour_noise_ratios)
    )
    return claims_early(bright, lost_db, ratios, {name: gathered(MOSAICS[name]) for name in ("rgbw", "rgbw_4x4")})
