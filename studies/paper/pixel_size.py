"""Figure 1: how much a small pixel loses in the dark.

Part (a) shows a dark half of a scene, which drowns in noise, beside a lit half. Part (b) compares pixels of 6 um with
pixels of 2 um.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from scenes.lit_and_shadowed import DARK_CD_M2, LIT_CD_M2
from sensor.config import LONGEST_S
from sensor.optics import form_image
from sensor.response import channel_electrons
from studies.metrics.truth import named_light
from studies.pages import report_text as text
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, judge_claim, paper_figure
from studies.paper.setup import (
    READINGS,
    TODAY,
    Camera,
    Setup,
    View,
    decibels,
    develop_view,
    exposures,
    quality_db,
    shot_noise_alone,
    table1_sensor,
    view,
)
from studies.photograph.snr import channel_e, snr

LARGE = "table1_output_6um"  # the larger pixel of Figure 1(b), as in cameras of the time
DARK_GAIN = LIT_CD_M2 / DARK_CD_M2  # multiplied by this factor, the dark half is as bright as the lit one
# Figure 1(b).
LUMINANCE_CD_M2, EXPOSURE_S = 100.0, 0.010
LARGE_UM, SMALL_UM = 6, 2


def half_snr_db(subject: View, reading: str, dark: bool) -> float:
    """Return the median SNR of a green pixel in the dark (left) or the lit half [dB]."""
    sensor = table1_sensor(reading, "bayer")
    half = subject.radiance.shape[1] // 2
    columns = slice(0, half) if dark else slice(half, None)
    part = replace(subject.radiance, values=subject.radiance.values[:, columns])
    green = channel_electrons(form_image(part, sensor), sensor, LONGEST_S)[..., 1]
    inside = green[green < sensor.pixel.full_well_e]
    return decibels(float(np.median(snr(inside, sensor, LONGEST_S)))) if inside.size else float("nan")


def claims_1a(dark_db: Mapping[str, float], lit_db: Mapping[str, float]) -> tuple[Claim, ...]:
    """Judge the paper's claims about Figure 1(a): the dark half shows noise, the lit half shows none.

    Parameters
    ----------
    dark_db, lit_db : mapping of str to float
        SNR of a green pixel in each half [dB], by preset.
    """
    light = {"dark": DARK_CD_M2, "lit": LIT_CD_M2, "ms": LONGEST_S * 1e3}
    return judge_claim(6, dark_db, **light), judge_claim(7, lit_db)


def figure_1a(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the photograph under both readings of Table 1, as taken and with its dark half as bright as the lit one."""
    subject = replace(view(setup, "lit_and_shadowed", None, "lamp"), level=f"{LIT_CD_M2:g}cd/m2")
    rows = []
    half = subject.radiance.shape[1] // 2
    for reading in READINGS:
        camera = Camera(reading, "bayer")
        linear, _ = develop_view(camera, exposures(camera, subject, "66ms")[0], subject)
        raised = linear.copy()
        raised[:, :half] *= DARK_GAIN
        rows.append(
            [
                (reading, encode_srgb(linear)),
                (f"left half {text.significant(DARK_GAIN)} times brighter", encode_srgb(raised)),
            ]
        )
    dark, lit = (
        {name: half_snr_db(subject, name, side) for name in (*READINGS, TODAY, LARGE)} for side in (True, False)
    )
    return paper_figure("1a", picture_rows(rows), dark=DARK_CD_M2, lit=LIT_CD_M2), claims_1a(dark, lit)


def gain_db(reading: str, *, shot_alone: bool = False) -> float:
    """Return the SNR of a green pixel of 6 um over that of a green pixel of 2 um, on a uniform field [dB]."""
    values = []
    for pitch_um in (LARGE_UM, SMALL_UM):
        sensor = table1_sensor(reading, "bayer", pitch_um)
        sensor = shot_noise_alone(sensor) if shot_alone else sensor
        electrons = channel_e(sensor, named_light("D65"), LUMINANCE_CD_M2, EXPOSURE_S)
        # The converter's rounding is noise too; with `shot_alone` it is left out, because only the root of e counts.
        values.append(float(np.sqrt(electrons[1]) if shot_alone else snr(electrons, sensor, EXPOSURE_S)[1]))
    return decibels(values[0] / values[1])


def claims_1b(shot_db: float, all_db: Mapping[str, float], psnr_gain_db: Image) -> tuple[Claim, ...]:
    """Judge the claim that large pixels gain 9.54 dB.

    Parameters
    ----------
    shot_db : float
        Gain with shot noise alone.
    all_db : mapping
        Gain with all of the sensor's noise, by reading.
    psnr_gain_db : (seed,) float64
        Gain of the developed pictures.
    """
    shown_db = {"shot noise alone": shot_db} | {f"{name}, all noise": value for name, value in all_db.items()}
    return (
        judge_claim(8, shown_db, ms=EXPOSURE_S * 1e3),
        judge_claim(9, {"table1_output, PSNR of 6 µm over 2 µm": psnr_gain_db}),
    )


def figure_1b(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Develop the study `paper_1b.toml` with pixels of 6 um and of 2 um, and judge the claims about PSNR and SNR."""
    subject = view(setup, "still_life", LUMINANCE_CD_M2)
    psnr = {}
    pictures = []
    for pitch in (LARGE_UM, SMALL_UM):
        camera = Camera("table1_output", "bayer", pitch)
        developed = [develop_view(camera, raw, subject)[0] for raw in exposures(camera, subject, "10ms", setup.seeds)]
        psnr[pitch] = quality_db(developed, subject.truth)
        pictures.append((f"{pitch} µm, PSNR {psnr[pitch].mean():.1f} dB", encode_srgb(developed[0])))
    everything = {name: gain_db(name) for name in READINGS}
    claims = claims_1b(gain_db("table1_output", shot_alone=True), everything, psnr[LARGE_UM] - psnr[SMALL_UM])
    return paper_figure("1b", picture_rows([pictures])), claims
