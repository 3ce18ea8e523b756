"""Lists of offsets and lanes: each pair (x, y) once, and every phase of a mosaic alike to the kernel."""

import math

import numpy as np
import pytest

from isp.lane_shape import HEAD, packet_rows
from isp.settings import Settings
from isp.similarity import noise_distance, saturated_fraction
from isp.tiles import first_offset, lane_size, list_offsets, number_tile, sort_tiles
from sensor.cfa import BAYER, RGBW
from sensor.raw import RawImage

RGBW_4X4 = ("RWGW", "WBWG", "GWBW", "WGWR")
TILES = [RGBW, ("WB", "GR"), BAYER, ("GB", "RG"), RGBW_4X4, ("RGBW",), ("R", "W"), ("RGB", "WWR", "GBW"), ("W",)]


@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4])
def test_every_phase_of_a_mosaic_is_one_pattern(tile):
    grid = np.array([list(row) for row in tile])
    patterns = set()
    for shift in np.ndindex(*grid.shape):
        phase = tuple("".join(row) for row in np.roll(grid, shift, (0, 1)))
        pattern = number_tile(phase)
        patterns.add((pattern.cells, pattern.white))
        for i, j in np.ndindex(*grid.shape):
            letter = phase[(pattern.start[0] + i) % len(phase)][(pattern.start[1] + j) % len(phase[0])]
            assert pattern.letters[pattern.cells[i][j]] == letter
    assert len(patterns) == 1


def unpacked(tile, settings, groups=50):
    """Offsets of each class as whole numbers: steps between groups, rows and columns; and the other values."""
    entries, counts = list_offsets(tile, number_tile(tile), settings, groups)
    return [(table[:n, : HEAD - 1].copy().view(np.int32), table[:n]) for table, n in zip(entries, counts, strict=True)]


@pytest.mark.parametrize("tile", TILES)
def test_classes_share_out_omega_and_lead_to_their_cell(tile):
    settings, pattern = Settings(9, 3, 2.0, 8.0), number_tile(tile)
    offsets = []
    for number, (steps, table) in enumerate(unpacked(tile, settings)):
        shift = divmod(number, len(tile[0]))
        # From the first pixel of a lane to the pattern's first cell.
        assert ((steps[:, 1] - shift[0] - pattern.start[0]) % len(tile) == 0).all()
        assert ((steps[:, 2] - shift[1] - pattern.start[1]) % len(tile[0]) == 0).all()
        first = first_offset(pattern, *shift)
        rows = (steps[:, 1] - first[0]) // packet_rows(pattern.cells)
        assert np.array_equal(steps[:, 0], rows * 50 + (steps[:, 2] - first[1]) // len(tile[0]))
        expected = -math.log2(math.e) * (steps[:, 1:] ** 2).sum(1) / (2 * 2.0**2)
        assert table[:, HEAD - 1] == pytest.approx(expected, rel=1e-6)
        offsets += [tuple(step) for step in steps[:, 1:].tolist()]
    assert sorted(offsets) == [(r, c) for r in range(-4, 5) for c in range(-4, 5)]


@pytest.mark.parametrize("tile", [("GR", "WB"), BAYER, RGBW_4X4])
def test_noise_distances_are_those_of_the_phase_of_x_and_the_letter_of_y(tile):
    settings, pattern = Settings(9, 3, 2.0, 8.0), number_tile(tile)
    down, across = pattern.size
    for number, (steps, table) in enumerate(unpacked(tile, settings)):
        shift = divmod(number, across)
        for cell in np.ndindex(down, across):
            phase = (cell[0] - shift[0]) % down, (cell[1] - shift[1]) % across
            for part, letter in enumerate(("W", pattern.letters[pattern.cells[cell[0]][cell[1]]])):
                if letter in pattern.letters:
                    at = noise_distance(tile, letter, 3, 4)[phase][steps[:, 1] + 4, steps[:, 2] + 4]
                    got = table[:, HEAD + part * down * across + cell[0] * across + cell[1]]
                    assert got == pytest.approx(at, rel=1e-6)


@pytest.mark.parametrize("tile", TILES)
@pytest.mark.parametrize("rows", [(0, 37), (24, 48)])
def test_lanes_meet_each_pixel_once_in_every_class(tile, rows):
    pattern, shape, reach = number_tile(tile), (49, 45), 4
    rows = tuple(row // (8 * len(tile)) * 8 * len(tile) if k == 0 else row for k, row in enumerate(rows))
    dn = np.random.default_rng(2).integers(100, 3000, shape).astype(np.uint16)
    dn[10:22, 15:32] = 4000
    raw = RawImage(dn, tile, 100.0, 4000.0, 1.0, 2.0, 0.0, 0.0, 0.01)
    alpha = saturated_fraction(raw, 3) if pattern.white is not None else None
    work = sort_tiles(shape, rows, alpha, 0, pattern, reach)
    visits, lines = np.zeros((*pattern.size, *shape), int), []
    for (judge, bordered), lanes in work.items():
        size = lane_size(pattern, judge)
        lines += lanes.line.tolist()
        for row, column, i, j in zip(lanes.row, lanes.column, lanes.shift_row, lanes.shift_column, strict=True):
            box = slice(max(row, 0), row + size[0]), slice(max(column, 0), column + size[1])
            visits[i, j][box] += 1
            if not bordered:
                assert min(row, column) >= reach
                assert row + size[0] + reach <= shape[0]
                assert column + size[1] + reach <= shape[1]
            if alpha is not None:
                near = alpha[
                    max(row - reach, 0) : row + size[0] + reach, max(column - reach, 0) : column + size[1] + reach
                ]
                assert {"white": (near == 0.0).all(), "band": (near == 1.0).all(), "both": True}[judge]
    assert (visits[:, :, rows[0] : rows[1]] == 1).all()
    assert len(set(lines)) == len(lines)
