"""A plan's table: nothing cut off in 100 columns, conditions of the same figures in one line, all terms named."""

from io import StringIO

from rich.console import Console

from sensor.presets import low_noise
from studies.budget.ledger import Ledger, Plan, Term
from studies.budget.plan_text import plan_table
from studies.study.model import ImageModel
from studies.study.study import Condition, SceneChoice

TERMS = ("Monte Carlo", "level", "bands", "light within bands", "diffraction", "veiling glare", "cos^4", "kernel")


def printed(shares: dict[str, dict[str, float]]) -> list[str]:
    """Print the table of two sensors under each level, with the shares given by level and term."""
    ledgers = []
    for sensor in ("low_noise", "table1_output_6um"):
        for level, of_terms in shares.items():
            condition = Condition(SceneChoice("still_life_outdoor"), "own", level, "auto", sensor)
            terms = tuple(Term(name, 1.0, of_terms.get(name, 0.0), modelled=name == "cos^4") for name in TERMS)
            ledgers.append(Ledger(condition, "rgbw", 0.066, 1234.5, terms, 12.34, 1.23))
    images = {row.condition: ImageModel(low_noise().lens) for row in ledgers}
    text = StringIO()
    Console(file=text, width=100).print(plan_table(Plan(renders={}, images=images, ledgers=tuple(ledgers))))
    return [line.rstrip() for line in text.getvalue().splitlines()]


def test_levels_of_the_same_figures_share_a_line_and_what_is_common_is_the_title() -> None:
    lines = printed({"100cd/m2": {"bands": 0.05}, "570cd/m2": {"bands": 0.05}, "1cd/m2": {"bands": 0.01}})
    assert lines[0] == "still_life_outdoor own auto rgbw"
    assert sum(line.startswith(("low_noise", "table1_output_6um")) for line in lines) == 2
    assert sum(line.startswith("100cd/m2,") for line in lines) == 2
    assert [line.split()[-1] for line in lines if line.startswith("1cd/m2")] == ["1%", "1%"]


def test_terms_under_a_tenth_of_a_per_cent_everywhere_are_named_below() -> None:
    lines = printed({"1cd/m2": {"bands": 0.01, "level": 0.0009}})
    left_out = ", ".join(name for name in TERMS if name != "bands")
    assert " ".join(lines).endswith(f"under 0.1% everywhere: {left_out}")
