"""SNR of each channel's pixel over light, for one sensor or several, as SVG."""

from collections.abc import Mapping

import numpy as np
from matplotlib import rc_context

from rodcone.plots import CHANNEL_COLOURS
from sensor.config import SensorConfig
from studies.pages.plots import CHART, SOFT, STYLE, blank, plain_ticks, svg_text
from studies.photograph.snr import snr_at

LINES = ("-", "--", ":", "-.")  # a sensor each, in turn
LEAST_CD_M2, MOST_CD_M2, POINTS = 1e-4, 1e5, 181  # starlight to sunlit snow


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
