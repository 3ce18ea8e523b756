"""Light that W doesn't see: a lamp of one pixel, or of one row of pixels, on sites of the colours alone.

W guides the similarity. Light that reaches no W site has dark W all around, which looks like dark W elsewhere: it would
spread over a block, in the colours that saw it. Yet a clear pixel collects whatever a colour does. So a sample far over
all W around it tells of its own pixel alone, and of no colour (docs/decisions/0051-unseen-light.md).
"""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import tent, tent_radius
from render.spectrum import Floats
from sensor.cfa import mask
from sensor.raw import RawImage

SIGMAS = 4.0  # of the sample, over what W allows
TIMES_NEUTRAL = 5.0  # a colour's share of W over a neutral's: behind a clear W never so much
MOST_SHARE = 1.0  # of what a clear W collects, which a colour never exceeds whatever the light
TIMES_LEAST = 2.0  # of its channel around, over which a sample is alone


def without_unseen(raw: RawImage, neutral: Floats) -> tuple[RawImage, NDArray[np.bool_]]:
    """Take out samples that no W around can explain.

    With n the channels' response to a neutral, k S + s^2 a sample's noise, M the largest sample of W as far as its tent
    reaches, and L the least of the eight of its own channel a tile away, a sample S is taken out where

        S > max(M, 5 M n / n_W, 2 L) + 4 sqrt(k S + s^2),

    and M n / n_W stands in its place. The bound 2 L keeps this to isolated samples: wider light reaches some W, but
    where crosstalk is strong, and W proves nothing.

    Parameters
    ----------
    raw : RawImage
        Mosaic with W.
    neutral : (channel,) float64
        In the order of `sensor.cfa.channels`.

    Returns
    -------
    raw : RawImage
        The same one where nothing is taken out.
    unseen : (h, w) bool
        Pixels whose sample is.
    """
    names, size = raw.channels, (len(raw.cfa), len(raw.cfa[0]))
    shares = neutral / neutral[names.index("W")]
    unseen, filled, reach = np.zeros(raw.shape, np.bool_), raw.dn, tent_radius(raw.cfa, "W")
    # Beyond the border, where a pixel's only W may lie, the samples a tile further in.
    rows, columns = (np.arange(-reach, length + reach) for length in raw.shape)
    for line, length, step in zip((rows, columns), raw.shape, size, strict=True):
        line[:reach] += step
        line[length + reach :] -= step
    padded = raw.dn[rows[:, None], columns]
    for phase in np.ndindex(size):
        channel = raw.cfa[phase[0]][phase[1]]
        if channel == "W":
            continue
        noise = raw.noise_of(channel)
        # Where W is 0: S = 4 sqrt(k S + s^2), solved for S; k is 1 but for a channel that is read apart.
        first_e = noise.shot * SIGMAS**2 + SIGMAS * np.sqrt((noise.shot * SIGMAS) ** 2 + 4.0 * noise.dark_noise_e**2)
        first_dn = raw.black_dn + first_e / 2.0 / raw.gain_e_per_dn
        at = slice(phase[0], None, size[0]), slice(phase[1], None, size[1])
        samples, white = raw.dn[at], _brightest_white(padded, raw, phase, reach)
        sites = np.nonzero((samples > first_dn) & (samples > white))  # mostly few
        light_e, white_e, least_e = (  # an integer under black would wrap around
            np.maximum(values - float(raw.black_dn), 0.0) * raw.gain_e_per_dn
            for values in (samples[sites], white[sites], _least_around(samples, sites))
        )
        share = float(shares[names.index(channel)])
        most_e = np.maximum(max(MOST_SHARE, TIMES_NEUTRAL * share) * white_e, TIMES_LEAST * least_e)
        over = light_e > most_e + SIGMAS * np.sqrt(noise.shot * light_e + noise.dark_noise_e**2)
        if over.any():
            filled, places = filled.copy() if filled is raw.dn else filled, tuple(index[over] for index in sites)
            explained = share * white_e[over] / raw.gain_e_per_dn + raw.black_dn
            filled[at][places] = explained if filled.dtype.kind == "f" else np.rint(explained)
            unseen[at][places] = True
    return raw if filled is raw.dn else replace(raw, dn=filled), unseen


def _brightest_white(padded: NDArray[Any], raw: RawImage, phase: tuple[int, ...], reach: int) -> NDArray[Any]:
    """Largest sample of W up to `reach` pixels away along either axis, for the pixels at a phase."""
    (down, across), parts = (len(raw.cfa), len(raw.cfa[0])), []
    for row, column in product(range(phase[0], phase[0] + 2 * reach + 1), range(phase[1], phase[1] + 2 * reach + 1)):
        if raw.cfa[(row - reach) % down][(column - reach) % across] == "W":
            last = raw.shape[0] + row - phase[0], raw.shape[1] + column - phase[1]
            parts.append(padded[row : last[0] : down, column : last[1] : across])
    return np.asarray(np.maximum.reduce(parts))


def _least_around(samples: NDArray[Any], places: tuple[NDArray[np.intp], ...]) -> NDArray[Any]:
    """Least of the eight samples around each place among those of a phase, mirrored at the border."""
    rows, columns = (np.pad(np.arange(length), 1, mode="reflect") for length in samples.shape)
    steps = [
        step for step in product(range(3), repeat=2) if step != (1, 1)
    ]  # of the padded rows: -1, 0 and 1 from the place
    return np.asarray(np.minimum.reduce([samples[rows[places[0] + i], columns[places[1] + j]] for i, j in steps]))


def draw_unseen(raw: RawImage, unseen: NDArray[np.bool_], gains: Floats, balanced: NDArray[np.float64]) -> None:
    """Draw, in place, what `without_unseen` took out of `raw`: at its own pixels, neutral, up to the full well.

    The level is the mean, weighted by a tent, of the balanced samples that were taken out there and beside: each colour
    saw a part. A pixel between two that were taken out is drawn too: a line goes on through a colour that sees little.

    Parameters
    ----------
    raw : RawImage
        With these samples.
    gains : (channel,) float64
        White balance.
    balanced : (h, w, channel) float64
    """
    if not unseen.any():
        return
    names, row, column = raw.channels, *np.nonzero(unseen)
    cells = np.array([[names.index(name) for name in line] for line in raw.cfa])
    gain = raw.gain_e_per_dn * gains[cells[row % len(cells), column % len(cells[0])]]
    height, width = raw.shape
    light, count = np.zeros((2, height + 2, width + 2))  # one pixel of border
    light[row + 1, column + 1], count[row + 1, column + 1] = gain * (raw.dn[row, column] - raw.black_dn), 1.0
    mended = unseen.copy()
    mended[1:-1] |= unseen[:-2] & unseen[2:]
    mended[:, 1:-1] |= unseen[:, :-2] & unseen[:, 2:]
    mended &= ~mask(raw.cfa, "W", raw.shape)
    row, column = np.nonzero(mended)
    sums = np.zeros((2, row.size))
    for (i, j), weight in np.ndenumerate(np.outer(tent(1), tent(1))):
        sums += weight * np.stack([light[row + i, column + j], count[row + i, column + j]])
    balanced[row, column] = np.minimum(sums[0] / sums[1], raw.full_well_e)[:, None]
