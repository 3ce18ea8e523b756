"""A study's axes: every combination once, and faults told before any scene is opened."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

from render.radiance import SpectralRadiance
from sensor.presets import low_noise, preset_file
from studies.budget.starting_points import plan_from_settings, reference_plan
from studies.study.levels import parse_exposure
from studies.study.lit_scene import open_all
from studies.study.model import LensTerms, unit_exposure_s
from studies.study.study import SceneChoice, Study, conditions, study_mosaics
from studies.study.study_file import read_study

STUDY = Study((SceneChoice("still_life"), SceneChoice("flat_field", "A")), ("1cd/m2", "25cd/m2", "500lux"))


def test_conditions_are_the_product_of_five_axes_each_once() -> None:
    study = replace(STUDY, spectra=("own", "A"), exposures=("auto", "5ms"), sensors=("low_noise", "table1_output"))
    made = conditions(study)
    assert len(made) == len(set(made)) == 2 * 2 * 3 * 2 * 2
    first, second = made[0], made[1]
    assert (first.scene.source, first.spectrum, first.level, first.exposure) == ("still_life", "own", "1cd/m2", "auto")
    assert (first.sensor, second.sensor) == study.sensors  # the last runs fastest
    assert replace(second, sensor=first.sensor) == first


def test_sensors_of_one_size_are_compared_at_the_coarsest_pitch() -> None:
    study = replace(STUDY, sensors=("low_noise", "table1_output_6um"))
    assert study.equal_area is None
    area = replace(study, sensor_side_um=600.0).equal_area
    assert area is not None
    assert (area.side_um, area.coarsest_um) == (600.0, 6.0)


def test_mosaics_are_those_of_the_processors_each_once() -> None:
    assert study_mosaics(replace(STUDY, processors=("bayer", "interleaved"))) == ("bayer", "rgbw")


def test_exposures_are_times_with_a_unit_or_auto() -> None:
    for text, seconds in [("auto", None), ("10ms", 0.01), ("0.5 s", 0.5), ("200us", 2e-4), ("1e-2s", 0.01)]:
        assert parse_exposure(text) == (None if seconds is None else pytest.approx(seconds, rel=1e-15)), (text, seconds)


def test_auto_exposure_goes_without_green(tmp_path: Path) -> None:
    text = preset_file("low_noise").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = ["RB", "BW"]')
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    sensors = (str(tmp_path / "mine.toml"),)
    assert replace(STUDY, sensors=sensors).exposures == ("auto:information",)


def test_a_sensor_without_a_channel_of_a_processor_s_mosaic_is_named_with_it(tmp_path: Path) -> None:
    nm, mine = (380, 780), tmp_path / "mine.toml"
    (tmp_path / "rgb.csv").write_text("nm,R,G,B\n" + "".join(f"{x},0.1,0.3,0.1\n" for x in nm), "utf-8")
    text = preset_file("low_noise").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = "bayer"')
    responses = '[responses]\ncsv = "rgb.csv"\nrange_nm = [380, 780]\nquantum_efficiency = "included"\n'
    mine.write_text(text + responses, "utf-8")
    words = "sensor mine.toml with the mosaic rgbw, which a processor takes: responses: channel: 'W' is unknown"
    refusal(replace, STUDY, sensors=(str(mine),), match=words)


def test_white_balances_left_out_are_the_processors() -> None:
    for processors, stated, balances in [
        (("interleaved", "bayer"), (), ("as-shot",)),
        (("interleaved_paper",), (), ("gray-world",)),  # it belongs to the published method
        (("bayer", "interleaved_paper"), (), ("as-shot", "gray-world")),
        (("interleaved_paper",), ("as-shot",), ("as-shot",)),
    ]:
        assert replace(STUDY, processors=processors, white_balances=stated).white_balances == balances, (
            processors,
            stated,
            balances,
        )


def test_faults_are_told_in_one_line() -> None:
    for changes, words in [
        ({"levels": ()}, "levels: [] is not allowed; give one or more"),
        ({"seeds": (1, 1)}, "seeds: ['1', '1']"),
        ({"scenes": (SceneChoice("a/x.exr"), SceneChoice("b/x.exr"))}, "files under names of their own"),
        ({"levels": ("25nits",)}, "'nits' is unknown"),
        ({"exposures": ("10",)}, "write 10ms or 10s"),
        ({"exposures": ("0s",)}, "give a time above 0"),
        ({"compare": ("bayer",)}, "compare: ['bayer'] is no pair of the study's processors; allowed: two of "),
        ({"compare": ("bayer", "ple")}, "is no pair of the study's processors"),
        ({"exposures": ("auto:V",)}, "allowed: auto, auto:W, auto:information, or a number"),
        ({"white_balances": ("grey-world",)}, "did you mean 'gray-world'"),
        ({"spectra": ("D66",)}, "did you mean 'D65'"),
        ({"scenes": (SceneChoice("still_life", "AA"),)}, "illuminant: 'AA' is unknown"),
        ({"scenes": (SceneChoice("x.mat"),), "spectra": ("A",)}, "can't relight x.mat"),
        ({"sensors": ("low_nose",)}, "did you mean 'low_noise'"),
        ({"processors": ("bayers",)}, "did you mean 'bayer'"),
        ({"seeds": (-1,)}, "give whole numbers"),
        ({"longest_exposure_s": 0.0}, "longest_exposure_s"),
        ({"sensor_side_um": float("nan")}, "sensor_side_um"),
        ({"sensor_side_um": -5.0}, "sensor_side_um"),
        ({"sensor_side_um": 20.0}, "pixels across low_noise"),  # 9 of 2.2 um
        ({"sensor_side_um": 1e5}, "pixels across low_noise"),
        ({"render": replace(STUDY.render, spp=0)}, "render.spp"),
        ({"render": replace(STUDY.render, size=8)}, "render.size"),
        ({"render": replace(STUDY.render, noise_share=0.0)}, "render.noise_share"),
        ({"lens": replace(STUDY.lens, veiling_glare=2.0)}, "lens.veiling_glare"),
        ({"flicker": "neon@100Hz"}, "lamp: 'neon' is unknown"),
        (
            {"flicker": "fluorescent@100Hz", "sensors": ("staggered",)},
            "staggered: flicker: the camera reads some charge",
        ),
        ({"flicker": "fluorescent@100Hz", "lens": replace(STUDY.lens, shake="hand")}, "flicker: with shake_um"),
        ({"lens": replace(STUDY.lens, shake="tripod")}, "lens.shake: 'tripod' is unknown; allowed: hand"),
        ({"budget": replace(STUDY.budget, monte_carlo=0.2)}, "within budget.total"),
    ]:
        refusal(replace, STUDY, **changes, words=[words])


def test_the_near_infrared_asks_for_lights_that_are_known_there() -> None:
    far = replace(STUDY.render, range_nm=(380.0, 1070.0))
    replace(STUDY, render=far, spectra=("own", "sunlight", "moonlight", "2856K", "E", "LED-B5"))
    for light in ("D65", "A", "LED-V1", "sodium_high", "sodium_low"):
        replace(STUDY, spectra=(light,))
        refusal(
            replace, STUDY, render=far, spectra=(light,), match=f"spectra: '{light}' is known over .* take one of them"
        )


def test_a_range_without_lights_or_without_a_band_is_refused() -> None:
    for range_nm in [(380.0,), (780.0, 380.0), (200.0, 780.0), (380.0, 1200.0), (380.0, 400.0)]:
        refusal(replace, STUDY, render=replace(STUDY.render, range_nm=range_nm), match="range_nm: ")


# Studies as TOML: strict keys and types, files beside the study, values changed from the command line.


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
    assert [model.spp for model in plan_from_settings(study).renders.values()] == [16, 7]
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
        ("lvels=3", "key: 'lvels' is unknown; allowed: budget, compare, exposures"),
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
    (tmp_path / "mine.py").write_text("from isp.interleaved.pipeline import picture_bayer as develop\n", "utf-8")
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


def test_a_lens_by_data_stands_in_front_of_all_sensors_at_its_own_f_number(tmp_path: Path) -> None:
    study = replace(STUDY, lens=LensTerms(table="double_gauss", veiling_glare=0.02), sensors=("low_noise", "dual_gain"))
    lenses = {image.lens for image in plan_from_settings(study).images.values()}
    stated = ("double_gauss", 2.0, 0.02)
    assert {(lens.table, round(lens.f_number, 3), lens.veiling_glare) for lens in lenses} == {stated}
    assert study.lens.behind(low_noise()).lens.f_number == pytest.approx(2.0, abs=1e-3)
    assert STUDY.lens.behind(low_noise()) == low_noise()
    # Its falloff is its own: the scene's camera adds none.
    whole = {image.lens.horizontal_view_deg for image in reference_plan(study).images.values()}
    assert whole == {0.0}
    assert min(image.lens.horizontal_view_deg for image in reference_plan(STUDY).images.values()) > 0
    (tmp_path / "mine.toml").write_text("f_number = 4.0\nfield = [0.0, 1.0]\n")
    path = written(tmp_path, TEXT + '\n[lens]\ntable = "mine.toml"\n')
    assert read_study(path).lens.table == str(tmp_path / "mine.toml")


def test_exposures_go_by_the_f_number_of_a_lens_of_one_s_own_and_not_by_its_falloff(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("f_number = 5.6\nfield = [0.0, 1.0]\nrelative_illumination = [1.0, 0.2]\n")
    light = SpectralRadiance(np.ones((8, 8, 4)), np.arange(430.0, 780.0, 100.0))
    stopped = replace(low_noise(), lens=replace(low_noise().lens, f_number=5.6))
    behind = LensTerms(table=str(path)).behind(low_noise())
    assert unit_exposure_s(light, behind) == pytest.approx(unit_exposure_s(light, stopped), rel=1e-12)


def test_a_lens_that_no_camera_can_have_is_refused(tmp_path: Path) -> None:
    refusal(replace, STUDY, lens=LensTerms(table="cook_triplet"), match="lens.table: .*cook_triplet.* is unknown")
    refusal(replace, STUDY, lens=LensTerms(table=str(tmp_path / "no.toml")), match="lens.table: .*can't be read")
    blurred = tmp_path / "blurred.toml"
    text = preset_file("low_noise").read_text("utf-8")
    blurred.write_text(text.replace("[lens]", "[lens]\ndefocus_um = 3.0"), "utf-8")
    words = "defocus_um: 3 with the lens 'cooke_triplet'"
    refusal(replace, STUDY, lens=LensTerms(table="cooke_triplet"), sensors=(str(blurred),), match=words)
