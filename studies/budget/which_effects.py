"""The first decision: which effects of the lens and of the readout a picture includes.

An effect may be left out if the sensor's noise hides it. Of all sets of effects that fit the budget the cheapest is
chosen.
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
        Effects on the sensors and mosaics that are compared with each other, and therefore have one lens.
    count, bands : int
        Number of bands without and with those of the lamps' lines.
    shares : BudgetShares

    Returns
    -------
    float, frozenset of str
        Cost of the modelled effects [ns per pixel], and the effects left out. None if the bands alone exceed the
        budget.
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

    The budget for them is what the share of Monte Carlo noise leaves of the total.
    """
    optional_e = {**row.lens, KERNEL: row.kernel}
    error_e = sum(row.bands[count]) + sum(optional_e.get(name, 0.0) for name in left_out)
    return error_e**2 <= (shares.total - shares.monte_carlo) * row.noise_variance
