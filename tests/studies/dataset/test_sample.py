"""A sample's raw frame is its truth with the noise that it states; light groups sum to the picture."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from builders import transport_of
from explore_sample import small_transport
from loop import loop

from render.engine import render
from render.illuminants import illuminant
from render.scene import LightGroup
from render.spectrum import even_bands, luminance, observer
from scenes.catalogue import load
from scenes.reflectances import color_checker_reflectances
from sensor.config import SensorConfig, with_channel_readings
from sensor.pixel import ChannelReading
from sensor.presets import low_noise
from sensor.readings.resolve import chip_readings
from studies.dataset.sample import Arrays, Sample, group_shares, make_sample, noise_coefficients, scene_hash
from studies.explore.controls import Lamp, lit_group
from studies.study.lit_scene import open_choice
from studies.study.study import RenderLimits, SceneChoice, Study

SIZE = (128, 128)
LIGHT = {"wavelength_nm": [], "width_nm": [], "groups": {}}
# One source each, large beside the others; and all together.
SOURCES: dict[str, dict[str, float]] = {
    # without any dark noise whole electrons meet whole DN, whose rounding then isn't the even error that is stated
    "shot noise": {"read_noise_e": 1.0, "dsnu_e": 0.0, "prnu": 0.0},
    "read noise": {"read_noise_e": 30.0, "prnu": 0.0},
    "DSNU": {"dsnu_e": 30.0, "prnu": 0.0},
    "PRNU": {"prnu": 0.05},
    "column gains": {"column_gain_spread": 0.02, "prnu": 0.0},
    "column offsets": {"column_offset_e": 20.0},
    "dark current": {"dark_current_e_per_s": 2000.0, "prnu": 0.0},
    "hot pixels": {"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 3000.0, "prnu": 0.0},
    "all": {"read_noise_e": 5.0, "dsnu_e": 4.0, "prnu": 0.02, "dark_current_e_per_s": 300.0},
}


def with_pixel(**values: float) -> SensorConfig:
    sensor = low_noise("bayer")
    return replace(sensor, pixel=replace(sensor.pixel, **values))


Made = tuple[Arrays, dict[str, Any]]


def sample_of(folder: Path, sensor: SensorConfig, level_cd_m2: float) -> Sample:
    """Frame of 128x128 over a ramp of expected electrons, 40 to 90 e- at 1 cd/m^2."""
    cell = SAMPLE.made_cells(folder)[0]
    ramp = np.broadcast_to(np.linspace(40.0, 90.0, SIZE[1]), SIZE) / cell.exposure_s
    files = {"electrons": ramp, "errors": np.zeros((1, *SIZE)), "truth": np.zeros((*SIZE, 3))}
    for name, array in files.items():
        np.save(folder / f"{name}.npy", array)
    frame = replace(cell.frame, sensor=sensor, **{x: folder / f"{x}.npy" for x in files})
    cell = replace(cell, frame=frame, luminance_cd_m2=level_cd_m2)
    files = {"mosaic_e": frame.electrons}
    return Sample("key", cell, "bayer", "0" * 32, "train", files, LIGHT, None, (0, 0, *SIZE))


def taken(folder: Path, sensor: SensorConfig, level_cd_m2: float) -> list[Made]:
    """The frame by eight chips."""
    sample = sample_of(folder, sensor, level_cd_m2)
    return [make_sample(replace(sample, cell=replace(sample.cell, seed=seed))) for seed in range(8)]


def squares(samples: list[Made]) -> np.ndarray:
    """Squared difference of raw and truth over the stated variance, a frame of each place in the tile."""
    found = []
    for arrays, facts in samples:
        for row, column in np.ndindex(2, 2):
            name, gain = facts["tile"][row][column], facts["gain_e_per_dn"]
            x = arrays["mosaic_e"][row::2, column::2] / gain
            dark_dn = facts["black_dn"] + facts["dark_above_black_e"][name] / gain
            off_dn = arrays["raw"][row::2, column::2].astype(float) - dark_dn - x
            noise = facts["noise"][name]
            found.append(off_dn**2 / (noise["a"] * x + noise["b"] + noise["c"] * x**2))
    return np.array(found)


def z_of(samples: list[Made]) -> float:
    """How far the mean square is from 1, in its own standard errors.

    Column terms are alike along a column, and pixels of a tile's two rows share them: a column's mean is one draw.
    """
    values = squares(samples).reshape(len(samples), 2, 2, SIZE[0] // 2, SIZE[1] // 2).mean(axis=(1, 3)).ravel()
    return float((values.mean() - 1) / (values.std(ddof=1) / np.sqrt(values.size)))


# 27 conditions, and a normal's 4.5 standard errors are passed by 7e-6 of them: one false alarm in 5 000 runs.
@pytest.mark.sample(3)
@pytest.mark.parametrize("level_cd_m2", [0.05, 1.0, 100.0])
@pytest.mark.parametrize("source", SOURCES)
def test_raw_minus_truth_has_the_stated_variance(source: str, level_cd_m2: float, tmp_path: Path) -> None:
    assert abs(z_of(taken(tmp_path, with_pixel(**SOURCES[source]), level_cd_m2))) < 4.5


# 4 conditions; in the brightest G's metered time is shorter than the frame's, and the density costs it light in all.
@pytest.mark.parametrize("level_cd_m2", [1.0, 150.0])
@pytest.mark.parametrize("reading", [ChannelReading("G", metered=True), ChannelReading("G", light_share=0.3)], ids=str)
def test_channels_read_apart_have_the_stated_variance_and_well(reading, level_cd_m2, tmp_path):
    sensor = with_channel_readings(with_pixel(**SOURCES["all"]), [reading])
    samples = taken(tmp_path, sensor, level_cd_m2)
    assert abs(z_of(samples)) < 4.5
    wells_e = samples[0][1]["full_well_e"]
    assert wells_e["R"] == sensor.pixel.full_well_e
    deeper = max(1.0, level_cd_m2 * 90 / (0.8 * wells_e["R"])) if reading.metered else 1 / 0.3
    assert wells_e["G"] / wells_e["R"] == pytest.approx(deeper, rel=0.05)  # steps of a sixteenth of an octave


def test_a_set_whose_prnu_is_twice_what_it_states_is_found(tmp_path: Path) -> None:
    stated, doubled = (taken(tmp_path, with_pixel(prnu=prnu), 100.0) for prnu in (0.01, 0.02))
    assert z_of([(arrays, facts) for (arrays, _), (_, facts) in zip(doubled, stated, strict=True)]) > 20


@loop("crosstalk", [0.0, 0.05])  # neighbours of an even field exchange the same
def test_coefficients_are_those_of_the_data_sheet(crosstalk: float) -> None:
    terms = {"read_noise_e": 3.0, "dsnu_e": 2.0, "prnu": 0.02, "dark_current_e_per_s": 50.0}
    sensor, time_s = with_pixel(**terms, crosstalk=crosstalk), 0.1
    gain = sensor.gain_e_per_dn
    for noise in noise_coefficients(chip_readings(sensor, time_s), gain).values():
        assert noise["a"] == pytest.approx(1 / gain, rel=1e-9)
        assert noise["b"] == pytest.approx((3.0**2 + 2.0**2 + 50.0 * 0.1 + gain**2 / 12) / gain**2, rel=1e-9)
        assert noise["c"] == pytest.approx(0.02**2, rel=1e-9)


def test_every_fact_of_a_sample_is_counted_another_way(tmp_path: Path) -> None:
    """By hand from its arrays, its cell and the data sheet; a new fact has to be named here."""
    terms = {"read_noise_e": 3.0, "dsnu_e": 2.0, "prnu": 0.02, "dark_current_e_per_s": 500.0}
    sensor, errors_e = with_pixel(**terms, hot_pixel_share=0.01, hot_pixel_dark_current_e_per_s=1e4), 2.0
    sample = sample_of(tmp_path, replace(sensor, gain=2.0), 60.0)
    cell = replace(sample.cell, seed=3)
    np.save(cell.frame.errors, np.full((1, *SIZE), errors_e / (60.0 * cell.exposure_s)))
    light = {"wavelength_nm": [550.0], "width_nm": [10.0], "groups": {"lamp": [1.0]}}
    window = (2, 4, 64, 96)
    arrays, facts = make_sample(
        replace(sample, cell=cell, illuminants=light, part=1, window=window, key="k", split="test", scene_hash="abc")
    )

    pixel, time_s, gain = sensor.pixel, cell.exposure_s, facts["gain_e_per_dn"]
    mean_dark_e, hot_e = 500.0 * time_s, 1e4 * time_s
    hot_e2 = 0.01 * 0.99 * hot_e**2 + 0.01 * hot_e
    dark_e2 = 3.0**2 + 2.0**2 + mean_dark_e + hot_e2 + gain**2 / 12
    x = np.asarray(arrays["mosaic_e"], float)
    sites = {"R": [(0, 0)], "G": [(0, 1), (1, 0)], "B": [(1, 1)]}
    mean_e = {name: np.mean([x[row::2, column::2].mean() for row, column in at]) for name, at in sites.items()}
    variance_e2 = x + dark_e2 + (0.02 * x) ** 2
    light_e2 = errors_e**2 / variance_e2  # share of the render's noise
    expected: dict[str, Any] = {
        "key": "k", "split": "test", "scene_hash": "abc", "scene": "scene.exr", "spectrum": "own", "level": "1cd/m2",
        "exposure": cell.condition.exposure, "sensor": "low_noise", "mosaic": "bayer", "tile": ["RG", "GB"],
        "channels": ["R", "G", "B"], "seed": 3, "window": [2, 4, 64, 96], "luminance_cd_m2": 60.0,
        "exposure_s": time_s, "white_cd_m2": cell.white_cd_m2, "white_dn": 2.0**sensor.bits - 1,
        "gain": 2.0, "groups": ["lamp"], "illuminants": light,
        "lens": vars(sensor.lens), "rodcone": facts["rodcone"],
    }  # fmt: skip
    for name, value in expected.items():
        assert facts[name] == value, name
    assert gain == pytest.approx(
        pixel.full_well_e / 2 / (facts["white_dn"] - replace(sensor, gain=2.0).black_dn), rel=1e-9
    )
    assert facts["black_dn"] == pytest.approx(replace(sensor, gain=2.0).black_dn + mean_dark_e / gain, rel=1e-9)
    for name in "RGB":
        noise, sources = facts["noise"][name], facts["sources_e"][name]
        assert facts["mean_e"][name] == pytest.approx(mean_e[name], rel=1e-6)
        assert facts["full_well_e"][name] == pytest.approx(pixel.full_well_e / 2, rel=1e-9)
        told = noise["a"] * gain, noise["b"] * gain**2, noise["c"] ** 0.5
        assert told == pytest.approx((1.0, dark_e2, 0.02), rel=1e-9)
        # the raw image's black holds dark current, not what few hot pixels raise the mean by
        assert facts["dark_above_black_e"][name] == pytest.approx(0.01 * hot_e, rel=1e-9)
        wanted = {
            "shot noise": mean_e[name], "dark current": mean_dark_e, "hot pixels": hot_e2,
            "PRNU": (0.02 * mean_e[name]) ** 2, "DSNU": 4.0, "read noise": 9.0, "quantisation": gain**2 / 12,
        }  # fmt: skip
        assert {key: value**2 for key, value in sources.items() if value} == pytest.approx(wanted, rel=1e-6)
    assert facts["snr_db"] == pytest.approx(10 * np.log10((x**2).mean() / variance_e2.mean()), abs=1e-6)
    assert facts["render_noise"]["mean"] == pytest.approx(errors_e**2 / variance_e2.mean(), rel=1e-5)
    assert facts["render_noise"]["of_95_percent"] == pytest.approx(np.quantile(light_e2, 0.95), rel=0.02)
    assert facts["saturated"] == 0.0
    named = set(expected) | {
        "black_dn",
        "gain_e_per_dn",
        "noise",
        "sources_e",
        "mean_e",
        "dark_above_black_e",
        "full_well_e",
    }
    assert named | {"snr_db", "saturated", "render_noise"} == set(facts)
    bright, told = make_sample(replace(sample, cell=replace(cell, luminance_cd_m2=120.0)))
    read_e = (bright["raw"].astype(float) - told["black_dn"]) * told["gain_e_per_dn"]
    full = [(bright["raw"] == told["white_dn"]).mean(), (read_e > 0.9 * pixel.full_well_e / 2).mean()]
    assert 0.1 < full[0] <= told["saturated"] <= full[1] < 0.9


def test_the_renders_share_in_95_per_cent_is_pooled_over_3x3_pixels(tmp_path: Path) -> None:
    """Two errors that are drawn apart for each pixel: their product over the sensor's variance, its mean of nine."""
    sensor = with_pixel(read_noise_e=3.0, dsnu_e=0.0, prnu=0.0)
    sample = sample_of(tmp_path, sensor, 1.0)
    time_s = sample.cell.exposure_s
    errors = np.random.default_rng(4).gamma(2.0, 3.0, (2, *SIZE))
    np.save(sample.cell.frame.errors, errors / time_s)
    arrays, facts = make_sample(sample)
    share = errors[0] * errors[1] / (arrays["mosaic_e"] + 9.0 + facts["gain_e_per_dn"] ** 2 / 12)
    padded = np.pad(share, 1, mode="symmetric")
    pooled = np.mean([padded[i : i + SIZE[0], j : j + SIZE[1]] for i in range(3) for j in range(3)], axis=0)
    assert facts["render_noise"]["of_95_percent"] == pytest.approx(np.quantile(pooled, 0.95), rel=1e-3)


