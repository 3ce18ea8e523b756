"""Mitsuba's own path integrator without the light that the camera sees directly: the slow form, without Dr.Jit."""

from typing import Any


def scattered_path(mi: Any) -> Any:
    """Build the integrator class for a scalar variant; register it as ``scatteredpath`` (``max_depth``, ``rr_depth``).

    The light that is left out is taken from the same samples, and so leaves no noise of its own behind.
    """

    class ScatteredPath(mi.SamplingIntegrator):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            depths = {name: int(props[name]) for name in ("max_depth", "rr_depth")}
            self.path = mi.load_dict({"type": "path", **depths})

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            light, _, _ = self.path.sample(scene, sampler, ray, medium, active)
            si = scene.ray_intersect(ray)
            emitter = si.emitter(scene)
            return light if emitter is None else light - emitter.eval(si), True, []

    return ScatteredPath
