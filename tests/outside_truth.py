"""Numbers of others that tests compare with. They are facts, rounded; the files that they come from aren't here.

Source: ISETCam (https://github.com/ISET/isetcam), its `data` folder as of 2021: MIT licence, Copyright (c) 2020
Stanford Center for Image Systems Engineering. V, D65 and A are the CIE's tables, as ISETCam holds them. The radiometry
was computed apart from this project, with NumPy, from ISETCam's published formulas and those tables: rectangle sums at
400:10:700 nm of spectra sampled at the band centres.
"""

from functools import cache
from typing import Any

from rodcone.optional import quietly_imported


@cache
def colour_science() -> Any:
    """Return the `colour` module, whose import takes 2 s."""
    return quietly_imported("colour")


MAGNIFICATION = 0.00323  # where none is named

IRRADIANCE = {  # f-number, magnification: lux per cd/m^2, photons [1/(um^2 s)] under D65
    (2.8, MAGNIFICATION): (0.09647774905903855, 107502.18),
    (2.8, 0.0): (0.09708259127286134, 108176.13),
    (4.0, MAGNIFICATION): (0.04802628514304116, 53514.207),
    (4.0, 0.0): (0.0483321946706122, 53855.073),
}
ELECTRONS = {  # under D65 in 10 ms, from RGBW: luminance [cd/m^2], f-number, pitch [um], fill factor
    (100.0, 4.0, 2.8, 0.75): {"R": 320.40544, "G": 643.80790, "B": 289.34835, "W": 2578.7138},
    (25.0, 2.8, 2.2, 0.9): {"R": 119.20613, "G": 239.52730, "B": 107.65141, "W": 959.40474},
}
# Under D65 at f/5.6, magnification 0; a luminance that gives 10 photons/(um^2 s), 1 a pixel of 2 um in 25 ms.
MOONLIGHT_PHOTONS_PER_UM2_S_CD_M2, MOONLIGHT_CD_M2 = 276.85698, 0.036119732

# Percent flicker over 100, and flicker index, of single lamps at 120 Hz: Lehman, Wilkins, Berman, Poplawski & Miller,
# "Proposing measures of flicker in the low frequencies for lighting applications" (IEEE ECCE 2011), as commonly quoted:
# its own table was not at hand; facts, no licence.
FLICKER_OF_LAMPS = {
    "incandescent": (0.063, 0.02),
    "fluorescent": (0.284, 0.07),
    "compact_magnetic": (0.370, 0.11),
    "compact_electronic": (0.077, 0.02),
    "metal_halide": (0.520, 0.16),
    "sodium_high": (0.950, 0.30),
}
