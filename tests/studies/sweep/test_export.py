"""A ledger as a table: CSV that no spreadsheet runs."""

import csv
import json
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal
from sweep_sample import ROW, row

from isp.colour.encoding import quantise
from rodcone.colour_spaces import encode_srgb
from scenes.catalogue import load
from studies.metrics.target_figures import daylight_srgb, patch_masks
from studies.photograph.picture_file import to_png
from studies.sweep.database import COLUMNS
from studies.sweep.export import lines, markdown, write_csv
from studies.sweep.prepare import PICTURES
from studies.sweep.row import Row
from studies.sweep.stored import keep


def as_csv(rows: list[Row], folder: Path) -> list[list[str]]:
    """Lines of the file that rows are written to."""
    write_csv(iter(rows), folder / "rows.csv")
    return list(csv.reader(StringIO((folder / "rows.csv").read_bytes().decode(), newline="")))


def test_a_text_that_a_spreadsheet_would_run_is_quoted(tmp_path: Path) -> None:
    for start in ["=", "+", "-", "@", "\t", "\r"]:
        table = as_csv([replace(ROW, scene=f"{start}cmd|' /C calc'!A0")], tmp_path)
        assert table[1][COLUMNS.index("scene")] == f"'{start}cmd|' /C calc'!A0", start


def test_csv_holds_every_value_and_numbers_as_they_are(tmp_path: Path) -> None:
    header, values = as_csv([ROW], tmp_path)
    assert tuple(header) == COLUMNS
    found = dict(zip(header, values, strict=True))
    assert (found["scene"], found["ssim"], found["snr_db"]) == ("desk, lit.exr", "-0.25", "-3.5")
    assert float(found["exposure_s"]) == ROW.exposure_s  # every digit
    assert (found["illuminance_lux"], found["psnr_db"]) == ("", "inf")


