"""Depth of field of a rendered scene, from the camera's f-number and the requested distance of focus."""

from dataclasses import replace

from render.geometry import horizontal_view_deg, thin_lens
from render.scene import Scene
from sensor.config import SensorConfig
from sensor.lens.focus import focal_length_of_view_mm, pupil_mm


def in_focus(
    scene: Scene, sensor: SensorConfig, size: tuple[int, int], focus_m: float, focal_length_mm: float | None = None
) -> tuple[Scene, str]:
    """Return the scene as a lens focused at a distance sees it, and the lens in words.

    A render of this scene is valid for this f-number alone, and is stored apart from others.

    Parameters
    ----------
    scene : Scene
        A scene whose lengths are in metres.
    sensor : SensorConfig
        Sensor whose lens states the f-number, and whose pixels give the default focal length.
    size : (int, int)
        Height and width of the picture in photodiodes.
    focus_m : float
    focal_length_mm : float, optional
        Left out, the focal length for a sensor as wide as the picture's pixels; for few pixels the lens then has a
        small pupil.

    Raises
    ------
    InputError
        For a camera without perspective, and a distance within the focal length.
    """
    camera = scene.geometry["sensor"]
    f_number = sensor.lens.f_number
    thin_lens(camera, 1.0, focus_m)  # raises an error for a camera without an angle of view
    view_deg = horizontal_view_deg(camera, size)
    if focal_length_mm is None:
        focal_length_mm = focal_length_of_view_mm(size[1] * sensor.site_pitch_um * 1e-3, view_deg, focus_m)
    pupil_m = pupil_mm(f_number, focal_length_mm, focus_m) * 1e-3
    seen = replace(scene, geometry={**scene.geometry, "sensor": thin_lens(camera, pupil_m, focus_m)})
    return seen, f"through f/{f_number:g}, {focal_length_mm:.3g} mm, focused at {focus_m:g} m, a render of its own"
