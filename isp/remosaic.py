"""Conversion of a mosaic to another one, for programs that know neither W nor 4x4 tiles; chips call it "re-mosaic"
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
    """Return the Bayer tile to which a mosaic is converted.

    For quad Bayer it is the tile with one pixel in place of 2x2 (`sensor.cfa.plain`). A quad RGBW tile is first reduced
    in the same way. In a 2x2 tile of RGBW, R keeps its site, B is diagonal to R, and G is at the two other sites.

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
    """Convert a raw image to another mosaic of the same size and levels.

    Where the two mosaics agree, the sample is kept; elsewhere it is replaced by the channel's best linear estimate
    (`isp.kriging`). The noise of these pixels isn't that of the noise profile, and is correlated with their
    neighbours'. Defective pixels are replaced first.

    Parameters
    ----------
    raw : RawImage
    tile : tuple of str, optional
        Tile to convert to, of channels that `raw` has; by default `bayer_tile`.

    Raises
    ------
    InputError
        If no tile is given, and the mosaic is neither RGBW nor quad Bayer.

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
    # The estimates are values of the old tile's channels with their crosstalk, which `colour` already includes.
    return replace(raw, dn=dn, cfa=tile, colour=colour, channel_noise=apart, crosstalk=0.0)
