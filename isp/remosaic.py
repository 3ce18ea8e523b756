"""Mosaics turned into others, for programs that know no W and no 4x4 tile: "re-mosaic", as chips do it inside
(arXiv:2209.08471).
"""

from dataclasses import replace

import numpy as np

from isp.defects import interpolate_defects
from isp.kriging import linear_strips
from rodcone.errors import InputError
from sensor.cfa import Tile, channels, is_bayer, is_rgbw, mask, plain
from sensor.raw import RawImage


def bayer_tile(tile: Tile) -> Tile:
    """Bayer phase that a mosaic becomes.

    Of quad Bayer the plain one. Of RGBW, 2x2 or quad, R where the (plain) tile has it, B on R's diagonal, G at the two
    other sites.

    Raises
    ------
    InputError
        For another mosaic.
    """
    if is_bayer(plain(tile)) and tile != plain(tile):
        return plain(tile)
    if not is_rgbw(plain(tile)):
        raise InputError(
            f"cfa: {tile} can't become Bayer; allowed: 2x2 with R, G, B and W, quad_rgbw, quad_bayer; use its raw file "
            "as it is"
        )
    row, column = divmod("".join(plain(tile)).index("R"), 2)
    colours = {(row, column): "R", (1 - row, 1 - column): "B"}
    return tuple("".join(colours.get((y, x), "G") for x in range(2)) for y in range(2))


def remosaic(raw: RawImage, tile: Tile | None = None) -> RawImage:
    """Raw image of another mosaic, of the same size and levels.

    Where the two mosaics agree the sample stays as it is; elsewhere stands the best linear estimate of that channel
    (`isp.kriging`). Those pixels hold other noise than the noise profile says, and are correlated with their
    neighbours. Defective pixels are mended first.

    Parameters
    ----------
    raw : RawImage
    tile : tuple of str, optional
        Mosaic to get, of channels that `raw` has; left out, `bayer_tile`.

    Raises
    ------
    InputError
        Where no tile is given, and the mosaic is neither RGBW nor quad Bayer.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> sensor, rng = rodcone.low_noise("rgbw"), np.random.default_rng(1)
    >>> device = rodcone.draw_device(sensor, (8, 8), rng)
    >>> raw = rodcone.expose(np.full((8, 8), 1000.0), sensor, 0.01, device, rng)
    >>> rodcone.remosaic(raw).cfa
    ('RG', 'GB')
    """
    tile = bayer_tile(raw.cfa) if tile is None else tile
    raw = interpolate_defects(raw)
    dn = raw.dn.copy()
    moved = {name: mask(tile, name, raw.shape) & ~mask(raw.cfa, name, raw.shape) for name in raw.channels}
    top_dn = [
        max(raw.white_dn, raw.noise_of(name).full_well_e / raw.gain_e_per_dn + raw.black_dn) for name in raw.channels
    ]
    for rows, estimate, _ in linear_strips(raw):
        estimate_dn = estimate / raw.gain_e_per_dn + raw.black_dn
        for index, channel in enumerate(raw.channels):
            at = moved[channel][rows]
            values = np.rint(np.clip(estimate_dn[at, index], 0.0, top_dn[index]))
            dn[rows][at] = values.astype(dn.dtype)
    order = [raw.channels.index(channel) for channel in channels(tile)]
    colour = None if raw.colour is None else raw.colour.part(order)
    apart = tuple(noise for noise in raw.channel_noise if noise.channel in channels(tile))
    # The estimates are of the old tile's channels, which `colour` knows as they read.
    return replace(raw, dn=dn, cfa=tile, colour=colour, channel_noise=apart, crosstalk=0.0)
