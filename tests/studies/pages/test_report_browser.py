"""The report in headless Chromium: what the browser refuses, what the controls change, what is on the screen."""

import csv
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import browser as CHROME
import numpy as np
import pytest
import report_sample as SAMPLE
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab

from studies.metrics import metric as figures
from studies.metrics.flip import flip
from studies.pages import report_text as text
from studies.pages.report import render_report
from studies.pages.report_compare import CAMERA, comparisons, groups_of
from studies.pages.report_data import ReportData
from studies.pages.report_pictures import ReportPictures, opened

pytestmark = CHROME.NEEDED


def written(folder: Path, results: ReportData, pictures: ReportPictures | None = None) -> Path:
    """The page of a report, in a folder."""
    file = folder / "report.html"
    file.write_text(render_report(results, pictures or SAMPLE.sample_pictures(results)), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of made-up results."""
    return written(tmp_path_factory.mktemp("report"), *standard())


@pytest.fixture(scope="module")
def axes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of several exposures and seeds."""
    return written(tmp_path_factory.mktemp("axes"), SAMPLE.sample_axes())


def shown(page: Any) -> dict[str, Any]:
    """Return what the viewer shows and says, once it is drawn; pictures as the colours of their 5th row."""
    value: dict[str, Any] = page.evaluate(
        """(async () => {
             await drawing;
             const [width] = [byId("under").width];
             const row = (id) => {
               const copy = new OffscreenCanvas(width, 1).getContext("2d", {willReadFrequently: true});
               copy.drawImage(byId(id), 0, -5);
               return [...copy.getImageData(0, 0, width, 1).data];
             };
             return {level: byId("level-name").textContent, a: row("over"), b: row("under"),
                     names: [...document.querySelectorAll(".tag")].map((tag) => tag.textContent),
                     psnr: document.querySelector("#numbers td").textContent,
                     spoken: byId("level").getAttribute("aria-valuetext"), status: byId("status").textContent}})()"""
    )
    return value


@cache
def standard() -> tuple[ReportData, ReportPictures]:
    """The report of the fixture `report`, and its pictures."""
    results = SAMPLE.sample_report()
    return results, SAMPLE.sample_pictures(results)


def row_of(results: ReportData, cell: int) -> list[int]:
    """The 5th row of a cell's picture as a canvas gives it."""
    known, pictures = standard()
    files = pictures.files if known.levels == results.levels else SAMPLE.sample_pictures(results).files
    picture = opened(files[results.cells[cell].picture or ""])[5]
    return [int(value) for pixel in picture for value in (*pixel, 255)]


def pick(page: Any, control: str, value: object) -> None:
    """Choose a value of a select or an input."""
    chosen = f"one.value = {value!r}; one.dispatchEvent(new Event('input'))"
    page.evaluate(f"(() => {{ const one = {control}; {chosen} }})()")


@pytest.mark.thorough
def test_it_opens_with_the_wipe_at_512_pixels_where_something_is_seen(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report, height=800)
    results = SAMPLE.sample_report()
    psnr_db = [cell.mean("psnr_db") for cell in results.by_group[0]]
    level = next(index // 2 for index, value in enumerate(psnr_db) if value and value >= 22)
    found = shown(page)
    assert found["level"] == results.levels[level].name
    assert found["a"] == row_of(results, 2 * level)
    assert found["b"] == row_of(results, 2 * level + 1)
    box = page.evaluate("(({top, width}) => [top, width])(byId('stage').getBoundingClientRect())")
    assert box[1] == 512
    assert box[0] + 512 <= 800, "the whole picture is on the first screen"
    ends = page.evaluate("all('.now > *').map((one) => one.getBoundingClientRect().bottom)")
    assert len(ends) == 5
    assert max(ends) - min(ends) < 12, "controls stand in one row"
    page.click("[name=view][value=side]")
    shown(page)
    tops = page.evaluate("all('#side figure').map((one) => one.getBoundingClientRect().top)")
    assert len(tops) > 2
    assert max(tops) == min(tops), "the reference stands in the row of the others"
    assert page.evaluate("document.documentElement.scrollHeight") < 6 * 800


@pytest.mark.thorough
def test_any_two_are_compared_and_the_truth(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    results = SAMPLE.sample_report()
    pick(page, "document.querySelector('[data-axis=\"2\"]')", 1)
    pick(page, "byId('level')", 0)
    pick(page, "byId('b')", "truth")
    found = shown(page)
    assert found["names"] == ["A: RGBW (interleaved)", "B: Reference, 256 samples"]
    assert found["a"] == row_of(results, 14)
    truth = opened(standard()[1].files["truth"])[5]
    assert found["b"] == [int(value) for pixel in truth for value in (*pixel, 255)]
    page.evaluate("document.querySelector('[data-cell=\"27\"]').click()")
    assert shown(page)["level"] == "daylight"
    assert shown(page)["a"] == row_of(results, 27)
    # Sensors in place of cameras: A and B are the two of them now, and the camera is chosen apart.
    pick(page, "byId('compared')", 2)
    assert shown(page)["names"] == ["A: table1_output", "B: low_noise"]
    assert page.evaluate("document.querySelector('[data-axis=\"2\"]').closest('label').hidden") is True
    assert CHROME.complaints(page) == []


@pytest.mark.thorough
def test_loupe_and_pixel_values_are_those_of_the_picture(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report, height=800)
    results = SAMPLE.sample_report()
    pick(page, "byId('level')", 3)
    pick(page, "byId('column')", 100)
    pick(page, "byId('row')", 180)
    shown(page)
    pictures = standard()[1]
    picture, truth = (opened(pictures.files[name]) for name in (results.cells[6].picture or "", "truth"))
    color = page.evaluate("[...byId('loupe-T').getContext('2d').getImageData(0, 0, 1, 1).data].slice(0, 3)")
    assert color == truth[180 - 8, 100 - 16].tolist()
    assert page.evaluate("getComputedStyle(byId('loupe-T')).imageRendering") == "pixelated"
    error = deltaE_ciede2000(rgb2lab(picture[180, 100] / 255), rgb2lab(truth[180, 100] / 255))
    errors = flip(picture / 255, truth / 255)[180, 100]
    red, green, blue = picture[180, 100]
    told = page.evaluate("byId('pixel-A').textContent")
    assert told == f"sRGB {red} {green} {blue} · ΔE2000 {error:.1f} · FLIP {errors:.2f}"
    # The pointer carries it.
    box = page.evaluate("(({left, top}) => [left, top])(byId('stage').getBoundingClientRect())")
    CHROME.drag(page, (box[0] + 21, box[1] + 31), (box[0] + 41, box[1] + 61))
    shown(page)
    assert page.evaluate("[byId('column').value, byId('row').value]") == ["20", "30"], "two screen pixels each"


@pytest.mark.thorough
def test_error_maps_are_ciede2000_and_flip_of_each_pixel(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    results = SAMPLE.sample_report()
    pick(page, "byId('level')", 2)
    pictures = standard()[1]
    picture, truth = (opened(pictures.files[name]) / 255 for name in (results.cells[4].picture or "", "truth"))
    for kind, exact, step in (
        ("delta_e", deltaE_ciede2000(rgb2lab(picture), rgb2lab(truth)), 2e-3),
        ("flip", flip(picture, truth), 0.51 / 255),
    ):
        found = np.array(page.evaluate(f"errorsOf(of.a, '{kind}').then((errors) => [...errors])")).reshape(exact.shape)
        assert np.abs(found - exact).max() < step
        page.evaluate(f"document.querySelector('[name=show][value={kind}]').click()")
        assert shown(page)["a"] != row_of(results, 4)
        assert page.evaluate("byId('key').hidden") is False
        top = page.evaluate(f"MAP_TOP.{kind}")
        colours = page.evaluate(f"[0, {top}, {2 * top}].map((error) => heat(error / {top}))")
        assert colours[0] == [0, 0, 4]
        assert colours[1] == colours[2] == [252, 253, 191]
    assert CHROME.complaints(page) == []


@pytest.mark.thorough
def test_fits_the_window(browser: Any, report: Path, axes: Path) -> None:
    page = CHROME.open_page(browser, axes)  # the figures beside its pictures are wide
    for width in (900, 960, 1040):
        CHROME.show(page, width=width)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    page = CHROME.open_page(browser, report)
    for dark in (False, True):
        for width, height, wide in ((390, 844, 358), (1280, 800, 512), (1920, 1080, 768), (2560, 1440, 1024)):
            CHROME.show(page, width=width, height=height, dark=dark)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate("byId('stage').getBoundingClientRect().width") == pytest.approx(wide, abs=2)
    CHROME.show(page, width=390, height=844)
    assert page.evaluate("document.documentElement.scrollHeight") <= 8 * 844
    page.click(".menu summary")
    box = page.evaluate("(({left, right}) => [left, right])(document.querySelector('.panel').getBoundingClientRect())")
    assert 0 <= box[0] < box[1] <= 390
    hint = "getComputedStyle(document.querySelector('#verdicts .scroll'), '::before').content"
    assert "scrolls sideways" in page.evaluate(hint)
    CHROME.show(page, width=2560)
    assert page.evaluate(hint) == "none"


@cache
def compared() -> ReportData:
    """A report of four cameras, two sensors and three seeds, without pictures in it."""

    def moved(made: Any) -> Any:
        at = [ord(letter) for letter in f"{made.sensor}{made.level}{made.processor}"]
        draw = np.random.default_rng([*at, made.seed]).standard_normal
        known = {
            metric.key: 20 + metric.threshold * (0.4 * (sum(at) % 5) + 0.1 * draw()) for metric in figures.METRICS[:8]
        }
        return replace(made, **known)

    cameras = ("interleaved", "bayer", "ple_rgbw", "ple_bayer")
    results = SAMPLE.sample_report(moved, cameras=cameras, seeds=(0, 1, 2))
    return replace(results, cells=tuple(replace(cell, picture=None) for cell in results.cells))


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of `compared`."""
    return written(tmp_path_factory.mktemp("four"), compared())


@pytest.mark.thorough
def test_the_tables_hold_the_leads_and_signs_turn_with_a_and_b(browser: Any, four: Path) -> None:
    """Outcomes and leads as they were found; with A and B swapped every lead has the other sign."""
    read = "[...document.querySelectorAll('#verdicts tr')].map((row) => [...row.children].map((cell) => [cell.className, cell.textContent.trim()]))"  # noqa: E501
    page = CHROME.open_page(browser, four)
    written = page.evaluate(read)
    assert len(written) == 2 * 9
    metrics = figures.METRICS[:8]
    for group, start in zip(groups_of(compared(), CAMERA, 2, 3), (0, 9), strict=True):
        for metric, row in zip(metrics, written[start + 1 : start + 9], strict=True):
            lead = group.pair.leads[metric.key]
            assert [cell[0].split()[-1] for cell in row[1:]] == lead.outcome.tolist()
            shown = [cell[1].split()[-1] for cell in row[1:]]
            assert shown == [text.lead_text(metric, float(mean)) for mean in lead.mean]
    assert {"ahead", "level", "behind"} <= {cell[0].split()[-1] for row in written for cell in row[1:]}
    pick(page, "byId('a')", 3)
    pick(page, "byId('b')", 2)
    other = {"ahead": "behind", "behind": "ahead", "▲": "▼", "▼": "▲", "+": "−", "−": "+"}
    for before, after in zip(written, page.evaluate(read), strict=True):
        turned = [
            ["".join(other.get(part, part) for part in re.split(r"(ahead|behind|[▲▼+−])", words)) for words in cell]
            for cell in before
        ]
        assert after == (turned if before[1][0] != "n" else before)


@pytest.mark.thorough
def test_a_beside_every_other_has_the_leads_of_every_place_and_counts(browser: Any, four: Path) -> None:
    page, report = CHROME.open_page(browser, four), compared()
    found = comparisons(report)[CAMERA]
    for a in (0, 2):
        pick(page, "byId('a')", a)
        for metric in (figures.PSNR, figures.FLIP):
            pick(page, "byId('beside-metric')", metric.key)
            read = "[...document.querySelectorAll('#beside tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))"  # noqa: E501
            rows = page.evaluate(read)
            assert len(rows) == 3 * 2, "three others, two sensors"
            for index, row in enumerate(rows):
                other, group = [value for value in range(4) if value != a][index // 2], index % 2
                lead = groups_of(report, CAMERA, a, other)[group].pair.leads[metric.key]
                shown = [cell.split()[-1].replace("−", "-") for cell in row[1:8]]
                assert [float(value) for value in shown] == pytest.approx(
                    lead.mean.tolist(), abs=0.51 * 10**-metric.digits
                )
                assert [cell.split(",")[0] for cell in row[1:8]] == lead.outcome.tolist()
                if group == 0:
                    counted = found["counts"][f"{min(a, other)} {max(a, other)}"][metric.key]
                    assert row[8] == " / ".join(map(str, counted if a < other else counted[::-1]))


@pytest.mark.thorough
def test_question_answer_and_first_chart_follow_the_menus(browser: Any, four: Path) -> None:
    page, answers = CHROME.open_page(browser, four), comparisons(compared())
    said = "['place', 'said', 'light', 'times'].map((id) => byId(id).textContent)"
    mark = "document.querySelector('#lead-chart .mark title').textContent"
    for a, b, sensor in ((2, 3, 0), (2, 3, 1), (0, 1, 1), (3, 0, 0)):
        pick(page, "byId('a')", a)
        pick(page, "byId('b')", b)
        pick(page, "document.querySelector('[data-axis=\"2\"]')", sensor)
        of = answers[CAMERA]
        words = of["answers"][f"{a} {b}"][sensor]
        place = ["table1_output", "low_noise"][sensor]
        assert page.evaluate(said) == [place, words["said"], words["light"], words["times"]]
        names = [text.camera_name(compared().cameras[value]) for value in (a, b)]
        assert page.evaluate("document.querySelector('.question').textContent").startswith(" beside ".join(names))
        lead = groups_of(compared(), CAMERA, a, b)[sensor].pair.leads["psnr_db"]
        outcome = str(lead.outcome[0])
        words = text.lead_text(figures.PSNR, float(lead.mean[0]))
        assert page.evaluate(mark) == f"moonlight: {outcome}, {words}"
    assert page.evaluate("document.querySelector('h1').textContent") == "What is seen?"
    # the band of what nobody sees is twice 0.5 dB high
    scale = "(() => { const ticks = [...document.querySelectorAll('#lead-chart .grid')].map((line) => Number(line.getAttribute('y1'))); const texts = [...document.querySelectorAll('#lead-chart text[text-anchor=end]')].map((one) => Number(one.textContent.replace('−', '-'))).filter(Number.isFinite); return (texts[1] - texts[0]) / (ticks[0] - ticks[1]) })()"  # noqa: E501
    height = page.evaluate("Number(document.querySelector('#lead-chart .unseen').getAttribute('height'))")
    assert height * page.evaluate(scale) == pytest.approx(2 * 0.5, rel=1e-6)
    pick(page, "byId('b')", "truth")
    assert page.evaluate(said)[1:3] == ["", ""]
    pick(page, "byId('compared')", 5)
    assert page.evaluate("byId('level-name').textContent") == "moonlight beside street light"
    assert page.evaluate(said)[1] == "", "light levels are no rivals"


# Metrics of which less is better, said once more by hand.
LOWER = {"delta_e_median", "delta_e_p95", "s_cielab_median", "s_cielab_p95", "flip_mean", "chart_delta_e_mean"}


@pytest.mark.thorough
def test_numbers_of_the_pair_and_words_beside_charts_are_recounted_from_the_rows(browser: Any, four: Path) -> None:
    page, report, level = CHROME.open_page(browser, four), compared(), 4
    for control, value in (("a", 3), ("b", 0), ("level", level)):
        pick(page, f"byId('{control}')", value)
    pick(page, "document.querySelector('[data-axis=\"2\"]')", 1)
    ours, theirs = (report.by_group[1][4 * level + camera] for camera in (3, 0))
    read = (
        "[...document.querySelectorAll('#numbers tr')].map((row) => [...row.children].map((cell) => cell.textContent))"
    )
    rows = {row[0]: row[1:] for row in page.evaluate(read)}
    for metric in figures.METRICS[:8]:
        written = rows[f"{metric.name} {metric.unit}" if metric.unit else metric.name]
        a, b, lead = (float(words.split(" ±")[0].split()[-1].replace("−", "-")) for words in written)
        of_a, of_b = (np.mean([getattr(row, metric.key) for row in cell.rows]) for cell in (ours, theirs))
        gain = (of_b - of_a) if metric.key in LOWER else (of_a - of_b)
        assert (a, b, lead) == pytest.approx((of_a, of_b, gain), abs=0.51 * 10**-metric.digits), metric.key
    times = [text.duration_text(cell.first.exposure_s) for cell in (ours, theirs) if cell.first]
    assert rows["Exposure"][:2] == times
    assert rows["Saturated"][:2] == [text.percent(cell.mean("saturated")) for cell in (ours, theirs)]
    said = page.evaluate("byId('status').textContent")
    for cell, name in ((ours, "Bayer (PLE)"), (theirs, "RGBW (interleaved)")):
        assert f"{name} PSNR {cell.mean('psnr_db'):.1f} ± " in said
    better = "[...document.querySelectorAll('#drawn figure')].map((one) => [one.dataset.metric, one.querySelector('small').textContent])"  # noqa: E501
    for key, words in page.evaluate(better):
        assert words == ("lower is better" if key in LOWER else "higher is better"), key
    said = page.evaluate("document.querySelector('#lead figcaption').textContent")
    assert said.endswith("above 0 A is better; grey: not seen"), "beside the chart: labels cross no curve"
    for percent, words in ((100, "Show B"), (0, "Show A")):
        pick(page, "byId('wiper')", percent)
        assert page.evaluate("byId('flip').textContent").startswith(words)
        told = page.evaluate("byId('wiper').getAttribute('aria-valuetext')")
        assert told == f"{percent} % Bayer (PLE), {100 - percent} % RGBW (interleaved)"
    for kind, words in (("delta_e", "20 and more"), ("flip", "0.5 and more")):
        page.evaluate(f"document.querySelector('[name=show][value={kind}]').click()")
        assert page.evaluate("byId('key-top').textContent") == words


@pytest.mark.thorough
def test_the_address_holds_the_view_and_a_point_of_a_chart_its_level(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    page.evaluate("document.querySelectorAll('#lead-chart .mark')[0].dispatchEvent(new Event('click'))")
    assert shown(page)["level"] == SAMPLE.sample_report().levels[0].name
    pick(page, "document.querySelector('[data-axis=\"2\"]')", 1)
    pick(page, "byId('b')", "truth")
    page.evaluate("document.querySelector('[name=show][value=delta_e]').click()")
    sent = page.evaluate("location.href")
    assert "#axis=6&a=0&b=truth&place=" in sent
    other = CHROME.open_page(browser, sent)
    assert shown(other) == shown(page)
    assert other.evaluate("document.querySelector('[name=show]:checked').value") == "delta_e"
    # An address that names what isn't there opens the page as it would be without one.
    plain, strange = (
        shown(CHROME.open_page(browser, report.resolve().as_uri() + end)) for end in ("", "#axis=6&a=9&b=0&place=7.7")
    )
    assert strange == plain


@pytest.mark.thorough
def test_wheel_and_double_click_enlarge_about_the_pointer_and_the_wipe_follows(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    shown(page)
    box = page.evaluate(
        "(({left, top, width, height}) => [left, top, width, height])(byId('stage').getBoundingClientRect())"
    )
    x, y = box[0] + 0.25 * box[2], box[1] + 0.5 * box[3]
    page.mouse.dblclick(x, y)
    assert page.evaluate("getComputedStyle(byId('under')).transform") == "matrix(4, 0, 0, 4, 0, 0)"
    columns = []
    for at in (x, x + 0.25 * box[2]):  # a quarter of the window is a sixteenth of the picture now
        page.mouse.move(at, y)
        columns.append(int(page.evaluate("byId('column').value")))
    width = page.evaluate("byId('under').width")
    assert abs(columns[0] - 0.25 * width) <= 1
    assert abs(columns[1] - columns[0] - width / 16) <= 1
    CHROME.drag(page, (x, y), (x + 0.25 * box[2], y))
    assert abs(page.evaluate("state.wipe") - 31) <= 1
    page.mouse.wheel(0, 500)
    page.mouse.dblclick(x, y)
    page.mouse.wheel(0, -100)
    page.wait_for_function("zoom.factor > 1")
    assert CHROME.complaints(page) == []


@pytest.mark.thorough
def test_what_is_shown_can_be_saved_as_numbers_and_as_a_picture(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    shown(page)
    page.click(".menu summary")
    with page.expect_download() as saved:
        page.click("#save-csv")
    rows = list(csv.DictReader(Path(saved.value.path()).read_text("utf-8").splitlines()))
    results = SAMPLE.sample_report()
    assert len(rows) == len(results.cells)
    for row, cell in zip(rows, results.cells, strict=True):
        assert row["Camera"] == text.camera_name(cell.camera)
        assert row["Light level"] == results.levels[cell.level].name
        mean = cell.mean("psnr_db")
        assert row["psnr_db"] == "" if np.isnan(mean) else abs(float(row["psnr_db"]) - mean) < 1e-4
    with page.expect_download() as saved:
        page.click("#save-png")
    with Image.open(saved.value.path()) as picture:
        assert picture.size == (2 * results.scenes[0].width, results.scenes[0].height)


CHART = """(chart => ({
  ticks: [...chart.querySelectorAll(".grid")].map(line => [+line.getAttribute("y1"),
    Number(line.nextSibling.textContent.replace("−", "-"))]),
  marks: [...chart.querySelectorAll(".slot0 circle")].map(one => [+one.getAttribute("cx"), +one.getAttribute("cy")]),
  band: chart.querySelector(".slot0 .band").getAttribute("d"),
  words: [...chart.querySelectorAll(".slot0 title")].map(one => one.textContent),
}))(document.querySelector(%r))"""


def mean_and_half(samples: list[float]) -> tuple[float, float]:
    """Mean and half of Student's interval of three seeds."""
    return float(np.mean(samples)), 4.30265 * float(np.std(samples, ddof=1)) / 3**0.5


@pytest.mark.thorough
def test_marks_and_bands_of_the_charts_lie_where_the_rows_say(browser: Any, four: Path) -> None:
    """Heights by the ticks' own labels, places by the logarithm of the light: leads, their sign, figures, intervals."""
    page, report = CHROME.open_page(browser, four), compared()
    pick(page, "byId('a')", 0)
    pick(page, "byId('b')", 1)
    light = [cell.luminance_cd_m2 for cell in report.by_group[0][::4]]
    for metric, sign in ((figures.PSNR, 1), (figures.FLIP, -1)):
        pick(page, "byId('lead-metric')", metric.key)
        ours, theirs = ([cell.samples(metric.key) for cell in report.by_group[0][side::4]] for side in (0, 1))
        gains = [[sign * (a - b) for a, b in zip(*pair, strict=True)] for pair in zip(ours, theirs, strict=True)]
        for place, samples in ((f"#drawn [data-metric={metric.key}] svg", ours), ("#lead-chart svg", gains)):
            wanted = np.array([mean_and_half(list(one)) for one in samples])
            drawn = page.evaluate(CHART % place)
            heights, labels = np.transpose(drawn["ticks"])
            to_value = np.polyfit(heights, labels, 1)
            assert to_value[0] < 0, "more is higher"
            x, y = np.transpose(drawn["marks"])
            assert np.polyval(to_value, y) == pytest.approx(wanted[:, 0], abs=1e-3 * np.ptp(labels))
            assert x == pytest.approx(np.polyval(np.polyfit(np.log(light), x, 1), np.log(light)), abs=1e-6)
            assert np.all(np.diff(x) > 0), "darkest left"
            edge = np.polyval(to_value, [float(end.split(" ")[1]) for end in drawn["band"][1:-1].split("L")])
            upper, lower = edge[: len(light)], edge[len(light) :][::-1]
            assert upper == pytest.approx(wanted.sum(axis=1), abs=1e-3 * np.ptp(labels))
            assert lower == pytest.approx(wanted[:, 0] - wanted[:, 1], abs=1e-3 * np.ptp(labels))
    mean, half = mean_and_half(list(report.by_group[0][0].samples("psnr_db")))
    said = page.evaluate(CHART % "#drawn [data-metric=psnr_db] svg")["words"][0]
    assert said.endswith(f": {mean:.1f} ± {half:.1f} dB")


@pytest.mark.thorough
def test_a_study_in_which_nothing_competes_shows_its_camera_beside_the_reference(browser: Any, tmp_path: Path) -> None:
    for levels in (3, 1):
        results = SAMPLE.sample_report(levels=levels, cameras=("bayer",), sensors=SAMPLE.SENSORS[:1])
        page = CHROME.open_page(browser, written(tmp_path, results))
        assert shown(page)["names"] == ["A: Bayer (bilinear)", "B: Reference, 256 samples"]
        assert page.evaluate("document.querySelectorAll('#drawn [data-metric=psnr_db] .mark').length") == levels
        assert page.evaluate("document.querySelector('#lead')") is None
        assert CHROME.complaints(page) == []


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of two scenes under two spectra, of which one condition's pictures are left out."""
    results = SAMPLE.sample_views()
    folder = tmp_path_factory.mktemp("views")
    file = written(folder, results)
    # One of the two that are left out lies beside the page, the other is gone.
    name = results.cells[-2].first.picture  # type: ignore[union-attr]
    (folder / "pictures" / name).parent.mkdir(parents=True)
    Image.new("RGB", (96, 48), (10, 200, 30)).save(folder / "pictures" / name, "PNG")
    return file


@pytest.mark.thorough
def test_choice_of_scene_and_light_changes_pictures_truth_and_numbers(browser: Any, views: Path) -> None:
    page = CHROME.open_page(browser, views)
    pick(page, "byId('level')", 0)
    pick(page, "byId('b')", "truth")
    seen = []
    for scene in range(2):
        for light in range(2):
            pick(page, "document.querySelector('[data-axis=\"0\"]')", scene)
            pick(page, "document.querySelector('[data-axis=\"1\"]')", light)
            found = shown(page)
            seen.append((found["psnr"], tuple(found["a"]), tuple(found["b"])))
    assert [psnr for psnr, _, _ in seen] == ["10.0", "14.0", "18.0", "22.0"]
    assert len({picture for _, picture, _ in seen}) == len({truth for _, _, truth in seen}) == 4
    # The chart's picture is twice as wide as high, and its figure stands on it alone.
    box = page.evaluate("(({width, height}) => [width, height])(byId('stage').getBoundingClientRect())")
    assert box[0] == pytest.approx(2 * box[1], abs=1)
    assert "ΔE2000 of the chart" in page.evaluate("byId('numbers').textContent")
    pick(page, "document.querySelector('[data-axis=\"0\"]')", 0)
    assert "ΔE2000 of the chart" not in page.evaluate("byId('numbers').textContent")
    assert CHROME.complaints(page) == []
    assert CHROME.requests(page) == []


@pytest.mark.thorough
def test_a_picture_left_out_is_shown_from_its_file_or_said_to_be_gone(browser: Any, views: Path) -> None:
    page = CHROME.open_page(browser, views)
    for axis, value in ((0, 1), (1, 1), (2, 1)):
        pick(page, f"document.querySelector('[data-axis=\"{axis}\"]')", value)
    pick(page, "byId('level')", 1)
    found = shown_safely(page)
    assert found["drawn"] == [True, False]
    assert found["gone"].startswith(
        "Not in this page, and its file isn't beside it: pictures/color_checker/A/1/1/bayer"
    )
    assert found["psnr"] == f"{10 + 8 + 4 + 2 + 1:.1f}"
    asked = [address.rpartition("/")[2] for address in CHROME.requests(page)]
    assert set(asked) == {"interleaved", "bayer"}, "nothing but the two pictures"
    pick(page, "byId('level')", 0)
    assert shown_safely(page)["gone"] == ""


def shown_safely(page: Any) -> dict[str, Any]:
    """What is drawn, where a picture from a file can't be read back."""
    value: dict[str, Any] = page.evaluate(
        """(async () => {
             await drawing;
             return {drawn: ["over", "under"].map((id) => !byId(id).hidden), gone: byId("gone").textContent,
                     psnr: document.querySelector("#numbers td").textContent}})()"""
    )
    return value


@pytest.mark.thorough
def test_every_control_has_a_name_for_a_screen_reader(browser: Any, axes: Path) -> None:
    page = CHROME.open_page(browser, axes)
    shown(page)
    page.evaluate("for (const fold of document.querySelectorAll('details')) fold.open = true")
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    # Level, wipe; views and what is shown; compared, A, B, exposure, rows and across; the metrics; column and row.
    wanted = {"slider": 2, "radio": 6, "checkbox": 8, "spinbutton": 2, "button": 3}
    for role, count in wanted.items():
        names = [node["name"]["value"] for node in nodes if node.get("role", {}).get("value") == role]
        assert len(names) == count, (role, names)
        assert all(names), (role, names)
    combos = [node["name"]["value"] for node in nodes if node.get("role", {}).get("value") == "combobox"]
    assert len(combos) >= 4
    assert all(combos)
    pictures = [node for node in nodes if node.get("role", {}).get("value") == "image" and not node["ignored"]]
    assert len(pictures) > 12
    assert all(node["name"]["value"] for node in pictures)


@pytest.mark.thorough
def test_everything_is_reached_by_keyboard_and_the_focus_is_seen(browser: Any, axes: Path) -> None:
    page = CHROME.open_page(browser, axes)
    shown(page)
    reached = []
    for _ in range(16):
        page.keyboard.press("Tab")
        focus = "document.activeElement"
        reached.append(page.evaluate(f"{focus}.id || {focus}.name || {focus}.className"))
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none", reached[-1]
    order = ["level", "a", "b", "view", "wiper", "flip", "column", "row"]
    assert [name for name in reached if name in order] == order
    # The rest lies in the menu, which opens by keyboard too, and Escape closes it.
    page.evaluate("document.querySelector('.menu summary').focus()")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('.panel') !== null")
    page.keyboard.press("Escape")
    assert page.evaluate("document.querySelector('.menu').open") is False


@pytest.mark.thorough
def test_print_holds_every_level_and_no_control(browser: Any, axes: Path) -> None:
    page = CHROME.open_page(browser, axes, width=720)
    shown(page)
    CHROME.show(page, width=720, medium="print")
    visible = "[...document.querySelectorAll('%s')].filter((one) => one.checkVisibility()).length"
    assert page.evaluate(visible % "input, select, button") == 0
    assert page.evaluate(visible % ".sheet [data-cell] img") == 12
    assert page.evaluate(visible % ".sheet [data-truth]") == 1
    tops = page.evaluate("[...document.querySelectorAll('.sheet')].map((sheet) => new Set([...sheet.children].map("
                      "(item) => item.getBoundingClientRect().top)).size)")  # fmt: skip
    assert tops == [1, 1], "the levels of a contact sheet stand in one row"
    # A4 across, less 10 mm to each side, at CSS's 96 pixels an inch.
    assert page.evaluate("document.querySelector('#table table').scrollWidth") <= (297 - 2 * 10) / 25.4 * 96


@pytest.mark.sample(1)
@pytest.mark.parametrize("dark", [False, True])
def test_screen_is_not_blank(browser: Any, axes: Path, dark: bool) -> None:
    page = CHROME.open_page(browser, axes, dark=dark)
    shown(page)
    top = CHROME.screenshot(page)
    paper = top[5, 5].mean()
    assert paper < 60 if dark else paper > 200
    assert 0.02 < (np.abs(top.astype(int) - top[5, 5]).max(axis=2) > 60).mean() < 0.6
    colours = top.astype(np.int64) @ (1 << 16, 1 << 8, 1)
    assert np.unique(colours).size > 3000, "noise pictures hold many colours"


@pytest.mark.thorough
def test_without_script_pictures_and_numbers_stand(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report, script=False)
    visible = (
        "[...document.querySelectorAll('main :is(input, select, button, canvas)')].filter((one) => one.offsetParent)"
    )
    assert page.evaluate(f"{visible}.length") == 0, "controls that can do nothing are shown"
    assert page.evaluate("document.querySelector('noscript').innerText").startswith("Without JavaScript")
    assert page.evaluate("document.querySelectorAll('.sheet img:not([data-truth])').length") == 28
    assert page.evaluate("document.querySelectorAll('.sheet img[data-truth]').length") == 1  # the reference
    page.evaluate("document.querySelector('noscript a[href=\"#overview\"]').click()")
    assert page.evaluate("location.hash") == "#overview"


@pytest.mark.thorough
def test_policy_refuses_injected_script_and_fetch(browser: Any, report: Path) -> None:
    page = CHROME.open_page(browser, report)
    page.evaluate(
        """(async () => {
             const script = document.createElement("script");
             script.textContent = "document.title = 'owned'";
             document.body.append(script);
             const image = document.createElement("img");
             image.src = "https://example.invalid/x.png";
             document.body.append(image);
             await fetch("https://example.invalid/").catch(() => {});
           })()"""
    )
    assert page.evaluate("document.title") != "owned"
    violations = json.dumps(CHROME.complaints(page))
    for directive in ("script-src", "img-src", "default-src"):
        assert directive in violations
