"""Figure 5: at 200 cd/m^2, 66 ms and 3 um W is partly full, and the result is whole; early fusion loses there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.colour.highlights import saturated_nearby
from isp.planes import bilinear
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.cfa import channels, mask
from sensor.raw import RawImage
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, ClaimCheck, PaperFigure, at_least, beside
from studies.paper.setup import (
    CAMERAS,
    DEFAULT,
    PAPER,
    READINGS,
    Camera,
    Image,
    Setup,
    View,
    develop,
    exposures,
    quality_db,
    view,
)

LUMINANCE_CD_M2, PITCH_UM = 200.0, 3
PARTLY = (0.02, 0.98)  # share of W's pixels that may be full for "partly"
WHOLE = 0.95  # correlation with the truth where W is full, for "whole": nine tenths of the variance
# Early fusion: W enters before anything else (Sato 1983, Kijima 2007), or behind a neutral density (Yamagami 1994).
EARLY = ("rgbw_sato", "rgbw_kijima", "rgbw_yamagami")
GAIN_DB = 1.0  # a decibel is easily seen


@dataclass(frozen=True)
class Bright:
    """What Figure 5 measures under one reading.

    Attributes
    ----------
    white_full, colours_full : float
        Share of W's pixels that are full, and of the colours'.
    result_likeness, white_likeness : float
        Correlation of luminance with the truth where W is full and no colour is: of the result, and of W itself.
    full_likeness : float
        Of the result where a colour is full as well.
    """

    white_full: float
    colours_full: float
    result_likeness: float
    white_likeness: float
    full_likeness: float


def likeness(plane: Image, truth: Image, where: NDArray[np.bool_]) -> float:
    """Correlation of two planes (h, w) over some pixels; 0 where either is constant or there are none."""
    if where.sum() < 2 or np.ptp(plane[where]) == 0 or np.ptp(truth[where]) == 0:
        return 0.0
    return float(np.corrcoef(plane[where], truth[where])[0, 1])


def measure_bright(raw: RawImage, result: Image, seen: View) -> Bright:
    """Measure one exposure and its result (h, w, 3), linear sRGB."""
    truth = luminance_of_srgb(seen.truth)
    white, colours = saturated_nearby(raw, "W"), saturated_nearby(raw, "RGB")
    alone = white & ~colours
    luminance = luminance_of_srgb(result)
    own = bilinear(raw)[..., channels(raw.cfa).index("W")]
    is_white = mask(raw.cfa, "W", raw.shape)
    return Bright(
        float(raw.saturated[is_white].mean()),
        float(raw.saturated[~is_white].mean()),
        likeness(luminance, truth, alone),
        likeness(own, truth, alone),
        likeness(luminance, truth, white & colours),
    )


def claims_5(found: Mapping[str, Bright], gains_db: Mapping[str, float]) -> tuple[Claim, ...]:
    """W partly full, the result whole, early fusion worse.

    Parameters
    ----------
    found : mapping
        By reading.
    gains_db : mapping
        PSNR of the interleaved camera over each opponent's, by opponent and reading.
    """
    return (
        Claim(
            "Figure 5",
            "At 200 cd/m², 66 ms and 3 µm W is partly saturated",
            tuple(ClaimCheck(name, one.white_full, *PARTLY, "of its pixels") for name, one in found.items()),
            "still_life, f/2.8; the well in proportion to area.",
        ),
        Claim(
            "Figure 5",
            "The result is whole where W is saturated",
            (
                *(at_least(f"{name}, colours not full", one.result_likeness, WHOLE) for name, one in found.items()),
                *(at_least(f"{name}, a colour full too", one.full_likeness, WHOLE) for name, one in found.items()),
            ),
            "Correlation of the result's luminance with the truth's over those pixels. W's own is "
            + " and ".join(f"{one.white_likeness:.2f} ({name})" for name, one in found.items())
            + ". Of the colours' pixels "
            + " and ".join(f"{one.colours_full:.0%}" for one in found.values())
            + " are full too.",
        ),
        Claim(
            "Section 2",
            "Early fusion gives away the dynamic range between the two mosaics",
            tuple(at_least(name, gain, GAIN_DB, "dB") for name, gain in gains_db.items()),
            "PSNR of the interleaved camera over the opponent's, Figure 5's conditions.",
        ),
    )


def grey(plane: Image, white: float) -> Image:
    """Plane (h, w) as encoded grey (h, w, 3), `white` being 1: shown as a camera would, by sRGB's curve."""
    return encode_srgb(np.repeat(np.asarray(plane, dtype=np.float64)[..., None] / white, 3, axis=-1))


def figure_5(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """R image, W image and result under both readings, with the opponents' PSNR."""
    seen = view(setup, "still_life", LUMINANCE_CD_M2)
    found = {name: dict[str, Bright]() for name in CAMERAS}
    gains_db, rows = {name: dict[str, float]() for name in CAMERAS}, []
    for reading in READINGS:
        early_db = {name: quality_db(_shoot(setup, seen, reading, name)[1], seen.truth) for name in EARLY}
        shown = {}
        for camera in CAMERAS:
            raws, made = _shoot(setup, seen, reading, camera)
            found[camera][reading] = measure_bright(raws[0], made[0], seen)
            own_db = quality_db(made, seen.truth)
            gains_db[camera] |= {f"{name}, {reading}": own_db - other_db for name, other_db in early_db.items()}
            shown["result" if camera == PAPER else "by the default"] = encode_srgb(made[0])
        full_e = raws[0].full_well_e
        planes = bilinear(raws[0])
        rows.append(
            [
                (f"{reading}: R, white is full", grey(planes[..., 0], full_e)),
                ("W, white is full", grey(planes[..., 3], full_e)),
                *shown.items(),
            ]
        )
    caption = "R as recorded, W as recorded with much of it full, and the result, at 200 cd/m², 66 ms and 3 µm."
    return PaperFigure("5", caption, picture_rows(rows)), beside(
        *(claims_5(found[camera], gains_db[camera]) for camera in (PAPER, DEFAULT))
    )


def _shoot(setup: Setup, seen: View, reading: str, processor: str) -> tuple[list[RawImage], list[Image]]:
    """Exposures and pictures of one processor."""
    camera = Camera(reading, processor, PITCH_UM)
    raws = exposures(camera, seen, "66ms", setup.seeds)
    return raws, [develop(camera, raw, seen)[0] for raw in raws]
