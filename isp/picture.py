"""A developed picture, and the last steps of development from linear planes of three colours."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.encoding import encode
from isp.colour.highlights import clip_highlights
from isp.colour.light_around import LIGHTS, apply_by_light, light_around
from isp.colour.white_balance import BalanceSource, WhiteBalance
from isp.substitution import COLOUR_ERROR, PLANE_ERROR
from rodcone.colour_spaces import white_of
from rodcone.display import Axes, brief, draw_line, preview_png
from rodcone.doors import method
from rodcone.errors import InputError, require_fields, require_range
from rodcone.jit import Backend
from rodcone.types import Image, real_array
from sensor.raw import RawImage


@dataclass(frozen=True)
class Picture:
    """A developed picture and the decisions made for it; in NumPy it is an array of its linear RGB.

    Attributes
    ----------
    rgb : (h, w, 3) float64
        Linear sRGB, not clipped to the display; a neutral has the electrons of a green pixel.
    balance : mapping of str to str
        Origin of each channel's gain: ``gray world``, ``calibrated`` or ``given``.
    engine : "cuda", "llvm" or "numpy"
        Engine that ran the reconstruction.
    snr : float or None
        SNR of the frame's green, by which substitution is decided; None if W substitutes nothing, as in a Bayer camera.
    substitution : float or None
        Share of W in the luminance, 0 to 1; None if W substitutes nothing.
    """

    rgb: Image
    balance: Mapping[str, BalanceSource]
    engine: Backend = "numpy"
    snr: float | None = None
    substitution: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)
        if real_array("rgb", self.rgb).shape[2:] != (3,):
            raise InputError(f"rgb: shape {np.shape(self.rgb)} is not allowed; give linear sRGB, (h, w, 3)")

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape of `rgb`."""
        return self.rgb.shape

    @property
    def substituted(self) -> bool | None:
        """Return whether W gave most of the luminance; None if W substitutes nothing."""
        return None if self.substitution is None else self.substitution > 0.5

    @property
    def snr_db(self) -> float | None:
        """Return `snr` in decibels; None without an SNR or without signal."""
        return 20 * float(np.log10(self.snr)) if self.snr is not None and self.snr > 0 else None

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[np.floating]:
        return np.array(self.rgb, dtype=dtype, copy=copy)

    def __truediv__(self, scale: ArrayLike) -> Image:
        return np.asarray(self.rgb / np.asarray(scale))

    @method
    def encode(self, white: float | None = None, encoding: str = "srgb") -> Image:
        """Encode the picture for a display: shape (h, w, 3), 0 to 1.

        Parameters
        ----------
        white : float, optional
            Level of `rgb` that is shown as white [e-]. By default the 99th percentile of the luminance is shown at 90 %
            of white.
        encoding : str
            Name in `isp.colour.encoding.ENCODINGS`.
        """
        level = (white_of(self.rgb) or 1.0) if white is None else white
        require_range("white", level, 1e-12, 1e12, "give electrons of green")
        return encode(self.rgb, encoding, white=level)

    @method
    def plot_line(self, row: int | None = None, axes: Axes | None = None) -> Axes:
        """Draw R, G and B along a row, the middle one by default, into Matplotlib's axes."""
        planes = dict(zip("RGB", np.moveaxis(self.rgb, -1, 0), strict=True))
        return draw_line(planes, row, axes, "linear sRGB, electrons of green")

    def _repr_png_(self) -> bytes:
        return preview_png(self.rgb)


def finish(
    raw: RawImage,
    planes: Image,
    matrix: ArrayLike | ColourFit,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | WhiteBalance | None = None,
    engine: Backend = "numpy",
    noise_gain: NDArray[np.floating] | None = None,
) -> Picture:
    """Develop planes of R, G and B: white balance, highlights, matrix.

    Parameters
    ----------
    raw : RawImage
        The exposure that the planes come from; its mosaic holds R, G and B.
    planes : (h, w, 3) float64
        Demosaicked channels [e-].
    matrix, neutral, balance
        As in `isp.processors.catalogue.Processor.develop`.
    engine : "cuda", "llvm" or "numpy"
        Engine that made the planes.
    noise_gain : (h, w, 3) array, optional
        Noise gain as `isp.interleaved.reconstruction.reconstruct_with_noise` returns it. If `matrix` is a `ColourFit`,
        the colours take this noise into account, at the light around each pixel (`isp.colour.light_around`), and
        `isp.substitution.PLANE_ERROR` beside it.
    """
    shape = *raw.shape, len(raw.channels)
    if planes.shape != shape or (noise_gain is not None and np.shape(noise_gain) != shape):
        raise InputError(
            f"planes: shape {planes.shape} is not allowed; give one a channel, {shape}, noise_gain likewise"
        )
    colours = ColourFit.of(matrix)
    gains, sources = WhiteBalance.of(raw, neutral, balance).gains(raw, planes)
    balanced = clip_highlights(raw, planes * gains, gains)
    if noise_gain is None:
        return Picture(balanced @ colours.matrix().T, sources, engine)
    errors = COLOUR_ERROR * relative_noise(raw, planes, noise_gain, gains, colours, LIGHTS) + PLANE_ERROR
    matrices = np.array([colours.matrix(noise=error) for error in errors])
    light = light_around(raw, balanced[..., raw.channels.index(raw.unit_channel)])
    return Picture(apply_by_light(balanced, light, matrices), sources, engine)


def require_letters(raw: RawImage, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the mosaic's channels; raise `InputError` if they aren't `names`."""
    if raw.channels != names:
        raise InputError(
            f"raw: mosaic {raw.cfa} holds {raw.channels}; allowed here: {names}; use ple, which develops any mosaic of "
            "R, G, B and W"
        )
    return names
