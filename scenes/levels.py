"""Light levels as mean scene luminance, each with the source of its number."""

from dataclasses import dataclass
from math import pi

AVERAGE_REFLECTANCE = 0.18  # mean reflectance of scenes, from which an illuminance in lux becomes a luminance
_CD_M2_PER_LUX = AVERAGE_REFLECTANCE / pi


@dataclass(frozen=True)
class LightLevel:
    """A level of light.

    Attributes
    ----------
    name : str
    luminance_cd_m2 : float
        Mean scene luminance.
    source : str
    """

    name: str
    luminance_cd_m2: float
    source: str


# Seven levels, five decades, from moonlight to daylight.
DEMO_LEVELS = (
    LightLevel(
        "moonlight",
        0.036,
        "Parmar & Wandell 2009: 10 photons per um^2 and second through f/5.6; 0.63 lux, twice the brightest moon",
    ),
    LightLevel("street", 10 * _CD_M2_PER_LUX, "EN 13201-2 class P2: 10 lux on the ground, reflectance 0.18"),
    LightLevel("corridor", 100 * _CD_M2_PER_LUX, "EN 12464-1: 100 lux in corridors, reflectance 0.18"),
    LightLevel("classroom", 25.0, "Parmar & Wandell 2009, Table 1; 440 lux, EN 12464-1: 300 to 500 in schools"),
    LightLevel("bright office", 100.0, "Parmar & Wandell 2009, Figure 1b"),
    LightLevel("overcast day", 10_000 * _CD_M2_PER_LUX, "10 000 lux under an overcast sky, reflectance 0.18"),
    LightLevel("sunlit day", 100_000 * _CD_M2_PER_LUX, "100 000 lux in full sun, reflectance 0.18"),
)
