"""Lists of offsets and lanes: each pair (x, y) once, and every phase of a mosaic alike to the kernel."""

import math

import numpy as np
import pytest

from isp.lane_shape import entry_length, noise_count, offsets_together, packet_rows
from isp.settings import Settings
from isp.similarity import noise_distance, saturated_fraction
from isp.tiles import first_offset, lane_size, list_offsets, number_tile, sort_tiles
from isp.weighted_sums import NO_OFFSET
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


def unpacked(tile, settings, *, dense, groups=50):
    """By list: steps between groups, then for each of the offsets together its log weight and noise distances."""
    pattern, count = number_tile(tile), noise_count((len(tile), len(tile[0])), dense=dense)
    entries, counts = list_offsets(tile, pattern, settings, groups, dense=dense)
    together = offsets_together(dense=dense)
    for table, n in zip(entries, counts, strict=True):
        values = table[:n, 1 : entry_length(pattern.size, together, dense=dense)].reshape(n, together, -1)
        assert values.shape[2] == 1 + count
        yield table[:n, 0].copy().view(np.int32), values[..., 0], values[..., 1:]


def offsets_of(tile, steps, shift, groups=50):
    """Rows and columns of offsets by their steps from the first of the class."""
    pattern = number_tile(tile)
    (down, across), first = pattern.size, first_offset(pattern, *shift)
    lines = (steps + groups // 2) // groups
    return lines * packet_rows(down) + first[0], (steps - lines * groups) * across + first[1]


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize("tile", TILES)
def test_lists_share_out_omega_and_lead_to_their_cell(tile, dense):
    settings, pattern = Settings(9, 3, 2.0, 8.0), number_tile(tile)
    (down, across), offsets = pattern.size, {}
    for number, (steps, log_weights, _) in enumerate(unpacked(tile, settings, dense=dense)):
        shift, cell = (number, 0) if dense else divmod(number, down * across)
        rows, columns = offsets_of(tile, steps, divmod(shift, across))
        # From the first pixel of a lane to the pattern's first cell.
        assert ((rows - shift // across - pattern.start[0]) % down == 0).all()
        assert ((columns - shift % across - pattern.start[1]) % across == 0).all()
        for i, line in enumerate(log_weights.T):
            below, inside = rows + i * down, rows + i * down <= 4
            expected = -math.log2(math.e) * (below**2 + columns**2) / (2 * 2.0**2)
            assert line[inside] == pytest.approx(expected[inside], rel=1e-6)
            assert (line[~inside] == np.float32(NO_OFFSET)).all()
            offsets.setdefault(cell, []).extend(zip(below[inside], columns[inside], strict=True))
    assert len(offsets) == (1 if dense else down * across)
    for found in offsets.values():
        assert sorted(found) == [(r, c) for r in range(-4, 5) for c in range(-4, 5)]


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize("tile", [("GR", "WB"), BAYER, RGBW_4X4])
def test_noise_distances_are_those_of_the_phase_of_x_and_the_letter_of_y(tile, dense):
    settings, pattern = Settings(9, 3, 2.0, 8.0), number_tile(tile)
    down, across = pattern.size
    for number, (steps, log_weights, noise) in enumerate(unpacked(tile, settings, dense=dense)):
        shift = divmod(number if dense else number // (down * across), across)
        rows, columns = offsets_of(tile, steps, shift)
        for k in range(noise.shape[2]):
            cell = divmod(k if dense else number % (down * across), across)
            letter = "W" if dense or k == 1 else pattern.letters[pattern.cells[cell[0]][cell[1]]]
            if letter not in pattern.letters:
                continue
            phase = (cell[0] - shift[0]) % down, (cell[1] - shift[1]) % across
            for i in range(noise.shape[1]):
                inside = log_weights[:, i] > NO_OFFSET
                at = noise_distance(tile, letter, 3, 4)[phase][rows[inside] + i * down + 4, columns[inside] + 4]
                assert noise[inside, i, k] == pytest.approx(at, rel=1e-6)


@pytest.mark.parametrize("tile", TILES)
@pytest.mark.parametrize("rows", [(0, 37), (24, 48)])
def test_lanes_meet_each_pixel_once_in_every_class(tile, rows):
    pattern, shape, reach = number_tile(tile), (49, 45), 4
    (down, across), size = pattern.size, lane_size(pattern)
    rows = tuple(row // (8 * down) * 8 * down if k == 0 else row for k, row in enumerate(rows))
    dn = np.random.default_rng(2).integers(100, 3000, shape).astype(np.uint16)
    dn[10:22, 15:32] = 4000
    raw = RawImage(dn, tile, 100.0, 4000.0, 1.0, 2.0, 0.0, 0.0, 0.01)
    alpha = saturated_fraction(raw, 3) if pattern.white is not None else None
    visits, places = np.zeros((*pattern.size, *shape), int), []
    for judge, lanes in sort_tiles(shape, rows, alpha, 0, pattern, reach).items():
        for row, column, i, j, cell, tile_number in zip(*vars(lanes).values(), strict=True):
            step, cell_row, cell_column = (1, 0, 0) if judge == "white" else (down, *divmod(cell, across))
            lines = [r for r in range(row + cell_row, row + size[0], step) if r >= 0]
            step = 1 if judge == "white" else across
            columns = [c for c in range(column + cell_column, column + size[1], step) if c >= 0]
            visits[i, j][np.ix_([r for r in lines if r < shape[0]], [c for c in columns if c < shape[1]])] += 1
            places.append((tile_number, cell if judge != "white" else -1))
            if alpha is not None:
                near = alpha[
                    max(row - reach, 0) : row + size[0] + reach, max(column - reach, 0) : column + size[1] + reach
                ]
                white = pattern.cells[cell // across][cell % across] == pattern.white
                assert {"white": (near == 0.0).all(), "band": white or (near == 1.0).all(), "both": not white}[judge]
    assert (visits[:, :, rows[0] : rows[1]] == 1).all()
    assert len(set(places)) == len(places)
    owned = {number for number, cell in places if cell == -1}
    assert not owned & {number for number, cell in places if cell >= 0}
