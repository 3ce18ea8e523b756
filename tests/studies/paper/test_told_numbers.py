"""Numbers that the paper's page tells, counted by hand in views of a few pixels, and where each stands on it."""

import csv
import json
import re
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import peak_signal_noise_ratio

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from scenes.levels import DEMO_LEVELS
from sensor.capture import expose
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.response import behind_filters, channel_electrons, expected_electrons
from sensor.shake import held_lens, shaken
from studies.metrics.flip import flip
from studies.metrics.truth import light_in_bands, named_light, neutral_electrons
from studies.paper import (
    best_exposure,
    early,
    light_levels,
    patches,
    pixel_size,
    white_beside_bayer,
    white_in_low_light,
    white_partly_full,
)
from studies.paper import paper as paper_module
from studies.paper import setup as common
from studies.paper.claims import Claim, ClaimCheck, PaperFigure, with_default, within
from studies.paper.figure2 import SNR_EXPOSURE_S, bright_cd_m2, signal_ratios, snr_claims, snr_gains
from studies.paper.numbers import measured_snr_db, number_claims, range_spans
from studies.paper.paper import Paper, as_csv, as_json, write
from studies.paper.pixel_size import gain_db, half_snr_db
from studies.paper.setup import READINGS, Camera, Setup, View, at_level, close_up, exposures, table1_sensor
from studies.photograph.snr import channel_e
from studies.study.study import OWN, Condition, SceneChoice
from studies.sweep.cells import device_stream, exposure_stream, shake_stream

NM = np.arange(390.0, 771.0, 20.0)
LIGHT = light_in_bands(illuminant("D65"), NM, np.full(NM.size, 20.0))
CHECKS = (
    ClaimCheck("alone", 0.94996, 0.95, np.inf, "dB", default=3.25),
    ClaimCheck("with spread", 12.5, 10.0, 20.0, "×", margin=1.5),
    ClaimCheck("no more", 7.0, -np.inf, 8.0),
    ClaimCheck("exact", 1.0, 1.0, 1.0),
    ClaimCheck("spread leaves", 10.5, 10.0, 20.0, margin=0.75),
)
CLAIMS = (
    Claim("Figure 9", "all of it", CHECKS[1:4], "a note"),
    Claim("Table 1", "some of it", CHECKS[:3]),
    Claim("Section 3.1", "none of it", (CHECKS[0], CHECKS[4])),
)


def view_of(luminance_cd_m2: Image) -> View:
    """A grey view under daylight; white is at 2 cd/m^2."""
    values = luminance_cd_m2[..., None] * LIGHT.spectrum
    return View("grey", "1cd/m2", SpectralRadiance(values.astype(np.float32), NM), LIGHT, 2.0)


def test_page_table_and_object_hold_each_checks_numbers(tmp_path: Path) -> None:
    facts = {"size": 21, "spp": 22, "seeds": 23, "rodcone": "9.8", "environment": {}}
    paper = Paper((PaperFigure("9", "a caption", Figure((1, 1))),), CLAIMS, facts)
    page = write(paper, tmp_path).read_text("utf-8")
    cells = r'<tr><th scope="row">([^<]*)</th><td class="n">([^<]*)(?:<span class="note">([^<]*)</span>)?</td>'
    cells += r'<td class="range">([^<]*)</td><td class="sign \w+">([^<]*)</td></tr>'
    found = [tuple(unescape(x).replace("\N{NO-BREAK SPACE}", " ") for x in row) for row in re.findall(cells, page)]
    alone = ("alone", "0.94996 dB", "default: 3.25 dB", "at least 0.95", "✗ fails")
    spread = ("with spread", "12.5 ± 1.5 ×", "", "10 to 20", "✓ holds")
    no_more, exact = ("no more", "7", "", "at most 8", "✓ holds"), ("exact", "1", "", "exactly 1", "✓ holds")
    leaves = ("spread leaves", "10.5 ± 0.75", "", "10 to 20", "✗ fails")
    rows = [spread, no_more, exact, alone, spread, no_more, alone, leaves]
    assert [tuple(x.strip() for x in row) for row in found] == rows
    words = "1 reproduced, 1 reproduced under a condition, 1 not reproduced."
    assert f"Of 3 claims: {words}" in page
    verdicts = dict.fromkeys(("reproduced", "reproduced under a condition", "not reproduced"), 1)
    told = as_json(paper)
    assert json.loads((tmp_path / "paper.json").read_text("utf-8")) == json.loads(json.dumps(told))
    assert {key: told[key] for key in (*facts, "verdicts")} == facts | {"verdicts": verdicts}
    for claim, of in zip(CLAIMS, told["claims"], strict=True):
        assert (of["where"], of["claim"], of["note"]) == (claim.where, claim.text, claim.note)
        for check, one in zip(claim.checks, of["checks"], strict=True):
            ends = [None if np.isinf(end) else end for end in (check.low, check.high)]
            assert [one["value"], one["low"], one["high"], one["margin"]] == [check.value, *ends, check.margin]
            assert (one["default"], one["unit"]) == (check.default, check.unit)
    table = list(csv.DictReader(as_csv(paper).splitlines()))
    assert [row["number"] for row in table] == list("11122233")
    for row, wanted in zip(table, rows, strict=True):
        plain = [row[key].replace("\N{NO-BREAK SPACE}", " ") for key in ("condition", "computed", "default", "claimed")]
        assert plain == list(wanted[:4])
        assert row["check"] == wanted[4].split()[1]


@pytest.mark.parametrize("name", READINGS)
def test_ratios_of_figure_2_are_those_of_the_data_sheet(name: str) -> None:
    """20 ms of D65: n / sqrt(n + dark^2 + (PRNU n)^2), dark^2 with the converter's rounding."""
    sensor = table1_sensor(name)
    pixel, lit_e = sensor.pixel, channel_e(sensor, named_light("D65"), 1.0, 0.02)
    assert list(signal_ratios("D65").values()) == pytest.approx(lit_e[3] / lit_e[:3])
    assert bright_cd_m2(name) * lit_e[3] == pytest.approx(0.9 * pixel.full_well_e)
    for level, fixed in ((0.5, True), (40.0, True), (40.0, False)):
        n, dark_e2 = level * lit_e, pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12
        variance = n + dark_e2 + (pixel.prnu * n * fixed) ** 2
        for i, gain in enumerate(snr_gains(name, level, fixed_pattern=fixed).values()):
            ratio = n[3] / n[i] * np.sqrt(variance[i] / variance[3])
            assert (gain.ratio, gain.dark, gain.shot) == pytest.approx(
                (ratio, dark_e2 / variance[3], n[i] / variance[i]), rel=1e-6
            )


