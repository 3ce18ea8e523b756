"""Invariants of raw images and pictures: in bounds everywhere, and without bias where black and well leave room."""

from dataclasses import replace
from functools import cache

import numpy as np
from hard.case import Margin, Situation, worse, worst_of
from hard.chain import CAMERAS, behind, develop, develop_fixed, expected, plain_matrix, shoot, to_picture
from numpy.typing import NDArray
from scipy.stats import t

from isp.colour.white_balance import neutral_response
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from sensor.cfa import channel_map
from sensor.config import BLACK_SIGMAS, SensorConfig
from sensor.raw import SATURATION_SIGMAS, RawImage
from sensor.readout import noise_variance, spread_charge

ROUNDING = 1e-5  # a weighted mean in single precision leaves the range of its samples by less
RAW_FRAMES, PICTURES = 32, 12  # each with a chip and noise of its own; a picture takes five times as long
FALSE_ALARM = 1e-6  # of each mean; all cases together test about a thousand
FLAT_SIDE = 32
ROOM_SIGMAS = 6.0  # between a mean and the full well: less than 1e-9 of the draws reach it


def bounded(situation: Situation) -> Margin:
    """All values are finite, DN are in the converter's range, and pictures in that of samples, balance and matrix."""
    worst = []
    for name in CAMERAS:
        electrons = expected(behind(situation, name))
        lit = Margin(0.0 if np.isfinite(electrons).all() and electrons.min() >= 0 else np.inf, 1.0, "of the bound")
        made = develop(shoot(situation, name), situation)
        dn = Margin(0.0 if made.raw.dn.max() <= made.raw.white_dn else np.inf, 1.0, "of the bound")
        shown = worst_of(made.fixed, _picture_bound(made.raw, situation)[None, None], "of the bound")
        automatic = made.automatic.rgb
        encoded = encode_srgb(automatic / max(float(np.abs(automatic).max()), 1.0))
        fits = np.isfinite(automatic).all() and encoded.min() >= 0 and encoded.max() <= 1
        decided = Margin(0.0 if fits else np.inf, 1.0, "of the bound")
        worst += [lit, dn, shown, decided]
    return worse(*worst)


def _picture_bound(raw: RawImage, situation: Situation) -> Image:
    """Largest value of each colour that means of the samples can give."""
    names = raw.channels
    samples = np.abs(raw.electrons).max() * np.ones(len(names))
    matrix = to_picture(raw.cfa, situation.develop)
    bound = np.abs(matrix) @ samples
    if "W" in names:  # near full samples of W the colours alone decide
        balance = np.asarray(situation.develop.get("balance", neutral_response(names)))
        gains = (balance[names.index("G")] / balance)[:3]
        bound = np.maximum(bound, np.abs(plain_matrix()) @ (gains * samples[:3]))
    return np.asarray(bound * (1 + ROUNDING) + 1e-300)


def raw_unbiased(situation: Situation) -> Margin | None:
    """The mean of each channel's pixels over chips and exposures, less black, is the expected value."""
    margins = []
    for name in CAMERAS:
        sensor = behind(situation, name).sensor
        mean_e = _above_black(behind(situation, name))
        room = _leaves_room(mean_e, sensor, situation.exposure_s)
        names = channel_map(sensor.cfa, mean_e.shape)
        frames = [shoot(situation, name, 100 + seed) for seed in range(RAW_FRAMES)] if room.any() else []
        for channel in sensor.channels:
            pixels = room & (names == channel)
            sound = [(raw.electrons - mean_e)[pixels & ~_defective(raw)] for raw in frames]
            errors = np.array([error.mean() for error in sound if error.size])
            if errors.size:
                margins.append(bias(errors, float(mean_e[pixels].mean())))
    return worse(*margins) if margins else None


