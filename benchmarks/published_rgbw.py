"""Colour error over illuminance of one automotive chip with two mosaics, beside the curves that Stanford published.

    python benchmarks/published_rgbw.py ISETCAM

Liu, Shah and Wandell ("ISETHDR", arXiv 2408.12048; IEEE Sensors Journal 2025) simulate the AR0132AT with an RGB and
with an RGBW mosaic in ISETCam: the ColorChecker under D65, f/4, pixels of 3 um, 1/60 s, a mean illuminance of 0.01 to
10 lux on the sensor. Each picture is scaled to its own brightest value, and the colour difference (CIE 1994) to that of
a camera without noise is averaged over all pixels. They develop RGB by adaptive Laplacian interpolation, and both
mosaics by a trained network (Restormer).

ISETCAM is a folder with ISETCam's ``data/`` (https://github.com/ISET/isetcam), from which
``sensor/colorfilters/auto/ar0132atRGBW.mat`` is read. The chip's other numbers stand in ISETCam's
``data/sensor/auto/ar0132atCreate.m``: 110 uV/e-, a swing of 2.8 V, read noise of 1 mV, dark voltage of 1 mV/s; fill
factor, 0.75, and f/4 are defaults of ISETCam's pixel and optics.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import colour
import numpy as np
import scipy

from isp.processors.catalogue import NAMED
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum, luminance
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import low_noise
from sensor.readout import read_out
from sensor.response import channel_electrons, expected_electrons
from studies.metrics.truth import light_in_bands, neutral_electrons
from studies.photograph.camera import calibrate, colour_fit, develop_to_scale

PATCH_PX = 80
EXPOSURE_S = 1 / 60
LUX = (0.01, 10**-1.25, 10**-0.5, 10**0.25, 10.0)
NM = np.arange(400.0, 701.0, 10.0)
VOLT_PER_E = 110e-6
# Read off the paper's figure at 0.01, 0.316 and 10 lux.
PUBLISHED = {"RGB": (46.0, 7.2, 1.0), "RGB by a network": (39.0, 5.0, 0.9), "RGBW by a network": (39.5, 4.2, 1.1)}
OURS = {
    "RGB, bilinear": ("bayer_bilinear", "bayer"),
    "RGB, residual": ("bayer_residual", "bayer"),
    "RGB by ple": ("ple_bayer", "bayer"),
    "RGBW, interleaved": ("interleaved", "rgbw"),
    "RGBW by ple": ("ple_rgbw", "rgbw"),
}


def sensor_of(folder: Path, cfa: str) -> SensorConfig:
    """AR0132AT as ISETCam has it, with one of its two mosaics."""
    file = scipy.io.loadmat(folder / "sensor/colorfilters/auto/ar0132atRGBW.mat", squeeze_me=True)
    nm = file["wavelength"].astype(np.float64)
    inside = (nm >= 400) & (nm <= 700)
    curves = {name: Spectrum(nm[inside], file["data"][inside, index]) for index, name in enumerate("RGBW")}
    chip = low_noise(cfa)
    pixel = replace(
        chip.pixel,
        pitch_um=3.0,
        fill_factor=0.75,
        full_well_e=2.8 / VOLT_PER_E,
        read_noise_e=1e-3 / VOLT_PER_E,
        dark_current_e_per_s=1e-3 / VOLT_PER_E,
        dsnu_e=0.0,
        prnu=0.0,
    )
    lens = replace(chip.lens, f_number=4.0)
    return replace(chip, responses=Responses(curves), pixel=pixel, lens=lens, bits=16, window_nm=(395.0, 705.0))


def chart(nm: Floats) -> SpectralRadiance:
    """ColorChecker of 4 x 6 patches without borders under D65."""
    light = illuminant("D65")
    patches = np.array([patch.band_average(nm, 10.0) for _, patch in color_checker_reflectances()])
    values = (patches * light.band_average(nm, 10.0)).reshape(4, 6, -1)
    return SpectralRadiance(values.repeat(PATCH_PX, axis=0).repeat(PATCH_PX, axis=1), nm, light=light)


def at_illuminance(radiance: SpectralRadiance, sensor: SensorConfig, lux: float) -> SpectralRadiance:
    """Radiance whose image on the sensor has a mean illuminance."""
    image = form_image(radiance, sensor)
    mean = luminance(image.values, image.wavelength_nm, image.widths_nm, image.light).mean()
    return replace(radiance, values=radiance.values * (lux / mean))


def true_picture(radiance: SpectralRadiance, sensor: SensorConfig) -> Floats:
    """Picture of a camera with the RGB mosaic's responses that reads all three at each pixel, without noise."""
    planes_e = channel_electrons(form_image(radiance, sensor), sensor, EXPOSURE_S)
    neutral = neutral_electrons(sensor, light_in_bands(illuminant("D65"), NM, radiance.widths_nm), EXPOSURE_S)
    return shown((planes_e / neutral) @ calibrate(sensor, illuminant("D65")).to_srgb.T)


def shown(linear: Floats) -> Floats:
    """Encoded sRGB, of which the brightest value is 1."""
    return np.asarray(encode_srgb(np.clip(linear / linear.max(), 0.0, 1.0)))


def developed(radiance: SpectralRadiance, sensor: SensorConfig, name: str) -> Floats:
    """Picture of one exposure."""
    processor = NAMED[name]
    light = light_in_bands(illuminant("D65"), radiance.wavelength_nm, radiance.widths_nm)
    expected_e = expected_electrons(form_image(radiance, sensor), sensor, EXPOSURE_S)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(0))
    raw = read_out(expected_e, sensor, device, EXPOSURE_S, np.random.default_rng(1))
    neutral = neutral_electrons(sensor, light, EXPOSURE_S)
    linear, _ = develop_to_scale(
        raw, processor, colour_fit(sensor, processor, light), sensor, neutral, 1.0, balance=neutral
    )
    return shown(linear)


def difference(one: Floats, other: Floats) -> float:
    """Mean over pixels of the colour difference CIE 1994 (graphic arts) of encoded sRGB."""
    lab = [colour.XYZ_to_Lab(colour.sRGB_to_XYZ(picture)) for picture in (one, other)]
    return float(np.mean(colour.delta_E(*lab, method="CIE 1994")))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("isetcam", type=Path, help="folder that holds ISETCam's data")
    folder = options.parse_args().isetcam
    print(
        f"{'mean colour difference (CIE 1994) at':38}" + "".join(f"{lux:>8.3g}" for lux in LUX) + "  lux on the sensor"
    )
    for name, published in PUBLISHED.items():
        row = dict(zip((0, 2, 4), published, strict=True))
        print(
            f"{'published: ' + name:38}" + "".join(f"{row[k]:8.1f}" if k in row else " " * 8 for k in range(len(LUX)))
        )
    reference = sensor_of(folder, "bayer")
    for title, (processor, cfa) in OURS.items():
        sensor = sensor_of(folder, cfa)
        levels = []
        for lux in LUX:
            radiance = at_illuminance(chart(NM), sensor, lux)
            truth = true_picture(radiance, reference)
            levels.append(difference(developed(radiance, sensor, processor), truth))
        print(f"{title:38}" + "".join(f"{level:8.1f}" for level in levels), flush=True)


if __name__ == "__main__":
    main()
