"""Plans of whole studies: what they hold, that they are always the same, and that they keep their word."""

import json
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call, check_refusals
from numpy.typing import NDArray
from refusal import refusal
from rich.console import Console

from render.transport import Transport
from sensor.kernel.kernel import expected_electrons_single
from sensor.optics import form_image
from sensor.presets import low_noise, preset, vary
from sensor.response import electrons_per_irradiance, expected_electrons
from studies.budget import pilot as pilot_module
from studies.budget import plan as planning
from studies.budget.costs import cost_over_reference
from studies.budget.ledger import LEVEL, MONTE_CARLO, Ledger, Plan, Term, ledger_html
from studies.budget.pilot import make_pilot
from studies.budget.plan import plan
from studies.budget.plan_text import plan_json, plan_table
from studies.budget.starting_points import plan_from_settings, reference_plan, starting_point
from studies.budget.summary import _bands as bands_text
from studies.budget.summary import _left_out as left_out_text
from studies.budget.summary import summary
from studies.study.lit_scene import level_luminance, lux_per_cd_m2, make_transport, open_all, photographed, under
from studies.study.model import ImageModel, LensTerms, RenderModel
from studies.study.scene_source import open_radiance_file
from studies.study.study import BudgetShares, Condition, RenderLimits, SceneChoice, Study, conditions

