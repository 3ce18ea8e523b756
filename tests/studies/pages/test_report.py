"""The report as text: what it refuses, what it escapes, what it says."""

import json
import re
from base64 import b64decode, b64encode
from dataclasses import fields, is_dataclass, replace
from functools import cache
from hashlib import sha256
from html import unescape
from math import isnan
from pathlib import Path
from typing import Any

import pytest
import report_sample as SAMPLE

from studies.metrics import metric as figures
from studies.pages import report_text as text
from studies.pages.report import group_views, render_report, speed_rows, viewer_data
from studies.pages.report_compare import first_comparison
from studies.pages.report_data import ReportCell, ReportData
from studies.pages.report_pictures import ReportPictures
from studies.study.study_file import read_study
from studies.sweep.row import Row

CONFIGS = Path(__file__).parents[3] / "studies" / "configs"
HOSTILE = "</script><b>bold</b><!--\"'&{{ 7*7 }}"
WEBP = b"RIFF"


def stubs(of: ReportData) -> ReportPictures:
    """A picture for each cell, told apart by its bytes; the page never decodes them."""
    names = [*of.truths, *(cell.picture for cell in of.cells)]
    return ReportPictures({name: WEBP + name.encode() for name in names if name}, {})


def page_of(of: ReportData) -> str:
    return render_report(of, stubs(of))


@cache
def sample_page() -> str:
    return page_of(SAMPLE.sample_report())


def cell_at(of: ReportData, level: int, sensor: str, camera: str) -> ReportCell:
    group = of.by_group[[each.name for each in of.sensors].index(sensor)]
    return next(c for c in group if (c.level, c.camera) == (level, camera))


TAG = re.compile(r"<([a-z][a-z0-9]*)\b((?:[^<>\"']|\"[^\"]*\"|'[^']*')*)>")


def tags(page: str) -> list[tuple[str, str]]:
    """Names of the page's tags, each with its attributes as they are written."""
    return TAG.findall(re.sub(r"<(script|style)\b[^>]*>.*?</\1>", r"<\1></\1>", page, flags=re.DOTALL))


def scripts(page: str) -> list[str]:
    """The page's data and its program."""
    return re.findall(r"<script\b[^>]*>(.*?)</script>", page, re.DOTALL)


