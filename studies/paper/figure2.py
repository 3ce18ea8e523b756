"""Figure 2: the four response curves and the tile, and W's light and SNR in comparison with R, G and B."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from math import sqrt

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from rodcone.types import Floats
from sensor.curves import rgbw
from sensor.readout import noise_variance
from studies.metrics.truth import named_light
from studies.pages.plots import BLUE, CHART, COLOURS, GREEN, INK, ORANGE, SOFT, STYLE, blank, name_at_ends, plain_ticks
from studies.paper.claims import Claim, PaperFigure, about, claim, judge_claim, paper_figure
from studies.paper.numbers import MOONLIGHT_CD_M2
from studies.paper.setup import READINGS, TODAY, table1_sensor, with_even_response
from studies.photograph.snr import channel_e, snr

NM: Floats = np.arange(400.0, 701.0, 2.0)  # the paper's range [nm]
CHANNELS = "RGBW"
CLAIMED = {"R": 10.0, "G": 6.0, "B": 10.0}
SNR_EXPOSURE_S = 0.020  # the longest exposure of Figure 6
BRIGHT = 0.9  # share of the full well that W reaches in "bright light"; above it W saturates
LEVELS = np.geomspace(1e-3, 1e2, 51)  # [cd/m^2]; W is full at more
FILLS = {"R": "#c8504b", "G": "#5a9e58", "B": "#4d72c0", "W": "#f4f4f0"}
SENSORS = (*READINGS, TODAY)

Ratios = Mapping[str, float]  # electrons of W over those of each colour


@dataclass(frozen=True)
class Gain:
    """W's SNR over a colour's; the share of dark noise in the variance of W's pixel, of shot noise in the colour's."""

    ratio: float
    dark: float
    shot: float


Gains = Mapping[str, Mapping[str, Gain]]  # by sensor and colour


def signal_ratios(light: str) -> Ratios:
    """Return the electrons of W over those of R, G and B in a light, from 380 to 780 nm."""
    electrons = channel_e(table1_sensor("table1_output"), named_light(light), 1.0, 1.0)
    return dict(zip("RGB", (electrons[3] / electrons[:3]).tolist(), strict=True))


def snr_gains(name: str, luminance_cd_m2: float, *, fixed_pattern: bool = True) -> Mapping[str, Gain]:
    """Return the SNR of a pixel of W over that of a pixel of R, G and B, on a uniform neutral field under D65."""
    sensor = table1_sensor(name) if fixed_pattern else with_even_response(table1_sensor(name))
    electrons = channel_e(sensor, named_light("D65"), luminance_cd_m2, SNR_EXPOSURE_S)
    values = snr(electrons, sensor, SNR_EXPOSURE_S)
    variance = noise_variance(electrons, sensor, SNR_EXPOSURE_S)
    dark = float(noise_variance(np.zeros(1), sensor, SNR_EXPOSURE_S)[0] / variance[3])
    return {
        channel: Gain(float(values[3] / values[i]), dark, float(electrons[i] / variance[i]))
        for i, channel in enumerate("RGB")
    }


def bright_cd_m2(name: str) -> float:
    """Return the luminance at which W is nearly full [cd/m^2]."""
    sensor = table1_sensor(name)
    return float(BRIGHT * sensor.pixel.full_well_e / channel_e(sensor, named_light("D65"), 1.0, SNR_EXPOSURE_S)[3])


def coverage() -> float:
    """Return the smallest value over the wavelengths of W's response over the largest response of R, G and B."""
    values = rgbw().band_average(tuple(CHANNELS), NM, np.full(NM.size, 2.0))
    return float((values[3] / values[:3].max(axis=0)).min())


def signal_claims(ratios: Mapping[str, Ratios], least: float) -> tuple[Claim, ...]:
    """Judge the claims that W is wideband, and that it gathers 6 times as much light as G and 10 times as R and B.

    Parameters
    ----------
    ratios : mapping
        Electrons of W over those of R, G and B (`signal_ratios`), by light.
    least : float
        Smallest ratio, over wavelength, of W's response to the largest of R's, G's and B's (`coverage`).
    """
    return (
        judge_claim(10, {"W over the largest of the three, at its least": least}),
        claim(
            11,
            chain.from_iterable(
                about({f"{channel}, {light}, 380-780 nm": value}, CLAIMED[channel], "×")
                for light, of_light in ratios.items()
                for channel, value in of_light.items()
            ),
        ),
    )


