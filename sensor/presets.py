"""Cameras by name: two readings of the paper's Table 1, and a present-day pixel of the same geometry."""

from collections.abc import Callable

from render.errors import unknown
from sensor.cfa import BAYER, RGBW, Tile
from sensor.config import LensConfig, PixelConfig, SensorConfig

# Table 1 of Parmar & Wandell 2009. It contradicts itself (1.08 V at 30 uV an electron are 36 000 electrons, the well
# holds 15 000), and doesn't say where its noise voltages are measured: hence two presets.
_CONVERSION_GAIN_UV_PER_E = 30.0
_ANALOG_GAIN = 7.98
_READ_NOISE_UV = 4580.0
_DSNU_UV = 6000.0

_TILES: dict[str, Tile] = {"rgbw": RGBW, "bayer": BAYER}


def _camera(cfa: str, read_noise_e: float, dsnu_e: float, prnu: float) -> SensorConfig:
    if cfa not in _TILES:
        raise unknown("cfa", cfa, _TILES)
    pixel = PixelConfig(
        pitch_um=2.2,
        fill_factor=0.9,
        full_well_e=15_000.0,
        read_noise_e=read_noise_e,
        dsnu_e=dsnu_e,
        prnu=prnu,
        conversion_gain_uv_per_e=_CONVERSION_GAIN_UV_PER_E,
        voltage_swing_v=1.08,
        analog_gain=_ANALOG_GAIN,
    )
    return SensorConfig(pixel, LensConfig(f_number=2.8), cfa=_TILES[cfa])


def table1_pixel(cfa: str = "rgbw") -> SensorConfig:
    """Table 1, its noise voltages taken at the photodiode, as ISET computes: read 152.7 e-, DSNU 200 e-."""
    return _camera(cfa, _READ_NOISE_UV / _CONVERSION_GAIN_UV_PER_E, _DSNU_UV / _CONVERSION_GAIN_UV_PER_E, 0.017)


def table1_output(cfa: str = "rgbw") -> SensorConfig:
    """Table 1, its noise voltages taken behind the analog gain of 7.98: read 19.1 e-, DSNU 25.1 e-."""
    behind_gain = _CONVERSION_GAIN_UV_PER_E * _ANALOG_GAIN
    return _camera(cfa, _READ_NOISE_UV / behind_gain, _DSNU_UV / behind_gain, 0.017)


def low_noise(cfa: str = "rgbw") -> SensorConfig:
    """Present-day pixel, Table 1's geometry: read 1.5 e-, DSNU 1 e-, PRNU 1 % (typical of backside-lit CMOS)."""
    return _camera(cfa, 1.5, 1.0, 0.01)


_PRESETS: dict[str, Callable[[str], SensorConfig]] = {
    "table1_pixel": table1_pixel,
    "table1_output": table1_output,
    "low_noise": low_noise,
}


def names() -> tuple[str, ...]:
    """Names that `preset` knows."""
    return tuple(_PRESETS)


def preset(name: str, cfa: str = "rgbw") -> SensorConfig:
    """Camera by name, with an ``rgbw`` or ``bayer`` mosaic.

    Raises
    ------
    InputError
        For an unknown name or mosaic.
    """
    if name not in _PRESETS:
        raise unknown("sensor preset", name, _PRESETS)
    return _PRESETS[name](cfa)