def rows_of(page: str) -> list[list[str]]:
    """Rows of the tables of all numbers."""
    tables = "".join(re.findall(r'<table class="cells">(.*?)</table>', page, re.DOTALL))
    rows = re.findall(r"<tr\b[^>]*>(.*?)</tr>", tables, re.DOTALL)
    cells = (re.findall(r"<t[hd]\b[^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in rows)
    return [[unescape(re.sub(r"<[^>]*>", "", cell)) for cell in row] for row in cells]


@pytest.mark.thorough
def test_page_refers_to_nothing_outside() -> None:
    page = sample_page()
    address = re.compile(r"\b(?:src|href|srcset|action|data|poster|xlink:href)=[\"'](?!data:|#)")
    assert [tag for tag in tags(page) if address.search(tag[1])] == []
    page = re.sub(r"data:image/[^\"]*", "", page)
    assert "url(" not in page
    assert "@import" not in page
    assert re.search(r"(?:https?:)?//[a-z]", page, re.IGNORECASE) is None


def test_policy_holds_the_scripts_hash() -> None:
    page = sample_page()
    data, script = scripts(page)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    metas = [unescape(attributes) for tag, attributes in tags(page) if tag == "meta"]
    # the policy comes before all that it is to hold for, but the characters' encoding
    assert "http-equiv" in metas[1]
    assert policy in metas[1]
    assert len(json.loads(data)["cells"]) == 28
    assert [tag for tag in tags(page) if re.search(r"\son\w+=", tag[1])] == [], "no inline handlers"


def _poison(value: Any) -> Any:
    """Put the hostile text into every string but numbers' JSON and the balance, whose words choose what is said."""
    if isinstance(value, str):
        return value + HOSTILE
    if isinstance(value, tuple):
        return tuple(_poison(item) for item in value)
    if isinstance(value, dict):
        return {key: _poison(item) for key, item in value.items()}
    if is_dataclass(value):
        kept = ("balance", "mean_electrons", "config")
        own = {field.name: getattr(value, field.name) for field in fields(value)}
        poisoned = {name: item if name in kept else _poison(item) for name, item in own.items()}
        return type(value)(**poisoned)
    return value


@pytest.mark.thorough
def test_hostile_text_stays_text_everywhere() -> None:
    clean = SAMPLE.sample_report()
    poisoned = replace(_poison(clean), exposures=clean.exposures, spectra=clean.spectra)
    page, other = page_of(clean), page_of(poisoned)
    assert [tag for tag, _ in tags(other)] == [tag for tag, _ in tags(page)]
    assert "<b>bold" not in other
    assert json.loads(scripts(other)[0])["levels"][0][0]["name"] == "moonlight" + HOSTILE
    assert scripts(other)[1] == scripts(page)[1]
    assert unescape(other).count(HOSTILE) > 100
    # Names of channels and of the environment's entries are keys, not values.
    electrons, balance = json.dumps({HOSTILE: 1.0}), json.dumps({HOSTILE: "calibrated"})
    keyed = SAMPLE.sample_report(
        lambda row: replace(row, mean_electrons=electrons, balance=balance), environment={HOSTILE: "1"}
    )
    assert "<b>bold" not in page_of(keyed)


def test_every_cell_stands_in_the_table() -> None:
    of, rows = SAMPLE.sample_report(), rows_of(sample_page())
    per_table = 1 + 7 * len(of.cameras)
    assert len(rows) == per_table * len(of.sensors)
    for start, sensor in zip(range(0, len(rows), per_table), of.sensors, strict=True):
        places = [(level, camera) for level in range(7) for camera in of.cameras]
        for row, (level, camera) in zip(rows[start + 1 : start + per_table], places, strict=True):
            cell = cell_at(of, level, sensor.name, camera)
            assert row[0] == of.levels[level].name
            assert row[2] == text.camera_name(camera)
            assert row[3] == f"{cell.mean('psnr_db'):.1f}"
            assert row[4] == f"{cell.mean('ssim'):.3f}"


@pytest.mark.thorough
def test_unknown_numbers_become_dashes() -> None:
    def some_unknown(row: Row) -> Row | None:
        if (row.sensor, row.processor) != ("low_noise", "bayer"):
            return row
        odd = {"street light": float("nan"), "living room": float("inf")}
        return None if row.level == "moonlight" else replace(row, psnr_db=odd.get(row.level, row.psnr_db))

    of = SAMPLE.sample_report(some_unknown, notes=())
    page = page_of(of)
    row = rows_of(page)[1 + 14 + 1 + 1]
    assert row[2] == "Bayer (bilinear)"
    assert set(row[3:16]) == {"—"}
    assert "NaN" not in scripts(page)[0]
    assert "Infinity" not in scripts(page)[0]
    for fault in ("nan", "None"):
        assert re.search(rf"\b{fault}\b", unescape(re.sub(r"base64,[^\"]*", "", page_of(of)))) is None


@pytest.mark.thorough
def test_error_budget_holds_each_picture_s_share_and_what_is_left_out() -> None:
    of = SAMPLE.sample_report(left_out=("veiling glare: each per cent adds 1 %", "aberrations"))
    page = unescape(page_of(of))
    budget = page[page.index('<table class="cells budget">') : page.index('<details class="part" id="speed"')]
    cells = "<t[hd][^>]*>([^<]*)</t[hd]>"
    rows = [re.findall(cells, row) for row in re.findall(r"<tr>(.*?)</tr>", budget, re.DOTALL)]
    for sensor, start in zip(of.sensors, (0, 8), strict=True):
        assert rows[start] == ["Level", "RGBW (interleaved)", "Bayer (bilinear)"]
        for row, level in zip(rows[start + 1 : start + 8], range(7), strict=True):
            shares = [text.percent(cell_at(of, level, sensor.name, camera).mean("mc_share")) for camera in of.cameras]
            assert row == [of.levels[level].name, *shares]
    over = sum(cell.mean("mc_share") > 0.03 for cell in of.cells)
    assert budget.count('class="n over') == over > 0
    assert "<dt>veiling glare</dt><dd>each per cent adds 1 %</dd>" in budget
    assert "<dt>aberrations</dt><dd>—</dd>" in budget


KNOWN = {
    "psnr_db": 21.26, "ssim": 0.71649, "delta_e_median": 3.14, "delta_e_p95": 14.16, "s_cielab_median": 2.72,
    "s_cielab_p95": 12.18, "flip_mean": 0.12349, "pu21_psnr_db": 31.07, "mtf50_cy_per_px": 0.2346,
    "chart_delta_e_mean": 6.78, "patch_snr_db": 18.24, "snr_db": 12.34, "exposure_s": 0.0125, "saturated": 0.012,
    "mc_share": 0.025, "capture_s": 0.021, "develop_s": 1.5, "substitution": 1, "spp": 64.0,
    "mean_electrons": json.dumps({"R": 12.34, "W": 1234.5}), "balance": json.dumps({"R": "calibrated", "G": "given"}),
}  # fmt: skip


def test_every_number_of_a_row_stands_in_the_table_with_its_factor_and_unit() -> None:
    """Written once more by hand, of a row whose numbers are all different."""
    of = SAMPLE.sample_report(lambda row: replace(row, **KNOWN), levels=3, sensors=SAMPLE.SENSORS[:1])
    head, *rows = rows_of(page_of(of))
    plain = [cell.replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ") for cell in rows[4]]
    assert list(zip(head, plain, strict=True)) == [
        ("Level", "living room"), ("Luminance", "8 cd/m²"), ("Camera", "RGBW (interleaved)"), ("PSNR dB", "21.3"),
        ("SSIM", "0.716"), ("ΔE2000, median", "3.1"), ("ΔE2000, 95 %", "14.2"), ("S-CIELAB, median", "2.7"),
        ("S-CIELAB, 95 %", "12.2"), ("FLIP", "0.123"), ("PU21-PSNR dB", "31.1"), ("MTF50 cy/px", "0.235"),
        ("ΔE2000 of the chart", "6.8"), ("SNR of the patches dB", "18.2"), ("Green SNR", "12.3 dB"),
        ("Exposure", "12.5 ms"), ("Saturated", "1.2 %"), ("Render's noise", "2.5 %"), ("Substitution", "on"),
        ("White balance", "calibrated for R"), ("Mean electrons", "R 12.3 W 1 230"), ("Capture", "21 ms"),
        ("Develop", "1.5 s"),
    ]  # fmt: skip


@pytest.mark.thorough
def test_the_set_up_has_the_numbers_of_sensor_light_scene_and_time() -> None:
    low_noise = SAMPLE.SENSORS[1].config
    assert low_noise is not None
    pixel = replace(low_noise.pixel, read_noise_e=1.5, dsnu_e=0.8, prnu=0.0123, full_well_e=15_000.0, pitch_um=2.2)
    chip = replace(low_noise, pixel=pixel, lens=replace(low_noise.lens, f_number=2.8), bits=14)
    of = SAMPLE.sample_report(
        scenes=(replace(SAMPLE.sample_report(levels=1).scenes[0], width=96, height=64),),
        sensors=SAMPLE.SENSORS[1:],
        stages={"render": 30.0, "metrics": 10.0},
    )
    page = unescape(page_of(replace(of, sensors=(replace(of.sensors[0], config=chip),))))
    page = page.replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ")
    for words in (
        "Read noise 1.5 e⁻, DSNU 0.8 e⁻, PRNU 1.2 %, well 15 000 e⁻, 2.2 µm pixels, f/2.8, 14 bits.",
        "<dt>moonlight</dt><dd>0.036 cd/m² · 0.21 lux on the scene's reference plane. Parmar",
        "<dt>daylight</dt><dd>5 000 cd/m² · 31 000 lux on",
        "still_life, 96 × 64 pixels",
        "it has the render's noise alone, 3.1 % of its light",
        'aria-label="75.0 per cent"><rect width="75.0" height="10"/></svg></td><td class="n">30 s</td>',
        'aria-label="25.0 per cent"><rect width="25.0" height="10"/></svg></td><td class="n">10 s</td>',
        '<th scope="row">Together</th><td></td><td class="n">40 s</td>',
    ):
        assert words in page, words
    data = json.loads(scripts(page_of(of))[0])
    assert data["sizes"] == [[64, 96]], "height, width"
    assert data["cells"][0]["x"] == 0.036


@pytest.mark.thorough
def test_seeds_and_exposures_stand_in_the_page() -> None:
    of = SAMPLE.sample_axes()
    page = unescape(page_of(of)).replace("\N{NO-BREAK SPACE}", " ")
    data = json.loads(scripts(page_of(of))[0])
    assert data["axes"][3] == {"name": "Exposure", "values": ["automatic", "10\N{NO-BREAK SPACE}ms"]}
    assert len(data["cells"]) == 2 * 3 * 2, "one a picture, not one a seed"
    psnr_db = SAMPLE.sample_row(0, 0, "interleaved").psnr_db - 3.0
    # Deviation 0.1 dB over 3 seeds: Student's 95 % interval is 4.3027 x 0.1 / sqrt(3) = 0.248 dB wide to each side.
    assert data["cells"][6]["figures"]["psnr_db"] == pytest.approx([psnr_db, 4.3027 * 0.1 / 3**0.5], rel=1e-4)
    assert page.count("<summary>10 ms</summary>") == 3, "budget, pictures, numbers"
    found = rows_of(page_of(of))[1 + 3 * 2 + 1][3].replace("\N{NO-BREAK SPACE}", " ")
    assert found == f"{psnr_db:.1f} ± 0.2"
    assert "over 3 seeds" in page
    assert "seeds 5, 6, 7" in page


def test_one_seed_calls_nothing_ahead_and_says_so() -> None:
    page = sample_page()
    assert "±" not in page.split("<main>")[1].split("<script")[0]
    assert "One seed (0)" in page


def test_the_same_method_on_both_mosaics_leads_the_page_under_the_studys_own_title() -> None:
    four = ("interleaved", "bayer", "ple_rgbw", "ple_bayer")
    page = page_of(SAMPLE.sample_report(cameras=four, seeds=(0, 1)))
    assert "<h1>What is seen?</h1>" in page
    assert '<b data-name="A">RGBW (PLE)</b> beside <b data-name="B">Bayer (PLE)</b>' in page
    assert read_study(CONFIGS / "demo.toml").title == "What does the white pixel bring?"


@pytest.mark.thorough
def test_a_camera_without_an_infrared_filter_has_a_page() -> None:
    seeing = replace(SAMPLE.SENSORS[1].config, window_nm=(380.0, 1068.0))
    sensors = (SAMPLE.SENSORS[0], replace(SAMPLE.SENSORS[1], config=seeing))
    page = page_of(replace(SAMPLE.sample_report(seeds=(0, 1)), sensors=sensors))
    plots = [b64decode(code).decode() for code in re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)]
    (snr,) = [plot for plot in plots if "SNR" in plot]
    assert "table1_output" in snr
    assert "low_noise" not in snr


@pytest.mark.thorough
def test_every_metric_is_explained() -> None:
    assert set(figures.MEANINGS) == {metric.key for metric in figures.METRICS}
    page = unescape(sample_page())
    assert "by moonlight it sees so little that even a picture full of noise gets some 45 dB" in page


@pytest.mark.thorough
def test_the_largest_share_of_the_renders_noise_is_told_once() -> None:
    of = SAMPLE.sample_report(lambda row: replace(row, mc_share=0.052 if row.level == "office" else 0.03))
    page = unescape(page_of(of)).replace("\N{NO-BREAK SPACE}", " ")
    assert page.count("at most 5.2 % (office, table1_output, RGBW (interleaved))") == 1
    assert "Up to 3 % it doesn't show" in page


def test_numbers_in_sentences_are_recounted_from_the_rows() -> None:
    """Of rows whose render has more noise than the sensor, by a plan; of a study in which nothing competes."""
    shares = {"office": (1.5, 0.004), "daylight": (3.25, 0.021)}

    def noisy(row: Row) -> Row:
        mc_share, budget_share = shares.get(row.level, (0.5, 0.002))
        return replace(row, mc_share=mc_share, budget_share=budget_share, spp=64)

    of = SAMPLE.sample_report(noisy)
    page = unescape(page_of(of)).replace("\N{NO-BREAK SPACE}", " ")
    over = sum(row.mc_share >= 1 for cell in of.cells for row in cell.rows if row)
    assert re.search(
        rf"The render's noise has 3\.2 times .*\(daylight, .*; above the sensor's in {over} of 28 pictures\)", page
    )
    assert "The plan of this sweep expects at most 2.1 % of all approximations together." in page
    for metric in (figures.PSNR, figures.FLIP):
        assert f"Seen from {metric.threshold}{' dB' if metric.unit else ''} on." in page
    alone = SAMPLE.sample_report(levels=3, cameras=("bayer",), sensors=SAMPLE.SENSORS[:1])
    dark, bright = (alone.cells[place].rows[0].psnr_db for place in (0, 2))  # type: ignore[union-attr]
    names = [level.name for level in alone.levels]
    said = f"PSNR {dark:.1f} dB at {names[0]} to {bright:.1f} dB at {names[-1]}."
    assert said in unescape(page_of(alone)).replace("\N{NO-BREAK SPACE}", " ")


# Speed: what cameras and renders cost.


def test_seconds_are_means_over_the_pictures_of_a_camera_and_a_sensor() -> None:
    def slower(row: Row) -> Row | None:
        """Seven levels of 0.11 s, of the second sensor one of 0.81 s; and Bayer's first picture isn't made yet."""
        if (row.processor, row.level) == ("bayer", "moonlight"):
            return None
        long = (row.processor, row.sensor, row.level) == ("interleaved", "low_noise", "office")
        return replace(row, develop_s=row.develop_s + 0.7 * long)

    rows = speed_rows(SAMPLE.sample_report(slower, seeds=(0, 1)))
    assert [row[:2] for row in rows] == [
        (camera, sensor)
        for sensor in ("table1_output", "low_noise")
        for camera in ("RGBW (interleaved)", "Bayer (bilinear)")
    ]
    assert [row[3] for row in rows[::2]] == pytest.approx([0.11, 0.21])
    assert rows[0][2] == pytest.approx(0.021)
    assert isnan(rows[1][3])


def test_each_render_has_its_cost_and_the_worst_share_of_its_pictures() -> None:
    def shared(row: Row) -> Row:
        worst = (row.scene, row.spectrum, row.level, row.processor) == ("still_life", "own", "moonlight", "bayer")
        return replace(row, mc_share=0.5 if worst else 0.01 if row.scene == "still_life" else 0.02)

    scenes = SAMPLE.sample_views().scenes
    report = SAMPLE.sample_report(shared, 2, scenes=scenes, spectra=("own", "A"), truths=(None,) * 4)
    pictures = ReportPictures({cell.picture: b"RIFF" for cell in report.cells if cell.picture}, {})
    page = unescape(render_report(report, pictures)).replace("\N{NO-BREAK SPACE}", " ")
    table = page[page.index('id="renders-h"') : page.index('id="time-h"')]
    found = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)[1:]]
    assert [row[0] for row in found] == ["still_life", "color_checker"]
    for row, share in zip(found, ("50 %", "2 %"), strict=True):
        assert row[1:] == ["path + specfilm", "256", "time", "40", "41.2 s", "3.1 %", share]


