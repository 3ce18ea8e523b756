"""The explorer in headless Chromium: every picture is that of the copied Python, nothing else is asked of any host."""

import json
from collections.abc import Iterator
from functools import partial, wraps
from random import Random
from typing import Any

import browser as CHROME
import numpy as np
import pytest

pytest.importorskip("uvicorn", reason="needs rodcone[explore]")
pytest.importorskip("websockets", reason="needs rodcone[explore]")

import explore_browser as EXPLORE
from explore_sample import ran

import render.engine as ENGINE
import studies.explore.messages as MESSAGES
from sensor.presets import preset_file
from studies.explore.controls import Controls
from studies.explore.messages import first_message
from studies.explore.source import RenderOptions, open_source

pytestmark = CHROME.NEEDED
OPTIONS = RenderOptions(size=48, spp=4, band_nm=50.0)
SCENES = {name: partial(open_source, name, OPTIONS) for name in ("color_checker", "still_life_outdoor")}
MODES = [(1280, False), (1280, True), (1920, False), (1920, True), (390, False), (390, True)]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Address of an explorer whose page opens with a processor that answers at once: no picture comes later."""
    with pytest.MonkeyPatch.context() as patch, EXPLORE.served(SCENES["still_life_outdoor"]()) as address:
        patch.setattr(MESSAGES, "Controls", lambda: Controls(processor="interleaved"))
        yield address


@pytest.mark.thorough
def test_the_page_opens_with_two_mosaics_by_one_method(browser):
    with EXPLORE.served(SCENES["still_life_outdoor"]()) as address:
        page = CHROME.open_page(browser, address)
        EXPLORE.settle(page)
        caption = "document.querySelector('.explore figcaption').textContent"
        assert ": any_mosaic," in page.evaluate(caption)
        page.evaluate(WAIT % "document.querySelector('.said button').hidden")
        assert ": ple," in page.evaluate(caption)
        chosen = "['mosaic', 'processor'].map(key => document.querySelector(`[data-key=${key}]`).value)"
        assert page.evaluate(chosen) == ["rgbw", "ple"]
        page.evaluate("""document.querySelector("[data-key='camera b']").click()""")
        assert page.evaluate(chosen) == ["bayer", "ple"]


@pytest.mark.thorough
def test_a_mosaic_shows_its_tile_in_the_colours_of_its_filters_and_what_it_is(browser, address):
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    fills = "[...document.querySelectorAll('.explore svg.tile rect')].map(each => each.getAttribute('fill'))"
    red, green, blue, white = "#d43d33", "#2f9e4f", "#3b62d6", "#f4f4f0"
    rows = [[red, green] * 2, [blue, white] * 2]
    assert page.evaluate(fills) == (rows[0] + rows[1]) * 2
    said = page.evaluate("document.querySelector('.explore .mosaic').textContent")
    assert said.startswith("RG/BW: one pixel of four is clear")


@pytest.fixture
def one_render(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each render that copied Python asks for is made once: `test_written` shows that a second one is the same."""
    render = ENGINE.render
    made: dict[str, Any] = {}

    @wraps(render)
    def rendered(*arguments: Any, **options: Any) -> Any:
        key = repr((arguments[0].name, arguments[1:], options))
        return made[key] if key in made else made.setdefault(key, render(*arguments, **options))

    monkeypatch.setattr(ENGINE, "render", rendered)


def check_changes(page: Any, count: int, seed: int) -> int:
    """Move controls at random, and press Reset where settings are refused; give how many made a picture."""
    rng, painted, told = Random(seed), 0, []
    for number in range(count):
        told.append(EXPLORE.move(page, rng))
        if number % 10 == 9:  # a burst of changes, of which the last alone counts
            told += [EXPLORE.move(page, rng) for _ in range(5)]
        if EXPLORE.settle(page) == "failed":
            assert page.evaluate("document.querySelector('.explore').classList.contains('waiting')")
            page.get_by_role("button", name="Reset").click()
            EXPLORE.settle(page)
            continue
        painted += 1
        index = number % 2
        code = EXPLORE.copied_python(page, index)
        assert np.array_equal(EXPLORE.picture(page, index), ran(code)["picture"]), (told, code)
    return painted


@pytest.mark.thorough
def test_each_picture_is_that_of_the_copied_python(browser, address, one_render):
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    assert check_changes(page, 12, seed=1) >= 8


