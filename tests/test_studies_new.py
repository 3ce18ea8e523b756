"""`rodcone new preset`: a commented copy to change."""

import pytest

from sensor.presets import names, preset, preset_file
from studies.cli import main


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
