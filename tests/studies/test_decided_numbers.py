"""Numbers that a standard, a paper, a data sheet or a page of our documents states, and the code that holds each.

Tests of formulas take them from here or write them out; a test that imports a number from the code that it checks
agrees with any.
"""

from importlib import import_module

import numpy as np
import pytest

# By where they are stated: standards and papers first, then docs/how_to/score.md, docs/budget.md, docs/paper.md and
# the other pages.
STATED = {
    "EMVA 1288, release 4: the gain up to 70 % of saturation, linearity from 5 to 95 %, rounding's variance": {
        "sensor.emva1288.estimators": {"FIT_SHARE": 0.7, "LINEAR_RANGE": (0.05, 0.95), "QUANTISATION_DN2": 1 / 12},
        "sensor.emva1288.characterise": {"LEAST_VARIANCE_DN2": 0.24},
        "sensor.emva1288.from_frames": {
            "NORMAL_95": 1.959964,
            "MOST_UNEVEN": 0.03,
            "SAME_LIGHT": 0.02,
            "MOST_CLIPPED": 0.001,
            "LEAST_SIDE": 8,
            "LEAST_LIGHTS": 3,
            "SPREAD": (0.4, 0.6),
            "TOLD": 2.0,
            "UNKNOWN_CHANGE": 0.05,
        },
    },
    "ISO 12232, 14524, 15739, 17321 and 12233": {
        "studies.study.gain": {"ISO_SATURATION_LUX_S": 78.0},
        "studies.score.noise_figures": {
            "ISO_NOISE_LUX_S": 10.0,
            "REFERENCE_SHARE": 0.13,
            "RAMP_TOP": 0.65,
            "SNR1S": ("3200 K", 1 / 60, 1.4),
        },
        "studies.score.output_speeds": {"OUTPUT": 118 / 255},
        "studies.score.visual_noise": {"WEIGHTS": (1.0, 0.852, 0.323), "WHITE_SHARE": 0.7},
        "studies.score.colour": {"INDEX_FACTOR": 5.5, "GREYS": 6, "COLOURS": 3, "WHITE_SHARE": 0.7},
        "studies.score.sharpness": {"ANGLE_DEG": 5.0, "CONTRAST": 4.0, "BRIGHT_SHARE": 0.6},
        "studies.metrics.mtf": {"OVERSAMPLING": 4, "HIGHEST_CYCLES_PER_PX": 1.0},
        "studies.metrics.truth": {"GREY": 0.18},
    },
    "IEEE 1858 and 2020: contrast sensitivity; pairs of 20 % within 50 %; a lamp of 100 Hz in 2 ms": {
        "studies.score.sharpness": {"CSF_POWER": 0.8, "CSF_DECAY": 0.2},
        "studies.score.contrast": {"CONTRAST": 0.2, "TOLERANCE": 0.5, "LUX": (0.1, 1.0, 10.0, 100.0)},
        "studies.score.flicker": {"LAMP": "metal_halide@100Hz", "EXPOSURE_S": 0.002},
    },
    "test houses' definitions: 30 dB at 18 %, 9 stops and 18 bits; a ratio of 20 in 22 um": {
        "studies.score.print_figures": {
            "GREY_SHARE": 0.18,
            "LEAST_DB": 30.0,
            "LEAST_STOPS": 9.0,
            "LEAST_BITS": 18.0,
            "WHITE_SHARE": 0.9,
            "CONFUSION_UM": 22.0,
            "PDR_RATIO": 20.0,
        }
    },
    "docs/how_to/score.md: a square of 3 pixels, from a ratio of 3 on, 8 measurements of 95 %, within 1 %, 3 times": {
        "studies.score.information": {"OBJECT_PX": 3.0},
        "studies.score.over_light": {"LEAST_RATIO": 3.0},
        "studies.score.figure": {"REPEATS": 8, "CONFIDENCE": 0.95},
        "studies.score.score": {"NORMAL_95": 1.959964},
        "studies.score.developed_range": {"BEHIND": 0.99, "RISE": 3.0},
    },
    "Wang et al. 2004; Andersson et al. 2020; Zhang & Wandell 1997; CIE 15; Mantiuk & Azimi 2021": {
        "studies.metrics.ssim": {"SIGMA_PX": 1.5, "REACH_PX": 5, "C1": 0.0001, "C2": 0.0009},
        "studies.metrics.flip": {
            "CONTRAST": (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025))),
            "WIDEST": 0.04,
            "Q_COLOUR": 0.7,
            "P_COLOUR": 0.4,
            "P_KNEE": 0.95,
            "FEATURE_DEG": 0.082,
            "Q_FEATURE": 0.5,
            "_SLOPE": 6 / 29,
        },
        "studies.metrics.s_cielab": {
            "PIXELS_PER_DEGREE": 3840 / 0.7 * 0.7 * np.pi / 180,
            "XYZ_TO_OPPONENT": (
                (0.2787336, 0.7218031, -0.1065520),
                (-0.4487736, 0.2898056, 0.0771569),
                (0.0859513, -0.5899859, 0.5011089),
            ),
            "SPREADS": (
                ((0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)),
                ((0.531, 0.0392), (0.330, 0.494)),
                ((0.488, 0.0536), (0.371, 0.386)),
            ),
        },
        "studies.metrics.appearance": {
            "LEAST_CD_M2": 0.005,
            "MOST_CD_M2": 10_000.0,
            "PEAK": 256.0,
            "_P": (0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627, 0.09150303166, 0.9099517204, 596.3148142),
        },
        "studies.design.expect": {"_LAB_LINEAR": (6 / 29) ** 3},
    },
    "the paper: wells, times and levels of its figures": {
        "studies.paper.claims": {"ABOUT": 0.2},
        "studies.paper.figure2": {"CLAIMED": {"R": 10.0, "G": 6.0, "B": 10.0}, "SNR_EXPOSURE_S": 0.020, "BRIGHT": 0.9},
        "studies.paper.early": {"EXPOSURE_S": 0.020},
        "studies.paper.patches": {"EXPOSURE_S": 0.020, "REACH": 10, "SIGMA_D": 3.0, "SIGMA_S": 60.0},
        "studies.paper.pixel_size": {"LUMINANCE_CD_M2": 100.0, "EXPOSURE_S": 0.010, "LARGE_UM": 6, "SMALL_UM": 2},
        "studies.paper.white_beside_bayer": {
            "LUMINANCE_CD_M2": 25.0,
            "SUBSTITUTED": {"5ms": True, "10ms": False, "20ms": False},
        },
        "studies.paper.white_in_low_light": {"LOW_CD_M2": 2.5, "LOW_S": 0.020},
        "studies.paper.numbers": {"FULL_SUN_LUX": 1e5, "NIGHT_SKY_LUX": 0.002},
    },
    "docs/studies.md and docs/budget.md: 3 % in 95 % of the pixels; what a person sees": {
        "studies.study.render_noise": {"MOST_SHARE": 0.03, "OF_PIXELS": 0.95, "SPECKLE": 5.0, "MARGIN": 1.05},
        "studies.pages.headline": {
            "CLEARLY": 2.0,
            "SAME_TIME": 1.01,
            "_SHARES": {1 / 2: "half", 1 / 3: "a third", 1 / 4: "a quarter"},
        },
        "studies.metrics.blemishes": {"SPOT": 20.0, "LIGHT": 0.5, "HOLE": 0.2, "EVEN": 1.0, "DOT": 5.0},
    },
    "Timmer et al. 1998 and the hand's 4 Hz, which is damped by half": {
        "sensor.shake": {"RESONANCE_HZ": 4.0, "DAMPING": 0.5, "FOCAL_LENGTH_MM": 6.0}
    },
    "docs/how_to/dataset.md: four fifths for training; a mistake is told from 3 dB on": {
        "studies.dataset.shards": {"SPLITS": {"train": 0.8, "validation": 0.9, "test": 1.0}},
        "studies.dataset.judge": {"_NEARER_DB": 3.0, "_OVERSHOOT": 0.01},
    },
    "docs of the sensor: a reading counts 6 deviations under its well": {
        "sensor.readings.best_estimate": {"CLEAR_SIGMAS": 6.0}
    },
}


