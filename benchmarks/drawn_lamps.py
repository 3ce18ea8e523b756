"""Lamps in the dark: `python benchmarks/drawn_lamps.py SEED [PROCESSOR]`, `interleaved` if none is named.

Four colours, seven sizes, on each site of the tile, of 300 to 300 000 e- in G, sharp and with a halo. *Hue*: pixels of
a chroma over 20 in CIELAB, 40 degrees off the truth's and the lamp's own. *Large*: over a fifth of the lamp on more
than (h + 2) (w + 2) pixels, where the truth has h x w. *Holes*: a pixel of the lamp is under a fifth of its rim.
"""

import sys
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from skimage.color import rgb2lab

from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.cfa import BAYER, RGBW, mask
from sensor.raw import RawImage

NEUTRAL = np.array([0.5, 1.0, 0.5, 4.8])
COLOURS = np.array([NEUTRAL, [0.55, 1.0, 0.03, 3.0], [0.05, 0.3, 1.5, 2.0], [0.6, 1.0, 0.25, 4.6]])
SIZES = [(1, 1), (1, 3), (3, 1), (2, 2), (2, 5), (5, 2), (4, 4)]
# Lamp and field [e- in G], and what is shown as white, over the field.
LEVELS = [(300, 1, 6), (6000, 1, 6), (6e4, 1, 6), (6000, 20, 6), (6e4, 20, 6), (6e4, 20, 500), (3e5, 100, 140)]
MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
CALIBRATION = {"black_dn": 100.0, "white_dn": 15_100.0, "gain_e_per_dn": 1.0, "read_noise_e": 1.5, "dsnu_e": 0.0}


def faults(
    colour: NDArray[np.float64], size: tuple[int, int], level: tuple[float, ...], halo: bool, seed: int, name: str
) -> NDArray[np.int_]:
    """Of a lamp on each of four sites: lamps, pixels of another hue, large lamps, and lamps with a hole."""
    (lamp_e, field_e, white), rng = level, np.random.default_rng(seed)
    lamp, counts = np.zeros((96, 96)), np.zeros(4, int)
    places = [np.s_[r : r + size[0], c : c + size[1]] for r, c in product((24, 73), repeat=2)]
    for place in places:
        lamp[place] = 1.0
    lamp = 0.997 * gaussian_filter(lamp, 0.7) + 0.003 * gaussian_filter(lamp, 3.0) if halo else lamp
    cfa = BAYER if PROCESSORS[name].mosaic == "bayer" else RGBW
    sites = np.argmax([mask(cfa, channel, lamp.shape) for channel in "RGBW"], axis=0)
    read = rng.poisson(field_e * NEUTRAL[sites] + lamp_e * lamp * colour[sites]) + rng.normal(0.0, 1.5, lamp.shape)
    dn = np.rint(np.minimum(read, 15_000.0) + 100.0).astype(np.uint16)
    raw, own = RawImage(dn=dn, cfa=cfa, prnu=0.0, exposure_s=0.01, **CALIBRATION), MATRIX @ (colour / NEUTRAL)[:3]
    shown = PROCESSORS[name].develop(raw, MATRIX, balance=NEUTRAL[: len(raw.channels)]).rgb
    got, true = (np.clip(x / (white * field_e), 0.0, 1.0) for x in (shown, field_e + lamp_e * lamp[..., None] * own))
    lab, *others = (rgb2lab(encode_srgb(np.clip(rgb, 0.0, 1.0))) for rgb in (got, true, own[None, None] / own.max()))
    light, truth, hue = luminance_of_srgb(got), luminance_of_srgb(true), lab @ [0, 1, 1j]
    other = (np.abs(hue) > 20.0) & (lab[..., 0] > 25.0) & (light > 3.0 * np.median(light))
    for reference in (values @ [0, 1, 1j] for values in others):
        other &= (np.abs(reference) < 8.0) | (np.abs(np.angle(hue / reference, deg=True)) > 40.0)
    for rows, columns in places:
        around = np.s_[rows.start - 10 : rows.stop + 10, columns.start - 10 : columns.stop + 10]
        dark, brightest = np.median(light[around]), truth[around].max()
        lit, own_lit = (picture[around] > dark + 0.2 * (brightest - dark) for picture in (light, truth))
        box = [np.ptp(np.flatnonzero(own_lit.any(axis))) + 3 for axis in (0, 1)] if own_lit.any() else [2, 2]
        rim = light[rows.start - 1 : rows.stop + 1, columns.start - 1 : columns.stop + 1].copy()
        rim[1:-1, 1:-1] = 0.0
        large = brightest > 3.0 * dark and lit.sum() > np.prod(box)
        counts += [1, other[around].sum(), large, light[rows, columns].min() < 0.2 * rim.max()]
    return counts


if __name__ == "__main__":
    named = sys.argv[2] if len(sys.argv) > 2 else "interleaved"
    for halo in (False, True):
        total = sum(faults(*case, halo, int(sys.argv[1]), named) for case in product(COLOURS, SIZES, LEVELS))
        print("halo" if halo else "sharp", "lamps, hue, large, holes:", *total)
