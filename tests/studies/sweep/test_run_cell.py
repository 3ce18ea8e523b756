"""One cell against the same steps written out, and what the files that cells share have to hold."""

import hashlib
import json
import pickle
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from builders import any_order, mosaic_of
from loop import loop
from PIL import Image
from refusal import refusal

from isp.colour.colour_fit import fit_colours
from isp.processors.catalogue import NAMED, PROCESSORS
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.radiance_files.radiance_source import as_transport, load_radiance
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, photons_per_joule
from rodcone.colour_spaces import encode_srgb
from rodcone.digests import digest, digest_file
from scenes.reflectances import color_checker_reflectances
from sensor.burst import merged_raw
from sensor.capture import expose
from sensor.cfa import BAYER, mask
from sensor.device import draw_device
from sensor.diffraction import diffraction_otf
from sensor.exposure import auto_exposure_s
from sensor.flicker.photograph import frame_starts_s
from sensor.flicker.rows import row_weights
from sensor.flicker.waveform import Waveform
from sensor.optics import form_image
from sensor.presets import preset, preset_file
from sensor.readout import read_out
from sensor.response import behind_filters, electrons_per_irradiance, expected_electrons
from sensor.shake import SHAKES, shaken
from studies.budget.ledger import Plan
from studies.metrics.appearance import appearance, picture_quality, true_picture
from studies.metrics.mtf import edge_response
from studies.metrics.truth import light_in_bands, neutral_electrons, true_srgb
from studies.pages.report_pictures import opened
from studies.photograph.camera import develop_to_scale
from studies.study.model import LensTerms
from studies.study.study import Condition, RenderLimits, SceneChoice, Study
from studies.sweep.cells import Cell, cell_keys, device_stream, exposure_stream, flicker_stream, shake_stream
from studies.sweep.provenance import Provenance
from studies.sweep.run_cell import run_cell
from studies.sweep.stored import keep


def made(folder: Path, plan: Plan | None = None, **changes: Any) -> list[Cell]:
    """Cells of the small study, their shared files made."""
    return SAMPLE.made_cells(folder, SAMPLE.small_study(folder, **changes), plan)


def test_a_cell_is_its_steps_written_out(tmp_path: Path) -> None:
    cell = next(cell for cell in made(tmp_path) if cell.condition.level == "25cd/m2")
    row = run_cell(cell)

    transport = as_transport(load_radiance(tmp_path / "scene.exr"))
    radiance = transport.relight(luminance_cd_m2=25.0)
    sensor = preset("low_noise", "bayer")
    irradiance = form_image(radiance, sensor)
    exposure_s = auto_exposure_s(irradiance, preset("low_noise"), 0.066)
    expected_e = expected_electrons(irradiance, sensor, exposure_s)
    light = light_in_bands(illuminant("E"), transport.wavelength_nm, transport.width_nm)
    nm, width = DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM)
    surfaces = np.array([reflectance.band_average(nm, width) for _, reflectance in color_checker_reflectances()])
    fine = light_in_bands(illuminant("E"), nm, width)
    assert sensor.channels == ("R", "G", "B")
    responses = electrons_per_irradiance(sensor, nm, width, 1.0, fine.lamp) / (photons_per_joule(nm) * width)
    colours = fit_colours(("R", "G", "B"), responses, nm, fine.spectrum, surfaces, width, fine.lamp)
    device = draw_device(sensor, radiance.shape, device_stream(cell.condition.sensor, "bayer", cell.seed))
    raw = read_out(expected_e, sensor, device, exposure_s, exposure_stream(cell.condition, "bayer", cell.seed))
    neutral = neutral_electrons(sensor, light, exposure_s)
    white = float(np.percentile(radiance.luminance(), 99.0, method="inverted_cdf")) / 0.9
    linear = NAMED["bayer"].develop(raw, colours, balance=neutral).rgb / (neutral[1] * white)
    truth = true_srgb(radiance, light, white)
    encoded = encode_srgb(linear)
    quality, seen = (picture_quality(encoded, encode_srgb(truth)), appearance(linear, true_picture(truth), white))

    assert row.exposure_s == pytest.approx(exposure_s, rel=1e-6)  # the level is put on before or after float32
    assert row.psnr_db == pytest.approx(quality.psnr_db, abs=1e-3)
    assert row.ssim == pytest.approx(quality.ssim, abs=1e-5)
    assert row.delta_e_median == pytest.approx(quality.delta_e_median, abs=1e-3)
    for name, tolerance in (("s_cielab_median", 1e-3), ("s_cielab_p95", 1e-2), ("flip_mean", 1e-4)):
        assert getattr(row, name) == pytest.approx(getattr(seen, name), abs=tolerance)
    assert row.pu21_psnr_db == pytest.approx(seen.pu21_psnr_db, abs=1e-3)  # in absolute luminance: at 25 cd/m^2
    assert (row.mtf50_cy_per_px, row.chart_delta_e_mean, row.patch_snr_db) == (None, None, None)
    shown_truth = np.asarray(Image.open(tmp_path / "pictures" / row.truth), dtype=int)
    assert (np.abs(shown_truth - np.rint(encode_srgb(truth) * 255)) <= 1).all()
    content = (tmp_path / "pictures" / row.picture).read_bytes()
    shown = np.asarray(Image.open(BytesIO(content)), dtype=int)
    assert (np.abs(shown - np.rint(encoded * 255)) <= 1).all()
    assert hashlib.sha256(content).hexdigest().startswith(Path(row.picture).stem)
    assert json.loads(row.mean_electrons)["G"] == pytest.approx(expected_e[::2, 1::2].mean(), rel=0.2)
    assert (row.luminance_cd_m2, row.illuminance_lux, row.mc_share) == (25.0, None, 0.0)


