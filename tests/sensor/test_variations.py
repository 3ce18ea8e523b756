"""Filters of other cameras: sums and densities of the own curves, and cameras that carry them."""

from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from isp.colour.colour_fit import fit_matrix
from isp.colour.white_balance import neutral_response
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, photons_per_joule, tristimulus
from rodcone.errors import InputError
from scenes.reflectances import color_checker
from sensor.cfa import MOSAICS, channels
from sensor.curves import Responses, complementary, matched_transmittance, neutral_density, read_csv, read_curve, rgbw
from sensor.photodiodes import binned
from sensor.presets import VARIATIONS, preset, vary
from studies.commands import new as new_command

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
    for channel in "RGB":
        assert neutral_density(rgbw()).curves[channel] is rgbw().curves[channel]


@loop("name", [*MOSAICS, *VARIATIONS])
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


@loop("binning", ["charge", "digital"])
def test_a_camera_that_bins_shows_no_quad(binning: str) -> None:
    camera = binned(preset("low_noise", "quad_bayer"), binning)
    assert vary(camera, "rgbw").cfa == MOSAICS["rgbw"]
    assert vary(camera, "mono").cfa == ("W",)
    for name in ("quad_bayer", "quad_rgbw"):
        refusal(vary, camera, name, match=rf"cfa: '{name}' .*that bins.* such as {name[5:]}; give that")


def test_what_cannot_be_made_is_refused() -> None:
    refusal(vary, preset("low_noise"), "rgbwnd", match=r"cfa: 'rgbwnd' is unknown; .*did you mean 'rgbw_nd'")
    with pytest.raises(InputError, match=r"responses: no curve of B; allowed: R, G, B and W; add it"):
        complementary(Responses({channel: rgbw().curves[channel] for channel in "RG"}))
    dim = Responses({"G": rgbw().curves["W"], "W": rgbw().curves["G"]})
    without = Responses({name: rgbw().curves[name] for name in "RGB"})
    refusal(neutral_density, without, match=r"responses: no curve of W; allowed: R, G, B and W; add it")
    refusal(matched_transmittance, dim, match=r"responses: W collects .* allowed: W more than G")
    bright = {channel: Spectrum(np.array([400.0, 700.0]), np.array([0.6, 0.6])) for channel in "RGB"}
    refusal(complementary, Responses(bright), match=r"responses: C reaches 1.2 electrons a photon")


SENSORS = Path(new_command.__file__).parents[1] / "configs" / "sensors"


@loop(("name", "factor"), [("narrow", 0.5), ("wide", 2.0)])
def test_narrow_and_wide_curves_keep_their_peaks_and_gather_by_the_factor(name: str, factor: float) -> None:
    fine = np.arange(385.5, 780.0)
    own, other = (
        responses.band_average(("R", "G", "B", "W"), fine, np.ones_like(fine))
        for responses in (rgbw(), read_csv(SENSORS / f"curves_{name}.csv"))
    )
    assert other.max(axis=1) == pytest.approx(own.max(axis=1), rel=0.02)  # points 4 nm apart
    assert np.abs(fine[other.argmax(axis=1)] - fine[own.argmax(axis=1)]).max() <= 2.0
    # R lies far enough from the curves' ends for its whole area to grow by the factor; G and B lose a tail at 380 nm
    assert other[0].sum() == pytest.approx(factor * own[0].sum(), rel=0.01)
    assert (other[1:3].sum(axis=1) < 1.01 * factor * own[1:3].sum(axis=1)).all()
    np.testing.assert_allclose(other[3], own[3], atol=1e-4)


def test_colorimetric_curves_collect_in_proportion_to_xyz_under_any_light() -> None:
    curves = read_csv(SENSORS / "curves_xyz.csv")
    nm = np.arange(380.5, 780.0)
    width = np.ones_like(nm)
    found = []
    for light in ("D65", "A"):
        watts = illuminant(light).band_average(nm, width)
        electrons = curves.band_average(("R", "G", "B"), nm, width) @ (watts * photons_per_joule(nm))
        found.append(electrons / tristimulus(watts, nm, width))
    np.testing.assert_allclose(found[1], found[0], rtol=2e-3)  # points 4 nm apart, six places


def test_open_dyes_leave_the_visible_alone_and_meet_silicon_beyond() -> None:
    opened = read_csv(SENSORS / "curves_infrared_open.csv")
    visible, beyond = np.arange(400.0, 680.0, 4.0), np.arange(832.0, 1060.0, 4.0)
    for channel in "RGB":
        own, now = (
            np.interp(visible, one.curves[channel].wavelength_nm, one.curves[channel].values)
            for one in (rgbw(), opened)
        )
        np.testing.assert_allclose(now, own, atol=2e-3)  # 1 / (1 + exp(80 / 12)) is 0.0013
        far, silicon = (
            np.interp(beyond, opened.curves[x].wavelength_nm, opened.curves[x].values) for x in (channel, "W")
        )
        np.testing.assert_allclose(far, silicon, rtol=4e-3)  # 1 / (1 + exp(-70 / 12)) is 0.9971


def test_the_filter_keeps_the_infrared_out_and_half_of_660_nm() -> None:
    curve = read_curve(SENSORS / "infrared_filter.csv")
    np.testing.assert_allclose(curve.values, 1 / (1 + np.exp((curve.wavelength_nm - 660.0) / 5.0)), atol=6e-7)


def test_the_sensors_of_examples_are_low_noise_but_for_their_curves_and_window() -> None:
    own = preset("low_noise")
    cameras = {
        name: preset(SENSORS / f"{name}.toml") for name in ("narrow", "wide", "xyz", "with_filter", "without_filter")
    }
    for camera in cameras.values():
        assert (camera.pixel, camera.lens, camera.bits, camera.cfa) == (own.pixel, own.lens, own.bits, own.cfa)
    # W behind the filter, by the product of curve and transmittance on the points of both
    nm = np.array([500.0, 640.0, 660.0, 680.0, 900.0])
    kept, all_of_it = (
        np.interp(nm, cameras[name].responses.curves["W"].wavelength_nm, cameras[name].responses.curves["W"].values)
        for name in ("with_filter", "without_filter")
    )
    np.testing.assert_allclose(kept / all_of_it, 1 / (1 + np.exp((nm - 660) / 5)), atol=1e-5)
