"""Figures 1 and B: what a small pixel costs in the dark, and a camera that is held in the hand.

Figure 1: (a) a dark half that drowns in noise beside a lit one, (b) pixels of 6 um and of 2 um. Figure B, camera shake:
the best exposure time by hand at each level, and what of W's light makes pictures sharp. A longer time brings light and
blur; W brings light without blur. A camera's best time is where they balance.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import log2

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import encode_srgb
from scenes.lit_and_shadowed import DARK_CD_M2, LIT_CD_M2
from sensor.config import LONGEST_S, SensorConfig
from sensor.optics import form_image
from sensor.response import channel_electrons
from sensor.shake import blur_variance
from studies.metrics.truth import light_of
from studies.pages import report_text as text
from studies.pages.plots import light_charts, picture_rows
from studies.paper.claims import Claim, PaperFigure, at_least, at_most, beside, claim, near, paper_figure
from studies.paper.setup import (
    DEFAULT,
    PAPER,
    READINGS,
    TODAY,
    Camera,
    Image,
    Setup,
    View,
    at_level,
    close_up,
    decibels,
    develop,
    exposures,
    quality_db,
    sensor_of,
    shot_noise_alone,
    view,
)
from studies.photograph.snr import channel_e, snr

LARGE = "table1_output_6um"  # Figure 1(b)'s larger pixel, as cameras of the time had
VISIBLE_NOISE_DB = 30.0  # the paper's measure: noise on a uniform field is visible below
DARK_GAIN = LIT_CD_M2 / DARK_CD_M2  # that shows the dark half as bright as the lit one
# Figure 1(b)
LUMINANCE_CD_M2, EXPOSURE_S = 100.0, 0.010
LARGE_UM, SMALL_UM = 6, 2
CLAIMED_DB = 9.54  # 20 log10(6 / 2), SNR falls 3 times
MARGIN_DB = 0.5  # 3 times to within 6 %


def half_snr_db(subject: View, reading: str, dark: bool) -> float:
    """Median SNR of a green pixel in the dark (left) or the lit half [dB]."""
    sensor = sensor_of(reading, "bayer")
    half = subject.radiance.shape[1] // 2
    columns = slice(0, half) if dark else slice(half, None)
    part = replace(subject.radiance, values=subject.radiance.values[:, columns])
    green = channel_electrons(form_image(part, sensor), sensor, LONGEST_S)[..., 1]
    inside = green[green < sensor.pixel.full_well_e]
    return decibels(float(np.median(snr(inside, sensor, LONGEST_S)))) if inside.size else float("nan")


def claims_1a(dark_db: Mapping[str, float], lit_db: Mapping[str, float]) -> tuple[Claim, ...]:
    """Noise in the dark half, none to be seen in the lit one: SNR of a green pixel by reading [dB]."""
    light = {"dark": DARK_CD_M2, "lit": LIT_CD_M2, "ms": LONGEST_S * 1e3}
    noisy, clean = at_most(dark_db, VISIBLE_NOISE_DB, "dB"), at_least(lit_db, VISIBLE_NOISE_DB, "dB")
    return claim(6, noisy, **light), claim(7, clean)


def figure_1a(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """The photograph under both readings, as it is and with its dark half made as bright as the other."""
    subject = replace(view(setup, "lit_and_shadowed", None, "lamp"), level=f"{LIT_CD_M2:g}cd/m2")
    rows, half = [], subject.radiance.shape[1] // 2
    for reading in READINGS:
        camera = Camera(reading, "bayer")
        linear, _ = develop(camera, exposures(camera, subject, "66ms")[0], subject)
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
    """SNR of a green pixel of 6 um over that of one of 2 um on a uniform field [dB]."""
    values = []
    for pitch_um in (LARGE_UM, SMALL_UM):
        sensor = sensor_of(reading, "bayer", pitch_um)
        sensor = shot_noise_alone(sensor) if shot_alone else sensor
        electrons = channel_e(sensor, light_of("D65"), LUMINANCE_CD_M2, EXPOSURE_S)
        # The converter's rounding belongs to noise too; with shot noise alone it is left out of the closed form.
        values.append(float(np.sqrt(electrons[1]) if shot_alone else snr(electrons, sensor, EXPOSURE_S)[1]))
    return decibels(values[0] / values[1])


def claims_1b(shot_db: float, all_db: Mapping[str, float], psnr_gain_db: Image) -> tuple[Claim, ...]:
    """The gain of 9.54 dB.

    Parameters
    ----------
    shot_db : float
        With shot noise alone.
    all_db : mapping
        With all of the sensor's noise, by reading.
    psnr_gain_db : (seed,) float64
        Of the developed pictures.
    """
    shown_db = {"shot noise alone": shot_db} | {f"{name}, all noise": value for name, value in all_db.items()}
    return (
        claim(8, near(shown_db, CLAIMED_DB, MARGIN_DB, "dB"), ms=EXPOSURE_S * 1e3),
        claim(9, at_least({"table1_output, PSNR of 6 µm over 2 µm": psnr_gain_db}, 1.0, "dB")),
    )


def figure_1b(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Pictures of the study `paper_1b.toml`, and the SNR."""
    subject = view(setup, "still_life", LUMINANCE_CD_M2)
    psnr, pictures = {}, []
    for pitch in (LARGE_UM, SMALL_UM):
        camera = Camera("table1_output", "bayer", pitch)
        developed = [develop(camera, raw, subject)[0] for raw in exposures(camera, subject, "10ms", setup.seeds)]
        psnr[pitch] = quality_db(developed, subject.truth)
        pictures.append((f"{pitch} µm, PSNR {psnr[pitch].mean():.1f} dB", encode_srgb(developed[0])))
    everything = {name: gain_db(name) for name in READINGS}
    claims = claims_1b(gain_db("table1_output", shot_alone=True), everything, psnr[LARGE_UM] - psnr[SMALL_UM])
    return paper_figure("1b", picture_rows([pictures])), claims


