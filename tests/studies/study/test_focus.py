"""Depth of field: the circle of confusion in closed form, on the sensor and in a render."""

from dataclasses import replace
from math import radians, tan

import numpy as np
import pytest
from refusal import refusal

from render.engine import render
from render.geometry import camera, thin_lens
from render.scene import LightGroup, Scene
from render.spectrum import flat
from sensor.lens.focus import circle_of_confusion_um, focal_length_of_view_mm, pupil_mm
from sensor.presets import low_noise, preset
from studies.photograph.shot import Order, check
from studies.study.focus import in_focus
from studies.study.lit_scene import open_all
from studies.study.model import LensTerms
from studies.study.study import SceneChoice, Study
from studies.study.study_file import EXAMPLES, read_study

SIDE, VIEW_DEG, RADIUS_M = 48, 8.0, 1e-3


def lamp(distance_m: float) -> Scene:
    """Small ball that gives light, straight ahead of the camera."""
    ball = {"type": "sphere", "center": [0.0, 0.0, 0.0], "radius": RADIUS_M, "emitter": {"type": "area"}}
    geometry = {"type": "scene", "sensor": camera(VIEW_DEG, (0, 0, distance_m), (0, 0, 0), (SIDE, SIDE)), "ball": ball}
    return Scene("lamp", geometry, {"ball": LightGroup(("ball/emitter",), flat())})


def spread_px(light: np.ndarray) -> float:
    """Diameter of an even disc that has the second moment of the light, both axes together."""
    y, x = np.indices(light.shape) - (np.array(light.shape) - 1)[:, None, None] / 2
    total = light.sum()
    moment = sum(((z - (light * z).sum() / total) ** 2 * light).sum() / total for z in (x, y))
    return float(np.sqrt(8 * moment))


@pytest.mark.parametrize("distance_m", [0.6, 2.0])
def test_a_point_out_of_focus_becomes_a_disc_of_the_closed_form_s_diameter(distance_m):
    sensor, focus_m, focal_mm = low_noise(), 1.0, 50.0
    sensor = replace(sensor, lens=replace(sensor.lens, f_number=2.0))
    scene, words = in_focus(lamp(distance_m), sensor, (SIDE, SIDE), focus_m, focal_mm)
    assert words == "through f/2, 50 mm, focused at 1 m, a render of its own"
    light = render(scene, (SIDE, SIDE), wavelength_nm=[550.0], width_nm=[20.0], spp=2048).relight().values[..., 0]
    px_per_tangent = SIDE / (2 * tan(radians(VIEW_DEG / 2)))
    # On the sensor c, v behind the lens: the tangent c / v.
    behind_mm = focal_mm * focus_m * 1e3 / (focus_m * 1e3 - focal_mm)
    wide_px = circle_of_confusion_um(2.0, focal_mm, focus_m, distance_m) * 1e-3 / behind_mm * px_per_tangent
    # Second moments add: of the disc c^2 / 8, of the ball's own image, and of a pixel 1 / 12 along each axis.
    ball2_px = (2 * RADIUS_M / distance_m * px_per_tangent) ** 2
    assert spread_px(light) == pytest.approx(np.sqrt(wide_px**2 + ball2_px + 8 / 6), rel=0.03)
    assert wide_px > 4


def test_the_circle_is_that_of_similar_triangles():
    # f 100 mm at f/2, focused at 1.1 m: v = 110 mm; a point at 0.55 m images at v' = 122.2 mm. Triangle: 50 (v'-v)/v'.
    far_mm = 1 / (1 / 100 - 1 / 550)
    assert circle_of_confusion_um(2.0, 100.0, 1.1, 0.55) == pytest.approx(1e3 * 50 * (far_mm - 110) / far_mm, rel=1e-12)
    assert circle_of_confusion_um(2.0, 100.0, 1.1, 1.1) == 0.0
    assert circle_of_confusion_um(4.0, 100.0, 1.1, 0.55) == circle_of_confusion_um(2.0, 100.0, 1.1, 0.55) / 2


