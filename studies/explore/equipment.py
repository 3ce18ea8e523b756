"""The lamps and the camera as the controls have them, and the light that colours are judged under."""

from dataclasses import replace

import numpy as np

from render.illuminants import illuminant, spectral_luminance
from render.scene import LightGroup
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.errors import InputError
from sensor.config import SensorConfig
from studies.explore.controls import Controls, Lamp
from studies.metrics.truth import Light, light_in_bands
from studies.study.scene_source import first_light, replaceable_luminance
from studies.study.study import OWN


def lit_transport(transport: Transport, lamps: dict[str, Lamp], reference_light: str) -> tuple[Transport, Light, float]:
    """Transport with the lamps, light of the camera's colours, and factor to 1 cd/m^2."""
    groups = {name: lit_group(group, lamps[name]) for name, group in transport.groups.items()}
    lit = replace(transport, groups=groups)
    level = lit.level().value
    if level <= 0:
        raise InputError("lamps: all are off; allowed: one power above 0; raise one")
    white = first_light(groups, illuminant(reference_light))
    light = light_in_bands(white, transport.wavelength_nm, transport.width_nm)
    return lit, light, 1.0 / level


def alone(lit: Transport, name: str) -> Transport:
    """Transport of which one light group shines, at power 1."""
    groups = {group_name: replace(group, power=float(group_name == name)) for group_name, group in lit.groups.items()}
    return replace(lit, groups=groups)


def lit_group(group: LightGroup, lamp: Lamp) -> LightGroup:
    """Light group with a lamp's spectrum, at the luminance of its own, and with its power.

    Raises
    ------
    InputError
        For another spectrum where the group has colours of its own or is dark, or one without light.
    """
    power = group.power * lamp.power
    if lamp.spectrum == OWN and not lamp.table:
        return replace(group, power=power)
    group_luminance = replaceable_luminance(group, f"lamps: {lamp.spectrum!r} for a light group that")
    spectrum = Spectrum(*np.transpose(lamp.table)) if lamp.table else illuminant(lamp.spectrum)
    luminance = spectral_luminance(spectrum)
    if luminance <= 0:
        raise InputError("lamps: the table gives no light that an eye sees; allowed: values above 0 within 380-780 nm")
    return replace(group, spectrum=spectrum * (group_luminance / luminance), power=power)


def camera_of(controls: Controls, base: SensorConfig) -> SensorConfig:
    """Sensor with its lens as the controls have it; `base` is the sensor with the controls' mosaic.

    Raises
    ------
    InputError
        For a file that describes no camera, or a term out of range.
    """
    if base.chip.binning:
        raise InputError(
            f"sensor: {controls.sensor!r} bins; allowed in the explorer: sensors without binning; take "
            "binning out of its file"
        )
    if base.chip.readings and (fixed := {"full_well_e", "read_noise_e", "dsnu_e"} & set(controls.pixel)):
        raise InputError(
            f"pixel: {', '.join(sorted(fixed))} with {controls.sensor!r}, whose readings have their own; allowed: the "
            "preset's; reset it, or take another sensor"
        )
    if base.chip.readings and not controls.shot_noise:
        raise InputError(
            f"shot_noise: False with {controls.sensor!r}, whose readings are merged by it; allowed: True; switch it on"
        )
    return replace(
        base,
        lens=replace(base.lens, **controls.lens),
        pixel=replace(base.pixel, **controls.pixel),
        bits=base.bits if controls.bits is None else controls.bits,
    )
