"""Values that many tests need, built by hand, and the libraries that a processor needs."""

import io
import pickle
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from isp.processors import network
from isp.processors.catalogue import NAMED, libraries
from isp.settings import WhiteReading
from render.error_estimates import Halves
from render.level import Irradiance, SceneMeans
from render.scene import LightGroup
from render.transport import Transport
from sensor.cfa import BAYER, RGBW, Tile, channel_map, channels
from sensor.device import Device
from sensor.raw import RawImage

BAYER_PHASES: list[Tile] = [BAYER, ("GR", "BG"), ("GB", "RG"), ("BG", "GR")]
RGBW_PHASES: list[Tile] = [RGBW, ("GR", "WB"), ("BW", "RG"), ("WB", "GR")]
RGBW_4X4: Tile = ("RWGW", "WBWG", "GWBW", "WGWR")  # W on a checkerboard, each colour on diagonals
# A pixel of a real chip, and one with every term there is, none of them large.
REAL_PIXEL = {
    "dark_current_e_per_s": 100.0,
    "column_gain_spread": 0.01,
    "column_offset_e": 3.0,
    "hot_pixel_share": 0.01,
    "hot_pixel_dark_current_e_per_s": 1e4,
    "crosstalk": 0.05,
}
EVERY_TERM = {
    "read_noise_e": 3.0,
    "dsnu_e": 4.0,
    "prnu": 0.02,
    "dark_current_e_per_s": 200.0,
    "column_gain_spread": 0.01,
    "column_offset_e": 2.0,
    "hot_pixel_share": 0.05,
    "hot_pixel_dark_current_e_per_s": 500.0,
    "crosstalk": 0.05,
}


def any_order(terms: int) -> float:
    """Most that two sums of the same positive terms differ by, relative, whatever order a processor adds them in.

    Each addition rounds once, by up to half an eps (Higham 2002, section 4.2). A quotient of two such sums counts both.
    """
    return terms * float(np.finfo(float).eps)


def single_precision(largest: NDArray[np.float64], full_e: float) -> NDArray[np.float64]:
    """Bound of the kernel's error [e-]: 1e-4 of full scale, or what rounding makes of the largest log weight.

    A log weight is right to some 16 roundings of 2^-24 (squares and their sum, of planes that are rounded). Two samples
    that share a pixel then share it wrongly by up to half of the sum of both errors.
    """
    return full_e * np.maximum(1e-4, 16 * 2.0**-24 * -largest)


def mosaic_of(planes: Mapping[str, ArrayLike], cfa: Tile, shape: tuple[int, int]) -> NDArray[np.float64]:
    """What each site sees of its own channel: a plane (h, w), or one number."""
    names = channel_map(cfa, shape)
    return np.select([names == name for name in planes], [np.broadcast_to(x, shape) for x in planes.values()], 0.0)


def behind(planes: NDArray[np.float64], cfa: Tile) -> NDArray[np.float64]:
    """What each site sees of planes (h, w, channel), channels in the mosaic's order."""
    return mosaic_of(dict(zip(channels(cfa), np.moveaxis(planes, -1, 0), strict=True)), cfa, planes.shape[:2])


