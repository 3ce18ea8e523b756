"""`rodcone new preset`: a commented copy to change."""

import json
import tomllib
from pathlib import Path

import pytest
from command_line import call, check_refusals
from file_samples import camera_json, library_copy, profiled

from sensor.cameras.library import VARIABLE
from sensor.cfa import BAYER
from sensor.config_file import read_sensor
from sensor.presets import preset, preset_file, preset_names
from studies.commands.new.study import study as study_command
from studies.study.study_file import EXAMPLES, read_study


def test_the_copy_is_the_preset_with_its_comments_and_reads_as_it(tmp_path):
    for name in preset_names():
        path = tmp_path / f"{name}_of_mine.toml"
        assert call(["new", "preset", name, "-o", path]) == (0, f"{path}\n", "")
        assert path.read_bytes() == preset_file(name).read_bytes(), name
        assert preset(path) == preset(name), name
    assert len(list(tmp_path.iterdir())) == len(preset_names())


def test_an_eye_comes_with_its_receptors_and_is_read_as_a_sensor(tmp_path):
    path = tmp_path / "mine.toml"
    assert call(["new", "preset", "eye", "-o", path]) == (0, f"{path}\n", "")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["mine.toml", "receptors.csv"]
    assert read_sensor(path).channels == ("V", "L", "M", "S")
    (tmp_path / "receptors.csv").write_text("another's", "utf-8")
    told = f"'{tmp_path / 'receptors.csv'}' exists and differs from the example's"
    check_refusals("new preset", [(f"eye -o {tmp_path / 'other.toml'}", told)], tmp_path)


def test_a_file_that_exists_is_left_alone(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine", "utf-8")
    code, out, err = call(["new", "preset", "low_noise", "-o", str(path)])
    assert (code, out) == (2, "")
    assert "mine.toml' exists; allowed: a new file" in err
    assert path.read_text("utf-8") == "mine"


NAMES = sorted(path.stem for path in EXAMPLES.glob("*.toml"))


def test_an_example_comes_with_all_that_it_names_and_the_help_names_it(tmp_path):
    for name in NAMES:
        folder = tmp_path / name
        folder.mkdir()
        path = folder / f"{name}.toml"
        assert call(["new", "study", name, "-o", path]) == (0, f"{path}\n", "")
        for file in (file for file in folder.rglob("*") if file.is_file()):
            assert file.read_bytes() == (EXAMPLES / file.relative_to(folder)).read_bytes(), file
        study = read_study(path)  # checks every sensor, whose curves lie beside it
        assert study.name == name.replace("_", " ")
        assert all(Path(sensor).parent == folder / "sensors" for sensor in study.sensors if sensor.endswith(".toml"))
        assert name in " ".join(study_command.__doc__.split()), name
    # by night Gray World takes a sodium lamp for a grey wall
    assert read_study(tmp_path / "light_levels" / "light_levels.toml").white_balances == ("as-shot",)


def test_bad_input_is_refused_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("low_nois -o a.toml", "did you mean 'low_noise'?"),
        ("low_noise -o a.txt", "allowed: .toml; rename it"),
        ("low_noise", "--out"),
    )
    check_refusals("new preset", rows, tmp_path)
    check_refusals("new preset", [("low_noise -o absent/a.toml", "choose another place with --out")], tmp_path, code=1)


# `rodcone new preset --camera --noise`, `rodcone list sensors`: cameras that exist.

REPORT = Path(__file__).parents[3] / "sensor" / "cameras" / "reports" / "framos_imx900_lcg.toml"


@pytest.fixture
def cameras(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(library_copy(tmp_path / "copy", camera_json())))


@pytest.mark.filterwarnings("default::sensor.curves.RelativeResponsesWarning")
@pytest.mark.usefixtures("cameras")
def test_a_measured_camera_is_listed_and_becomes_a_preset(tmp_path):
    listed = json.loads(call(["list", "sensors", "--json"])[1])["sensors"]
    assert listed["Maker Model One"].startswith("Measured response, relative: lab, 2025-11-09")
    path = tmp_path / "one.toml"
    code, out, err = call(["new", "preset", "low_noise", "--camera", "maker model one", "-o", path])
    assert (code, out, err) == (0, f"{path}\n", "")
    assert (tmp_path / "one_curves.csv").is_file()
    code, out, err = call(["snr", path, "low_noise"])
    assert code == 0
    assert "hold up to one factor" in err
    assert f"{path}*" in " ".join(out.split())
    assert "* its responses are relative" in out
    found = json.loads(call(["snr", path, "low_noise", "--json"])[1])
    assert [rows[0]["relative"] for rows in found.values()] == [True, False]


