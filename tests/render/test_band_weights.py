"""Integrals over bands against closed forms and fine sums: chart patches under every lamp, several lamps at once."""

import numpy as np
import pytest
from builders import transport_of
from loop import loop

from render.band_weights import band_weights, transport_of_light
from render.bands.error import curve_error
from render.bands.known_lamp import over_lamp
from render.bands.mixed_light import band_light
from render.engine import render
from render.illuminants import illuminant, illuminant_names
from render.radiance import SpectralRadiance
from render.scene import LightGroup
from render.spectrum import LUMINOUS_EFFICACY_LM_W, Spectrum, even_bands, line_spectrum, observer, tristimulus
from scenes.catalogue import load
from scenes.reflectances import color_checker_reflectances
from sensor.presets import low_noise
from sensor.response import electrons_per_irradiance

STEP_NM = 0.02
FINE_NM = np.arange(380.0, 780.0, STEP_NM) + STEP_NM / 2
PATCHES = [spectrum for _, spectrum in color_checker_reflectances()]
REFLECTANCES = np.array([np.interp(FINE_NM, x.wavelength_nm, x.values) for x in PATCHES])
SENSOR = low_noise()
CURVES = [SENSOR.responses.curves[name] for name in SENSOR.channels]
PHOTONS = np.array([np.interp(FINE_NM, x.wavelength_nm, x.values) * FINE_NM for x in CURVES])
# Largest errors allowed at 20 nm: smooth light, fluorescent tubes and three LEDs, lamps of lines.
MOST = {"D65": 2e-3, "A": 2e-3, "LED-B3": 2e-3, "F2": 5e-3, "LED-RGB1": 5e-3, "F11": 25e-3, "sodium_high": 25e-3}


def fine(name):
    lamp = illuminant(name)
    return np.interp(FINE_NM, lamp.wavelength_nm, lamp.values, left=0.0, right=0.0)


def means(nm, width):
    return np.array([patch.band_average(nm, width) for patch in PATCHES])


@loop(("name", "most"), list(MOST.items()))
def test_electrons_of_20_nm_bands_are_those_of_a_fine_integral(name, most):
    nm, width = even_bands((380.0, 780.0), 20)
    lamp = illuminant(name)
    weights = electrons_per_irradiance(SENSOR, nm, width, 1.0, lamp)
    made = (means(nm, width) * lamp.band_average(nm, width)) @ weights.T
    exact = np.einsum("px,cx,x->pc", REFLECTANCES, PHOTONS, fine(name), optimize=True)
    ratio = made / exact
    assert np.abs(ratio / np.median(ratio) - 1).max() < most
    assert weights.min() >= 0


@loop(("name", "most"), [("D65", 1e-3), ("A", 2e-3), ("LED-B3", 5e-3), ("F11", 6e-2)])
def test_xyz_of_light_that_is_known_by_its_bands_alone_is_the_smooth_ones(name, most):
    nm, width = even_bands((380.0, 780.0), 20)
    lamp = Spectrum(FINE_NM, fine(name))
    light = np.array([Spectrum(FINE_NM, patch * lamp.values).band_average(nm, width) for patch in REFLECTANCES[:6]])
    exact = LUMINOUS_EFFICACY_LM_W * np.einsum("px,cx->pc", REFLECTANCES[:6] * lamp.values, observer(FINE_NM)) * STEP_NM
    made = tristimulus(light, nm, width)
    assert np.abs(made / exact - 1)[:, :2].max() < most


@loop(("name", "most"), list(MOST.items()))
def test_electrons_of_a_file_of_true_band_means_are_those_of_a_fine_integral_once_its_lamp_is_named(name, most):
    nm, width = even_bands((380.0, 780.0), 20)
    made = over_lamp(SpectralRadiance(true_means(name, nm, width), nm, width_nm=width), illuminant(name))
    lit = transport_of(np.moveaxis(made.values, -1, 0)[None], {"x": LightGroup(("x",), illuminant(name))},
                       made.wavelength_nm, made.widths_nm).relight()  # fmt: skip
    weights = electrons_per_irradiance(SENSOR, lit.wavelength_nm, lit.widths_nm, 1.0, lit.light)
    exact = np.einsum("px,cx,x->pc", REFLECTANCES, PHOTONS, fine(name), optimize=True)
    ratio = lit.values[0] @ weights.T / exact
    assert np.abs(ratio / np.median(ratio) - 1).max() < most / 2
    # Noise of bands whose relative errors are alike and independent, over that of products of averages.
    emission = illuminant(name).band_average(lit.wavelength_nm, lit.widths_nm)
    of_file = (weights * emission) @ transport_of_light(nm, width, illuminant(name), lit.wavelength_nm, lit.widths_nm)
    plain = SENSOR.responses.band_average(SENSOR.channels, nm, width) * nm
    for row in true_means(name, nm, width)[0]:
        assert (relative_noise(row * of_file) / relative_noise(row * plain)).max() < 1.055