SMALL = Study(
    scenes=(SceneChoice("slanted_edge"),),
    levels=("0.05cd/m2", "500cd/m2"),
    render=RenderLimits(size=16, spp=32),
    sensors=("low_noise",),
)
FILE = """
levels = ["0.05cd/m2"]
processors = ["bayer"]
scenes = [{ source = "slanted_edge" }]

[render]
size = 16
spp = 32
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("renders")


@pytest.fixture(scope="module")
def planned(cache: Path) -> Plan:
    return plan(SMALL, cache=cache)


def test_a_plan_has_a_render_for_each_scene_and_an_image_for_each_condition(planned: Plan) -> None:
    (model,) = planned.renders.values()
    assert list(planned.renders) == list(SMALL.scenes)
    assert set(planned.images) == set(conditions(SMALL)) == set(planned.shares)
    assert model.spp == 32
    assert sum(model.width_nm) == pytest.approx(400.0)
    assert {(row.condition, row.mosaic) for row in planned.ledgers} == {
        (condition, mosaic) for condition in conditions(SMALL) for mosaic in ("rgbw", "bayer")
    }
    assert all(planned.shares[row.condition] >= row.share for row in planned.ledgers)


def test_the_dark_hides_what_daylight_shows(planned: Plan) -> None:
    dark, bright = (planned.images[condition] for condition in conditions(SMALL))
    assert dark.lens.veiling_glare == 0.0
    assert bright.lens.diffraction == 1.0
    assert bright.lens.horizontal_view_deg == pytest.approx(20.0)  # the scene's own camera
    assert not bright.exact


def test_a_level_added_leaves_the_others_terms_alone(planned: Plan, cache: Path) -> None:
    more = plan(replace(SMALL, levels=("3cd/m2", *SMALL.levels)), cache=cache)
    for row in planned.ledgers:
        (same,) = [x for x in more.ledgers if (x.condition, x.mosaic) == (row.condition, row.mosaic)]
        effects = {term.name: term.rms_e for term in row.terms if term.name in ("diffraction", "veiling glare")}
        assert {term.name: term.rms_e for term in same.terms if term.name in effects} == pytest.approx(effects)


def test_a_burst_of_four_frames_has_four_times_each_error_and_four_times_the_shot_noise(cache: Path) -> None:
    burst = replace(SMALL, levels=("100cd/m2",), exposures=("2ms",), frames=(1, 4), processors=("bayer",))
    one, four = plan(burst, cache=cache).ledgers
    assert (one.condition.frames, four.condition.frames) == (1, 4)
    for single, merged in zip(one.terms[2:-1], four.terms[2:-1], strict=True):  # the kernel's bound isn't linear
        assert merged.rms_e == pytest.approx(4 * single.rms_e)
    assert 4.0 < four.noise_e**2 / one.noise_e**2 < 4.5  # PRNU, the same in each frame, grows as the square


def test_the_reference_leaves_nothing_out() -> None:
    reference = reference_plan(replace(SMALL, spectra=("own", "sodium_low")))
    (model,) = reference.renders.values()
    assert model.spp == 4 * 32
    assert len(model.width_nm) > 40
    assert min(model.width_nm) < 2.0
    for image in reference.images.values():
        assert (image.lens.diffraction, image.lens.veiling_glare, image.exact) == (1.0, 0.01, True)
        assert image.lens.horizontal_view_deg == pytest.approx(20.0)


def test_each_starting_point_holds_what_its_name_says_and_its_ledger_states_what_that_costs(cache: Path) -> None:
    made = {}
    for name in ("fast", "default", "reference"):
        made[name] = plan(replace(SMALL, budget=BudgetShares(model=name)), cache=cache)
        without_pilot = starting_point(SMALL, name)
        assert (made[name].renders, made[name].images) == (without_pilot.renders, without_pilot.images)
        assert f"the starting point '{name}' renders" in made[name].summary[0]
    held = {
        name: {(len(model.wavelength_nm), model.spp) for model in plan.renders.values()} for name, plan in made.items()
    }
    assert held == {"fast": {(8, 32)}, "default": {(20, 32)}, "reference": {(40, 128)}}
    left_out = {
        name: {term.name for row in plan.ledgers for term in row.terms[4:] if not term.modelled}
        for name, plan in made.items()
    }
    assert left_out == {
        "fast": {"diffraction", "veiling glare", "cos^4", "kernel"},
        "default": {"veiling glare", "cos^4"},  # the sensor states its aperture's diffraction alone
        "reference": set(),
    }
    # in daylight each is nearer to the truth than the one before; the reference's error is its own noise
    _, bright = zip(*(plan.shares.values() for plan in made.values()), strict=True)
    assert sorted(bright, reverse=True) == list(bright)
    reference = made["reference"].ledgers[-1]
    noise = sum(term.share for term in reference.terms[:2])
    assert reference.share == pytest.approx(noise, rel=1e-6)
    # the variance of the light's level falls with the samples alone, of which the reference has four times as many
    of_level = {name: np.array([row.terms[1].share for row in plan.ledgers]) for name, plan in made.items()}
    assert (of_level["reference"] > 0).all()
    for name in ("fast", "default"):
        np.testing.assert_allclose(of_level[name], 4 * of_level["reference"], rtol=1e-9)
    assert all(row.terms[0].share > 0 for plan in made.values() for row in plan.ledgers)


def test_a_fast_plan_keeps_what_the_study_itself_states_of_the_lens() -> None:
    stated = replace(SMALL, lens=LensTerms(veiling_glare=0.05), render=RenderLimits(size=16, spp=4096))
    fast = starting_point(stated, "fast")
    assert {(x.lens.diffraction, x.lens.veiling_glare, x.exact) for x in fast.images.values()} == {(0.0, 0.05, False)}
    assert {model.spp for model in fast.renders.values()} == {128}


def test_what_a_study_states_of_the_lens_goes_before_the_sensors_own_and_that_before_what_is_filled_in(tmp_path):
    own = tmp_path / "mine.toml"
    text = planning.preset.__globals__["preset_file"]("low_noise").read_text()
    own.write_text(text.replace("diffraction = 1.0", "diffraction = 2.0\nveiling_glare = 0.2"))
    assert preset(str(own)).lens.diffraction == 2.0
    study = replace(SMALL, sensors=(str(own),))
    stated = replace(study, lens=LensTerms(diffraction=0.0))
    for made, expected in (
        (reference_plan(study), (2.0, 0.2)),
        (plan_from_settings(study), (2.0, 0.2)),
        (reference_plan(stated), (0.0, 0.2)),
        (plan_from_settings(stated), (0.0, 0.2)),
        (plan_from_settings(replace(SMALL, sensors=("table1_output",))), (0.0, 0.0)),
        (plan_from_settings(SMALL), (1.0, 0.0)),  # a pixel of today has a lens
    ):
        assert {(image.lens.diffraction, image.lens.veiling_glare) for image in made.images.values()} == {expected}


def test_a_metered_channel_in_a_shaking_hand_is_refused_as_a_sweep_refuses_it(cache: Path) -> None:
    shaky = replace(SMALL, sensors=("white_apart",), levels=("500cd/m2",), lens=LensTerms(shake="hand"))
    refusal(plan, shaky, cache=cache, match="shake_um: .*after a part of the time")


def test_a_picture_file_is_planned_in_its_own_bands(tmp_path: Path) -> None:
    from render.radiance import SpectralRadiance
    from render.radiance_files.exr import write_exr

    values = np.random.default_rng(1).uniform(0.1, 1.0, (24, 24, 8)).astype(np.float32)
    path = tmp_path / "scene.exr"
    write_exr(SpectralRadiance(values, np.arange(405.0, 780.0, 50.0)), path)
    found = plan(replace(SMALL, scenes=(SceneChoice(str(path)),)))
    assert not found.renders
    assert len(found.images) == 2
    for row in found.ledgers:
        assert {term.name: term.share for term in row.terms}["Monte Carlo"] == 0.0


def test_the_command_prints_a_ledger_and_why_and_refuses_a_bad_key(tmp_path, cache, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(FILE)
    code, out, _ = call(["plan", "study.toml", "--cache", cache])
    assert code == 0
    for word in ("Monte Carlo", "diffraction", "veiling glare", "cos^4", "the budget of 10%", "samples per pixel"):
        assert word in " ".join(out.split())
    found = json.loads(call(["plan", "study.toml", "--cache", cache, "--json", "--set", "budget.total=0.2"])[1])
    assert found["budget"]["total"] == 0.2
    assert found["conditions"][0]["terms"][0]["name"] == "Monte Carlo"
    assert found["renders"][0]["spp"] == 32
    assert 0 < found["renders"][0]["cost_over_reference"] < 1
    check_refusals(
        "plan study.toml",
        [
            ("--set budget.totl=0.2", "did you mean 'total'?"),
            ("--set budget.model=fats", "budget.model: 'fats' is unknown ... did you mean 'fast'?"),
        ],
        tmp_path,
    )


def model_electrons(transport: Transport, row: Ledger, model: ImageModel) -> NDArray[np.float64]:
    """Expected electrons (h, w) of a condition and mosaic under a model of render, lens and readout."""
    condition = row.condition
    lit = under(transport, condition.spectrum)
    level = level_luminance(condition.level, lux_per_cd_m2(lit, [condition.level]))
    sensor = replace(vary(preset(condition.sensor), row.mosaic).undivided, lens=model.lens)
    image = form_image(photographed(lit, level), sensor)
    if model.exact:
        return expected_electrons(image, sensor, row.exposure_s)
    weights = electrons_per_irradiance(sensor, image.wavelength_nm, image.widths_nm, row.exposure_s, image.light)
    return expected_electrons_single(image.values, weights, sensor).astype(np.float64)


def predicted_and_measured(study: Study, planned: Plan, cache: Path) -> NDArray[np.float64]:
    """Error that a plan predicts, and the one found against the reference model, (ledger, 2) [e-]; no sensor noise.

    The reference is rendered with another seed than plan and pilot; its own Monte Carlo noise, which no model of it
    leaves out, and that of its level count as predicted.
    """
    reference, pairs = reference_plan(study), []
    other = replace(study, render=replace(study.render, seed=study.render.seed + (1 << 30)))
    for choice, opened in open_all(study).items():
        lit, true_lit = (
            make_transport(opened, of_seed, of.renders[choice], cache, lambda *_: None)[0]
            for of, of_seed in ((planned, study), (reference, other))
        )
        spp_over_reference = planned.renders[choice].spp / reference.renders[choice].spp
        for row in planned.ledgers:
            if row.condition.scene == choice:
                electrons = model_electrons(lit, row, planned.images[row.condition])
                true = model_electrons(true_lit, row, reference.images[row.condition])
                below = true < preset(row.condition.sensor).pixel.full_well_e
                rms_e = {term.name: term.rms_e for term in row.terms}
                square = row.rms_e**2 + rms_e[MONTE_CARLO] ** 2 * spp_over_reference + rms_e[LEVEL] ** 2
                measured_e = np.sqrt(np.mean((electrons - true)[below] ** 2)) if below.any() else 0.0
                pairs.append((np.sqrt(square), measured_e))
    return np.array(pairs)


def test_what_is_predicted_covers_what_is_measured(planned: Plan, cache: Path) -> None:
    predicted_e, measured_e = predicted_and_measured(SMALL, planned, cache).T
    assert len(predicted_e) == len(planned.ledgers)
    assert (predicted_e >= measured_e).all()
    assert 1.0 <= np.median(predicted_e / measured_e) <= 3.0


STUDIES = (
    Study(
        scenes=(SceneChoice("still_life"),),
        levels=("0.036cd/m2", "2cd/m2", "25cd/m2", "5000cd/m2"),
        exposures=("auto", "5ms"),
        sensors=("low_noise", "table1_output"),
        render=RenderLimits(size=32, spp=128),
    ),
    Study(
        scenes=(SceneChoice("cornell_box"),),
        levels=("0.1cd/m2", "100cd/m2"),
        spectra=("own", "F11"),
        sensors=("low_noise", "table1_pixel"),
        render=RenderLimits(size=32, spp=128, seed=1),
    ),
    Study(
        scenes=(SceneChoice("color_checker"),),
        levels=("0.02cd/m2", "0.5cd/m2", "10cd/m2", "1000cd/m2"),
        spectra=("own", "A"),
        sensors=("low_noise", "table1_output"),
        render=RenderLimits(size=48, spp=256, seed=2),
    ),
)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_predictions_cover_what_is_measured_in_three_studies(tmp_path: Path) -> None:
    """Issue: in at least 95 % of the conditions, with a median of predicted over measured of at most 3."""
    pairs = np.concatenate([predicted_and_measured(study, plan(study), tmp_path) for study in STUDIES])
    predicted_e, measured_e = pairs.T
    covered, seen = np.mean(predicted_e >= measured_e), measured_e > 0
    ratio = np.median(predicted_e[seen] / measured_e[seen])
    print(f"{len(pairs)} conditions: {covered:.1%} covered, median of predicted over measured {ratio:.2f}")
    assert len(pairs) >= 60
    assert covered >= 0.95
    assert 1.0 <= ratio <= 3.0


# A plan's table: nothing cut off in 100 columns, conditions of the same figures in one line, all terms named.


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


def plan_of(bands: int, spp: int, *, diffraction: float, veiling_glare: float, exact: bool) -> Plan:
    """Two mosaics of one condition, the second with twice the errors."""
    ledgers = tuple(
        Ledger(
            CONDITION,
            mosaic,
            0.066,
            10.0,
            (
                Term("Monte Carlo", 1.0, share),
                Term("diffraction", 3.0, 0.5, modelled=True),
                Term("veiling glare", 1.0, 0.04),
                Term("kernel", 0.0, 0.0),
            ),
            2.0,
            share,
        )
        for mosaic, share in (("bayer", 0.05), ("rgbw", 0.1))
    )
    lens = replace(low_noise().lens, diffraction=diffraction, veiling_glare=veiling_glare, horizontal_view_deg=0.0)
    nm = tuple(380 + 400 / bands * (index + 0.5) for index in range(bands))
    render = RenderModel(nm, (400 / bands,) * bands, spp)
    return Plan(renders={SCENE: render}, images={CONDITION: ImageModel(lens, exact)}, ledgers=ledgers)


def test_the_summary_and_costs_are_counted_once_more() -> None:
    """Nanoseconds a pixel: 85 for a sample's band and 12 more a sample; a lens 55 a band, glare 4.5, exactness 40."""
    plan = plan_of(8, 64, diffraction=1.0, veiling_glare=0.0, exact=False)
    reference = plan_of(40, 256, diffraction=1.0, veiling_glare=0.01, exact=True)
    ratio = (85 * 20 * 64 + 2 * 55 * 8) / (85 * 52 * 256 + 2 * (59.5 * 40 + 40))
    assert cost_over_reference(plan, reference, SCENE) == pytest.approx(ratio)
    shares = BudgetShares(total=0.2, monte_carlo=0.02)
    study = Study((SCENE,), ("1cd/m2",), budget=shares, render=RenderLimits(spp=64))
    # a variance of 10 % at 64 samples is one of 2 % at five times as many
    (paragraph,) = summary(study, plan, reference)
    assert paragraph == (
        "still_life: the cheapest model within the budget renders 8 bands of 50 nm with 64 samples per pixel. "
        "It leaves out veiling glare and exact readout in the one condition. "
        "This adds at most 10% of the sensor's own noise variance, within the budget of 20%. "
        "The error is largest under own 1cd/m2 auto low_noise rgbw, "
        "where the largest parts are Monte Carlo (10%) and veiling glare (4%). "
        f"Render and lens take about {ratio:.2g} of the time of the reference, "
        "which has 40 bands of 10 nm and 256 samples per pixel and models every effect. "
        "Monte Carlo noise exceeds its share of 2%: "
        "320 samples per pixel would keep it, and the study allows 64."
    )
    found = plan_json(study, plan, reference)
    assert found["renders"][0]["monte_carlo_share"] == 0.1
    assert found["renders"][0]["cost_over_reference"] == pytest.approx(ratio)
    text = StringIO()
    Console(file=text, width=100).print(plan_table(plan))
    assert "rgbw" in text.getvalue(), "the worse mosaic"
    assert [line.split() for line in text.getvalue().splitlines() if line.startswith("1cd/m2")] == [
        ["1cd/m2", "10", "2", "10%", "10%", "(50%)", "4%"]
    ]


