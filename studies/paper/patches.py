"""Figure 4 and section 3.1: the patches by which eq. (1) decides how similar two pixels are.

Figure 4: beside an edge, the patch around a pixel x is more similar to that around y, on the same side, than to that
around z, on the other side. Section 3.1: with patches of one pixel eq. (1) is the bilateral filter, with larger patches
it is non-local means. Both filters are written here from their own papers, to compare `isp.interleaved.reconstruction`
with them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from isp.anscombe import stabilise_raw
from isp.interleaved.reconstruction import reconstruct
from isp.planes import fill
from isp.settings import Settings
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from sensor.device import draw_device
from sensor.raw import RawImage
from sensor.readout import read_out
from studies.pages.plots import ORANGE, SIDE, STYLE, blank, show_picture
from studies.paper.claims import Claim, PaperFigure, judge_claim, paper_figure
from studies.paper.numbers import MOONLIGHT_CD_M2
from studies.paper.setup import READINGS, Camera, Setup, exposures, table1_sensor, view

PATCH = 5  # our choice, because the paper states none
ASIDE, AWAY = 4, 8  # pixels from the edge to x, and from x to y and z; even, because the tile has 2x2 pixels
CROP = 40  # side of the part of the picture that is shown [pixels]
EXPOSURE_S = 0.020
LEVELS = {"25 cd/m²": 25.0, "moonlight": MOONLIGHT_CD_M2}
# Section 3.1.
FRAME_SIDE, REACH = 32, 10  # side of the test frame, and reach of the neighbourhood of 21 x 21 [pixels]
SIGMA_D, SIGMA_S = 3.0, 60.0  # [pixels], [electrons]


@dataclass(frozen=True)
class Triplets:
    """Pixels x beside the edge with their pixels y and z, and the distances between their patches.

    Attributes
    ----------
    places : (n, 2) intp
        Row and column of each x; y is `AWAY` rows below it, and z is as many columns to its left, across the edge.
    to_y, to_z : (n,) float64
        Euclidean distance between patches of W around x and y, and x and z [standard deviations of a pixel's noise].
    """

    places: NDArray[np.intp]
    to_y: Image
    to_z: Image

    @property
    def share(self) -> float:
        """Return the share of the pixels x whose patch is nearer to that of y than to that of z."""
        return float((self.to_y < self.to_z).mean())


def edge_columns(truth: Image) -> NDArray[np.intp]:
    """Return for each row of luminance (h, w) the column of the edge, midway between dark and bright; shape (h,)."""
    middle = (truth.min() + truth.max()) / 2
    return np.asarray((truth < middle).sum(axis=1), dtype=np.intp)  # the dark half is on the left


def white_plane(raw: RawImage) -> Image:
    """Return W's plane h_W (h, w), interpolated, in units in which noise has the standard deviation 1 everywhere."""
    return np.asarray(fill(stabilise_raw(raw.electrons, raw), raw.cfa, "W"))


def triplets(raw: RawImage, columns: NDArray[np.intp]) -> Triplets:
    """Compare the patches of h_W around x, y and z beside the edge, in every row where all three fit.

    Parameters
    ----------
    columns : (h,) intp
        As from `edge_columns`.
    """
    plane = white_plane(raw)
    half = PATCH // 2
    rows = np.arange(half, plane.shape[0] - AWAY - half)
    places = np.stack([rows, columns[rows] + ASIDE], axis=-1)
    inside = (places[:, 1] - AWAY >= half) & (places[:, 1] < plane.shape[1] - half)
    places = places[inside]

    def patches(down: int, across: int) -> Image:
        windows = np.lib.stride_tricks.sliding_window_view(plane, (PATCH, PATCH))
        return np.asarray(windows[places[:, 0] + down - half, places[:, 1] + across - half])

    centre = patches(0, 0)
    along = patches(AWAY, 0)
    beyond = patches(0, -AWAY)
    distances = (np.sqrt(((centre - other) ** 2).sum(axis=(1, 2))) for other in (along, beyond))
    return Triplets(places, *distances)


def claims_4(shares: Mapping[str, float]) -> tuple[Claim, ...]:
    """Judge the statement of Figure 4; `shares` are those of the pixels beside the edge that confirm it."""
    return (judge_claim(16, shares, patch=PATCH, ms=EXPOSURE_S * 1e3, aside=ASIDE, away=AWAY),)


def figure_4(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the edge with three patches under both readings, and judge the claim at two levels."""
    shares = {}
    parts = []
    for name, level in LEVELS.items():
        subject = view(setup, "slanted_edge", level)
        columns = edge_columns(subject.radiance.luminance())
        for reading in READINGS:
            raw = exposures(Camera(reading), subject, "20ms")[0]
            edge = triplets(raw, columns)
            shares[f"{reading}, {name}"] = edge.share
            if name == next(iter(LEVELS)):
                parts.append((reading, white_plane(raw), edge))
    return paper_figure("4", _drawing(parts), level=next(iter(LEVELS))), claims_4(shares)


@rc_context(STYLE)
def _drawing(parts: list[tuple[str, Image, Triplets]]) -> Figure:
    """Draw for each reading W's plane around one x with three boxes, and beside it the boxes' patches, enlarged."""
    figure = blank(len(parts) * (SIDE + 150), SIDE + 28)
    for (reading, plane, edge), part in zip(parts, figure.subfigures(1, len(parts), squeeze=False)[0], strict=True):
        axes = part.subplot_mosaic([["plane", name, "."] for name in "xyz"], width_ratios=(10, 3, 5))
        middle = len(edge.places) // 2
        row, column = edge.places[middle].tolist()
        side = min(CROP, *plane.shape)
        top, left = (
            min(max(at - side // 2, 0), size - side) for at, size in zip((row, column), plane.shape, strict=True)
        )
        low, high = np.percentile(plane, [1, 99])
        grey = encode_srgb(np.repeat(np.clip((plane - low) / (high - low), 0.0, 1.0)[..., None] ** 2.2, 3, axis=-1))
        show_picture(axes["plane"], grey[top:, left:][:side, :side], reading)
        words = {"x": "x", "y": f"y, {edge.to_y[middle]:.1f} away", "z": f"z, {edge.to_z[middle]:.1f} away"}
        for name, down, across in (("x", 0, 0), ("y", AWAY, 0), ("z", 0, -AWAY)):
            i, j = row + down - PATCH // 2, column + across - PATCH // 2
            corner = j - left - 0.5, i - top - 0.5  # a pixel's middle has whole coordinates
            axes["plane"].add_patch(Rectangle(corner, PATCH, PATCH, fill=False, edgecolor=ORANGE, linewidth=1.6))
            axes["plane"].text(*corner, name, color=ORANGE, weight="bold", va="top")
            show_picture(axes[name], grey[i : i + PATCH, j : j + PATCH])
            distance = axes[name].text(1.1, 0.5, words[name], va="center", transform=axes[name].transAxes)
            distance.set_in_layout(False)  # the empty column has room for it
    return figure


def noisy_edge(reading: str) -> RawImage:
    """Expose a ramp with an edge on a sensor that has W at every pixel, with noise."""
    sensor = table1_sensor(reading, "mono")
    rng = np.random.default_rng(0)
    field = 500.0 + 60.0 * np.add.outer(np.arange(FRAME_SIDE), np.arange(FRAME_SIDE)) / FRAME_SIDE
    field[:, FRAME_SIDE // 2 :] += 800.0
    return read_out(field, sensor, draw_device(sensor, field.shape, rng), 0.01, rng)


def filtered(values: NDArray[np.float64], patch: int) -> NDArray[np.float64]:
    """Apply the bilateral filter (Tomasi & Manduchi 1998) for a patch of 1, or non-local means (Buades et al. 2005)."""
    half = patch // 2
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, half, mode="reflect"), (patch, patch))
    result = np.empty_like(values)
    for i, j in np.ndindex(*values.shape):
        rows, columns = (
            slice(max(at - REACH, 0), min(at + REACH + 1, size)) for at, size in zip((i, j), values.shape, strict=True)
        )
        y, x = np.mgrid[rows, columns]
        distance = ((windows[rows, columns] - windows[i, j]) ** 2).sum(axis=(2, 3))
        weight = np.exp(-((y - i) ** 2 + (x - j) ** 2) / (2 * SIGMA_D**2) - distance / (2 * SIGMA_S**2))
        result[i, j] = (weight * values[rows, columns]).sum() / weight.sum()
    return result


def difference(reading: str, patch: int) -> float:
    """Return the largest relative difference in the frame between eq. (1) and `filtered` [parts per million]."""
    raw = noisy_edge(reading)
    settings = Settings(neighbourhood=2 * REACH + 1, patch=patch, sigma_d=SIGMA_D, sigma_s=SIGMA_S, distance="raw")
    ours = reconstruct(raw, settings)[..., 0]
    theirs = filtered(raw.electrons, patch)
    return float((np.abs(ours - theirs) / np.abs(theirs)).max() * 1e6)


def filter_claims(differences: Mapping[int, Mapping[str, float]]) -> tuple[Claim, ...]:
    """Judge the two claims that eq. (1) contains the two filters, by the largest differences from them [ppm].

    The differences are given by patch and by reading of Table 1.
    """
    return tuple(
        judge_claim(number, {f"{x}, {patch} × {patch}": values[x] for x in values}, side=FRAME_SIDE)
        for number, (patch, values) in enumerate(differences.items(), 34)
    )


def section_3_1() -> tuple[Claim, ...]:
    """Compute the differences from both filters, and judge both claims by them."""
    return filter_claims({patch: {name: difference(name, patch) for name in READINGS} for patch in (1, 5)})
