"""Mitsuba's own `path` and `specfilm` on a scene of this project: what the engine is compared with."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.loader import mitsuba_module
from render.scene import Scene


def stock(
    scene: Scene,
    size: tuple[int, int],
    nm: ArrayLike,
    width_nm: ArrayLike,
    *,
    spp: int,
    passes: int,
    seed: int,
    sampler: str = "multijitter",
) -> NDArray[np.float64]:
    """Band averages (pass, band, h, w) over paths of 8 segments, lights at their own spectra; seeds from `seed` on."""
    mi, description = mitsuba_module(), scene.description
    film: dict[str, Any] = {"type": "specfilm", "width": size[1], "height": size[0], "component_format": "float32"}
    widths = np.broadcast_to(width_nm, np.shape(nm))
    for index, (centre, width) in enumerate(zip(np.asarray(nm), widths, strict=True)):
        ends = {"wavelength_min": centre - width / 2, "wavelength_max": centre + width / 2}
        film[f"band{index:03d}"] = {"type": "regular", **ends, "values": "1,1"}
    film["rfilter"] = {"type": "box"}
    description["sensor"] = {**description["sensor"], "film": film, "sampler": {"type": sampler}}
    description["integrator"] = {"type": "path", "max_depth": 8}
    loaded = mi.load_dict(description)
    made = [np.asarray(mi.render(loaded, spp=spp, seed=seed + k), np.float64) for k in range(passes)]
    return np.moveaxis(np.stack(made), -1, 1) / widths[:, None, None]