def test_without_a_focal_length_the_sensor_is_as_wide_as_the_pixels():
    focal_mm = focal_length_of_view_mm(36.0, 40.0, 2.0)
    behind_mm = 1 / (1 / focal_mm - 1 / 2000.0)
    assert 2 * behind_mm * tan(radians(20.0)) == pytest.approx(36.0, rel=1e-12)
    sensor = low_noise()
    by_pixels, _ = in_focus(lamp(1.0), sensor, (SIDE, SIDE), 1.0)
    focal_mm = focal_length_of_view_mm(SIDE * sensor.site_pitch_um * 1e-3, VIEW_DEG, 1.0)
    radius = by_pixels.geometry["sensor"]["aperture_radius"]
    assert radius == pytest.approx(pupil_mm(sensor.lens.f_number, focal_mm, 1.0) / 2000, rel=1e-12)
    assert by_pixels.geometry["sensor"]["focus_distance"] == 1.0


def test_what_has_no_depth_or_no_focus_is_refused():
    refusal(thin_lens, {"type": "orthographic"}, 0.01, 1.0, match="focus: the scene's camera is 'orthographic'")
    shifted = {"type": "perspective", "principal_point_offset_x": 0.1}
    refusal(thin_lens, shifted, 0.01, 1.0, match="principal_point_offset")
    refusal(in_focus, lamp(1.0), low_noise(), (8, 8), 0.05, 50.0, match="focus_m: 0.05 m with a focal length of 50 mm")
    refusal(check, Order("still_life", focal_length_mm=50.0), match="focal_length_mm: 50 without a distance of focus")
    refusal(check, Order("photo.exr", focus_m=2.0), match="focus-m: 2.0 for .*a stored picture")
    refusal(Order, "still_life", focus_m=0.0, match="focus_m: 0.0")


def test_a_study_s_scene_is_rendered_through_its_sensors_one_lens(tmp_path):
    near = SceneChoice("still_life", focus_m=1.85, focal_length_mm=200.0)
    study = Study([SceneChoice("still_life"), near], ["10cd/m2"], sensors=["low_noise", "dual_gain"])
    pinhole, seen = open_all(study).values()
    sensor = seen.scene.geometry["sensor"]
    assert (pinhole.scene.geometry["sensor"]["type"], sensor["type"]) == ("perspective", "thinlens")
    assert sensor["aperture_radius"] == pytest.approx(0.1 / low_noise().lens.f_number)
    assert pinhole.identity != seen.identity
    assert [choice.label for choice in study.scenes] == ["still_life", "still_life, 200 mm focused at 1.85 m"]
    # A lens by data brings its own f-number, and the pupil follows.
    (behind,) = open_all(replace(study, scenes=(near,), lens=LensTerms(table="double_gauss"))).values()
    assert behind.scene.geometry["sensor"]["aperture_radius"] == pytest.approx(0.05, rel=1e-3)
    path = tmp_path / "study.toml"
    path.write_text('scenes = [{source = "still_life", focus_m = 2, focal_length_mm = 50}]\nlevels = ["1lux"]\n')
    assert read_study(path).scenes[0].focus_m == 2.0

    def wrong(choice, **changes):
        return refusal(open_all, replace(study, scenes=(choice,), **changes), match="focus_m: 2 with sensors of f/")

    wrong(SceneChoice("still_life", focus_m=2.0), sensors=("low_noise", "table1_output_6um"))
    wrong(SceneChoice("still_life", focus_m=2.0), sensor_side_um=500.0)
    refusal(SceneChoice, "still_life", focal_length_mm=50.0, match="focal_length_mm: 50 without a distance of focus")


def test_the_example_s_sensors_state_the_discs_of_one_lens_at_its_f_numbers():
    study = read_study(EXAMPLES / "depth_of_field.toml")
    lenses = [preset(name).lens for name in study.sensors]
    assert [lens.f_number for lens in lenses] == [1.4, 2.8, 5.6]
    for lens in lenses:
        disc_um = circle_of_confusion_um(lens.f_number, 12.0, 1.0, 1.1)
        assert lens.defocus_um == pytest.approx(disc_um, abs=0.005)  # of two digits
    assert {preset(name).pixel for name in study.sensors} == {low_noise().pixel}


def test_the_first_line_tells_the_lens_and_light_that_is_there_is_left_aside():
    focused = check(Order("still_life", focus_m=1.0, focal_length_mm=50.0, size=64))
    assert "through f/" in focused.cost.words()
    assert focused.ready is None
    assert focused.opened.scene.geometry["sensor"]["type"] == "thinlens"
    assert "through" not in check(Order("still_life", size=64)).cost.words()