# The report's cells: means and intervals over seeds.


def cell_of(*rows: Row | None) -> ReportCell:
    return ReportCell(1, "interleaved", 8.0, None, rows, None)


def made(seed: int = 0, **values: Any) -> Row:
    return SAMPLE.sample_row(1, 0, "interleaved", seed, **values)


def test_two_seeds_give_mean_and_student_s_interval() -> None:
    cell = cell_of(made(psnr_db=20.0, ssim=1.0), made(1, psnr_db=21.0, ssim=1.0))
    # n = 2: s / sqrt(2) = 0.5, and t of one degree of freedom at 97.5 % is tan(0.475 pi) = 12.7062 (the Cauchy law).
    assert (cell.mean("psnr_db"), cell.half("psnr_db")) == pytest.approx((20.5, 6.3531), abs=1e-4)
    assert (cell.mean("ssim"), cell.half("ssim")) == (1.0, 0.0)
    assert text.figure_text(cell, "psnr_db", 1, "dB").replace("\N{NO-BREAK SPACE}", " ") == "20.5 ± 6.4 dB"


def test_a_figure_that_is_unknown_for_a_seed_is_unknown() -> None:
    for rows in [
        (made(psnr_db=None), made(1)),
        (made(), made(1, psnr_db=float("inf"))),
        (made(), None),
        (None, made(1)),
        (None, None),
    ]:
        cell = cell_of(*rows)
        assert isnan(cell.mean("psnr_db")), rows
        assert isnan(cell.half("psnr_db")), rows
        assert text.figure_text(cell, "psnr_db", 1, "dB") == "—", rows


