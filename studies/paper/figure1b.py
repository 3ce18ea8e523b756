"""Figure 1(b): the same scene with pixels of 6 um and of 2 um at 100 cd/m^2 and f/4."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from studies.pages.plots import picture_rows
from studies.paper.checks import Claim, ClaimCheck, at_least, near
from studies.paper.flat import channel_e, decibels, light_of, shot_noise_alone, snr
from studies.paper.page import PaperFigure
from studies.paper.setup import READINGS, SWEEP, Setup, sensor_of, swept
from studies.sweep.prepare import PICTURES
from studies.sweep.row import Row

LUMINANCE_CD_M2, EXPOSURE_S = 100.0, 0.010
LARGE_UM, SMALL_UM = 6, 2
CLAIMED_DB = 9.54  # 20 log10(6 / 2), SNR falls 3 times
MARGIN_DB = 0.5  # 3 times to within 6 %


def gain_db(reading: str, *, shot_alone: bool = False) -> float:
    """SNR of a green pixel of 6 um over that of one of 2 um on a uniform field [dB]."""
    values = []
    for pitch_um in (LARGE_UM, SMALL_UM):
        sensor = sensor_of(reading, "bayer", pitch_um)
        sensor = shot_noise_alone(sensor) if shot_alone else sensor
        electrons = channel_e(sensor, light_of("D65"), LUMINANCE_CD_M2, EXPOSURE_S)
        # The converter's rounding belongs to noise too; with shot noise alone it is left out of the closed form.
        values.append(float(np.sqrt(electrons[1]) if shot_alone else snr(electrons, sensor, EXPOSURE_S)[1]))
    return decibels(values[0] / values[1])


def shown(setup: Setup, row: Row) -> NDArray[np.float64]:
    """Picture of a row, encoded sRGB (h, w, 3)."""
    with Image.open(Path(setup.out) / SWEEP / PICTURES / row.picture) as file:
        return np.asarray(file, dtype=np.float64) / 255


def claims_1b(shot_db: float, all_db: Mapping[str, float], psnr_gain_db: float) -> tuple[Claim, ...]:
    """The gain of 9.54 dB.

    Parameters
    ----------
    shot_db : float
        With shot noise alone.
    all_db : mapping
        With all of the sensor's noise, by reading.
    psnr_gain_db : float
        Of the developed pictures.
    """
    checks: Sequence[ClaimCheck] = (
        near("shot noise alone", shot_db, CLAIMED_DB, MARGIN_DB, "dB"),
        *(near(f"{name}, all noise", value, CLAIMED_DB, MARGIN_DB, "dB") for name, value in all_db.items()),
    )
    return (
        Claim(
            "Figure 1b",
            "From pixels of 6 µm to 2 µm the SNR falls 3 times, 9.54 dB",
            tuple(checks),
            f"A green pixel on a uniform field, 100 cd/m² of D65, f/4, {EXPOSURE_S * 1e3:g} ms (ours: the paper gives "
            "no time). Well in proportion to area, dark noise in electrons kept. Dark noise makes the fall steeper, "
            "fixed pattern makes it flatter.",
        ),
        Claim(
            "Figure 1b",
            "The picture of the smaller pixels is visibly worse",
            (at_least("table1_output, PSNR of 6 µm over 2 µm", psnr_gain_db, 1.0, "dB"),),
            "Developed Bayer pictures against the noise-free truth, mean over seeds; a decibel is easily seen.",
        ),
    )


def figure_1b(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Pictures of the study `paper_1b.toml`, and the SNR."""
    rows = swept(setup, "1b")
    by_sensor = {
        pitch: [row for row in rows if row.sensor == f"table1_output_{pitch}um"] for pitch in (LARGE_UM, SMALL_UM)
    }
    psnr = {pitch: float(np.mean([row.psnr_db for row in own])) for pitch, own in by_sensor.items()}
    pictures = [(f"{pitch} µm, PSNR {psnr[pitch]:.1f} dB", shown(setup, own[0])) for pitch, own in by_sensor.items()]
    everything = {name: gain_db(name) for name in READINGS}
    claims = claims_1b(gain_db("table1_output", shot_alone=True), everything, psnr[LARGE_UM] - psnr[SMALL_UM])
    caption = (
        "The same scene at 100 cd/m², f/4 and 10 ms with pixels of 6 µm and of 2 µm; both pictures have as many pixels."
    )
    return PaperFigure("1b", caption, picture_rows([pictures])), claims
