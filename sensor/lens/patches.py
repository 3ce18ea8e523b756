"""Light behind a lens by data: it is moved by distortion and lateral colour, and spread by point images.

Point images are computed at a grid of places on the picture, as close as the table's rings or closer. Between four
places their images are blended by distance: each place has a window, a tent along each axis, and the windows of all
places sum to 1. The image at a place is that of its image height, turned by its azimuth. Beyond the border the picture
continues as its mirror image, spread as at the border. So an even wall stays even, because light that leaves the
picture is replaced by as much.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import atan2, ceil, cos, hypot, sin

import numpy as np
import scipy

from rodcone.types import Floats, Plane
from sensor.lens.table import BEYOND, LensTable, Wavefronts
from sensor.lens.wavefront import orders, reach_of, sampled_kernel

LEAST_STEPS = 8  # least steps of the grid from the middle to a corner; with 4 a blend's MTF is off by up to 0.02


@dataclass(frozen=True)
class Patch:
    """Place of the grid, and the part of the picture that its window covers.

    Attributes
    ----------
    height, azimuth : float
        Image height, 1 in the corners, and angle from the rows' direction towards the columns' [radians].
    rows, columns : slice
    window : array
        Weight of the place at each sample of the part.
    """

    height: float
    azimuth: float
    rows: slice
    columns: slice
    window: Floats


def patches(shape: tuple[int, int], rings: int, beyond: int = 0) -> tuple[Patch, ...]:
    """Return the places of a grid over a picture; the windows of all places sum to 1 at each sample.

    `beyond` samples at each side of the picture belong to the border's places; slices count from the first of them.
    """
    half = [(side - 1) / 2 for side in shape]
    found = []
    step = max(hypot(*shape) / 2 / max(rings - 1, LEAST_STEPS), 1.0)
    axes = [_windows(side, step, beyond) for side in shape]
    for row, rows, down in axes[0]:
        for column, columns, over in axes[1]:
            y, x = row - half[0], column - half[1]
            height = hypot(y, x) / (hypot(*half) or 1.0)
            found.append(Patch(height, atan2(x, y), rows, columns, down[:, None] * over))
    return tuple(found)


def _windows(side: int, step: float, beyond: int) -> list[tuple[float, slice, Floats]]:
    """Return the places along an axis (its middle and ends included), the samples that each covers, and its window."""
    places = max(ceil((side - 1) / 2 / step), 1)
    nodes = np.linspace(0, side - 1, 2 * places + 1) if side > 2 else np.arange(float(side))
    samples = np.clip(np.arange(-beyond, side + beyond), 0, side - 1)
    apart = nodes[1] - nodes[0] if side > 1 else 1.0
    found = []
    for node in nodes:
        window = np.maximum(1 - np.abs(samples - node) / apart, 0.0)
        covered = np.flatnonzero(window)
        part = slice(int(covered[0]), int(covered[-1]) + 1)
        found.append((float(node), part, window[part]))
    return found


def spreader(
    table: LensTable, shape: tuple[int, int], step_um: float, folded: bool, threads: int
) -> Callable[[Plane, float], Plane]:
    """Return a function of light and wavelength: the difference between the lens's point images and an ideal lens's.

    Its result is to be added to what an ideal lens makes of the same light (with diffraction if the table holds
    wavefronts); the sum is the light on the sensor. It doesn't depend on the number of threads.

    Parameters
    ----------
    table : LensTable
        With a point spread.
    shape : (int, int)
        Rows and columns of samples.
    step_um : float
        Distance between samples.
    folded : bool
        As in `sensor.diffraction.sampled_otf`.
    threads : int
    """
    reach = reach_of(table, table.wavelength_nm, step_um)
    laid = patches(shape, table.field.size, reach)

    # Opposite places have opposite images, and where a lens is round those beside an axis too.
    mirrored = isinstance(table.point_spread, Wavefronts) and all(orders(j)[1] >= 0 for j in table.point_spread.noll)
    own: dict[tuple[float, float], list[tuple[Patch, bool, bool]]] = {}
    for patch in laid:
        down, over = cos(patch.azimuth) < -1e-9, sin(patch.azimuth) < -1e-9
        if not mirrored:
            down = over = down or (over and abs(cos(patch.azimuth)) < 1e-9)
        azimuth = round(atan2(*[sin(patch.azimuth) * (1 - 2 * over), cos(patch.azimuth) * (1 - 2 * down)]), 9)
        own.setdefault((round(patch.height, 9), azimuth), []).append((patch, down, over))

    def of_place(place: tuple[float, float], light: Plane, nm: float) -> list[tuple[Patch, Floats]]:
        kernel = sampled_kernel(table, *place, nm, step_um, reach, folded)
        return [(patch, of_patch(patch, _turned(kernel, down, over), light)) for patch, down, over in own[place]]

    def of_patch(patch: Patch, kernel: Floats, light: Plane) -> Floats:
        part = light[patch.rows, patch.columns] * patch.window
        sides = [scipy.fft.next_fast_len(side + 2 * reach, real=True) for side in part.shape]
        spectrum = scipy.fft.rfft2(part, s=sides)
        spectrum *= scipy.fft.rfft2(np.fft.fftshift(kernel), s=sides)
        spread = scipy.fft.irfft2(spectrum, s=sides, overwrite_x=True)
        return np.asarray(spread[: part.shape[0] + 2 * reach, : part.shape[1] + 2 * reach])

    def spread(light: Plane, wavelength_nm: float) -> Plane:
        nm = float(np.clip(wavelength_nm, table.wavelength_nm[0], table.wavelength_nm[-1]))
        around = np.pad(light, reach, mode="symmetric")
        canvas = np.zeros([side + 4 * reach for side in shape])
        with ThreadPoolExecutor(threads) as pool:
            for places in pool.map(lambda place: of_place(place, around, nm), own):
                for patch, found in places:
                    top, left = patch.rows.start, patch.columns.start
                    canvas[top : top + found.shape[0], left : left + found.shape[1]] += found
        return canvas[2 * reach : 2 * reach + shape[0], 2 * reach : 2 * reach + shape[1]]

    return spread


def _turned(kernel: Floats, down: bool, over: bool) -> Floats:
    """Mirror a kernel, whose middle is its first sample, along its rows, its columns or both."""
    axes = tuple(axis for axis, mirrored in enumerate((down, over)) if mirrored)
    return np.roll(np.flip(kernel, axes), 1, axes) if axes else kernel


def mover(table: LensTable, shape: tuple[int, int], step_um: float) -> Callable[[Plane, float], Plane]:
    """Return a function of light and wavelength that moves light by distortion and lateral colour.

    Between samples the light is a cubic spline, cut off at 0 unless some of the light is negative. Beyond the border
    the picture continues as its mirror image.

    Parameters
    ----------
    table : LensTable
    shape : (int, int)
        Rows and columns of samples.
    step_um : float
        Distance between samples.
    """
    middle = [(side - 1) / 2 for side in shape]
    rows, columns = (np.arange(side) - half for side, half in zip(shape, middle, strict=True))
    half_diagonal = hypot(*shape) / 2
    heights = np.hypot(rows[:, None], columns) / half_diagonal
    ideal = np.linspace(0, BEYOND, 2001)

    def moved(light: Plane, wavelength_nm: float) -> Plane:
        landing = table.landing(ideal, wavelength_nm, half_diagonal * step_um)
        if np.array_equal(landing, ideal):
            return light
        landing = np.maximum.accumulate(landing)
        # For each sample, the image height that its light would have with an ideal lens, over the sample's own height.
        share = np.interp(heights, landing, ideal) / np.maximum(heights, 1e-12)
        share = np.where(heights < 1e-12, 0.0, share)
        at = [rows[:, None] * share + middle[0], columns * share + middle[1]]
        found = scipy.ndimage.map_coordinates(light, at, order=3, mode="reflect", output=np.float64)
        return np.asarray(found if light.min() < 0 else np.maximum(found, 0.0))

    return moved