def test_a_part_without_light_is_told_as_minus_120_db(tmp_path: Path) -> None:
    """Its ratio of powers is 0, whose logarithm JSON can't hold."""
    sample = sample_of(tmp_path, with_pixel(), 1.0)
    for name, value in (("electrons", 0.0), ("errors", 0.0)):
        path = getattr(sample.cell.frame, name)
        np.save(tmp_path / f"dark_{name}.npy", np.full_like(np.load(path), value))
    frame = replace(sample.cell.frame, **{x: tmp_path / f"dark_{x}.npy" for x in ("electrons", "errors")})
    _, facts = make_sample(replace(sample, cell=replace(sample.cell, frame=frame), files={}))
    assert facts["snr_db"] == pytest.approx(-120.0, abs=1e-9)
    assert set(facts["mean_e"].values()) == {0.0}
    assert facts["render_noise"] == {"mean": 0.0, "of_95_percent": 0.0}


def test_parts_of_a_frame_have_noise_of_their_own_and_one_chip(tmp_path: Path) -> None:
    sample = sample_of(tmp_path, with_pixel(prnu=0.2), 20.0)

    def part(number: int) -> np.ndarray:
        window = (64 * (number // 2), 0, 64, 64)  # the ramp runs along columns: all see the same light
        return make_sample(replace(sample, part=number, window=window))[0]["raw"].astype(float)

    raws = [part(number) for number in range(4)]
    assert not any(np.array_equal(raws[0], other) for other in raws[1:])
    assert not np.array_equal(raws[2], raws[3])  # the same light
    np.testing.assert_array_equal(part(2), raws[2])  # whatever was made before
    assert np.corrcoef(raws[0].ravel(), raws[3].ravel())[0, 1] > 0.9  # the chip's fixed pattern


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:bands. luminance")  # three bands of 100 nm
def test_shares_of_lights_sum_to_the_picture_and_each_is_what_it_gives_alone() -> None:
    scene = load("night_street")
    transport = render(scene, (16, 24), wavelength_nm=[450, 550, 650], width_nm=[100] * 3, spp=8)
    assert len(transport.groups) > 2
    shares = group_shares(transport, (16, 24))

    def y(**powers: float) -> np.ndarray:
        view = transport.relight(powers=powers or None)
        return luminance(view.values.astype(float), view.wavelength_nm, view.widths_nm, view.light)

    alone = [
        y(**{other: transport.groups[other].power * (other == name) for other in transport.groups})
        for name in transport.groups
    ]
    whole = np.sum(alone, axis=0)
    np.testing.assert_allclose(shares.sum(axis=-1) * whole, whole, rtol=1e-6)
    for index, given in enumerate(alone):
        # radiance is rounded to float32 after it is summed
        np.testing.assert_allclose(shares[..., index] * whole, given, atol=1e-6 * whole.max())


def test_shares_follow_each_lamps_own_spectrum_within_the_bands() -> None:
    """In bands of 50 nm the eye weighs a lamp at their red end otherwise than daylight in the same band."""
    transport = small_transport()
    red = Lamp(table=tuple((nm, float(np.exp(-(((nm - 615.0) / 20.0) ** 2)))) for nm in np.arange(380.0, 781.0, 2.0)))
    lamps = {"sun": red, "sky": Lamp("D65")}  # each at its own luminance
    groups = {name: lit_group(group, lamps[name]) for name, group in transport.groups.items()}
    lit = replace(transport, groups=groups)
    shares = group_shares(lit, lit.radiance.shape[2:])
    alone = []
    for name in groups:
        powers = {other: groups[other].power * (other == name) for other in groups}
        view = lit.relight(powers=powers)
        alone.append(luminance(view.values.astype(float), view.wavelength_nm, view.widths_nm, view.light))
    whole = np.sum(alone, axis=0)
    bright = whole > 0.01 * whole.max()
    for index, plane in enumerate(alone):
        np.testing.assert_allclose(shares[bright, index], (plane / np.maximum(whole, 1e-9))[bright], atol=5e-3)
    assert shares[bright].mean(axis=0).min() > 0.05


def test_shares_are_those_of_any_power_and_0_in_pixels_without_light() -> None:
    transport = small_transport()
    shape = transport.radiance.shape[2:]
    wanted = group_shares(transport, shape)
    for factor in (1e-9, 1e6):
        scaled = {name: replace(group, power=factor * group.power) for name, group in transport.groups.items()}
        np.testing.assert_allclose(group_shares(replace(transport, groups=scaled), shape), wanted, rtol=1e-6, atol=1e-9)
    dark = transport.radiance.copy()
    dark[..., :2, :] = 0.0
    shares = group_shares(replace(transport, light=replace(transport.light, mean=dark)), shape)
    assert not shares[:2].any()
    np.testing.assert_allclose(shares[2:], wanted[2:], rtol=1e-6)


def test_shares_of_a_lamp_of_lines_beside_a_sky_are_those_of_surfaces_at_its_lines() -> None:
    """Low-pressure sodium in bands of 20 nm: the band of the line holds what surfaces do 7 nm beside it, too."""
    nm, width_nm = even_bands((380.0, 780.0), 20)
    lamp, sky = illuminant("sodium_low"), illuminant("D65")
    patches = [curve for _, curve in color_checker_reflectances()]
    means = np.array([curve.band_average(nm, width_nm) for curve in patches]).T.reshape(1, 20, 4, 6)
    groups = {"lamp": LightGroup(("lamp",), lamp), "sky": LightGroup(("sky",), sky)}
    found = group_shares(transport_of(means.astype(np.float32).repeat(2, axis=0), groups, nm, width_nm), (4, 6))
    y = []
    for group, at in ((groups["lamp"], np.arange(588.9, 589.7, 1e-4)), (groups["sky"], np.arange(380.0, 780.0, 0.1))):
        light = group.power * np.interp(at, group.spectrum.wavelength_nm, group.spectrum.values, left=0.0, right=0.0)
        surfaces = np.array([np.interp(at, curve.wavelength_nm, curve.values) for curve in patches])
        y.append(surfaces @ (light * observer(at)[1]) * (at[1] - at[0]))
    share = (y[0] / np.sum(y, axis=0)).reshape(4, 6)
    assert 0.2 < share.min() < share.max() < 0.8
    np.testing.assert_allclose(found[..., 0], share, rtol=0.01)


def test_a_scene_has_one_hash_whatever_lights_it_and_another_for_other_shapes(tmp_path: Path) -> None:
    study = Study((SceneChoice("color_checker"),), ("1cd/m2",), render=RenderLimits(size=32))

    def hashed(*arguments: str, **changes: str) -> str:
        return scene_hash(open_choice(SceneChoice(*arguments, **changes), study))

    assert hashed("generated-1f") == hashed("generated-1f", light="A")
    assert hashed("generated-1f") != hashed("generated-2f")
