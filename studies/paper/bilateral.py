"""Section 3.1: with patches of one pixel eq. (1) is the bilateral filter, with larger ones non-local means.

Written down here once more, straight from the two filters' own papers, to compare with `isp.interleaved`.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from isp.interleaved import reconstruct
from isp.settings import Settings
from sensor.device import draw_device
from sensor.raw import RawImage
from sensor.readout import read_out
from studies.paper.claims import Claim, at_most
from studies.paper.setup import sensor_of

SIDE, REACH = 32, 10  # of the test frame, and the neighbourhood's, 21 x 21 [pixels]
SIGMA_D, SIGMA_S = 3.0, 60.0  # [pixels], [electrons]
SAME_PPM = 1000.0  # relative difference of two computations of which one is in single precision


def noisy_edge(reading: str) -> RawImage:
    """A ramp with an edge on a sensor of W alone, so that every pixel is a sample, with noise."""
    sensor = sensor_of(reading, "mono")
    rng = np.random.default_rng(0)
    field = 500.0 + 60.0 * np.add.outer(np.arange(SIDE), np.arange(SIDE)) / SIDE
    field[:, SIDE // 2 :] += 800.0
    return read_out(field, sensor, draw_device(sensor, field.shape, rng), 0.01, rng)


def filtered(values: NDArray[np.float64], patch: int) -> NDArray[np.float64]:
    """Bilateral filter (Tomasi & Manduchi 1998) for a patch of 1, non-local means (Buades et al. 2005) for more."""
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
    """Largest relative difference of eq. (1) and the filter, over the frame [parts per million]."""
    raw = noisy_edge(reading)
    settings = Settings(neighbourhood=2 * REACH + 1, patch=patch, sigma_d=SIGMA_D, sigma_s=SIGMA_S, distance="raw")
    ours = reconstruct(raw, settings)[..., 0]
    theirs = filtered(raw.electrons, patch)
    return float((np.abs(ours - theirs) / np.abs(theirs)).max() * 1e6)


def filter_claims(differences: Mapping[int, Mapping[str, float]]) -> tuple[Claim, ...]:
    """The two limits of eq. (1); largest differences [ppm] by patch and reading."""
    names = {1: "A patch of one pixel makes eq. (1) the bilateral filter", 5: "A larger one makes it non-local means"}
    return tuple(
        Claim(
            "Section 3.1",
            names[patch],
            tuple(at_most(f"{name}, {patch} × {patch}", value, SAME_PPM, "ppm") for name, value in found.items()),
            f"Largest difference on a noisy edge of {SIDE} × {SIDE} pixels of W alone, distances in electrons.",
        )
        for patch, found in differences.items()
    )


def bilateral_claims(readings: tuple[str, ...]) -> tuple[Claim, ...]:
    """Both claims, computed."""
    return filter_claims({patch: {name: difference(name, patch) for name in readings} for patch in (1, 5)})
