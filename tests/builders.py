"""Values that many tests need, built by hand."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.level import PassMeans
from render.scene import LightGroup
from render.transport import Transport


def transport_of(
    radiance: NDArray[np.float32],
    groups: Mapping[str, LightGroup],
    wavelength_nm: ArrayLike,
    width_nm: ArrayLike,
    *,
    seen: NDArray[np.float32] | None = None,
    irradiance: NDArray[np.float64] | None = None,
    **changes: Any,
) -> Transport:
    """Transport of radiance (group, band, h, w) in eight passes of eight samples that don't differ.

    `seen` (group, h, w) is the share of each pixel in which each group's light is seen directly, none by default.
    """
    given, bands, *size = radiance.shape
    seen = np.zeros((given, *size), np.float32) if seen is None else seen
    scattered = radiance.mean(axis=(2, 3), dtype=np.float64) - seen.mean(axis=(1, 2), dtype=np.float64)[:, None]
    means = PassMeans(
        spp=np.full(8, 8),
        uncovered=np.full(8, 1 - seen.sum(axis=0).mean(dtype=np.float64)),
        radiance=np.repeat(scattered[None], 8, axis=0),
        irradiance=None if irradiance is None else np.repeat(irradiance[None], 8, axis=0),
    )
    facts = {"stopped_by": "samples", "seconds": 1.0, "integrator": "none", "variant": "none", "spp": 64, "passes": 8}
    errors = {name: np.zeros((given, bands, *size), np.float32) for name in ("half_difference", "variance")}
    return Transport(
        **{
            "radiance": radiance,
            "coverage": seen.sum(axis=0),
            "seen": tuple(seen[:, None]),
            "pass_means": means,
            "groups": dict(groups),
            "wavelength_nm": np.asarray(wavelength_nm, np.float64),
            "width_nm": np.asarray(width_nm, np.float64),
            **errors,
            **facts,
            **changes,
        }
    )
