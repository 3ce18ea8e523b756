"""The third decision: how many bands a render has. Each number is compared with its own best effects and samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

from studies.budget.costs import render_ns
from studies.budget.how_many_samples import samples_per_pixel
from studies.budget.scaled_effects import ScaledEffects
from studies.budget.which_effects import effects_left_out
from studies.study.study import BudgetShares, Condition


@dataclass(frozen=True)
class Choice:
    """Model of a scene's render and of the images of its conditions.

    Attributes
    ----------
    count : int
        Number of bands before those of the lamps' lines are added.
    spp : int
        Samples per pixel; 0 for a picture file.
    left_out : dict of Condition to frozenset of str
        Effects of lens and readout that are not modelled.
    """

    count: int
    spp: int
    left_out: dict[Condition, frozenset[str]]


def choose(rows: Sequence[ScaledEffects], sizes: dict[int, int], shares: BudgetShares, most_spp: int) -> Choice:
    """Choose the cheapest model of one scene: one render for all conditions, and a lens for each.

    Monte Carlo noise has its own share of the budget, and all other errors together have the rest. Sensors and mosaics
    that see the same light for the same time are compared with each other, so an effect that one of them needs is
    modelled for all. The finest bands with every effect modelled are always allowed.

    Parameters
    ----------
    rows : sequence of ScaledEffects
    sizes : dict of int to int
        For each `Choice.count`, the number of bands with those of the lamps' lines.
    shares : BudgetShares
    most_spp : int
        Samples per pixel that the study allows; 0 for a picture file.
    """
    compared: dict[Condition, list[ScaledEffects]] = {}
    for row in rows:
        compared.setdefault(replace(row.condition, sensor=""), []).append(row)
    candidates: list[tuple[float, Choice]] = []
    for count, bands in sizes.items():
        images_ns = 0.0
        left_out = {}
        for alike in compared.values():
            lens = effects_left_out(alike, count, bands, shares)
            if lens is None:
                break
            for condition in dict.fromkeys(row.condition for row in alike):
                images_ns += lens[0]
                left_out[condition] = lens[1]
        else:
            spp = samples_per_pixel(rows, count, left_out, shares, most_spp)
            candidates.append((images_ns + render_ns(bands, spp), Choice(count, spp, left_out)))
    return min(candidates, key=itemgetter(0))[1]