SAME = {("bayer", "auto"), ("bayer", "auto:W")}


def test_rules_of_exposure_are_each_cameras_own_and_leave_its_noise(tmp_path: Path) -> None:
    """Of a camera whose dark current fills a well as quickly as white's light does: it doesn't go with the level."""
    rules = ("auto", "auto:W", "auto:information")
    text = preset_file("low_noise").read_text("utf-8")
    hot = tmp_path / "hot.toml"
    hot.write_text(text.replace("dark_current_e_per_s = 0.0", "dark_current_e_per_s = 1e7"), "utf-8")
    changes = {"levels": ("1000cd/m2",), "exposures": rules, "processors": ("bayer", "interleaved")}
    cells = made(tmp_path, sensors=(str(hot),), seeds=(0,), **changes)
    times = {(cell.processor, cell.condition.exposure): cell.exposure_s for cell in cells}
    sensor = preset(hot)
    sharp = replace(sensor, lens=replace(sensor.lens, diffraction=0.0))  # one time for all models of the lens
    radiance = as_transport(load_radiance(tmp_path / "scene.exr")).relight(luminance_cd_m2=1000.0)
    for_white = auto_exposure_s(form_image(radiance, sharp), sensor, channel="W")
    # no W to expose for; three channels in place of four are other products of matrices over the ten bands
    assert times["bayer", "auto:W"] == times["bayer", "auto"]
    assert times["bayer", "auto"] == pytest.approx(times["interleaved", "auto"], rel=any_order(10))
    assert times["interleaved", "auto:W"] == pytest.approx(for_white, rel=1e-6)
    plain_s = auto_exposure_s(form_image(radiance, sharp), preset("low_noise"), channel="W")
    assert 0.2 < for_white / plain_s < 0.8
    assert times["interleaved", "auto:information"] < times["interleaved", "auto"]  # W is not left full
    bayer = {run_cell(cell).picture for cell in cells if (cell.processor, cell.condition.exposure) in SAME}
    assert len(bayer) == 1  # the same time, the same picture


@loop("rule", ["auto", "auto:W"])
def test_twice_the_gain_takes_half_the_time_of_an_automatic_exposure(rule: str, tmp_path: Path) -> None:
    changes: dict[str, Any] = {"levels": ("900cd/m2",), "exposures": (rule,), "processors": ("interleaved",)}
    one, two = made(tmp_path, **changes, gains=(1.0, 2.0), seeds=(0,))
    assert (one.frame.sensor.gain, two.frame.sensor.gain) == (1.0, 2.0)
    assert two.exposure_s == pytest.approx(one.exposure_s / 2, rel=1e-9)


