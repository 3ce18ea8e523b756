"""Contrast patches: pairs of greys of known contrast and luminance, by which IEEE 2020 measures contrast accuracy.

Each pair is a bright and a dark square side by side. Pairs in the same column have the same Michelson contrast,
(a - b) / (a + b), and pairs in the same row the same mean reflectance. The chart is on grey card and fills the picture.
"""

from dataclasses import dataclass

import numpy as np

from render.geometry import camera, look_at, translate
from render.scene import Scene
from scenes.materials import matte, panel, under_sky
from scenes.reflectances import grey

CONTRASTS = (0.1, 0.2, 0.4)  # Michelson contrasts of the columns, left to right
MEANS = (0.5, 0.125, 0.03125, 0.0078125)  # reflectances, from the top down: two stops apart
GROUND = 0.18
SIDE_M = 0.5  # side of the picture
PATCH_M = 0.07  # side of a patch
PAIR_M, ROW_M = 0.16, 0.12  # distance from pair to pair, and from row to row


@dataclass(frozen=True)
class PatchPair:
    """Two patches: their reflectances, and their middles and side as shares of the picture's side.

    Attributes
    ----------
    contrast, mean : float
        Michelson's contrast of the reflectances, and their mean.
    row, bright_column, dark_column : float
        Middles of the patches from the picture's top and left, 0 to 1.
    side : float
    """

    contrast: float
    mean: float
    row: float
    bright_column: float
    dark_column: float
    side: float


def patch_pairs() -> list[PatchPair]:
    """Return the chart's pairs, row by row from the top."""
    rows = 0.5 + (np.arange(len(MEANS)) - (len(MEANS) - 1) / 2) * ROW_M / SIDE_M
    columns = 0.5 + (np.arange(len(CONTRASTS)) - (len(CONTRASTS) - 1) / 2) * PAIR_M / SIDE_M
    half = PATCH_M / 2 / SIDE_M
    return [
        PatchPair(contrast, mean, row, column - half, column + half, PATCH_M / SIDE_M)
        for mean, row in zip(MEANS, rows.tolist(), strict=True)
        for contrast, column in zip(CONTRASTS, columns.tolist(), strict=True)
    ]


def contrast_patches(light: str = "D65") -> Scene:
    """Build twelve pairs of patches on grey card in a constant environment.

    Parameters
    ----------
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    facing = look_at((0, 0, 0), (0, 0, 1))
    shapes = {"card": panel(translate(0, 0, -0.0002) @ facing, 4.0, 4.0, matte(grey(GROUND)))}
    for index, pair in enumerate(patch_pairs()):
        for name, column, sign in (("bright", pair.bright_column, 1), ("dark", pair.dark_column, -1)):
            place = translate((column - 0.5) * SIDE_M, (0.5 - pair.row) * SIDE_M, 0)
            surface = matte(grey(pair.mean * (1 + sign * pair.contrast)))
            shapes[f"{name}{index:02d}"] = panel(place @ facing, PATCH_M, PATCH_M, surface)
    view = camera(20.0, (0, 0, SIDE_M / 2 / np.tan(np.radians(10.0))), (0, 0, 0))
    return under_sky("contrast_patches", view, shapes, light, reference_plane="card")
