"""A developed picture, and how linear planes of three colours become one."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.camera_colour import BalanceSource
from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.white_balance import clip_highlights, white_balance
from isp.substitution import matrix_without_white
from rodcone.errors import InputError
from rodcone.jit import Backend
from rodcone.notebook import html_of, preview_png
from sensor.cfa import channels
from sensor.raw import RawImage

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Picture:
    """A developed picture, and what was decided on the way.

    Attributes
    ----------
    rgb : (h, w, 3) float64
        Linear sRGB, not clipped to the display; a neutral reads the electrons of a green pixel.
    balance : mapping of str to str
        Where each channel's gain comes from: ``gray world``, ``calibrated`` or ``given``.
    snr : float or None
        Frame SNR of green, on which substitution is decided; None for the Bayer camera.
    substituted : bool or None
        Whether W gave most of the luminance; None for the Bayer camera.
    engine : "cuda", "llvm" or "numpy"
        What ran the reconstruction.
    substitution : float or None
        W's share of the luminance, 0 to 1; None for the Bayer camera.
    """

    rgb: Image
    balance: Mapping[str, BalanceSource]
    snr: float | None
    substituted: bool | None
    engine: Backend
    substitution: float | None = None

    @property
    def snr_db(self) -> float | None:
        """`snr` in decibels; None where there is none, or no signal."""
        return 20 * float(np.log10(self.snr)) if self.snr is not None and self.snr > 0 else None

    def _repr_png_(self) -> bytes:
        return preview_png(self.rgb)

    def _repr_html_(self) -> str:
        facts = {"white balance": ", ".join(f"{letter}: {source}" for letter, source in self.balance.items())}
        if self.snr is not None:
            facts["frame SNR of green"] = f"{self.snr:.3g}, W's share of the luminance {self.substitution or 0:.2g}"
        return html_of("Picture", facts | {"engine": self.engine}, self._repr_png_())


def finish(
    raw: RawImage,
    planes: Image,
    matrix: ArrayLike | ColourFit,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | None = None,
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
        As `isp.pipeline.develop_interleaved`.
    engine : "cuda", "llvm" or "numpy"
        What made the planes.
    noise_gain : (h, w, 3) array, optional
        Of `isp.interleaved.reconstruct_with_noise`: with a `ColourFit` as `matrix`, colours that know this noise.
    """
    white = white_balance(raw, planes, neutral, balance)
    if noise_gain is not None and isinstance(matrix, ColourFit):
        matrix = matrix_without_white(matrix, relative_noise(raw, planes, noise_gain, white.gains, matrix))
    rgb = clip_highlights(raw, planes * white.gains) @ checked_matrix(matrix).T
    return Picture(rgb, dict(zip(channels(raw.cfa), white.sources, strict=True)), None, None, engine)


def require_letters(raw: RawImage, letters: tuple[str, ...]) -> tuple[str, ...]:
    """Return the mosaic's letters, or raise `InputError` where they are others."""
    if channels(raw.cfa) != letters:
        raise InputError(
            f"raw: mosaic {raw.cfa} holds {channels(raw.cfa)}; allowed here: {letters}; use the other camera's pipeline"
        )
    return letters


def checked_matrix(matrix: ArrayLike) -> Image:
    """Return the matrix as an array, or raise `InputError` unless it is 3x3 and finite."""
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape != (3, 3) or not np.all(np.isfinite(array)):
        raise InputError(
            f"matrix: shape {array.shape} is not allowed; give 3x3 finite numbers, as fit_matrix makes them"
        )
    return array