def test_the_pilot_of_a_large_picture_has_the_means_of_its_blocks(tmp_path: Path) -> None:
    cube = np.random.default_rng(5).uniform(0.1, 0.9, (130, 300, 3)).astype(np.float32)
    np.save(tmp_path / "wall.npy", cube)
    (tmp_path / "wall.toml").write_text('holds = "radiance"\nwavelength_nm = [400, 550, 700]\n', "utf-8")
    study = replace(SMALL, scenes=(SceneChoice(str(tmp_path / "wall.npy")),))
    (opened,) = open_all(study).values()
    pilot = make_pilot(opened, study, [3])
    whole = open_radiance_file(opened.choice.source, opened.white)[0]
    assert pilot.transport.coverage.mean.shape == (44, 100), "blocks of three, the last row's of one"
    small, large = (x.relight(luminance_cd_m2=1.0).values for x in (pilot.transport, whole))
    np.testing.assert_allclose(small[7, 9], large[21:24, 27:30].mean(axis=(0, 1)), rtol=1e-5)
    np.testing.assert_allclose(small[43, 99], large[129:, 297:].mean(axis=(0, 1)), rtol=1e-5)


@pytest.mark.parametrize(
    ("widths", "words"),
    [
        ((7.27272, 7.27272), "2 bands of 7.3 nm"), ((7.26, 7.34, 20.0), "3 bands of 7.3 to 20 nm"),
        ((0.6, 100.04), "2 bands of 0.6 to 100 nm"), ((10.0,), "1 bands of 10 nm"),
    ],
)  # fmt: skip
def test_bands_are_told_by_their_number_and_their_widths_to_a_tenth(widths: tuple[float, ...], words: str) -> None:
    assert bands_text(RenderModel(tuple(400.0 + x for x in widths), widths, 64)) == words