@pytest.mark.filterwarnings("default::sensor.curves.RelativeResponsesWarning")
def test_a_fresh_installation_has_a_measured_camera(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert "each channel by itself: Darrodi" in call(["list", "sensors"])[1]
    path = tmp_path / "mine.toml"
    assert call(["new", "preset", "low_noise", "--camera", "Nikon D5100", "-o", path]) == (0, f"{path}\n", "")
    assert "BSD-3-Clause" in path.read_text("utf-8")
    assert "their ratios aren't known" in path.read_text("utf-8")
    check_refusals("snr", [("'nikon d5100'", "a measured response without a pixel; allowed")], tmp_path)  # it is listed


@pytest.mark.usefixtures("cameras")
def test_an_anchor_makes_it_absolute_and_what_is_missing_is_told(tmp_path):
    path = tmp_path / "one.toml"
    code, _, err = call(["new", "preset", "--camera", "Maker Model One", "--anchor", "0.5@540", "-o", path])
    assert code == 0
    assert "no source gives pitch_um, fill_factor, full_well_e" in err
    assert tomllib.loads(path.read_text("utf-8"))["responses"]["quantum_efficiency"] == pytest.approx(0.5, rel=0.02)


@pytest.mark.usefixtures("cameras")
def test_a_report_gives_a_camera_of_its_own_or_the_noise_and_the_anchor_of_a_measured_one(tmp_path):
    path = tmp_path / "report.toml"
    assert call(["new", "preset", "--noise", REPORT, "-o", path])[0] == 0
    sensor = read_sensor(path)
    assert (sensor.cfa, sensor.pixel.pitch_um) == (("W",), 2.25)
    both = tmp_path / "both.toml"
    assert call(["new", "preset", "--noise", REPORT, "--camera", "Maker Model One", "-o", both])[0] == 0
    sensor = read_sensor(both)
    assert sensor.pixel.read_noise_e == 5.56
    assert sensor.responses.band_average(("G",), [536.0], [0.1])[0, 0] == pytest.approx(0.9125, rel=2e-3)


def test_an_anchor_beside_a_digital_negative_needs_curves_that_it_scales(tmp_path):
    profiled(tmp_path / "shot.dng")
    asked = ("--noise", tmp_path / "shot.dng", "--anchor", "0.5@540", "-o", tmp_path / "mine.toml")
    code, out, err = call(["new", "preset", *asked])
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "anchor: 0.5@540 scales a response, and 'shot.dng' has none" in err
    assert not (tmp_path / "mine.toml").exists()
    assert call(["new", "preset", "low_noise", *asked])[0] == 0
    sensor = read_sensor(tmp_path / "mine.toml")
    assert sensor.cfa == BAYER
    assert sensor.responses.band_average(("G",), [540.0], [0.1])[0, 0] == pytest.approx(0.5, rel=1e-4)
    assert sensor.pixel.full_well_e == pytest.approx(12_000)


@pytest.mark.usefixtures("cameras")
def test_what_is_not_allowed_is_refused_and_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("", "name: none is given"),
        ("--anchor 0.5@530", "name: none is given"),
        ("low_nois --camera 'Maker Model One'", "did you mean 'low_noise'"),
        ("--camera 'Maker Model Two'", "did you mean 'Maker Model One'"),
        ("--camera 'Maker Model One' --anchor 0.5", "such as 0.5@530"),
        ("--camera 'Maker Model One' --anchor 50@530", "anchor: 50.0"),
        ("--camera 'Maker Model One' --anchor 0.5@nan", "anchor: nan"),
        ("--camera 'Maker Model One' --anchor 0.5@@530", "such as 0.5@530"),
        ("--noise absent.toml", "can't be read"),
        ("--noise absent.dng", "there is no such file"),
        ("--noise noise.xml", "another ending"),
    )
    check_refusals("new preset -o a.toml", rows, tmp_path)