def test_larger_pixels_gain_what_their_areas_and_noise_give() -> None:
    assert gain_db("table1_output", shot_alone=True) == pytest.approx(20 * np.log10(3), abs=1e-6)
    for name in READINGS:
        ratio = []
        for pitch in (6, 2):
            sensor = table1_sensor(name, "bayer", pitch)
            pixel, n = sensor.pixel, channel_e(sensor, named_light("D65"), 100.0, 0.01)[1]
            dark_e2 = pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12
            ratio.append(n / np.sqrt(n + dark_e2 + (pixel.prnu * n) ** 2))
        assert gain_db(name) == pytest.approx(20 * np.log10(ratio[0] / ratio[1]), abs=1e-6)


def test_halves_of_figure_1a_are_the_left_and_the_right_ones_green() -> None:
    """66 ms of an even field in each half."""
    luminance = np.repeat([[0.4] * 16 + [1.6] * 16], 32, axis=0)
    sensor = table1_sensor("table1_output", "bayer")
    pixel, per_cd_m2 = sensor.pixel, channel_e(sensor, LIGHT, 1.0, 0.066)[1]
    for dark, level in ((True, 0.4), (False, 1.6)):
        n = per_cd_m2 * level
        ratio = n / np.sqrt(
            n + pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12 + (pixel.prnu * n) ** 2
        )
        assert half_snr_db(view_of(luminance), "table1_output", dark) == pytest.approx(20 * np.log10(ratio), abs=0.05)
    assert np.isnan(half_snr_db(view_of(1e5 * luminance), "table1_output", False))


def test_numbers_of_the_text_are_counted_from_levels_and_pixels() -> None:
    """1000 electrons read out: five standard errors of 65 536 differences are 0.12 dB."""
    assert measured_snr_db() == pytest.approx(30.0, abs=0.13)
    luminance = np.linspace(0.01, 5.0, 40 * 50).reshape(40, 50)
    low, high = np.percentile(luminance, [0.1, 99.9])
    day_over_moon = DEMO_LEVELS[-1].luminance_cd_m2 / DEMO_LEVELS[0].luminance_cd_m2
    spans = list(range_spans(view_of(luminance)).values())
    assert spans == pytest.approx([day_over_moon, 1e5 / 0.002, day_over_moon * high / low], rel=2e-3)
    photons, in_pixels, _, decades, swings = number_claims(view_of(luminance))
    for one, factor in ((photons, 1.0), (in_pixels, 4 * 0.025)):  # 4 um^2 in 25 ms
        values = {check.condition: check.value for check in one.checks}
        assert values["D65, 400-700 nm"] == pytest.approx(9.71 * factor, rel=2e-3)
    assert [check.value for check in decades.checks] == pytest.approx(np.log10(spans))
    checks = {check.condition: check.value for check in swings.checks}
    pixel = table1_sensor(next(iter(READINGS))).pixel
    assert checks[next(iter(READINGS))] == pytest.approx(pixel.swing_e / pixel.full_well_e)


def test_levels_scale_light_and_white_alike_and_a_close_up_is_the_middle() -> None:
    subject = view_of(np.arange(80.0 * 60).reshape(80, 60))
    lit = at_level(subject, 8.0)
    assert (lit.level, lit.white_cd_m2) == ("8cd/m2", 16.0)
    np.testing.assert_allclose(lit.radiance.values, 8 * subject.radiance.values, rtol=1e-6)
    np.testing.assert_allclose(lit.truth, subject.truth, rtol=1e-5)
    near = close_up(subject).radiance.values
    np.testing.assert_array_equal(near, subject.radiance.values[20:60, 15:45])


def test_exposures_are_those_of_a_sweeps_chips_and_streams() -> None:
    subject, camera = view_of(np.full((16, 20), 3.0)), Camera("table1_output", "interleaved")
    expected_e = expected_electrons(form_image(subject.radiance, camera.sensor), camera.sensor, 0.02)
    condition = Condition(
        scene=SceneChoice("grey"), spectrum=OWN, level="1cd/m2", exposure="20ms", sensor="table1_output"
    )
    found = exposures(camera, subject, "20ms", 2)
    assert len(found) == 2
    for seed, raw in enumerate(found):
        device = draw_device(camera.sensor, expected_e.shape, device_stream("table1_output", "rgbw", seed))
        stream = exposure_stream(condition, "rgbw", seed)
        wanted = expose(expected_e, camera.sensor, 0.02, device, stream, exact=True)
        np.testing.assert_array_equal(raw.dn, wanted.dn)
        assert raw.exposure_s == 0.02


def test_in_the_hand_each_seed_has_a_path_of_its_own() -> None:
    """A camera in a hand has its lens; each exposure's light moves on the path of its seed, before the filters."""
    subject = view_of(np.random.default_rng(3).uniform(1.0, 9.0, (16, 20)))
    still, held = Camera("table1_output", "interleaved"), Camera("table1_output", "interleaved", shake="hand")
    assert still.sensor.lens.shake_um == 0.0
    assert held.sensor.lens == held_lens(still.sensor.lens, "hand") != still.sensor.lens
    sensor = held.sensor
    electrons = channel_electrons(form_image(subject.radiance, sensor), sensor, 0.2)
    condition = Condition(
        scene=SceneChoice("grey"), spectrum=OWN, level="1cd/m2", exposure="200ms", sensor="table1_output"
    )
    moved = []
    for seed, raw in enumerate(exposures(held, subject, "200ms", 2)):
        moved.append(behind_filters(shaken(electrons, sensor, 0.2, shake_stream(seed)), sensor))
        device = draw_device(sensor, (16, 20), device_stream("table1_output", "rgbw", seed))
        stream = exposure_stream(condition, "rgbw", seed)
        np.testing.assert_array_equal(raw.dn, expose(moved[-1], sensor, 0.2, device, stream, exact=True).dn)
    assert np.abs(moved[0] - moved[1]).max() > 0.05 * moved[0].mean()


