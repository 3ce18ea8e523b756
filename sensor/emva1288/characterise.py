"""Measure a simulated chip as an EMVA 1288 laboratory does, and report the figures beside the configured values."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, log10, sqrt

import numpy as np

from rodcone.display import BLUE, ORANGE, Axes, brief, draw_curves
from rodcone.doors import method
from rodcone.errors import InputError, require_range, require_whole
from rodcone.jit import backend
from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.emva1288 import estimators as emva
from sensor.emva1288.photon_transfer import Expose, Transfer, dark_slopes, light_bench, take_stack, take_transfer

# Below this variance [DN^2] rounding doesn't simply add 1/12, and the standard gives only an upper limit.
LEAST_VARIANCE_DN2 = 0.24


@dataclass(frozen=True)
class ExposurePlan:
    """Exposures to take: levels of light [e-], exposure time [s], frames per stack, times of the dark series [s]."""

    light_e: Floats
    exposure_s: float
    frames: int
    dark_times_s: Sequence[float]

    __repr__ = brief


@dataclass(frozen=True)
class FigureOfMerit:
    """One result: name, unit, configured and measured value, and the measurement's standard error.

    The error is 0 for a figure that is derived from others.
    """

    name: str
    unit: str
    configured: float
    measured: float
    error: float


@dataclass(frozen=True)
class Characterisation:
    """Results of one chip.

    Attributes
    ----------
    figures : tuple of FigureOfMerit
    transfer : Transfer
    dark_mean_dn, dark_variance_dn2, gain_dn_per_e, saturation_e : float
        Dark mean and variance, slope and end of the photon-transfer line.
    linearity_share : (level,) float64
        Relative deviation of the mean from the fitted line; NaN beyond 5-95 % of saturation.
    notes : tuple of str
        Notes on how to read the figures.
    """

    figures: tuple[FigureOfMerit, ...]
    transfer: Transfer
    dark_mean_dn: float
    dark_variance_dn2: float
    gain_dn_per_e: float
    saturation_e: float
    linearity_share: Floats
    notes: tuple[str, ...]

    __repr__ = brief

    @property
    def snr(self) -> Floats:
        """Return the mean above the dark over the temporal noise at each level; NaN where nothing varies."""
        noise = np.sqrt(np.where(self.transfer.variance_dn2 > 0, self.transfer.variance_dn2, np.nan))
        return np.asarray((self.transfer.mean_dn - self.dark_mean_dn) / noise)

    @method
    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the photon transfer, temporal noise over signal, into Matplotlib's axes, new ones by default."""
        signal_e = (self.transfer.mean_dn - self.dark_mean_dn) / self.gain_dn_per_e
        noise_e = np.sqrt(np.maximum(self.transfer.variance_dn2, 0.0)) / self.gain_dn_per_e
        positive = (signal_e > 0) & (noise_e > 0)
        light_e = np.geomspace(signal_e[positive].min(), signal_e[positive].max(), 60)
        dark_e = float(np.sqrt(max(self.dark_variance_dn2, 0.0)) / self.gain_dn_per_e)
        axes = draw_curves({"shot noise, slope ½": (light_e, np.sqrt(light_e))}, axes, x="signal, e⁻", y="noise, e⁻")
        axes.plot(signal_e[positive], noise_e[positive], color=BLUE, marker="o", markersize=4.0, linestyle="")
        axes.axhline(dark_e, color=ORANGE, linestyle="--", label="dark noise")
        axes.set(xscale="log", yscale="log")
        axes.legend(frameon=False)
        return axes

    def figure(self, name: str) -> FigureOfMerit:
        """Return the figure of merit of this name."""
        return next(figure for figure in self.figures if figure.name == name)


def characterise(
    sensor: SensorConfig,
    shape: tuple[int, int] = (256, 320),
    seed: int = 0,
    exposure_s: float = 0.01,
    exact: bool = False,
) -> Characterisation:
    """Draw one chip, take its frames (`exact` as in `sensor.emva1288.photon_transfer.light_bench`) and report.

    Raises
    ------
    InputError
        For a frame under 16 x 16 pixels, a seed or an exposure time out of range, or a camera that shows no shot noise.
    """
    for name, side in zip(("height", "width"), shape, strict=True):
        require_whole(name, side, 16, 1 << 14, "give the frame's side in pixels")
    require_whole("seed", seed, 0, 2**31, "give a whole number")
    if sensor.chip.readings:
        raise InputError(
            f"sensor: {len(sensor.chip.readings)} readings of a pixel; allowed: one, for the standard has no other; "
            "give one of them (--reading 1, sensor.readings.resolve.chip_readings)"
        )
    require_range("exposure_s", exposure_s, 0.0, 1e6, "give seconds, 0 or more")
    result = measure_camera(light_bench(sensor, shape, seed, exact), plan_for(sensor, exposure_s), sensor)
    engine = "numpy" if exact else backend()
    binning = sensor.chip.binning
    binned = (f"figures are of 2x2 pixels, binned: {binning.way}",) if binning else ()
    return replace(result, notes=(*result.notes, *binned, f"frames were drawn by {engine}"))


def plan_for(sensor: SensorConfig, exposure_s: float = 0.01) -> ExposurePlan:
    """Plan the exposures: even levels up to 1.1 times the well, a few dim ones, and dark times.

    In the longest dark time the pixels with the most dark current fill to about a third.
    """
    pixel = sensor.pixel
    current = pixel.dark_current_e_per_s + pixel.hot_pixel_dark_current_e_per_s
    longest_s = min(0.3 * sensor.top_e / current, 1e6) if current else 1.0
    even = np.linspace(0, 1.1 * sensor.top_e, 56)[1:]
    dim = np.geomspace(1e-4 * sensor.top_e, even[0], 8)[:-1]  # for the plot; too dim to matter in a fit
    light_e = np.concatenate([dim, even])
    dark_times_s = tuple(np.linspace(0, longest_s, 6))
    return ExposurePlan(light_e=light_e, exposure_s=exposure_s, frames=32, dark_times_s=dark_times_s)


