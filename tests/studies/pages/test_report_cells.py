"""The report's cells: in order, each once, means and intervals over seeds."""

import re
from collections.abc import Callable
from typing import Any

import pytest
import report_sample as SAMPLE

from rodcone.errors import InputError
from studies.pages.report_cells import SCATTERED, exposure_name, groups, ordered_cells, over_seeds, seeds


def test_two_seeds_give_mean_and_student_s_interval() -> None:
    base = dict.fromkeys(SCATTERED, 1.0)
    rest = {"substitution": None, "balance": None, "picture": "a"}
    cell = over_seeds([{**base, **rest, "psnr_db": 20.0}, {**base, **rest, "psnr_db": 21.0, "picture": "b"}])
    # n = 2: s / sqrt(2) = 0.5, and t of one degree of freedom at 97.5 % is tan(0.475 pi) = 12.7062 (the Cauchy law).
    assert cell["psnr_db"] == 20.5
    assert cell["intervals"]["psnr_db"] == pytest.approx((20.5 - 6.3531, 20.5 + 6.3531), abs=1e-4)
    assert cell["intervals"]["ssim"] == (1.0, 1.0)
    assert cell["picture"] == "a"


def test_figure_unknown_for_a_seed_is_unknown() -> None:
    one, other = [SAMPLE.sample_cell(1, 0, "interleaved") for _ in range(2)]
    one["snr_db"], other["psnr_db"] = None, float("inf")
    cell = over_seeds([one, other])
    assert cell["snr_db"] is None
    assert cell["psnr_db"] is None
    assert set(cell["intervals"]).isdisjoint({"snr_db", "psnr_db"})


def test_decisions_of_all_seeds_count() -> None:
    cells = [SAMPLE.sample_cell(1, 0, "interleaved") for _ in range(4)]
    cells[3]["substitution"] = False
    cells[2]["balance"] = cells[2]["balance"] | {"B": "calibrated"}
    cell = over_seeds(cells)
    assert cell["substitution"] == 0.75
    assert cell["balance"] == {"R": "gray world", "G": "gray world", "B": "calibrated"}


def test_one_seed_keeps_its_numbers() -> None:
    cell = SAMPLE.sample_cell(1, 0, "bayer")
    assert over_seeds([cell]) == {**cell, "intervals": {}}


def test_cells_come_by_sensor_exposure_level_and_camera() -> None:
    of = SAMPLE.sample_axes()
    of["cells"].reverse()
    cells = ordered_cells(of)
    places = [(cell["exposure"], cell["level"], cell["camera"]) for cell in cells]
    assert places == [(e, lv, c) for e in ("auto", "10ms") for lv in range(3) for c in ("interleaved", "bayer")]
    assert groups(of) == ["table1_output, exposure automatic", "table1_output, exposure 10\N{NO-BREAK SPACE}ms"]
    assert [cell["group"] for cell in cells] == [title for title in groups(of) for _ in range(6)]
    assert seeds(of) == [7, 6, 5]


def test_results_without_axes_have_one_exposure_and_the_study_s_seed() -> None:
    of = SAMPLE.sample_results()
    assert groups(of) == ["table1_output", "low_noise"]
    assert seeds(of) == [0]
    assert exposure_name("auto") == "automatic"


def _drop(of: dict[str, Any]) -> None:
    of["cells"] = [c for c in of["cells"] if (c["seed"], c["exposure"], c["level"], c["camera"]) != MISSING]


def _unknown(of: dict[str, Any]) -> None:
    of["cells"][0]["exposure"] = "20ms"


def _unreadable(of: dict[str, Any]) -> None:
    of["exposures"] = ["auto", "</script>"]


MISSING = (6, "10ms", 2, "bayer")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (_drop, "sensor 'table1_output', exposure '10ms', level 2, camera 'bayer', seed 6 is missing"),
        (_unknown, "'20ms'"),
        (_unreadable, "'</script>' is not a time"),
    ],
)
def test_incomplete_axes_are_refused(fault: Callable[[dict[str, Any]], None], words: str) -> None:
    of = SAMPLE.sample_axes()
    fault(of)
    if fault is _unreadable:
        for cell in of["cells"]:
            cell["exposure"] = cell["exposure"].replace("10ms", "</script>")
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        ordered_cells(of)
    assert "\n" not in str(caught.value)
