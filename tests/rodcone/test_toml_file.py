"""TOML that would take a parser without limits down, and that a camera and a study both refuse it in one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rodcone.errors import InputError
from rodcone.toml_file import MOST_BYTES, read_toml
from sensor.config_file import read_sensor
from studies.study.study_file import read_study

HOSTILE = {
    "nested": ("a = " + 20_000 * "[", "nested too deep"),
    "dotted": ("a" + 20_000 * " . a-b" + " = 1", "nested too deep"),
    "quoted": ("[a" + 15_000 * '."."' + "]", "nested too deep"),
    "number": ("seeds = [1, [0x" + 16_000 * "f" + "]]", "whole number of more than 64 bits"),
    "large": ("#" * MOST_BYTES + "\n", "is over 262144 bytes"),
    "bytes": ("\udcff", "can't decode byte 0xff"),
}


@pytest.mark.parametrize("read", [read_sensor, read_study])
def test_hostile_toml_is_refused_in_one_line(read: Callable[[Path], Any], tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    for text, told in HOSTILE.values():
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        with pytest.raises(InputError, match=told):
            read(path)


def test_the_largest_file_and_the_largest_numbers_are_read(tmp_path: Path) -> None:
    text = f"least = {-(1 << 63)}\nmost = {(1 << 63) - 1}\ncurve = {[0.5] * 99}\ntable = [{{ deep = [true, 1e300] }}]\n"
    (tmp_path / "a.toml").write_text(text + "#" * (MOST_BYTES - len(text)))
    held = read_toml(tmp_path / "a.toml")
    assert held == {"least": -(1 << 63), "most": (1 << 63) - 1, "curve": [0.5] * 99, "table": [{"deep": [True, 1e300]}]}
