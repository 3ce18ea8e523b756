"""The 24-patch ColorChecker on grey card in a constant environment, or a chart of any other 24 reflectances."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from render.geometry import camera, look_at, translate
from render.scene import Node, Scene
from render.spectrum import Spectrum
from rodcone.errors import InputError, require_range
from rodcone.types import Floats
from scenes.materials import matte, panel, under_sky
from scenes.reflectances import color_checker_reflectances as patches
from scenes.reflectances import grey, held, read_reflectances

PATCH_M, GAP_M = 0.040, 0.005  # the classic chart's 40 mm patches
COLUMNS, ROWS = 6, 4
BOARD = 0.04  # reflectance of the board between the patches: the chart's black frame
CHART_SIZE = 170, 256  # 3:2, like the chart; a square picture would cut off a seventh of its first and last column
FACING = look_at((0, 0, 0), (0, 0, 1))  # towards the camera


def color_checker(light: str = "D65", surround: float = 0.2, chart: str | None = None) -> Scene:
    """Build a ColorChecker that faces the camera; each patch's radiance is its reflectance times the sky's.

    The tables end at 780 nm. Up to 1100 nm every surface is assumed to keep its reflectance at 780 nm, for studies of
    the near infrared.

    Parameters
    ----------
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    surround : float
        Reflectance of the grey card around the chart.
    chart : str, optional
        CSV file with the reflectances of 1 to 24 patches in place of the ColorChecker's, row by row: ``wavelength_nm``
        and a column each. Outside their wavelengths they are not known.
    """
    require_range("surround", surround, 0.0, 1.0, "give a reflectance: 18 % is 0.18")
    if chart is not None:
        measured = read_reflectances(chart)
        if len(measured) > ROWS * COLUMNS:
            raise InputError(f"chart: {chart!r} has {len(measured)} reflectances; allowed: 1 to 24; make two charts")
        card = Spectrum(measured[0][1].wavelength_nm, np.full(measured[0][1].values.shape, surround))
        return chart_scene(Path(chart).stem, [curve for _, curve in measured], card, light)
    curves = [held(curve) for _, curve in patches()]
    return chart_scene("color_checker", curves, held(grey(surround)), light)


def chart_scene(name: str, curves: Sequence[Spectrum], surround: Spectrum, light: str) -> Scene:
    """Make a scene of a chart of up to 24 reflectances on a card, in a constant environment.

    All reflectances should have the same wavelengths, so that the scene compiles quickly.
    """
    view = camera(20.0, (0, 0, 0.72), (0, 0, 0), CHART_SIZE)
    scene = under_sky(name, view, {"card": panel(FACING, 4.0, 4.0, matte(surround))}, light, reference_plane="card")
    board = Spectrum(surround.wavelength_nm, np.full(surround.values.shape, BOARD))
    return replace(scene, geometry=scene.geometry | chart_nodes(translate(0, 0, 0.0002) @ FACING, curves, board))


def color_checker_nodes(pose: Floats) -> dict[str, Node]:
    """Return the nodes of a ColorChecker centred on `pose` and facing its +z, 380-780 nm."""
    return chart_nodes(pose, [curve for _, curve in patches()], grey(BOARD))


def chart_nodes(pose: Floats, curves: Sequence[Spectrum], board: Spectrum) -> dict[str, Node]:
    """Return the nodes of a chart's board and up to 24 patches, row by row, centred on `pose` and facing its +z."""
    step = PATCH_M + GAP_M
    nodes = {"chart_board": panel(pose, COLUMNS * step + GAP_M, ROWS * step + GAP_M, matte(board))}
    for index, reflectance in enumerate(curves):
        row, column = divmod(index, COLUMNS)
        x, y = (column - (COLUMNS - 1) / 2) * step, ((ROWS - 1) / 2 - row) * step
        nodes[f"patch{index:02d}"] = panel(pose @ translate(x, y, 0.0005), PATCH_M, PATCH_M, matte(reflectance))
    return nodes
