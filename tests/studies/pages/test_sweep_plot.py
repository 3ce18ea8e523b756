"""A sweep's figure over light: means, intervals and leads of known figures; what it refuses; the command."""

from pathlib import Path

import numpy as np
import pytest
import sweep_sample as SAMPLE
from command_line import call
from refusal import refusal

from studies.metrics.metric import DELTA_E, PSNR
from studies.pages.sweep_plot import metric_figure, panels

# PSNR by processor, level and seed. Each seed's difference is 2 and 4, so the lead is 3; t(1, 97.5 %) is 12.706.
PSNR_DB = {("ple_rgbw", 1): (22.0, 26.0), ("ple_bayer", 1): (20.0, 22.0), ("ple_rgbw", 25): (30.0, 30.0)}
STUDENT = 12.7062


def rows(**same: object) -> list:
    """Rows of two processors, levels and seeds; the Bayer camera's at 25 cd/m2 are missing."""
    return [
        SAMPLE.row(
            processor, seed, level=f"{level}cd/m2", luminance_cd_m2=level, psnr_db=value, delta_e_median=value, **same
        )
        for (processor, level), values in PSNR_DB.items()
        for seed, value in enumerate(values)
    ]


def test_lines_are_means_over_seeds_and_leads_are_of_pairs() -> None:
    (part,) = parts = panels(rows(), PSNR, "processor", {})
    assert (part.title, part.unit, part.light.tolist()) == ("", "cd/m²", [1.0, 25.0])
    assert list(part.lines) == ["RGBW (PLE)", "Bayer (PLE)"]
    plain, lead = metric_figure(parts, PSNR).axes
    (_, ours), (_, theirs) = (line.get_xydata().T for line in plain.lines)
    np.testing.assert_allclose(ours, [24.0, 30.0])
    np.testing.assert_allclose(theirs, [21.0, np.nan])
    leads = next(line for line in lead.lines if line.get_marker() == "o").get_ydata()
    np.testing.assert_allclose(leads, [3.0, np.nan])
    # Intervals at 1 cd/m2: deviations of (22, 26) and of the differences (2, 4), over sqrt(2).
    for band, mean, half in ((plain.collections[0], 24.0, 2.0 * STUDENT), (lead.collections[-1], 3.0, STUDENT)):
        corners = band.get_paths()[0].vertices
        heights = corners[corners[:, 0] == 1.0][:, 1]
        np.testing.assert_allclose([heights.min(), heights.max()], [mean - half, mean + half], rtol=1e-4)
    (turned,) = panels(rows(), PSNR, "processor", {}, "ple_bayer")
    assert list(turned.lines) == ["Bayer (PLE)", "RGBW (PLE)"]
    worse = metric_figure(panels(rows(), DELTA_E, "processor", {}), DELTA_E).axes[1]
    assert next(line for line in worse.lines if line.get_marker() == "o").get_ydata()[0] == pytest.approx(-3.0)


def test_what_else_varies_stands_in_panels_and_levels_in_lux_are_in_lux() -> None:
    both = [*rows(white_balance="as-shot"), *rows(white_balance="gray-world")]
    assert [part.title for part in panels(both, PSNR, "processor", {})] == ["as-shot", "gray-world"]
    assert len(panels(both, PSNR, "processor", {"white_balance": "as-shot"})) == 1
    lux = [SAMPLE.row("ple", 0, level=level, illuminance_lux=float(level[:-3])) for level in ("10lux", "2lux")]
    (part,) = panels(lux, PSNR, "processor", {})
    assert (part.unit, part.light.tolist()) == ("lux", [2.0, 10.0])
    assert len(metric_figure([part], PSNR).axes) == 1, "nothing to lead over"


def test_a_figure_of_too_much_is_refused() -> None:
    many = [row for number in range(7) for row in rows(scene=f"scene{number}")]
    refusal(panels, many, PSNR, "processor", {}, match="would have 7 panels; allowed: 6; .* --where scene=scene0")
    lines = [SAMPLE.row(f"p{number}", 0) for number in range(9)]
    refusal(panels, lines, PSNR, "processor", {}, match="would have 9 lines; allowed: 8; .* --where processor=p0")
    refusal(panels, rows(), PSNR, "processor", {}, "ple", match="first: 'ple' is unknown")
    refusal(panels, rows(), PSNR, "level", {}, match="axis: 'level' is unknown")
    refusal(panels, rows(), PSNR, "processor", {"level": "3lux"}, match="no cell has {'level': '3lux'}")


@pytest.mark.thorough
def test_the_command_writes_the_figure_of_a_sweep(tmp_path: Path) -> None:
    SAMPLE.swept(SAMPLE.small_study(tmp_path), tmp_path / "out")
    out = tmp_path / "lead.svg"
    assert call(["plot", tmp_path / "out", "-o", out]) == (0, f"{out}\n", "")
    assert "Bayer (bilinear)" in out.read_text("utf-8")
    assert call(["plot", tmp_path / "out", "--metric", "flip_mean", "--by", "sensor", "-o", tmp_path / "a.png"])[0] == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    for wrong, words in (("--metric psnr", "did you mean 'psnr_db'"), ("--by camera", "axis: 'camera'")):
        code, _, told = call(["plot", tmp_path / "out", "-o", out, *wrong.split()])
        assert (code, words in told) == (2, True), told
