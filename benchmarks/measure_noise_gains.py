"""Measure `isp/colour/noise_gains.toml`: what is left of the noise, with blur, in each processor's planes.

Run ``python benchmarks/measure_noise_gains.py`` for all, or with names for some; the others' rows stay. On pictures
that no page judges on (`training_pictures`), at light that gives the unit's channel a stated SNR in the mean, on two
sensors: squared error of the balanced planes over the noise variance of one sample. The factor on it is the one of
`FACTORS` with the smallest product of RMS error and median CIEDE2000 of the developed pictures, neither of which may be
worse than the plain matrix's in the mean over any kind of picture.
"""

import argparse
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from training_pictures import KINDS, TRAINING, TRAINING_SEED, TrainingPicture, training_pictures

from isp.colour.colour_fit import ColourFit
from isp.colour.noise_gains import TABLE, NoiseGains, colours_in_noise
from isp.colour.white_balance import WhiteBalance
from isp.processors.catalogue import PROCESSORS, Processor
from isp.processors.own import processor_of
from rodcone.colour_spaces import encode_srgb
from rodcone.toml_file import read_toml
from rodcone.types import Floats
from sensor.capture import expose
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import preset, vary
from sensor.raw import RawImage
from sensor.readout import noise_variance
from sensor.response import channel_electrons, expected_electrons
from studies.metrics.appearance import picture_quality
from studies.metrics.truth import neutral_electrons
from studies.photograph.camera import colour_fit, develop_to_scale

