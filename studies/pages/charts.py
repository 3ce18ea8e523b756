"""Plots of commands as SVG: spectra and responses side by side, SNR over light, a chip's photon transfer."""

from collections.abc import Mapping
from math import ceil

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from numpy.typing import NDArray

from render.spectrum import Spectrum
from rodcone.plots import CHANNEL_COLOURS, INK
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.emva1288.characterise import Characterisation
from studies.pages.plots import BLUE, CHART, ORANGE, SOFT, STYLE, blank, plain_ticks, svg_text
from studies.photograph.snr import snr_at

COLUMNS, WIDTH, HIGHEST = 4, 480.0, 200.0  # panels in a row; width of all, and height of the highest [points]
BAND_NM = 5.0  # lines of lamps are drawn as wide as the published tables' steps
NM = np.arange(380.0 + BAND_NM / 2, 780.0, BAND_NM)
LINES = ("-", "--", ":", "-.")  # a sensor each, in turn
LEAST_CD_M2, MOST_CD_M2, POINTS = 1e-4, 1e5, 181  # starlight to sunlit snow
SNR = 10.0  # 20 dB

Curves = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]  # by channel: wavelength [nm], value


def lights_svg(lights: Mapping[str, Spectrum]) -> str:
    """Draw spectra by name, each in bands of 5 nm, its greatest 1."""
    spectra = {name: light.band_average(NM, BAND_NM) for name, light in lights.items()}
    return _svg({name: {"": (NM, values / values.max())} for name, values in spectra.items()})


def responses_svg(responses: Mapping[str, Responses]) -> str:
    """Draw electrons per photon by name; relative ones have a greatest of 1."""
    return _svg(
        {
            name: {channel: (curve.wavelength_nm, curve.values) for channel, curve in response.curves.items()}
            for name, response in responses.items()
        }
    )


@rc_context(STYLE)
def _svg(panels: Mapping[str, Curves]) -> str:
    rows, columns = ceil(len(panels) / COLUMNS), min(len(panels), COLUMNS)
    figure = blank(WIDTH, rows * min(0.8 * WIDTH / columns, HIGHEST) + 20)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, (name, curves) in zip(grid.flat, panels.items(), strict=False):
        for channel, (nm, values) in curves.items():
            axes.plot(nm, values, color=CHANNEL_COLOURS.get(channel, INK), linewidth=0.9)
        axes.set_title(name.replace("$", r"\$"), fontsize=8)  # a formula's sign
        axes.set(xlim=(380, 780), ylim=(0, 1.05))
        axes.tick_params(labelsize=7)
        plain_ticks(axes)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_visible(False)
    figure.supxlabel("nm", fontsize=8)
    return svg_text(figure)


@rc_context(STYLE)
def snr_svg(sensors: Mapping[str, SensorConfig], light: str, exposure_s: float, mark: float) -> str:
    """Draw SNR [dB] over luminance up to the full well; `mark` is a line across."""
    figure = blank(1.5 * CHART[0], 1.3 * CHART[1])
    axes = figure.subplots()
    luminance = np.geomspace(LEAST_CD_M2, MOST_CD_M2, POINTS)
    for index, (name, sensor) in enumerate(sensors.items()):
        for channel, ratio in snr_at(luminance, sensor, light, exposure_s).items():
            colour = CHANNEL_COLOURS.get(channel, SOFT)
            line, label = LINES[index % len(LINES)], f"{name} {channel}".replace("$", r"\$")  # a formula's sign
            axes.semilogx(luminance, 20 * np.log10(ratio), line, color=colour, label=label)
    axes.axhline(20 * np.log10(mark), color=SOFT, linewidth=0.8)
    axes.set(title=f"SNR of a pixel [dB], {light}, {1e3 * exposure_s:g} ms", xlabel="cd/m²", ylim=(-20, None))
    plain_ticks(axes)
    axes.legend(fontsize=8)
    return svg_text(figure)


@rc_context(STYLE)
def transfer_svg(result: Characterisation, title: str) -> str:
    """Draw four plots into one SVG document."""
    transfer, gain = result.transfer, result.gain_dn_per_e
    signal_dn = transfer.mean_dn - result.dark_mean_dn
    signal_e = signal_dn / gain
    useful = (signal_dn > 0) & (transfer.light_e <= result.saturation_e)  # beyond it clipping hides the noise
    dark_e = float(np.sqrt(max(result.dark_variance_dn2, 0.0)) / gain)
    light_e = np.geomspace(signal_e[signal_e > 0].min(), signal_e.max(), 60)
    figure = blank(2 * CHART[0], 2.3 * CHART[1])
    figure.suptitle(title, x=0.02, ha="left", weight="bold")
    linear, logarithmic, snr, linearity = figure.subplots(2, 2).flat

    _draw(linear, signal_dn, transfer.variance_dn2)
    line_dn = np.array([0.0, signal_dn.max()])
    linear.plot(line_dn, gain * line_dn + result.dark_variance_dn2, color=BLUE, label=f"slope {gain:.4g} DN/e⁻")
    linear.set(title="Photon transfer: temporal variance, DN²", xlabel="mean above dark, DN")

    result.plot(logarithmic)
    logarithmic.set(title="Photon transfer, logarithmic: temporal noise, e⁻", ylabel="")

    _draw(snr, signal_e[useful], 20 * np.log10(result.snr[useful]))
    snr.plot(light_e, 10 * np.log10(light_e), color=BLUE, label="shot noise alone")
    with_dark_db = 20 * np.log10(light_e / np.sqrt(light_e + dark_e**2))
    snr.plot(light_e, with_dark_db, color=ORANGE, linestyle="--", label="with dark noise")
    snr.set(xscale="log", title="Signal to noise: SNR, dB", xlabel="signal, e⁻")

    _draw(linearity, signal_e, 100 * result.linearity_share)
    linearity.set(title="Linearity: deviation from the line, %", xlabel="signal, e⁻")
    for axes in (linear, logarithmic, snr, linearity):
        plain_ticks(axes)
    for axes in (linear, logarithmic, snr):
        axes.legend()
    return svg_text(figure)


def _draw(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw measured points, those that are not finite left out."""
    known = np.isfinite(x) & np.isfinite(y)
    axes.plot(x[known], y[known], color=BLUE, marker="o", markersize=4.0, linestyle="")
