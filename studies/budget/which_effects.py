"""The first decision: which effects of the lens and of the readout a picture holds.

An effect may be left out where the sensor's noise hides it. Of all subsets that fit the budget the cheapest is taken.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations

from studies.budget.costs import image_ns
from studies.budget.effects import KERNEL
from studies.budget.scaled_effects import ScaledEffects
from studies.study.study import BudgetShares


def effects_left_out(
    rows: Sequence[ScaledEffects], count: int, bands: int, shares: BudgetShares
) -> tuple[float, frozenset[str]] | None:
    """Choose the effects that the pictures of one condition leave out.

    Parameters
    ----------
    rows : sequence of ScaledEffects
        Effects on the sensors and mosaics that are compared with each other, so that all of them have one lens.
    count, bands : int
        Number of bands as it is asked for, and as it is with the lines of lamps.
    shares : BudgetShares

    Returns
    -------
    float, frozenset of str
        Cost of what is modelled [ns per pixel], and what is left out. None where the bands alone exceed the budget.
    """
    names = [*dict.fromkeys(name for row in rows for name in row.lens), KERNEL]
    subsets = (frozenset(some) for size in range(len(names) + 1) for some in combinations(names, size))
    fitting = [
        (image_ns(bands, set(names) - left_out), left_out)
        for left_out in subsets
        if all(_fits(row, count, left_out, shares) for row in rows)
    ]
    return min(fitting, key=lambda choice: (choice[0], sorted(choice[1])), default=None)


def _fits(row: ScaledEffects, count: int, left_out: Iterable[str], shares: BudgetShares) -> bool:
    """Return whether the errors of the bands and of the effects left out stay within the budget.

    Their part of the budget is what remains of it after the share of Monte Carlo noise.
    """
    optional_e = {**row.lens, KERNEL: row.kernel}
    error_e = sum(row.bands[count]) + sum(optional_e.get(name, 0.0) for name in left_out)
    return error_e**2 <= (shares.total - shares.monte_carlo) * row.noise_variance
