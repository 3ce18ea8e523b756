"""What a kernel is compiled for, and how values are packed for its lanes."""

from dataclasses import dataclass
from typing import Literal

Judge = Literal["white", "band", "both"]
Pixel = tuple[int, int]
Cells = tuple[tuple[int, ...], ...]

PACKET = 8  # floats loaded at once: one AVX register, and a good size for the others
HEAD = 4  # floats that every entry of a list begins with: step in groups, rows, columns, log2 of the spatial weight


@dataclass(frozen=True)
class Shape:
    """What a kernel is compiled for.

    Attributes
    ----------
    cells : tuple of tuple of int
        Numbered letters of the tile, as `isp.tiles.Pattern`.
    white : int or None
        Number of W.
    rows, columns : int
        Pixels of a lane, whole tiles.
    patch : int
        Width of the patches.
    judge : {"white", "band", "both"}
        Whose plane judges similarity: W's, each band's own, or both as alpha mixes them.
    exact, bordered, noise : bool
        Whether sums are exact; y may lie outside the frame; squares of weights are summed too.
    """

    cells: Cells
    white: int | None
    rows: int
    columns: int
    patch: int
    judge: Judge
    exact: bool
    bordered: bool
    noise: bool

    @property
    def pixels(self) -> list[Pixel]:
        """Places in the lane, row by row."""
        return [(r, c) for r in range(self.rows) for c in range(self.columns)]

    @property
    def across(self) -> int:
        """Columns of the tile."""
        return len(self.cells[0])

    @property
    def cell_count(self) -> int:
        """Cells of the tile."""
        return len(self.cells) * self.across

    @property
    def packet_rows(self) -> int:
        """Rows in one group of packets."""
        return packet_rows(self.cells)

    @property
    def slots(self) -> list[int]:
        """Planes that judge in this kernel, in the order in which memory holds them."""
        judging = {n for pixel in self.pixels for n in self.judges(pixel)}
        return [n for n in slots(self.cells, self.white) if n in judging]

    def letter(self, pixel: Pixel) -> int:
        """Number of the letter at y, for the pixel at this place in the lane."""
        return self.cells[pixel[0] % len(self.cells)][pixel[1] % self.across]

    def cell(self, pixel: Pixel) -> int:
        """Number of the cell at y."""
        return pixel[0] % len(self.cells) * self.across + pixel[1] % self.across

    def judges(self, pixel: Pixel) -> list[int]:
        """Planes that judge there, in the order of `slots`: one, or W's and the band's own."""
        own = self.letter(pixel)
        if self.judge == "band" or self.white is None or own == self.white:
            return [own]
        return [self.white] if self.judge == "white" else [self.white, own]

    def judged(self, plane: int) -> tuple[list[int], list[int]]:
        """Rows and columns of the lane where a plane judges: it does at all their crossings, or at most of them."""
        pixels = [pixel for pixel in self.pixels if plane in self.judges(pixel)]
        return sorted({r for r, _ in pixels}), sorted({c for _, c in pixels})


def slots(cells: Cells, white: int | None) -> list[int]:
    """Letters in the order in which memory holds their planes: W first, for it may be the only one."""
    return sorted({n for row in cells for n in row}, key=lambda n: (n != white, n))


def packet_rows(cells: Cells) -> int:
    """Rows in one group of packets: two in an even tile, for patches of y begin at rows of one phase."""
    return 2 if len(cells) % 2 == 0 else 1


def packet_width(columns: int, patch: int) -> int:
    """Values that a lane reads of a row, rounded up to what packets make."""
    return whole_packets(columns + patch - 1)


def whole_packets(count: int) -> int:
    """Smallest power of two up to a packet, or multiple of packets, that holds `count` values."""
    return int(2 ** (count - 1).bit_length()) if count <= PACKET else -(-count // PACKET) * PACKET


def entry_size(cell_count: int) -> int:
    """Floats of an entry: its head, then the noise distance of W's plane and of the band's own by cell."""
    return whole_packets(HEAD + 2 * cell_count)
