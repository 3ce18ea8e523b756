"""A processor of your own beside a built-in one, in a study: demosaicking by cells, the simplest there is.

    python examples/08_own_processor.py [SIZE]

Writes cells.png and the folder cells with its report.html.

New here: a function of yours as a processor, in `develop` and in a study.
Expect: cells of 2x2 pixels lose detail; they are behind bilinear interpolation by some dB.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import rodcone


def picture_by_cells(raw: rodcone.RawImage, matrix: ArrayLike, **options: Any) -> rodcone.Picture:
    """Develop a Bayer raw image: each cell of 2x2 pixels is one colour. Options go on to `rodcone.finish`."""
    height, width = raw.shape
    planes = []
    for channel in "RGB":
        sampled = rodcone.mask(raw.cfa, channel, raw.shape)
        cells = (raw.electrons * sampled).reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3))
        planes.append(np.kron(cells / sampled[:2, :2].sum(), np.ones((2, 2))))
    return rodcone.finish(raw, np.stack(planes, axis=-1), matrix, **options)


# A study takes it by this file's name. It develops the mosaic that it asks for, whichever a sensor has.
develop = rodcone.Processor("bayer", picture_by_cells, "cells of a Bayer mosaic")


def main(size: int) -> None:
    """Photograph a star, then compare with the conventional camera over two light levels."""
    print("processors by name:", ", ".join(rodcone.processors()[:4]), "...")
    radiance = rodcone.render("siemens_star", (size, size), spp=64).relight(luminance_cd_m2=25.0)
    raw = rodcone.capture(radiance, rodcone.low_noise(cfa="bayer"), "10ms")
    # A Python file may do all that you may, so rodcone runs one only with your consent.
    picture = rodcone.develop(raw, processor=f"{__file__}:develop", trust_code=True)
    rodcone.write_picture(picture, "cells.png")

    study = rodcone.Study(
        scenes=(rodcone.SceneChoice("siemens_star"),),
        levels=("0.5cd/m2", "25cd/m2"),
        processors=(f"{__file__}:develop", "bayer"),  # neither removes noise
        seeds=(0, 1),
        name="cells",
        render=rodcone.RenderLimits(size=size, spp=64),
        trust_code=True,
    )
    rodcone.sweep(study, "cells")
    for row in rodcone.read_rows("cells"):
        print(f"{row.level:>9}  {row.processor:9}  seed {row.seed}  {row.psnr_db:.1f} dB  FLIP {row.flip_mean:.3f}")
    print("open", rodcone.report("cells", "cells/report.html"))


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 96)
