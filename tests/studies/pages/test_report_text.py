"""The report's parts: numbers as text, and sentences."""

import pytest

from studies.metrics import metric as figures
from studies.pages import report_text as text


@pytest.mark.parametrize(("lead", "words"), [(0.04, "0.0"), (-0.04, "0.0"), (0.06, "+0.1"), (-11.94, "−11.9")])
def test_a_lead_that_is_written_as_0_has_no_sign(lead: float, words: str) -> None:
    assert text.lead_text(figures.PSNR, lead) == words


def test_powers_have_their_signs() -> None:
    assert text.with_signs("10 photons per um^2, 5 cd/m2, cos^4") == "10 photons per µm², 5 cd/m², cos⁴"
    assert (text.plain_name("quiet.toml"), text.plain_name("low_noise")) == ("quiet", "low_noise")


def test_substitution_of_some_seeds_is_told_apart() -> None:
    assert [text.substitution_text(share) for share in (None, True, 0.25, 0.0)] == [
        "not applicable",
        "on",
        "on for 25\N{NO-BREAK SPACE}% of the seeds",
        "off",
    ]


@pytest.mark.parametrize(("level", "words"), [("0.036cd/m2", "0.036 cd/m²"), ("500lux", "500 lux")])
def test_levels_are_written_as_prose_does(level: str, words: str) -> None:
    assert text.level_text(level).replace("\N{NO-BREAK SPACE}", " ") == words


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.036, "0.036"),
        (0.0999, "0.0999"),
        (80, "80"),
        (1234.0, "1 230"),
        (99.96, "100"),
        (0, "0"),
        (None, "—"),
        (-2, "−2"),
    ],
)
def test_significant_digits(value: float | None, written: str) -> None:
    assert text.significant(value).replace("\N{NARROW NO-BREAK SPACE}", " ") == written


def test_times_choose_their_unit() -> None:
    said = [text.duration(seconds).replace("\N{NO-BREAK SPACE}", " ") for seconds in (0.066, 0.00012, 41.23, 0.0)]
    assert said == ["66 ms", "0.12 ms", "41.2 s", "0 s"]


def test_exposures_are_written_as_prose_does() -> None:
    said = [text.exposure_name(way) for way in (text.way_name("auto"), text.way_name("2ms", 4))]
    assert said == ["automatic", "2\N{NO-BREAK SPACE}ms, 4 frames"]
