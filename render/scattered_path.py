"""Mitsuba's own path integrator with the light that is seen directly kept apart: the slow form, without Dr.Jit."""

from typing import Any


def scattered_path(mi: Any) -> Any:
    """Build the integrator class for a scalar variant; register it as ``scatteredpath``.

    Property of the plug-in: ``max_depth``. After the film's bands comes a channel with the share of paths that meet a
    light first; that light is left out of the bands.
    """

    class ScatteredPath(mi.SamplingIntegrator):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.path = mi.load_dict({"type": "path", "max_depth": int(props["max_depth"])})

        def aov_names(self) -> list[str]:
            return ["coverage"]

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            light, _, _ = self.path.sample(scene, sampler, ray, medium, active)
            si = scene.ray_intersect(ray)
            emitter = si.emitter(scene)
            if emitter is None:
                return light, True, [0.0]
            seen = emitter.eval(si)
            return light - seen, True, [float(any(value != 0 for value in seen))]

    return ScatteredPath
