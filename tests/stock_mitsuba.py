"""Mitsuba's own `path` and `specfilm` on a scene of this project: what the engine is compared with."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from render.loader import mitsuba_module
from render.scene import Scene
from render.user_scene.scene_paths import search_path


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


_BAND = (
    '<spectrum name="band{}" type="regular"><float name="wavelength_min" value="{}"/>'
    '<float name="wavelength_max" value="{}"/><string name="values" value="1, 1"/></spectrum>'
)


def spectral_film(size: tuple[int, int], nm: NDArray[np.float64], width_nm: float) -> str:
    """Sampler and film of a scene's XML whose pixels are sums over bands."""
    bands = "".join(_BAND.format(i, centre - width_nm / 2, centre + width_nm / 2) for i, centre in enumerate(nm))
    return (
        f'<sampler type="multijitter"/><film type="specfilm"><integer name="width" value="{size[1]}"/>'
        f'<integer name="height" value="{size[0]}"/><string name="component_format" value="float32"/>'
        f'<rfilter type="box"/>{bands}</film>'
    )


def picture_of_file(path: Path, spp: int, seed: int) -> NDArray[np.float64]:
    """Mitsuba's own render of a scene's XML as it stands."""
    mi, kept = mitsuba_module(), mitsuba_module().file_resolver()
    mi.set_file_resolver(search_path(mi, path.parent))
    try:
        loaded = mi.load_file(str(path))
    finally:
        mi.set_file_resolver(kept)
    return np.asarray(mi.render(loaded, spp=spp, seed=seed), np.float64)


def write_bitmap(path: Path) -> NDArray[np.uint8]:
    """Write a picture of 4 x 4 pixels, none of them dark or full, and give its values."""
    pixels = np.random.default_rng(5).integers(30, 230, (4, 4, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(path)
    return pixels
