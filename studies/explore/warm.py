"""Settings whose kernels are compiled while nobody asks, so that hardly any is compiled under a slider.

Kernels differ by which noise terms there are, by the tile's size, the patch, what guides the similarity, and by whether
weights had to be counted in units of the largest one, as they are where sigma is small.
"""

from itertools import product
from typing import Any

from studies.explore.controls import TIME, Controls

_TERMS: tuple[dict[str, float], ...] = (
    {"crosstalk": 0.01},
    {"hot_pixel_share": 0.01, "hot_pixel_dark_current_e_per_s": 100.0},
    {"column_gain_spread": 0.01},
)
_LIT: dict[str, Any] = {}
# Many pixels are full, in any scene.
_FULL: dict[str, Any] = {"level_cd_m2": 1e4, "exposure": TIME, "exposure_s": 0.01}
_NARROW = {"sigma_s": 0.1, "sigma_d": 0.3}

WARM = (
    *(Controls(pixel=first | second | third) for first, second, third in product(*(({}, term) for term in _TERMS))),
    *(
        Controls(mosaic=mosaic, processor=processor, settings=_NARROW | {"patch": patch}, **light)
        for patch in (1.0, 3.0, 5.0, 7.0, 9.0)
        for mosaic in ("rgbw", "rgbw_4x4")
        for processor in ("interleaved", "interleaved_paper")
        for light in (_LIT, _FULL)
    ),
    *(Controls(processor="bayer_nlm", mosaic="bayer", **light) for light in (_LIT, _FULL)),
)
