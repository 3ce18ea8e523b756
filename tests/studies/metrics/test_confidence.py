"""Mean and Student's interval: a table's value, coverage, refusals."""

import numpy as np
import pytest

from rodcone.errors import InputError
from studies.metrics.confidence import mean_with_confidence


def test_five_figures_have_the_interval_of_the_printed_table() -> None:
    # t(0.975; 4) is 2.776 and t(0.995; 4) is 4.604 in any table; s^2 of 1..5 is 2.5, so that s / sqrt 5 is sqrt 0.5.
    found = mean_with_confidence([1.0, 2.0, 3.0, 4.0, 5.0])
    assert (found.mean, found.count) == (3.0, 5)
    assert found.high - found.mean == pytest.approx(2.776 * np.sqrt(0.5), abs=0.0005)
    assert found.mean - found.low == pytest.approx(2.776 * np.sqrt(0.5), abs=0.0005)
    assert mean_with_confidence([1, 2, 3, 4, 5], 0.99).high == pytest.approx(3 + 4.604 * np.sqrt(0.5), abs=0.0005)


def test_19_of_20_intervals_hold_the_true_mean() -> None:
    # 2000 intervals: the share scatters by sqrt(0.95 * 0.05 / 2000) = 0.5 %; 4.4 of these fail once in 100 000. The
    # normal law's 1.96 in place of Student's 3.18 would hold 85 %.
    samples = np.random.default_rng(5).normal(7.0, 3.0, (2000, 4))
    held = [found.low < 7.0 < found.high for found in map(mean_with_confidence, samples)]
    assert np.mean(held) == pytest.approx(0.95, abs=4.4 * np.sqrt(0.95 * 0.05 / 2000))


@pytest.mark.parametrize(
    ("values", "confidence", "told"),
    [
        ([1.0], 0.95, r"^values: shape \(1,\)"),
        ([[1.0, 2.0]], 0.95, r"^values: shape \(1, 2\)"),
        ([1.0, np.inf], 0.95, "^values: inf"),
        ([1.0, 2.0], 95.0, r"^confidence: 95\.0"),
    ],
)
def test_what_has_no_interval_is_refused(values: list[float], confidence: float, told: str) -> None:
    with pytest.raises(InputError, match=told):
        mean_with_confidence(values, confidence)
