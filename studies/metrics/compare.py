"""Measure a developed picture against the noise-free scene by the metrics of a study, in a script of one's own."""

from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike

from isp.colour.encoding import encode
from isp.picture import Picture
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from rodcone.display import brief, preview_png
from rodcone.doors import method
from rodcone.errors import InputError
from rodcone.types import Image, real_array
from studies.metrics.appearance import TruePicture, appearance, true_picture
from studies.metrics.appearance import picture_quality as quality_of
from studies.metrics.truth import light_in_bands, true_srgb, white_of_pixels

_CELL_PX = 8
_MOST_DOUBLED = 40  # doublings of the factor that are tried


@dataclass(frozen=True)
class ReferencePicture:
    """The scene as a camera without noise, blur or mosaic would show it.

    Attributes
    ----------
    linear : (h, w, 3) float64
        Linear sRGB, adapted to D65; white is 1.
    white_cd_m2 : float
        Luminance that is shown as white.
    """

    linear: Image
    white_cd_m2: float

    __repr__ = brief

    @cached_property
    def truth(self) -> TruePicture:
        """Return the `TruePicture` for comparisons, computed once."""
        return true_picture(self.linear)

    @method
    def encode(self, encoding: str = "srgb") -> Image:
        """Encode the picture for a display, by a name in `isp.colour.encoding.ENCODINGS`; (h, w, 3) in [0, 1]."""
        return encode(self.linear, encoding)

    def _repr_png_(self) -> bytes:
        return preview_png(self.linear)


def reference_picture(radiance: SpectralRadiance, light: Spectrum | None = None) -> ReferencePicture:
    """Show radiance without a camera: the picture that a developed one is measured against.

    Parameters
    ----------
    radiance : SpectralRadiance
        The radiance that `capture` was given.
    light : Spectrum, optional
        Lamp whose colour is shown as white, or an illuminant's name; left out, the one that the radiance states, else
        D65, as in `capture`.

    Returns
    -------
    ReferencePicture
        The 99th percentile of the pixels' luminance is 90 % of its white.
    """
    lamp = light or radiance.light or illuminant("D65")
    white_cd_m2 = white_of_pixels(radiance.luminance(), np.zeros(radiance.shape))
    if not white_cd_m2 > 0:
        raise InputError("radiance: it is dark; allowed: light in a hundredth of its pixels; give a level above 0")
    in_bands = light_in_bands(lamp, radiance.wavelength_nm, radiance.widths_nm)
    return ReferencePicture(true_srgb(radiance, in_bands, white_cd_m2), white_cd_m2)


def measure(picture: Picture | ArrayLike, reference: ReferencePicture) -> dict[str, float]:
    """Measure a developed picture against the scene without noise, by the metrics of a study.

    The picture is first multiplied by one factor, so that its brightness isn't judged: the mean luminances then agree,
    with luminance above white counted as white, because a clipped lamp says nothing about the exposure. A study uses
    the factor that is known for the camera instead.

    Parameters
    ----------
    picture : Picture or (h, w, 3) array
        A picture from `develop`, or linear sRGB of any scale.
    reference : ReferencePicture
        A reference of the same size, from `reference_picture`.

    Returns
    -------
    dict of str to float
        ``psnr_db``: peak signal over the mean square difference of encoded sRGB [dB]; half the light costs about 3 dB.
        ``ssim``: structural similarity, 1 for the same picture. ``delta_e_median``, ``delta_e_p95``: median and 95th
        percentile of CIEDE2000 over pixels; a difference of 1 can just be seen on even patches. ``s_cielab_median``,
        ``s_cielab_p95``: the same of the CIELAB difference after the eye's blur. ``flip_mean``: mean LDR-FLIP, the
        difference seen when the pictures alternate, 0 to 1. ``pu21_psnr_db``: PSNR on a scale of equally visible steps
        of absolute luminance.

    Raises
    ------
    InputError
        For another size, values that aren't finite, or a picture that is dark.
    """
    linear = np.asarray(picture.rgb if isinstance(picture, Picture) else real_array("picture", picture), np.float64)
    if linear.shape != reference.linear.shape:
        raise InputError(
            f"picture: shape {linear.shape} is not the reference's {reference.linear.shape}; give pictures of one size"
        )
    mean = float(luminance_of_srgb(linear).mean())
    if not 0 < mean < np.inf:
        raise InputError(
            f"picture: its mean luminance is {mean:g}; allowed: above 0, finite; give linear sRGB of a scene"
        )
    scaled = linear * _brightness(luminance_of_srgb(linear), luminance_of_srgb(reference.linear))
    encoded = encode_srgb(scaled)
    quality = quality_of(encoded, reference.truth)
    return asdict(quality) | asdict(appearance(scaled, reference.truth, reference.white_cd_m2))


def _brightness(luminance: Image, reference: Image) -> float:
    """Return the factor k for which the mean of min(k luminance, 1) is the mean of min(reference, 1).

    Luminances are first averaged over cells of 8 x 8 pixels, so that noise above white isn't clipped like light.
    """
    counts = _cell_sums(np.ones_like(reference))
    picture, scene = _cell_sums(luminance) / counts, _cell_sums(reference) / counts

    def shown(cells: Image, factor: float) -> float:
        return float(np.average(np.minimum(factor * cells, 1.0), weights=counts))

    wanted = shown(scene, 1.0)
    low = wanted / float(luminance.mean())  # clipping removes light, so the factor is at least this
    high = next((k for k in low * 2.0 ** np.arange(1, _MOST_DOUBLED) if shown(picture, k) >= wanted), None)
    if high is None or shown(picture, low) >= wanted:  # nothing clips, except by rounding
        return low
    return float(scipy.optimize.brentq(lambda k: shown(picture, k) - wanted, low, high))


def _cell_sums(plane: Image) -> Image:
    """Return sums over cells with `_CELL_PX` pixels along each side; cells at the far borders are smaller."""
    rows, columns = (np.arange(0, side, _CELL_PX) for side in plane.shape)
    return np.asarray(np.add.reduceat(np.add.reduceat(plane, rows, axis=0), columns, axis=1))