SNR_DB = (-20.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
SENSORS = ("low_noise", "table1_output")
FACTORS = (10.0, 3.0, 1.0, 0.5, 0.2, 0.1, 0.03, 0.0)
SIZE = 96
TIME_S = 0.066
BELOW_FULL = 0.9  # of the well: pixels that the planes are held against


@dataclass(frozen=True)
class Shot:
    """One exposure of a training picture.

    Attributes
    ----------
    picture : TrainingPicture
    level_cd_m2 : float
    sensor : SensorConfig
    raw : RawImage
    colours : ColourFit
    neutral : (channel,) float64
        Electrons of a neutral of 1 cd/m^2, which the pictures are balanced by.
    planes, truth : (h, w, 3) float64
        The processor's balanced planes before the matrix, and the true ones [e-].
    """

    picture: TrainingPicture
    level_cd_m2: float
    sensor: SensorConfig
    raw: RawImage
    colours: ColourFit
    neutral: Floats
    planes: NDArray[np.float64]
    truth: NDArray[np.float64]


@cache
def pictures() -> list[TrainingPicture]:
    return training_pictures(SIZE, TRAINING, TRAINING_SEED)


def take(processor: Processor, index: int, name: str, snr_db: float) -> Shot:
    """Expose a picture so that the unit's channel has an SNR in the mean."""
    picture, sensor = pictures()[index], vary(preset(name), processor.mosaic)
    image, names = form_image(picture.radiance, sensor), sensor.channels
    of_channels = channel_electrons(image, sensor, TIME_S)  # of 1 cd/m^2
    unit = names.index(processor.unit)
    dark = float(noise_variance(np.zeros((1, 1)), sensor, TIME_S)[0, 0])
    snr2 = 10.0 ** (snr_db / 10)
    mean_e = (snr2 + np.sqrt(snr2**2 + 4 * snr2 * dark)) / 2
    level = float(mean_e / of_channels[..., unit].mean())
    rng = np.random.default_rng([TRAINING_SEED, index, SENSORS.index(name), round(100 + snr_db)])
    device = draw_device(sensor, (SIZE, SIZE), rng)
    raw = expose(expected_electrons(image, sensor, TIME_S) * level, sensor, TIME_S, device, rng, exact=True)
    neutral = neutral_electrons(sensor, picture.light, TIME_S)
    order = [names.index(channel) for channel in processor.colours]
    planes = processor.develop(raw, np.eye(3), neutral=neutral, balance=neutral).rgb
    truth = of_channels[..., order] * level * neutral[unit] / neutral[order]
    return Shot(picture, level, sensor, raw, colour_fit(sensor, processor, picture.light), neutral, planes, truth)


def plane_error(processor: Processor, shot: Shot) -> Floats:
    """Mean squared error of the planes over one sample's noise variance, shape (3,)."""
    names, dark_e = channels(shot.raw.cfa), shot.raw.dark_noise_e
    kept = (shot.truth < BELOW_FULL * shot.raw.full_well_e).all(axis=-1)
    order = [names.index(name) for name in processor.colours]
    response = shot.neutral[order] / shot.neutral[names.index(processor.unit)]
    mean_e = shot.truth[..., processor.colours.index(processor.unit)].mean()
    one_sample = (mean_e * response + dark_e**2) / response**2
    return np.asarray(((shot.planes - shot.truth)[kept] ** 2).mean(axis=0) / one_sample)


def quality(processor: Processor, shot: Shot, gains: NoiseGains) -> tuple[float, float]:
    """RMS error and median CIEDE2000 of the developed picture."""
    white = shot.picture.white_cd_m2 * shot.level_cd_m2
    if processor.mosaic == "bayer" or processor.extra == "bm3d":  # the matrix is the last step: one development serves
        balance = WhiteBalance(given=shot.neutral)
        colours = colours_in_noise(shot.raw, shot.colours, balance, processor.unit, gains)
        linear = shot.planes @ colours.matrix().T / (shot.neutral[channels(shot.raw.cfa).index("G")] * white)
    else:
        knowing = replace(processor, noise_gains=gains)
        neutral = shot.neutral
        linear, _ = develop_to_scale(shot.raw, knowing, shot.colours, shot.sensor, neutral, white, balance=neutral)
    found = picture_quality(encode_srgb(linear), shot.picture.truth)
    return 10 ** (-found.psnr_db / 20), found.delta_e_median


def measure_at(name: str, snr_db: float) -> tuple[list[float], float]:
    """Error of one processor's planes at one SNR, and the factor on it."""
    processor = processor_of(name)
    shots = [take(processor, index, sensor, snr_db) for index in range(TRAINING) for sensor in SENSORS]
    error = np.mean([plane_error(processor, shot) for shot in shots], axis=0)
    found = []
    for factor in FACTORS:
        gains = NoiseGains(np.zeros(1), factor * error[None])
        found.append([quality(processor, shot, gains) for shot in shots])
    # (factor, kind, figure) and (factor, figure): shots of a picture, on all sensors, follow each other
    by_kind = np.reshape(found, (len(FACTORS), -1, len(KINDS), len(SENSORS), 2)).mean(axis=(1, 3))
    figures = by_kind.mean(axis=1)
    allowed = (by_kind <= by_kind[-1] * (1 + 1e-9)).all(axis=(1, 2))
    best = int(np.argmin(np.where(allowed, figures.prod(axis=1), np.inf)))
    won = [
        f"{FACTORS[at]:g}: {20 * np.log10(figures[-1, 0] / figures[at, 0]):+.2f} dB, "
        f"dE {figures[-1, 1] - figures[at, 1]:+.2f}"
        for at in (best, FACTORS.index(1.0))
    ]
    print(f"{name:16s} {snr_db:5.0f} dB  error {error.round(3)}  factor {won[0]}; {won[1]}", flush=True)
    return [float(f"{value:.3g}") for value in error], FACTORS[best]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="as a study names them; FILE.whl:bayer_net too")
    names = parser.parse_args().names
    rows = read_toml(TABLE)["processors"]
    for name in names or [name for name in rows if name in PROCESSORS]:
        errors, factors = zip(*(measure_at(name, snr_db) for snr_db in SNR_DB), strict=True)
        rows[name.rpartition(":")[2]] = {"errors": errors, "factors": factors}
    lines = [
        "# What is left of noise, with blur, in each processor's planes, over the noise variance of one sample.",
        "#   python benchmarks/measure_noise_gains.py",
        f"# {TRAINING} generated pictures of {SIZE} x {SIZE} pixels (seed {TRAINING_SEED}) on {' and '.join(SENSORS)}; "
        f"NumPy {np.__version__}.",
        "# errors: a row for each SNR of the frame's mean in the processor's unit (G; Y of CMYW), a number for each",
        "# channel that the matrix takes. factors: on them, chosen by the pictures; 0 is the plain matrix.",
        f"snr_db = {list(SNR_DB)}",
    ]
    for name, found in rows.items():
        lines += ["", f"[processors.{name}]", f"factors = {list(found['factors'])}", "errors = ["]
        lines += [*(f"  {list(row)}," for row in found["errors"]), "]"]
    TABLE.write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main()
