"""The raw image: all that a camera's software knows about an exposure, and nothing of the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rodcone.display import Axes, brief, draw_line, preview_png
from rodcone.doors import method
from rodcone.errors import InputError, require_fields
from rodcone.types import Floats, require_unmasked
from sensor.calibration import ChannelNoise, ColourCalibration, NoiseStep
from sensor.cfa import Tile, channel_mixing, channels, check_covers, check_tile, mask, unit_channel

# A saturated pixel reads white - 4 sigma_dark or more, give or take half a DN, with probability 1 - 3.2e-5.
ISO_RANGE = 1e-6, 1e9
SATURATION_SIGMAS = 4.0
LARGEST_DN = 2.0**24  # up to which single precision holds every whole number


@dataclass(frozen=True)
class RawImage:
    """One exposure as read out, with the calibration that a DNG's tags and noise profile would hold.

    Attributes
    ----------
    dn : (h, w) uint16
        Mosaic in digital numbers; other whole numbers, or finite floats, are taken as they are.
    cfa : tuple of str
        Tile of channels, row 0 first.
    black_dn, white_dn : float
        Reading of no light, with the mean of its dark current; and of a full well.
    gain_e_per_dn : float
        Electrons per digital number.
    read_noise_e, dsnu_e : float
        Standard deviations of the temporal and the fixed dark noise [e-], with dark current's.
    prnu : float
        Standard deviation of the pixels' relative response.
    exposure_s : float
        Exposure time [s].
    camera : str
        Name of the camera: printable ASCII, as TIFF's tags hold it.
    f_number, iso : float or None
        The lens's f-number, and the saturation-based speed (ISO 12232); None if they aren't stated.
    colour : ColourCalibration or None
        Colour calibration of the channels of `cfa`; None for a camera without colours, or one that isn't calibrated.
    engine : str
        Engine that drew a simulated frame's noise: ``numpy`` (exact), or ``llvm`` or ``cuda``
        (`sensor.kernel.poisson` states the error); empty where unknown, as for a file of another program.
    column_gain_spread : float
        Standard deviation of the columns' relative gain, in `prnu` too: full pixels of weak columns read less.
    defects : (n, 2) intp, optional
        Row and column of each defective pixel, as a camera's maker lists them; None where there is none.
    noise_steps : tuple of NoiseStep
        For pixels that are read several times, the noise above each level at which one reading is full. Below the first
        level `read_noise_e`, `dsnu_e` and `prnu` hold.
    channel_noise : tuple of ChannelNoise
        Noise and full well of channels that are read in a way of their own; the other fields on noise and well don't
        hold for them. Their samples may be above `white_dn`.
    dark_current_e : float
        Mean of the dark current in `black_dn` [e-], on which the columns' gains act as on light.
    crosstalk : float
        Share of a pixel's electrons that goes to each of its four neighbours; `colour` is that of the channels as
        they read for it (`sensor.cfa`).

    Raises
    ------
    InputError
        For a frame without a whole tile or with samples that are no finite real numbers, a number out of its range, or
        a defect that isn't in the frame.
    """

    dn: NDArray[np.uint16]
    cfa: Tile
    black_dn: Annotated[float, (-LARGEST_DN, LARGEST_DN, "give digital numbers of 24 bits")]
    white_dn: Annotated[float, (-LARGEST_DN, LARGEST_DN, "give digital numbers of 24 bits")]
    gain_e_per_dn: Annotated[float, (1e-12, 1e12, "give electrons per digital number")]
    read_noise_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    dsnu_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    prnu: Annotated[float, (0.0, 1.0, "give a fraction: 1.7 % is 0.017")]
    exposure_s: Annotated[float, (0.0, 1e7, "give seconds, 0 or more")]
    camera: str = "rodcone"
    f_number: Annotated[float | None, (0.1, 1e4, "give focal length over aperture")] = None
    iso: Annotated[float | None, (*ISO_RANGE, "give a speed above 0")] = None
    colour: ColourCalibration | None = None
    engine: str = ""
    column_gain_spread: Annotated[float, (0.0, 1.0, "give a fraction, 0 for none")] = 0.0
    defects: NDArray[np.intp] | None = None
    noise_steps: tuple[NoiseStep, ...] = ()
    channel_noise: tuple[ChannelNoise, ...] = ()
    dark_current_e: Annotated[float, (0.0, 1e20, "give electrons, 0 for none")] = 0.0
    crosstalk: Annotated[float, (0.0, 0.25, "give the share that goes to each of four neighbours, 0 for none")] = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "cfa", check_tile(self.cfa))
        object.__setattr__(self, "dn", _checked_dn(self.dn))
        check_covers(self.cfa, self.dn.shape)
        require_fields(self)
        if self.defects is not None:
            object.__setattr__(self, "defects", _checked_defects(self.defects, self.shape))
        if not self.black_dn < self.white_dn:
            raise InputError(
                f"black_dn: {self.black_dn!r} is not under white_dn {self.white_dn!r}; swap or correct them"
            )
        object.__setattr__(self, "noise_steps", tuple(self.noise_steps))
        levels = [step.from_e for step in self.noise_steps]
        if levels != sorted(levels):
            raise InputError(f"noise_steps: from_e {levels} doesn't rise; put the darkest step first")
        apart = [noise.channel for noise in self.channel_noise]
        if len(set(apart)) < len(apart) or not set(apart) <= set(self.channels):
            raise InputError(f"channel_noise: {apart}; allowed: channels of {self.channels}, each once; list those")
        for name, text in (("camera", self.camera), ("engine", self.engine)):
            if not (isinstance(text, str) and text.isascii() and text.isprintable() and (text or name == "engine")):
                raise InputError(f"{name}: {text!r} is not allowed; give a name in printable ASCII")
        if self.colour is not None and self.colour.neutral.size != len(self.channels):
            raise InputError(
                f"colour: {self.colour.neutral.size} channels don't fit the mosaic's {self.channels}; "
                "calibrate this camera"
            )

    @method
    def plot_line(self, row: int | None = None, axes: Axes | None = None) -> Axes:
        """Draw the electrons along a row, the middle one by default, into Matplotlib's axes, by channel."""
        planes = {x: np.where(mask(self.cfa, x, self.shape), self.electrons, np.nan) for x in self.channels}
        return draw_line(planes, row, axes, "electrons")

    def _repr_png_(self) -> bytes:
        return preview_png(np.maximum(self.electrons, 0.0))

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the channels of `cfa` in the order of `sensor.cfa.channels`."""
        return channels(self.cfa)

    @property
    def unit_channel(self) -> str:
        """Return the channel that sets exposure, white balance and a picture's scale (`sensor.cfa.unit_channel`)."""
        return unit_channel(self.cfa)

    @property
    def colour_channels(self) -> tuple[str, ...]:
        """Return the channels that saturate together with the picture: all but a W beside G, which is full earlier."""
        return tuple(x for x in self.channels if x != "W") if "G" in self.channels else self.channels

    @property
    def shape(self) -> tuple[int, int]:
        """Return the height and width in pixels."""
        return self.dn.shape[0], self.dn.shape[1]

    @property
    def dark_noise_e(self) -> float:
        """Return the standard deviation of a dark pixel [e-]: read noise, DSNU and quantisation (1/sqrt(12) DN)."""
        return float(np.sqrt(self.read_noise_e**2 + self.dsnu_e**2 + self.rounding_e2))

    @property
    def rounding_e2(self) -> float:
        """Return the variance of quantisation [e-^2]; 0 for floating-point samples, which aren't rounded."""
        return self.gain_e_per_dn**2 / 12 if self.dn.dtype.kind in "iu" else 0.0

    @property
    def electrons(self) -> NDArray[np.float64]:
        """Return the mosaic in electrons above black, shape (h, w), float64; noise can make it negative."""
        return (np.asarray(self.dn, dtype=np.float64) - self.black_dn) * self.gain_e_per_dn

    @property
    def full_well_e(self) -> float:
        """Return the electrons of a pixel that reads the white level."""
        return float((self.white_dn - self.black_dn) * self.gain_e_per_dn)

    @method
    def noise_of(self, channel: str) -> ChannelNoise:
        """Return the noise and full well of a channel's samples.

        For pixels that are read several times they hold below the first of `noise_steps`. Its ``shot`` includes what
        the columns' gains make of dark current and light together (`gains_shot`).
        """
        noise = next((noise for noise in self.channel_noise if noise.channel == channel), self._plain(channel))
        return replace(noise, shot=noise.shot + gains_shot(self, noise.dark_current_e))

    @property
    def plain_noise(self) -> ChannelNoise:
        """Return `noise_of` a channel that has no entry in `channel_noise`."""
        noise = self._plain("")
        return replace(noise, shot=noise.shot + gains_shot(self, noise.dark_current_e))

    def _plain(self, channel: str) -> ChannelNoise:
        return ChannelNoise(channel, self.full_well_e, 1.0, self.dark_noise_e, 0.0, self.prnu, self.dark_current_e)

    @property
    def channel_mixing(self) -> Floats:
        """Return what the channels read of each channel's light in an even field (`sensor.cfa.channel_mixing`)."""
        return channel_mixing(self.cfa, self.crosstalk, self._light_shares)

    @property
    def _light_shares(self) -> dict[str, float]:
        return {noise.channel: noise.light_share for noise in self.channel_noise}

    @property
    def saturation_e(self) -> float:
        """Return the level [e-] from which a sample of a channel without `channel_noise` counts as saturated."""
        return self._saturation_e(self._plain(""))

    def _saturation_e(self, noise: ChannelNoise) -> float:
        """Return the level [e-] from which a channel's sample counts as saturated.

        It lies several standard deviations below the full well. They are those of the noise that arises after the well
        clips, which is all but that of the dark current; the columns' gains act on the whole well. Rounding takes off
        half a DN at most, whatever its variance.
        """
        last = self.noise_steps[-1] if self.noise_steps else noise
        dark_e = noise.dark_current_e
        before_e2 = last.shot * dark_e + (self.column_gain_spread * dark_e) ** 2 + self.rounding_e2
        after_e = sqrt(max(hypot(last.read_noise_e, last.dsnu_e) ** 2 - before_e2, 0.0))
        spread_e = hypot(after_e, self.column_gain_spread * (noise.full_well_e + dark_e))
        return noise.full_well_e - SATURATION_SIGMAS * spread_e - noise.shot * self.gain_e_per_dn / 2

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """Return where pixels count as saturated, shape (h, w)."""
        return full_at_sites(self, self.dn)


