"""Filters of other cameras: sums and densities of the own curves, and cameras that carry them."""

import numpy as np
import pytest

from isp.colour import fit_matrix, neutral_response
from render.errors import InputError
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum
from scenes.reflectances import color_checker
from sensor.cfa import MOSAICS, RGBW, channels
from sensor.curves import Responses, rgbw
from sensor.filters import complementary, matched_transmittance, neutral_density
from sensor.presets import preset
from sensor.variations import VARIATIONS, vary

NM = DEFAULT_WAVELENGTH_NM
WIDTH = np.full(NM.shape, 10.0)


def test_complementary_filters_pass_what_two_primaries_do() -> None:
    primaries = dict(zip("RGB", rgbw().band_average(("R", "G", "B"), NM, WIDTH), strict=True))
    cyan, magenta, yellow, white = complementary(rgbw()).band_average(("C", "M", "Y", "W"), NM, WIDTH)
    assert cyan == pytest.approx(primaries["G"] + primaries["B"])
    assert magenta == pytest.approx(primaries["R"] + primaries["B"])
    assert yellow == pytest.approx(primaries["R"] + primaries["G"])
    assert white == pytest.approx(rgbw().curves["W"].band_average(NM, WIDTH))
    # a filter is no brighter than none
    visible = (NM > 420) & (NM < 680)
    assert np.all(np.array([cyan, magenta, yellow])[:, visible] < white[visible])


def test_complementary_colours_lead_to_the_same_colours_as_the_primaries() -> None:
    # balanced C, Y and M are mixtures of balanced R, G and B, so the fitted matrices differ by exactly that mixture
    surfaces = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker()])
    light = illuminant("D65").band_average(NM, WIDTH)
    primary = fit_matrix(rgbw().band_average(("R", "G", "B"), NM, WIDTH), NM, light, surfaces)
    curves = complementary(rgbw())
    other = fit_matrix(curves.band_average(("C", "Y", "M"), NM, WIDTH), NM, light, surfaces)
    red, green, blue = neutral_response(("R", "G", "B"))
    mixture = np.array([[0, green, blue], [red, green, 0], [red, 0, blue]])
    mixture /= mixture.sum(axis=1, keepdims=True)
    assert other @ mixture == pytest.approx(primary, abs=1e-9)


def test_a_matched_density_gives_w_greens_electrons() -> None:
    share = matched_transmittance(rgbw())
    green, white = neutral_response(("G", "W"), neutral_density(rgbw()))
    assert white == pytest.approx(green, rel=1e-12)
    assert 1 / 7 < share < 1 / 4  # the paper: W gathers about 6 times green's light
    for letter in "RGB":
        assert neutral_density(rgbw()).curves[letter] is rgbw().curves[letter]


@pytest.mark.parametrize("name", [*MOSAICS, *VARIATIONS])
def test_a_varied_camera_keeps_everything_but_mosaic_and_filters(name: str) -> None:
    camera = preset("low_noise")
    other = vary(camera, name)
    assert (other.pixel, other.lens, other.bits, other.window_nm) == (
        camera.pixel,
        camera.lens,
        camera.bits,
        camera.window_nm,
    )
    assert other.cfa == (VARIATIONS[name][0] if name in VARIATIONS else MOSAICS[name])
    assert set(channels(other.cfa)) <= set(other.responses.curves)


def test_variations_are_named_by_what_they_change() -> None:
    assert VARIATIONS["rgbw_nd"][0] == RGBW
    assert channels(VARIATIONS["cmyw"][0]) == ("W", "C", "M", "Y")
    assert vary(preset("low_noise"), "rccc").responses.curves["C"] is rgbw().curves["W"]


def test_what_cannot_be_made_is_refused() -> None:
    with pytest.raises(InputError, match=r"cfa: 'rgbwnd' is unknown; .*did you mean 'rgbw_nd'"):
        vary(preset("low_noise"), "rgbwnd")
    with pytest.raises(InputError, match=r"responses: no curve of B; allowed: R, G, B and W; add it"):
        complementary(Responses({letter: rgbw().curves[letter] for letter in "RG"}))
    dim = Responses({"G": rgbw().curves["W"], "W": rgbw().curves["G"]})
    with pytest.raises(InputError, match=r"responses: W collects .* allowed: W more than G"):
        matched_transmittance(dim)
    bright = {letter: Spectrum(np.array([400.0, 700.0]), np.array([0.6, 0.6])) for letter in "RGB"}
    with pytest.raises(InputError, match=r"responses: C reaches 1.2 electrons a photon"):
        complementary(Responses(bright))
