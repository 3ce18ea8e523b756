"""Student's interval: a table's value."""

import numpy as np
import pytest

from studies.metrics.confidence import half_width


def test_five_figures_have_the_interval_of_the_printed_table() -> None:
    # t(0.975; 4) is 2.776 and t(0.995; 4) is 4.604 in any table; s^2 of 1..5 is 2.5, so that s / sqrt 5 is sqrt 0.5.
    figures = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    assert half_width(figures) == pytest.approx(2.776 * np.sqrt(0.5), abs=0.0005)
    assert half_width(figures, 0.99) == pytest.approx(4.604 * np.sqrt(0.5), abs=0.0005)
