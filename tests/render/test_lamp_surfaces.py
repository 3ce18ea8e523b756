"""A lamp's own surface where its shape states none: black, under every light group, as Mitsuba makes it."""

from pathlib import Path

import numpy as np
import pytest
from stock_mitsuba import picture_of_file, spectral_film

from render.engine import render
from render.geometry import look_at, to_world
from render.scene import LightGroup, Scene, uniform_node
from render.spectrum import flat
from render.user_scene.scene_file import load_scene_file

NM, WIDTH_NM = np.array([425.0, 500.0, 575.0, 650.0]), 60.0
CAMERA = {"type": "perspective", "fov": 20.0, "to_world": to_world(look_at((0, 0, 4), (0, 0, 0)))}
SUN = {"type": "directional", "direction": [0, 0, -1]}


def panel_and_sun(**panel: object) -> Scene:
    shape = {"type": "rectangle", "emitter": {"type": "area"}, **panel}
    geometry = {"type": "scene", "sensor": CAMERA, "panel": shape, "sun": SUN}
    groups = {"panel": LightGroup(("panel/emitter",), flat(0.01)), "sun": LightGroup(("sun",), flat())}
    return Scene("panel", geometry, groups)


def test_a_panel_without_a_bsdf_reflects_nothing_of_another_light() -> None:
    made = render(panel_and_sun(), (4, 4), wavelength_nm=NM, width_nm=WIDTH_NM, spp=16)
    np.testing.assert_allclose(made.relight().values, 0.01, rtol=0, atol=1e-5)


def test_a_panel_with_a_bsdf_or_a_reference_to_one_keeps_it() -> None:
    half = {"type": "diffuse", "reflectance": uniform_node(0.5)}
    scene = panel_and_sun(surface={"type": "ref", "id": "cloth"})
    geometry = {**scene.geometry, "cloth": half}
    for made_of in (panel_and_sun(surface=half), Scene("panel", geometry, scene.groups)):
        made = render(made_of, (4, 4), wavelength_nm=NM, width_nm=WIDTH_NM, spp=16)
        np.testing.assert_allclose(made.relight().values, 0.01 + 0.5 / np.pi, rtol=1e-5)


ROOM = f"""<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="8"/></integrator>
<sensor type="perspective"><float name="fov" value="70"/>
<transform name="to_world"><lookat origin="0, 0, 0.95" target="0, 0, 0" up="0, 1, 0"/></transform>
{spectral_film((16, 16), NM, WIDTH_NM)}</sensor><shape type="cube" id="room"><boolean name="flip_normals" value="true"/>
<bsdf type="diffuse"><spectrum name="reflectance" value="380:0.4, 780:0.6"/></bsdf></shape>
<shape type="rectangle" id="ceiling">CEILING<transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/>
<translate y="0.97"/></transform><emitter type="area"><spectrum name="radiance" value="1"/></emitter></shape>
<shape type="disk" id="wall">WALL<transform name="to_world"><scale value="0.3"/><rotate y="1" angle="90"/>
<translate x="-0.97"/></transform><emitter type="area"><spectrum name="radiance" value="3"/></emitter>
</shape></scene>"""
GREY = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.3"/></bsdf>'


@pytest.mark.thorough
@pytest.mark.parametrize(("ceiling", "wall"), [("", ""), (GREY, ""), (GREY, GREY)])
def test_a_room_with_two_lamps_is_what_stock_mitsuba_renders(ceiling: str, wall: str, tmp_path: Path) -> None:
    path = tmp_path / "room.xml"
    path.write_text(ROOM.replace("CEILING", ceiling).replace("WALL", wall))
    options = {"wavelength_nm": NM, "width_nm": WIDTH_NM, "max_depth": 8, "spp": 4096}
    made = render(load_scene_file(path).scene, (16, 16), **options).relight()
    # Both means scatter by 0.02 %; a surface of 0.5 in place of black made 0.31 % of the picture's mean.
    assert made.values.mean(axis=(0, 1), dtype=np.float64) == pytest.approx(
        picture_of_file(path, 8192, seed=7).mean(axis=(0, 1)) / WIDTH_NM, rel=1e-3
    )
