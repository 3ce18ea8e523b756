"""Models of a study: how each scene is rendered, and which effects of lens and readout each condition's image has."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any

from render.radiance import SpectralRadiance
from rodcone.types import Floats
from sensor.config import LensConfig, SensorConfig, without_terms
from sensor.exposure import auto_exposure_s
from sensor.lens.table import terms_of, with_lens
from sensor.optics import form_image, least_samples
from sensor.shake import held_lens
from studies.metrics.target_figures import EDGE

_DARK_S = 1e7  # longer than any exposure


@dataclass(frozen=True)
class RenderModel:
    """Way to render one scene for all its conditions: bands [nm], samples per pixel, and whether light is denoised."""

    wavelength_nm: tuple[float, ...]
    width_nm: tuple[float, ...]
    spp: int
    denoise: bool = False


def in_bands(bands: tuple[Floats, Floats], spp: int, denoise: bool = False) -> RenderModel:
    """Return the model of a render in bands, which are given as their centres and widths [nm]."""
    nm, width_nm = (tuple(x.tolist()) for x in bands)
    return RenderModel(nm, width_nm, spp, denoise)


@dataclass(frozen=True)
class LensTerms:
    """Terms of the lens that a study states for all of its sensors; None leaves one to each sensor.

    Attributes
    ----------
    diffraction : float, optional
        1 for an ideal aperture, as `sensor.config.LensConfig`.
    veiling_glare : float, optional
        Share of the light.
    horizontal_view_deg : float, optional
        Angle of view for cos^4.
    falloff_power, vignetting : float, optional
        Falloff by the angle of view of the scene's own camera, and what a rim takes from the corners.
    scatter : float, optional
        Share of the light in the wings of glare.
    shake : str, optional
        ``hand``: cameras are held in the hand (`sensor.shake`).
    table : str, optional
        Lens by data (`sensor.lens.table`) in front of all sensors, at its own f-number: a shipped one or a file.
    """

    diffraction: Annotated[float | None, (0.0, 100.0, "give 1 for an ideal lens, 0 for none")] = None
    veiling_glare: Annotated[float | None, (0.0, 1.0, "give a fraction, 0 for none")] = None
    horizontal_view_deg: Annotated[float | None, (0.0, 175.0, "give degrees, 0 for none")] = None
    falloff_power: Annotated[float | None, (0.0, 8.0, "give the power of the cosine, 4 for a thin lens")] = None
    vignetting: Annotated[float | None, (0.0, 0.99, "give the share of light lost in the corners, 0 for none")] = None
    scatter: Annotated[float | None, (0.0, 0.99, "give a fraction, 0 for none")] = None
    shake: str | None = None
    table: str | None = None

    def on(self, lens: LensConfig) -> LensConfig:
        """Return a lens in which the terms that the study states replace the lens's own."""
        terms = {name: value for name, value in vars(self).items() if value is not None and name != "shake"}
        of_table: dict[str, Any] = {} if self.table is None else terms_of(self.table)
        return held_lens(replace(lens, **(terms | of_table)), self.shake)

    def behind(self, sensor: SensorConfig) -> SensorConfig:
        """Return the camera behind the study's lens by data, whose f-number then decides exposures, if it has one."""
        return sensor if self.table is None else with_lens(sensor, self.table)


@dataclass(frozen=True)
class ImageModel:
    """The lens effects that an image includes (a term of 0 leaves one out), and how the sensor is read out.

    With `exact` NumPy computes the readout in double precision. Otherwise Dr.Jit computes it in single precision, on
    machines where it runs.
    """

    lens: LensConfig
    exact: bool = True


def samples_a_side(scene: str, sensors: Iterable[SensorConfig]) -> int:
    """Return how many samples of a scene's light the cameras need along each side of a pixel.

    A scene that measures sharpness needs as many as the sharpest lens does (`sensor.optics.least_samples`): with one
    sample per pixel its MTF50 would be too low. All other scenes need one.
    """
    return max((least_samples(sensor) for sensor in sensors), default=1) if scene == EDGE else 1


def unit_exposure_s(radiance: SpectralRadiance, preset: SensorConfig, channel: str | None = None) -> float:
    """Return the automatic exposure time of a scene at 1 cd/m^2 [s]; `_DARK_S` is the longest, for want of light.

    The time leaves the lens's blur, glare and falloff out. So it is the same for every model of the lens and, for G
    with the preset's own mosaic, for every processor, and their pictures can be compared.
    """
    glare = "veiling_glare", "scatter", "eye_age_years"
    blur_and_falloff = "diffraction", "defocus_um", "horizontal_view_deg", "falloff_power", "vignetting"
    bare = replace(without_terms(preset.lens, glare + blur_and_falloff), table="")
    plain = replace(preset, lens=bare)
    return auto_exposure_s(form_image(radiance, plain), plain, _DARK_S, channel=channel)
