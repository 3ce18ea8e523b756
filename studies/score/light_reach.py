"""Cameras that see beyond 380-780 nm: figures that a light can't give because its table of wavelengths ends earlier."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import nan

from render.illuminants import illuminant
from render.spectrum import VISIBLE_NM
from sensor.config import SensorConfig
from studies.metrics.truth import named_light, neutral_electrons
from studies.score.figure import Definition, Merit, not_measured
from studies.score.noise_figures import SNR1S

EVERYWHERE = "E"  # the light of equal energy over 300-1100 nm, for which the same figures exist


def unlit(sensor: SensorConfig, light: str) -> str:
    """Say why a camera's unit channel collects nothing under a light; return an empty text if it collects some."""
    electrons = neutral_electrons(sensor, named_light(light, sensor.window_nm), 1.0)
    if electrons[sensor.channels.index(sensor.unit_channel)] > 0:
        return ""
    first_nm, last_nm = illuminant(light).wavelength_nm[[0, -1]].tolist()
    return f"{light} is known over {first_nm:.4g}-{last_nm:.4g} nm, where {sensor.unit_channel} collects nothing"


def without_light(definitions: Iterable[Definition], reason: str) -> Iterator[Definition]:
    """Mark figures as missing under a light that gives the camera nothing; keep SNR1s, which has a lamp of its own."""
    for definition in definitions:
        if definition.merits[0].name.startswith("snr1s."):
            yield definition
        else:
            missing = tuple(replace(merit, computed=nan, missing=reason) for merit in definition.merits)
            yield Definition(missing, not_measured)


def with_reach(definition: Definition, sensor: SensorConfig, light: str) -> Definition:
    """Add to the conditions of figures where the light's table ends, if that is before the camera's window does."""
    return replace(definition, merits=tuple(_told(merit, sensor, light) for merit in definition.merits))


def _told(merit: Merit, sensor: SensorConfig, light: str) -> Merit:
    low, high = sensor.window_nm
    for name in dict.fromkeys((light, SNR1S[0])):
        if not re.search(rf"(?<!\w){re.escape(name)}(?!\w)", merit.conditions):
            continue
        first_nm, last_nm = illuminant(name).wavelength_nm[[0, -1]].tolist()
        if last_nm < high > VISIBLE_NM[1] or first_nm > low < VISIBLE_NM[0]:
            end = f"{name} is known over {first_nm:.4g}-{last_nm:.4g} nm and counts as dark outside"
            merit = replace(merit, conditions=f"{merit.conditions}; {end}")
    return merit
