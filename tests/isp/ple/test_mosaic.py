"""What of a mosaic lies where: cells, patches, and the samples beyond the frame."""

import numpy as np

from isp.ple import mosaic
from isp.ple.prior import LETTERS, PATCH
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map
from sensor.raw import RawImage

TILES = [RGBW, BAYER, *(MOSAICS[name] for name in ("rgbw_4x4", "quad_bayer", "quad_rgbw", "mono"))]
TILES += [("RRGG", "GGBB"), ("RGGR", "GBBG", "GBBG", "RGGR"), ("WWWW", "WWWW", "WWWR", "WWGB")]
WHITE_E = np.array([0.5, 1.0, 0.45, 4.9])


def white(tile, shape) -> RawImage:
    """Frame of white at 1 electron of green, without noise."""
    electrons = WHITE_E[np.vectorize(LETTERS.index)(channel_map(tile, shape))]
    return RawImage(electrons, tile, 0.0, 1e4, 1.0, 1.5, 0.0, 0.0, 0.01)


def test_each_patch_of_pixels_has_the_sampling_of_its_phase():
    for tile in TILES:
        numbers = np.vectorize(LETTERS.index)(channel_map(tile, (20, 20)))
        raw = white(tile, (20, 20))
        scale = mosaic.scale_of_pixels(raw, WHITE_E, raw.electrons.astype(np.float32), np.zeros(raw.shape, bool))
        wide, _ = mosaic.continued(tile, numbers, numbers)
        for i, j in np.ndindex(10, 10):
            patch = wide[2 * i : 2 * i + PATCH, 2 * j : 2 * j + PATCH]
            rows = np.array(scale.samplings[i % len(scale.samplings)][j % len(scale.samplings[0])].rows)
            assert np.array_equal(rows // 4, np.arange(PATCH**2)), tile
            assert np.array_equal(rows % 4, patch.ravel()), tile
        assert len({sampling for row in scale.samplings for sampling in row}) <= 4, tile


def test_a_full_w_is_a_bound_beside_g_alone():
    for tile, some in [(RGBW, True), (("GW",), True), (("W",), False), (("RW",), False)]:
        raw = RawImage(np.full((8, 8), 500.0), tile, 0.0, 400.0, 1.0, 1.5, 0.0, 0.0, 0.01)
        assert mosaic.full_white(raw).any() == some, (tile, some)