def pictures_unbiased(situation: Situation) -> Margin | None:
    """Both pictures of an even field, lit like the frame's median pixel, have the expected colour."""
    level = flat_field(situation)
    margins = []
    for name in CAMERAS:
        sensor = behind(level, name).sensor
        mean_e = _above_black(behind(level, name))
        if not _leaves_room(mean_e, sensor, level.exposure_s).all():
            continue
        names = channel_map(sensor.cfa, mean_e.shape)
        means = np.array([mean_e[names == channel].mean() for channel in sensor.channels])
        shown = to_picture(sensor.cfa, level.develop) @ means
        pictures = [develop_fixed(shoot(level, name, 200 + seed), level) for seed in range(PICTURES)]
        found = np.array([picture.mean(axis=(0, 1)) for picture in pictures])
        margins += [bias(found[:, i] - shown[i], float(np.abs(means).max())) for i in range(3)]
    return worse(*margins) if margins else None


def flat_field(situation: Situation) -> Situation:
    """The same camera before an even field of the frame's median pixel; small, and without the lens's falloff."""
    values = situation.radiance.values
    total = values.sum(axis=-1, dtype=np.float64)
    median = values.reshape(-1, values.shape[-1])[np.argsort(total, axis=None)[total.size // 2]]
    shape = tuple(min(FLAT_SIDE, size) for size in situation.shape)
    even = replace(situation.radiance, values=np.broadcast_to(median, (*shape, median.size)).copy())
    lens = replace(situation.sensor.lens, horizontal_view_deg=0.0)
    return replace(situation, radiance=even, sensor=replace(situation.sensor, lens=lens), samples_per_pixel=1)


def _above_black(situation: Situation) -> Image:
    """Mean of each sound pixel's electrons above black."""
    return spread_charge(expected(situation), situation.sensor.pixel.crosstalk)


def _leaves_room(mean_e: Image, sensor: SensorConfig, exposure_s: float) -> NDArray[np.bool_]:
    """Pixels where black is five standard deviations of the dark or more, and the well isn't reached."""
    pixel = sensor.pixel
    dark_e = float(np.hypot(pixel.read_noise_e, pixel.fixed_dark_e))
    sigma_e = np.sqrt(noise_variance(mean_e, sensor, exposure_s))
    # Highlights are held from where a pixel counts as saturated, some sigmas of the dark under the well.
    top_e = pixel.full_well_e * (1 - SATURATION_SIGMAS * pixel.column_gain_spread)
    dark_current_e = pixel.dark_current_e_per_s * exposure_s
    top_e -= SATURATION_SIGMAS * float(np.hypot(np.hypot(dark_e, dark_current_e**0.5), sensor.gain_e_per_dn))
    top_e -= dark_current_e
    fits = sensor.black_dn * sensor.gain_e_per_dn >= BLACK_SIGMAS * dark_e * (1 - 1e-12)
    return np.asarray(fits & (mean_e + ROOM_SIGMAS * sigma_e < top_e))


def _defective(raw: RawImage) -> NDArray[np.bool_]:
    bad = np.zeros(raw.shape, dtype=np.bool_)
    if raw.defects is not None:
        bad[tuple(raw.defects.T)] = True
    return bad


def bias(errors: Image, scale_e: float) -> Margin:
    """Mean error over its standard error, which the frames' own scatter gives (Student's t)."""
    spread = float(errors.std(ddof=1)) / len(errors) ** 0.5 if len(errors) > 1 else 0.0
    mean = abs(float(errors.mean())) if len(errors) else 0.0
    rounding_e = 1e-6 * scale_e + 1e-12
    if spread < rounding_e:  # nothing scatters: nothing may be off but by rounding
        return worst_of(mean, rounding_e, "e⁻")
    return Margin(mean / spread, allowed_errors(len(errors)), "standard errors")


@cache
def allowed_errors(frames: int) -> float:
    """Standard errors that a mean without bias exceeds once in 1 / FALSE_ALARM times."""
    return float(t.isf(FALSE_ALARM / 2, frames - 1))
