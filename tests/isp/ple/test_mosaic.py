"""What of a mosaic lies where: cells, patches, and the samples beyond the frame."""

import numpy as np
import pytest

from isp.ple import mosaic
from isp.ple.estimate import border, padded
from isp.ple.prior import LETTERS, PATCH
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map, channels
from sensor.raw import RawImage

TILES = [RGBW, BAYER, *(MOSAICS[name] for name in ("rgbw_4x4", "quad_bayer", "quad_rgbw", "mono"))]
TILES += [("RRGG", "GGBB"), ("RGGR", "GBBG", "GBBG", "RGGR"), ("WWWW", "WWWW", "WWWR", "WWGB")]
WHITE_E = np.array([0.5, 1.0, 0.45, 4.9])


def white(tile, shape) -> RawImage:
    """Frame of white at 1 electron of green, without noise."""
    electrons = WHITE_E[np.vectorize(LETTERS.index)(channel_map(tile, shape))]
    return RawImage(electrons, tile, 0.0, 1e4, 1.0, 1.5, 0.0, 0.0, 0.01)


@pytest.mark.parametrize("shape", [(4, 4), (5, 7), (21, 18)])
@pytest.mark.parametrize("tile", TILES)
def test_beyond_the_frame_the_mosaic_goes_on(tile, shape):
    numbers = np.vectorize(LETTERS.index)(channel_map(tile, shape))
    values = np.arange(numbers.size).reshape(shape)
    wide_numbers, wide_values = mosaic.continued(tile, numbers, values)
    top, left = (border(length, PATCH)[0] for length in shape)
    asked = [
        [LETTERS.index(tile[(y - top) % len(tile)][(x - left) % len(tile[0])]) for x in range(wide_numbers.shape[1])]
        for y in range(wide_numbers.shape[0])
    ]
    assert np.array_equal(wide_numbers, asked)
    assert np.array_equal(numbers.ravel()[wide_values], wide_numbers)
    # none comes from further than a tile from where reflection takes it
    mirrored = padded(values, PATCH)
    for axis in (0, 1):
        moved = np.unravel_index(wide_values, shape)[axis] - np.unravel_index(mirrored, shape)[axis]
        assert np.abs(moved).max() < max(len(tile), len(tile[0]))


@pytest.mark.parametrize("tile", TILES)
def test_cells_sum_as_many_samples_as_their_sampling_says_and_patches_know_which(tile):
    raw = white(tile, (45, 42))
    levels = mosaic.pyramid(raw, WHITE_E, raw.electrons.astype(np.float32), np.zeros(raw.shape, bool))
    assert [cells.full.shape[0] for cells in levels] == [22, 11, 5]
    for number, cells in enumerate(levels):
        gains = np.array(cells.sampling.gains)[list(cells.index)]
        held = np.tile(cells.held, (22, 21, 1))[: cells.full.shape[0], : cells.full.shape[1]]
        assert cells.electrons == pytest.approx(held * gains, rel=1e-5)
        counts = np.array(cells.sampling.gains) / WHITE_E
        assert np.array(cells.sampling.dark_e) == pytest.approx(1.5 * np.sqrt(counts), rel=1e-5)  # both in six digits
        if number:
            sites = np.array(["".join(tile).count(name) for name in channels(tile)]) / len("".join(tile))
            assert gains / WHITE_E[list(cells.index)] == pytest.approx(4 ** (number + 1) * sites)
        # of the first patch, whose first row and column of the tile lie before the frame
        scale = mosaic.scale_of_cells(cells)
        patch = padded(np.where(held, np.array(cells.index), -1), 4)[:4, :4].ravel()
        patch = patch if scale.columns is None else patch[scale.columns]
        assert patch.tolist() == [row % 4 for row in cells.sampling.rows]


@pytest.mark.parametrize("tile", TILES)
def test_each_patch_of_pixels_has_the_sampling_of_its_phase(tile):
    numbers = np.vectorize(LETTERS.index)(channel_map(tile, (20, 20)))
    raw = white(tile, (20, 20))
    scale = mosaic.scale_of_pixels(raw, WHITE_E, raw.electrons.astype(np.float32), np.zeros(raw.shape, bool))
    wide, _ = mosaic.continued(tile, numbers, numbers)
    for i, j in np.ndindex(10, 10):
        patch = wide[2 * i : 2 * i + PATCH, 2 * j : 2 * j + PATCH]
        rows = np.array(scale.samplings[i % len(scale.samplings)][j % len(scale.samplings[0])].rows)
        assert np.array_equal(rows // 4, np.arange(PATCH**2))
        assert np.array_equal(rows % 4, patch.ravel())
    assert len({sampling for row in scale.samplings for sampling in row}) <= 4


@pytest.mark.parametrize(("tile", "some"), [(RGBW, True), (("GW",), True), (("W",), False), (("RW",), False)])
def test_a_full_w_is_a_bound_beside_g_alone(tile, some):
    raw = RawImage(np.full((8, 8), 500.0), tile, 0.0, 400.0, 1.0, 1.5, 0.0, 0.0, 0.01)
    assert mosaic.full_white(raw).any() == some