def true_means(name, nm, width):
    lamp = fine(name)
    edges = np.searchsorted(FINE_NM, nm - width / 2)
    return np.add.reduceat(REFLECTANCES * lamp, edges, axis=1)[None] * STEP_NM / width


def relative_noise(terms):
    return np.linalg.norm(terms, axis=1) / terms.sum(axis=1)


@loop(("lamps", "most"), [(("D65", "A"), 2e-3), (("A", "LED-B3"), 2e-3), (("F2", "LED-RGB1"), 6e-3),
                          (("LED-B3", "sodium_high"), 25e-3)])  # fmt: skip
def test_each_light_group_keeps_its_own_light_within_the_bands(lamps, most):
    """Pixels of other patches under other shares of two lamps, relit together."""
    nm, width = even_bands((380.0, 780.0), 20)
    rng, shape = np.random.default_rng(4), (4, 6)
    shares = rng.random((2, *shape)) ** 3
    patches = [np.arange(24).reshape(shape), np.roll(np.arange(24), 7).reshape(shape)]
    planes = np.stack(
        [np.moveaxis(means(nm, width)[patch], -1, 0) * share for patch, share in zip(patches, shares, strict=True)]
    )
    groups = {name: LightGroup((name,), illuminant(name)) for name in lamps}
    made = transport_of(planes.astype(np.float32), groups, nm, width).relight()
    exact = sum(
        share[..., None] * np.einsum("hwx,cx,x->hwc", REFLECTANCES[patch], PHOTONS, fine(name), optimize=True)
        for name, patch, share in zip(lamps, patches, shares, strict=True)
    )
    ratio = made.values @ electrons_per_irradiance(SENSOR, nm, width, 1.0, made.light).T / exact
    assert np.abs(ratio / np.median(ratio) - 1).max() < most
    xyz = sum(
        share[..., None] * np.einsum("hwx,cx,x->hwc", REFLECTANCES[patch], observer(FINE_NM), fine(name), optimize=True)
        for name, patch, share in zip(lamps, patches, shares, strict=True)
    )
    seen = tristimulus(made.values, nm, width, made.light) / (xyz * LUMINOUS_EFFICACY_LM_W * STEP_NM)
    assert np.abs(seen[..., :2].mean(axis=(0, 1)) - 1).max() < most


@loop("name", illuminant_names())
@loop("count", [20, 40])
def test_weights_turn_the_noise_of_a_render_up_by_5_percent_at_most(name, count):
    """Beside products of averages, whose bands have independent relative errors of one size."""
    nm, width = even_bands((380.0, 780.0), count)
    lamp = illuminant(name)
    emission = lamp.band_average(nm, width)
    plain = SENSOR.responses.band_average(SENSOR.channels, nm, width) * nm * width * emission
    weights = electrons_per_irradiance(SENSOR, nm, width, 1.0, lamp) * emission
    noise, of_plain = (np.linalg.norm(x, axis=1) / x.sum(axis=1) for x in (weights, plain))
    assert (noise / of_plain).max() < 1.052  # the response's average is here without the photon energy's within a band
    assert weights.min() >= 0


@pytest.mark.thorough
@pytest.mark.parametrize("scene", ["cornell_box", "still_life"])
def test_weights_turn_the_noise_that_a_render_has_up_by_1_percent_at_most(scene):
    """Its bands share their paths: errors of neighbours go together, and their weights' spread hardly counts."""
    nm, width = even_bands((380.0, 780.0), 20)
    transport = render(load(scene), 48, spp=16, wavelength_nm=nm, width_nm=width)
    plain = SENSOR.responses.band_average(SENSOR.channels, nm, width) * nm * width
    for name in illuminant_names():
        even, odd = transport.relight_halves(name)
        weights = electrons_per_irradiance(SENSOR, nm, width, 1.0, even.light)
        noise, of_plain = (
            np.sqrt(np.square((even.values - odd.values) @ x.T).mean(axis=(0, 1)))
            / ((even.values + odd.values) @ x.T).mean(axis=(0, 1))
            for x in (weights, plain)
        )
        assert np.abs(noise / of_plain - 1).max() < 0.01, name