def test_a_white_balance_as_shot_is_the_neutral_of_the_scenes_light(tmp_path: Path) -> None:
    # all of the scene is reddish, which Gray World takes for the light's colour
    shade = np.linspace(0.2, 1.0, SAMPLE.SIZE[1])[None, :, None] * np.ones((SAMPLE.SIZE[0], 1, 1))
    values = shade * np.linspace(0.3, 1.0, SAMPLE.NM.size) * 1e-3
    write_exr(SpectralRadiance(values.astype(np.float32), SAMPLE.NM), tmp_path / "scene.exr")
    gray, shot = made(tmp_path, levels=("25cd/m2",), seeds=(0,), white_balances=("gray-world", "as-shot"))
    assert gray.key != shot.key
    rows = [run_cell(gray), run_cell(shot)]
    assert [row.white_balance for row in rows] == ["gray-world", "as-shot"]
    assert [set(json.loads(row.balance).values()) for row in rows] == [{"gray world"}, {"given"}]
    assert rows[0].delta_e_median > 10.0
    assert rows[0].balance_delta_e > 10.0  # a grey card would get the complement of the scene's colour
    assert rows[1].balance_delta_e == pytest.approx(0.0, abs=1e-3)
    assert rows[1].delta_e_median < 4.0
    assert rows[0].mean_electrons == rows[1].mean_electrons


def with_light(cell: Cell, expected_e: np.ndarray, error_e: np.ndarray, folder: Path) -> Cell:
    """The cell with electrons of 10 ms and their error, (h, w), in place of its own."""
    given = {}
    for name, array in (("electrons", expected_e), ("errors", error_e[None])):
        file = BytesIO()
        np.save(file, array / 0.01)  # at 1 cd/m^2 and 1 s
        given[name] = folder / keep(folder, file.getvalue(), ".npy")
    return replace(cell, frame=replace(cell.frame, **given))


def test_the_monte_carlo_share_is_of_the_pixels_below_saturation(tmp_path: Path) -> None:
    """Half of the pixels at 400 e- with an error of 3 e- each, half beyond the well with 5000 e-, in numbers."""
    cell = made(tmp_path, levels=("1cd/m2",), exposures=("10ms",), seeds=(0,))[0]
    saturated = np.arange(SAMPLE.SIZE[1]) >= SAMPLE.SIZE[1] // 2
    expected_e = np.broadcast_to(np.where(saturated, 2.0 * cell.frame.sensor.pixel.full_well_e, 400.0), SAMPLE.SIZE)
    error_e = np.broadcast_to(np.where(saturated, 5000.0, 3.0), SAMPLE.SIZE)
    row = run_cell(with_light(cell, expected_e, error_e, tmp_path))
    pixel, sensor = cell.frame.sensor.pixel, cell.frame.sensor
    dark_e = pixel.dark_current_e_per_s * 0.01
    dark = pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12
    own = 400.0 + dark_e + (pixel.prnu * 400.0) ** 2 + dark
    assert row.mc_share == pytest.approx(9.0 / own, rel=1e-6)


def test_the_monte_carlo_share_of_a_burst_is_over_the_noise_that_merged_frames_scatter_by(tmp_path: Path) -> None:
    """20 e- in each of four frames, an error of 0.5 e- in the light, which all of them share; the noise by 60 chips."""
    cell = made(tmp_path, levels=("1cd/m2",), exposures=("10ms",), seeds=(0,), frames=(4,))[0]
    lit = with_light(cell, np.full(SAMPLE.SIZE, 20.0), np.full(SAMPLE.SIZE, 0.5), tmp_path)
    merged = []
    for chip in range(60):
        device = draw_device(cell.frame.sensor, SAMPLE.SIZE, np.random.default_rng([chip, 0]))
        stream = np.random.default_rng([chip, 1])
        light = np.full(SAMPLE.SIZE, 20.0), cell.frame.sensor, 0.01, device, stream
        merged.append(merged_raw([expose(*light, exact=True) for _ in range(4)]).electrons)
    # the merged frames' electrons of the light that one frame's 20 e- are, and its error with them; 19 200 pixels
    # know a variance to 1 %, and columns share offsets
    error_e = 0.5 * np.mean(merged) / 20.0
    assert run_cell(lit).mc_share == pytest.approx(error_e**2 / np.var(merged), rel=0.06)


def test_a_cell_weighs_the_same_whatever_the_pictures_size_and_travels_as_it_is(tmp_path: Path) -> None:
    small, large = tmp_path / "small", tmp_path / "large"
    large.mkdir()
    SAMPLE.picture(large / "scene.exr", (64, 64))
    small.mkdir()
    weights = [pickle.dumps(made(folder)[0]) for folder in (small, large)]
    assert abs(len(weights[0]) - len(weights[1])) < 500  # 3776 pixels more would be 30 kB
    assert pickle.loads(weights[0]).key == made(small)[0].key
    assert np.load(pickle.loads(weights[1]).frame.electrons).shape == (64, 64)


