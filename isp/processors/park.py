"""RGBW denoised by principal components before it is demosaicked: Park et al. 2009 on another mosaic.

S. H. Park, H. S. Kim, S. Lansel, M. Parmar, B. A. Wandell, "A case for denoising before demosaicking color filter array
data", Asilomar 2009, is about Bayer; `isp.processors.sub_images` takes any 2x2 tile. Ours: W's sub-image as the fourth,
and what follows, Adams' interpolation through W (`isp.processors.gindele`). Where W is full its sub-image is flat, and
the others keep what they differ by.
"""

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture, require_letters
from isp.processors.fusion import CHANNELS
from isp.processors.gindele import picture_gindele, require_rgbw
from isp.processors.sub_images import bm3d_mosaic, principal_components
from sensor.raw import RawImage


def picture_rgbw_park(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a 2x2 RGBW raw image."""
    require_letters(raw, CHANNELS)
    require_rgbw(raw.cfa)
    return picture_gindele(raw, colours, balance=balance, electrons=bm3d_mosaic(raw, principal_components))