def snr_claims(moon: Gains, bright: Gains, pure: Gains) -> tuple[Claim, ...]:
    """Judge the claims that W's gain in SNR is the signals' ratio if read noise prevails, its root if shot noise does.

    Parameters
    ----------
    moon, bright : mapping
        `snr_gains` in moonlight, and with W nearly full.
    pure : mapping
        Like `bright`, but without fixed patterns.
    """
    roots = {channel: sqrt(value) for channel, value in signal_ratios("D65").items()}
    return (
        claim(
            12,
            chain.from_iterable(
                about({f"{channel}, {name}, {where}: {gain.dark:.0%} dark noise": gain.ratio}, CLAIMED[channel], "×")
                for where, by_sensor in (("moonlight", moon), ("W full", bright))
                for name, of_sensor in by_sensor.items()
                for channel, gain in of_sensor.items()
            ),
            ms=SNR_EXPOSURE_S * 1e3,
        ),
        claim(
            13,
            chain.from_iterable(
                about({f"{channel}, {name}: {gain.shot:.0%} shot noise": gain.ratio}, roots[channel], "×")
                for name, of_sensor in pure.items()
                for channel, gain in of_sensor.items()
            ),
            ms=SNR_EXPOSURE_S * 1e3,
        ),
    )


def figure_2() -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the response curves, the tile and W's gain over light, and judge the claims about them."""
    moon = {name: snr_gains(name, MOONLIGHT_CD_M2) for name in READINGS}
    bright = {name: snr_gains(name, bright_cd_m2(name)) for name in READINGS}
    pure = {name: snr_gains(name, bright_cd_m2(name), fixed_pattern=False) for name in SENSORS}
    claims = signal_claims({light: signal_ratios(light) for light in ("E", "D65")}, coverage())
    return paper_figure("2", _drawing(), ms=SNR_EXPOSURE_S * 1e3), (*claims, *snr_claims(moon, bright, pure))


@rc_context(STYLE)
def _drawing() -> Figure:
    """Draw the responses, the tile, and W's gain."""
    figure = blank(2 * CHART[0], CHART[1])
    left, middle, right = figure.subplots(1, 3, width_ratios=(10, 2, 10))
    responses = rgbw().band_average(tuple(CHANNELS), NM, np.full(NM.size, 2.0))
    for channel, response, colour in zip(CHANNELS, responses, (ORANGE, GREEN, BLUE, INK), strict=True):
        left.plot(NM, response, color=colour, linestyle="--" if channel == "W" else "-")
        peak = int(response.argmax())
        place = NM[peak], response[peak]
        left.annotate(channel, place, (0, 3), textcoords="offset points", color=colour, ha="center")
    left.set(title="Responses, electrons per photon", xlabel="wavelength, nm", ylim=(0.0, None))
    _draw_tile(middle)
    ends = []
    for slot, name in enumerate(SENSORS):
        gains = [snr_gains(name, float(level))["G"].ratio for level in LEVELS]
        right.semilogx(LEVELS, gains, color=COLOURS[slot], linestyle="--" if slot == 1 else "-")
        ends.append((name, gains[-1], COLOURS[slot]))
    root = sqrt(signal_ratios("D65")["G"])
    right.axhline(root, color=SOFT, linestyle="--")
    right.set(title="W's SNR over G's, one pixel", xlabel="luminance, cd/m²", xlim=(LEVELS[0], LEVELS[-1]))
    plain_ticks(right)
    name_at_ends(right, [*ends, ("√ of signals' ratio", root, SOFT)])
    return figure


def _draw_tile(axes: Axes) -> None:
    """Draw the 2x2 tile, the channel in each pixel."""
    axes.set_axis_off()
    axes.imshow([[to_rgb(FILLS[channel]) for channel in row] for row in ("RG", "BW")])
    for index, channel in enumerate(CHANNELS):
        axes.text(index % 2, index // 2, channel, ha="center", va="center")