def full_at_sites(raw: RawImage, dn: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where digital numbers of the mosaic, or of a part that begins with a whole tile, count as saturated."""
    full = np.asarray(dn >= raw.saturation_e / raw.gain_e_per_dn + raw.black_dn)
    for noise in raw.channel_noise:
        at = mask(raw.cfa, noise.channel, full.shape)
        full[at] = dn[at] >= raw._saturation_e(noise) / raw.gain_e_per_dn + raw.black_dn
    return full


def gains_shot(raw: RawImage, dark_current_e: float) -> float:
    """Return the variance per electron of light that the columns' gains add in the presence of dark current.

    A column's gain multiplies both the light e and the dark current D. Its variance c^2 (e + D)^2 has the term 2 c^2 D
    e, which grows with the light as shot noise does.
    """
    return 2.0 * raw.column_gain_spread**2 * dark_current_e


def noise_at_sites(raw: RawImage, electrons: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the variance of samples with these means [e-^2], in their shape and type; a negative mean counts as 0.

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        Means of the mosaic's samples, or of a part of the mosaic that begins with a whole tile.
    """
    light = np.maximum(electrons, 0.0)

    def variance_of(
        noise: NoiseStep | ChannelNoise, dark_current_e: float, mean_e: NDArray[np.floating]
    ) -> NDArray[np.floating]:
        return replace(noise.law, shot=noise.shot + gains_shot(raw, dark_current_e)).variance(mean_e)

    variance = variance_of(raw._plain(""), raw.dark_current_e, light)
    parts: list[tuple[NDArray[np.bool_], NoiseStep | ChannelNoise, float]]
    parts = [(light >= step.from_e, step, raw.dark_current_e) for step in raw.noise_steps]
    parts += [(mask(raw.cfa, noise.channel, light.shape), noise, noise.dark_current_e) for noise in raw.channel_noise]
    for where, noise, dark_current_e in parts:
        variance[where] = variance_of(noise, dark_current_e, light[where])
    return variance


def channel_variance(raw: RawImage, mean_e: ArrayLike) -> NDArray[np.float64]:
    """Return the variance of a sample of each channel at these means, without PRNU [e-^2], shape (channel,)."""
    noise = [raw.noise_of(name) for name in raw.channels]
    shot, dark_e = np.array([(x.shot, x.dark_noise_e) for x in noise]).T
    return np.asarray(shot * mean_e + dark_e**2)


def renamed(raw: RawImage, names: Mapping[str, str]) -> RawImage:
    """Return the raw image with other names for its channels, and without its colour calibration."""
    return replace(
        raw,
        cfa=tuple("".join(names.get(name, name) for name in row) for row in raw.cfa),
        colour=None,
        channel_noise=tuple(replace(x, channel=names.get(x.channel, x.channel)) for x in raw.channel_noise),
    )


def _as_array(values: ArrayLike) -> NDArray[Any]:
    """Return values as an array; an empty one of objects for lists of unequal length or numbers beyond 64 bits."""
    try:
        return np.asarray(values)
    except (ValueError, OverflowError):
        return np.empty(0, dtype=np.object_)


def _checked_dn(dn: ArrayLike) -> NDArray[np.uint16]:
    """Return samples as an array; raise `InputError` unless all are finite real numbers."""
    require_unmasked("dn", dn)
    samples = _as_array(dn)
    if samples.dtype.kind not in "uif":
        raise InputError(f"dn: samples of type {samples.dtype} are not allowed; give whole numbers or finite floats")
    if samples.dtype.kind == "f" and not np.isfinite(samples).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(samples))[0])
        raise InputError(
            f"dn: {samples[where]} at {where} is not allowed; give finite numbers: mend or mask that pixel"
        )
    return samples


def _checked_defects(defects: ArrayLike, shape: tuple[int, int]) -> NDArray[np.intp] | None:
    """Return the rows and columns of defects in the frame's order, each pixel once; None where there is none."""
    pixels = _as_array(defects)
    if pixels.size == 0 and pixels.dtype != np.object_:
        return None
    fits = pixels.ndim == 2 and pixels.shape[1] == 2 and pixels.dtype.kind in "iu"
    if not fits or np.any((pixels < 0) | (pixels >= np.array(shape))):
        raise InputError(
            f"defects: shape {pixels.shape} is not allowed; give rows and columns inside {shape}, (n, 2) whole numbers"
        )
    return np.unique(pixels.astype(np.intp), axis=0)
