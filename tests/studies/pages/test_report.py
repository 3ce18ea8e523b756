"""The report as text: what it refuses, what it escapes, what it says."""

import json
import re
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256
from html import unescape
from html.parser import HTMLParser
from typing import Any

import pytest
import report_sample as SAMPLE

from rodcone.errors import InputError
from studies.pages import report_text as text
from studies.pages.report import render_report

HOSTILE = "</script><b>bold</b><!--\"'&{{ 7*7 }}"
PNG = b"\x89PNG\r\n\x1a\n" + b"rest"


def results() -> dict[str, Any]:
    made: dict[str, Any] = SAMPLE.sample_results()
    return made


def stubs(of: dict[str, Any]) -> dict[str, bytes]:
    """A picture for each cell, told apart by its bytes; the page never decodes them."""
    names = ["truth", *(cell["picture"] for cell in of["cells"])]
    return {name: PNG + name.encode() for name in names}


def page_of(of: dict[str, Any]) -> str:
    return render_report(of, stubs(of))


def cell_at(of: dict[str, Any], level: int, sensor: str, camera: str) -> dict[str, Any]:
    wanted = (level, sensor, camera)
    found: dict[str, Any] = next(c for c in of["cells"] if (c["level"], c["sensor"], c["camera"]) == wanted)
    return found


