"""Invariant of pictures: a raw image that is mirrored or cut, with its mosaic, develops into the same picture."""

from dataclasses import replace

import numpy as np
from hard.case import Margin, Situation, worse, worst_of
from hard.chain import CAMERAS, develop_fixed, shoot, to_picture

from isp.colour.white_balance import neutral_response
from isp.interleaved.kernel.edges import FAR
from isp.interleaved.numpy_form import sum_weights
from isp.interleaved.panchromatic import read_as_white
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S, Settings
from rodcone.types import Image
from sensor.cfa import Tile, channel_map
from sensor.raw import RawImage

# The kernel's own bound: 1e-4 of the samples' range, or some 16 roundings of the largest log weight
# (isp.interleaved.kernel.accumulate, isp.interleaved.kernel.kernel). Two developments differ by twice that.
KERNEL_ERROR = 1e-4
KERNEL_ROUNDINGS = 16 * 2.0**-24
DOUBLE_ROUNDINGS = 64 * 2.0**-53  # bilinear planes and their matrix, all in double precision
NOTHING_E = 1e-12
GUIDE = 24  # pixels that a pixel of the guide depends on


def equivariant(situation: Situation) -> Margin | None:
    """A raw image that is mirrored, or cut by its first tile, gives the same picture, mirrored or cut."""
    margins = []
    for name in CAMERAS:
        raw = shoot(situation, name)
        picture = develop_fixed(raw, situation)
        pairs = [
            (develop_fixed(mirrored(raw, axis), situation), np.flip(picture, axis), np.s_[:, :]) for axis in (0, 1)
        ]
        inside = _interior(raw, situation)
        if inside is not None:
            down, across = len(raw.cfa), len(raw.cfa[0])
            pairs.append((develop_fixed(cut(raw), situation), picture[down:, across:], inside))
        margins += [_margin(found[where] - same[where], raw, situation) for found, same, where in pairs]
    return worse(*margins)


def mirrored(raw: RawImage, axis: int) -> RawImage:
    """The frame mirrored along an axis, with its mosaic and its list of defects."""
    lines = raw.shape[axis]
    period = (len(raw.cfa), len(raw.cfa[0]))[axis]
    turned = _turn(raw.cfa, lines % period, axis)
    cfa = turned[::-1] if axis == 0 else tuple(row[::-1] for row in turned)
    defects = raw.defects
    if defects is not None:
        defects = defects.copy()
        defects[:, axis] = lines - 1 - defects[:, axis]
    return replace(raw, dn=np.ascontiguousarray(np.flip(raw.dn, axis)), cfa=cfa, defects=defects)


def cut(raw: RawImage) -> RawImage:
    """The frame without its first tile's rows and columns."""
    tile, defects = (len(raw.cfa), len(raw.cfa[0])), raw.defects
    if defects is not None:
        defects = defects[np.all(defects >= tile, axis=1)] - tile
    return replace(raw, dn=np.ascontiguousarray(raw.dn[tile[0] :, tile[1] :]), defects=defects)


def _turn(cfa: Tile, steps: int, axis: int) -> Tile:
    if axis == 0:
        return cfa[steps % len(cfa) :] + cfa[: steps % len(cfa)]
    return tuple(row[steps % len(row) :] + row[: steps % len(row)] for row in cfa)


def _interior(raw: RawImage, situation: Situation) -> tuple[slice, slice] | None:
    """Pixels of the cut frame that nothing at the border reaches; None where the frame has none."""
    develop = situation.develop
    reach = develop.get("neighbourhood", NEIGHBOURHOOD) // 2 + develop.get("patch", PATCH) // 2 + GUIDE
    margin = reach + FAR + 2 * len(raw.cfa)  # the surroundings of colours that noise hides, and mended pixels
    if min(raw.shape) - len(raw.cfa) <= 2 * margin:
        return None
    return np.s_[margin:-margin, margin:-margin]


def _margin(error: Image, raw: RawImage, situation: Situation) -> Margin:
    """Error over what the arithmetic may differ by; the slow reference runs only where the plain bound is passed."""
    if "W" not in raw.channels:
        return _beside(error, raw, situation, DOUBLE_ROUNDINGS * float(np.abs(raw.electrons).max()))
    settings = _settings(situation)
    samples = settings.neighbourhood**2 / np.size(channel_map(raw.cfa, (len(raw.cfa), len(raw.cfa[0]))))
    spread = float(np.ptp(raw.electrons))
    sums = 2 * samples * 2.0**-24 * float(np.abs(raw.electrons).max())  # roundings of the weights' sum and the values'
    plain = _beside(error, raw, situation, KERNEL_ERROR * spread + sums)
    if plain.kept:
        return plain
    white = read_as_white(raw, neutral_response(raw.channels))
    largest = float(-sum_weights(white.raw, settings, white.guide).largest.min())
    return _beside(error, raw, situation, np.clip(KERNEL_ROUNDINGS * largest, KERNEL_ERROR, 0.5) * spread + sums)


def _beside(error: Image, raw: RawImage, situation: Situation, channel_e: float) -> Margin:
    """Error of a picture over twice the error `channel_e` of its channels, through balance and matrix."""
    through = np.abs(to_picture(raw.cfa, situation.develop)).sum(axis=1)
    return worst_of(error, np.broadcast_to(2 * channel_e * through + NOTHING_E, error.shape), "e⁻")


def _settings(situation: Situation) -> Settings:
    defaults = {"neighbourhood": NEIGHBOURHOOD, "patch": PATCH, "sigma_d": SIGMA_D, "sigma_s": SIGMA_S}
    return Settings(**{name: situation.develop.get(name, value) for name, value in defaults.items()})
