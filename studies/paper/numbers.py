"""The paper's numbers outside its figures: photons of moonlight, 30 dB, eight decades of light, and Table 1."""

from collections.abc import Mapping
from dataclasses import replace
from math import sqrt

import numpy as np

from render.spectrum import VISIBLE_NM
from scenes.levels import DEMO_LEVELS
from sensor.config import LensConfig
from sensor.device import Device
from sensor.readout import read_out
from studies.metrics.truth import named_light
from studies.paper.claims import Claim, claim, judge_claim, within_margin
from studies.paper.setup import READINGS, View, decibels, photons, shot_noise_alone, table1_sensor

MOONLIGHT_CD_M2 = DEMO_LEVELS[0].luminance_cd_m2
FULL_SUN_LUX = 1e5  # the same as in `DEMO_LEVELS`
# A clear night without moon, airglow included: 0.002 lux (Schlyter, "Radiometry and photometry in astronomy", 2009).
NIGHT_SKY_LUX = 2e-3
FLAT_SIDE = 256  # side of the uniform field that is read out [pixels]


def moonlight_photons(first_nm: float, last_nm: float) -> float:
    """Return moonlight's photons in a range of wavelengths that reach the sensor through f/5.6 [um^-2 s^-1]."""
    sensor = replace(table1_sensor("table1_output"), lens=LensConfig(5.6))
    light = named_light("D65")
    inside = (light.wavelength_nm > first_nm) & (light.wavelength_nm < last_nm)
    return photons(replace(light, spectrum=np.where(inside, light.spectrum, 0.0)), MOONLIGHT_CD_M2, sensor)


def measured_snr_db() -> float:
    """Measure the SNR of a uniform field of 1000 electrons that is read out with shot noise alone [dB].

    The noise is measured on the difference of two frames.
    """
    sensor = shot_noise_alone(table1_sensor("table1_output"))
    shape = (FLAT_SIDE, FLAT_SIDE)
    rng = np.random.default_rng(0)
    chip = Device(np.ones(shape), np.zeros(shape))
    field = np.full((FLAT_SIDE, FLAT_SIDE), 1000.0)
    first, second = (read_out(field, sensor, chip, 0.01, rng).electrons for _ in range(2))
    return decibels((first.mean() + second.mean()) / 2 / (np.std(first - second) / sqrt(2)))


def photon_claims(per_um2_s: Mapping[str, float], measured_db: float) -> tuple[Claim, ...]:
    """Judge the claims about moonlight in photons, and about 30 dB.

    Parameters
    ----------
    per_um2_s : mapping
        `moonlight_photons` by the range of wavelengths.
    measured_db : float
        SNR of 1000 electrons as read out.
    """
    # The standard deviation of n differences has the relative error 1 / sqrt(2 n). Chance exceeds 5 such errors once in
    # 2 million.
    margin = decibels(1 + 5 / sqrt(2 * FLAT_SIDE**2)) + 0.01
    under_d65 = {f"D65, {name}": value for name, value in per_um2_s.items()}
    in_pixels = {name: value * 2.0**2 * 0.025 for name, value in under_d65.items()}
    thousand = (
        *within_margin({"closed form, √1000": decibels(sqrt(1000.0))}, 30.0, 0.01, "dB"),
        *within_margin({"1000 e⁻ read out, shot noise alone": measured_db}, 30.0, margin, "dB"),
    )
    return (judge_claim(1, under_d65, moonlight=MOONLIGHT_CD_M2), judge_claim(2, in_pixels), claim(3, thousand))


def range_spans(view: View) -> dict[str, float]:
    """Return three ratios of bright to dark luminance, day over night; `view` is a scene at any level."""
    levels = [level.luminance_cd_m2 for level in DEMO_LEVELS]
    low, high = np.percentile(view.radiance.luminance(), [0.1, 99.9])
    of_scene = float(high / low) if low > 0 else float("inf")
    return {
        "mean of a scene, moonlight to full sun": levels[-1] / levels[0],
        "mean of a scene, moonless sky to full sun": FULL_SUN_LUX / NIGHT_SKY_LUX,
        "pixels of still_life, dark by moonlight to bright in the sun": levels[-1] / levels[0] * of_scene,
    }


def range_claim(spans: Mapping[str, float]) -> Claim:
    """Judge the claim of eight decades from day to night, to the order of magnitude; `spans` are from `range_spans`."""
    return judge_claim(4, {name: float(np.log10(span)) for name, span in spans.items()})


def table_claim(swing_wells: Mapping[str, float]) -> Claim:
    """Judge whether Table 1 is consistent, by the voltage swing under each reading of it, in full wells."""
    return judge_claim(5, swing_wells)


def number_claims(view: View) -> tuple[Claim, ...]:
    """Judge all claims of this module; `view` is the scene whose range of luminance is used."""
    per_um2_s = {f"{low:g}-{high:g} nm": moonlight_photons(low, high) for low, high in ((400.0, 700.0), VISIBLE_NM)}
    pixels = {name: table1_sensor(name).pixel for name in READINGS}
    swing_wells = {name: pixel.swing_e / pixel.full_well_e for name, pixel in pixels.items()}
    return *photon_claims(per_um2_s, measured_snr_db()), range_claim(range_spans(view)), table_claim(swing_wells)