def test_other_code_and_arrays_out_of_reach_are_told_in_one_line(tmp_path: Path) -> None:
    cell = made(tmp_path)[0]
    refusal(
        run_cell,
        replace(cell, made_by=replace(cell.made_by, versions='{"rodcone": "0.0.0+other"}')),
        match="install the same rodcone",
    )
    absent = replace(cell.frame, electrons=tmp_path / "absent.npy")
    refusal(run_cell, replace(cell, frame=absent), match="a folder that all workers see")
    cell.frame.truth.write_bytes(b"no array")
    refusal(run_cell, cell, match="can't be read")


@pytest.mark.thorough
def test_targets_have_their_own_figures_on_their_own_scene(tmp_path: Path) -> None:
    """A bright chart and a bright edge, nearly without noise; each figure is None on the other's scene."""
    changes = {"levels": ("100cd/m2",), "seeds": (0,), "render": RenderLimits(size=96, spp=16)}
    scenes = (SceneChoice("color_checker"), SceneChoice("slanted_edge"))
    chart, edge = (run_cell(cell) for cell in made(tmp_path, scenes=scenes, **changes))
    assert chart.mtf50_cy_per_px is None
    assert chart.chart_delta_e_mean is not None
    assert 0.3 < chart.chart_delta_e_mean < 8  # what the matrix's fit leaves, and some noise
    assert chart.patch_snr_db is not None
    assert 20 < chart.patch_snr_db < 45
    assert (edge.chart_delta_e_mean, edge.patch_snr_db) == (None, None)
    assert edge.mtf50_cy_per_px is not None
    # Bilinear green keeps less than a pixel's own box does (0.6 cycles a pixel), and more than a box of three pixels.
    assert 0.2 < edge.mtf50_cy_per_px < 0.6
    assert chart.render_s > 0


@pytest.mark.thorough
def test_an_edges_frame_has_the_mtf50_of_its_lens_and_pixel(tmp_path: Path) -> None:
    """Over all channels, at f/2.8 and 2.2 um: by one sample of light per pixel it was 8 % too low."""
    sensor, size, lamp = preset("low_noise", "bayer"), 144, illuminant("D65")
    limits = RenderLimits(size=size, spp=32, band_nm=50.0)
    study = Study((SceneChoice("slanted_edge"),), ("100cd/m2",), processors=("bayer",), render=limits)
    (cell,) = SAMPLE.made_cells(tmp_path, study)
    electrons, truth = np.load(cell.frame.electrons), np.load(cell.frame.truth)
    assert (electrons.shape, truth.shape) == ((size, size), (size, size, 3))
    bright = {name: electrons[:, -16:][mask(BAYER, name, (size, 16))].mean() for name in sensor.channels}
    even = electrons / mosaic_of(bright, BAYER, (size, size))
    # The true transfer: of each band by its part in each channel's light, green at half of the sites.
    model = SAMPLE.stated(study).renders[study.scenes[0]]
    nm, width = np.array(model.wavelength_nm), np.array(model.width_nm)
    parts = electrons_per_irradiance(sensor, nm, width, 1.0, lamp) * lamp.band_average(nm, width)
    parts = np.array([0.25, 0.5, 0.25]) @ (parts / parts.sum(axis=1, keepdims=True))
    frequency = np.linspace(0.01, 0.6, 2000)
    mtf = parts @ [diffraction_otf(frequency / sensor.site_pitch_um, at, sensor.lens) for at in nm] * np.sinc(frequency)
    true = float(np.interp(-0.5, -mtf, frequency))
    assert edge_response(even).mtf50_cycles_per_px == pytest.approx(true, rel=0.01)
    # sensors of one size take as many samples
    (cell,) = SAMPLE.made_cells(tmp_path, replace(study, sensor_side_um=48 * sensor.site_pitch_um))
    assert np.load(cell.frame.electrons).shape == (48, 48)


