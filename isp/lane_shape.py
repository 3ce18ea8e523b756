"""What a kernel is compiled for, and how values are packed for its lanes."""

from dataclasses import dataclass
from typing import Literal

Judge = Literal["white", "band", "both"]
Pixel = tuple[int, int]
Cells = tuple[tuple[int, ...], ...]

PACKET = 8  # floats loaded at once: one AVX register, and a good size for the others
MOST_TOGETHER = 2  # offsets an iteration (`offsets_together`)


@dataclass(frozen=True)
class Shape:
    """What a kernel is compiled for. The letters aren't part of it: a lane is told where its planes lie.

    Attributes
    ----------
    tile : (int, int)
        Rows and columns of the tile of letters.
    rows, columns : int
        Pixels that a lane spans, whole tiles.
    dense : bool
        Whether it owns all these pixels, or those of one cell of the tile.
    patch : int
        Width of the patches.
    judges : int
        Planes that judge similarity: one, or a band's own and W's, as alpha mixes them. One where `dense`.
    exact, noise : bool
        Whether sums are exact; squares of weights are summed too.
    """

    tile: tuple[int, int]
    rows: int
    columns: int
    dense: bool
    patch: int
    judges: int
    exact: bool
    noise: bool

    @property
    def step(self) -> tuple[int, int]:
        """Rows and columns from one of the lane's pixels to the next."""
        return (1, 1) if self.dense else self.tile

    @property
    def places(self) -> tuple[range, range]:
        """Rows and columns of the lane's pixels, from its first one."""
        return range(0, self.rows, self.step[0]), range(0, self.columns, self.step[1])

    @property
    def pixels(self) -> list[Pixel]:
        """The lane's pixels cell by cell, columns first: the order in which sums lie in memory."""
        (down, across), (rows, columns) = self.tile, self.places
        return sorted(((r, c) for r in rows for c in columns), key=lambda p: (p[0] % down, p[1] % across, p[1], p[0]))

    @property
    def window(self) -> tuple[range, range]:
        """Rows and columns under the pixels' patches."""
        rows, columns = self.places
        return range(rows[-1] + self.patch), range(columns[-1] + self.patch)

    @property
    def together(self) -> int:
        """Offsets of an iteration."""
        return offsets_together(dense=self.dense)

    @property
    def row_parts(self) -> list[tuple[int, int, int]]:
        """First value, width and values needed of the packets in which it reads a row of its window.

        The lanes of one cell may end a packet before the dense ones, whose rows are as wide as all.
        """
        count, parts = len(self.window[1]), row_parts(self.columns, self.patch, self.tile[1])
        return [(first, width, min(count - first, PACKET)) for first, width in parts if first < count]

    @property
    def noises(self) -> int:
        """Noise distances of an offset: one a cell, or one a judge."""
        return noise_count(self.tile, dense=self.dense)

    def noise_number(self, pixel: Pixel, judge: int) -> int:
        """Which of them holds for a pixel."""
        return pixel[0] % self.tile[0] * self.tile[1] + pixel[1] % self.tile[1] if self.dense else judge


def packet_rows(down: int) -> int:
    """Rows in one group of packets: two in an even tile, for patches of y begin at rows of one phase."""
    return 2 if down % 2 == 0 else 1


def row_parts(columns: int, patch: int, across: int) -> list[tuple[int, int]]:
    """Packets in which a lane reads a row under its patches: the first value of each and its width.

    Each has room for the columns of a tile, by which one group of packets follows another.
    """
    count = columns + patch - 1
    return [
        (first, max(whole_packets(min(count - first, PACKET)), whole_packets(across)))
        for first in range(0, count, PACKET)
    ]


def whole_packets(count: int) -> int:
    """Smallest power of two up to a packet, or multiple of packets, that holds `count` values."""
    return int(2 ** (count - 1).bit_length()) if count <= PACKET else -(-count // PACKET) * PACKET


def offsets_together(*, dense: bool) -> int:
    """Offsets an iteration, one a tile below the other: they share most rows that they load.

    Two are too much code for dense lanes: a processor decodes it anew each time (docs/decisions/0026).
    """
    return 1 if dense else MOST_TOGETHER


def noise_count(tile: tuple[int, int], *, dense: bool) -> int:
    """Noise distances of one offset in a list: W's plane by cell, or the lane's own plane and W's."""
    return tile[0] * tile[1] if dense else 2


def entry_length(tile: tuple[int, int], together: int, *, dense: bool) -> int:
    """Floats of an entry: a step in groups, then for each offset log2 of the spatial weight and noise distances."""
    return 1 + together * (1 + noise_count(tile, dense=dense))