def test_each_curve_over_light_is_of_its_own_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    """A developed picture that is off by a tenth of white, and one without W that is off by a fifth."""
    subject, setup = view_of(np.linspace(0.2, 1.8, 32 * 40).reshape(32, 40)), Setup(Path("unused"), seeds=2)
    camera, asked = Camera("table1_output", "interleaved_paper"), []

    def develop(_: Any, raw: Any, lit: View, substitution_snr: float | None = None) -> tuple[Image, Any]:
        asked.append((raw, substitution_snr))
        bare = substitution_snr == 0.0
        return lit.truth + (0.2 if bare else 0.1), SimpleNamespace(substitution=0.375)

    monkeypatch.setattr(light_levels, "develop_view", develop)
    monkeypatch.setattr(light_levels, "LEVELS_CD_M2", np.array([0.1, 10.0, 1e4, 1e5]))
    curves = light_levels.curves(setup, subject, camera)
    truth = encode_srgb(subject.truth)
    shown, bare = (encode_srgb(subject.truth + off) for off in (0.1, 0.2))
    psnr, psnr_bare = (peak_signal_noise_ratio(truth, np.clip(x, 0, 1), data_range=1.0) for x in (shown, bare))
    apart = deltaE_ciede2000(rgb2lab(np.clip(shown, 0, 1)), rgb2lab(np.clip(truth, 0, 1)))
    assert curves.weight.shape == (4, 2)
    assert (curves.weight == 0.375).all()
    np.testing.assert_allclose(curves.psnr_db, psnr, atol=0.02)
    np.testing.assert_allclose(curves.gain_db, psnr - psnr_bare, atol=0.02)
    np.testing.assert_allclose(curves.delta_e, np.median(apart), rtol=0.02)
    np.testing.assert_allclose(curves.flip, flip(np.clip(shown, 0, 1), truth).mean(), rtol=0.02)
    for (raw, _), white_full, similarity in zip(
        asked[::2], curves.white_full.ravel(), curves.similarity.ravel(), strict=False
    ):
        white_e = raw.electrons[1::2, 1::2]
        assert (raw.dn[1::2, 1::2] >= raw.white_dn).mean() <= white_full <= (white_e > 0.9 * raw.full_well_e).mean()
        assert 0 <= similarity <= 1
    assert (curves.similarity[0] == 1).all()
    # brighter levels than the one from which the time falls have the same electrons
    np.testing.assert_array_equal(curves.white_full[3], curves.white_full[2])
    without = [raw for raw, snr in asked if snr == 0.0]
    assert all((raw.dn[1::2, 1::2] == raw.white_dn).all() for raw in without)


def test_the_best_time_by_hand_is_of_each_levels_own_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quality falls with the square of the octaves from 40 ms over the level, of the second seed from twice that."""
    asked: list[tuple[str, str, int]] = []

    def shoot(_: Any, lit: View, time: str, count: int) -> list[tuple[float, float]]:
        asked.append((lit.level, time, count))
        level, time_s = float(lit.level.removesuffix("cd/m2")), float(time.removesuffix("ms")) / 1e3
        return [(time_s, factor * 0.04 / level) for factor in (1.0, 2.0)]

    monkeypatch.setattr(best_exposure, "exposures", shoot)
    monkeypatch.setattr(best_exposure, "develop_view", lambda _, raw, lit: (raw, None))
    monkeypatch.setattr(
        best_exposure, "quality_db", lambda raws, _: [30 - np.log2(time / best) ** 2 for time, best in raws]
    )
    monkeypatch.setattr(best_exposure, "LEVELS_CD_M2", (1.0, 2.0))
    camera = Camera("table1_output", "bayer", shake="hand")
    found = best_exposure.measure_best(Setup(Path("unused"), seeds=2), view_of(np.ones((4, 4))), camera)
    assert list(found) == [1.0, 2.0]
    for level, best in found.items():
        assert best.time_s == pytest.approx([0.04 / level, 0.08 / level])
        assert best.psnr_db == pytest.approx([30.0, 30.0])
        assert best.blur_px == pytest.approx(best_exposure.blur_px(camera.sensor, 0.06 / level))
    assert {count for *_, count in asked} == {2}


def test_patches_beside_the_edge_are_compared_along_and_across_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plane that rises by 1 a row and by 3 a column: 25 pixels, each 8 rows or 8 columns away."""
    rows, columns = np.mgrid[0:40, 0:40].astype(float)
    monkeypatch.setattr(patches, "white_plane", lambda _: rows + 3 * columns + rows * columns)
    found = patches.triplets(SimpleNamespace(), np.full(40, 17))  # type: ignore[arg-type]
    assert found.places.tolist() == [[row, 21] for row in range(2, 30)]
    near = np.arange(-2, 3.0)
    for (row, column), to_y, to_z in zip(found.places, found.to_y, found.to_z, strict=True):
        assert to_y == pytest.approx(np.sqrt(5 * ((8 + 8 * (column + near)) ** 2).sum()))
        assert to_z == pytest.approx(np.sqrt(5 * ((24 + 8 * (row + near)) ** 2).sum()))
    assert found.share == (found.to_y < found.to_z).sum() / 28


def test_ratios_of_early_designs_are_of_each_light_and_way(monkeypatch: pytest.MonkeyPatch) -> None:
    def noise(reading: str, design: str, luminance_cd_m2: float) -> tuple[float, float]:
        first = {"cmyw_yamagami_published": 3.0, "rgbw_sato_published": 2.0}[design]
        return first * luminance_cd_m2, first**2 / luminance_cd_m2

    monkeypatch.setattr(early, "colour_noise", noise)
    found = early.colour_noise_ratios("table1_pixel")
    lights = ("moonlight", "low light", "25 cd/m²")
    assert found == {
        f"table1_pixel, {light}, {how}": ratio
        for light in lights
        for how, ratio in (("closed form", 1.5), ("read out", 2.25))
    }
    assert early.COLOUR_LIGHTS["25 cd/m²"] == 25.0
    assert sorted(early.COLOUR_LIGHTS.values()) == list(early.COLOUR_LIGHTS.values())
    monkeypatch.setattr(early, "range_db", lambda sensor: (70.0, 71.0) if "W" in sensor.cfa[1] else (60.0, 60.5))
    assert set(early.ranges_lost_db("table1_pixel")) == {
        f"table1_pixel, {mosaic}, {how}" for mosaic in ("rgbw_nd", "cmyw") for how in ("closed form", "read out")
    }


