"""What is modelled: how each scene is rendered, and what each condition's image holds."""

from dataclasses import dataclass

from sensor.config import LensConfig


@dataclass(frozen=True)
class RenderModel:
    """How one scene is rendered for all of its conditions: band centres and widths [nm], samples a pixel."""

    wavelength_nm: tuple[float, ...]
    width_nm: tuple[float, ...]
    spp: int


@dataclass(frozen=True)
class ImageModel:
    """The lens whose terms an image holds (0: left out), and the readout.

    `exact` reads out in NumPy's double precision; otherwise Dr.Jit does in single precision, where it runs.
    """

    lens: LensConfig
    exact: bool = True