LEVELS_CD_M2 = (1.0, 4.0, 16.0, 64.0)
TIMES_S = 0.005 * 2.0 ** np.arange(8)
LEVEL_OCTAVES = 0.1  # a time that is hardly shorter
READING, BAYER = "table1_output", "bayer"


@dataclass(frozen=True)
class Best:
    """Best exposure of a camera at one level, by exposure of its own (seed,).

    Attributes
    ----------
    time_s, psnr_db : (seed,) float64
    blur_px : float
        Standard deviation of the image's place at the mean time, along each axis.
    """

    time_s: Image
    psnr_db: Image
    blur_px: float


def best_time_s(times_s: NDArray[np.floating], quality: NDArray[np.floating]) -> tuple[float, float]:
    """Time of the highest quality, shape (time,), and that quality.

    That is the top of the parabola over log time through the best and its neighbours; at either end it is that time.
    """
    index = int(quality.argmax())
    if index in (0, len(times_s) - 1):
        return float(times_s[index]), float(quality[index])
    near = slice(index - 1, index + 2)
    curve = np.polynomial.Polynomial.fit(np.log(times_s[near]), quality[near], 2, domain=[])
    top = float(curve.deriv().roots()[0])
    return float(np.exp(top)), float(curve(top))


def blur_px(sensor: SensorConfig, exposure_s: float) -> float:
    """Standard deviation of the image's place within an exposure, along each axis [pixels]."""
    return float(sensor.lens.shake_um / sensor.site_pitch_um * blur_variance(exposure_s) ** 0.5)


def measure_best(setup: Setup, subject: View, camera: Camera) -> Mapping[float, Best]:
    """Best exposure of a camera by level; `subject` at 1 cd/m^2."""
    best = {}
    for level in LEVELS_CD_M2:
        lit = at_level(subject, level)
        quality = np.stack(
            [
                quality_db(
                    [develop(camera, raw, lit)[0] for raw in exposures(camera, lit, f"{time * 1e3:g}ms", setup.seeds)],
                    lit.truth,
                )
                for time in TIMES_S
            ]
        )
        time_s, psnr_db = np.array([best_time_s(TIMES_S, of_seed) for of_seed in quality.T]).T
        best[level] = Best(time_s, psnr_db, blur_px(camera.sensor, float(time_s.mean())))
    return best


def claims_held(bayer: Mapping[float, Best], interleaved: Mapping[float, Best], more_light: float) -> tuple[Claim, ...]:
    """Shorter times and better pictures by hand, at the best time of each camera.

    Parameters
    ----------
    bayer, interleaved : mapping
        By level [cd/m^2].
    more_light : float
        Electrons of the RGBW tile over those of Bayer's.
    """
    pairs = {f"{level:g} cd/m²": (bayer[level], interleaved[level]) for level in bayer}
    octaves = {name: np.log2(theirs.time_s / ours.time_s) for name, (theirs, ours) in pairs.items()}
    mean_octaves = np.mean([values.mean() for values in octaves.values()])
    times = "; ".join(
        f"{name} {theirs.time_s.mean() * 1e3:.3g} and {ours.time_s.mean() * 1e3:.3g} ms, blur {theirs.blur_px:.2f} and "
        f"{ours.blur_px:.2f} pixels"
        for name, (theirs, ours) in pairs.items()
    )
    shorter = {f"{name}, best time shorter by": x for name, x in octaves.items()}
    gained_db = {f"{name}, PSNR gained": ours.psnr_db - theirs.psnr_db for name, (theirs, ours) in pairs.items()}
    return (
        claim(
            27,
            at_least(shorter, LEVEL_OCTAVES, "octaves"),
            reading=READING,
            count=len(TIMES_S),
            times=times,
            more_light=more_light,
            octaves=log2(more_light),
            share=mean_octaves / log2(more_light),
        ),
        claim(28, at_least(gained_db, 0.0, "dB")),
    )


def figure_b(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Best exposures by hand of Bayer, the paper's camera and the default, and the claims about them."""
    subject = close_up(view(setup, "still_life", 1.0))
    best = {name: measure_best(setup, subject, Camera(READING, name, shake="hand")) for name in (BAYER, PAPER, DEFAULT)}
    light = light_of("D65")
    rgbw, bayer = (channel_e(Camera(READING, name).sensor, light, 1.0, 1.0) for name in (PAPER, BAYER))
    more_light = float(rgbw.sum() / (bayer @ [1.0, 2.0, 1.0]))  # Bayer's tile has green twice
    claims = beside(lambda of: claims_held(best[BAYER], of, more_light), best)
    names = {"Bayer": best[BAYER], "interleaved": best[PAPER], "the default": best[DEFAULT]}
    charts = {
        "Best time by hand, ms": {
            name: [1e3 * one.time_s.mean() for one in of_level.values()] for name, of_level in names.items()
        },
        "PSNR at the best time, dB": {
            name: [one.psnr_db.mean() for one in of_level.values()] for name, of_level in names.items()
        },
    }
    return paper_figure("B", light_charts(LEVELS_CD_M2, charts), reading=READING), claims
