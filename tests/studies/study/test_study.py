"""A study's axes: every combination once, and faults told before any scene is opened."""

from dataclasses import replace
from pathlib import Path

import pytest
from refusal import refusal

from sensor.presets import preset_file
from studies.study.levels import parse_exposure
from studies.study.study import SceneChoice, Study, conditions, mosaics

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
    assert mosaics(replace(STUDY, processors=("bayer", "interleaved"))) == ("bayer", "rgbw")


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
        ({"exposures": ("auto:V",)}, "allowed: auto, auto:W, auto:information, or a number"),
        ({"white_balances": ("grey-world",)}, "did you mean 'gray-world'"),
        ({"spectra": ("D66",)}, "did you mean 'D65'"),
        ({"scenes": (SceneChoice("still_life", "AA"),)}, "illuminant: 'AA' is unknown"),
        ({"scenes": (SceneChoice("x.exr"),), "spectra": ("A",)}, "can't relight x.exr"),
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
