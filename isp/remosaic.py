"""RGBW 2x2 turned into Bayer, for programs that know no W: "re-mosaic", as chips do it inside (arXiv:2209.08471)."""

from dataclasses import replace

import numpy as np

from isp.defects import mend
from isp.interleaved import reconstruct
from rodcone.errors import InputError
from sensor.cfa import Tile, channels, is_rgbw, mask
from sensor.raw import RawImage


def bayer_tile(tile: Tile) -> Tile:
    """Bayer phase with R where the RGBW tile has it: B on R's diagonal, G at the two other sites.

    Raises
    ------
    InputError
        Where the tile is not 2x2 with R, G, B and W once each.
    """
    if not is_rgbw(tile):
        raise InputError(f"cfa: {tile} can't become Bayer; allowed: 2x2 with R, G, B and W; use its raw file as it is")
    row, column = divmod("".join(tile).index("R"), 2)
    colours = {(row, column): "R", (1 - row, 1 - column): "B"}
    return tuple("".join(colours.get((y, x), "G") for x in range(2)) for y in range(2))


def remosaic(raw: RawImage) -> RawImage:
    """Bayer raw image of an RGBW one, of the same size and levels.

    Where the two mosaics agree the sample stays as it is; elsewhere (W's sites, and B's where B has to move) stands the
    interleaved reconstruction of that channel, a weighted mean of its samples that W's detail guides. Those pixels hold
    less noise than the noise profile says, and are correlated with their neighbours. Defective pixels are mended first.

    Raises
    ------
    InputError
        Where the mosaic is not 2x2 RGBW.
    """
    tile = bayer_tile(raw.cfa)
    raw = mend(raw)
    estimate_dn = np.asarray(reconstruct(raw), dtype=np.float64) / raw.gain_e_per_dn + raw.black_dn
    dn = raw.dn.copy()
    for index, channel in enumerate(channels(raw.cfa)):
        moved = mask(tile, channel, raw.shape) & ~mask(raw.cfa, channel, raw.shape)
        dn[moved] = np.rint(np.clip(estimate_dn[moved, index], 0.0, raw.white_dn)).astype(np.uint16)
    kept = [channels(raw.cfa).index(channel) for channel in "RGB"]
    return replace(raw, dn=dn, cfa=tile, colour=None if raw.colour is None else raw.colour.part(kept))
