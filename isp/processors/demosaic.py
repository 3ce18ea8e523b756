"""Bayer opponents that carry detail between colours: Malvar's linear filters and Menon's directional ones.

Both come from the library `colour-demosaicing`:
H. S. Malvar, L.-W. He, R. Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images",
ICASSP 2004; D. Menon, S. Andriani, G. Calvagno, "Demosaicing with directional filtering and a posteriori decision",
IEEE Trans. Image Process. 16(1), 2007.

The preparation is this project's: the mosaic is balanced first (`isp.processors.mosaic`), and reflected about its
outermost pixels, which keeps the phase of the tile. The library itself repeats the outermost pixel, which puts one
colour where another belongs.
"""

from collections.abc import Callable

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.processors.mosaic import balance_mosaic, to_rgb
from rodcone.errors import InputError
from rodcone.optional import optional_library
from rodcone.types import Image, Mosaic, Plane
from sensor.cfa import BAYER, Tile, is_bayer
from sensor.raw import RawImage

EXTRA = "opponents"
# Distance [pixels along an axis] at which a mosaic's value may still change a result. Malvar's filters are 5 pixels
# wide. Menon's steps add up: 2 for green, 2 for its difference, 2 for the decision, 2 for R and B, 4 for refinement.
MALVAR_REACH, MENON_REACH = 2, 12


def malvar(mosaic: Mosaic, cfa: Tile) -> Image:
    """Demosaic by Malvar's 5x5 filters to planes of R, G and B, shape (h, w, 3).

    Parameters
    ----------
    mosaic : (h, w) float64
        Balanced mosaic.

    Raises
    ------
    InputError
        For a tile that isn't Bayer's, or if `colour-demosaicing` isn't installed.
    """
    return _demosaic("demosaicing_CFA_Bayer_Malvar2004", mosaic, cfa, MALVAR_REACH)


def menon(mosaic: Mosaic, cfa: Tile) -> Image:
    """Demosaic by Menon's directional filters with refinement; parameters and result are those of `malvar`."""
    return _demosaic("demosaicing_CFA_Bayer_Menon2007", mosaic, cfa, MENON_REACH)


def picture_demosaicked(
    raw: RawImage,
    colours: ColourFit,
    *,
    balance: WhiteBalance,
    demosaic: Callable[[Plane, Tile], Image],
    electrons: Mosaic | None = None,
) -> Picture:
    """Balance and demosaic a Bayer raw image, or its denoised mosaic `electrons` [e-], and develop the picture."""
    require_bayer(raw.cfa)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons if electrons is None else electrons, balance)
    return Picture(to_rgb(raw, demosaic(mosaic, raw.cfa), gains, colours, MALVAR_REACH), sources)


def require_bayer(cfa: Tile) -> None:
    """Raise `InputError` unless the tile is one of Bayer's four phases."""
    if not is_bayer(cfa):
        raise InputError(f"raw: mosaic {cfa} is not Bayer; allowed here: {BAYER} in any phase; use another processor")


def _demosaic(function: str, mosaic: Mosaic, cfa: Tile, reach: int) -> Image:
    require_bayer(cfa)
    pad = reach + reach % 2  # whole tiles, so that the pattern keeps its phase
    library = optional_library("colour_demosaicing", EXTRA)
    planes = getattr(library, function)(np.pad(mosaic, pad, mode="reflect"), "".join(cfa))
    return np.asarray(planes, dtype=np.float64)[pad:-pad, pad:-pad]
