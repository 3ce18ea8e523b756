"""Colour calibration: identities of DNG's matrices, a camera whose matrices are known on paper, the speed."""

from dataclasses import replace

import numpy as np
import pytest

from isp.colour.colour_fit import fit_matrix
from isp.colour.white_balance import neutral_response
from render.illuminants import illuminant
from render.photometry import colour_matching_functions, tristimulus
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths, flat
from rodcone.errors import InputError
from scenes.reflectances import color_checker
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.presets import low_noise
from studies.photograph.camera import calibrate, iso_speed

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
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
        assert colours.xyz_to_camera_d65 @ white_xyz("D65") == pytest.approx(neutral_d65 / neutral_d65[1], rel=1e-12), (
            cfa
        )
        under_a = calibrate(low_noise(cfa), illuminant("A")).neutral
        assert colours.xyz_to_camera_a @ white_xyz("A") == pytest.approx(under_a, rel=1e-12), cfa
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
    surfaces = np.array([curve.band_average(NM, WIDTH) for _, curve in color_checker()])
    for name in ("A", "D65", "moonlight"):
        colours = calibrate(sensor, illuminant(name))
        responses = sensor.responses.band_average(("R", "G", "B"), NM, WIDTH)
        expected = fit_matrix(responses, NM, illuminant(name).band_average(NM, WIDTH), surfaces)
        assert colours.to_srgb == pytest.approx(expected, rel=1e-9)


def test_a_camera_that_is_the_observer_has_identity_matrices() -> None:
    colours = calibrate(observer(), illuminant("D65"))
    # products of band means stand for means of products over 10 nm: up to 0.3 % at the edges of x and z
    for matrix in (colours.xyz_to_camera_a, colours.xyz_to_camera_d65):
        assert matrix == pytest.approx(np.eye(3), abs=5e-3)
    assert colours.neutral == pytest.approx(white_xyz("D65"), rel=2e-3)


def test_the_row_of_white_is_the_least_squares_fit_that_keeps_a_neutral() -> None:
    """Solved again with a Lagrange multiplier, in XYZ."""
    colours = calibrate(low_noise("rgbw"), illuminant("D65"))
    surfaces = np.array([curve.band_average(NM, WIDTH) for _, curve in color_checker()])
    light = illuminant("D65").band_average(NM, WIDTH)
    white = white_xyz("D65")
    xyz = tristimulus(surfaces * light, NM, WIDTH) / tristimulus(light, NM, WIDTH)[1]
    collected = low_noise("rgbw").responses.band_average(("W",), NM, WIDTH)[0] * NM * light
    signal = surfaces @ collected / collected.sum()
    system = np.block([[xyz.T @ xyz, white[:, None]], [white[None, :], np.zeros((1, 1))]])
    row = np.linalg.solve(system, np.append(xyz.T @ signal, 1.0))[:3]
    assert colours.xyz_to_camera_d65[3] / colours.neutral[3] == pytest.approx(row, rel=1e-9)


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


def test_what_cannot_be_calibrated_is_refused() -> None:
    blind = {"R": flat(), "G": flat(0.5), "B": Spectrum(np.array([900.0, 950.0]), np.array([1.0, 1.0]))}
    with pytest.raises(InputError, match=r"responses: B collects nothing under the light"):
        calibrate(camera(blind), illuminant("D65"))
    with pytest.raises(InputError, match=r"responses: R, G, B can't tell colours apart"):
        calibrate(camera(dict.fromkeys("RGB", flat())), illuminant("D65"))