def test_decisions_of_all_seeds_count() -> None:
    balances = [{"R": "gray world", "G": "gray world", "B": "calibrated" if seed == 2 else "gray world"}
                for seed in range(4)]  # fmt: skip
    rows = [made(seed, substitution=int(seed < 3), balance=json.dumps(balances[seed])) for seed in range(4)]
    assert cell_of(*rows).substitution == 0.75
    assert cell_of(*rows).balance == {"R": "gray world", "G": "gray world", "B": "calibrated"}
    assert cell_of(rows[0], None).substitution is None


def test_a_study_names_the_pair_that_its_report_opens_on() -> None:
    report = SAMPLE.sample_report(cameras=("interleaved_paper", "ple_rgbw", "ple_bayer", "bayer"))
    assert (first_comparison(report).a, first_comparison(report).b) == (1, 2)
    named = replace(report, compare=("interleaved_paper", "bayer"))
    assert (first_comparison(named).a, first_comparison(named).b) == (0, 3)


def test_light_has_the_unit_that_the_studys_levels_have() -> None:
    report = SAMPLE.sample_report()
    assert viewer_data(report, group_views(report))["light"] == {"key": "x", "name": "scene luminance, cd/m²"}
    in_lux = replace(report, levels=tuple(replace(level, name=f"{at} lux") for at, level in enumerate(report.levels)))
    data = viewer_data(in_lux, group_views(in_lux))
    assert data["light"] == {"key": "lux", "name": "illuminance, lux"}
    assert [cell["lux"] for cell in data["cells"]] == [cell.illuminance_lux for cell in in_lux.cells]


