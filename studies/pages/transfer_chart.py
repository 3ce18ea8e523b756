"""Plots of a characterisation as one SVG: photon transfer (linear, logarithmic), SNR and linearity."""

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes

from sensor.emva1288.characterise import Characterisation
from studies.pages.plots import BLUE, CHART, ORANGE, STYLE, blank, plain_ticks, svg_text


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
