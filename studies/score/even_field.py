"""A camera that looks at an even neutral field: the light that it sees, and samples of its simulated frames."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from render.radiance import SpectralRadiance
from rodcone.types import Floats
from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.lens.illumination import EVEN_LIGHT
from sensor.optics import camera_equation, form_image
from sensor.raw import RawImage
from sensor.readings.best_estimate import collected_share
from sensor.readings.resolve import PlainReading, at_channel, chip_readings, several
from sensor.readout import sources_of
from sensor.response import expected_electrons
from studies.metrics.truth import Light, neutral_electrons

TEMPORAL = ("read noise", "converter noise", "quantisation", "dark current")  # dark noise that changes between frames
SIDE_PX = 128  # side of a frame; a channel in one pixel of four has 4096 samples


@dataclass(frozen=True)
class EvenField:
    """An even neutral field under a light, and the camera that sees it.

    Attributes
    ----------
    sensor : SensorConfig
        The camera, with a lens without falloff and shake, because the middle of an even field shows neither.
    light : Light
    exposure_s : float
    channel : str
        Channel whose samples are measured.
    frame_e : (h, w) float64
        Photo-electrons behind each filter at 1 cd/m^2.
    means_e : (channel,) float64
        Mean photo-electrons of the channels' samples at 1 cd/m^2, crosstalk included.
    """

    sensor: SensorConfig
    light: Light
    exposure_s: float
    channel: str
    frame_e: Floats
    means_e: Floats

    @cached_property
    def electrons_per_cd_m2(self) -> float:
        """Return the mean photo-electrons of the channel's samples at 1 cd/m^2, crosstalk included."""
        return float(self.means_e[self.sensor.channels.index(self.channel)])

    @cached_property
    def lux_s_per_cd_m2(self) -> float:
        """Return the luminous exposure of the sensor at 1 cd/m^2 [lux s]."""
        return camera_equation(self.sensor.lens) * self.exposure_s

    def draw_chip(self, rng: np.random.Generator) -> Device:
        """Make a chip of the frame's size."""
        return draw_device(self.sensor, self.frame_e.shape, rng)

    def shoot(self, luminance_cd_m2: float, chip: Device, rng: np.random.Generator) -> RawImage:
        """Expose and read one frame of the field at a luminance."""
        return expose(self.frame_e * luminance_cd_m2, self.sensor, self.exposure_s, chip, rng)

    def samples_e(self, raw: RawImage) -> Floats:
        """Return the channel's samples of a frame [e-], scaled to the whole pixel and the whole exposure time."""
        samples = raw.electrons[mask(raw.cfa, self.channel, raw.shape)]
        return np.asarray(samples / (collected_share(self.readings) if several(self.readings) else 1.0), np.float64)

    @cached_property
    def readings(self) -> tuple[PlainReading, ...]:
        """Return the readings of the channel's pixels that the chip can take."""
        return tuple(at_channel(chip_readings(self.sensor, self.exposure_s), self.channel))

    @cached_property
    def headroom_e(self) -> float:
        """Return the photo-electrons of the whole pixel at which its largest reading is full."""
        return max(reading.headroom_e for reading in self.readings)

    @cached_property
    def temporal_dark_e(self) -> float:
        """Return the standard deviation of a dark pixel over frames [e-]."""
        if not several(self.readings):
            return float(self.readings[0].law.dark_e)
        sources_e = sources_of(0.0, self.readings)
        return float(np.hypot.reduce([sources_e[name] for name in TEMPORAL]))


def even_field(sensor: SensorConfig, light: Light, exposure_s: float, channel: str) -> EvenField:
    """Return an even neutral field in front of a camera."""
    plain = replace(sensor, lens=replace(sensor.lens, **EVEN_LIGHT, shake_um=0.0, scatter=0.0, eye_age_years=0.0))
    tile_rows, tile_columns = (side * plain.sites for side in (len(plain.cfa), len(plain.cfa[0])))
    radiance = SpectralRadiance(
        np.broadcast_to(light.spectrum, (tile_rows, tile_columns, light.spectrum.size)).copy(),
        light.wavelength_nm,
        width_nm=light.width_nm,
        light=light.lamp,
    )
    tile_e = expected_electrons(form_image(radiance, without_blur(plain)), plain, exposure_s)
    repeats = SIDE_PX // tile_rows, SIDE_PX // tile_columns
    means_e = neutral_electrons(plain, light, exposure_s)
    return EvenField(plain, light, exposure_s, channel, np.tile(tile_e, repeats), means_e)


def without_blur(sensor: SensorConfig) -> SensorConfig:
    """Return the camera without diffraction and defocus: an even field's image is the same, in 1 % of the time."""
    return replace(sensor, lens=replace(sensor.lens, diffraction=0.0, defocus_um=0.0))