def white_reading(raw: RawImage, colour: ArrayLike, window_shares: NDArray[Any] | None = None) -> WhiteReading:
    """What `isp.interleaved.panchromatic` reads of a frame whose surroundings have one colour [e-], without lines.

    The windows have the same shares, or those that are given, (row, column, channel) by tile.
    """
    tiles = [-(-length // size) for length, size in zip(raw.shape, (len(raw.cfa), len(raw.cfa[0])), strict=True)]
    of_white = np.asarray(colour)[raw.channels.index("W")]
    shares = np.broadcast_to(np.float32(colour / of_white), (*tiles, len(raw.channels))).copy()
    guide, lines = np.zeros(raw.shape, np.float32), np.zeros(tiles, np.float32)
    return WhiteReading(raw, shares, guide, lines, shares if window_shares is None else window_shares)


def even_device(shape: tuple[int, int]) -> Device:
    """Chip without fixed patterns."""
    return Device(np.ones(shape), np.zeros(shape))


def block_means(planes: NDArray[Any], block: int = 8) -> NDArray[np.float64]:
    """Means over blocks of pixels of (..., h, w)."""
    h, w = planes.shape[-2] // block, planes.shape[-1] // block
    return planes.reshape(*planes.shape[:-2], h, block, w, block).mean(axis=(-3, -1), dtype=np.float64)


def raw_image(dn: ArrayLike, cfa: Tile = RGBW, **changes: Any) -> RawImage:
    """Raw image of `dn` as uint16: one electron a DN, black 100, full well 15 000 e-, read noise and DSNU 1 e-."""
    calibration = {
        "black_dn": 100.0,
        "white_dn": 15_100.0,
        "gain_e_per_dn": 1.0,
        "read_noise_e": 1.0,
        "dsnu_e": 1.0,
        "prnu": 0.0,
        "exposure_s": 0.01,
    }
    return RawImage(dn=np.asarray(dn).astype(np.uint16), cfa=cfa, **{**calibration, **changes})


def transport_of(
    radiance: NDArray[np.float32],
    groups: Mapping[str, LightGroup],
    wavelength_nm: ArrayLike,
    width_nm: ArrayLike,
    *,
    seen: NDArray[np.float32] | None = None,
    irradiance: NDArray[np.float64] | None = None,
    spp: int = 64,
    **changes: Any,
) -> Transport:
    """Transport of radiance (group, band, h, w) of `spp` samples a pixel, in halves that don't differ.

    `seen` (group, h, w) is the share of each pixel in which each group's light is seen directly, none by default.
    """
    given, bands, *size = radiance.shape
    seen = np.zeros((given, *size), np.float32) if seen is None else seen
    scattered = radiance.mean(axis=(2, 3), dtype=np.float64) - seen.mean(axis=(1, 2), dtype=np.float64)[:, None]
    means = SceneMeans(
        radiance=scattered,
        uncovered=1 - float(seen.sum(axis=0).mean(dtype=np.float64)),
        covariance=np.zeros((scattered.size + 1,) * 2),
    )
    measured = None if irradiance is None else Irradiance(irradiance, np.zeros((irradiance.size,) * 2))
    facts = {"stopped_by": "samples", "seconds": 1.0, "integrator": "none", "variant": "none"}
    return Transport(
        **{
            "light": Halves(radiance, np.zeros_like(radiance)),
            "variance": np.zeros((given, bands, *size), np.float32),
            "coverage": Halves(seen.sum(axis=0), np.zeros(size, np.float32)),
            "seen": tuple(Halves(planes, np.zeros_like(planes)) for planes in seen[:, None]),
            "scene_means": means,
            "counts": np.full(size, spp, np.uint32),
            "groups": dict(groups),
            "wavelength_nm": np.asarray(wavelength_nm, np.float64),
            "width_nm": np.asarray(width_nm, np.float64),
            "meter": None if measured is None else lambda: measured,
            **facts,
            **changes,
        }
    )


def random_weights() -> dict[str, np.ndarray]:
    """Weights by the names and shapes of `isp.processors.network`."""
    rng = np.random.default_rng(1)
    weights = {}
    for name, shape in network.LAYERS.items():
        count = 3 if name == "upsampler" else shape[0]
        weights[f"{name}.weight"] = rng.normal(0, 1.5 / np.sqrt(np.prod(shape[1:])), shape).astype(np.float32)
        weights[f"{name}.bias"] = rng.normal(0, 0.1, count).astype(np.float32)
    return weights


def wheel_of(weights: dict[str, np.ndarray], before: bytes = b"", packed: int = zipfile.ZIP_STORED) -> bytes:
    """Wheel of demosaicnet as torch wrote it before 1.6: five pickles, the fourth with names and keys, the arrays."""
    texts = [[name, "storage", f"key {name}", "cpu"] for name in weights]
    keys = sorted(f"key {name}" for name in weights)
    parts = [before, *(pickle.dumps(part, 2) for part in (0x1950A86A20F9469CFC6C, 1001, {}, texts, keys))]
    for key in keys:
        array = weights[key.removeprefix("key ")]
        parts += [array.size.to_bytes(8, "little"), array.astype("<f4").tobytes()]
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", packed) as members:
        members.writestr(network.MEMBER, b"".join(parts))
    return out.getvalue()


def require_library(name: str) -> None:
    """Skip the test where a processor's libraries aren't installed."""
    for library in libraries(name):
        pytest.importorskip(library, reason=f"rodcone[{NAMED[name].extra}] is not installed")