def test_a_paper_has_its_figures_claims_after_those_of_its_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two figures that tell their progress; where one is asked for alone, the text's claims are left out."""
    steps: list[tuple[str, float]] = []

    def maker(name: str) -> Any:
        def make(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
            setup.step("renders", 0.5)
            return PaperFigure(name, name, Figure((1, 1))), (Claim(name, "a", CHECKS[:1]), Claim(name, "b", CHECKS[:1]))

        return make

    def claim_of(*what: Any) -> tuple[Claim, ...]:
        return (Claim(str(what), "", CHECKS[:1]),)

    monkeypatch.setattr(paper_module, "_MAKERS", {"1": maker("1"), "2": maker("2")})
    monkeypatch.setattr(paper_module, "view", lambda setup, scene, level: (setup.size, scene, level))
    monkeypatch.setattr(paper_module, "number_claims", claim_of)
    monkeypatch.setattr(paper_module, "section_2", lambda setup: claim_of("2", setup.size))
    monkeypatch.setattr(paper_module, "section_3_1", lambda: claim_of("3.1"))
    setup = Setup(tmp_path / "new" / "folder", size=24, spp=5, seeds=3, step=lambda *asks: steps.append(asks))
    whole = paper_module.make(setup)
    assert [figure.name for figure in whole.figures] == ["1", "2"]
    text = [str(((24, "still_life", 1.0),)), str(("2", 24)), str(("3.1",))]
    assert [claim.where for claim in whole.claims] == [text[0], "1", "1", "2", "2", *text[1:]]
    words = [f"Figure {name}: {what}" for name in "12" for what in ("begins", "renders")]
    assert steps == list(zip(words, (0.0, 0.25, 0.5, 0.75), strict=True))
    assert {name: whole.facts[name] for name in ("size", "spp", "seeds")} == {"size": 24, "spp": 5, "seeds": 3}
    assert set(whole.facts) == {"size", "spp", "seeds", "rodcone", "environment"}
    alone = paper_module.make(setup, ["2"])
    assert ([x.name for x in alone.figures], [x.where for x in alone.claims]) == (["2"], ["2", "2"])


Called = dict[str, list[tuple[Any, ...]]]


def recorded(monkeypatch: pytest.MonkeyPatch, module: Any, **functions: Any) -> Called:
    """Take functions of a module in place of its own, and note what each is called with."""
    called: Called = {name: [] for name in functions}

    def noting(name: str, function: Any) -> Any:
        return lambda *asks, **more: called[name].append((*asks, *more.values())) or function(*asks, **more)

    for name, function in functions.items():
        monkeypatch.setattr(module, name, noting(name, function))
    return called


def pictured(scene: str, level: float | None, *light: str) -> View:
    return view_of(np.full((8, 12), level or 1.0))


def drawn(rows: Any) -> dict[str, Image]:
    return {words: picture for row in rows for words, picture in row}


def test_figure_1a_shows_each_reading_and_its_dark_half_made_as_bright(monkeypatch: pytest.MonkeyPatch) -> None:
    shade = {"table1_pixel": 0.001, "table1_output": 0.002}
    called = recorded(
        monkeypatch,
        pixel_size,
        view=lambda setup, *asks: pictured(*asks),
        exposures=lambda camera, subject, time: [("first", camera.reading), "second"],
        develop_view=lambda camera, raw, subject: (np.full((8, 12, 3), shade[raw[1]]), None),
        half_snr_db=lambda subject, name, dark: len(name) + 100 * dark,
        picture_rows=lambda rows: Figure((1, 1)),
        claims_1a=lambda dark, lit: (),
    )
    figure, _ = pixel_size.figure_1a(Setup(Path("unused"), size=24))
    assert called["view"][0][1:] == ("lit_and_shadowed", None, "lamp")
    names = (*READINGS, pixel_size.TODAY, pixel_size.LARGE)
    ((dark, lit),) = called["claims_1a"]
    assert (dark, lit) == ({name: len(name) + 100 for name in names}, {name: len(name) for name in names})
    assert {(camera.processor, time) for camera, _, time in called["exposures"]} == {("bayer", "66ms")}
    assert f"the left half at {pixel_size.DARK_CD_M2:g} cd/m², the right one at 25." in figure.caption
    rows = called["picture_rows"][0][0]
    assert [row[0][0] for row in rows] == list(READINGS)
    for (reading, taken), (words, raised) in rows:
        np.testing.assert_allclose(taken, encode_srgb(np.full((8, 12, 3), shade[reading])))
        np.testing.assert_allclose(
            raised[:, :6], encode_srgb(np.full((8, 6, 3), pixel_size.DARK_GAIN * shade[reading]))
        )
        np.testing.assert_array_equal(raised[:, 6:], taken[:, 6:])
        assert words.startswith("left half ")
    (level,) = {subject.level for _, subject, _ in called["exposures"]}
    assert level == f"{pixel_size.LIT_CD_M2:g}cd/m2"


def test_figure_1b_gains_what_the_pictures_of_large_pixels_do(monkeypatch: pytest.MonkeyPatch) -> None:
    called = recorded(
        monkeypatch,
        pixel_size,
        view=lambda setup, *asks: pictured(*asks),
        exposures=lambda camera, subject, time, seeds: [(camera.pitch_um, n) for n in range(seeds)],
        develop_view=lambda camera, raw, subject: (np.full((2, 2, 3), raw[0] / 10 + raw[1] / 100), None),
        quality_db=lambda developed, truth: np.array([20 + 10 * x.mean() for x in developed]),
        gain_db=lambda reading, shot_alone=False: len(reading) + 0.5 * shot_alone,
        picture_rows=lambda rows: Figure((1, 1)),
        claims_1b=lambda *asks: (),
    )
    pixel_size.figure_1b(Setup(Path("unused"), size=24, seeds=3))
    ((shot_db, all_db, gained_db),) = called["claims_1b"]
    assert (shot_db, all_db) == (len("table1_output") + 0.5, {name: len(name) for name in READINGS})
    np.testing.assert_allclose(gained_db, [4.0] * 3)  # 6 um over 2 um
    assert called["view"][0][1:] == ("still_life", pixel_size.LUMINANCE_CD_M2)
    assert {time for _, _, time, _ in called["exposures"]} == {"10ms"}
    shown = drawn(called["picture_rows"][0][0])
    assert list(shown) == ["6 µm, PSNR 26.1 dB", "2 µm, PSNR 22.1 dB"]
    np.testing.assert_allclose(next(iter(shown.values())), encode_srgb(np.full((2, 2, 3), 0.6)))


def test_figure_3s_images_show_a_grey_field_as_it_is() -> None:
    """Half of white: the mean of 64 x 64 pixels is 0.5 in colour and in W, less noise of a few thousandths."""
    camera, light = Camera("table1_output"), named_light("D65")
    neutral_e = neutral_electrons(camera.sensor, light, 0.02)
    sensor = camera.sensor
    white_cd_m2 = 0.8 * sensor.pixel.full_well_e / neutral_e.max()
    per_cd_m2 = dict(zip(sensor.channels, neutral_e.tolist(), strict=True))
    field_e = np.tile([[per_cd_m2[channel] for channel in row] for row in sensor.cfa], (32, 32)) * white_cd_m2 / 2
    rng = np.random.default_rng(1)
    raw = expose(field_e, sensor, 0.02, draw_device(sensor, field_e.shape, rng), rng)
    subject: Any = SimpleNamespace(light=light, white_cd_m2=white_cd_m2)
    colour, white = white_in_low_light.colour_and_white(raw, subject, camera)
    for picture in (colour, white):
        np.testing.assert_allclose(picture.mean(axis=(0, 1)), 0.5, rtol=0.01)


def test_figure_3_measures_colour_white_and_both_results(monkeypatch: pytest.MonkeyPatch) -> None:
    of = {"interleaved_paper": 0.5, "interleaved": 0.7}
    called = recorded(
        monkeypatch,
        white_in_low_light,
        view=lambda setup, *asks: pictured(*asks),
        exposures=lambda camera, subject, time, seeds: [(camera.reading, n) for n in range(seeds)],
        colour_and_white=lambda raw, subject, camera: (np.full((2, 2, 3), 0.1), np.full((2, 2, 3), 0.2)),
        develop_view=lambda camera, raw, subject: (np.full((2, 2, 3), of[camera.processor]), None),
        noise=lambda pictures: float(pictures[0].mean()),
        quality_db=lambda pictures, truth: np.array([10 * x.mean() for x in pictures]),
        picture_rows=lambda rows: Figure((1, 1)),
        claims_3=lambda stages: (),
    )
    figure, _ = white_in_low_light.figure_3(Setup(Path("unused"), size=24, seeds=2))
    stages = {name: shot for (one,) in called["claims_3"] for name, shot in one.items()}
    assert len(called["claims_3"]) == 2  # the paper's way, and the default's
    for (one,), gained_db in zip(called["claims_3"], (4.0, 6.0), strict=True):
        assert list(one) == list(READINGS)
        for shot in one.values():
            assert (shot.colour_noise, shot.white_noise) == pytest.approx((0.1, 0.2))
            np.testing.assert_allclose(shot.gain_db, [gained_db] * 2)
    assert called["view"][0][1:] == ("still_life", 2.5)
    assert {time for _, _, time, _ in called["exposures"]} == {"20ms"}
    rows = called["picture_rows"][0][0]
    assert [[words for words, _ in row] for row in rows] == [
        [f"{name}: colour", "W", "result", "by the default"] for name in stages
    ]
    for row in rows:
        levels = [0.1, 0.2, 0.5, 0.7]
        np.testing.assert_allclose([picture.mean() for _, picture in row], encode_srgb(np.array(levels)), rtol=1e-6)
    assert "2.5" in figure.caption
    assert "20" in figure.caption


def test_figure_6_has_an_outcome_for_each_reading_camera_and_exposure(monkeypatch: pytest.MonkeyPatch) -> None:
    cameras = ("bayer", "interleaved_paper", "interleaved")

    def photographed(setup: Setup, subject: View, camera: Camera, exposure: str) -> tuple[Any, Image]:
        substituted = None if camera.processor == "bayer" else float(exposure == "5ms")
        return white_beside_bayer.Outcome(0.1, np.array([1.0]), substituted), np.full((2, 2, 3), 0.1)

    called = recorded(
        monkeypatch,
        white_beside_bayer,
        view=lambda setup, *asks: pictured(*asks),
        _photograph=photographed,
        swap=lambda setup, subject, camera: (camera.reading, camera.processor),
        picture_rows=lambda rows: Figure((1, 1)),
        claims_6=lambda *asks: (),
    )
    white_beside_bayer.figure_6(Setup(Path("unused"), size=24))
    exposures = list(white_beside_bayer.SUBSTITUTED)
    wanted = [(reading, name, exposure) for reading in READINGS for name in cameras for exposure in exposures]
    assert [(x.reading, x.processor, exposure) for *_, x, exposure in called["_photograph"]] == wanted
    (bayer, paper, swaps), (_, default, other) = called["claims_6"]
    keys = [f"{reading}, {exposure}" for reading in READINGS for exposure in exposures]
    assert list(bayer) == list(paper) == list(default) == keys
    assert (swaps, other) == tuple({x: (x, name) for x in READINGS} for name in cameras[1:])
    assert called["view"][0][1:] == ("still_life", white_beside_bayer.LUMINANCE_CD_M2)
    words = [[text for text, _ in row] for row in called["picture_rows"][0][0]]
    names = ("Bayer", "interleaved", "the default")
    told = iter(words)
    for reading in READINGS:
        for name in names:
            row = [
                f"{name}{', W' + chr(39) + 's luminance' if exposure == '5ms' and name != 'Bayer' else ''}, {exposure}"
                for exposure in exposures
            ]
            assert next(told) == [f"{reading}: {row[0]}", *row[1:]]


def test_figure_5_measures_each_reading_by_both_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    planes = np.broadcast_to([3000.0, 0.0, 0.0, 6000.0], (2, 2, 4))
    of = {"interleaved_paper": 0.5, "interleaved": 0.7}
    called = recorded(
        monkeypatch,
        white_partly_full,
        view=lambda setup, *asks: pictured(*asks),
        exposures=lambda camera, subject, time: [("first", camera.reading, camera.processor), "second"],
        develop_view=lambda camera, raw, subject: (np.full((2, 2, 3), of[camera.processor]), None),
        bilinear=lambda raw: planes,
        measure_bright=lambda raw, result, subject: (*raw, float(result.mean())),
        picture_rows=lambda rows: Figure((1, 1)),
        claims_5=lambda bright: (),
    )
    white_partly_full.figure_5(Setup(Path("unused"), size=24))
    assert called["view"][0][1:] == ("still_life", 200.0)
    assert {(camera.pitch_um, time) for camera, _, time in called["exposures"]} == {(3, "66ms")}
    for (told,), (name, level) in zip(called["claims_5"], of.items(), strict=True):
        assert told == {reading: ("first", reading, name, pytest.approx(level)) for reading in READINGS}
    for reading, row in zip(READINGS, called["picture_rows"][0][0], strict=True):
        words = [f"{reading}: R, white is full", "W, white is full", "result", "by the default"]
        assert [text for text, _ in row] == words
        full_e = Camera(reading, pitch_um=3).sensor.pixel.full_well_e
        levels = [min(3000 / full_e, 1.0), min(6000 / full_e, 1.0), 0.5, 0.7]
        means = [picture.mean() for _, picture in row]
        np.testing.assert_allclose(means, encode_srgb(np.array(levels)), rtol=1e-6)


def test_where_w_alone_is_full_is_told_by_the_correlation_of_luminance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the pixels near a full W, of which a quarter are near a full colour; each has a slope of its own."""
    rng = np.random.default_rng(6)
    near = {"W": np.arange(64).reshape(8, 8) < 32, "RGB": np.arange(64).reshape(8, 8) < 8}
    truth = rng.uniform(0, 1, (8, 8))
    both, alone = near["W"] & near["RGB"], near["W"] & ~near["RGB"]
    grey = np.where(both, -truth, np.where(alone, 2 * truth + 1, rng.uniform(0, 1, (8, 8))))
    white = np.where(alone, 5 - truth, 9.0)
    planes = np.stack([np.zeros((8, 8))] * 3 + [white], axis=-1)
    monkeypatch.setattr(white_partly_full, "saturated_nearby", lambda raw, channels: near[channels])
    monkeypatch.setattr(white_partly_full, "bilinear", lambda raw: planes)
    is_white = (np.indices((8, 8)) % 2).prod(axis=0) == 1
    full = np.where(is_white, near["W"], near["RGB"])
    raw: Any = SimpleNamespace(cfa=("RG", "BW"), shape=(8, 8), saturated=full, channels=("R", "G", "B", "W"))
    subject: Any = SimpleNamespace(truth=np.repeat(truth[..., None], 3, axis=-1))
    found = white_partly_full.measure_bright(raw, np.repeat(grey[..., None], 3, axis=-1), subject)
    assert (found.white_full, found.colours_full) == pytest.approx((0.5, 8 / 48))
    assert found.result_correlation == pytest.approx(1.0)
    assert found.white_correlation == pytest.approx(-1.0)
    assert found.full_correlation == pytest.approx(-1.0)
    none, one, two = (np.arange(64).reshape(8, 8) < count for count in range(3))
    for first, second, where in ((truth, grey, none), (truth, grey, one)):
        assert white_partly_full.correlation(first, second, where) == 0.0
    for first, second in ((np.ones((8, 8)), truth), (truth, np.ones((8, 8)))):
        assert white_partly_full.correlation(first, second, alone) == 0.0
    assert abs(white_partly_full.correlation(truth, grey, two)) == pytest.approx(1.0)


def test_figure_4_compares_patches_at_both_levels_and_draws_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    called = recorded(
        monkeypatch,
        patches,
        view=lambda setup, *asks: pictured(*asks),
        exposures=lambda camera, subject, time: [(camera.reading, subject.radiance.luminance().mean()), "second"],
        edge_columns=lambda luminance: luminance.shape,
        triplets=lambda raw, columns: SimpleNamespace(share=raw[1] * (1 + (raw[0] == "table1_output")), raw=raw),
        white_plane=lambda raw: ("plane", raw),
        _drawing=lambda parts: Figure((1, 1)),
        claims_4=lambda shares: (),
    )
    figure, _ = patches.figure_4(Setup(Path("unused"), size=24))
    ((shares,),) = called["claims_4"]
    light = {name: pictured("", level).radiance.luminance().mean() for name, level in patches.LEVELS.items()}
    wanted = {
        f"{reading}, {name}": light[name] * factor
        for name in patches.LEVELS
        for reading, factor in zip(READINGS, (1, 2), strict=True)
    }
    assert shares == pytest.approx(wanted)
    assert list(patches.LEVELS) == ["25 cd/m²", "moonlight"]
    ((parts,),) = called["_drawing"]
    assert [(reading, plane, edge.raw[0]) for reading, plane, edge in parts] == [
        (reading, ("plane", (reading, light["25 cd/m²"])), reading) for reading in READINGS
    ]
    assert "25 cd/m²" in figure.caption
    assert [asks[1:] for asks in called["view"]] == [("slanted_edge", level) for level in patches.LEVELS.values()]
    assert {time for _, _, time in called["exposures"]} == {"20ms"}


def test_the_notes_of_claims_state_the_settings_that_their_numbers_have() -> None:
    """Times in ms of Figure 4's frames ("20ms"), 1a's ("66ms"), 1b's, 2's and the early designs'; light; patches."""
    one = {"as any": 1.0}
    edge, halves = patches.claims_4(one)[0].note, pixel_size.claims_1a(one, one)[0].note
    for words in ("W's patches of 5 × 5", " 20 ms;", "x 4 pixels from the edge", "z 8 from x"):
        assert words in edge
    dark, lit = pixel_size.DARK_CD_M2, pixel_size.LIT_CD_M2
    assert f"Halves of {dark:g} and {lit:g} cd/m², one exposure of 66 ms," in halves
    large, *_ = pixel_size.claims_1b(1.0, one, np.ones(2))
    assert f", {pixel_size.LUMINANCE_CD_M2:g} cd/m² of D65, f/4, {1000 * pixel_size.EXPOSURE_S:g} ms " in large.note
    for claim in snr_claims({}, {}, {}):
        assert f" {1000 * SNR_EXPOSURE_S:g} ms, f/2.8, D65" in claim.note
    lost = early.claims_early({early.GINDELE: one}, one, one, {})[2]
    assert f"D65, {1000 * early.EXPOSURE_S:g} ms:" in lost.note
    swap = white_beside_bayer.claims_6({}, {}, {})[3]
    assert swap.note.endswith(f"with it, {white_beside_bayer.DARKEST}.")
    for claim in patches.filter_claims({1: one, 5: one}):
        assert f"of {patches.FRAME_SIDE} × {patches.FRAME_SIDE} pixels" in claim.note


def test_an_edge_is_at_the_middle_of_dark_and_bright() -> None:
    truth = np.full((3, 10), 1.0)
    for row, column in enumerate((2, 5, 9)):
        truth[row, column:] = 9.0
        truth[row, column - 1] = 4.9  # the middle is 5
    assert patches.edge_columns(truth).tolist() == [2, 5, 9]
    truth[truth == 4.9] = 5.1
    assert patches.edge_columns(truth).tolist() == [1, 4, 8]


def test_the_bilateral_filter_is_its_sum_by_hand() -> None:
    """Of a frame of 3 x 3 with a spot, by patches of one pixel; with three, of a frame of one value but the spot."""
    values = np.zeros((3, 3))
    values[1, 1] = 60.0
    near, far, value = np.exp(-1 / 18), np.exp(-2 / 18), np.exp(-0.5)
    middle = 60 / (1 + value * (4 * near + 4 * far))
    assert patches.filtered(values, 1)[1, 1] == pytest.approx(middle, rel=1e-12)
    others = 1 + 2 * near + 2 * np.exp(-4 / 18) + 2 * np.exp(-5 / 18) + np.exp(-8 / 18)
    assert patches.filtered(values, 1)[0, 0] == pytest.approx(60 * value * far / (others + value * far), rel=1e-12)
    assert np.abs(patches.filtered(np.full((5, 7), 3.0), 3) - 3.0).max() < 1e-12


def test_what_always_against_never_substituting_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Grey 0.2 without W and 0.3 with it; the noise of 4 is a quarter's."""
    called = recorded(
        monkeypatch,
        white_beside_bayer,
        exposures=lambda camera, subject, time, seeds: list(range(seeds)),
        develop_view=lambda camera, raw, subject, snr: (np.full((2, 2, 3), 0.3 if snr else 0.2), None),
        noise=lambda pictures: 1.0 if pictures[0][0, 0, 0] > 0.25 else 4.0,
    )
    setup, subject = Setup(Path("unused"), size=24, seeds=2), view_of(np.ones((2, 2)))
    found = white_beside_bayer.swap(setup, subject, Camera("table1_output"))
    assert found.noise_ratio == 4.0
    lab = [rgb2lab(np.full((1, 1, 3), encode_srgb(np.array(x)))) for x in (0.2, 0.3)]
    assert found.delta_e == pytest.approx(float(deltaE_ciede2000(*lab)[0, 0]), rel=1e-6)
    assert [snr for *_, snr in called["develop_view"]] == [0.0, 0.0, np.inf, np.inf]
    assert called["exposures"][0][2:] == (white_beside_bayer.DARKEST, 2)


def test_figure_b_draws_the_three_cameras_that_its_claims_compare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each camera with times and qualities of its own; a tile of RGBW holds a quarter of each channel."""
    asked: list[Any] = []
    firsts = {"bayer": 0.04, "interleaved_paper": 0.02, "interleaved": 0.01}

    def measure(setup: Setup, subject: View, camera: Camera) -> dict[float, best_exposure.Best]:
        asked.append((setup, subject, camera))
        first = firsts[camera.processor]
        return {
            level: best_exposure.Best(np.array([first, 3 * first]) / level, np.array([20.0, 24.0]) - 100 * first, first)
            for level in best_exposure.LEVELS_CD_M2
        }

    drawn: list[Any] = []
    monkeypatch.setattr(best_exposure, "view", lambda setup, scene, level: (setup, scene, level))
    monkeypatch.setattr(best_exposure, "close_up", lambda subject: ("close up", *subject))
    monkeypatch.setattr(best_exposure, "measure_best", measure)
    monkeypatch.setattr(best_exposure, "light_charts", lambda *asks: drawn.append(asks) or Figure((1, 1)))
    setup = Setup(Path("unused"), seeds=2)
    figure, (times, qualities) = best_exposure.figure_b(setup)
    assert {x[:2] for x in asked} == {(setup, ("close up", setup, "still_life", 1.0))}
    assert [(x.processor, x.reading, x.shake) for *_, x in asked] == [
        (name, best_exposure.READING, "hand") for name in ("bayer", "interleaved_paper", "interleaved")
    ]
    ((levels, charts),) = drawn
    assert levels == best_exposure.LEVELS_CD_M2
    names = {"Bayer": 0.04, "interleaved": 0.02, "the default": 0.01}
    for name, first in names.items():
        means = [charts[chart][name] for chart in ("Best time by hand, ms", "PSNR at the best time, dB")]
        assert means[0] == pytest.approx([2e3 * first / level for level in levels])
        assert means[1] == pytest.approx([22.0 - 100 * first] * len(levels))
    assert [list(chart) for chart in charts.values()] == [list(names)] * 2
    assert figure.name == "B"
    # an octave, and 2 dB; of the default two octaves, and 3 dB
    assert {(round(x.value, 9), round(x.default or 0.0, 9)) for x in times.checks} == {(1.0, 2.0)}
    assert {(round(x.value, 9), round(x.default or 0.0, 9)) for x in qualities.checks} == {(2.0, 3.0)}
    light = [channel_e(asked[n][2].sensor, named_light("D65"), 1.0, 1.0) for n in (1, 0)]
    more = (light[0].sum() / 4) / ((light[1][0] + 2 * light[1][1] + light[1][2]) / 4)
    assert f"gathers {more:.2f} times" in times.note


def test_section_2_is_counted_from_each_designs_own_developed_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    def developed(camera: Camera, raw: Any, subject: Any) -> tuple[Any, Any]:
        return ("picture of", camera, raw, subject), "no picture"

    told: list[Any] = []
    number = {camera: 0.01 * n for n, camera in enumerate((x, y) for x in early.DESIGNS for y in READINGS)}

    def measured(raw: Any, picture: Any, subject: Any) -> SimpleNamespace:
        words, camera, of_raw, of_subject = picture
        assert (words, of_raw, of_subject) == ("picture of", raw, subject)
        assert raw == ("first of", camera, subject, "66ms")
        return SimpleNamespace(result_correlation=number[camera.processor, camera.reading])

    monkeypatch.setattr(early, "view", lambda setup, scene, level: (scene, level))
    monkeypatch.setattr(early, "exposures", lambda *asks: [("first of", *asks), "second"])
    monkeypatch.setattr(early, "develop_view", developed)
    monkeypatch.setattr(early, "measure_bright", measured)
    monkeypatch.setattr(early, "ranges_lost_db", lambda reading: {f"{reading}, lost": 1.0})
    monkeypatch.setattr(early, "colour_noise_ratios", lambda reading: {f"{reading}, noise": 2.0})
    monkeypatch.setattr(early, "gathered", lambda tile: {"R": (float(len(tile)), 0.0)})
    monkeypatch.setattr(early, "claims_early", lambda *asks: told.append(asks) or ())
    early.section_2(Setup(Path("unused"), seeds=2))
    ((bright, lost_db, noise, lights),) = told
    assert {(x, y): value for x, of in bright.items() for y, value in of.items()} == number
    assert lost_db == {f"{reading}, lost": 1.0 for reading in READINGS}
    assert noise == {f"{reading}, noise": 2.0 for reading in READINGS}
    assert lights == {"rgbw": {"R": (2.0, 0.0)}, "rgbw_4x4": {"R": (4.0, 0.0)}}


def test_the_default_stands_beside_a_check_where_it_differs() -> None:
    told = with_default(
        lambda factor: [Claim("a", "b", tuple(within({"one": 2.0 * factor, "two": 5.0})))],
        {"interleaved": 3.0, "interleaved_paper": 1.0},
    )
    assert [(check.value, check.default) for claim in told for check in claim.checks] == [(2.0, 6.0), (5.0, None)]


def test_a_range_read_out_is_off_by_what_its_ends_are_off_by(monkeypatch: pytest.MonkeyPatch) -> None:
    """A read out whose SNR in the dark is a half, where it should be 1, and which is half full at 1.05 of the well."""
    sensor = table1_sensor("table1_output")

    def read(field: Image, *_: Any) -> SimpleNamespace:
        mean = field.mean()
        half_full = np.clip((mean / sensor.pixel.full_well_e - 0.95) / 0.2, 0.0, 1.0)
        return SimpleNamespace(electrons=np.array([-mean, 3 * mean]), saturated=np.array([half_full]))

    monkeypatch.setattr(early, "read_out", read)
    computed, measured = early.range_db(sensor)
    pixel, lit_e = sensor.pixel, channel_e(sensor, named_light("D65"), 1.0, 0.02)
    dark_e2 = pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12
    # n = sqrt(n + dark^2 + (PRNU n)^2)
    a = 1 - pixel.prnu**2
    least_e = (1 + np.sqrt(1 + 4 * a * dark_e2)) / (2 * a)
    ratio = pixel.full_well_e / lit_e[:3].max() / (least_e / lit_e[3])
    assert computed == pytest.approx(20 * np.log10(ratio), abs=0.01)
    assert measured == pytest.approx(computed + 20 * np.log10(1.05 / 2), abs=0.01)


def test_the_two_limits_of_the_filter_are_of_single_pixels_and_of_5_x_5(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each reading's largest difference, under the claim of its patch."""
    from studies.paper import patches

    readings = tuple(patches.READINGS)
    monkeypatch.setattr(patches, "difference", lambda name, patch: 1e-3 * patch * (1 + readings.index(name)))
    pixels, windows = patches.section_3_1()
    for claim, patch in ((pixels, 1), (windows, 5)):
        told = {check.condition: check.value for check in claim.checks}
        assert told == {f"{x}, {patch} × {patch}": pytest.approx(1e-3 * patch * at) for at, x in enumerate(readings, 1)}


@pytest.mark.parametrize(("scene", "spp"), [("still_life", 100), ("lit_and_shadowed", 25), ("slanted_edge", 25)])
def test_a_view_is_of_a_render_with_the_samples_of_its_scene(
    scene: str, spp: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two of the scenes take a quarter; the light is the first group's, or the one that is named."""
    asked: list[Any] = []
    first, second = (SimpleNamespace(spectrum=illuminant(name)) for name in ("D65", "A"))
    light = SpectralRadiance(np.ones((4, 4, NM.size), np.float32), NM)

    def transport_of(opened: Any, study: Any, model: Any, folder: Path, progress: Any) -> Any:
        asked.append((study, model, folder))
        progress(0.25, float("nan"))
        made = SimpleNamespace(groups={"sun": first, "lamp": second}, wavelength_nm=NM, width_nm=np.full(NM.size, 20.0))
        made.relight = lambda luminance_cd_m2: asked.append(luminance_cd_m2) or light
        return made, None

    steps: list[tuple[str, float]] = []
    monkeypatch.setattr(common, "make_transport", transport_of)
    monkeypatch.setattr(common, "shown_white_cd_m2", lambda made, level: (level or 50.0) / 2)
    setup = Setup(tmp_path, size=24, spp=100, band_nm=40.0, step=lambda *told: steps.append(told))
    for level, name, white in ((3.0, "3cd/m2", None), (None, "own", "lamp")):
        found = common.view(setup, scene, level, white)
        study, model, folder = asked[-2]
        assert asked[-1] == level
        assert (found.scene, found.level, found.white_cd_m2) == (scene, name, (level or 50.0) / 2)
        assert found.radiance is light
        lamp = (second if white else first).spectrum
        wanted = light_in_bands(lamp, NM, np.full(NM.size, 20.0))
        np.testing.assert_array_equal(found.light.spectrum, wanted.spectrum)
        assert (study.render.size, study.render.spp, model.spp, len(model.width_nm)) == (24, spp, spp, 10)
        assert folder == tmp_path / "renders"
    assert {share for _, share in steps} == {0.25}
    assert all(words.startswith(f"{scene}: ") for words, _ in steps)
    common.view(Setup(tmp_path, size=24, spp=1), scene, 1.0)
    assert asked[-2][0].render.spp == 1