def test_conditions_that_leave_effects_out_are_counted_once_for_all_mosaics() -> None:
    """Of three conditions and two mosaics; effects of the same number share their words, the fewest first."""
    conditions_of = [replace(CONDITION, level=f"{level}cd/m2") for level in (1, 2, 3)]
    names = {"diffraction": (0,), "veiling glare": (0,), "cos^4": (0, 1, 2), "kernel": (1, 2)}
    ledgers = [
        Ledger(
            condition, mosaic, 0.066, 10.0,
            tuple(Term(x, 1.0, 0.01, modelled=number not in of) for x, of in names.items()),
            2.0, 0.05,
        )
        for number, condition in enumerate(conditions_of)
        for mosaic in ("bayer", "rgbw")
    ]  # fmt: skip
    assert left_out_text(ledgers) == (
        "It leaves out diffraction and veiling glare in 1 of 3 conditions, and exact readout in 2 of 3 conditions, "
        "and cos^4 in all 3 conditions."
    )
    none = [replace(row, terms=tuple(replace(term, modelled=True) for term in row.terms)) for row in ledgers]
    assert left_out_text(none) == "It leaves no effect of lens or readout out."


@pytest.mark.parametrize(
    ("size", "most", "asked"),
    [
        ((64, 48), 200, ((64, 48), 128)), ((65, 32), 100, ((64, 32), 100)), ((300, 200), 128, ((64, 43), 128)),
        ((2, 4096), 7, ((1, 64), 7)), ((32, 32), 127, ((32, 32), 127)),
    ],
)  # fmt: skip
def test_a_pilot_is_a_small_render_of_few_samples_in_fine_bands_with_a_seed_of_its_own(
    size: tuple[int, int], most: int, asked: tuple[Any, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its longer side is 64 pixels at most, and its samples 128; its seed is none that a study can have."""
    told: list[dict[str, Any]] = []
    monkeypatch.setattr(pilot_module, "render", lambda scene, of, **more: told.append({"size": of} | more) or "light")
    study = replace(SMALL, render=RenderLimits(size=16, spp=most, seed=3))
    (opened,) = open_all(study).values()
    made = make_pilot(replace(opened, size=size), study, [8, 40], Path("renders"))
    ((one,),) = (told,)
    assert (one["size"], one["max_spp"]) == asked
    assert one["seed"] == 3 + 2**32
    assert one["cache"] == Path("renders")
    assert (one["wavelength_nm"].size, one["width_nm"].sum()) == (40, pytest.approx(400.0))
    assert made.transport == "light"
    assert {count: len(groups) for count, groups in made.groups.items()} == {8: 8, 40: 40}
    assert made.rendered


@pytest.mark.parametrize(("side", "seen"), [(128, 128), (129, 65), (256, 128), (257, 86)])
def test_a_picture_files_pilot_has_a_longer_side_of_128_pixels_at_most(side: int, seen: int, tmp_path: Path) -> None:
    np.save(tmp_path / "wall.npy", np.full((16, side, 3), 0.5, np.float32))
    (tmp_path / "wall.toml").write_text('holds = "radiance"\nwavelength_nm = [400, 550, 700]\n', "utf-8")
    study = replace(SMALL, scenes=(SceneChoice(str(tmp_path / "wall.npy")),))
    (opened,) = open_all(study).values()
    pilot = make_pilot(opened, study, [3])
    assert pilot.transport.counts.shape[1] == seen
    assert not pilot.rendered


@pytest.mark.parametrize(("name", "count"), [("fast", 8), ("default", 20), ("reference", 40)])
def test_bands_of_each_starting_point_fill_the_visible_range_side_by_side(name: str, count: int) -> None:
    ((model,),) = (starting_point(SMALL, name).renders.values(),)
    nm, width_nm = np.array(model.wavelength_nm), np.array(model.width_nm)
    assert nm.size == width_nm.size == count
    assert width_nm == pytest.approx(np.full(count, 400.0 / count))
    assert nm == pytest.approx(380.0 + 400.0 / count * (np.arange(count) + 0.5))
