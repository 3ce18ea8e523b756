"""A photograph with every processor: on a known grey and on colours, all show the scene's own numbers."""

from dataclasses import replace
from pathlib import Path

import colour
import numpy as np
import pytest
from builders import require_library
from refusal import refusal

from isp.colour.colour_fit import ColourFit, fit_matrix
from isp.colour.white_balance import neutral_response
from isp.processors.catalogue import NAMED, default_processor
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import (
    DEFAULT_WAVELENGTH_NM,
    Spectrum,
    band_widths,
    colour_matching_functions,
    flat,
    line_spectrum,
    tristimulus,
)
from rodcone.colour_spaces import encode_srgb
from scenes.reflectances import color_checker_reflectances
from sensor.capture import expose, photograph_radiance
from sensor.cfa import MOSAICS
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import low_noise, vary
from sensor.raw import RawImage
from sensor.raw_files.raw_file import write_raw
from sensor.response import expected_electrons
from studies.metrics.truth import light_in_bands, neutral_electrons, true_srgb
from studies.photograph.camera import balance_delta_e, calibrate, colour_fit, develop_to_scale
from studies.photograph.develop import develop, develop_file
from studies.study.gain import iso_speed

NM = DEFAULT_WAVELENGTH_NM
FINE_NM = np.arange(380.5, 780.0)
WIDTH = band_widths(NM)
LIGHT = light_in_bands(illuminant("D65"), NM, WIDTH)
# Mosaics without R, G and B tell other colours, or none: tests/isp/processors/test_catalogue.py
QUICK = [name for name, processor in NAMED.items() if processor.extra != "bm3d" and processor.colours]
SIDE = 16  # pixels of a patch


EXPOSURE_S = 0.025  # W collects 10 600 of its 15 000 e- from a perfect white


def chart(reflectances: np.ndarray) -> SpectralRadiance:
    """Patches (4, 6, band) under D65, 100 cd/m^2 from a perfect white."""
    values = 100.0 * np.repeat(np.repeat(reflectances, SIDE, axis=0), SIDE, axis=1) * LIGHT.spectrum
    return SpectralRadiance(values, NM)