def test_the_page_asks_no_other_host(browser, address):
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page, figures=True)
    asked = CHROME.requests(page)
    assert asked
    assert all(each.startswith(address) for each in asked), asked
    assert CHROME.complaints(page) == []


@pytest.mark.thorough
@pytest.mark.parametrize(("width", "dark"), MODES)
def test_the_page_fits_and_is_readable(browser, address, width, dark):
    page = CHROME.open_page(browser, address, width=width, dark=dark)
    EXPLORE.settle(page, figures=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    background = CHROME.screenshot(page)[2, 2].astype(int)
    assert (background.mean() < 60) if dark else (background.mean() > 200)
    unnamed = page.evaluate(
        """[...document.querySelectorAll(".explore :is(input, select, button, canvas, textarea, svg)")].filter(each =>
           !each.getAttribute("aria-label") && !each.closest("label")?.textContent.trim() && !each.textContent.trim())
           .map(each => each.outerHTML)"""
    )
    assert unnamed == []
    boxes = page.evaluate(
        "[...document.querySelectorAll('.explore canvas')].map(each => each.getBoundingClientRect().width)"
    )
    assert min(boxes) > 100


CHOOSE = """(() => { const select = document.querySelector('[data-key="%s"]');
  select.value = %r; select.dispatchEvent(new Event("change")); })()"""
DROP = """(() => { const given = new DataTransfer(); given.items.add(new File([%r], "chip.toml"));
  document.querySelector(".explore").dispatchEvent(new DragEvent("drop", { dataTransfer: given })); })()"""
WAIT = "new Promise(done => (function look() { %s ? done() : setTimeout(look, 20); })())"


@pytest.fixture
def offered() -> Iterator[str]:
    """Address of an explorer of its own: the scene that a page chooses is its session's."""
    with pytest.MonkeyPatch.context() as patch, EXPLORE.served(SCENES["still_life_outdoor"](), SCENES) as address:
        patch.setattr(MESSAGES, "Controls", lambda: Controls(processor="interleaved"))
        yield address


@pytest.mark.thorough
def test_speed_and_gain_are_one_control(browser, address):
    """Low noise has ISO 51.57 at a gain of 1 (78 lux s over what fills its well): either moves the other."""
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    enter = """(() => { const box = document.querySelector('[data-key="%s box"]');
      box.value = "%s"; box.dispatchEvent(new Event("input")); })()"""
    value = "Number(document.querySelector('[data-key=\"%s box\"]').value)"
    caption = "document.querySelector('.explore figcaption').textContent"
    for key, number, other, wanted, speed in (("iso", 412.6, "gain", 8.001, 413), ("gain", 2, "iso", 103.1, 103)):
        page.evaluate(enter % (key, number))
        EXPLORE.settle(page)
        assert page.evaluate(value % other) == pytest.approx(wanted, rel=1e-3)
        assert f", ISO {speed}, " in page.evaluate(caption)


@pytest.mark.thorough
def test_level_by_name_a_dropped_sensor_another_scene_and_back(browser, offered, one_render, tmp_path, monkeypatch):
    """Each is in the copied Python; a scene keeps the cameras; *Reset* brings all back."""
    monkeypatch.chdir(tmp_path)
    chip = preset_file("low_noise").read_text("utf-8").replace("read_noise_e = 1.5", "read_noise_e = 9.0")
    (tmp_path / "chip.toml").write_text(chip, "utf-8")
    page = CHROME.open_page(browser, offered)
    EXPLORE.settle(page)
    page.evaluate(CHOOSE % ("level name", "moonlight"))
    page.evaluate(DROP % chip)
    page.evaluate(WAIT % "document.querySelector('[data-key=\"pixel.read_noise_e box\"]').value === '9'")
    page.evaluate(CHOOSE % ("scene", "color_checker"))
    page.evaluate(WAIT % "!document.querySelector('[data-key=\"power sky\"]')")
    EXPLORE.settle(page)
    code = EXPLORE.copied_python(page)
    assert all(each in code for each in ("'color_checker'", "level_cd_m2=0.036", "sensor='chip.toml'"))
    assert np.array_equal(EXPLORE.picture(page), ran(code)["picture"])
    page.evaluate("[...document.querySelectorAll('header button')].find(each => each.textContent === 'Reset').click()")
    EXPLORE.settle(page)
    changed = "explorer_view(\n    transport,\n    'picture',\n    processor='interleaved',\n)"
    assert changed in EXPLORE.copied_python(page)
    reference = page.evaluate("document.querySelectorAll('figcaption')[1].textContent")
    assert "Reference, 4 samples, render noise" in reference


def answered(page, views, script):
    """Value of a script in a page whose program is the script: `asked` holds what the page sends, `tell` answers.

    `level` is a slider, and an answer is ``{...answer, number}`` with its pictures.
    """
    EXPLORE.settle(page)
    said = first_message(open_source("still_life_outdoor", RenderOptions(size=48, spp=4)))
    answer = {
        "kind": "show", "cameras": [{"controls": said["controls"], "waiting_for": None}], "views": views,
        "facts": [{"exposure_s": 0.01, "gain": 1.0, "iso": 100.0, "saturated": 0.0, "snr_db": None}],
        "size": [1, 1], "spp": 4, "render_error": 0.1, "last": True, "notes": [],
    }  # fmt: skip
    return page.evaluate(
        f"""(async () => {{
          const {{ default: explorer }} = await import(new URL("explore.js", location.href));
          const asked = [], el = document.createElement("div"), seen = [], answer = {json.dumps(answer)};
          let tell;
          document.body.append(el);
          const send = each => asked.push(structuredClone(each));
          explorer.render({{ model: {{ send, on: (_, listener) => tell = listener }}, el }});
          tell({json.dumps({**said, "kind": "hello", "number": 1})}, []);
          const level = el.querySelector("[data-key=level]");
          {script}
        }})()"""
    )


@pytest.mark.thorough
def test_one_picture_is_asked_at_a_time_the_next_with_the_newest_values_and_no_old_one_comes_back(browser, address):
    """The page's module with a program that answers every third change, and an old question once more."""
    levels, painted = answered(
        CHROME.open_page(browser, address),
        [[0, "picture"]],
        """
          const shows = () => asked.filter(each => each.kind === "show");
          const grey = value => [new DataView(new Uint8Array([value, value, value]).buffer)];
          for (let moved = 1; moved <= 9; moved++) {
            level.value = moved;
            level.dispatchEvent(new Event("input"));
            if (moved % 3 === 0) tell({ ...answer, number: shows().at(-1).number }, grey(moved));
            seen.push(el.querySelector("canvas").getContext("2d").getImageData(0, 0, 1, 1).data[0]);
          }
          tell({ ...answer, number: shows()[1].number }, grey(99));
          seen.push(el.querySelector("canvas").getContext("2d").getImageData(0, 0, 1, 1).data[0]);
          return [shows().map(each => each.cameras[0].level_cd_m2), seen];
        """,
    )
    steps = [float(f"{1e-4 * 1e9 ** (step / 1000):.4g}") for step in (3, 6, 9)]
    assert levels == [25.0, *steps]
    assert painted == [0, 0, 3, 3, 3, 6, 6, 6, 9, 9]


@pytest.mark.thorough
def test_a_slider_that_moves_slowly_ends_no_two_pictures_in_a_row(browser, address):
    """A change each 200 ms, and a program that takes longer: the first picture ends, the second one is waited for."""
    asked = answered(
        CHROME.open_page(browser, address),
        [[0, "picture"]],
        """
          for (let moved = 1; moved <= 4; moved++) {
            level.value = moved;
            level.dispatchEvent(new Event("input"));
            await new Promise(done => setTimeout(done, 200));
          }
          return asked.filter(each => each.kind === "show").map(each => each.cameras[0].level_cd_m2);
        """,
    )
    assert asked == [25.0, float(f"{1e-4 * 1e9**0.001:.4g}")]


@pytest.mark.thorough
def test_pictures_are_painted_while_a_slider_is_dragged(browser, address):
    """A mouse's events, one each 16 ms, for 2 s: without them a picture waited until the slider came to rest."""
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    assert len(page.evaluate(EXPLORE.DRAG % ("level", 0.2, 0.8, 2000))) / 2 > 0


LOAD = """new Promise(done => {
  const file = document.querySelector(".explore input[type=file]"), given = new DataTransfer();
  given.items.add(new File([%r], "lamp.csv"));
  file.files = given.files;
  file.dispatchEvent(new Event("change"));
  setTimeout(() => done(document.querySelector(".explore .status").textContent), 100);
})"""


@pytest.mark.thorough
def test_a_lamp_from_a_csv_file_is_in_the_copied_python(browser, address, one_render):
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    before = EXPLORE.picture(page)
    for text, line in (("400,1\n500,x\n700,2\n", 2), ("nm,value\n400;1\n\n500\n", 4), ("nm,value\nW,m2\n400,1\n", 2)):
        assert f"line {line} of lamp.csv" in page.evaluate(LOAD % text)
    assert "fewer than two" in page.evaluate(LOAD % "nm,value\n400,1\n")
    EXPLORE.settle(page)
    assert np.array_equal(EXPLORE.picture(page), before)
    page.evaluate(LOAD % "nm;value;remark\r\n380;0.25;blue\r\n# measured\r\n650;1e0\r\n780;2\r\n")
    EXPLORE.settle(page)
    code = EXPLORE.copied_python(page)
    assert "'table': [[380.0, 0.25], [650.0, 1.0], [780.0, 2.0]]" in code
    assert np.array_equal(EXPLORE.picture(page), ran(code)["picture"])
    assert not np.array_equal(EXPLORE.picture(page), before)


@pytest.mark.thorough
def test_a_picture_without_bytes_is_the_last_one_sent(browser, address):
    seen = answered(
        CHROME.open_page(browser, address),
        [[0, "picture"], [0, "truth"]],
        """
          const none = new DataView(new ArrayBuffer(0));
          const grey = value => new DataView(new Uint8Array([value, value, value]).buffer);
          const red = each => each.getContext("2d").getImageData(0, 0, 1, 1).data[0];
          const look = () => seen.push([...el.querySelectorAll("canvas")].map(red));
          level.dispatchEvent(new Event("input"));
          tell({ ...answer, number: 2 }, [grey(10), grey(20)]);
          look();
          tell({ ...answer, number: 3 }, [grey(30), none]);
          look();
          return seen;
        """,
    )
    assert seen == [[10, 20], [30, 20]]


FIGURES = {
    "histogram": {
        "edges_e": [1.0, 10.0, 100.0, 1e3, 1e4], "counts": {"G": [4, 16, 100, 0]}, "well_e": 5000.0, "floor_e": 3.0,
    },
    "pixel": {
        "row": 1, "column": 0, "channel": "G", "photons": 1234.5, "electrons": {"R": 100.25, "G": 400.5},
        "read_e": 390.0, "well_e": 5000.0, "noise_e": {"shot": 20.0, "total": 25.5},
        "wavelength_nm": [400.0, 500.0, 600.0], "photons_nm": [2.0, 8.0, 4.0], "electrons_nm": {"G": [1.0, 6.0, 0.0]},
    },
}  # fmt: skip


def test_captions_and_figures_have_the_programs_numbers_in_their_units(browser, address):
    """Places by the ticks' own labels: electrons on a scale of factors, samples by their roots, spectra evenly."""
    said = answered(
        CHROME.open_page(browser, address),
        [[0, "picture"], [0, "truth"]],
        f"""
          const figures = {json.dumps(FIGURES)}, wait = kind => new Promise(done => (function look() {{
            const one = asked.find(each => each.kind === kind); one ? done(one.number) : setTimeout(look, 10); }})());
          const colour = new DataView(new Uint8Array([10, 20, 30, 10, 20, 30]).buffer);
          const facts = [{{ exposure_s: 0.0125, gain: 2.0, iso: 413.25, saturated: 0.9999, snr_db: 17.36 }}];
          const cameras = answer.cameras.map(one => ({{ ...one, controls: {{ ...one.controls, frames: 4 }} }}));
          tell({{ ...answer, number: 2, size: [2, 1], facts, cameras }}, [colour, colour]);
          el.querySelector("canvas").dispatchEvent(new KeyboardEvent("keydown", {{ key: "ArrowUp" }}));
          for (const kind of ["histogram", "pixel"])
            tell({{ kind, number: await wait(kind), python: "", noise_note: "", [kind]: figures[kind] }}, []);
          const all = (each, what) => [...each.querySelectorAll(what)];
          const named = one => [+one.getAttribute("x1"), one.nextSibling.textContent];
          const points = one => one.getAttribute("points").split(" ").map(point => point.split(",").map(Number));
          const svg = each => ({{ ticks: all(each, ".grid").map(named), marks: all(each, ".mark").map(named),
            lines: all(each, "polyline").map(points), note: all(each, "text").at(-1).textContent }});
          return {{ captions: all(el, "figcaption").map(one => one.textContent),
            pixel: [...el.querySelector("canvas").getContext("2d").getImageData(0, 0, 1, 1).data],
            rows: all(el, ".budget tr").map(one => [...one.children].map(cell => cell.textContent)),
            of: [asked.find(each => each.kind === "pixel").row, el.querySelector(".budget p").textContent],
            figures: all(el, ".figures svg").map(svg) }};
        """,
    )
    assert said["captions"][0].endswith(": interleaved, 4 × 12.5 ms, ISO 413, 100 % full, green's SNR 17.4 dB")
    assert said["captions"][1] == "Reference, 4 samples, render noise 10 %: without the sensor's noise"
    assert said["pixel"] == [10, 20, 30, 255]
    assert said["rows"] == [
        *(["Photons on the pixel", "1235"], ["Electrons behind R", "100.3"], ["Electrons behind G, its own", "400.5"]),
        *(["Read out", "390 of 5000"], ["σ of shot", "20 e⁻"], ["All noise", "25.5 e⁻"]),
    ]
    assert said["of"] == [0, "Row 1, column 0, channel G"]
    histogram, spectrum = said["figures"]
    at, decades = np.array([(x, float(text.replace("k", "e3"))) for x, text in histogram["ticks"]]).T
    place = np.polyfit(np.log(decades), at, 1)
    assert place[0] > 0
    assert at == pytest.approx(np.polyval(place, np.log([1, 10, 100, 1e3, 1e4])), abs=0.1)
    for x, text in histogram["marks"]:
        assert x == pytest.approx(np.polyval(place, np.log(float(text.split()[-1]))), abs=0.1), text
    assert [text for _, text in histogram["marks"]] == ["well 5000", "noise floor 3"]
    x, y = np.array(histogram["lines"][0]).T
    assert x == pytest.approx(np.polyval(place, np.log([1, 10, 10, 100, 100, 1e3, 1e3, 1e4])), abs=0.1)
    assert y[-1] > y[4], "more is higher"
    assert (y[-1] - y[:6]) ** 2 == pytest.approx((y[-1] - y[4]) ** 2 * np.repeat([0.04, 0.16, 1], 2), rel=0.02)
    photons, electrons = np.array(spectrum["lines"])
    assert photons[:, 0] == pytest.approx([x for x, _ in spectrum["ticks"]], abs=0.1)
    assert [text for _, text in spectrum["ticks"]] == ["400", "500", "600"]
    up = electrons[2, 1] - np.stack([photons[:, 1], electrons[:, 1]])
    assert up[0, 1] > 0, "more is higher"
    assert up / up[0, 1] == pytest.approx(np.array([[0.25, 1, 0.5], [0.125, 0.75, 0]]), abs=0.01)
    assert "dashed: photons, at most 8 a nm" in spectrum["note"]


@pytest.mark.thorough
def test_a_slow_processor_can_be_cancelled_and_its_picture_comes_when_the_sliders_rest(browser, address, one_render):
    page = CHROME.open_page(browser, address)
    EXPLORE.settle(page)
    choose = """(() => { const select = document.querySelector("[data-key=processor]");
        select.value = %r; select.dispatchEvent(new Event("change")); })()"""
    waiting = "!document.querySelector('.said button').hidden"
    page.evaluate(choose % "ple_rgbw")
    EXPLORE.settle(page)
    assert page.evaluate(waiting)
    assert "any_mosaic" in page.evaluate("document.querySelector('.explore figcaption').textContent")
    page.evaluate("document.querySelector('.said button').click()")
    assert not page.evaluate(waiting)
    page.evaluate(choose % "interleaved")
    EXPLORE.settle(page)
    page.evaluate(choose % "ple_rgbw")
    EXPLORE.settle(page)
    page.evaluate(
        """new Promise(done => (function look() {
            document.querySelector(".said button").hidden ? done() : setTimeout(look, 50); })())"""
    )
    code = EXPLORE.copied_python(page)
    assert "ple_rgbw" in code
    assert np.array_equal(EXPLORE.picture(page), ran(code)["picture"])