def test_a_processor_of_ones_own_counts_by_its_bytes_and_workers_run_no_others(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("from isp.interleaved.pipeline import picture_bayer as develop\n", "utf-8")
    sensor = tmp_path / "bayer.toml"
    sensor.write_text(preset_file("low_noise").read_text("utf-8").replace('"rgbw"', '"bayer"', 1), "utf-8")
    asked: dict[str, Any] = {"processors": (f"{mine}:develop",), "trust_code": True, "sensors": (str(sensor),)}
    cell = made(tmp_path, **asked)[0]
    row = run_cell(cell)
    assert row.processor == "mine.py:develop"
    assert json.loads(row.versions)["mine.py"] == digest_file(mine)
    mine.write_text(mine.read_text("utf-8") + "# changed\n", "utf-8")
    refusal(run_cell, cell, match=r"mine.py' on .* isn't the file that the sweep began with")
    other = made(tmp_path, **asked)[0]
    assert other.key != cell.key
    assert run_cell(other).picture == row.picture


def test_a_burst_is_merged_and_shows_less_noise_and_its_first_frame_is_the_single_one(tmp_path: Path) -> None:
    cells = made(tmp_path, levels=("1cd/m2",), exposures=("5ms",), seeds=(0,), frames=(1, 16))
    alone = made(tmp_path, levels=("1cd/m2",), exposures=("5ms",), seeds=(0,))
    one, many = (run_cell(cell) for cell in cells)
    assert (one.frames, many.frames) == (1, 16)
    assert one.picture == run_cell(alone[0]).picture
    assert (one.exposure_s, many.exposure_s) == (0.005, 0.005)
    assert many.psnr_db > one.psnr_db + 3.0


def test_lamps_of_a_study_flicker_in_every_exposure_and_rules_take_whole_periods(tmp_path: Path) -> None:
    lamps = {"flicker": "sodium_high@100Hz", "seeds": (0,), "levels": ("25cd/m2",)}
    (cell,) = made(tmp_path, **lamps, exposures=("2ms",))
    assert cell.flicker == Waveform(100.0, 0.95)
    sensor = replace(cell.frame.sensor, row_time_us=200.0)
    cell = replace(cell, frame=replace(cell.frame, sensor=sensor))
    expected_e = np.load(cell.frame.electrons) * cell.luminance_cd_m2 * 0.002
    (start_s,) = frame_starts_s(sensor, expected_e.shape, 0.002, flicker_stream(0))
    frame = expected_e * row_weights(cell.flicker, sensor, len(expected_e), 0.002, start_s)[:, None]
    device = draw_device(sensor, frame.shape, device_stream(cell.condition.sensor, "bayer", 0))
    raw = read_out(frame, sensor, device, 0.002, exposure_stream(cell.condition, "bayer", 0))
    assert run_cell(cell).saturated == raw.saturated.mean()
    (steady,) = made(tmp_path, **lamps | {"flicker": ""}, exposures=("2ms",))
    assert steady.flicker is None
    assert run_cell(cell).picture != run_cell(steady).picture
    (by_rule,) = made(tmp_path, **lamps | {"levels": ("0.1cd/m2",)}, exposures=("auto",))
    assert by_rule.exposure_s == pytest.approx(0.06)  # of the longest time, 66 ms


def test_cells_of_a_hand_held_study_are_moved_alike_and_a_dark_frame_is_the_still_one(tmp_path: Path) -> None:
    by_hand = {"lens": LensTerms(shake="hand"), "seeds": (0,), "levels": ("1cd/m2",)}
    cells = made(tmp_path, **by_hand, exposures=("66ms",))
    sensor = cells[0].frame.sensor
    assert sensor.lens.shake_um == SHAKES["hand"]
    unmoved = np.load(cells[0].frame.electrons)
    assert unmoved.ndim == 3
    frame = behind_filters(shaken(unmoved * 0.066, sensor, 0.066, shake_stream(0)), sensor)
    device = draw_device(sensor, frame.shape, device_stream(cells[0].condition.sensor, "bayer", 0))
    raw = read_out(frame, sensor, device, 0.066, exposure_stream(cells[0].condition, "bayer", 0))
    row = run_cell(cells[0])
    assert row.saturated == raw.saturated.mean()
    neutral = neutral_electrons(sensor, cells[0].frame.light, 0.066)
    linear, _ = develop_to_scale(
        raw, PROCESSORS["bayer"], cells[0].colours, sensor, neutral, cells[0].white_cd_m2, balance=neutral
    )
    shown = np.asarray(Image.open(tmp_path / "pictures" / row.picture), dtype=int)
    assert (np.abs(shown - np.rint(encode_srgb(linear) * 255)) <= 1).all()

    (still,) = made(tmp_path, seeds=(0,), levels=("1cd/m2",), exposures=("1us",))
    (dark,) = made(tmp_path, **by_hand, exposures=("1us",))  # no time to move: the noise is the same
    assert run_cell(dark).picture == run_cell(still).picture
    assert run_cell(made(tmp_path, seeds=(0,), levels=("1cd/m2",), exposures=("66ms",))[0]).picture != row.picture


# Cells of a camera that bins: half as large, against a truth of half the size; never beside one that doesn't.


def quad_file(folder: Path, binning: str) -> str:
    path = folder / f"{binning}.toml"
    lines = preset_file("low_noise").read_text("utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(("cfa", "bits"))]
    path.write_text("\n".join([f'binning = "{binning}"', 'cfa = "quad_bayer"', "bits = 12", *kept]), "utf-8")
    return str(path)


@pytest.mark.parametrize("binning", ["charge", "digital"])
def test_a_binned_cell_is_measured_at_its_own_size(binning: str, tmp_path: Path) -> None:
    study = SAMPLE.small_study(tmp_path, sensors=(quad_file(tmp_path, binning),), processors=("bayer",))
    cell = SAMPLE.made_cells(tmp_path, study)[0]
    whole, row = np.load(cell.frame.truth), run_cell(cell)
    sizes = [opened((cell.pictures / name).read_bytes()).shape[:2] for name in (row.picture, row.truth)]
    assert sizes == [(whole.shape[0] // 2, whole.shape[1] // 2)] * 2
    assert row.psnr_db > 15.0  # one at a wrong scale, a factor of four, has under 10


def test_a_study_holds_cameras_that_bin_or_none(tmp_path: Path) -> None:
    refusal(
        SAMPLE.small_study,
        tmp_path,
        sensors=("low_noise", quad_file(tmp_path, "charge")),
        match=r"sensors: .* one bins, so that .*; give each a study of its own",
    )


def test_a_picture_of_odd_size_is_refused_for_a_camera_that_bins(tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr", (17, 20))
    study = SAMPLE.small_study(tmp_path, sensors=(quad_file(tmp_path, "charge"),))
    refusal(SAMPLE.made_cells, tmp_path, study, match=r"size: 17 x 20 pixels with binning")


# Keys and random streams of cells: by coordinates, so that what a study also asks for changes nothing.


AT = Condition(SceneChoice("still_life"), "own", "25cd/m2", "10ms", "low_noise")


def draws(stream: np.random.Generator) -> list[int]:
    return [int(x) for x in stream.integers(0, 2**63, 4)]


def test_a_stream_is_the_same_for_the_same_coordinates_and_writing() -> None:
    assert draws(exposure_stream(AT, "rgbw", 0)) == draws(exposure_stream(AT, "rgbw", 0))
    spelt = replace(AT, level="25.0 cd/m2", exposure="0.01s")
    assert draws(exposure_stream(AT, "rgbw", 0)) == draws(exposure_stream(spelt, "rgbw", 0))


def test_streams_are_those_of_the_first_release() -> None:
    """The digests of the coordinates as a row names them; another order or spelling would draw other pictures."""
    named = replace(AT, scene=SceneChoice("/a/desk.exr", "A"), sensor="/b/mine.toml")
    exposed = digest(["exposure", "desk.exr", "own", 25.0, "cd/m2", 0.01, "mine.toml", "rgbw", 7])
    chip = digest(["device", "mine.toml", "rgbw", 7])
    assert draws(exposure_stream(named, "rgbw", 7)) == draws(np.random.default_rng(int(exposed, 16)))
    assert draws(device_stream("/b/mine.toml", "rgbw", 7)) == draws(np.random.default_rng(int(chip, 16)))


def test_a_key_changes_with_each_thing_that_decides_a_picture() -> None:
    made_by = Provenance("llvm_ad_spectral", "llvm", "numpy", "{}")
    given = (AT, "bayer", (0,), "frame", 25.0, 0.01, made_by)
    others = (replace(AT, level="1lux"), "interleaved", (1,), "other", 25.1, 0.011)
    keys = [*cell_keys(*given)]
    for place, other in enumerate(others):
        changed = list(given)
        changed[place] = other
        keys.extend(cell_keys(*changed))  # type: ignore[arg-type]
    for field in ("variant", "readout_engine", "development_engine", "versions"):
        keys.extend(cell_keys(*given[:-1], replace(made_by, **{field: "another"})))  # type: ignore[arg-type]
    assert len(set(keys)) == 1 + 6 + 4
    assert cell_keys(*given) == keys[:1]
