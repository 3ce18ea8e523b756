"""Colour spaces: sRGB and Display P3, their white D65, XYZ, and adaptation between whites."""

import numpy as np
from numpy.typing import NDArray

# Chromaticities of red, green and blue. sRGB: IEC 61966-2-1. Display P3: primaries of SMPTE EG 432-1 (DCI-P3) with D65
# and the curve of sRGB, as CSS Color 4, section 10.4, has it.
SRGB_PRIMARIES_XY = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
DISPLAY_P3_PRIMARIES_XY = np.array([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]])

# White points: D65 as IEC 61966-2-1 has it, illuminant A (CIE 15:2018), and D50, the white of the space that connects
# colour profiles (ICC.1:2022, 7.2.16).
D65_XY = np.array([0.3127, 0.3290])
A_XY = np.array([0.44758, 0.40745])
D50_XYZ = np.array([0.9642, 1.0, 0.8249])

WHITE_PERCENTILE, WHITE_AT = 99.0, 0.9  # this percentile of a picture's luminance is shown at 90 % of white
# Bradford cone responses (Lam 1985), as ICC.1:2010 Annex E gives them.
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def xyz_from_xy(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return XYZ of a chromaticity (x, y) at Y = 1."""
    return np.array([xy[0] / xy[1], 1.0, (1 - xy[0] - xy[1]) / xy[1]])


def rgb_to_xyz(primaries_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix from linear R, G, B of these primaries, (3, 2) x and y, to XYZ; (1, 1, 1) is D65 at Y = 1."""
    columns = np.stack([xyz_from_xy(xy) for xy in primaries_xy], axis=1)
    return np.asarray(columns * np.linalg.solve(columns, xyz_from_xy(D65_XY)))


SRGB_TO_XYZ = rgb_to_xyz(SRGB_PRIMARIES_XY)
# IEC 61966-2-1, equation (F.8): the inverse, rounded to four digits. Files and previews for other programs use it.
XYZ_TO_SRGB_ROUNDED = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def xyz_to_srgb(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert XYZ, along the last axis, to linear sRGB; D65 at Y = 1 gives (1, 1, 1)."""
    return np.asarray(xyz @ np.linalg.inv(SRGB_TO_XYZ).T)


def luminance_of_srgb(rgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the luminance Y of linear sRGB, which lies along the last axis."""
    return np.asarray(rgb @ SRGB_TO_XYZ[1])


def white_of(linear: NDArray[np.floating]) -> float:
    """Return the level of linear sRGB (h, w, 3), or grey (h, w), that is shown as white; 0 or less without light."""
    luminance = linear if linear.ndim == 2 else luminance_of_srgb(linear)
    return float(np.percentile(luminance, WHITE_PERCENTILE)) / WHITE_AT


def adapt_to_d65(xyz: NDArray[np.float64], white_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Adapt XYZ (last axis) from a light's white to D65 by Bradford's transform, which keeps Y of the white."""
    source = _BRADFORD @ (white_xyz / white_xyz[1])
    matrix = np.linalg.inv(_BRADFORD) @ np.diag(_BRADFORD @ xyz_from_xy(D65_XY) / source) @ _BRADFORD
    return np.asarray(xyz @ matrix.T)


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Encode linear sRGB for display, clipped to [0, 1] (IEC 61966-2-1).

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> rodcone.encode_srgb(np.array([0.0, 0.18, 1.0])).round(3)
    array([0.   , 0.461, 1.   ])
    """
    clipped = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def decode_srgb(encoded: NDArray[np.floating]) -> NDArray[np.float64]:
    """Convert encoded sRGB values in 0..1 to linear ones (IEC 61966-2-1)."""
    low = encoded / 12.92
    return np.asarray(np.where(encoded <= 0.04045, low, ((encoded + 0.055) / 1.055) ** 2.4), dtype=np.float64)
