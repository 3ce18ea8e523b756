"""Colours of a raw file whose response curves are unknown: a `ColourFit` from the matrices of its calibration."""

import numpy as np

from isp.colour.colour_fit import ColourFit, grey_of
from render.spectrum import DEFAULT_WAVELENGTH_NM as NM
from render.spectrum import Spectrum, band_widths, tristimulus
from rodcone.colour_spaces import A_XY, D65_XY, adapt_to_d65, xyz_from_xy, xyz_to_srgb
from rodcone.types import Floats
from sensor.calibration import ColourCalibration
from sensor.cfa import unmixed

WIDTH = band_widths(NM)

# Mean and mean product of the ColorChecker's 24 patches in linear sRGB under D65 (`scenes.reflectances`).
MEAN_SRGB = np.array([0.3295, 0.2602, 0.2292])
MOMENTS_SRGB = np.array([[0.1875, 0.1203, 0.0822], [0.1203, 0.1140, 0.0838], [0.0822, 0.0838, 0.0969]])
# RMS of the part of W that three colours don't explain, over W of white. For the project's curves on the ColorChecker
# it is 0.043 under D65, 0.046 under F11 and 0.066 under A. Without it the fit would rely too much on W without noise.
UNEXPLAINED = 0.05


def fit_of_calibration(colour: ColourCalibration, names: tuple[str, ...], mixing: Floats | None = None) -> ColourFit:
    """Fit the colours of a camera that is known only by matrices.

    R, G and B respond to linear sRGB by the inverse of `colour.to_srgb`. Any other channel responds by its row of the
    matrix from XYZ under A or D65, whichever light's neutral is nearer to the exposure's. The part of its response that
    three colours don't explain isn't known; `UNEXPLAINED` is used instead. With one or two channels all respond by
    their rows, and the colours are grey.

    Parameters
    ----------
    names : tuple of str
        The channels in the order of `sensor.cfa.channels`: R, G and B first, or other colours in their place.
    mixing : (channel, channel) float64, optional
        `RawImage.channel_mixing`, for pixels that exchange charge. The calibration describes the channels as they are
        read, and the fit the light behind each filter. If there are more than three channels, all of them then respond
        by their rows.
    """
    three = len(names) >= 3
    by_rows = mixing is not None and len(names) > 3
    rows = np.linalg.inv(colour.to_srgb) if three and not by_rows else np.zeros((0, 3))
    if len(names) != 3:
        green = names.index("G") if "G" in names else 0
        # balanced channels of linear sRGB, (channel, 3), and how far their neutral lies from the exposure's, in stops
        candidates = []
        for name, xy in (("a", A_XY), ("d65", D65_XY)):
            from_xyz = getattr(colour, f"xyz_to_camera_{name}")
            white = xyz_from_xy(xy)
            neutral = from_xyz @ white
            to_xyz = np.linalg.inv(xyz_to_srgb(adapt_to_d65(np.eye(3), white)).T)
            stops = np.log2(np.maximum(neutral, 1e-9) / colour.neutral)
            candidates.append((np.abs(stops - stops[green]).max(), from_xyz @ to_xyz / neutral[:, None]))
        rows = np.vstack([rows, min(candidates, key=lambda pair: pair[0])[1][len(rows) :]])
    if mixing is not None:
        share = mixing * unmixed(mixing, colour.neutral)
        rows = np.linalg.lstsq(share / share.sum(axis=1, keepdims=True), rows, rcond=1e-9)[0]
    unexplained = np.diag([0.0 if three and index < 3 else UNEXPLAINED**2 for index in range(len(names))])
    cross = rows @ MOMENTS_SRGB
    moments = cross @ rows.T + unexplained
    return ColourFit(names, mean=rows @ MEAN_SRGB, moments=moments, cross=cross if three else grey_of(cross))


def neutral_under(colour: ColourCalibration, light: Spectrum) -> Floats:
    """Compute each channel's response to a neutral under a light from a camera's matrices; green is 1, (channel,).

    As the DNG specification 1.7 says, the matrices from XYZ under A and D65 are interpolated by the light's inverse
    correlated colour temperature. That is computed by McCamy's formula (1992), which is within 4e-4 under A and D65.

    Parameters
    ----------
    light : Spectrum
        Light of any level.
    """
    white = tristimulus(light.band_average(NM, WIDTH), NM, WIDTH)
    a, d65, at = (_inverse_temperature(xyz) for xyz in (xyz_from_xy(A_XY), xyz_from_xy(D65_XY), white))
    share = float(np.clip((at - d65) / (a - d65), 0.0, 1.0))
    response = (share * colour.xyz_to_camera_a + (1 - share) * colour.xyz_to_camera_d65) @ white
    return np.asarray(response / response[min(1, response.size - 1)])  # R, G, B come first


def _inverse_temperature(xyz: Floats) -> float:
    """Compute the inverse of McCamy's correlated colour temperature [1/K]."""
    x, y = xyz[:2] / xyz.sum()
    n = (x - 0.3320) / (0.1858 - y)
    return float(1 / (449 * n**3 + 3525 * n**2 + 6823.3 * n + 5520.33))
