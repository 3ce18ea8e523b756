"""What `rodcone list` says: every name that a catalogue knows, and temperatures as the spectra have them."""

import json
from pathlib import Path

import pytest
from command_line import call, check_refusals, in_new_python

from isp.processors.catalogue import PROCESSORS
from render import illuminants
from render.illuminants import illuminant
from scenes import catalog
from sensor import cfa, presets
from sensor.cameras.library import measured_cameras


def printed(*arguments: object) -> str:
    code, out, _ = call(["list", *arguments])
    assert code == 0
    return out


def test_every_name_of_every_catalogue_is_listed() -> None:
    found = json.loads(printed("--json"))
    assert tuple(found["scenes"]) == catalog.names()
    assert tuple(found["lights"]) == (*illuminants.names(), "3000K", "D7000K")
    assert tuple(found["sensors"]) == (*presets.names(), *measured_cameras())
    assert tuple(found["mosaics"]) == cfa.mosaics()
    assert tuple(found["processors"]) == tuple(PROCESSORS)
    assert "flip_mean" in found["metrics"]
    assert all(text.strip() for lines in found.values() for text in lines.values())
    for name in found["lights"]:
        illuminant(name)


def test_one_kind_is_listed_alone_with_a_line_a_name() -> None:
    lines = printed("mosaics").splitlines()
    assert lines[0] == "mosaics"
    assert [line.split() for line in lines[1:3]] == [["rgbw", "RG/BW"], ["bayer", "RG/GB"]]


@pytest.mark.thorough
def test_curves_are_drawn_with_every_name(tmp_path: Path) -> None:
    for kind, names in (("lights", [*illuminants.names(), "3000K"]), ("sensors", ["the presets"])):
        printed(kind, "-o", tmp_path / "curves.svg")
        drawn = (tmp_path / "curves.svg").read_text("utf-8")
        assert [name for name in names if f">{name}</text>" not in drawn] == []


def test_what_has_no_curves_or_no_place_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = (("lights -o a.png", ".svg"), ("scenes -o a.svg", "no curves to show"), ("-o a.svg", "no curves to show"))
    check_refusals("list", rows, tmp_path)


@pytest.mark.sample(1)
@pytest.mark.parametrize("kind", ["", "scenes", "lights", "sensors", "mosaics", "processors", "metrics"])
def test_lists_import_no_renderer(kind: str) -> None:
    """Nor what takes long to load: 0.2 to 0.6 s of processor time a command, where a list of mosaics took 1.7 s."""
    program = (
        f"import sys; from studies.commands.cli import app; app('list {kind}', result_action='return_value'); "
        f"print([name for name in 'mitsuba drjit matplotlib colour scipy.ndimage'.split() if name in sys.modules])"
    )
    assert in_new_python(program).splitlines()[-1] == "[]"
