"""How a render was made, and the error that it reached."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from render.transport import Transport

MOST_BAND_ERROR = 0.01  # of a band's light: a larger error of wide bands is said
LEAST_LIGHT = 0.01  # of the picture's light, in a band whose error counts


@dataclass(frozen=True)
class RenderFacts:
    """How a render was made, as `render.transport.Transport` has it, and the error that it reached.

    Attributes
    ----------
    integrator, variant, stopped_by : str
    seconds : float
    spp : float
        Samples a pixel, in the mean.
    bands : int
    relative_mc_error, relative_level_error : float or None
        Of the lit scene, as `render.radiance.SpectralRadiance`.
    first_nm, last_nm, width_nm : float
        Centres of the first and the last band, and the width of the first.
    """

    integrator: str
    variant: str
    seconds: float
    spp: float
    stopped_by: str
    relative_mc_error: float | None
    relative_level_error: float | None
    bands: int
    first_nm: float
    last_nm: float
    width_nm: float


def render_facts(transport: Transport, radiance: SpectralRadiance) -> RenderFacts:
    """Return the facts of a render; `radiance` is the scene that it lights."""
    return RenderFacts(
        integrator=transport.integrator,
        variant=transport.variant,
        seconds=transport.seconds,
        spp=transport.spp,
        stopped_by=transport.stopped_by,
        relative_mc_error=radiance.relative_mc_error,
        relative_level_error=radiance.relative_level_error,
        bands=transport.wavelength_nm.size,
        first_nm=float(transport.wavelength_nm[0]),
        last_nm=float(transport.wavelength_nm[-1]),
        width_nm=float(transport.width_nm[0]),
    )


def bands_note(transport: Transport, radiance: SpectralRadiance, spectra: Mapping[str, Spectrum]) -> str | None:
    """Line that says where bands are too wide for the lights, and which would do; None where they aren't.

    What light and transport vary together within a band is missed (`Transport.band_error`); for smooth light it falls
    with the square of the width.
    """
    error = transport.band_error(spectra)
    light = radiance.values.mean(axis=(0, 1)) * transport.width_nm
    error = np.where(light >= LEAST_LIGHT * light.sum(), error, 0.0)
    worst = int(error.argmax())
    if error[worst] <= MOST_BAND_ERROR:
        return None
    width_nm, off = float(transport.width_nm[worst]), float(error[worst])
    enough_nm = max(1, int(width_nm * (MOST_BAND_ERROR / off) ** 0.5))
    return (
        f"bands: the one at {transport.wavelength_nm[worst]:g} nm is off by about {off:.1%}, for light and surfaces "
        f"vary together within its {width_nm:g} nm; bands of {enough_nm} nm would do, or for a lamp's lines "
        "rodcone.line_bands"
    )