def test_the_pages_script_is_told_each_cells_own_figures_and_light() -> None:
    """Counted again from the rows: means of three seeds, Student's interval (4.303 s / sqrt 3), light in both units."""
    of = SAMPLE.sample_axes()
    data = viewer_data(of, group_views(of))
    keys = [metric["key"] for metric in data["metrics"]]
    assert keys[:2] == ["psnr_db", "ssim"]
    places = [(exposure, level, camera) for exposure in range(2) for level in range(3) for camera in of.cameras]
    for shown, cell, (exposure, level, camera) in zip(data["cells"], of.cells, places, strict=True):
        assert (cell.first.exposure, cell.first.level, cell.camera) == (
            ("auto", "10ms")[exposure],
            SAMPLE.LEVELS[level][0],
            camera,
        )
        assert (shown["x"], shown["lux"]) == SAMPLE.LEVELS[level][1:3]
        for key in keys:
            values = [getattr(row, key) for row in cell.rows]
            mean = sum(values) / 3
            deviation = (sum((x - mean) ** 2 for x in values) / 2) ** 0.5
            assert shown["figures"][key][0] == pytest.approx(mean, rel=1e-6), key
            assert shown["figures"][key][1] == pytest.approx(4.303 * deviation / 3**0.5, rel=1e-3, abs=1e-9), key
        assert shown["file"] == f"pictures/{cell.rows[0].picture}"
        assert shown["over"] == (cell.rows[0].mc_share > 0.03)
    levels = data["levels"][0]
    assert [level["name"] for level in levels] == [name for name, *_ in SAMPLE.LEVELS[:3]]
    for level, (_, cd_m2, lux, source) in zip(levels, SAMPLE.LEVELS, strict=False):
        plain = level["light"].replace("\N{NO-BREAK SPACE}", " ")
        assert plain == f"{cd_m2:g} cd/m² · {lux:g} lux on the scene's reference plane"
        assert level["source"] == source
    assert data["sizes"] == [[64, 64]]


def test_each_view_of_several_scenes_has_its_own_levels_and_cells() -> None:
    of = SAMPLE.sample_views()
    data = viewer_data(of, group_views(of))
    assert len(data["levels"]) == len(of.truths) == 4
    assert [shown["figures"]["psnr_db"][0] for shown in data["cells"]] == [cell.mean("psnr_db") for cell in of.cells]
    assert len({shown["figures"]["psnr_db"][0] for shown in data["cells"]}) == len(of.cells)
    assert data["sizes"] == [[64, 64], [48, 96]]
    assert [view.first for view in group_views(of)] == [4 * index for index in range(8)]
    assert [view.truth for view in group_views(of)] == [0, 0, 1, 1, 2, 2, 3, 3]
