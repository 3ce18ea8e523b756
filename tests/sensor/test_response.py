"""Expected photo-electrons in closed form."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from render.spectrum import Spectrum, flat
from rodcone.errors import InputError
from sensor import response
from sensor.capture import photograph_radiance
from sensor.cfa import BAYER, RGBW, mask
from sensor.config import LensConfig, SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.pixel import PixelConfig
from sensor.presets import low_noise
from sensor.response import electrons_per_irradiance, expected_electrons, lost_shares

PIXEL = PixelConfig(pitch_um=3.0, fill_factor=0.5, full_well_e=1e5, read_noise_e=2.0, dsnu_e=2.0, prnu=0.1)
QE = {"R": 0.25, "G": 0.5, "B": 0.125, "W": 1.0}
JOULES = 6.62607015e-34 * 299792458.0  # of a photon, times its wavelength in metres


def camera(**changes):
    plain = SensorConfig(PIXEL, LensConfig(2.0), responses=Responses({x: flat(value) for x, value in QE.items()}))
    return replace(plain, **changes)


def uniform(value, nm, width_nm=10.0, shape=(4, 6)):
    """Light in bands that touch, and dark bands beside them, so that no window is left open."""
    nm = np.atleast_1d(np.asarray(nm, dtype=np.float64))
    edges = np.array([200.0, nm[0] - width_nm / 2, nm[-1] + width_nm / 2, 1100.0])
    centres = np.concatenate([edges[:2].mean(keepdims=True), nm, edges[2:].mean(keepdims=True)])
    widths = np.concatenate([[edges[1] - edges[0]], np.full(nm.size, width_nm), [edges[3] - edges[2]]])
    values = np.concatenate([[0.0], np.full(nm.size, value), [0.0]])
    return SpectralRadiance(np.broadcast_to(values, (*shape, values.size)), centres, width_nm=widths)


def expected(radiance, sensor, exposure_s):
    return expected_electrons(form_image(radiance, sensor), sensor, exposure_s)


@loop("tile", [RGBW, BAYER])
def test_a_uniform_scene_gives_each_letter_its_closed_form(tile):
    sensor = camera(cfa=tile)
    electrons = expected(uniform(2e-3, 550.0, width_nm=10.0), sensor, 0.02)
    # irradiance x width x photons a joule x collecting area x time
    photons = 2e-3 * pi / (1 + 4 * 2.0**2) * 10.0 * (550e-9 / JOULES) * (9e-12 * 0.5) * 0.02
    for channel in set("".join(tile)):
        np.testing.assert_allclose(electrons[mask(tile, channel, (4, 6))], QE[channel] * photons, rtol=1e-12)


def test_bands_add_up_each_with_its_own_wavelength_and_width():
    edges = np.array([380.0, 447.5, 452.5, 585.0, 615.0, 699.0, 701.0, 780.0])
    nm, width_nm = (edges[1:] + edges[:-1]) / 2, np.diff(edges)  # 5 nm at 450, 30 at 600, 2 at 700, dark between
    weights = np.array([0.0, 3.0, 0.0, 1.0, 0.0, 2.0, 0.0])
    radiance = SpectralRadiance(np.broadcast_to(weights * 1e-3, (2, 2, 7)), nm, width_nm=width_nm)
    photons = np.sum(weights * 1e-3 * width_nm * nm) * 1e-9 / JOULES * pi / 17 * 4.5e-12 * 0.01
    electrons = expected(radiance, camera(), 0.01)
    np.testing.assert_allclose(electrons, photons * np.array([[QE["R"], QE["G"]], [QE["B"], QE["W"]]]), rtol=1e-12)


@loop(
    ("centre_nm", "width_nm", "inside"),
    [
        (550.0, 10.0, 1.0),
        (400.0, 20.0, 0.5),  # 390-410 nm: half of it is let in
        (395.0, 20.0, 0.25),  # 385-405 nm
        (698.0, 8.0, 0.75),  # 694-702 nm
        (390.0, 20.0, 0.0),  # ends at the edge
        (900.0, 20.0, 0.0),
        (550.0, 600.0, 0.5),  # 250-850 nm holds the whole window
    ],
)
def test_the_window_cuts_bands_to_the_part_inside(centre_nm, width_nm, inside):
    sensor = camera(window_nm=(400.0, 700.0))
    scene = uniform(1e-3, centre_nm, width_nm=width_nm)
    low, high = max(400.0, centre_nm - width_nm / 2), min(700.0, centre_nm + width_nm / 2)
    assert max(0.0, high - low) == pytest.approx(inside * width_nm)
    # photons a joule go with the wavelength: their integral over the part inside
    photons = 1e-3 * pi / 17 * inside * width_nm * ((low + high) / 2 * 1e-9 / JOULES) * 4.5e-12 * 0.01
    white = expected(scene, sensor, 0.01)[1, 1]
    assert white == pytest.approx(photons, rel=1e-12, abs=1e-30)


def test_single_precision_radiance_agrees_with_double_to_1e_6():
    nm = np.arange(385.0, 780.0, 10.0)
    values = np.random.default_rng(2).random((16, 16, nm.size)).astype(np.float32)
    sensor = SensorConfig(PIXEL, LensConfig(2.0))
    single = expected(SpectralRadiance(values, nm), sensor, 0.01)
    double = expected(SpectralRadiance(values.astype(np.float64), nm), sensor, 0.01)
    assert single.dtype == double.dtype == np.float64
    np.testing.assert_allclose(single, double, rtol=1e-6)


def test_an_image_smaller_than_the_tile_is_refused():
    with pytest.raises(InputError, match=r"mosaic: shape \(1, 6\).*at least 2x2"):
        expected(uniform(1e-3, [500.0, 510.0], shape=(1, 6)), camera(), 0.01)


# Bands that don't fill a camera's window: what each channel loses is told, and more than half is refused.

SENSOR = low_noise()


def equal_energy(low_nm, high_nm, width_nm=10.0, shape=(4, 4)):
    nm = np.arange(low_nm + width_nm / 2, high_nm, width_nm)
    return SpectralRadiance(np.full((*shape, nm.size), 1e-3), nm, width_nm=np.full(nm.size, width_nm))


def bands(radiance):
    return radiance.wavelength_nm, radiance.widths_nm


def test_an_even_response_loses_the_photons_of_what_is_left_out():
    """Photons of equal energy go with the wavelength: over an interval, with the difference of the ends' squares."""
    even = replace(SENSOR, responses=Responses(dict.fromkeys("RGBW", flat(0.5))))
    gap = SpectralRadiance(np.ones((2, 2, 2)), [390.0, 640.0], width_nm=[20.0, 280.0])  # 380-400 and 500-780 nm
    for radiance, lost_nm in (
        (equal_energy(380, 650), (650, 780)),
        (equal_energy(450, 780), (380, 450)),
        (gap, (400, 500)),
    ):
        expected = (lost_nm[1] ** 2 - lost_nm[0] ** 2) / (780**2 - 380**2)
        assert lost_shares(even, *bands(radiance)) == pytest.approx(dict.fromkeys("RGBW", expected), abs=1e-6)


