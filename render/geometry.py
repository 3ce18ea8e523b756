"""4x4 transforms that place things and the camera: NumPy arrays, and the plain values that a scene's dict holds."""

from collections.abc import Mapping, Sequence
from math import radians, tan
from typing import Any, TypeAlias

import numpy as np

from rodcone import jit
from rodcone.errors import InputError, unknown
from rodcone.types import Floats

Point: TypeAlias = tuple[float, float, float]  # [m]


def translate(x: float, y: float, z: float) -> Floats:
    """Return the matrix that shifts by (x, y, z) [m]."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scale(x: float, y: float, z: float) -> Floats:
    """Return the matrix that stretches along each axis."""
    return np.diag([x, y, z, 1.0])


def rotate(axis: Sequence[float], degrees: float) -> Floats:
    """Return the matrix that turns about an axis through the origin, right-handed (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def look_at(origin: Sequence[float], target: Sequence[float], up: Sequence[float] = (0.0, 1.0, 0.0)) -> Floats:
    """Return the matrix that places a camera (or anything that faces +z) at `origin` and turns it towards `target`.

    Raises
    ------
    InputError
        If the two are the same place, or `up` points from one to the other.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.look_at((0, 0, 5), (0, 0, 0))[:3, 3]  # the place of the camera [m]
    array([0., 0., 5.])
    """
    start = np.asarray(origin, dtype=np.float64)
    forward = np.asarray(target, dtype=np.float64) - start
    left = np.cross(up, forward)
    if not left.any():
        raise InputError(
            f"target: {target} lies at {origin}, or straight {up} of it; give another target, or another up"
        )
    forward /= np.linalg.norm(forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(forward, left), forward, start], axis=1)
    return matrix


def to_world(*transforms: Floats) -> Any:
    """Multiply transforms, the last applied first, into the form that `mitsuba.load_dict` takes in every variant."""
    return jit.Matrix4(np.linalg.multi_dot([*transforms, np.eye(4)]).tolist())


def camera(fov_deg: float, origin: Point, target: Point, size: tuple[int, int] | None = None) -> dict[str, Any]:
    """Describe a perspective camera with `fov_deg` across the shorter side; `size` is the film's height and width."""
    pose = to_world(look_at(origin, target))
    view = {"type": "perspective", "fov": fov_deg, "fov_axis": "smaller", "to_world": pose}
    return view | ({"film": {"type": "hdrfilm", "height": size[0], "width": size[1]}} if size else {})


def thin_lens(camera: Mapping[str, Any], pupil_m: float, focus_m: float) -> dict[str, Any]:
    """Give a pinhole camera depth of field: return a camera of the same view that is sharp at one distance.

    Parameters
    ----------
    camera : mapping
        Camera of Mitsuba's type ``perspective``, or ``thinlens``, whose own lens is replaced.
    pupil_m, focus_m : float
        Diameter of the pupil, and distance of focus, in the scene's unit of length.

    Raises
    ------
    InputError
        For an orthographic camera, and for one whose axis isn't in the middle of its picture.
    """
    if camera.get("type") not in ("perspective", "thinlens"):
        raise InputError(
            f"focus: the scene's camera is {camera.get('type')!r}; allowed: perspective, thinlens; leave the focus out"
        )
    if any(camera.get(f"principal_point_offset_{axis}") for axis in "xy"):
        raise InputError("focus: the scene's camera has a principal_point_offset; allowed: none; leave the focus out")
    kept = {name: value for name, value in camera.items() if not name.startswith("principal_point_offset")}
    return kept | {"type": "thinlens", "aperture_radius": pupil_m / 2, "focus_distance": focus_m}


def horizontal_view_deg(camera: Mapping[str, object], size: tuple[int, int]) -> float:
    """Compute the horizontal angle of view of a Mitsuba camera's picture.

    It is 0 for an ``orthographic`` camera, whose rays are all parallel.
    """
    if camera.get("type") == "orthographic":
        return 0.0
    field = camera.get("fov")
    axis = camera.get("fov_axis", "x")
    if not isinstance(field, int | float):
        field = _field_of_focal_length(camera.get("focal_length", "50mm"))
        axis = "diagonal"
    height, width = size
    spans = {
        "x": width,
        "y": height,
        "smaller": min(size),
        "larger": max(size),
        "diagonal": float(np.hypot(height, width)),
    }
    if str(axis).lower() not in spans:
        raise unknown("camera: fov_axis", axis, spans)
    half = tan(radians(float(field) / 2)) * width / spans[str(axis).lower()]
    return float(2 * np.degrees(np.arctan(half)))


def _field_of_focal_length(focal_length: object) -> float:
    """Convert a focal length to the diagonal angle of view [degrees] on film of 36 mm x 24 mm, as Mitsuba does."""
    try:
        focal_length_mm = float(str(focal_length).removesuffix("mm"))
    except ValueError:
        focal_length_mm = 0.0
    if not 0 < focal_length_mm < np.inf:
        raise InputError(f"camera: focal_length {focal_length!r} is no length; allowed: above 0; give '50mm'")
    return float(2 * np.degrees(np.arctan(np.hypot(36.0, 24.0) / (2 * focal_length_mm))))
