"""TOML that would take a parser without limits down, and that a camera and a study both refuse it in one line."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from refusal import refusal

from rodcone.toml_file import MOST_BYTES, read_toml, strict_converter, structured
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
        refusal(read, path, match=told)


def test_the_largest_file_and_the_largest_numbers_are_read(tmp_path: Path) -> None:
    text = f"least = {-(1 << 63)}\nmost = {(1 << 63) - 1}\ncurve = {[0.5] * 99}\ntable = [{{ deep = [true, 1e300] }}]\n"
    (tmp_path / "a.toml").write_text(text + "#" * (MOST_BYTES - len(text)))
    held = read_toml(tmp_path / "a.toml")
    assert held == {"least": -(1 << 63), "most": (1 << 63) - 1, "curve": [0.5] * 99, "table": [{"deep": [True, 1e300]}]}


# Tables as dataclasses: nothing is converted, and the first fault is named by its keys.


@dataclass(frozen=True)
class Lens:
    f_number: float
    name: str | None = None


@dataclass(frozen=True)
class Camera:
    lens: Lens
    bits: int = 12
    range_nm: tuple[float, float] = (400.0, 700.0)
    response: str | float = "included"
    lenses: tuple[Lens, ...] = ()


def camera(**content: Any) -> Camera:
    return structured(content, Camera, strict_converter(), "see the manual")


def test_a_table_becomes_the_dataclass_and_a_whole_number_a_number() -> None:
    found = camera(lens={"f_number": 2, "name": "x"}, range_nm=[380, 780], response=0.5, lenses=[{"f_number": 4.0}])
    assert found == Camera(Lens(2.0, "x"), 12, (380.0, 780.0), 0.5, (Lens(4.0),))
    assert isinstance(found.lens.f_number, float)


def test_the_first_fault_is_named() -> None:
    rows: tuple[tuple[dict[str, Any], str], ...] = (
        ({}, "lens is missing; add it, or see the manual"),
        ({"lens": {}}, "lens: f_number is missing"),
        ({"lens": 3}, "lens: the value is not a table; allowed: a table of keys; see the manual"),
        ({"lens": {"f_number": "2"}}, "lens: f_number: '2' is not a number"),
        ({"lens": {"f_number": True}}, "lens: f_number: True is not a number"),
        ({"lens": {"f_numer": 2}}, "lens key: 'f_numer' is unknown; allowed: f_number, name; did you mean 'f_number'?"),
        ({"lens": {"f_number": 2}, "bits": 1.5}, "bits: 1.5 is not a whole number"),
        ({"lens": {"f_number": 2}, "range_nm": [400]}, "range_nm: [400] has 1 values; allowed: 2"),
        ({"lens": {"f_number": 2}, "range_nm": "4007"}, "range_nm: '4007' is not a list"),
        ({"lens": {"f_number": 2}, "response": [1]}, "response: [1] is not a text in quotes or a number"),
        ({"lens": {"f_number": 2}, "lenses": [{"f_number": 2}, {}]}, "lenses: f_number is missing"),
    )
    for content, words in rows:
        refusal(camera, **content, match="^" + re.escape(words))