def patches(name: str, radiance: SpectralRadiance, view_deg: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Mean colour of each patch as the camera shows it, and the right one, (4, 6, 3), encoded."""
    processor = NAMED[name]
    sensor = vary(low_noise(), processor.mosaic)
    if view_deg:
        sensor = replace(sensor, lens=replace(sensor.lens, horizontal_view_deg=view_deg))
    device = draw_device(sensor, radiance.shape, np.random.default_rng(0))
    expected = expected_electrons(form_image(radiance, sensor), sensor, EXPOSURE_S)
    raw = expose(expected, sensor, EXPOSURE_S, device, np.random.default_rng(1), exact=True)
    assert not raw.saturated.any()
    colours = colour_fit(sensor, processor, LIGHT)
    neutral = neutral_electrons(sensor, LIGHT, EXPOSURE_S)
    linear, picture = develop_to_scale(raw, processor, colours, sensor, neutral, 100.0)
    assert picture.rgb.shape == linear.shape
    truth = encode_srgb(true_srgb(radiance, LIGHT, 100.0))
    inside = slice(4, -4)
    shown, right = (
        picture.reshape(4, SIDE, 6, SIDE, 3).swapaxes(1, 2)[:, :, inside, inside]
        for picture in (encode_srgb(linear), truth)
    )
    return shown.mean((2, 3)), right.mean((2, 3))


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", QUICK)
def test_every_camera_shows_greys_at_their_own_level(name: str) -> None:
    require_library(name)
    greys = np.broadcast_to(np.linspace(0.05, 0.9, 24).reshape(4, 6, 1), (4, 6, NM.size))
    shown, right = patches(name, chart(greys))
    # The darkest patch has 126 e- in green and 16 samples of a colour: 2.2 % of linear light, half of that encoded,
    # times 2 in the matrix of R, G and B or 4 in that of C, Y and M, and 3.5 sigma for the largest of 72: 15 %. On
    # average over the greys a fifth of it. A unit mixed up, such as green's for yellow's, would be 20 % everywhere.
    assert np.abs(shown / right - 1).max() < 0.15
    assert np.abs(shown / right - 1).mean() < 0.02


def test_the_falloff_that_a_lens_is_known_to_have_is_corrected() -> None:
    """At 60 degrees the corners get less than half of the light: cos^4 of 35 degrees is 0.45."""
    for name in ["interleaved", "bayer"]:
        greys = np.full((4, 6, NM.size), 0.5)
        shown, right = patches(name, chart(greys), view_deg=60.0)
        assert np.abs(shown / right - 1).max() < 0.15, name  # as above
        assert np.abs(shown / right - 1).mean() < 0.02, name


# A matrix that knows its noise shows them paler where the planes' error is large, by intent.
@pytest.mark.sample(4)
@pytest.mark.parametrize("name", [name for name in QUICK if NAMED[name].noise_gains is None])
def test_every_camera_shows_the_colour_checkers_colours(name: str) -> None:
    require_library(name)
    surfaces = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker_reflectances()])
    shown, right = patches(name, chart(surfaces.reshape(4, 6, -1)))
    hues = [(one - one.mean(-1, keepdims=True)).ravel() for one in (shown, right)]
    # Gray World on a chart that isn't grey shifts all of them; a matrix with its columns mixed up turns them
    assert np.corrcoef(*hues)[0, 1] > 0.9


def test_the_balances_error_is_the_cast_that_it_gives_a_grey_card() -> None:
    """Gray World makes an even red field grey: a grey card then lacks as much red, and as shot nothing is wrong."""
    for tint in [1.0, 1.6]:
        sensor = vary(low_noise(), "bayer")
        neutral = neutral_electrons(sensor, LIGHT, EXPOSURE_S) * 40.0
        expected = np.full((64, 64), neutral[1])
        expected[::2, ::2], expected[1::2, 1::2] = neutral[0] * tint, neutral[2]
        assert sensor.cfa == ("RG", "GB"), tint
        quiet = replace(sensor, pixel=replace(sensor.pixel, crosstalk=0.0, prnu=0.0))
        device = draw_device(quiet, (64, 64), np.random.default_rng(0))
        raw = expose(expected, quiet, EXPOSURE_S, device, np.random.default_rng(1), exact=True)
        assert not raw.saturated.any(), tint
        colours = ColourFit.of(np.eye(3))  # channels as they are
        card = 0.18 * np.array([1 / tint, 1.0, 1.0])
        white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
        lab = colour.XYZ_to_Lab(colour.RGB_to_XYZ([card, np.full(3, 0.18)], "sRGB"), white)
        # 1024 samples a channel of 1000 e- and more are known to 0.1 %, some 0.1 of CIEDE2000
        assert balance_delta_e(raw, colours, quiet, LIGHT) == pytest.approx(
            colour.delta_E(*lab, method="CIE 2000"), abs=0.2
        ), tint
        assert balance_delta_e(raw, colours, quiet, LIGHT, neutral) == pytest.approx(0.0, abs=1e-3), tint


# Colour calibration: identities of DNG's matrices, a camera whose matrices are known on paper, the speed.

D50 = [0.9642, 1.0, 0.8249]  # ICC.1:2010, connection space


def white_xyz(light: str) -> np.ndarray:
    xyz = tristimulus(illuminant(light).band_average(NM, WIDTH), NM, WIDTH)
    return np.asarray(xyz / xyz[1])


def camera(curves: dict[str, Spectrum], cfa: tuple[str, ...] = ("RG", "GB")) -> SensorConfig:
    return replace(low_noise(), cfa=cfa, responses=Responses(curves))


def observer() -> SensorConfig:
    """Camera whose R, G, B count energy through the CIE 1931 observer: its signals are XYZ over one factor."""
    curves = {}
    for channel, curve in zip("RGB", colour_matching_functions(), strict=True):
        curves[channel] = Spectrum(curve.wavelength_nm, 0.1 * curve.values * 360.0 / curve.wavelength_nm)
    return camera(curves)


def test_colour_matrices_take_each_illuminants_white_to_its_neutral() -> None:
    for cfa in ["bayer", "rgbw"]:
        colours = calibrate(low_noise(cfa), illuminant("D50"))
        neutral_d65 = neutral_response("RGBW"[: len(colours.neutral)])
        assert colours.xyz_to_camera_d65 @ white_xyz("D65") == pytest.approx(neutral_d65 / neutral_d65[1], rel=1e-4), (
            cfa
        )
        under_a = calibrate(low_noise(cfa), illuminant("A")).neutral
        assert colours.xyz_to_camera_a @ white_xyz("A") == pytest.approx(under_a, rel=1e-5), cfa
        assert abs(under_a[2] / neutral_d65[2] * neutral_d65[1] - 1) > 0.3, cfa  # lamp light holds much less blue


def test_forward_matrices_take_a_balanced_neutral_to_d50() -> None:
    for cfa in ["bayer", "rgbw"]:
        colours = calibrate(low_noise(cfa), illuminant("D65"))
        for matrix in (colours.camera_to_xyz_a, colours.camera_to_xyz_d65):
            assert matrix.sum(axis=1) == pytest.approx(D50, rel=1e-12), cfa
        if cfa == "rgbw":
            assert not colours.camera_to_xyz_d65[:, 3].any(), cfa  # W carries no colour


def test_as_shot_values_are_those_of_the_light_asked_for() -> None:
    sensor = low_noise("bayer")
    surfaces = np.array([curve.band_average(FINE_NM, 1.0) for _, curve in color_checker_reflectances()])
    for name in ("A", "D65", "moonlight"):
        colours = calibrate(sensor, illuminant(name))
        responses = sensor.responses.band_average(("R", "G", "B"), FINE_NM, 1.0)
        expected = fit_matrix(responses, FINE_NM, illuminant(name).band_average(FINE_NM, 1.0), surfaces)
        assert colours.to_srgb == pytest.approx(expected, abs=2e-4)  # bands of 10 nm beside 1 nm


def test_a_camera_that_is_the_observer_has_identity_matrices() -> None:
    colours = calibrate(observer(), illuminant("D65"))
    for matrix in (colours.xyz_to_camera_a, colours.xyz_to_camera_d65):
        assert matrix == pytest.approx(np.eye(3), abs=1e-4)
    assert colours.neutral == pytest.approx(white_xyz("D65"), rel=1e-4)


def test_the_row_of_white_is_the_least_squares_fit_that_keeps_a_neutral() -> None:
    """Solved again with a Lagrange multiplier, in XYZ."""
    colours = calibrate(low_noise("rgbw"), illuminant("D65"))
    ones = np.ones_like(FINE_NM)
    surfaces = np.array([curve.band_average(FINE_NM, 1.0) for _, curve in color_checker_reflectances()])
    light = illuminant("D65").band_average(FINE_NM, 1.0)
    white = white_xyz("D65")
    xyz = tristimulus(surfaces * light, FINE_NM, ones) / tristimulus(light, FINE_NM, ones)[1]
    collected = low_noise("rgbw").responses.band_average(("W",), FINE_NM, 1.0)[0] * FINE_NM * light
    signal = surfaces @ collected / collected.sum()
    system = np.block([[xyz.T @ xyz, white[:, None]], [white[None, :], np.zeros((1, 1))]])
    row = np.linalg.solve(system, np.append(xyz.T @ signal, 1.0))[:3]
    assert colours.xyz_to_camera_d65[3] / colours.neutral[3] == pytest.approx(row, abs=1e-4)


def test_the_cameras_window_counts() -> None:
    cut = replace(low_noise("bayer"), window_nm=(380.0, 600.0))  # takes half of red away
    whole, without = calibrate(low_noise("bayer"), illuminant("E")), calibrate(cut, illuminant("E"))
    assert without.neutral[0] < 0.7 * whole.neutral[0]
    assert without.neutral[2] == pytest.approx(whole.neutral[2], rel=0.05)


def test_speed_is_78_over_the_exposure_that_fills_the_well() -> None:
    sensor = replace(
        camera(dict.fromkeys("RGB", flat())),
        window_nm=(395.0, 705.0),  # what sums at 400, 410, ... 700 nm stand for
    )
    area_um2 = 2.2**2 * 0.9
    # 1 lx of D65 is 1.114e4 photons um^-2 s^-1 by such sums, whose luminance lacks 0.1 % beyond
    assert iso_speed(sensor) == pytest.approx(78 * 1.114e4 * area_um2 / 15_000, rel=3e-3)
    dull = replace(sensor, lens=replace(sensor.lens, transmittance=0.5, f_number=8.0))
    assert iso_speed(dull) == pytest.approx(iso_speed(sensor), rel=1e-12)  # it is counted at the sensor


@pytest.mark.parametrize("lines_nm", [(589.3,), (499.9, 510.1), (656.3,)])
def test_under_a_line_or_two_all_is_nearly_grey(lines_nm: tuple[float, ...]) -> None:
    calibration = calibrate(low_noise(), line_spectrum(lines_nm, np.ones(len(lines_nm))))
    share = calibration.neutral[:3] / calibration.neutral[:3].sum()  # a channel counts by its electrons
    assert np.abs(calibration.to_srgb - share).max() < 0.011
    assert np.linalg.cond(calibration.to_srgb) < 1000
    calibrate(low_noise(), illuminant("sodium_high"))


def test_what_cannot_be_calibrated_is_refused() -> None:
    blind = {"R": flat(), "G": flat(0.5), "B": Spectrum(np.array([900.0, 950.0]), np.array([1.0, 1.0]))}
    refusal(calibrate, camera(blind), illuminant("D65"), match=r"responses: B collects nothing under the light")
    refusal(
        calibrate,
        camera(dict.fromkeys("RGB", flat())),
        illuminant("D65"),
        match=r"responses: R, G, B can't tell colours apart",
    )


# A raw image developed from Python: with its own colours or given ones, by the paper's processor for its mosaic.


def raw_of(cfa: str) -> RawImage:

    nm = np.arange(385.0, 780.0, 10.0)
    spectrum = illuminant("D65").band_average(nm, np.full(nm.size, 10.0))
    radiance = SpectralRadiance(np.broadcast_to(20 * spectrum, (24, 28, nm.size)).copy(), nm)
    sensor = low_noise(cfa)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    raw = photograph_radiance(radiance, sensor, 0.01, device, np.random.default_rng(2), exact=True)
    return replace(raw, colour=calibrate(sensor, illuminant("D65")))


def test_a_grey_wall_is_grey_by_the_raw_image_s_own_colours_and_by_given_ones() -> None:
    for cfa in ("rgbw", "bayer"):
        raw = raw_of(cfa)
        picture = develop(raw)
        assert np.array_equal(picture.rgb, develop(replace(raw, colour=None), raw.colour).rgb), cfa
        mean = picture.rgb.mean(axis=(0, 1))
        assert mean == pytest.approx(np.full(3, mean[1]), rel=0.02), cfa


def test_where_no_processor_is_named_every_mosaic_is_developed_by_the_same_method() -> None:
    """By `ple`; a tile that it doesn't take still has colours, by `any_mosaic`."""
    for cfa in ("bayer", "rgbw", "quad_rgbw"):
        raw = raw_of(cfa)
        assert np.array_equal(develop(raw).rgb, develop(raw, processor="ple").rgb), cfa
    raw = raw_of("ryyb")
    assert np.array_equal(develop(raw).rgb, develop(raw, processor="any_mosaic").rgb)
    six_wide = ("RGBWRG", "BWRGBW")
    assert [default_processor(tile) for tile in (*MOSAICS.values(), six_wide)] == [
        "ple" if set("".join(tile)) <= set("RGBW") and len(tile[0]) in (1, 2, 4) else "any_mosaic"
        for tile in (*MOSAICS.values(), six_wide)
    ]


def test_what_is_missing_or_unknown_is_said_in_one_line() -> None:
    raw = raw_of("bayer")
    for arguments, told in (
        ({"raw": replace(raw, colour=None)}, r"no colour calibration; .* calibrate\(sensor, illuminant\('D65'\)\)"),
        ({"raw": raw, "processor": "bayerr"}, "'bayerr' is unknown; .*did you mean 'bayer'"),
        ({"raw": raw, "processor": "bayer_menon_fair"}, "did you mean 'bayer_menon'"),
        ({"raw": raw, "processor": "bayer_fair"}, "is gone; .*; use bayer_bilinear"),
        ({"raw": raw, "white_balance": "none"}, "white_balance: 'none' is unknown"),
        ({"raw": raw, "calibration": raw_of("rgbw").colour}, "colour: 4 channels don't fit the mosaic's"),
    ):
        refusal(develop, **arguments, match=told)  # type: ignore[arg-type]


def test_as_shot_is_the_default_from_python_too(tmp_path: Path) -> None:
    raw = raw_of("bayer")
    raw = replace(raw, colour=calibrate(low_noise("bayer"), illuminant("A")))  # set to a lamp, taken in daylight
    default, gray = develop(raw), develop(raw, white_balance="gray-world")
    assert np.array_equal(default.rgb, develop(raw, white_balance="as-shot").rgb)
    blue, grey = (picture.rgb.mean(axis=(0, 1)) for picture in (default, gray))
    assert blue[2] > 1.5 * blue[0]
    assert grey == pytest.approx(np.full(3, grey[1]), rel=0.02)
    write_raw(raw, tmp_path / "shot.dng")
    assert set(develop_file(tmp_path / "shot.dng").facts["balance"].values()) == {"given"}
