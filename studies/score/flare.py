"""Figures of a lens in even light: flare onto a black patch in a bright surround, and falloff in the corners."""

from dataclasses import replace
from math import nan, radians, tan

import numpy as np

from render.radiance import SpectralRadiance
from rodcone.types import Plane
from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.lens.illumination import EVEN_LIGHT, NATURAL_POWER, pupil_share
from sensor.lens.scatter import scatters
from sensor.optics import form_image
from sensor.response import expected_electrons
from studies.score.even_field import SIDE_PX
from studies.score.figure import Definition, Merit, not_measured
from studies.score.sharpness import bands_of

PATCH_PX, BORDER_PX = 32, 2  # the black square's side, and the pixels of its border that crosstalk reaches
WHITE_SHARE = 0.8  # share of the converter's top value that a perfect white reads


VIEW_PX = 96, 128  # height and width of the picture whose corners are measured
CORNER_PX = 16  # side of a corner, and half of the middle's


def flare(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Definition:
    """Define the veiling glare index of a lens that scatters the share g of its light evenly over the picture.

    A black square covers the share a of a white picture. It reads g (1 - a), and the white 1 - g + g (1 - a). The wings
    of glare, which depend on the angle from each light, have no formula on a chart; for them the index is only
    measured.
    """
    glare = sensor.lens.veiling_glare
    lit = glare * (1 - (PATCH_PX / SIDE_PX) ** 2)
    wings = scatters(sensor.lens)
    missing = "" if lit or wings else "the lens states no glare; state veiling_glare or scatter in [lens]"
    if wings and not sensor.lens.horizontal_view_deg:
        missing = "wings need an angle of view; state horizontal_view_deg in [lens]"
    merit = Merit(
        "iso_9358.veiling_glare_index",
        "veiling glare index",
        "%",
        "ISO 9358, black patch in a white surround (flare)",
        f"{channel}, raw, black square of {100 * (PATCH_PX / SIDE_PX) ** 2:.1f} % of the picture, {light}, share of "
        f"evenly scattered light {glare:g}{', and wings by angle' if wings else ''}",
        nan if missing or wings else 100 * lit / (1 - glare + lit),
        missing=missing,
    )
    if merit.missing:
        return Definition((merit,), not_measured)
    plain = replace(sensor, lens=replace(sensor.lens, **EVEN_LIGHT, shake_um=0.0, diffraction=0.0, defocus_um=0.0))
    bands = bands_of(light, sensor.window_nm)
    side = SIDE_PX * sensor.sites
    start, stop = (at * sensor.sites for at in ((SIDE_PX - PATCH_PX) // 2, (SIDE_PX + PATCH_PX) // 2))
    reflectance = np.ones((side, side))
    reflectance[start:stop, start:stop] = 0.0
    radiance = SpectralRadiance(
        reflectance[..., None] * bands.spectrum,
        bands.wavelength_nm,
        width_nm=bands.width_nm,
        light=bands.lamp,
        horizontal_view_deg=sensor.lens.horizontal_view_deg or None,
    )
    chart_e = expected_electrons(form_image(radiance, plain), plain, exposure_s)
    chart_e = chart_e * WHITE_SHARE * plain.top_e / plain.sites**2 / chart_e.max()

    def measure(rng: np.random.Generator) -> list[float]:
        raw = expose(chart_e, plain, exposure_s, draw_device(plain, chart_e.shape, rng), rng)
        seen = mask(raw.cfa, channel, raw.shape)
        first, last = (SIDE_PX - PATCH_PX) // 2, (SIDE_PX + PATCH_PX) // 2
        black, white = np.zeros_like(seen), seen.copy()
        black[first + BORDER_PX : last - BORDER_PX, first + BORDER_PX : last - BORDER_PX] = True
        white[first - BORDER_PX : last + BORDER_PX, first - BORDER_PX : last + BORDER_PX] = False
        return [100 * float(raw.electrons[black & seen].mean() / raw.electrons[white].mean())]

    return Definition((merit,), measure)


def corner_illumination(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Definition:
    """Define the ratio of the light in the corners to that in the middle, for a lens that states its angle of view.

    With t, the tangent of the angle off the axis, natural falloff is cos^4 = 1 / (1 + t^2)^2. The share that the lens's
    rim lets through multiplies it.
    """
    lens, (height, width) = sensor.lens, VIEW_PX
    across = tan(radians(lens.horizontal_view_deg / 2))
    half_diagonal = np.hypot(*VIEW_PX) / 2
    tangents = ((np.arange(side) - (side - 1) / 2) * 2 * across / width for side in VIEW_PX)
    power = lens.falloff_power or NATURAL_POWER
    light_share = (1 + np.add.outer(*(tangent**2 for tangent in tangents))) ** (-power / 2)
    if lens.vignetting:
        places = (np.arange(side) - (side - 1) / 2 for side in VIEW_PX)
        light_share *= pupil_share(np.hypot.outer(*places) / half_diagonal, lens)
    merit = Merit(
        "lens.corner_illumination",
        "relative illumination of the corners",
        "1",
        "like ISO 17957 (shading): corners over the middle",
        f"{channel}, raw, an even field of 4:3, {lens.horizontal_view_deg:g} degrees wide, {light}, corners of "
        f"{100 * CORNER_PX / width:.1f} % of the width; natural falloff, "
        f"{'a rim that cuts the pupil' if lens.vignetting else 'no mechanical vignetting'}",
        _corners_over_middle(light_share),
    )
    if not lens.horizontal_view_deg and (lens.falloff_power or not lens.vignetting):
        missing = "the lens states no angle of view; state horizontal_view_deg in [lens]"
        return Definition((replace(merit, computed=nan, missing=missing),), not_measured)
    plain = replace(
        sensor, lens=replace(lens, shake_um=0.0, diffraction=0.0, defocus_um=0.0, veiling_glare=0.0, scatter=0.0)
    )
    plain = replace(plain, lens=replace(plain.lens, eye_age_years=0.0))
    bands = bands_of(light, sensor.window_nm)
    even = np.ones((height * sensor.sites, width * sensor.sites, 1)) * bands.spectrum
    radiance = SpectralRadiance(even, bands.wavelength_nm, width_nm=bands.width_nm, light=bands.lamp)
    field_e = expected_electrons(form_image(radiance, plain), plain, exposure_s)
    field_e = field_e * WHITE_SHARE * plain.top_e / plain.sites**2 / field_e.max()

    def measure(rng: np.random.Generator) -> list[float]:
        chip = draw_device(plain, field_e.shape, rng)
        lit, dark = (expose(light_e, plain, exposure_s, chip, rng) for light_e in (field_e, np.zeros_like(field_e)))
        seen_e = np.where(mask(lit.cfa, channel, lit.shape), lit.electrons - dark.electrons, np.nan)
        return [_corners_over_middle(seen_e)]

    return Definition((merit,), measure)


def _corners_over_middle(plane: Plane) -> float:
    """Return the mean of four corners over that of the middle, which has the same area; nan pixels don't count."""
    ends = slice(None, CORNER_PX), slice(-CORNER_PX, None)
    corners = [plane[rows, columns] for rows in ends for columns in ends]
    rows, columns = (slice(side // 2 - CORNER_PX, side // 2 + CORNER_PX) for side in plane.shape)
    return float(np.nanmean(corners) / np.nanmean(plane[rows, columns]))
