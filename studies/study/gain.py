"""Gain and speed of a camera: the saturation-based speed, and the gain that a study or a command asks for."""

from render.illuminants import illuminant
from render.spectrum import VISIBLE_NM, fine_bands
from rodcone.errors import InputError
from sensor.cfa import OWN
from sensor.config import MOST_GAIN, SensorConfig
from sensor.optics import camera_equation
from sensor.photodiodes import with_gain
from sensor.raw import ISO_RANGE
from studies.metrics.truth import light_in_bands, neutral_electrons

ISO = "ISO"
ISO_SATURATION_LUX_S = 78.0  # ISO 12232:2019: the saturation-based speed is this over the saturating exposure [lux s]
_ROUNDING = 0.015  # relative tolerance, because users round: for a base speed of 51.56 they may write 51


def iso_speed(sensor: SensorConfig) -> float | None:
    """Return the saturation-based speed of green under D65; None if the camera has no such speed.

    A camera has none without G, if G collects nothing, or if the speed is beyond what files can hold. The speed is that
    of the exposure in which green's mean reads the converter's top value, without half a stop of headroom. It is
    proportional to the gain. D65's table ends at 780 nm, so a camera that sees longer wavelengths gets no light there.
    """
    if "G" not in sensor.channels:
        return None
    d65, (low, high) = illuminant("D65"), sensor.window_nm
    bands = fine_bands([d65], (min(VISIBLE_NM[0], low), max(VISIBLE_NM[1], high)))
    neutral = neutral_electrons(sensor, light_in_bands(d65, *bands), 1.0)
    electrons_per_cd_m2 = float(neutral[sensor.channels.index("G")])
    if electrons_per_cd_m2 <= 0:
        return None
    per_lux_s = electrons_per_cd_m2 / camera_equation(sensor.lens)
    speed = ISO_SATURATION_LUX_S * per_lux_s / sensor.metered_well_e(sensor.unit_channel)
    return speed if ISO_RANGE[0] <= speed <= ISO_RANGE[1] else None


def at_gain(sensor: SensorConfig, text: str) -> SensorConfig:
    """Set a camera's gain from a study's text: ``own``, a factor such as ``8``, or a speed such as ``ISO 400``.

    Raises
    ------
    InputError
        For any other text, a gain that the camera doesn't have, or a speed below its base speed.
    """
    if text == OWN:
        return sensor
    word, _, number = text.rpartition(" ")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if word not in ("", ISO) or not value > 0:
        raise InputError(f"gain: {text!r} is not known; allowed: {OWN!r}, a factor such as 8, or 'ISO 400'; write so")
    return with_gain(sensor, value if word != ISO else gain_for_iso(sensor, value))


def gain_text(gain: float | None, iso: float | None) -> str:
    """Write a gain or a speed, at most one of which may be given, as a text for `at_gain`; ``own`` without either."""
    if gain is not None and iso is not None:
        raise InputError(f"gain: {gain:g} beside iso {iso:g}; allowed: one of the two; leave one out")
    return OWN if gain is None and iso is None else f"{gain:.12g}" if gain is not None else f"{ISO} {iso:.12g}"


def gain_for_iso(sensor: SensorConfig, iso: float) -> float:
    """Return the gain at which a camera has a given saturation-based speed.

    Raises
    ------
    InputError
        For a speed below that at gain 1, or a camera without a saturation-based speed.
    """
    base = iso_speed(with_gain(sensor, 1.0))
    if base is None:
        raise InputError(f"iso: {iso:g} for the mosaic {sensor.cfa}, which has no G to state a speed by; give a gain")
    if not base * (1 - _ROUNDING) <= iso <= base * MOST_GAIN:
        raise InputError(
            f"iso: {iso:g} is outside {base:.4g}, this camera's speed at gain 1, to {base * MOST_GAIN:.4g}; give one "
            "within, or less light"
        )
    return max(iso / base, 1.0)