def measure_camera(expose: Expose, plan: ExposurePlan, sensor: SensorConfig) -> Characterisation:
    """Run the procedure on any chip; `sensor` states its full well and the configured values for comparison."""
    # Frames
    dark = take_stack(expose, 0.0, plan.exposure_s, plan.frames)
    bright = take_stack(expose, 0.5 * sensor.top_e, plan.exposure_s, plan.frames)
    full = take_stack(expose, 2 * sensor.top_e, plan.exposure_s, 2)
    transfer = take_transfer(expose, plan.light_e, plan.exposure_s)
    slopes = dark_slopes(expose, plan.dark_times_s)

    # Estimates
    saturation_e = float(transfer.light_e[np.argmax(transfer.variance_dn2)])
    dark_mean_dn = float(dark.mean_dn.mean())
    gain = emva.gain(transfer, dark, saturation_e)
    linear, linear_error = emva.linearity(transfer, dark_mean_dn, saturation_e)
    current, hot_share, hot_current = emva.dark_current(slopes, gain)
    column_gain = emva.column_gain(dark, bright)
    dark_e = plan.exposure_s * (current[0] + hot_share[0] * hot_current[0])
    # Light that equals the noise, in the standard's form.
    threshold_e = sqrt(max(dark.variance_dn2, 0.0)) / gain[0] + 0.5
    expected = configured(sensor, plan.exposure_s)
    beyond_e = sensor.pixel.full_well_e - sensor.top_e
    estimates = (
        ("gain", "DN/e-", gain),
        ("dark noise", "e-", emva.dark_noise(dark, gain)),
        ("DSNU", "e-", emva.dsnu(dark, gain)),
        ("PRNU", "1", emva.prnu(dark, bright)),
        ("column offsets", "e-", emva.column_offset(dark, gain)),
        ("column gains", "1", column_gain),
        ("dark current", "e-/s", current),
        ("hot pixels", "1", hot_share),
        ("their dark current", "e-/s", hot_current),
        ("full well", "e-", emva.well(full, dark, gain, column_gain[0], dark_e, beyond_e)),
        ("saturation", "e-", (saturation_e, 0.0)),
        ("threshold", "e-", (threshold_e, 0.0)),
        ("dynamic range", "dB", (_decibels(saturation_e / threshold_e), 0.0)),
        ("greatest SNR", "dB", (_decibels(sqrt(saturation_e)), 0.0)),
        ("linearity error", "1", (linear_error, 0.0)),
    )
    # What a reader has to know
    notes = [
        "light is set in electrons: quantum efficiency is 1",
        "saturation is where the temporal variance peaks, under the well where PRNU spreads the clipping; the dynamic "
        "range and the greatest SNR follow from it, configured ones from the well",
    ]
    if dark.variance_dn2 < LEAST_VARIANCE_DN2:
        notes.append(
            f"the dark's variance, {dark.variance_dn2:.3f} DN^2, is under {LEAST_VARIANCE_DN2}: rounding hides the "
            f"dark noise, which is less than {0.4 / gain[0]:.3g} e-, and moves DSNU"
        )
    return Characterisation(
        figures=tuple(FigureOfMerit(name, unit, expected[name], *estimate) for name, unit, estimate in estimates),
        transfer=transfer,
        dark_mean_dn=dark_mean_dn,
        dark_variance_dn2=dark.variance_dn2,
        gain_dn_per_e=gain[0],
        saturation_e=saturation_e,
        linearity_share=linear,
        notes=tuple(notes),
    )


def configured(sensor: SensorConfig, exposure_s: float) -> dict[str, float]:
    """Return each figure as configured, without measurement error.

    Saturation is the converter's top, as if all pixels clipped at once.
    """
    pixel = sensor.pixel
    share = sensor.pixel.hot_pixel_share
    hot_e = pixel.hot_pixel_dark_current_e_per_s * exposure_s
    dark_e = pixel.dark_current_e_per_s * exposure_s + share * hot_e
    dark_noise_e = sqrt(sensor.read_noise_e**2 + dark_e)
    threshold_e = hypot(dark_noise_e, sensor.gain_e_per_dn / sqrt(12)) + 0.5
    return {
        "gain": 1 / sensor.gain_e_per_dn,
        "dark noise": dark_noise_e,
        "DSNU": hypot(pixel.fixed_dark_e, sqrt(share * (1 - share)) * hot_e, pixel.column_gain_spread * dark_e),
        "PRNU": pixel.fixed_gain,
        "column offsets": hypot(pixel.column_offset_e, pixel.column_gain_spread * dark_e),
        "column gains": pixel.column_gain_spread,
        "dark current": pixel.dark_current_e_per_s,
        "hot pixels": share if pixel.hot_pixel_dark_current_e_per_s else 0.0,
        "their dark current": pixel.hot_pixel_dark_current_e_per_s if share else 0.0,
        "full well": sensor.top_e,
        "saturation": sensor.top_e,
        "threshold": threshold_e,
        "dynamic range": _decibels(sensor.top_e / threshold_e),
        "greatest SNR": _decibels(sqrt(sensor.top_e)),
        "linearity error": 0.0,
    }


def _decibels(ratio: float) -> float:
    return 20 * log10(ratio)
