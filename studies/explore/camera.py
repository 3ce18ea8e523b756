"""The camera that the explorer's controls describe."""

from dataclasses import replace

from rodcone.errors import InputError
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.explore.controls import Controls


def own_camera(sensor: str, mosaic: str) -> SensorConfig:
    """Sensor of a preset's name or a file, with a mosaic."""
    return vary(preset(sensor), mosaic)


def camera_of(controls: Controls, own: SensorConfig | None = None) -> SensorConfig:
    """Sensor with its lens as the controls have it; `own` is that of `own_camera`, where it has been read before.

    Raises
    ------
    InputError
        For a file that describes no camera, or a term out of range.
    """
    own = own or own_camera(controls.sensor, controls.mosaic)
    if own.chip.binning:
        raise InputError(
            f"sensor: {controls.sensor!r} bins, which is not explored; allowed: one without binning; take "
            "binning out of its file"
        )
    if own.chip.readings and (fixed := {"full_well_e", "read_noise_e", "dsnu_e"} & set(controls.pixel)):
        raise InputError(
            f"pixel: {', '.join(sorted(fixed))} with {controls.sensor!r}, whose readings have their own; allowed: the "
            "preset's; reset it, or take another sensor"
        )
    if own.chip.readings and not controls.shot_noise:
        raise InputError(
            f"shot_noise: False with {controls.sensor!r}, whose readings are merged by it; allowed: True; switch it on"
        )
    return replace(
        own,
        lens=replace(own.lens, **controls.lens),
        pixel=replace(own.pixel, **controls.pixel),
        bits=own.bits if controls.bits is None else controls.bits,
    )
