"""Flare: how much of a bright surround's light a lens scatters onto a black patch."""

from dataclasses import replace
from math import nan

import numpy as np

from render.radiance import SpectralRadiance
from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.response import expected_electrons
from studies.score.even_field import SIDE_PX
from studies.score.figure import Definition, Merit, not_measured
from studies.score.sharpness import bands_of

PATCH_PX, BORDER_PX = 32, 2  # the black square's side, and the pixels of its border that crosstalk reaches
WHITE_SHARE = 0.8  # of the converter's top


def flare(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Definition:
    """Define the veiling glare index of a lens that states a share g of evenly scattered light.

    A black square takes the share a of a white picture. It reads g (1 - a), and the white 1 - g + g (1 - a).
    """
    glare = sensor.lens.veiling_glare
    lit = glare * (1 - (PATCH_PX / SIDE_PX) ** 2)
    merit = Merit(
        "iso_9358.veiling_glare_index",
        "veiling glare index",
        "%",
        "ISO 9358, black patch in a white surround (flare)",
        f"{channel}, raw, black square of {100 * (PATCH_PX / SIDE_PX) ** 2:.1f} % of the picture, {light}, share of "
        f"scattered light {glare:g}",
        100 * lit / (1 - glare + lit) if lit else nan,
        missing="" if lit else "the lens states no glare; state veiling_glare in [lens]",
    )
    if merit.missing:
        return Definition((merit,), not_measured)
    plain = replace(
        sensor, lens=replace(sensor.lens, horizontal_view_deg=0.0, shake_um=0.0, diffraction=0.0, defocus_um=0.0)
    )
    bands, side = bands_of(light), SIDE_PX * sensor.sites
    start, stop = (at * sensor.sites for at in ((SIDE_PX - PATCH_PX) // 2, (SIDE_PX + PATCH_PX) // 2))
    reflectance = np.ones((side, side))
    reflectance[start:stop, start:stop] = 0.0
    radiance = SpectralRadiance(
        reflectance[..., None] * bands.spectrum, bands.wavelength_nm, width_nm=bands.width_nm, light=bands.lamp
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