@loop("name", list(MOST))
@loop("count", [20, 40])
def test_the_error_that_is_told_is_what_a_fine_integral_finds(name, count):
    """RMS over patches; told are expectations, for surfaces as rough as these, within a factor of 3."""
    nm, width = even_bands((380.0, 780.0), count)
    lamp = illuminant(name)
    planes = means(nm, width).T.reshape(1, count, 4, 6)
    lights = {"lamp": LightGroup(("lamp",), lamp)}
    told = curve_error(lights, band_light(lights, np.ones(1), nm, width), planes, nm, width, SENSOR.responses.curves)
    weights = electrons_per_irradiance(SENSOR, nm, width, 1.0, lamp)
    exact = np.einsum("px,cx,x->pc", REFLECTANCES, PHOTONS, fine(name), optimize=True)
    ratio = (means(nm, width) * lamp.band_average(nm, width)) @ weights.T / exact
    found = np.sqrt(np.mean((ratio / np.median(ratio) - 1) ** 2, axis=0))
    for channel, off in zip(SENSOR.channels, found, strict=True):
        assert off / 3 - 2e-5 < told[channel] < 3 * off + 2e-5


def test_a_line_is_weighed_where_it_lies_on_surfaces_that_rise_evenly():
    """A line at 507 nm, transport that rises from band to band: its value there counts, not the band's mean."""
    nm, width = even_bands((400.0, 700.0), 15)
    rising = 1.0 + 0.004 * (nm - 550.0)
    lamp = line_spectrum([507.0], [2.0])
    together = Spectrum(np.array([300.0, 506.9, 507.0, 507.1, 900.0]), np.array([1e-4, 1e-4, 1.0, 1e-4, 1e-4]))
    ones = lambda at: np.ones((1, at.size))  # noqa: E731
    alone = band_weights(ones, np.zeros(0), nm, width, lamp)[0]
    assert alone @ lamp.band_average(nm, width) == pytest.approx(2.0, rel=1e-9)
    weights = band_weights(ones, np.zeros(0), nm, width, together)[0]
    exact = 0.1 * (1 + 0.004 * -43) + 1e-4 * 300.0  # the line, and what is even beside it
    assert weights @ (rising * together.band_average(nm, width)) == pytest.approx(exact, rel=1e-3)


def test_a_narrow_band_of_unknown_light_keeps_to_itself():
    edges = np.array([380.0, 500.0, 501.0, 780.0])
    nm, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    ramp = lambda at: at[None]  # noqa: E731
    weights = band_weights(ramp, np.zeros(0), nm, width)[0]
    assert weights == pytest.approx(nm * width, rel=1e-12)


@loop("count", [20, 40])
@loop("with_sky", [False, True])
def test_a_lamp_of_lines_in_wide_bands_shows_surfaces_at_its_lines(count, with_sky):
    """Low-pressure sodium alone: its dark bands tell what surfaces do beside 589 nm; and beside a sky of D65."""
    nm, width = even_bands((380.0, 780.0), count)
    lamp = illuminant("sodium_low")
    planes = means(nm, width).T.reshape(1, count, 4, 6).repeat(2, axis=0)
    groups = {"lamp": LightGroup(("lamp",), lamp), "sky": LightGroup(("sky",), illuminant("D65"), float(with_sky))}
    made = transport_of(planes.astype(np.float32), groups, nm, width)
    lit = made.relight()
    at = np.linspace(588.9, 589.7, 8001)
    surfaces = np.array([np.interp(at, x.wavelength_nm, x.values) for x in PATCHES])
    line = np.interp(at, lamp.wavelength_nm, lamp.values, left=0.0, right=0.0)
    photons = np.array([np.interp(at, x.wavelength_nm, x.values) * at for x in CURVES])
    exact = np.einsum("px,cx,x->pc", surfaces, photons, line) * (at[1] - at[0])
    if with_sky:
        exact += np.einsum("px,cx,x->pc", REFLECTANCES, PHOTONS, fine("D65"), optimize=True) * STEP_NM
    ratio = lit.values.reshape(24, count) @ electrons_per_irradiance(SENSOR, nm, width, 1.0, lit.light).T / exact
    off = ratio / np.median(ratio) - 1
    told = made.band_error(responses=SENSOR.responses.curves)
    found = np.sqrt(np.mean(off**2, axis=0))
    # Together at 10 nm the line lies at a band's edge, and curves no narrower than a band tell where: one patch.
    most = {(20, False): 0.014, (40, False): 0.006, (20, True): 0.016, (40, True): 0.03}[count, with_sky]
    assert np.abs(off).max() < most
    for channel, rms in zip(SENSOR.channels, found, strict=True):
        assert rms / 3 < told[channel] < 3 * rms
    assert lit.values.min() >= 0