def test_the_page_makes_a_labelled_array_of_rows(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    page = (ROOT / "docs" / "formats.md").read_text("utf-8")
    lines_of_code = re.findall(r"^(axes = .*|psnr_db = .*)$", page, re.MULTILINE)
    names = {"table": pandas.DataFrame(map(vars, ROWS))}
    exec("\n".join(lines_of_code), names)
    psnr_db = names["psnr_db"]
    assert psnr_db.dims == ("scene", "sensor", "level", "processor", "seed")
    assert psnr_db.sel(processor="interleaved").mean().item() == 21.0
    assert psnr_db.sel(processor="bayer", seed=1).item() == 12.0


# Tables of a sweep's figures: means and intervals by hand, electrons by channel, and what is refused.


HERE = Path()
ROOT = Path(__file__).parents[3]


def cell(processor: str, seed: int, psnr_db: float, **more: object) -> Row:
    electrons = json.dumps({"G": 10.0, "W": 40.0 + seed} if processor == "interleaved" else {"G": 10.0})
    return row(processor, seed, level="1lux", psnr_db=psnr_db, mean_electrons=electrons, versions="{}", **more)


ROWS = [cell("interleaved", 0, 20.0), cell("interleaved", 1, 22.0), cell("bayer", 0, 12.0), cell("bayer", 1, 12.0)]


def test_means_and_intervals_are_those_of_the_seeds() -> None:
    table = lines(ROWS, HERE, ["processor"], ["psnr_db", "electrons_W"], {})
    assert [line.at for line in table] == [("interleaved",), ("bayer",)]
    assert table[0].means == (21.0, 40.5)
    # Student's t of one degree of freedom at 97.5 % is tan(0.475 pi); the standard error of 20 and 22 is 1
    assert table[0].halves[0] == pytest.approx(np.tan(0.475 * np.pi))
    assert (table[1].means, table[1].halves) == ((12.0, None), (0.0, None))
    text = markdown(table, ["processor"], ["psnr_db", "electrons_W"])
    assert text.splitlines() == [
        "| processor | psnr_db | electrons_W |",
        "| --- | ---: | ---: |",
        "| interleaved | 21.0 ± 12.7 | 40.5 ± 6.4 |",
        "| bayer | 12.0 | - |",
    ]


def test_names_from_outside_are_shown_and_not_interpreted() -> None:
    name = "<img src=x onerror=alert(1)>|[a](javascript:b)\n# `c`.exr"
    (line,) = lines([replace(ROWS[0], scene=name)], HERE, ["scene"], ["psnr_db"], {})
    row = markdown([line], ["scene"], ["psnr_db"]).splitlines()[2:]
    assert row == [r"| &lt;img src=x onerror=alert(1)&gt;\|\[a\](javascript:b) # \`c\`.exr | 20.0 |"]


def test_one_seed_has_no_interval_and_a_figure_that_a_seed_lacks_has_no_mean() -> None:
    (line,) = lines(ROWS[:1], HERE, [], ["psnr_db"], {})
    assert (line.means, line.halves) == ((20.0,), (None,))
    both = [replace(ROWS[0], snr_db=3.0), replace(ROWS[1], snr_db=None)]
    assert lines(both, HERE, [], ["snr_db"], {})[0].means == (None,)


def test_where_chooses_and_a_mean_over_cameras_is_refused() -> None:
    assert lines(ROWS, HERE, [], ["psnr_db"], {"processor": "bayer"})[0].means == (12.0,)
    for by, show, where, words in (
        ([], ["psnr_db"], {}, "by: a line of all would be a mean over processor interleaved, bayer"),
        (["procesor"], ["psnr_db"], {}, "axis: 'procesor' is unknown; .*did you mean 'processor'"),
        (["processor"], ["psnr"], {}, "show: 'psnr' is unknown; .*did you mean 'psnr_db'"),
        (["processor"], ["psnr_db"], {"level": "2lux"}, r"where: no cell has \{'level': '2lux'\}"),
        (["processor"], ["pair_delta_e"], {}, "pair_delta_e is known of scene metamers"),
    ):
        refusal(lines, ROWS, HERE, by, show, where, match=words)
    refusal(lines, [], HERE, ["processor"], ["psnr_db"], {}, match="the sweep has made no cell yet")


def test_chart_colours_are_read_from_the_pictures(tmp_path: Path) -> None:
    masks = patch_masks(load("color_checker"), (128, 128))
    linear = np.full((128, 128, 3), 0.2)
    for mask, colour in zip(masks, daylight_srgb(), strict=True):
        linear[mask] = colour
    picture = keep(tmp_path / PICTURES, to_png(quantise(encode_srgb(linear))), ".png")
    row = replace(ROWS[0], scene="color_checker", picture=picture)
    (line,) = lines([row], tmp_path, [], ["daylight_delta_e"], {})
    # 8 bits, and cyan's and a few others' share beyond sRGB clipped: well under one, far from none
    assert line.means[0] is not None
    assert 0.0 < line.means[0] < 0.5
    refusal(
        lines, [replace(row, picture="b.png")], tmp_path, [], ["daylight_delta_e"], {}, match="run rodcone sweep again"
    )
    (tmp_path / PICTURES / picture).write_bytes(b"\x89")
    refusal(lines, [row], tmp_path, [], ["daylight_delta_e"], {}, match="isn't what was written")


def test_a_mean_over_cells_that_other_versions_variants_or_engines_made_is_refused() -> None:
    mixed = [replace(ROWS[0], variant="scalar"), ROWS[1]]
    refusal(lines, mixed, HERE, ["processor"], ["psnr_db"], {}, match="would be in one mean or comparison")
    apart = [replace(row, development_engine=f"of {row.processor}") for row in ROWS]
    assert len(lines(apart, HERE, ["processor"], ["psnr_db"], {})) == 2, "each processor has its engine"


def test_what_the_observer_sees_of_pairs_depends_on_the_light_alone() -> None:
    rows = [replace(row, scene="metamers", spectrum=light) for light in ("D65", "own", "A") for row in ROWS]
    table = lines(rows, HERE, ["spectrum", "processor"], ["true_pair_delta_e"], {})
    found = np.array([line.means[0] for line in table])
    assert found[:4] == pytest.approx(np.zeros(4), abs=0.05)  # as tests/studies/metrics/test_appearance.py says
    assert found[4] == found[5]
    assert 1.0 < found[4] < 10.0
