"""Figure 1(a): one photograph of a dark half and a lit half. The dark one drowns in noise."""

from collections.abc import Mapping

import numpy as np

from render.radiance import SpectralRadiance
from rodcone.colour_spaces import encode_srgb
from scenes.lit_and_shadowed import DARK_CD_M2, LIT_CD_M2
from sensor.exposure import LONGEST_S
from sensor.optics import form_image
from sensor.response import channel_electrons
from studies.pages import report_text as text
from studies.pages.plots import picture_rows
from studies.paper.camera import View, develop, exposures
from studies.paper.checks import Claim, at_least, at_most
from studies.paper.flat import decibels, snr
from studies.paper.page import PaperFigure
from studies.paper.setup import READINGS, TODAY, Setup, sensor_of, view
from studies.study.study import Condition, SceneChoice

LARGE = "table1_output_6um"  # Figure 1(b)'s larger pixel, as cameras of the time had
VISIBLE_NOISE_DB = 30.0  # the paper's measure: noise on a uniform field is visible below
DARK_GAIN = LIT_CD_M2 / DARK_CD_M2  # that shows the dark half as bright as the lit one


def half_snr_db(seen: View, reading: str, dark: bool) -> float:
    """Median SNR of a green pixel in the dark (left) or the lit half [dB]."""
    sensor = sensor_of(reading, "bayer")
    half = seen.radiance.shape[1] // 2
    columns = slice(0, half) if dark else slice(half, None)
    part = SpectralRadiance(
        seen.radiance.values[:, columns], seen.radiance.wavelength_nm, width_nm=seen.radiance.widths_nm
    )
    green = channel_electrons(form_image(part, sensor), sensor, LONGEST_S)[..., 1]
    inside = green[green < sensor.pixel.full_well_e]
    return decibels(float(np.median(snr(inside, sensor, LONGEST_S)))) if inside.size else float("nan")


def claims_1a(dark_db: Mapping[str, float], lit_db: Mapping[str, float]) -> tuple[Claim, ...]:
    """Noise in the dark half, none to be seen in the lit one: SNR of a green pixel by reading [dB]."""
    note = (
        f"Halves of {DARK_CD_M2:g} and {LIT_CD_M2:g} cd/m², one exposure of {LONGEST_S * 1e3:g} ms, Bayer: ours, "
        "the paper gives no conditions; low_noise is a pixel of today. f/2.8, the pixel of 6 µm at f/4. Median SNR of "
        "a green pixel; visible means under 30 dB, as the paper says."
    )
    return (
        Claim(
            "Figure 1a",
            "The scotopic part of one photograph shows noise",
            tuple(at_most(name, value, VISIBLE_NOISE_DB, "dB") for name, value in dark_db.items()),
            note,
        ),
        Claim(
            "Figure 1a",
            "Its well-lit part shows none",
            tuple(at_least(name, value, VISIBLE_NOISE_DB, "dB") for name, value in lit_db.items()),
            "As above.",
        ),
    )


def figure_1a(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """The photograph under both readings, as it is and with its dark half made as bright as the other."""
    seen = view(setup, "lit_and_shadowed", None, "lamp")
    rows, half = [], seen.radiance.shape[1] // 2
    for reading in READINGS:
        sensor = sensor_of(reading, "bayer")
        at = Condition(SceneChoice("lit_and_shadowed"), "own", f"{LIT_CD_M2:g}cd/m2", "66ms", reading)
        linear, _ = develop(exposures(seen, sensor, LONGEST_S, at, 1, "bayer")[0], seen, sensor, "bayer")
        raised = linear.copy()
        raised[:, :half] *= DARK_GAIN
        rows.append(
            [
                (reading, encode_srgb(linear)),
                (f"left half {text.significant(DARK_GAIN)} times brighter", encode_srgb(raised)),
            ]
        )
    dark, lit = ({name: half_snr_db(seen, name, side) for name in (*READINGS, TODAY, LARGE)} for side in (True, False))
    caption = (
        f"One photograph of a cabinet: the left half at {DARK_CD_M2:g} cd/m², the right one at {LIT_CD_M2:g}. "
        "Beside it the same with the left half brightened on the screen: what the camera recorded there."
    )
    return PaperFigure("1a", caption, picture_rows(rows)), claims_1a(dark, lit)
