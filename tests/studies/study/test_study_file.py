"""Studies as TOML: strict keys and types, files beside the study, values changed from the command line."""

from dataclasses import replace
from pathlib import Path

from refusal import refusal

from studies.budget.ledger import as_stated
from studies.study.lit_scene import open_all
from studies.study.study import SceneChoice, Study
from studies.study.study_file import read_study

TEXT = """
scenes = ["still_life", {source = "desk.exr", light = "A"}]
levels = ["1cd/m2", "25cd/m2"]
sensors = ["low_noise"]
[render]
spp = 16
"""


def written(folder: Path, text: str = TEXT) -> Path:
    path = folder / "study.toml"
    path.write_text(text, "utf-8")
    return path


def told(folder: Path, text: str = TEXT, *changes: str) -> str:
    return refusal(read_study, written(folder, text), changes)


def test_a_file_becomes_a_study_with_files_beside_it(tmp_path: Path) -> None:
    study = read_study(written(tmp_path))
    scenes = (SceneChoice("still_life"), SceneChoice(str(tmp_path / "desk.exr"), "A"))
    expected = Study(scenes, ("1cd/m2", "25cd/m2"))
    assert study == replace(expected, render=replace(expected.render, spp=16))


def test_a_scenes_surfaces_may_be_held_beyond_their_tables(tmp_path: Path) -> None:
    text = TEXT.replace('{source = "desk.exr", light = "A"}', '{source = "room.xml", extend = "hold"}')
    assert read_study(written(tmp_path, text)).scenes[1] == SceneChoice(str(tmp_path / "room.xml"), extend="hold")


def test_a_scene_may_have_samples_of_its_own(tmp_path: Path) -> None:
    text = TEXT.replace('"still_life"', '"still_life", {source = "siemens_star", spp = 7}')
    study = read_study(written(tmp_path, text.replace(', {source = "desk.exr", light = "A"}', "")))
    assert [model.spp for model in as_stated(study).renders.values()] == [16, 7]
    assert "spp: 0 is outside 1 to 65536; give samples per pixel" in told(tmp_path, text.replace("spp = 7", "spp = 0"))
    picture = read_study(written(tmp_path, TEXT.replace('light = "A"', "spp = 7")))
    refusal(open_all, picture, match="^spp: 7 for .*desk.exr, a picture without surfaces; leave it out$")


def test_changes_take_toml_values_and_plain_words_and_make_tables(tmp_path: Path) -> None:
    changes = "render.spp=64 render.denoise=true seeds=[3,4] sensors=table1_output budget.total=0.2"
    study = read_study(written(tmp_path), [*changes.split(), 'levels=["2cd/m2"]'])
    assert (study.render.spp, study.seeds, study.sensors) == (64, (3, 4), ("table1_output",))
    assert study.render.denoise is True
    assert (study.budget.total, study.levels) == (0.2, ("2cd/m2",))


def test_a_number_of_seeds_counts_from_0_and_a_list_names_them(tmp_path: Path) -> None:
    for given, seeds in [("3", (0, 1, 2)), ("1", (0,)), ("[3]", (3,)), ("[5, 2]", (5, 2))]:
        study = read_study(written(tmp_path), [f"seeds={given}", "scenes=still_life"])
        assert (study.seeds, study.scenes) == (seeds, (SceneChoice("still_life"),))


def test_wrong_keys_and_values_are_told_in_one_line(tmp_path: Path) -> None:
    for change, words in (
        ("lvels=3", "key: 'lvels' is unknown; allowed: budget, exposures"),
        ("lvels=3", "did you mean 'levels'?"),
        ("render.ssp=3", "render key: 'ssp' is unknown; allowed: band_nm, denoise, max_seconds, noise_share, range_nm"),
        ('scenes=[{sorce="x"}]', "did you mean 'source'?"),
        ("seeds=[true]", "seeds: True is not a whole number"),
        ("seeds=0", "seeds: 0 is outside 1 to 100000; give how many, from 0 on, or a list such as [7]"),
        ("seeds=true", "seeds: True is not a whole number"),
        ("render.spp=1.5", "render: spp: 1.5 is not a whole number"),
        ("render.denoise=1", "render: denoise: 1 is not true or false"),
        ("scenes=[3]", "3 is not a scene"),
        ("sensors.x=3", "'sensors' of 'sensors.x' is not a table"),
        ("spp", "write KEY=VALUE"),
        ("levels=[]", "levels: [] is not allowed"),
    ):
        assert words in told(tmp_path, TEXT, change), change


def test_what_is_missing_or_unreadable_is_told(tmp_path: Path) -> None:
    assert "levels is missing" in told(tmp_path, 'scenes = ["still_life"]')
    assert "can't be read" in told(tmp_path, "levels = [")
    refusal(read_study, tmp_path / "absent.toml", match=r"rodcone new study -o FILE")


def test_a_likely_mistake_is_told_with_its_fix(tmp_path: Path) -> None:
    for text, words in (
        ("bits = 12\n[pixel]\npitch_um = 2.0\n", "it is a sensor; allowed: a study .*, in which it stands as"),
        ('scenes = "still_life"\nlevels = [1, 5]\n', 'levels: 1 is not a text in quotes; write "1lux" or "25cd/m2"'),
        ('scenes = "still_life"\nlevels = "1lux"\nexposures = [10]\n', 'exposures: 10 is not .*; write "10ms"'),
    ):
        (tmp_path / "study.toml").write_text(text, "utf-8")
        refusal(read_study, tmp_path / "study.toml", match=words)


def test_code_beside_a_study_runs_with_consent_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("from isp.pipeline import picture_bayer as develop\n", "utf-8")
    changes = ['processors=["mine.py:develop", "bayer"]']
    refusal(read_study, written(tmp_path), changes, match=r"processors: '.*mine.py:develop' is Python code")
    for sly in ("trust_code=true", "trust_code=1"):
        refusal(read_study, written(tmp_path), [*changes, sly], match="trust_code: no file may ask for it")
    study = read_study(written(tmp_path), changes, trust_code=True)
    assert study.processors == (f"{tmp_path / 'mine.py'}:develop", "bayer")


def test_lamps_and_charts_are_files_beside_the_study(tmp_path: Path) -> None:
    (tmp_path / "led.csv").write_text("wavelength_nm,watts\n380,1\n780,1\n", "utf-8")
    changes = ['spectra=["led.csv", "D65"]', 'scenes=[{source="color_checker", light="led.csv", chart="mine.csv"}]']
    study = read_study(written(tmp_path), changes)
    assert study.spectra == (str(tmp_path / "led.csv"), "D65")
    assert study.scenes[0].light == str(tmp_path / "led.csv")
    assert study.scenes[0].chart == str(tmp_path / "mine.csv")
    assert study.scenes[0].label == "mine.csv"
    (room,) = read_study(written(tmp_path), ['scenes={source="room.xml", define=["side=8"]}']).scenes
    assert (room.source, room.define) == (str(tmp_path / "room.xml"), ("side=8",))
    refusal(
        read_study, written(tmp_path), ['spectra=["absent.csv"]'], match=r"illuminant: '.*absent.csv' can't be read"
    )
