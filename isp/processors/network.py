"""Demosaicking of Bayer by a learned network, the one opponent without a closed form.

M. Gharbi, G. Chaurasia, S. Paris, F. Durand, "Deep joint demosaicking and denoising", ACM Trans. Graph. 35(6), 2016, in
the form that its authors released as the package `demosaicnet` (MIT License). Its weights stay in the wheel that a user
fetched, ``pip download --no-deps demosaicnet``, and named as a processor: ``FILE.whl:bayer_net``.

Three things are this project's: weights are read as arrays, so that nothing is unpickled; the mosaic is reflected about
its outermost pixels; and samples are scaled so that the quantile `WHITE` is 1.
"""

import io
import math
import pickletools
from collections.abc import Mapping
from functools import cache, partial
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from isp.colour.noise_gains import measured_gains
from isp.processors.bayer_denoised import picture_demosaicked_first
from isp.processors.catalogue import Processor
from isp.processors.convolution import convolve
from isp.processors.demosaic import require_bayer
from isp.processors.sub_images import EXTRA as BM3D
from isp.processors.sub_images import bm3d
from rodcone.errors import one_line
from rodcone.types import Image, Mosaic
from sensor.cfa import Tile

MEMBER = "demosaicnet/data/bayer.pth"
LAYERS = {  # shape of each layer's weights: out, in, height, width
    "main_processor.pack_mosaic": (4, 3, 2, 2),
    "main_processor.conv1": (64, 4, 3, 3),
    **{f"main_processor.conv{n}": (64, 64, 3, 3) for n in range(2, 15)},
    "main_processor.conv15": (128, 64, 3, 3),
    "residual_predictor": (12, 64, 1, 1),
    "upsampler": (12, 1, 2, 2),
    "fullres_processor.post_conv": (64, 6, 3, 3),
    "fullres_processor.output": (3, 64, 1, 1),
}
REACH = 32  # distance [pixels] up to which a value depends on others: fifteen 3x3 filters of 2x2 tiles, one of pixels
WHITE = 0.999  # quantile of a frame's samples that is scaled to 1 for the network
MOST_BYTES = 1 << 24  # largest wheel that is read; demosaicnet's has 3.7 MB
_LEAST = 1e-6  # least divisor [units of noise]
NAMES = ("bayer_net", "bayer_net_bm3d")
SOURCE = "Gharbi, Chaurasia, Paris & Durand 2016, learned"
Weights = Mapping[str, NDArray[np.float32]]


@cache
def network_processor(name: str, wheel: bytes) -> Processor:
    """Make the processor ``bayer_net``, or ``bayer_net_bm3d``, which denoises its pictures by colour BM3D.

    Raises
    ------
    ValueError
        For another name, or a wheel without the weights.
    """
    if name not in NAMES:
        raise ValueError(f"it has no {name!r}, only {' and '.join(NAMES)}")
    denoise, extra, gains = (None, None, name) if name == NAMES[0] else (bm3d, BM3D, "bayer_residual_bm3d")
    network = partial(demosaic, weights=read_weights(wheel))
    picture = partial(picture_demosaicked_first, demosaic=network, denoise=denoise)
    # The noise that BM3D leaves hardly depends on the demosaicking: the gains of `bayer_residual_bm3d` apply here too.
    return Processor("bayer", picture, SOURCE, extra=extra, noise_gains=measured_gains()[gains])


def read_weights(wheel: bytes) -> Weights:
    """Read the arrays of demosaicnet's wheel by name; raise `ValueError` for another file."""
    shapes: dict[str, tuple[int, ...]] = {f"{name}.weight": shape for name, shape in LAYERS.items()}
    shapes |= {f"{name}.bias": (3 if name == "upsampler" else shape[0],) for name, shape in LAYERS.items()}
    most = 8 * sum(math.prod(shape) for shape in shapes.values())  # bytes: twice what they take
    try:
        with ZipFile(io.BytesIO(wheel)) as members, members.open(MEMBER) as member:
            content = member.read(most)
    except Exception as error:  # damaged members fail in many ways, each compression in its own
        raise ValueError(f"it is no wheel of demosaicnet ({one_line(error)})") from error
    return read_network(content, shapes)


