"""`rodcone snr`: a table, JSON, a plot, and what isn't allowed."""

import json
from math import pi
from pathlib import Path

import pytest
from command_line import call, check_refusals

from sensor.presets import low_noise
from studies.photograph.snr import electrons_at_snr


def test_a_faster_lens_needs_less_light_as_the_camera_equation_has_it() -> None:
    needed = {}
    for number in ("2", "4"):
        code, out, _ = call(["snr", "low_noise", "--at", "10", "--f-number", number, "--json"])
        assert code == 0
        needed[number] = json.loads(out)["low_noise"][1]["luminance_cd_m2"]
    # irradiance is pi L / (1 + 4 N^2) of a far scene
    assert needed["4"] / needed["2"] == pytest.approx((1 + 4 * 16) / (1 + 4 * 4), rel=1e-9)


def test_the_table_holds_the_light_of_each_channel() -> None:
    head, _, green, *_ = call(["snr", "low_noise", "--at", "10"])[1].splitlines()
    assert head.split()[2:4] == ["electrons", "cd/m2"]
    name, channel, *figures = green.split()
    electrons, luminance_cd_m2, lux = map(float, figures)
    assert (name, channel) == ("low_noise", "G")
    assert electrons == pytest.approx(electrons_at_snr(10.0, low_noise(), 0.033), rel=1e-3)
    assert lux == pytest.approx(luminance_cd_m2 * pi / 0.18, rel=1e-3)


def test_several_sensors_stand_in_one_table_and_one_plot(tmp_path: Path) -> None:
    code, out, _ = call(["snr", "low_noise", "table1_output", "--at", "90", "-o", str(tmp_path / "snr.svg")])
    assert code == 0
    assert len(out.splitlines()) == 1 + 8 + 1  # table1_output's PRNU of 1.7 % ends at an SNR of 59
    assert "no light is enough" in out
    drawn = (tmp_path / "snr.svg").read_text("utf-8")
    assert "low_noise G" in drawn
    assert "table1_output W" in drawn


def test_what_is_not_allowed_is_refused(tmp_path: Path) -> None:
    rows = (
        ("low_nois", "did you mean 'low_noise'?"),
        ("low_noise --at 0", "at:"),
        ("low_noise --exposure 20", "write 20ms or 20s"),
        ("low_noise --light D64", "D65"),
        ("low_noise -o snr.png", ".svg"),
    )
    check_refusals("snr", rows, tmp_path)
