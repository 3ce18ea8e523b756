"""What the W pixel brings: leads worked out by hand, scenes apart by who drew them, intervals over seeds."""

from dataclasses import replace

import pytest
import sweep_sample as SAMPLE

from studies.pages.duels import contests_of
from studies.pages.report_text import PSNR
from studies.pages.white_pixel import BAYER, RGBW, lead, white_pixel_tables
from studies.sweep.row import Row

LIGHT = {"1cd/m2": 1.0, "10cd/m2": 10.0}


def made(names: tuple[str, ...] = (RGBW, BAYER), scenes: tuple[str, ...] = ("still_life", "generated-1f")) -> list[Row]:
    """RGBW leads by 2 dB in the dark and is behind by 1 in the light; seeds differ by 0.04 dB; drawn scenes add 4."""
    return [
        SAMPLE.row(name, seed, scene=scene, level=level, luminance_cd_m2=light, delta_e_median=5.0,
                   psnr_db=20.0 + (name == RGBW) * (2.0 - 3.0 * (light > 1) + 4.0 * (scene[0] == "g") + 0.04 * seed))
        for name in names
        for scene in scenes
        for level, light in LIGHT.items()
        for seed in (0, 1)
    ]  # fmt: skip


def test_a_lead_is_the_mean_over_scenes_and_its_interval_is_over_seeds() -> None:
    dark = [x for x in contests_of(made()) if x.level == "1cd/m2"]
    found = lead(dark, PSNR)
    # seeds 0 and 1: (2 + 6) / 2 and 0.04 more; t of one degree of freedom is 12.706, the standard error 0.04 / 2
    assert found.mean == pytest.approx(4.02)
    assert found.high - found.mean == pytest.approx(12.706 * 0.02, rel=1e-4)


def test_scenes_that_were_drawn_stand_apart() -> None:
    parts = [part.replace("\N{NO-BREAK SPACE}", " ") for part in white_pixel_tables(contests_of(made()))]
    table = next(part for part in parts if part.startswith("| PSNR")).splitlines()
    assert table[0] == "| PSNR [dB] | exposure | white balance | scenes | 1 cd/m² | 10 cd/m² |"
    named = [line for line in table if "1 named" in line]
    drawn = [line for line in table if "1 drawn" in line]
    assert named[0].endswith("| +2.0 ± 0.3 | −1.0 ± 0.3 |")
    assert drawn[0].endswith("| +6.0 ± 0.3 | +3.0 ± 0.3 |")
    assert "*Drawn* scenes" in parts[1]
    assert "*Drawn* scenes" not in white_pixel_tables(contests_of(made(scenes=("still_life",))))[1]


def test_lights_stand_apart() -> None:
    rows = [replace(row, spectrum=light) for row in made(scenes=("still_life",)) for light in ("own", "sodium_high")]
    table = next(part for part in white_pixel_tables(contests_of(rows)) if part.startswith("| PSNR"))
    assert [line.split(" | ")[3] for line in table.splitlines()[2:]] == ["1 named", "1 named, `sodium_high`"]


def test_nothing_is_said_where_one_of_the_two_is_missing() -> None:
    assert white_pixel_tables(contests_of(made((RGBW, "bayer")))) == []
