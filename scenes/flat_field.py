"""A grey wall in a constant environment: every pixel has the same, known radiance."""

from render.geometry import look_at, to_world
from render.scene import Scene
from rodcone.errors import require_range
from scenes.materials import matte, panel, under_sky
from scenes.reflectances import grey


def flat_field(reflectance: float = 0.5, light: str = "D65") -> Scene:
    """Build a Lambertian wall of one reflectance; its radiance is exactly `reflectance` times the sky's.

    Parameters
    ----------
    reflectance : float
        0 to 1, at every wavelength.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    require_range("reflectance", reflectance, 0.0, 1.0, "give a fraction: 18 % is 0.18")
    view = {"type": "perspective", "fov": 30.0, "to_world": to_world(look_at((0, 0, 3), (0, 0, 0)))}
    wall = panel(look_at((0, 0, 0), (0, 0, 1)), 20.0, 20.0, matte(grey(reflectance)))
    return under_sky("flat_field", view, {"wall": wall}, light, reference_plane="wall")
