"""The interleaved reconstruction of Parmar & Wandell (2009), section 3.1: every channel at every pixel.

    f_i(x) = (1 / W_y) sum_{y in Omega} G(beta_d, sigma_d) G(beta_s, sigma_s) S_i(y) g_i(y)      eqs. (1), (3)

What the paper leaves open is settled so:

- Patches h_i are compared in units of noise: Anscombe-transformed and filled by normalised convolution
  (`isp.planes`), extended beyond the border by reflection without repeating the edge.
- The squared distance that noise alone makes is subtracted (`isp.similarity.noise_distance`), clamped at 0.
- Omega ends at the border, where W_y normalises. Samples are averaged in electrons.
- The largest weight counts as 1, so W_y is never 0: where all others underflow, the most similar sample is the result.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.kernel import PACKET, Frame, Grid, Lanes, reconstruct_lanes, samples_size
from isp.planes import Plane, planes
from isp.reference import reference_with_noise
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S, Reconstruction, Settings
from isp.similarity import saturated_fraction
from isp.tiles import Offsets, Work, list_offsets, make_grid, sort_work
from render.jit import arrays, backend, dr
from sensor.cfa import channels
from sensor.raw import RawImage

ALIGNMENT = 64  # bytes; Dr.Jit compiles another kernel for memory that isn't aligned, and refuses it packet loads


def reconstruct(
    raw: RawImage,
    *,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
) -> NDArray[np.float32]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        One exposure; any tile of letters.
    neighbourhood, patch : int
        Odd widths of Omega and of the patches h_i [pixels]. The time grows with the square of the first.
    sigma_d : float
        Standard deviation of the spatial weight, eq. (4) [pixels]; 0.001 to inf.
    sigma_s : float
        Standard deviation of the similarity weight, eq. (5) [standard deviations of one pixel's noise]; 0.001 to inf.

    Returns
    -------
    (h, w, channel) float32
        f_i(x) of eq. (1) [e-], channels in the order of `sensor.cfa.channels`.

    Raises
    ------
    InputError
        Where a parameter is outside its range, or Omega may miss a letter of the tile.

    Notes
    -----
    Takes some 250 bytes a pixel of RGBW while it runs, most of it the planes in packets (`isp.kernel`). Other sizes,
    sigmas and neighbourhoods run the kernels compiled already; another patch or size of tile compiles its own.
    """
    return reconstruct_with_noise(
        raw, neighbourhood=neighbourhood, patch=patch, sigma_d=sigma_d, sigma_s=sigma_s
    ).estimate.astype(np.float32, copy=False)


def reconstruct_with_noise(
    raw: RawImage,
    *,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
) -> Reconstruction:
    """As `reconstruct`, with the factor by which the weights reduce white noise, and the engine that ran."""
    settings = Settings(neighbourhood, patch, sigma_d, sigma_s)
    settings.check_reaches(raw.cfa)
    engine = backend()
    if engine == "numpy":
        return reference_with_noise(raw, settings)
    alpha, grid = saturated_fraction(raw, patch), make_grid(raw.cfa, patch)
    offsets = list_offsets(raw.cfa, settings)
    frame = _load(raw, alpha, offsets, settings, grid)
    shape = (*raw.shape, len(channels(raw.cfa)))
    results = [dr.zeros(arrays().Float, int(np.prod(shape))) for _ in range(2)]
    for work in sort_work(alpha, raw.cfa, grid, settings.reach):
        if len(work.row):
            _run(frame, offsets, work, grid, results)
    estimate, noise_gain = (np.array(result).reshape(shape) for result in results)
    return Reconstruction(estimate, noise_gain, engine)


def _load(raw: RawImage, alpha: Plane, offsets: Offsets, settings: Settings, grid: Grid) -> Frame:
    """Pad and pack what the lanes read."""
    jit, before = arrays(), settings.reach + settings.patch // 2
    # A lane at the lower right corner reaches beyond the frame, by its own size and to the end of its last packet.
    margins = [(before, before + grid.height), (before, before + grid.width + PACKET)]
    h = np.pad(planes(raw).astype(np.float32), [(0, 0), *margins], mode="reflect")
    rows, pitch = h.shape[1:]
    columns = [np.pad(raw.electrons, margins), np.pad(alpha, margins)]
    samples = np.zeros((rows, pitch, samples_size(grid)), dtype=np.float32)
    for c in range(grid.columns):
        for i, values in enumerate(columns):
            shift = c * grid.step[1]
            samples[:, : pitch - shift, i * grid.columns + c] = values[:, shift:]
    return Frame(
        h=_packets(h),
        samples=_upload(samples, jit.Float),
        entries=_upload(offsets.entries, jit.Float),
        height=dr.opaque(jit.UInt, raw.shape[0]),
        width=dr.opaque(jit.UInt, raw.shape[1]),
        rows=dr.opaque(jit.UInt, rows),
        pitch=dr.opaque(jit.UInt, pitch),
        reach=dr.opaque(jit.UInt, settings.reach),
        channels=dr.opaque(jit.UInt, len(h)),
        length=dr.opaque(jit.UInt, offsets.entries.shape[1]),
        decay=dr.opaque(jit.Float, float(np.log2(np.e)) / (2.0 * settings.sigma_s**2)),
    )


def _packets(h: NDArray[np.float32]) -> Any:
    """Each value together with those that follow it, `PACKET` in all."""
    jit = arrays()
    source = _upload(np.append(h.ravel(), np.zeros(PACKET, np.float32)), jit.Float)
    index = dr.arange(jit.UInt, h.size * PACKET)
    packets = dr.gather(jit.Float, source, index // PACKET + index % PACKET)
    dr.eval(packets)
    return packets


def _upload(values: NDArray[Any], kind: Any) -> Any:
    """Copy to an evaluated, aligned Dr.Jit array."""
    memory = np.empty(values.nbytes + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    aligned = memory[start : start + values.nbytes].view(values.dtype)
    aligned[:] = values.ravel()
    return kind(aligned)


def _run(frame: Frame, offsets: Offsets, work: Work, grid: Grid, results: list[Any]) -> None:
    """Reconstruct one group of lanes and put its pixels in their place."""
    jit = arrays()
    row, column, channel, number, count = (
        _upload(values, jit.UInt)
        for values in (work.row, work.column, work.channel, work.list, offsets.counts[work.list])
    )
    corner = (row + frame.reach) * frame.pitch + column + frame.reach
    lanes = Lanes(row, column, corner, number, count, tuple(_upload(plane, jit.UInt) for plane in work.planes))
    pixels = reconstruct_lanes(frame, lanes, grid)
    dr.eval(pixels)  # a scatter straight from the loop would repeat the loop for each array
    for i, values in enumerate(pixels):
        y, x = row + (i // grid.columns) * grid.step[0], column + (i % grid.columns) * grid.step[1]
        place = (y * frame.width + x) * frame.channels + channel
        for result, value in zip(results, values, strict=True):
            dr.scatter(result, value, place, (y < frame.height) & (x < frame.width))
    dr.eval(results)
