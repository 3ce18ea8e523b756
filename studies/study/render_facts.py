"""How a render was made, and the error that it reached."""

from dataclasses import dataclass

from render.radiance import SpectralRadiance
from render.transport import Transport


@dataclass(frozen=True)
class RenderFacts:
    """Facts of a render, from its `render.transport.Transport`, and the error that it reached.

    Attributes
    ----------
    integrator, variant, stopped_by : str
    seconds : float
    spp : float
        Mean samples per pixel.
    bands : int
    relative_mc_error, relative_level_error : float or None
        Errors of the lit scene, as in `render.radiance.SpectralRadiance`.
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
