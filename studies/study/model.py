"""What is modelled: how each scene is rendered, and which terms of the lens each condition's image holds."""

from dataclasses import dataclass, replace

from sensor.config import SensorConfig


@dataclass(frozen=True)
class RenderModel:
    """How one scene is rendered for all of its conditions: band centres and widths [nm], samples a pixel."""

    wavelength_nm: tuple[float, ...]
    width_nm: tuple[float, ...]
    spp: int


@dataclass(frozen=True)
class ImageModel:
    """Terms of the lens, as `sensor.config.LensConfig` has them (0: left out), and the readout.

    `exact` reads out in NumPy; otherwise `sensor.kernel.kernel.read_frame` does in single precision.
    """

    diffraction: float
    veiling_glare: float
    horizontal_view_deg: float
    exact: bool = True


def modelled(sensor: SensorConfig, model: ImageModel) -> SensorConfig:
    """Sensor whose lens has the model's terms."""
    lens = replace(
        sensor.lens,
        diffraction=model.diffraction,
        veiling_glare=model.veiling_glare,
        horizontal_view_deg=model.horizontal_view_deg,
    )
    return replace(sensor, lens=lens)
