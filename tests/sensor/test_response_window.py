"""Bands that don't fill a camera's window: what each channel loses is told, and more than half is refused."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from render.spectrum import flat
from rodcone.errors import InputError
from sensor.capture import capture
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.presets import low_noise
from sensor.response import expected_electrons, lost_shares

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
    return capture(radiance, SENSOR, 0.01, device, np.random.default_rng(2), **options)


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
