"""The page of all cameras: counts by hand, a camera that is no worse, sweeps that aren't whole; wrong arguments."""

import csv
import runpy
import sys
from dataclasses import replace

import pytest
from opponents import PAGE, parts
from refusal import refusal
from report_sample import sample_row

from studies.sweep.row import Row

# PSNR [dB] by processor at two levels; seeds differ by 0.2 dB, in step.
PSNR_DB = {
    "ple_rgbw": (20.0, 30.0),
    "ple_bayer": (18.0, 30.05),
    "bayer_residual_bm3d": (19.0, 32.0),
    "interleaved": (17.0, 29.0),
}


def swept(seeds: int = 2) -> list[Row]:
    return [
        replace(
            sample_row(level, 1, camera, seed, white_balance=balance),
            level=f"{level + 1}cd/m2",
            psnr_db=psnr_db + 0.2 * seed,
            delta_e_median=5.0,
            flip_mean=0.2,
            develop_s=4.0 if camera == "ple_rgbw" else 1.0,
            mean_electrons='{"R": 1.0, "G": 2.0, "B": 1.0}' if "bayer" in camera else '{"G": 2.0, "W": 4.0}',
        )
        for camera, of in PSNR_DB.items()
        for level, psnr_db in enumerate(of)
        for seed in range(seeds)
        for balance in ("gray-world", "as-shot")
    ]


def test_conditions_are_counted_by_hand() -> None:
    content, figure, table = parts(swept(), "0.2.0+abc")
    ranks = content["ranks"]
    assert "| `interleaved` | 2/0/0 | 2/0/0 | 0/2/0 | 0/2/0 | 0/2/0 | 0/2/0 | ×0.25 |" in ranks
    assert "| `ple_bayer` | 1/1/0 | 1/1/0 |" in ranks  # 0.05 dB behind is not seen
    assert "| `bayer_residual_bm3d` | 1/0/1 | 1/0/1 |" in ranks
    # in step: no scatter; 2 dB behind one Bayer camera at the second level
    assert "| no worse than every Bayer camera | 1 | 1 | 2 | 2 | 2 | 2 |  |" in ranks
    assert "rodcone 0.2.0+abc, 2 conditions under each balance" in content["set-up"]
    assert figure.count(">ple_bayer</text>") == 2
    cells = list(csv.DictReader(table.splitlines()))
    assert len(cells) == 16
    (cell,) = (x for x in cells if list(x.values())[:1] + list(x.values())[3:5] == ["as-shot", "2cd/m2", "ple_bayer"])
    assert (cell["psnr_db"], cell["psnr_db: lead of ple_rgbw"], cell["psnr_db: outcome"]) == ("30.15", "-0.05", "level")


def test_a_sweep_of_one_seed_or_without_a_picture_is_refused() -> None:
    refusal(parts, swept(seeds=1), "", match="seeds a picture; allowed: a whole sweep")
    refusal(parts, swept()[1:], "", match="seeds a picture; allowed: a whole sweep")


def test_the_page_has_a_place_for_every_part() -> None:
    text = PAGE.read_text("utf-8")
    assert [name for name in ("set-up", "ranks") if text.count(f"<!-- {name} -->") != 1] == []


@pytest.mark.parametrize(
    ("program", "words"), [("design", ["2eb261e"]), ("filters", []), ("opponents", []), ("five_cameras", ["a", "b"])]
)
def test_a_program_with_other_arguments_ends_in_one_line(
    program: str, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [f"{program}.py", *words])
    with pytest.raises(SystemExit, match=rf"^{program}: arguments: .* are not allowed; give .*$"):
        runpy.run_path(str(PAGE.parent / "make" / f"{program}.py"), run_name="__main__")
