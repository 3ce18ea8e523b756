"""SNR of each channel's pixel over light: a plot, and in how little light sensors reach an SNR, as a table."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from math import isinf

import numpy as np
from matplotlib import rc_context

from rodcone.plots import CHANNEL_COLOURS
from sensor.config import SensorConfig
from studies.pages import report_text as text
from studies.pages.plots import CHART, SOFT, STYLE, blank, plain_ticks, svg_text
from studies.photograph.snr import light_for_snr, snr_at

LINES = ("-", "--", ":", "-.")  # a sensor each, in turn
LEAST_CD_M2, MOST_CD_M2, POINTS = 1e-4, 1e5, 181  # starlight to sunlit snow
SNR, LIGHT, EXPOSURE_S = 10.0, "D65", 0.033  # 20 dB, a photograph's light and time; the same for every study


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


@dataclass(frozen=True)
class SnrOverLight:
    """Rows of texts, and the address of the plot; empty without a sensor."""

    rows: list[tuple[str, ...]]
    image: str


def snr_over_light(sensors: Mapping[str, SensorConfig]) -> SnrOverLight:
    """Table and plot of the sensors, by name."""
    return SnrOverLight(snr_rows(sensors), snr_image(sensors) if sensors else "")


def snr_rows(sensors: Mapping[str, SensorConfig]) -> list[tuple[str, ...]]:
    """Sensor, channel, electrons, cd/m^2 and lux on a grey card at `SNR`, as texts."""
    return [
        (name, each.channel, *(text.MISSING if isinf(value) else text.significant(value) for value in figures))
        for name, sensor in sensors.items()
        for each in light_for_snr(SNR, sensor, LIGHT, EXPOSURE_S)
        for figures in [(each.electrons, each.luminance_cd_m2, each.illuminance_lux)]
    ]


def snr_image(sensors: Mapping[str, SensorConfig]) -> str:
    """Address of the plot that holds the plot itself: SVG, as the page's policy allows."""
    return f"data:image/svg+xml;base64,{b64encode(snr_svg(sensors, LIGHT, EXPOSURE_S, SNR).encode()).decode()}"
