"""Lists of offsets and threads: each pair (x, y) is met once, with the noise distance of its phase and channel."""

import math

import numpy as np
import pytest
from builders import RGBW_4X4, raw_image

from isp.kernel.schedule import list_offsets, list_threads, make_pattern
from isp.settings import Settings
from isp.similarity.guide import saturated_fraction
from isp.similarity.noise_distance import noise_distances
from sensor.cfa import BAYER, RGBW

TILES = [RGBW, ("WB", "GR"), BAYER, ("GB", "RG"), RGBW_4X4, ("RGBW",), ("R", "W"), ("RGB", "WWR", "GBW"), ("W",)]
SETTINGS = Settings(neighbourhood=9, patch=3, sigma_d=2.0, sigma_s=8.0)


@pytest.mark.parametrize("guide", ["W", "channel"])
@pytest.mark.parametrize("tile", TILES)
def test_lists_share_out_omega_and_lead_to_their_phase(tile, guide):
    pattern = make_pattern(tile)
    entries, counts = list_offsets(pattern, SETTINGS, guide)
    found, cells = {}, 1 if guide == "W" else len(pattern.cells)
    for number, (table, count) in enumerate(zip(entries, counts, strict=True)):
        phase, cell = divmod(number, cells)
        rows, columns, log_spatial = table[:count, :3].T
        assert (rows % pattern.tile[0] == phase // pattern.tile[1]).all()
        assert (columns % pattern.tile[1] == phase % pattern.tile[1]).all()
        assert log_spatial == pytest.approx(-math.log2(math.e) * (rows**2 + columns**2) / (2 * 2.0**2), rel=1e-6)
        found.setdefault(cell, []).extend(zip(rows, columns, strict=True))
    for offsets in found.values():
        assert sorted(offsets) == [(r, c) for r in range(-4, 5) for c in range(-4, 5)]


@pytest.mark.parametrize("guide", ["W", "channel"])
@pytest.mark.parametrize("tile", [("GR", "WB"), BAYER, RGBW_4X4])
def test_noise_distances_are_those_of_the_phase_of_x_and_the_channel_of_y(tile, guide):
    pattern, tables = make_pattern(tile), noise_distances(tile, 3, 4)
    entries, counts = list_offsets(pattern, SETTINGS, guide)
    for number, (table, count) in enumerate(zip(entries, counts, strict=True)):
        rows, columns = table[:count, :2].T.astype(int)
        for k, noise in enumerate(table[:count, 3:].T):
            cell = k if guide == "W" else number % len(pattern.cells)
            channel = pattern.white if guide == "W" or k == 1 else pattern.cells[cell]
            if channel is None:
                assert not noise.any()
                continue
            row, column = cell // pattern.tile[1] - rows, cell % pattern.tile[1] - columns  # x = y - d
            expected = tables[channel][row % pattern.tile[0], column % pattern.tile[1], rows + 4, columns + 4]
            assert noise == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("tile", TILES)
@pytest.mark.parametrize("rows", [(0, 37), (24, 48)])
def test_threads_meet_each_pixel_once_in_every_phase(tile, rows):
    pattern, shape, reach = make_pattern(tile), (49, 45), 4
    (down, across), block = pattern.tile, pattern.block
    rows = rows[0] // block[0] * block[0], rows[1]
    dn = np.random.default_rng(2).integers(100, 3000, shape).astype(np.uint16)
    dn[10:22, 15:32] = 4000
    raw = raw_image(dn, tile, white_dn=4000.0, read_noise_e=2.0, dsnu_e=0.0)
    alpha = saturated_fraction(raw, 3) if pattern.white is not None else None
    visits = np.zeros((down * across, *shape), int)
    for guide, threads in list_threads(pattern, shape, rows, alpha, 0, reach).items():
        for row, column, cell, plane, phase in zip(*vars(threads).values(), strict=True):
            step = (1, 1) if guide == "W" else pattern.tile
            # The block's first pixel, which the thread's own follows by its cell.
            top, left = row - cell // across, column - cell % across
            assert (top + phase // across) % block[0] == rows[0] % block[0]
            assert (left + phase % across) % block[1] == 0
            lines = [r for r in range(row, top + block[0], step[0]) if 0 <= r < shape[0]]
            columns = [c for c in range(column, left + block[1], step[1]) if 0 <= c < shape[1]]
            visits[phase][np.ix_(lines, columns)] += 1
            assert plane == pattern.cells[cell]
            if alpha is not None:
                near = alpha[
                    max(top - reach, 0) : top + block[0] + reach, max(left - reach, 0) : left + block[1] + reach
                ]
                white = plane == pattern.white
                assert {"W": (near == 0.0).all(), "channel": white or (near == 1.0).all(), "mixed": not white}[guide]
    assert (visits[:, rows[0] : rows[1]] == 1).all()
