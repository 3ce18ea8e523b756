"""Make the first page's picture, one dim still life by two mosaics: `python docs/dim_light.py`.

The lines are those of README: light that comes along, one pixel, one exposure, one method; left RGBW, right Bayer.
"""

from pathlib import Path

import numpy as np
from PIL import Image

import rodcone

OUT = Path(__file__).resolve().parent / "images" / "dim_light.webp"
GAP = 8  # pixels


def main() -> None:
    """Write the picture."""
    radiance = rodcone.load_transport("still_life").relight(luminance_cd_m2=0.05)
    shown = []
    for mosaic in ("rgbw", "bayer"):
        raw = rodcone.capture(radiance, rodcone.low_noise(cfa=mosaic), "66ms")
        shown.append(np.rint(255 * rodcone.develop(raw).encode()).astype(np.uint8))
    gap = np.full((shown[0].shape[0], GAP, 3), 255, dtype=np.uint8)
    Image.fromarray(np.hstack([shown[0], gap, shown[1]])).save(OUT, quality=80, method=6)


if __name__ == "__main__":
    main()
