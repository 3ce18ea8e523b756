"""Hard cases of spectra: lines, narrow peaks, one band and 401."""

from dataclasses import replace

import numpy as np
from hard.case import Case, Margin, Situation, worse, worst_of
from hard.chain import expected
from hard.light import BANDS_NM, at_level, even_lines, in_bands, of_lines, planes_of, times, with_planes

from render.illuminants import lines_nm
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, photons_per_joule
from sensor.cfa import channel_map
from sensor.optics import camera_equation

SODIUM = "sodium_low"


def _line_closed_form(situation: Situation) -> Margin:
    """Electrons as the response at the lines says.

    A doublet's power times the response and the photons per joule at the lines themselves.
    """
    lines = np.array(lines_nm(SODIUM))
    edges = np.array([lines[0] - 0.5, lines[1] + 0.5])  # of the band: within it response and photons may differ
    sensor = situation.sensor
    at_lines, at_edges = (sensor.responses.band_average(sensor.channels, nm, np.full(2, 1e-3)) for nm in (lines, edges))
    # Of 1 cd/m^2: V weighs the lines as `render.illuminants` does, so the radiance is what the picture itself holds.
    radiance = float(np.median(situation.radiance.values @ situation.radiance.widths_nm))
    area_m2 = (sensor.pixel.pitch_um * 1e-6) ** 2 * sensor.pixel.fill_factor
    powers = np.array([2.0, 1.0]) / 3.0 * camera_equation(sensor.lens) * area_m2 * situation.exposure_s * radiance
    exact = (at_lines * photons_per_joule(lines)) @ powers
    names = channel_map(sensor.cfa, situation.shape)
    found = expected(situation)
    margins = []
    for number, channel in enumerate(sensor.channels):
        slack = float(np.ptp(at_edges[number]) / at_lines[number].min() + np.ptp(edges) / lines[0])
        margins.append(worst_of(found[names == channel] - exact[number], slack * exact[number], "e⁻"))
    return worse(*margins)


def _parts_add(situation: Situation) -> Margin:
    """Bands add up.

    Odd bands and even bands alone.
    """
    every = situation.radiance
    halves = [_only(every, np.arange(every.wavelength_nm.size) % 2 == odd) for odd in (0, 1)]
    both = expected(situation)
    parts = sum(expected(replace(situation, radiance=half)) for half in halves)
    return worst_of(both - parts, 1e-6 * both, "e⁻")


def _only(radiance: SpectralRadiance, kept: np.ndarray) -> SpectralRadiance:
    """The same bands, those that aren't kept dark."""
    return with_planes(radiance, planes_of(radiance) * kept[:, None, None].astype(radiance.values.dtype))


def _some_bands(*kept_nm: float) -> SpectralRadiance:
    return _only(at_level(100.0), np.isin(BANDS_NM, kept_nm))


def _one_narrow() -> SpectralRadiance:
    """10 cd/m^2 in 1 nm at 555 nm, and dark bands on both sides: a camera refuses a window left open."""
    alone = _only(in_bands((467.25, 555.0, 667.75), (174.5, 1.0, 224.5)), np.array([False, True, False]))
    return times(alone, np.full(alone.shape, 10.0 / alone.luminance().mean()))


def _fine() -> SpectralRadiance:
    edges_nm = np.linspace(*VISIBLE_NM, 402)
    return in_bands(tuple((edges_nm[1:] + edges_nm[:-1]) / 2), tuple(np.diff(edges_nm)), 32, 4)


SPECTRUM_CASES = (
    Case("sodium", "low-pressure sodium: two lines in 1 nm", lambda: Situation(of_lines(SODIUM))),
    Case(
        "sodium_even",
        "an even field under the same lamp, 10 cd/m²",
        lambda: Situation(even_lines(SODIUM, 10.0)),
        _line_closed_form,
    ),
    Case("fluorescent", "F11: narrow peaks in bands of 20 nm", lambda: Situation(at_level(10.0, "F11"))),
    Case("led_rgb", "three LEDs as white", lambda: Situation(at_level(10.0, "LED-RGB1"))),
    Case("violet_alone", "light in one band at 390 nm alone", lambda: Situation(_some_bands(390.0))),
    Case("red_alone", "light in one band at 770 nm alone", lambda: Situation(_some_bands(770.0))),
    Case("one_band", "one band of 400 nm", lambda: Situation(in_bands((580.0,), (400.0,)))),
    Case("one_narrow_band", "one band of 1 nm at 555 nm", lambda: Situation(_one_narrow())),
    Case("bands_401", "401 bands, 1 nm each: a render of its own", lambda: Situation(_fine()), _parts_add),
)
