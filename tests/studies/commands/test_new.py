"""`rodcone new preset`: a commented copy to change."""

from pathlib import Path

import pytest

from sensor.presets import names, preset, preset_file
from studies.commands import new as new_command
from studies.commands.cli import main
from studies.study.study_file import read_study


def call(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    captured = capsys.readouterr()
    return int(stopped.value.code or 0), captured.out, captured.err


@pytest.mark.parametrize("name", names())
def test_the_copy_is_the_preset_with_its_comments_and_reads_as_it(name, capsys, tmp_path):
    path = tmp_path / "mine.toml"
    assert call(["new", "preset", name, "-o", str(path)], capsys) == (0, f"{path}\n", "")
    assert path.read_bytes() == preset_file(name).read_bytes()
    assert preset(path) == preset(name)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_exists_is_left_alone(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine", "utf-8")
    code, out, err = call(["new", "preset", "low_noise", "-o", str(path)], capsys)
    assert (code, out) == (2, "")
    assert "mine.toml' exists; allowed: a new file" in err
    assert path.read_text("utf-8") == "mine"


EXAMPLES = sorted(path.stem for path in (Path(new_command.__file__).parents[1] / "configs").glob("*.toml"))


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_comes_with_all_that_it_names_and_the_help_names_it(name, capsys, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    path = folder / f"{name}.toml"
    assert call(["new", "study", name, "-o", str(path)], capsys) == (0, f"{path}\n", "")
    own = Path(new_command.__file__).parents[1] / "configs"
    copied = [file for file in folder.rglob("*") if file.is_file()]
    assert {file.relative_to(folder).as_posix(): file.read_bytes() for file in copied} == {
        file.relative_to(folder).as_posix(): (own / file.relative_to(folder)).read_bytes() for file in copied
    }
    study = read_study(path)  # checks every sensor, whose curves lie beside it
    assert all(Path(sensor).parent == folder / "sensors" for sensor in study.sensors if sensor.endswith(".toml"))
    assert name in " ".join(new_command.study.__doc__.split())


def test_two_examples_share_sensors_and_a_changed_one_is_left_alone(capsys, tmp_path):
    first, second, third = (tmp_path / f"{name}.toml" for name in ("first", "second", "third"))
    assert call(["new", "study", "responses", "-o", str(first)], capsys)[0] == 0
    assert call(["new", "study", "metamers", "-o", str(second)], capsys)[0] == 0
    sensor = tmp_path / "sensors" / "xyz.toml"
    sensor.write_text("mine", "utf-8")
    code, out, err = call(["new", "study", "metamers", "-o", str(third)], capsys)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "xyz.toml' exists and differs from the example's" in err
    assert sensor.read_text("utf-8") == "mine"
    assert not third.exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["low_nois", "-o", "a.toml"], 2, "did you mean 'low_noise'?"),
        (["low_noise", "-o", "a.txt"], 2, "write a.toml"),
        (["low_noise"], 2, "--out"),
        (["low_noise", "-o", "absent/a.toml"], 1, "choose another place with --out"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(arguments, code, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found, out, err = call(["new", "preset", *arguments], capsys)
    assert (found, out, err.count("\n")) == (code, "", 1)
    assert words in err
    assert list(tmp_path.iterdir()) == []
