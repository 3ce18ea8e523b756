"""Depth of field of a thin lens: the diameter of the disc that a point out of focus becomes on the sensor.

A lens with the focal length f, focused at the distance s, forms its image at v = f s / (s - f) behind it. A point at
the distance d becomes a disc, because the lens's pupil has the diameter f / N. The disc's diameter is

    c = f^2 / N |d - s| / (d (s - f)),

the circle of confusion. Distances are those along the line of sight, from the lens.
"""

from math import radians, tan

from rodcone.errors import InputError


def focal_length_of_view_mm(width_mm: float, view_deg: float, focus_m: float) -> float:
    """Return the focal length [mm] of a lens that, focused at a distance, gives a sensor this angle of view.

    Parameters
    ----------
    width_mm : float
        Width of the sensor.
    view_deg : float
        Angle of view across that width.
    focus_m : float
    """
    behind_mm = width_mm / 2 / tan(radians(view_deg / 2))
    return 1 / (1 / behind_mm + 1 / (focus_m * 1e3))


def pupil_mm(f_number: float, focal_length_mm: float, focus_m: float) -> float:
    """Return the diameter of a lens's pupil [mm].

    Raises
    ------
    InputError
        For a distance within the focal length.
    """
    if focus_m * 1e3 <= focal_length_mm:
        raise InputError(
            f"focus_m: {focus_m:g} m with a focal length of {focal_length_mm:g} mm; allowed: a distance beyond it; "
            "focus farther away"
        )
    return focal_length_mm / f_number


def circle_of_confusion_um(f_number: float, focal_length_mm: float, focus_m: float, distance_m: float) -> float:
    """Return the diameter [um] of the disc that a point becomes on the sensor, which is `defocus_um` for its distance.

    Parameters
    ----------
    f_number, focal_length_mm : float
    focus_m : float
        Distance at which the lens is focused.
    distance_m : float
        Distance of the point, above 0.

    Raises
    ------
    InputError
        For a distance of focus within the focal length.
    """
    behind = focal_length_mm / (focus_m * 1e3 - focal_length_mm)  # size of an image in focus over that of its object
    return 1e3 * pupil_mm(f_number, focal_length_mm, focus_m) * behind * abs(distance_m - focus_m) / distance_m
