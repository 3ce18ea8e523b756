"""How far electrons of chart patches are from a fine integral, by products of band averages and by weights of bands.

Run ``python benchmarks/bands.py``. For each illuminant and bands of 10 and 20 nm it prints the largest relative error
over 24 patches and R, G, B and W: of means times means, of the weights with the lamp known, and of a file of true band
means with its lamp unknown and named (`render.band_weights`, `render.bands.known_lamp`); the error that
`Transport.band_error` states beside the one found (largest channel, RMS over patches), with the lamp known and for a
file of radiance alone; and by how much the weights turn up the noise of bands whose relative errors are alike and
independent, in even light, of the patch where it is most, and of that of a file whose lamp is named.

``--render SCENE`` prints how much the weights turn up the noise that a render really has in each channel: its bands
share their paths.
"""

import argparse
from collections.abc import Mapping

import numpy as np

from render.band_weights import transport_of_light
from render.bands.error import curve_error
from render.bands.known_lamp import over_lamp
from render.bands.mixed_light import band_light
from render.engine import render
from render.illuminants import illuminant, illuminant_names
from render.radiance import SpectralRadiance
from render.scene import LightGroup
from render.spectrum import Spectrum, even_bands, photons_per_joule
from rodcone.types import Floats, Planes
from scenes.catalogue import load
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
    curves_by_name = sensor.responses.curves
    print(f"\n{width[0]:g} nm: largest error, %; RMS, %, stated and found; noise, times")
    print("             means      known   file: unknown named    known: stated found   file: stated found", end="")
    print("   even   patch   named")
    for name in illuminant_names():
        if name == "sodium_low":
            continue  # lines of 0.1 nm: the fine sum would need more points
        lamp = illuminant(name)
        light = surfaces * np.interp(NM, lamp.wavelength_nm, lamp.values, left=0.0, right=0.0)
        exact = light @ responses.T * (STEP_NM * area_m2)
        averages = np.array([Spectrum(NM, row).band_average(nm, width) for row in light])
        emission = lamp.band_average(nm, width)
        made = named(averages, nm, width, lamp)
        known, unknown = (electrons_per_irradiance(sensor, nm, width, 1.0, x) for x in (lamp, None))
        errors = [
            values @ weights.T / exact - 1
            for values, weights in (
                (surface_means * emission, plain),
                (surface_means * emission, known),
                (averages, unknown),
                (averages, made),
            )
        ]
        planes = surface_means.T.reshape(1, count, 4, 6)
        of_file = averages.T.reshape(1, count, 4, 6)
        told = [
            max(stated(spectrum, x, nm, width, curves_by_name).values())
            for spectrum, x in ((lamp, planes), (illuminant("E"), of_file))
        ]
        noise = (relative_noise(known * emission) / relative_noise(plain * emission)).max()
        of_patches = [relative_noise(row * known) / relative_noise(row * plain) for row in surface_means * emission]
        of_named = max((relative_noise(row * made) / relative_noise(row * plain)).max() for row in averages)
        largest = "   ".join(f"{100 * np.abs(error).max():8.2f}" for error in errors)
        found = [np.sqrt(np.mean(error**2, axis=0)).max() for error in errors[1:3]]
        pairs = "   ".join(f"{100 * a:7.3f} {100 * b:7.3f}" for a, b in zip(told, found, strict=True))
        print(f"{name:12} {largest}   {pairs}   {noise:7.3f} {np.max(of_patches):7.3f} {of_named:7.3f}")


def named(averages: Floats, nm: Floats, width: Floats, lamp: Spectrum) -> Floats:
    """Weights of a file's band means in each channel's electrons where its lamp is named, shape (channel, band)."""
    file = SpectralRadiance(averages[None], nm, width_nm=width)
    finer = over_lamp(file, lamp)
    if finer is None:  # an even lamp tells nothing
        return electrons_per_irradiance(low_noise(), nm, width, 1.0, None)
    of_finer = electrons_per_irradiance(low_noise(), finer.wavelength_nm, finer.widths_nm, 1.0, lamp)
    emission = lamp.band_average(finer.wavelength_nm, finer.widths_nm)
    return (of_finer * emission) @ transport_of_light(nm, width, lamp, finer.wavelength_nm, finer.widths_nm)


def stated(
    spectrum: Spectrum, planes: Planes, nm: Floats, width: Floats, curves: Mapping[str, Spectrum]
) -> dict[str, float]:
    """Return what `Transport.band_error` says of one light group."""
    lights = {"lamp": LightGroup((), spectrum)}
    light = band_light(lights, np.ones(1), nm, width)
    return curve_error(lights, light, planes, nm, width, curves)


def table_of_render(scene: str) -> None:
    """Print the noise of each channel's electrons by weights over that by products of averages, of one render."""
    sensor, (nm, width) = low_noise(), even_bands((380.0, 780.0), 20)
    transport = render(load(scene), 64, spp=32, wavelength_nm=nm, width_nm=width)
    plain = sensor.responses.band_average(sensor.channels, nm, width) * photons_per_joule(nm) * width
    print(f"{scene}, 20 nm: {', '.join(sensor.channels)}")
    for name in illuminant_names():
        even, odd = transport.relight_halves(name)
        weights = electrons_per_irradiance(sensor, nm, width, 1.0, even.light)
        noise = [relative_noise_of(even.values, odd.values, x) for x in (weights, plain)]
        print(f"{name:12} " + " ".join(f"{ratio:.4f}" for ratio in noise[0] / noise[1]))


def relative_noise_of(even: Planes, odd: Planes, weights: Floats) -> Floats:
    """RMS over pixels of half the difference of two halves' electrons, over their mean, by channel."""
    differences, means = (even - odd) @ weights.T / 2, (even + odd) @ weights.T / 2
    return np.asarray(np.sqrt(np.square(differences).mean(axis=(0, 1))) / means.mean(axis=(0, 1)))


def relative_noise(weights: Floats) -> Floats:
    """Relative error of each channel where those of the bands are independent and 1."""
    return np.asarray(np.linalg.norm(weights, axis=1) / weights.sum(axis=1))


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--render", metavar="SCENE")
    given = options.parse_args()
    if given.render:
        table_of_render(given.render)
    else:
        for bands in (20, 40):
            table(bands)
