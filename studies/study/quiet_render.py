"""Rendering until the render's own noise is small beside the sensor's, or a cap stops it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from render.engine import render
from render.scene import Scene
from render.transport import Transport

FIRST_SPP = 128  # enough to tell how many more it takes
MARGIN = 1.05  # on samples that the share so far asks for: it is an estimate
MOST_GROWTH = 4.0  # of samples from one look to the next


def render_quietly(
    scene: Scene,
    size: tuple[int, int],
    share: Callable[[Transport], float],
    *,
    most_share: float,
    max_spp: int,
    max_seconds: float | None,
    **options: Any,
) -> Transport:
    """Render until `share` is `most_share` or less, or samples or time are used up; what was made is kept.

    Parameters
    ----------
    share : callable
        The render's noise variance over the sensor's own, such as `studies.budget.budget.render_share`.
    most_share : float
    max_spp : int
        Samples a pixel, at most.
    max_seconds : float or None
        Time, at most.
    **options
        Of `render.engine.render`: bands, seed, cache, progress.
    """
    made, wanted = None, min(FIRST_SPP, max_spp)
    while True:
        made = render(scene, size, max_spp=wanted, max_seconds=max_seconds, resume=made, **options)
        now = share(made)
        if now <= most_share or made.stopped_by != "samples" or made.spp >= max_spp:
            return made
        wanted = min(max_spp, int(np.ceil(made.spp * min(MARGIN * now / most_share, MOST_GROWTH))))
