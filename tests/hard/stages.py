"""The chain's stages in single precision, each beside the same arithmetic in double precision.

Noise is the least that a sensor can have: shot noise, and the dark noise among the stage's parameters. Levels end at
1e6 e-, the largest well. Bounds count roundings, each of u = 2^-24 of the number that is rounded.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from builders import raw_image
from hard.case import Image, Margin, worse, worst_of
from hard.chain import to_picture
from hard.light import at_level, transport
from hard.precision import Found, Parameters, Stage, beside_noise
from numpy.typing import NDArray
from scipy.stats import poisson

from isp.anscombe import LEAST_PRNU, stabilise
from isp.interleaved import reconstruct
from isp.planes import fill
from isp.reference import sum_weights
from isp.settings import SIGMA_S, Settings
from render.combine import emission
from render.spectrum import band_widths
from rodcone.colour_spaces import encode_srgb
from sensor.cfa import RGBW, channel_map, channels
from sensor.config import LensConfig, SensorConfig
from sensor.device import Device
from sensor.kernel.kernel import expected_electrons_single, read_frame
from sensor.optics import camera_equation, form_image
from sensor.presets import low_noise
from sensor.random import NoiseTerm, philox
from sensor.response import electrons_per_irradiance, expected_electrons

ROUNDING = 2.0**-24  # u: half a step of single precision
MOST_E = 1e6  # the largest well
SHAPE = (32, 32)
# Mean error of a normal draw and of what a quantile makes of it: the angle has three roundings of up to 2 pi, the
# radius four, its logarithm's argument one, which counts over the radius; means of radius and of its inverse are 1.25.
NORMAL_ERROR = (3 * 2 * np.pi * 1.25 + 4 * 1.25 + 1.25 + 4) * ROUNDING
LEVELS_E = (1e-3, MOST_E)
SEEDS = (1.0, 1e9)
BAND_COUNTS = (1, 5, 20, 40, 401)
LENS = LensConfig(2.8)


def _camera(**pixel: float) -> SensorConfig:
    """A camera without noise of its own, for electrons alone."""
    terms = {"read_noise_e": 0.0, "dsnu_e": 0.0, "prnu": 0.0, "full_well_e": MOST_E} | pixel
    sensor = low_noise()
    return replace(sensor, pixel=replace(sensor.pixel, **terms), bits=16, lens=LENS)


def _shot(electrons: Image, dark_e: float = 0.0) -> Image:
    return np.sqrt(np.maximum(electrons, 0.0) + dark_e**2 + 1e-12)


def _rng(at: Parameters) -> np.random.Generator:
    return np.random.default_rng(int(at["seed"]))


def _relit(at: Parameters) -> Found:
    """Spectrum sums of `Transport.relight`: summed in double precision, rounded once."""
    made, camera = transport(), _camera()
    group = next(iter(made.groups))
    lit = made.relight(powers={group: at["power"]})
    lights = {
        name: replace(one, power=at["power"] if name == group else one.power) for name, one in made.groups.items()
    }
    coefficients = emission(lights, made.wavelength_nm, made.width_nm)
    exact = np.einsum("gb,gbhw->hwb", coefficients, made.radiance.astype(np.float64))
    one, two = (
        expected_electrons(form_image(replace(lit, values=values), camera), camera, 1.0)
        for values in (lit.values.astype(np.float64), exact)
    )
    level = at["level_e"] / max(two.mean(), 1e-300)
    found = _within_well((one - two) * level, two * level, ROUNDING * 1.001 * two * level)
    return replace(found, bound=worse(found.bound, _band_by_band(lit.values, exact, 1)))


def _within_well(error_e: Image, electrons: Image, bound_e: Image) -> Found:
    kept = (electrons <= MOST_E) & (electrons > 0)
    if not kept.any():
        return beside_noise([0.0], [1.0], [1.0])
    return beside_noise(error_e[kept], _shot(electrons[kept]), bound_e[kept])


def _imaged(spread: bool, at: Parameters) -> Found:
    """`form_image` of float32 beside float64."""
    lens = LensConfig(at["f_number"], horizontal_view_deg=at["view_deg"])
    if spread:
        lens = LensConfig(at["f_number"], diffraction=1.0, veiling_glare=min(at["view_deg"] / 120, 1.0))
    camera, seen = replace(_camera(), lens=lens), at_level(10.0)
    double = replace(seen, values=seen.values.astype(np.float64))
    single = form_image(seen, camera)
    one, two = (
        expected_electrons(replace(single, values=image.values.astype(np.float64)), camera, 1.0)
        for image in (single, form_image(double, camera))
    )
    level = at["level_e"] / two.mean()
    # lens factor, its product, falloff, its product; a lens that spreads light works in double and rounds once
    roundings = 1 if spread else 4
    found = _within_well((one - two) * level, two * level, roundings * ROUNDING * 1.001 * two * level)
    return replace(
        found, bound=worse(found.bound, _band_by_band(single.values, form_image(double, camera).values, roundings))
    )


def _band_by_band(single: NDArray[np.floating], double: NDArray[np.floating], roundings: int) -> Margin:
    """Error of each band over its roundings, before sums over bands even them out [of the band's value]."""
    lit = double > 0
    relative = single.astype(np.float64)[lit] / double[lit] - 1.0
    return worst_of(relative, roundings * ROUNDING * 1.001, "of a band's value")


def _summed(at: Parameters) -> Found:
    """Sum over bands behind each filter, of random spectra."""
    count = BAND_COUNTS[min(int(at["bands"]) - 1, len(BAND_COUNTS) - 1)]
    edges = np.linspace(380.0, 780.0, count + 1)
    nm, camera = (edges[1:] + edges[:-1]) / 2, _camera()
    planes = (10.0 ** _rng(at).uniform(-3.0, 0.0, (count, *SHAPE))).astype(np.float32)
    weights = electrons_per_irradiance(camera, nm, band_widths(nm, np.diff(edges)), 1.0) * camera_equation(LENS)
    single = expected_electrons_single(np.moveaxis(planes, 0, -1), weights, camera).astype(np.float64)
    channel = np.vectorize(channels(RGBW).index)(channel_map(RGBW, SHAPE))
    double = np.einsum("hwb,bhw->hw", weights[channel], planes.astype(np.float64))
    level = at["level_e"] / double.mean()
    # weight, first product or fma in each of at most 8, then one addition for each 8 bands
    roundings = 1 + min(count, 8) + -(-count // 8)
    return _within_well((single - double) * level, double * level, roundings * ROUNDING * 1.001 * double * level)


def _read(at: Parameters) -> Found:
    """Poisson draws of 30 e- and more, read noise and rounding, beside the same in double precision."""
    camera = replace(_camera(read_noise_e=at["read_noise_e"], full_well_e=57_343.0), black_level_dn=8192)  # 1 e- a DN
    mean = np.full(SHAPE, at["level_e"], dtype=np.float32)
    device, key = Device(np.ones(SHAPE), np.zeros(SHAPE)), int(_rng(at).integers(0, 2**63))
    single = read_frame(mean, camera, device, 0.0, key).astype(np.float64)
    drawn = _drawn(mean.astype(np.float64), key, at["read_noise_e"])
    double = np.clip(np.rint(drawn + 8192.0), 0, 65_535)
    # one electron where the draw's floor falls on the other side, one where rounding to DN does
    found = beside_noise(single - double, _shot(mean.astype(np.float64), at["read_noise_e"]), np.full(SHAPE, 2.0))
    shift_e = NORMAL_ERROR * (at["level_e"] ** 0.5 + at["read_noise_e"])
    flips = Margin(float((single != double).sum()), max(float(poisson.isf(1e-9, shift_e * single.size)), 1.0), "pixels")
    return replace(found, bound=worse(found.bound, flips))


def _drawn(mean: Image, key: int, read_noise_e: float) -> Image:
    """`sensor.kernel.kernel.read_pixels` in double precision: Box-Muller, and Giles's quantile Q_N2."""
    rows, columns = (np.asarray(index, dtype=np.uint64) for index in np.indices(mean.shape))
    words = philox((columns, rows, np.full_like(rows, int(NoiseTerm.EXPOSURE)), np.zeros_like(rows)), key)
    radius = np.sqrt(-2.0 * np.log((words[0] >> np.uint64(1)).astype(np.float64) * 2.0**-31 + 2.0**-32))
    angle = (words[1] >> np.uint64(1)).astype(np.float64) * (2.0 * np.pi * 2.0**-31)
    z, root = radius * np.sin(angle), np.sqrt(mean)
    terms = root * z + z**2 / 6 + 1 / 3 - z * (z**2 / 72 + 1 / 36) / root
    terms += (z**2 * (z**2 / 270 + 7 / 810) - 8 / 405) / mean
    counts = np.floor(mean) + np.floor(terms + mean - np.floor(mean))
    return np.asarray(counts + read_noise_e * radius * np.cos(angle))


def _stabilised(at: Parameters) -> Found:
    """The mosaic in units of noise, and a plane filled from it; an error of 1 there is an error of one noise."""
    dark_e, prnu = at["dark_e"], at["prnu"] if at["prnu"] > 2e-5 else 0.0
    electrons = (at["level_e"] * 10.0 ** _rng(at).uniform(-1.0, 0.0, SHAPE)).astype(np.float32)
    planes = [fill(stabilise(e, dark_e, prnu), RGBW, "R") for e in (electrons, electrons.astype(np.float64))]
    noise = np.sqrt(electrons + dark_e**2 + (prnu * electrons.astype(np.float64)) ** 2)
    error = planes[0].astype(np.float64) - planes[1]
    # a root: of v two roundings, halved, and its own; filled: nine products and sums and a quotient. A logarithm: of
    # 1 + x eight, which count over p, and two more
    bound = (13 * planes[1].max() + (8 / prnu if prnu >= LEAST_PRNU else 0.0)) * ROUNDING
    return beside_noise(error * noise, noise, bound * noise)


def _reconstructed(at: Parameters) -> Found:
    """The kernel beside the reference, on noisy frames with edges."""
    rng, side = _rng(at), 16
    rows, columns = np.indices((side, side))
    edges = 1.0 + at["contrast"] * ((columns // 5 + rows // 7) % 2)
    response = np.vectorize({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}.get)(channel_map(RGBW, (side, side)))
    full_e, black = 15_000.0, 100.0
    electrons = np.minimum(rng.poisson(at["level_e"] * edges * response), full_e) + rng.normal(0, 2.0, (side, side))
    dn = np.clip(np.rint(electrons + black), 0, 65_535)
    raw = raw_image(dn, black_dn=black, white_dn=black + full_e, read_noise_e=2.0, dsnu_e=0.0)
    settings = Settings(neighbourhood=9, sigma_s=at["sigma_s"])
    sums = sum_weights(raw, settings)
    double = sums.value / sums.weight
    single = reconstruct(raw, settings)
    share = np.maximum(1e-4, 16 * ROUNDING * -sums.largest)
    return beside_noise(single - double, _shot(double, raw.dark_noise_e), np.ptp(raw.electrons) * share)


def _coloured(at: Parameters) -> Found:
    """Balance and matrix, in double precision, of channels that are rounded to float32."""
    electrons = at["level_e"] * 10.0 ** _rng(at).uniform(-1.0, 0.0, (*SHAPE, 4))
    matrix = to_picture(RGBW, {})
    error = (electrons.astype(np.float32).astype(np.float64) - electrons) @ matrix.T
    noise = np.sqrt(electrons @ (matrix**2).T)
    return beside_noise(error, noise, ROUNDING * electrons @ np.abs(matrix).T * 1.001)


def _encoded(at: Parameters) -> Found:
    """The curve of sRGB of a float32 picture beside a float64 one, taken back to electrons by its slope."""
    linear = 10.0 ** _rng(at).uniform(-4.0, 0.0, SHAPE)
    electrons = linear * at["level_e"]
    error = encode_srgb(linear.astype(np.float32)) - encode_srgb(linear)
    slope = np.where(linear <= 0.0031308, 12.92, 1.055 / 2.4 * linear ** (1 / 2.4 - 1))
    # the picture's rounding, and a hundredth where the slope changes within it
    return beside_noise(error / slope * at["level_e"], _shot(electrons), 1.01 * ROUNDING * electrons)


STAGES = (
    Stage("spectrum sums of relighting", "u e", {"power": (1e-6, 1e6), "level_e": LEVELS_E}, _relit),
    Stage(
        "optics, no spreading",
        "4 u e",
        {"level_e": LEVELS_E, "f_number": (0.5, 64.0), "view_deg": (1.0, 120.0)},
        partial(_imaged, False),
    ),
    Stage(
        "optics, diffraction and glare",
        "u e",
        {"level_e": LEVELS_E, "f_number": (0.5, 64.0), "view_deg": (1.0, 120.0)},
        partial(_imaged, True),
    ),
    Stage(
        "expected electrons",
        "(9 + bands / 8) u e",
        {"level_e": LEVELS_E, "bands": (1.0, 5.999), "seed": SEEDS},
        _summed,
    ),
    Stage(
        "noise and readout",
        "1 e⁻ where a draw or a DN falls on the other side, in no more pixels than roundings move there",
        {"level_e": (30.0, 5e4), "read_noise_e": (1e-3, 1e3), "seed": SEEDS},
        _read,
    ),
    Stage(
        "planes in units of noise",
        "(13 t + 8 / p) u σ",
        {"level_e": LEVELS_E, "dark_e": (0.1, 1e4), "prnu": (1e-5, 0.5), "seed": SEEDS},
        _stabilised,
    ),
    Stage(
        "reconstruction",
        "1e-4 of the range, or 16 u of the largest log weight",
        {"level_e": (1.0, 1e4), "contrast": (0.1, 30.0), "sigma_s": (SIGMA_S, SIGMA_S), "seed": SEEDS},
        _reconstructed,
    ),
    Stage(
        "reconstruction, any sigma_s",
        "1e-4 of the range, or 16 u of the largest log weight",
        {"level_e": (1.0, 1e4), "contrast": (0.1, 30.0), "sigma_s": (0.1, 30.0), "seed": SEEDS},
        _reconstructed,
    ),
    Stage("colour", "u e through the matrix", {"level_e": LEVELS_E, "seed": SEEDS}, _coloured),
    Stage("encoding", "1.01 u e", {"level_e": LEVELS_E, "seed": SEEDS}, _encoded),
)
