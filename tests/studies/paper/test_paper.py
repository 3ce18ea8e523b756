"""The paper's command, small: figures as files, one page, claims with verdicts; and in full, where there is time."""

import csv
import json
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from command_line import call, check_refusals
from PIL import Image

from sensor.curves import rgbw
from studies.metrics.truth import named_light
from studies.paper import best_exposure, light_levels
from studies.paper.claims import at_least, value_text, within
from studies.paper.figure2 import figure_2
from studies.paper.numbers import moonlight_photons
from studies.paper.paper import Paper, make, write
from studies.paper.patches import edge_columns
from studies.paper.pixel_size import gain_db
from studies.paper.setup import READINGS, Setup, noise, table1_sensor
from studies.photograph.snr import channel_e

FIGURES = ["1a", "1b", "2", "3", "4", "5", "6", "A", "B"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("paper")


@pytest.fixture(scope="module")
def fewer() -> Iterator[None]:
    """Six levels of light for Figures A and B in place of 40 and 4, and three times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(light_levels, "LEVELS_CD_M2", np.geomspace(1e-3, 1e3, 6))
        patch.setattr(best_exposure, "LEVELS_CD_M2", (4.0, 16.0))
        patch.setattr(best_exposure, "TIMES_S", np.array([0.005, 0.02, 0.08]))
        yield


@pytest.fixture(scope="module")
def paper(folder: Path, fewer: None) -> Paper:
    made = make(Setup(folder, size=24, spp=4, band_nm=100.0, seeds=2))
    write(made, folder)
    return made


@pytest.mark.thorough
def test_every_figure_is_written_as_svg_and_png(paper: Paper, folder: Path) -> None:
    assert [figure.name for figure in paper.figures] == FIGURES
    for name in FIGURES:
        svg = (folder / f"figure_{name}.svg").read_text("utf-8")
        assert svg.lstrip().startswith("<svg")
        assert svg.count("<image") == svg.count("data:image/png;base64,")
        assert set(re.findall(r"https?://[^\"]*", svg)) == {
            "http://www.w3.org/2000/svg",
            "http://www.w3.org/1999/xlink",
        }
        with Image.open(folder / f"figure_{name}.png") as picture:
            assert np.asarray(picture.convert("L")).std() > 5  # not blank


@pytest.mark.thorough
def test_page_is_self_contained_and_names_every_claim_with_its_verdict(paper: Paper, folder: Path) -> None:
    page = (folder / "paper.html").read_text("utf-8")
    assert "default-src 'none'; img-src data:; style-src 'unsafe-inline'" in page
    assert "<script" not in page
    held = json.loads((folder / "paper.json").read_text("utf-8"))
    assert [claim["verdict"] for claim in held["claims"]] == [claim.verdict for claim in paper.claims]
    for claim in paper.claims:
        assert claim.verdict.capitalize() in page


@pytest.mark.thorough
def test_claims_cover_the_figures_the_table_and_both_readings(paper: Paper) -> None:
    assert len(paper.claims) == 35  # and as many rows in test_claims.py: a new claim needs one there
    places = {claim.where for claim in paper.claims}
    assert places >= {"Table 1", *(f"Figure {name}" for name in FIGURES if name.islower() or name.isdigit())}
    for claim in paper.claims:
        conditions = [check.condition for check in claim.checks]
        assert len(set(conditions)) == len(conditions) > 0, claim.text
    told = " ".join(check.condition for claim in paper.claims for check in claim.checks)
    assert all(reading in told for reading in READINGS)


@pytest.mark.thorough
def test_table_has_a_row_for_each_check_under_its_claims_number(paper: Paper, folder: Path) -> None:
    with (folder / "paper.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    numbered = [(str(number), claim, check) for number, claim in enumerate(paper.claims, 1) for check in claim.checks]
    for row, (number, claim, check) in zip(rows, numbered, strict=True):
        assert (row["number"], row["claim"], row["verdict"]) == (number, claim.text, claim.verdict)
        assert (row["condition"], row["check"]) == (check.condition, "holds" if check.holds else "fails")


def number(words: str) -> float:
    """The first number of a text as pages write it."""
    return float(
        re.sub(r"[\N{NARROW NO-BREAK SPACE}]", "", words).replace("\N{MINUS SIGN}", "-").replace("∞", "inf").split()[0]
    )


@pytest.mark.thorough
def test_every_number_of_the_page_and_the_table_is_recounted_from_the_checks(paper: Paper, folder: Path) -> None:
    page = (folder / "paper.html").read_text("utf-8")
    cells = r'<tr><th scope="row">([^<]*)</th><td class="n">([^<]*)(?:<span class="note">([^<]*)</span>)?</td>'
    cells += r'<td class="range">([^<]*)</td><td class="sign \w+">([^<]*)</td></tr>'
    rows = [[unescape(cell) for cell in row] for row in re.findall(cells, page)]
    checks = [check for claim in paper.claims for check in claim.checks]
    for (condition, value, default, span, sign), check in zip(rows, checks, strict=True):
        shown, margin = f"{value} ".split("±") if "±" in value else (value, "0")
        assert condition == check.condition
        assert number(shown) == pytest.approx(check.value, rel=5.1e-3), condition
        assert number(margin) == pytest.approx(check.margin, rel=0.051), condition
        assert value.endswith(check.unit), condition
        assert (number(default.removeprefix("default: ")) if default else None) == (
            check.default if check.default is None else pytest.approx(check.default, rel=5.1e-3)
        ), condition
        ends = [float("-inf"), float("inf")]
        for word, places in (("at least", [0]), ("at most", [1]), ("exactly", [0, 1])):
            if span.startswith(word):
                for place in places:
                    ends[place] = number(span.removeprefix(word))
        if " to " in span:
            ends = [number(end) for end in span.split(" to ")]
        assert ends == pytest.approx([check.low, check.high], rel=5.1e-4), condition
        inside = check.low <= check.value - check.margin and check.value + check.margin <= check.high
        assert sign == ("✓ holds" if inside and np.isfinite(check.value) else "✗ fails"), condition
    held = [[check.holds for check in claim.checks] for claim in paper.claims]
    counts = [sum(map(all, held)), sum(any(one) and not all(one) for one in held), sum(not any(one) for one in held)]
    words = "{} reproduced, {} reproduced under a condition, {} not reproduced.".format(*counts)
    assert f"Of {len(held)} claims: {words}" in page


@pytest.mark.thorough
def test_the_lines_of_the_figures_are_recounted_from_the_claims(paper: Paper) -> None:
    axes = {
        (figure.name, one.get_title("left")): [line.get_ydata() for line in one.lines]
        for figure in paper.figures
        for one in figure.drawing.axes
    }
    checks = {claim.text: [check.value for check in claim.checks] for claim in paper.claims}
    notes = {claim.text: claim.note for claim in paper.claims}
    with_white, without_white, _ = axes["A", "PSNR, dB"]
    for gain in checks["W makes the picture better, at no level worse"]:
        assert np.abs(with_white - without_white - gain).min() < 1e-9
    similarity, _, full = axes["A", "W's part, share"]
    assert [similarity[0], similarity[-1]] == pytest.approx(
        checks["W's part in the picture falls smoothly as light grows"][2:]
    )
    assert full[0] == 0 < full[-1]
    bayer_ms, ours_ms, _ = axes["B", "Best time by hand, ms"]
    shorter = "By hand, W's light allows a shorter exposure than Bayer's"
    told = re.findall(r"([\d.]+) and ([\d.]+) ms", notes[shorter])
    assert np.transpose([bayer_ms, ours_ms]) == pytest.approx(np.array(told, float), rel=5.1e-3)
    assert np.log2(np.divide(bayer_ms, ours_ms)) == pytest.approx(checks[shorter], abs=0.1)
    bayer_db, ours_db, _ = axes["B", "PSNR at the best time, dB"]
    better = checks["By hand, the picture at the best time is better than Bayer's at its own"]
    assert np.subtract(ours_db, bayer_db) == pytest.approx(better)


@pytest.mark.thorough
def test_the_curves_and_gains_of_figure_2_are_recounted_from_curves_and_data_sheets(paper: Paper) -> None:
    (drawing,) = (figure.drawing for figure in paper.figures if figure.name == "2")
    axes = {one.get_title("left"): one.lines for one in drawing.axes}
    for letter, line in zip("RGBW", axes["Responses, electrons per photon"], strict=True):
        curve = rgbw().curves[letter]
        expected = np.interp(line.get_xdata(), curve.wavelength_nm, curve.values)
        np.testing.assert_allclose(line.get_ydata(), expected, atol=0.01)  # a mean over 2 nm
    *gains, root = axes["W's SNR over G's, one pixel"]
    for name, line in zip((*READINGS, "low_noise"), gains, strict=True):
        pixel = table1_sensor(name).pixel
        lit_e = channel_e(table1_sensor(name), named_light("D65"), 1.0, 0.02)
        electrons = np.multiply.outer(line.get_xdata(), lit_e[[1, 3]])
        dark_e2 = pixel.read_noise_e**2 + pixel.dsnu_e**2 + table1_sensor(name).gain_e_per_dn ** 2 / 12
        ratio = electrons / np.sqrt(electrons + dark_e2 + (pixel.prnu * electrons) ** 2)
        np.testing.assert_allclose(line.get_ydata(), ratio[:, 1] / ratio[:, 0], rtol=1e-9)
        np.testing.assert_allclose(root.get_ydata(), np.sqrt(lit_e[3] / lit_e[1]), rtol=1e-9)


@pytest.mark.thorough
def test_another_run_takes_up_the_renders_and_gives_the_same_numbers(paper, folder, monkeypatch):
    monkeypatch.setattr("render.engine._render", lambda *_, **__: pytest.fail("rendered again"))
    again = make(Setup(folder, size=24, spp=4, band_nm=100.0, seeds=2))
    assert again.claims == paper.claims


@pytest.mark.thorough
def test_failed_write_leaves_no_file(paper: Paper, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Path.write_bytes

    def full_disk(path: Path, data: bytes) -> int:
        if path.suffix == ".html":
            raise OSError(28, "No space left on device", str(path))
        return real(path, data)

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write(paper, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_bad_numbers_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    rows = (("--size 4", "size: "), ("--spp 0", "spp: "), ("--seeds 1", "seeds: "))
    check_refusals(f"paper -o {tmp_path / 'out'}", rows, tmp_path)


def test_readings_keep_table_1s_own_noise_behind_other_pixels() -> None:
    assert table1_sensor("table1_pixel", pitch_um=3).pixel.read_noise_e == pytest.approx(4580 / 30)
    assert table1_sensor("table1_output", pitch_um=3).pixel.read_noise_e == pytest.approx(4580 / 30 / 7.98)
    assert table1_sensor("table1_pixel", pitch_um=3).pixel.full_well_e == pytest.approx(15_000 * (3 / 2.2) ** 2)


def test_numbers_of_the_paper_in_closed_form() -> None:
    assert moonlight_photons(400, 700) == pytest.approx(9.71, rel=2e-3)
    assert gain_db("table1_output", shot_alone=True) == pytest.approx(9.542425, abs=1e-6)


def test_noise_is_the_standard_deviation_of_luminance_over_exposures() -> None:
    rng = np.random.default_rng(0)
    field = np.linspace(0.1, 0.9, 64 * 64).reshape(64, 64)  # the scene itself is no noise
    pictures = [np.repeat((field + rng.normal(0.0, 0.05, field.shape))[..., None], 3, axis=2) for _ in range(4)]
    # A variance of 3 degrees of freedom over 4096 pixels: relative error of its root 0.64 %; 5 of them.
    assert noise(pictures) == pytest.approx(0.05, rel=0.032)


def test_edge_is_found_at_the_first_bright_column() -> None:
    field = np.ones((3, 10))
    for row, column in enumerate((4, 5, 6)):
        field[row, :column] = 0.25
    np.testing.assert_array_equal(edge_columns(field), [4, 5, 6])


def test_a_number_that_reads_as_its_bound_has_another_digit() -> None:
    # 0.9496 would read 0.95 beside "at least 0.95", and fail: another digit tells why
    assert value_text(*at_least({"": 0.94996}, 0.95)) == "0.94996"
    assert value_text(*within({"": np.array([1.0, 3.0])}, unit="dB")) == "2 ± 13\N{NO-BREAK SPACE}dB"


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_full_command_judges_every_claim(tmp_path: Path) -> None:
    assert call(["paper", "-o", tmp_path])[:2] == (0, f"{tmp_path / 'paper.html'}\n")
    verdicts = {
        claim["claim"]: claim["verdict"] for claim in json.loads((tmp_path / "paper.json").read_text())["claims"]
    }
    assert verdicts["Interleaved is less noisy than Bayer at 5, 10 and 20 ms"] == "reproduced"
    assert verdicts["W replaces the luminance at 5 ms, and not at 10 and 20 ms"] == "reproduced"
    assert verdicts["The voltage swing is what a full well gives"] == "not reproduced"


@pytest.mark.thorough
def test_one_figure_alone_has_its_own_claims_and_no_other(tmp_path: Path) -> None:
    code, out, _ = call(["paper", "--figure", "2", "-o", str(tmp_path)])
    assert (code, out) == (0, f"{tmp_path / 'paper.html'}\n")
    assert sorted(path.name for path in tmp_path.glob("*.svg")) == ["figure_2.svg"]
    claims = json.loads((tmp_path / "paper.json").read_text("utf-8"))["claims"]
    assert [claim["claim"] for claim in claims] == [claim.text for claim in figure_2()[1]]
    assert 'href="#figure-2"' in (tmp_path / "paper.html").read_text("utf-8")
    check_refusals("paper", [("--figure 7 -o new", "figure: ... allowed: 1a, 1b, 2, 3, 4, 5, 6, A, B")], tmp_path)
