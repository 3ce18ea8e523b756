"""In how little light the sensors of a report reach an SNR: a table and a plot for the page."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from math import isinf

from sensor.config import SensorConfig
from studies.pages import report_text as text
from studies.pages.snr_chart import snr_svg
from studies.photograph.snr import light_for_snr

SNR, LIGHT, EXPOSURE_S = 10.0, "D65", 0.033  # 20 dB, a photograph's light and time; the same for every study


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
