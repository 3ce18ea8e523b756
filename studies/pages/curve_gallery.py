"""Curves over wavelength side by side, as SVG: spectra of lights, responses of cameras."""

from collections.abc import Mapping
from math import ceil

import numpy as np
from matplotlib import rc_context
from numpy.typing import NDArray

from render.spectrum import Spectrum
from rodcone.plots import CHANNEL_COLOURS, INK
from sensor.curves import Responses
from studies.pages.plots import STYLE, blank, plain_ticks, svg_text

COLUMNS, WIDTH, HIGHEST = 4, 480.0, 200.0  # panels in a row; width of all, and height of the highest [points]
BAND_NM = 5.0  # lines of lamps are drawn as wide as the published tables' steps
NM = np.arange(380.0 + BAND_NM / 2, 780.0, BAND_NM)

Curves = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]  # by channel: wavelength [nm], value


def lights_svg(lights: Mapping[str, Spectrum]) -> str:
    """Draw spectra by name, each in bands of 5 nm, its greatest 1."""
    spectra = {name: light.band_average(NM, BAND_NM) for name, light in lights.items()}
    return _svg({name: {"": (NM, values / values.max())} for name, values in spectra.items()})


def responses_svg(responses: Mapping[str, Responses]) -> str:
    """Draw electrons per photon by name; relative ones have a greatest of 1."""
    return _svg(
        {
            name: {channel: (curve.wavelength_nm, curve.values) for channel, curve in each.curves.items()}
            for name, each in responses.items()
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