def read_network(content: bytes, shapes: Mapping[str, tuple[int, ...]]) -> Weights:
    """Read arrays of 32-bit floats by name from a file of torch's first format.

    The file begins with pickles that name the arrays. Only texts are read from them; nothing that they would call is
    executed.

    Parameters
    ----------
    content : bytes
    shapes : mapping of str to tuple of int
        Names and shapes of the arrays to read.

    Raises
    ------
    ValueError
        For a file without one of them.
    """
    file = io.BytesIO(content)
    try:
        texts = [[text for code, text, _ in pickletools.genops(file) if code.name == "BINUNICODE"] for _ in range(5)]
        words = [word for word in texts[3] if word != "storage"]  # a name, then its array's key, and so on
        arrays = {}
        for key in texts[4]:
            count = int.from_bytes(file.read(8), "little")
            arrays[key] = np.frombuffer(file.read(4 * count), "<f4", count)
        weights = {name: arrays[words[words.index(name) + 1]].reshape(shape) for name, shape in shapes.items()}
    except (ArithmeticError, LookupError) as error:
        raise ValueError(f"its arrays can't be read ({one_line(error)})") from error
    if not all(np.isfinite(weight).all() for weight in weights.values()):
        raise ValueError("its arrays hold what is no number")
    return weights


def demosaic(mosaic: Mosaic, cfa: Tile, weights: Weights) -> Image:
    """Demosaic by the network to planes of R, G and B, shape (h, w, 3).

    Parameters
    ----------
    mosaic : (h, w) float64
        Balanced mosaic, encoded like a picture by roots of light or sRGB. It is scaled so that the quantile `WHITE` is
        1, because the network was trained on values of 0 to 1.
    """
    require_bayer(cfa)
    # The network's tile begins with G in a row of R; the mosaic is padded to this phase.
    phase = ["".join(cfa).index("R") // 2, 1 - "".join(cfa).index("R") % 2]
    before = [REACH + offset for offset in phase]
    after = [REACH + (size + offset) % 2 for size, offset in zip(mosaic.shape, phase, strict=True)]
    white = max(float(np.quantile(mosaic, WHITE)), _LEAST)
    padded = np.pad((mosaic / white).astype(np.float32), tuple(zip(before, after, strict=True)), mode="reflect")
    sites = np.zeros((*padded.shape, 3), np.float32)
    for row, column, colour in ((0, 0, 1), (0, 1, 0), (1, 0, 2), (1, 1, 1)):
        sites[row::2, column::2, colour] = padded[row::2, column::2]
    # Pack 2x2 pixels into four features, apply fifteen filters, multiply two halves, and unpack to pixels.
    features = _convolve(sites, weights, "main_processor.pack_mosaic", step=2)
    for n in range(1, 16):
        features = np.maximum(_convolve(features, weights, f"main_processor.conv{n}"), 0.0)
    residual = _convolve(features[..., :64] * features[..., 64:], weights, "residual_predictor")
    high, wide = residual.shape[:2]
    blocks = np.einsum(
        "hwck,ckt->hwct", residual.reshape(high, wide, 3, 4), weights["upsampler.weight"].reshape(3, 4, 4)
    )
    finer = blocks.reshape(high, wide, 3, 2, 2).transpose(0, 3, 1, 4, 2).reshape(2 * high, 2 * wide, 3)
    finer = finer + weights["upsampler.bias"]
    # Put the mosaic beside the result, and apply one filter of pixels and the output layer.
    both = np.concatenate([sites[30:-30, 30:-30], finer], axis=-1)
    features = np.maximum(_convolve(both, weights, "fullres_processor.post_conv"), 0.0)
    planes = _convolve(features, weights, "fullres_processor.output").astype(np.float64)
    inside = tuple(slice(1 + offset, 1 + offset + size) for offset, size in zip(phase, mosaic.shape, strict=True))
    return planes[inside] * white


def _convolve(values: NDArray[np.float32], weights: Weights, layer: str, step: int = 1) -> NDArray[np.float32]:
    return convolve(values, weights[f"{layer}.weight"], weights[f"{layer}.bias"], step)
