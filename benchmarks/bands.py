"""How far electrons of chart patches are from a fine integral, by products of band averages and by weights of bands.

Run ``python benchmarks/bands.py``. For each illuminant and bands of 10 and 20 nm it prints the largest relative error
over 24 patches and R, G, B and W: of means times means, of the weights with the lamp known and unknown
(`render.band_weights`), the error that `Transport.band_error` would tell (largest channel, RMS over patches), and by
how much the weights turn up the noise of bands whose relative errors are alike and independent.
"""

import numpy as np

from render.bands.error import curve_error
from render.bands.mixed_light import band_light
from render.illuminants import illuminant, illuminant_names
from render.scene import LightGroup
from render.spectrum import Spectrum, even_bands, photons_per_joule
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances
from sensor.presets import low_noise
from sensor.response import electrons_per_irradiance

STEP_NM = 0.02
NM = np.arange(380.0, 780.0, STEP_NM) + STEP_NM / 2
PATCHES = [spectrum for _, spectrum in color_checker_reflectances()]


def table(count: int) -> None:
    """Print the table of one number of bands."""
    sensor = low_noise()
    nm, width = even_bands((380.0, 780.0), count)
    curves = [sensor.responses.curves[name] for name in sensor.channels]
    responses = np.array([np.interp(NM, x.wavelength_nm, x.values) for x in curves]) * photons_per_joule(NM)
    surfaces = np.array([np.interp(NM, x.wavelength_nm, x.values) for x in PATCHES])
    surface_means = np.array([x.band_average(nm, width) for x in PATCHES])
    area_m2 = (sensor.site_pitch_um * 1e-6) ** 2 * sensor.pixel.fill_factor
    plain = sensor.responses.band_average(sensor.channels, nm, width) * photons_per_joule(nm) * width * area_m2
    print(f"\n{width[0]:g} nm        means, %   lamp known   unknown   told (RMS)   found (RMS)   noise")
    for name in illuminant_names():
        if name == "sodium_low":
            continue  # lines of 0.1 nm: the fine sum would need more points
        lamp = illuminant(name)
        light = surfaces * np.interp(NM, lamp.wavelength_nm, lamp.values, left=0.0, right=0.0)
        exact = light @ responses.T * (STEP_NM * area_m2)
        averages = np.array([Spectrum(NM, row).band_average(nm, width) for row in light])
        emission = lamp.band_average(nm, width)
        known, unknown = (electrons_per_irradiance(sensor, nm, width, 1.0, x) for x in (lamp, None))
        errors = [
            values @ weights.T / exact - 1
            for values, weights in (
                (surface_means * emission, plain),
                (surface_means * emission, known),
                (averages, unknown),
            )
        ]
        planes = surface_means.T.reshape(1, count, 4, 6)
        lights = {"lamp": LightGroup(("lamp",), lamp)}
        light = band_light(lights, np.ones(1), nm, width)
        told = curve_error(lights, light, planes, nm, width, sensor.responses.curves)
        noise = (relative_noise(known * emission) / relative_noise(plain * emission)).max()
        largest = "   ".join(f"{100 * np.abs(error).max():8.2f}" for error in errors)
        found = np.sqrt(np.mean(errors[1] ** 2, axis=0)).max()
        print(f"{name:12} {largest}   {100 * max(told.values()):8.3f}   {100 * found:8.3f}   {noise:8.3f}")


def relative_noise(weights: Floats) -> Floats:
    """Relative error of each channel where those of the bands are independent and 1."""
    return np.asarray(np.linalg.norm(weights, axis=1) / weights.sum(axis=1))


if __name__ == "__main__":
    for bands in (20, 40):
        table(bands)