@pytest.mark.parametrize("source", STATED)
def test_numbers_are_those_of_their_source(source: str) -> None:
    for module, numbers in STATED[source].items():
        held = import_module(module)
        for name, stated in numbers.items():
            found = getattr(held, name)
            if isinstance(stated, str | bool | dict) or name in ("CONTRAST", "SPREADS", "SNR1S"):
                assert found == stated, (module, name)
            else:
                assert np.asarray(found) == pytest.approx(np.asarray(stated), rel=1e-12), (module, name)


THRESHOLDS = {
    "psnr_db": 0.5,
    "ssim": 0.02,
    "delta_e_median": 1.0,
    "delta_e_p95": 1.0,
    "s_cielab_median": 1.0,
    "s_cielab_p95": 1.0,
    "flip_mean": 0.02,
    "pu21_psnr_db": 0.5,
    "mtf50_cy_per_px": 0.02,
    "chart_delta_e_mean": 1.0,
    "patch_snr_db": 0.5,
}


def test_what_a_person_sees_and_which_way_is_better_is_as_decided() -> None:
    """Errors of colour and FLIP are better where they are small, all other figures where they are large."""
    metrics = {metric.key: metric for metric in import_module("studies.metrics.metric").METRICS}
    assert {key: metric.threshold for key, metric in metrics.items()} == THRESHOLDS
    lower = {key for key in metrics if "delta_e" in key or "cielab" in key or "flip" in key}
    assert {key for key, metric in metrics.items() if not metric.higher} == lower
