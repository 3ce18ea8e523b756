"""The second decision: how many samples per pixel a render takes."""

from collections.abc import Mapping, Sequence
from math import ceil

from studies.budget.scaled_effects import ScaledEffects
from studies.study.study import BudgetShares, Condition

# Fewer samples are spread less evenly than those of the pilot, so that its noise wouldn't predict theirs.
FEWEST_SPP = 128


def samples_per_pixel(
    rows: Sequence[ScaledEffects],
    count: int,
    left_out: Mapping[Condition, frozenset[str]],
    shares: BudgetShares,
    most_spp: int,
) -> int:
    """Return how many samples per pixel keep Monte Carlo noise within its share of the budget in every condition.

    The number is at most `most_spp`, which the study allows. The variance of the noise is inversely proportional to the
    number of samples, so that the number follows from the variance of one sample.
    """
    needed = max(
        row.monte_carlo(count, 1, left_out[row.condition]) / (shares.monte_carlo * row.noise_variance) for row in rows
    )
    return min(max(ceil(needed), FEWEST_SPP), most_spp)
