"""`rodcone new preset`: a commented copy to change."""

from pathlib import Path

from command_line import call, check_refusals

from sensor.presets import names, preset, preset_file
from studies.commands import new as new_command
from studies.study.study_file import read_study


def test_the_copy_is_the_preset_with_its_comments_and_reads_as_it(tmp_path):
    for name in names():
        path = tmp_path / f"{name}_of_mine.toml"
        assert call(["new", "preset", name, "-o", path]) == (0, f"{path}\n", "")
        assert path.read_bytes() == preset_file(name).read_bytes(), name
        assert preset(path) == preset(name), name
    assert len(list(tmp_path.iterdir())) == len(names())


def test_a_file_that_exists_is_left_alone(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine", "utf-8")
    code, out, err = call(["new", "preset", "low_noise", "-o", str(path)])
    assert (code, out) == (2, "")
    assert "mine.toml' exists; allowed: a new file" in err
    assert path.read_text("utf-8") == "mine"


CONFIGS = Path(new_command.__file__).parents[1] / "configs"
EXAMPLES = sorted(path.stem for path in CONFIGS.glob("*.toml"))


def test_an_example_comes_with_all_that_it_names_and_the_help_names_it(tmp_path):
    for name in EXAMPLES:
        folder = tmp_path / name
        folder.mkdir()
        path = folder / f"{name}.toml"
        assert call(["new", "study", name, "-o", path]) == (0, f"{path}\n", "")
        for file in (file for file in folder.rglob("*") if file.is_file()):
            assert file.read_bytes() == (CONFIGS / file.relative_to(folder)).read_bytes(), file
        study = read_study(path)  # checks every sensor, whose curves lie beside it
        assert study.name == name.replace("_", " ")
        assert all(Path(sensor).parent == folder / "sensors" for sensor in study.sensors if sensor.endswith(".toml"))
        assert name in " ".join(new_command.study.__doc__.split()), name


def test_bad_input_is_refused_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("low_nois -o a.toml", "did you mean 'low_noise'?"),
        ("low_noise -o a.txt", "write a.toml"),
        ("low_noise", "--out"),
    )
    check_refusals("new preset", rows, tmp_path)
    check_refusals("new preset", [("low_noise -o absent/a.toml", "choose another place with --out")], tmp_path, code=1)
