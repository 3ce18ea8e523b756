"""The 24-patch ColorChecker on grey card, under an even sky."""

from render.errors import require_range
from render.geometry import look_at, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from render.spectrum import Floats
from scenes.materials import matte, panel
from scenes.reflectances import color_checker as patches
from scenes.reflectances import grey

SKY_LUMINANCE_CD_M2 = 100.0
PATCH_M, GAP_M = 0.040, 0.005  # the classic chart's 40 mm patches
COLUMNS, ROWS = 6, 4
FACING = look_at((0, 0, 0), (0, 0, 1))  # towards the camera


def color_checker(light: str = "D65", surround: float = 0.2) -> Scene:
    """ColorChecker, facing the camera; each patch's radiance is its reflectance times the sky's.

    Parameters
    ----------
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    surround : float
        Reflectance of the grey card around the chart.
    """
    require_range("surround", surround, 0.0, 1.0, "give a reflectance: 18 % is 0.18")
    camera = {
        "type": "perspective",
        "fov": 20.0,
        "fov_axis": "smaller",
        "to_world": to_world(look_at((0, 0, 0.72), (0, 0, 0))),
    }
    geometry: Node = {
        "type": "scene",
        "sensor": camera,
        "card": panel(FACING, 4.0, 4.0, matte(grey(surround))),
        "sky": {"type": "constant"},
    }
    groups = {"sky": LightGroup(("sky",), illuminant(light), SKY_LUMINANCE_CD_M2)}
    return Scene("color_checker", geometry | chart(translate(0, 0, 0.0002) @ FACING), groups, reference_plane="card")


def chart(place: Floats) -> dict[str, Node]:
    """Nodes of the chart's board and patches, centred on `place` and facing its +z."""
    step = PATCH_M + GAP_M
    board = panel(place, COLUMNS * step + GAP_M, ROWS * step + GAP_M, matte(grey(0.04)))
    nodes = {"chart_board": board}
    for index, (_, reflectance) in enumerate(patches()):
        row, column = divmod(index, COLUMNS)
        x, y = (column - (COLUMNS - 1) / 2) * step, ((ROWS - 1) / 2 - row) * step
        nodes[f"patch{index:02d}"] = panel(place @ translate(x, y, 0.0005), PATCH_M, PATCH_M, matte(reflectance))
    return nodes