@pytest.mark.thorough
@loop(("low_nm", "high_nm"), [(380, 650), (450, 650), (400, 700)])
@pytest.mark.filterwarnings("ignore:radiance")
def test_the_shares_are_what_the_electrons_of_equal_energy_light_lose(low_nm, high_nm):
    whole, cut = (
        expected_electrons(form_image(seen, SENSOR), SENSOR, 0.01)[:2, :2].ravel()
        for seen in (equal_energy(380, 780, 1.0), equal_energy(low_nm, high_nm, 1.0))
    )
    shares = lost_shares(SENSOR, *bands(equal_energy(low_nm, high_nm)))
    assert [shares[channel] for channel in "RGBW"] == pytest.approx(1 - cut / whole, abs=2e-4)


def shoot(radiance, **options):
    device = draw_device(SENSOR, radiance.shape, np.random.default_rng(1))
    return photograph_radiance(radiance, SENSOR, 0.01, device, np.random.default_rng(2), **options)


DOORS = {
    "capture": shoot,
    "exact capture": lambda radiance: shoot(radiance, exact=True),
    "expected electrons": lambda radiance: expected_electrons(form_image(radiance, SENSOR), SENSOR, 0.01),
    "auto exposure": lambda radiance: auto_exposure_s(form_image(radiance, SENSOR), SENSOR),
}


