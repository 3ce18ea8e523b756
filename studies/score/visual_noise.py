"""Visual noise: how strongly the eye sees an even field's noise, by formula and on simulated frames.

As in ISO 15739:2013, annex B, the picture's XYZ is blurred in opponent planes as by the eye, and the standard
deviations of CIELUV are added, V = s(L*) + 0.852 s(u*) + 0.323 s(v*). The blur is that of S-CIELAB, on which the
standard's blur is based. The standard's own table of sensitivities, and its CIELAB form of 2023, were not at hand.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import nan

import numpy as np
from numpy.typing import NDArray
from skimage.color.colorconv import xyz2luv

from rodcone.colour_spaces import SRGB_TO_XYZ
from rodcone.errors import InputError, one_line
from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.readings.best_estimate import merged_variances
from sensor.readings.resolve import several
from studies.metrics.s_cielab import PIXELS_PER_DEGREE, XYZ_TO_OPPONENT, eye_transfer, eye_xyz
from studies.metrics.truth import GREY, named_light
from studies.photograph.camera import calibrate
from studies.score.even_field import SIDE_PX, EvenField, even_field
from studies.score.figure import Definition, Merit, not_measured
from studies.score.sharpness import every_pixel

WEIGHTS = np.array([1.0, 0.852, 0.323])  # weights of L*, u* and v*
WHITE_SHARE = 0.7  # share of the full well that a perfect white fills, in the channel that fills first
COLUMNS = ("column gains", "column offsets")  # noise that all pixels of a column share
STANDARD = "like ISO 15739:2013, annex B: s(L*) + 0.852 s(u*) + 0.323 s(v*)"
STEP = 1e-6  # step of XYZ by which the slopes of CIELUV are found


def visual_noise(linear: NDArray[np.float64]) -> float:
    """Measure the visual noise of an even field's picture, linear sRGB (h, w, 3) in which white is 1."""
    luv = xyz2luv(np.clip(eye_xyz(linear @ SRGB_TO_XYZ.T), 0.0, None))
    return float(WEIGHTS @ luv.reshape(-1, 3).std(axis=0))


def raw_visual_noise(sensor: SensorConfig, light: str, exposure_s: float) -> Definition:
    """Define the visual noise of a camera with all three colours at every pixel, developed by its matrix alone."""
    names = sensor.channels[:3]
    merit = Merit(
        "iso_15739.visual_noise",
        "visual noise of 18 % grey",
        "1",
        STANDARD,
        f"{', '.join(names)} at every pixel, balanced on {light} and taken to sRGB by the matrix, white at "
        f"{100 * WHITE_SHARE:.0f} % of the well, the eye's blur of S-CIELAB, {PIXELS_PER_DEGREE:.0f} pixels per degree",
        nan,
    )
    if len(names) < 3:
        return Definition((replace(merit, missing="the mosaic tells no colours"),), not_measured)
    try:
        fields, matrix = colour_fields(sensor, light, exposure_s)
    except InputError as error:  # with the reasons of `colour_figures`
        return Definition((replace(merit, missing=one_line(error)),), not_measured)
    white_cd_m2 = min(WHITE_SHARE * field.headroom_e / field.electrons_per_cd_m2 for field in fields)
    return Definition(
        (replace(merit, computed=expected_noise(fields, matrix, white_cd_m2)),),
        lambda rng: [measured_noise(fields, matrix, white_cd_m2, rng)],
    )


def colour_fields(sensor: SensorConfig, light: str, exposure_s: float) -> tuple[list[EvenField], Floats]:
    """Return even fields of the three channels, each with its filter at every pixel, and their matrix to sRGB.

    Raises
    ------
    InputError
        For a channel that gets no light, or channels that are alike.
    """
    known = named_light(light, sensor.window_nm)
    matrix = calibrate(sensor, known.lamp).to_srgb
    return [even_field(every_pixel(sensor, name), known, exposure_s, name) for name in sensor.channels[:3]], matrix


def measured_noise(fields: Sequence[EvenField], matrix: Floats, white_cd_m2: float, rng: np.random.Generator) -> float:
    """Measure the visual noise of 18 % grey on frames of the channels; `white_cd_m2` is shown as white."""
    planes = []
    for field in fields:
        raw = field.shoot(GREY * white_cd_m2, field.draw_chip(rng), rng)
        planes.append(field.samples_e(raw).reshape(raw.shape) / (white_cd_m2 * field.electrons_per_cd_m2))
    return visual_noise(np.stack(planes, axis=-1) @ matrix.T)


def expected_noise(fields: Sequence[EvenField], matrix: Floats, white_cd_m2: float) -> float:
    """Compute the result of `measured_noise` by a formula, which holds for noise that is small beside the grey."""
    whites_e = [white_cd_m2 * field.electrons_per_cd_m2 for field in fields]
    by_channel = [_variances(field, GREY * e) / e**2 for field, e in zip(fields, whites_e, strict=True)]
    return _expected(np.array(by_channel), matrix, SIDE_PX // fields[0].sensor.sites)


def _variances(field: EvenField, electrons: float) -> Floats:
    """Return three variances [e-^2]: of noise that is each pixel's own, that a column shares, and that a row shares."""
    light_e = np.array([electrons])
    readings = field.readings
    if several(readings):
        by_source = {name: float(values[0]) for name, values in merged_variances(light_e, readings).items()}
    else:
        by_source = {name: float(law.variance(light_e)[0]) for name, law in readings[0].sources.items()}
    columns = sum(by_source[name] for name in COLUMNS)
    pixel = readings[0].sensor.pixel  # merged readings are assumed to have this reading's share of row noise
    rows = by_source["read noise"] * (pixel.row_noise_e / pixel.read_noise_e) ** 2 if pixel.row_noise_e else 0.0
    return np.array([sum(by_source.values()) - columns - rows, columns, rows])


def _expected(variances: Floats, matrix: Floats, side: int) -> float:
    """Return the visual noise for relative variances (channel, 3) of noise per pixel, per column and per row.

    The eye's blur is a product in the space of the cosine transform. There, noise per pixel is the same at all
    frequencies; noise per column lies at frequencies that don't change down a column, and noise per row at those that
    don't change along a row.
    """
    cycles = np.arange(side) / (2 * side) * PIXELS_PER_DEGREE
    passed = np.stack([eye_transfer(plane, np.hypot(cycles[:, None], cycles)) for plane in range(3)], axis=-1)
    passed[0, 0] = 0.0  # because the mean isn't noise
    every = np.einsum("hwi,hwj->ij", passed, passed) / side**2
    kept = (every, passed[0].T @ passed[0] / side, passed[:, 0].T @ passed[:, 0] / side)
    to_xyz = SRGB_TO_XYZ @ matrix
    to_opponent, to_eye = XYZ_TO_OPPONENT @ to_xyz, np.linalg.inv(XYZ_TO_OPPONENT)
    opponent = sum(to_opponent * of @ to_opponent.T * share for of, share in zip(variances.T, kept, strict=True))
    grey = GREY * to_xyz.sum(axis=1)
    slopes = (xyz2luv(grey + STEP * np.eye(3)) - xyz2luv(grey - STEP * np.eye(3))).T / (2 * STEP)
    covariance = slopes @ to_eye @ opponent @ to_eye.T @ slopes.T
    return float(WEIGHTS @ np.sqrt(np.diag(covariance)))
