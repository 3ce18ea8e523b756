"""`rodcone snr`: a table, JSON, a plot, and what isn't allowed."""

import json
from pathlib import Path

import pytest

from studies.commands.cli import main


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as end:
        main(["snr", *arguments])
    return end.value.code, *capsys.readouterr()


def test_a_faster_lens_needs_less_light_as_the_camera_equation_has_it(capsys: pytest.CaptureFixture[str]) -> None:
    needed = {}
    for number in ("2", "4"):
        code, out, _ = run(capsys, "low_noise", "--at", "10", "--f-number", number, "--json")
        assert code == 0
        needed[number] = json.loads(out)["low_noise"][1]["luminance_cd_m2"]
    # irradiance is pi L / (1 + 4 N^2) of a far scene
    assert needed["4"] / needed["2"] == pytest.approx((1 + 4 * 16) / (1 + 4 * 4), rel=1e-9)


def test_several_sensors_stand_in_one_table_and_one_plot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "low_noise", "table1_output", "--at", "90", "-o", str(tmp_path / "snr.svg"))
    assert code == 0
    assert len(out.splitlines()) == 1 + 8 + 1  # table1_output's PRNU of 1.7 % ends at an SNR of 59
    assert "no light is enough" in out
    drawn = (tmp_path / "snr.svg").read_text("utf-8")
    assert "low_noise G" in drawn
    assert "table1_output W" in drawn


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["low_nois"], "low_noise"),
        (["low_noise", "--at", "0"], "at:"),
        (["low_noise", "--exposure", "20"], "write 20ms or 20s"),
        (["low_noise", "--light", "D64"], "D65"),
        (["low_noise", "-o", "snr.png"], ".svg"),
    ],
)
def test_what_is_not_allowed_is_told_in_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, error = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert len(error.splitlines()) == 1
    assert words in error