@loop("door", DOORS)
def test_each_door_tells_what_every_channel_loses(door):
    told = (
        r"^radiance: its bands, 450 to 650 nm, don't fill the camera's window, 380 to 780 nm; of light of equal energy "
        r"there, they leave out 5\.6% of R, 0\.9% of G, 21\.6% of B, 48\.2% of W; give those bands, or narrow the "
        r"camera's window_nm$"
    )
    with pytest.warns(UserWarning, match=told):
        DOORS[door](equal_energy(450, 650))


@loop("door", DOORS)
def test_more_than_half_of_a_channel_is_refused(door):
    with pytest.raises(InputError, match=r"540 to 780 nm, don't fill .* 9\d\.\d% of B, .*; allowed: half; give those"):
        DOORS[door](equal_energy(540, 780))


@loop("radiance", [equal_energy(380, 780), equal_energy(385, 785), equal_energy(300, 1100, 50.0)])
def test_a_picture_that_fills_the_window_but_for_half_a_per_cent_is_taken_silently(radiance):
    for door in DOORS.values():
        door(radiance)


def test_a_window_as_wide_as_the_picture_is_taken_silently():
    narrow, radiance = replace(SENSOR, window_nm=(545.0, 555.0)), equal_energy(545, 555)
    assert expected_electrons(form_image(radiance, narrow), narrow, 0.01).min() > 0


def test_responses_known_at_one_wavelength_are_told():
    """As `rodcone new preset --noise` writes them: 0.64 electrons a photon at 525 nm, and nothing elsewhere."""
    peak = Spectrum(np.array([524.0, 526.0]), np.array([0.64, 0.64]))
    with pytest.warns(UserWarning, match=r"responses: they are known over 524-526 nm, and count as 0 elsewhere"):
        expected(equal_energy(380.0, 780.0), camera(cfa=("W",), responses=Responses({"W": peak})), 0.01)


def test_weights_that_were_asked_for_before_are_those_of_what_is_asked_for_now():
    """They are kept by all that decides them: a curve's last bit, the bands, the lamp, the window."""
    nm, width = np.arange(390.0, 771.0, 20.0), np.full(20, 20.0)
    lamp = Spectrum([380.0, 600.0, 800.0], [1.0, 2.0, 0.5])
    sensor = low_noise()
    curves = dict(sensor.responses.curves)
    values = np.copy(curves["G"].values)
    values[values.argmax()] *= 1 + 1e-9
    greener = replace(sensor, responses=Responses({**curves, "G": Spectrum(curves["G"].wavelength_nm, values)}))
    asked = [
        (sensor, nm, width, 1.0, None),
        (greener, nm, width, 1.0, None),
        (replace(sensor, window_nm=(420.0, 680.0)), nm, width, 1.0, None),
        (sensor, nm, width, 1.0, lamp),
        (sensor, nm, width, 1.0, Spectrum(lamp.wavelength_nm, lamp.values[::-1])),
        (sensor, nm, width * 0.999, 1.0, None),
    ]
    first = [electrons_per_irradiance(*what) for what in asked]
    kept = [weights.copy() for weights in first]
    assert len({weights.tobytes() for weights in first}) == len(asked)
    for weights in first:
        weights[:] = 0.0  # a caller's own
    for what, weights in zip(asked, kept, strict=True):
        assert np.array_equal(electrons_per_irradiance(*what), weights)
        response._response_weights.cache_clear()
        assert np.array_equal(electrons_per_irradiance(*what), weights)
    assert np.array_equal(electrons_per_irradiance(sensor, nm, width, 0.25), kept[0] / 4)


def test_a_camera_that_does_not_bin_is_its_own_undivided():
    sensor = low_noise()
    assert sensor.undivided is sensor
