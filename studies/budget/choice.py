"""The cheapest model within the stated share of the sensor's noise variance."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil
from operator import itemgetter

from studies.budget.ledger import KERNEL, Weighed
from studies.study.study import BudgetShares, Condition

FIRST_SPP = 128  # fewer are less even than the pilot's, which says how noisy they are

# What a model costs in nanoseconds of one core; ratios are what counts. `still_life` at 256x256 takes 1690, 2370 and
# 4410 ns a pixel and sample in 8, 16 and 40 bands: 85 ns a band, and as much as 12 bands for tracing a path.
TRACING_BANDS = 12
SAMPLE_BAND_NS = 85.0
# A pixel, on the same picture.
LENS_BAND_NS = {"diffraction": 55.0, "veiling glare": 4.5, "cos^4": 0.7, "camera shake": 10.0}
EXACT_NS = 40.0  # a pixel


@dataclass(frozen=True)
class Choice:
    """What a scene's render and its conditions' images hold: bands, samples, terms left out."""

    count: int
    spp: int
    left_out: dict[Condition, frozenset[str]]


def choose(rows: Sequence[Weighed], sizes: dict[int, int], shares: BudgetShares, most_spp: int) -> Choice:
    """Choose one render and a lens for each condition of one scene.

    Monte Carlo noise has a share of its own; the rest is for all other terms together. Sensors and mosaics that see the
    same light for the same time are compared: what one needs, all have. The finest bands with everything modelled are
    within any share.

    Parameters
    ----------
    rows : sequence of Weighed
    sizes : dict of int to int
        Real number of bands by the count asked for; lines add some.
    shares : BudgetShares
    most_spp : int
        What the study allows; 0 for a picture file.
    """
    compared: dict[Condition, list[Weighed]] = {}
    for row in rows:
        compared.setdefault(replace(row.condition, sensor=""), []).append(row)
    choices: list[tuple[float, Choice]] = []
    for count, bands in sizes.items():
        lenses = [(alike, _cheapest_lens(alike, count, bands, shares)) for alike in compared.values()]
        by_condition = {row.condition: lens for alike, lens in lenses if lens for row in alike}
        if not all(lens for _, lens in lenses):
            continue
        left_out = {condition: out for condition, (_, out) in by_condition.items()}
        # Samples a pixel that bring Monte Carlo noise under its share in every condition.
        wanted = ceil(
            max(
                row.monte_carlo(count, 1, left_out[row.condition]) / (shares.monte_carlo * row.noise_variance)
                for row in rows
            )
        )
        spp = min(max(wanted, FIRST_SPP), most_spp)
        cost = sum(lens_ns for lens_ns, _ in by_condition.values()) + render_ns(bands, spp)
        choices.append((cost, Choice(count=count, spp=spp, left_out=left_out)))
    return min(choices, key=itemgetter(0))[1]


def render_ns(bands: int, spp: int) -> float:
    """Time of a render [ns a pixel]; bands are worked on in fours."""
    return (-(-bands // 4) * 4 + TRACING_BANDS) * spp * SAMPLE_BAND_NS


def image_ns(bands: int, modelled: Iterable[str]) -> float:
    """Time of a picture's lens and readout [ns a pixel]."""
    return sum(EXACT_NS if name == KERNEL else LENS_BAND_NS[name] * bands for name in modelled)


def _cheapest_lens(
    rows: Sequence[Weighed], count: int, bands: int, shares: BudgetShares
) -> tuple[float, frozenset[str]] | None:
    """Cost, and the terms of lens and kernel left out; None where the bands alone are too much."""

    def fits(row: Weighed, left_out: Iterable[str]) -> bool:
        total_e = sum(row.bands[count]) + sum({**row.lens, KERNEL: row.kernel}.get(name, 0.0) for name in left_out)
        return total_e**2 <= (shares.total - shares.monte_carlo) * row.noise_variance

    names = [*dict.fromkeys(name for row in rows for name in row.lens), KERNEL]
    fitting = [
        (image_ns(bands, set(names) - set(out)), frozenset(out))
        for count_left_out in range(len(names) + 1)
        for out in combinations(names, count_left_out)
        if all(fits(row, out) for row in rows)
    ]
    return min(fitting, key=lambda choice: (choice[0], sorted(choice[1])), default=None)