class Outline(HTMLParser):
    """Tags with their attributes, text outside style and script, and the rows of the table of all numbers."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.rows: list[list[str]] = []
        self._table = False
        self._cell = False
        self._raw = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append((tag, given))
        if tag == "table":
            self._table = given.get("class") == "cells"
        if tag in ("script", "style"):
            self._raw = tag
            if tag == "script":
                self.scripts.append("")
        if self._table and tag == "tr":
            self.rows.append([])
        if self._table and tag in ("td", "th"):
            self._cell = True
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag == self._raw:
            self._raw = ""
        if tag in ("td", "th"):
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._raw == "script":
            self.scripts[-1] += data
        elif self._cell:
            self.rows[-1][-1] += data


def test_page_refers_to_nothing_outside() -> None:
    outline = Outline(page_of(results()))
    for tag, given in outline.tags:
        for name in ("src", "href", "srcset", "action", "data", "poster", "xlink:href"):
            value = given.get(name)
            assert value is None or value.startswith(("data:", "#")), (tag, name, value)
    page = re.sub(r"data:image/[^\"]*", "", page_of(results()))
    assert "url(" not in page
    assert "@import" not in page
    assert re.search(r"(?:https?:)?//[a-z]", page, re.IGNORECASE) is None


def test_policy_holds_the_scripts_hash() -> None:
    outline = Outline(page_of(results()))
    policy = next(a["content"] for t, a in outline.tags if t == "meta" and "http-equiv" in a)
    assert policy is not None
    data, script = outline.scripts
    digest = b64encode(sha256(script.encode()).digest()).decode()
    assert policy == f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    assert len(json.loads(data)["cells"]) == 28
    first = [tag for tag, _ in outline.tags].index("meta")
    assert "http-equiv" in outline.tags[first + 1][1], "the policy has to come before all it is to hold for"
    assert not [name for _, given in outline.tags for name in given if name.startswith("on")], "no inline handlers"


def _poison(value: Any) -> Any:
    """Put the hostile text into every string but the balance, whose words choose what the summary says."""
    if isinstance(value, str):
        return value + HOSTILE
    if isinstance(value, list):
        return [_poison(item) for item in value]
    if isinstance(value, dict):
        return {key: item if key == "balance" else _poison(item) for key, item in value.items()}
    return value


def test_hostile_text_stays_text_everywhere() -> None:
    clean, poisoned = results(), _poison(results())
    outline, other = Outline(page_of(clean)), Outline(page_of(poisoned))
    assert [tag for tag, _ in other.tags] == [tag for tag, _ in outline.tags]
    assert "<b>bold" not in page_of(poisoned)
    assert json.loads(other.scripts[0])["views"][0]["levels"][0]["name"] == "moonlight" + HOSTILE
    assert other.scripts[1] == outline.scripts[1]
    assert unescape(page_of(poisoned)).count(HOSTILE) > 100
    # Names of channels and of the environment's entries are keys, not values.
    keyed = results()
    keyed["environment"][HOSTILE] = "1"
    keyed["cells"][0]["mean_electrons"][HOSTILE] = 1.0
    keyed["cells"][0]["balance"][HOSTILE] = "calibrated"
    assert "<b>bold" not in page_of(keyed)


def test_every_cell_stands_in_the_table() -> None:
    of = results()
    rows = Outline(page_of(of)).rows
    assert len(rows) == 1 + len(of["sensors"]) + len(of["cells"])
    start = 1
    for sensor in of["sensors"]:
        assert rows[start] == [f"Sensor {sensor['name']}"]
        for row, (level, camera) in zip(
            rows[start + 1 :], [(lv, c) for lv in range(7) for c in of["cameras"]], strict=False
        ):
            cell = cell_at(of, level, sensor["name"], camera)
            assert row[0] == of["levels"][level]["name"]
            assert row[2] == text.camera_name(camera)
            assert row[3] == f"{cell['psnr_db']:.1f}"
            assert row[4] == f"{cell['ssim']:.3f}"
        start += 1 + 7 * len(of["cameras"])


def test_order_of_cells_does_not_matter() -> None:
    turned = results()
    turned["cells"].reverse()
    assert page_of(turned) == page_of(results())


def test_every_picture_is_there_with_its_own_type() -> None:
    of = results()
    pictures = stubs(of)
    pictures["truth"] = b"RIFF\0\0\0\0WEBPVP8L"
    page = render_report(of, pictures)
    for name, content in pictures.items():
        kind = "webp" if name == "truth" else "png"
        assert f"data:image/{kind};base64,{b64encode(content).decode()}" in page


@pytest.mark.parametrize("name", ["truth", "0/low_noise/interleaved"])
def test_missing_picture_is_one_clear_line(name: str) -> None:
    of = results()
    pictures = stubs(of)
    del pictures[name]
    with pytest.raises(InputError, match=re.escape(repr(name))) as caught:
        render_report(of, pictures)
    assert "\n" not in str(caught.value)


def test_unknown_picture_format_is_refused() -> None:
    of = results()
    with pytest.raises(InputError, match="PNG, WebP"):
        render_report(of, stubs(of) | {"truth": b"GIF89a"})


def _drop_cell(of: dict[str, Any]) -> None:
    of["cells"].pop()


def _twice(of: dict[str, Any]) -> None:
    of["cells"].append(of["cells"][0])


def _dark(of: dict[str, Any]) -> None:
    of["levels"][0]["luminance_cd_m2"] = 0.0


def _no_seed(of: dict[str, Any]) -> None:
    del of["seed"]


def _camera(of: dict[str, Any]) -> None:
    of["cells"][0]["camera"] = "bayern"


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (_drop_cell, "sensor 'low_noise', exposure 'auto', level 6, camera 'bayer', seed 0 is missing"),
        (_twice, "comes twice"),
        (_dark, "luminance_cd_m2: 0.0"),
        (_no_seed, "'seed' is missing"),
        (_camera, "did you mean 'bayer'"),
    ],
)
def test_inconsistent_results_are_refused(fault: Callable[[dict[str, Any]], None], words: str) -> None:
    of = results()
    pictures = stubs(of)
    fault(of)
    with pytest.raises(InputError, match=re.escape(words)):
        render_report(of, pictures)


def test_unknown_numbers_become_dashes() -> None:
    of = results()
    cell = cell_at(of, 0, "low_noise", "bayer")
    for key in (*(metric.key for metric in text.METRICS), "mc_share", "snr_db", "exposure_s", "saturated"):
        cell[key] = None
    cell["balance"] = cell["mean_electrons"] = cell["seconds"] = None
    cell_at(of, 1, "low_noise", "bayer")["psnr_db"] = float("nan")
    cell_at(of, 2, "low_noise", "bayer")["psnr_db"] = float("inf")
    of["stages"][0]["seconds"] = None
    of["notes"] = []
    outline = Outline(page_of(of))
    row = outline.rows[1 + 1 + 14 + 1 + 1]
    assert row[2] == "Bayer"
    assert set(row[3:16]) == {"—"}
    assert "NaN" not in outline.scripts[0]
    assert "Infinity" not in outline.scripts[0]
    for fault in ("nan", "None"):
        assert re.search(rf"\b{fault}\b", unescape(re.sub(r"base64,[^\"]*", "", page_of(of)))) is None


def test_error_budget_holds_each_picture_s_share_and_what_is_left_out() -> None:
    of = results()
    of["left_out"] = ["veiling glare: each per cent adds 1 %", "aberrations"]
    page = unescape(page_of(of))
    budget = page[page.index('<table class="cells budget">') : page.index('<section id="speed"')]
    rows = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", budget, re.DOTALL)]
    assert rows[0] == ["", "table1_output", "low_noise"]
    assert rows[1] == ["Level", *["Interleaved", "Bayer"] * 2]
    for row, level in zip(rows[2:], range(7), strict=True):
        places = [(level, sensor["name"], camera) for sensor in of["sensors"] for camera in of["cameras"]]
        shares = [text.percent(cell_at(of, *place)["mc_share"]) for place in places]
        assert row == [of["levels"][level]["name"], *shares]
    over = sum(cell["mc_share"] > 0.03 for cell in of["cells"])
    assert budget.count('class="n over') == over > 0
    assert "<dt>veiling glare</dt><dd>each per cent adds 1 %</dd>" in budget
    assert "<dt>aberrations</dt><dd>—</dd>" in budget


def test_seeds_and_exposures_stand_in_the_page() -> None:
    of = SAMPLE.sample_axes()
    outline, page = Outline(page_of(of)), unescape(page_of(of)).replace("\N{NO-BREAK SPACE}", " ")
    data = json.loads(outline.scripts[0])
    assert data["exposures"] == ["automatic", "10\N{NO-BREAK SPACE}ms"]
    assert len(data["cells"]) == 2 * 3 * 2, "one a picture, not one a seed"
    cell = next(cell for cell in of["cells"] if cell["seed"] == 6 and cell["exposure"] == "10ms")
    # Deviation 0.1 dB over 3 seeds: Student's 95 % interval is 4.3027 x 0.1 / sqrt(3) = 0.248 dB wide to each side.
    assert data["cells"][6]["psnr_db"].replace("\N{NO-BREAK SPACE}", " ") == f"{cell['psnr_db']:.1f} ± 0.2 dB"
    assert page.count('class="band"') == 2 * (8 + 1) * 2, "for each exposure, metric (and Monte Carlo share), camera"
    assert "Means over 3 seeds" in page
    assert "seeds 5, 6, 7" in page
    assert "Sensor table1_output, exposure 10 ms" in page


def test_one_seed_draws_no_band_and_says_so() -> None:
    page = page_of(results())
    assert 'class="band"' not in page
    assert "±" not in page
    assert "One seed (0)" in page
    assert 'id="exposure"' not in page


def test_one_camera_and_one_level_make_a_page() -> None:
    of = results()
    of["cameras"] = ["interleaved"]
    of["levels"] = of["levels"][:1]
    of["cells"] = [cell for cell in of["cells"] if cell["camera"] == "interleaved" and cell["level"] == 0]
    assert len(Outline(page_of(of)).rows) == 1 + 2 + 2


def test_summary_states_wins_and_losses() -> None:
    of = results()
    for cell in of["cells"]:
        ahead = 2.0 if (cell["camera"] == "interleaved") == (cell["level"] < 3) else 0.0
        cell["psnr_db"] = 20.0 + ahead + (0.5 if cell["level"] == 6 and ahead else 0.0)
        cell["ssim"] = 0.5
        cell["delta_e_median"] = 5.0 if cell["camera"] == "bayer" else 6.5
    page = unescape(page_of(of)).replace("\N{NO-BREAK SPACE}", " ").replace("<b>", "").replace("</b>", "")
    assert (
        "PSNR is higher for Interleaved in 6 (by 2.0 dB at most: moonlight, table1_output) and "
        "Bayer in 8 (by 2.5 dB at most: daylight, table1_output)." in page
    )
    assert (
        "PSNR: Interleaved leads from moonlight to living room, by 2.0 dB; "
        "Bayer leads from paper's figure 6 to daylight, by 2.0 to 2.5 dB." in page
    )
    assert "SSIM: no camera leads at every level." in page
    assert "ΔE2000, median: Bayer leads at every level, by 1.5." in page
    assert "Luminance substitution (Interleaved): on from moonlight to living room, off elsewhere." in page
    assert "White balance (Interleaved): falls back to calibrated gains at moonlight." in page
