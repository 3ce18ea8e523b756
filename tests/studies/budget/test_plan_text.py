"""A plan's table: nothing cut off in 100 columns, conditions of the same figures in one line, all terms named."""

import re
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from sensor.presets import low_noise
from studies.budget.ledger import Ledger, Plan, Term, ledger_html
from studies.budget.plan_text import cost_over_reference, plan_json, plan_table, reasons
from studies.study.model import ImageModel, RenderModel
from studies.study.study import BudgetShares, Condition, RenderLimits, SceneChoice, Study

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


def test_a_picture_file_s_ledger_lacks_a_term_beside_a_scene_s() -> None:
    ledgers = []
    for scene, names in (("cube.exr", TERMS[:-2] + TERMS[-1:]), ("siemens_star", TERMS)):
        condition = Condition(SceneChoice(scene), "own", "1cd/m2", "auto", "low_noise")
        terms = tuple(Term(name, 1.0, 0.01 * (1 + TERMS.index(name)), modelled=False) for name in names)
        ledgers.append(Ledger(condition, "rgbw", 0.066, 1234.5, terms, 12.34, 1.23))
    images = {row.condition: ImageModel(low_noise().lens) for row in ledgers}
    plan = Plan(renders={}, images=images, ledgers=tuple(ledgers))
    text = StringIO()
    Console(file=text, width=120).print(plan_table(plan))
    lines = [line.split() for line in text.getvalue().splitlines() if line.startswith("1cd/m2")]
    assert [line[-2:] for line in lines] == [["6%", "8%"], ["7%", "8%"]]
    cells = re.findall(r"<t[hd]>([^<]*)", ledger_html(plan.ledgers))
    rows = [cells[start : start + 12] for start in range(0, 36, 12)]
    assert rows[0][-2:] == ["cos^4", "kernel"]
    assert [row[-2:] for row in rows[1:]] == [["", "8%"], ["7%", "8%"]]


SCENE = SceneChoice("still_life")
CONDITION = Condition(SCENE, "own", "1cd/m2", "auto", "low_noise")


def planned(bands: int, spp: int, *, diffraction: float, veiling_glare: float, exact: bool) -> Plan:
    """Two mosaics of one condition, the second with twice the errors."""
    ledgers = tuple(
        Ledger(CONDITION, mosaic, 0.066, 10.0, (Term("Monte Carlo", 1.0, share),), 2.0, share)
        for mosaic, share in (("bayer", 0.05), ("rgbw", 0.1))
    )
    lens = replace(low_noise().lens, diffraction=diffraction, veiling_glare=veiling_glare, horizontal_view_deg=0.0)
    nm = tuple(380 + 400 / bands * (index + 0.5) for index in range(bands))
    render = RenderModel(nm, (400 / bands,) * bands, spp)
    return Plan(renders={SCENE: render}, images={CONDITION: ImageModel(lens, exact)}, ledgers=ledgers)


def test_reasons_and_costs_are_counted_once_more() -> None:
    """Nanoseconds a pixel: 85 for a sample's band and 12 more a sample; a lens 55 a band, glare 4.5, exactness 40."""
    plan = planned(8, 64, diffraction=1.0, veiling_glare=0.0, exact=False)
    reference = planned(40, 256, diffraction=1.0, veiling_glare=0.01, exact=True)
    ratio = (85 * 20 * 64 + 2 * 55 * 8) / (85 * 52 * 256 + 2 * (59.5 * 40 + 40))
    assert cost_over_reference(plan, reference, SCENE) == pytest.approx(ratio)
    shares = BudgetShares(total=0.2, monte_carlo=0.02)
    study = Study((SCENE,), ("1cd/m2",), budget=shares, render=RenderLimits(spp=64))
    budget, chosen, short = reasons(study, plan, reference)
    assert budget.startswith("Budget: 20% of the sensor's own noise variance, 2% of it for Monte Carlo noise.")
    assert chosen == (
        f"still_life: 8 bands of 50 nm, 64 samples a pixel; render and lens cost about {ratio:.2g} of the reference's"
    )
    # a variance of 10 % at 64 samples is one of 2 % at five times as many
    assert short == (
        "still_life: Monte Carlo noise reaches 10% in the worst condition; 3.2e+02 samples would keep the aim, and "
        "spp allows 64"
    )
    found = plan_json(study, plan, reference)
    assert found["renders"][0]["monte_carlo_share"] == 0.1
    assert found["renders"][0]["cost_over_reference"] == pytest.approx(ratio)
    text = StringIO()
    Console(file=text, width=100).print(plan_table(plan))
    assert "rgbw" in text.getvalue(), "the worse mosaic"
    assert text.getvalue().split()[-4:] == ["10", "2", "10%", "10%"]
