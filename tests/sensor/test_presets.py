"""Presets as files: what ships, what a user copies and changes, and what is refused."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from isp.colour.colour_fit import fit_matrix
from isp.colour.white_balance import neutral_response
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, photons_per_joule, tristimulus
from rodcone.errors import InputError
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import BAYER, MOSAICS, RGBW, channels
from sensor.config import LensConfig, SensorConfig
from sensor.config_file import read_sensor
from sensor.curves import Responses, complementary, matched_transmittance, neutral_density, read_csv, read_curve, rgbw
from sensor.device import draw_device
from sensor.photodiodes import binned
from sensor.pixel import PixelConfig
from sensor.presets import VARIATIONS, low_noise, preset, preset_file, preset_names, table1_output, table1_pixel, vary
from sensor.readout import read_out
from studies.study.study_file import EXAMPLES

LEAST = "[pixel]\npitch_um = 2.2\nfill_factor = 0.9\nfull_well_e = 15000\nread_noise_e = 3\ndsnu_e = 4\nprnu = 0.01\n"
LENS = "[lens]\nf_number = 2.8\n"


def write(folder, text, name="camera.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@loop("name", preset_names())
def test_every_preset_is_a_file_that_says_what_it_is_and_names_every_pixel_term(name):
    text = preset_file(name).read_text("utf-8")
    assert text.startswith("# ")
    table = text.partition("[pixel]")[2].partition("[[readings]]" if preset(name).chip.readings else "[lens]")[0]
    of_real_cameras = {"row_noise_e", "telegraph_share", "telegraph_e", "response_bend", "ramp_step_e", "ramp_rise"}
    terms = {field.name for field in fields(PixelConfig)} - {"binned_well_e"} - of_real_cameras
    if preset(name).chip.readings:
        terms -= {"read_noise_e", "dsnu_e", "full_well_e"}  # each reading's own
    assert {line.split(" = ")[0] for line in table.splitlines() if " = " in line and line[0] != "#"} == terms
    assert preset(name).cfa == RGBW


@loop(
    ("camera", "read_noise_e", "dsnu_e", "prnu", "diffraction"),
    [
        (table1_pixel, 4580.0 / 30.0, 6000.0 / 30.0, 0.017, 0.0),  # the paper has no blur
        (table1_output, 4580.0 / (30.0 * 7.98), 6000.0 / (30.0 * 7.98), 0.017, 0.0),
        (low_noise, 1.5, 1.0, 0.01, 1.0),
    ],
)
@loop("cfa", ["rgbw", "bayer"])
def test_the_files_hold_the_last_bit_of_table_1_s_quotients(camera, read_noise_e, dsnu_e, prnu, diffraction, cfa):
    pixel = PixelConfig(2.2, 0.9, 15_000.0, read_noise_e, dsnu_e, prnu, analog_gain=7.98)
    expected = SensorConfig(pixel, LensConfig(2.8, diffraction=diffraction), cfa=MOSAICS[cfa])
    assert camera(cfa) == expected
    assert camera(cfa).gain_e_per_dn == expected.gain_e_per_dn


@loop(("pitch_um", "f_number"), [(6.0, 4.0), (3.0, 2.8), (2.0, 4.0)])
def test_variants_for_figures_1_and_5_change_pitch_well_and_f_number_alone(pitch_um, f_number):
    sensor, base = preset(f"table1_output_{pitch_um:g}um"), table1_output()
    well_e = 15_000.0 * (pitch_um / 2.2) ** 2
    assert sensor.pixel.full_well_e == pytest.approx(well_e, rel=1e-12)
    assert sensor.pixel == replace(base.pixel, pitch_um=pitch_um, full_well_e=sensor.pixel.full_well_e)
    assert sensor == replace(base, pixel=sensor.pixel, lens=LensConfig(f_number))


def test_a_copy_that_was_changed_reads_as_it_was_changed(tmp_path):
    text = preset_file("low_noise").read_text("utf-8").replace("read_noise_e = 1.5", "read_noise_e = 2.5")
    path = write(tmp_path, text.replace('cfa = "rgbw"', 'cfa = "rccc"'))
    for given in (path, str(path)):
        sensor = preset(given)
        assert sensor.pixel == replace(low_noise().pixel, read_noise_e=2.5)
        assert sensor.cfa == ("RC", "CC")
    assert preset(path, "bayer").cfa == BAYER
    assert preset(path, ["GR", "BG"]).cfa == ("GR", "BG")


DARK = "dark_current_e_per_s = 3.0\nhot_pixel_share = 0.5\nhot_pixel_dark_current_e_per_s = 40.0\n"
TEMPERATURE = "[temperature]\nchip_c = 50\nmeasured_c = 36\ndoubling_k = 7\n"


def test_dark_current_doubles_with_each_so_many_kelvin_that_the_chip_is_warmer_and_nothing_else_changes(tmp_path):
    measured = read_sensor(write(tmp_path, LEAST + DARK + LENS))
    for chip_c, factor in ((50, 4.0), (36, 1.0), (29, 0.5), (39.5, 2**0.5)):
        table = TEMPERATURE.replace("chip_c = 50", f"chip_c = {chip_c}")
        sensor = read_sensor(write(tmp_path, LEAST + DARK + LENS + table))
        currents = sensor.pixel.dark_current_e_per_s, sensor.pixel.hot_pixel_dark_current_e_per_s
        assert currents == pytest.approx((3.0 * factor, 40.0 * factor), rel=1e-12)
        names = ("dark_current_e_per_s", "hot_pixel_dark_current_e_per_s")
        colder = replace(sensor.pixel, **{name: getattr(measured.pixel, name) for name in names})
        assert replace(sensor, pixel=colder) == measured
    # a dark frame of 10 s, half of whose pixels are hot, has four times the charge: 4.5 errors of a mean of 4096
    warm = read_sensor(write(tmp_path, LEAST + DARK + LENS + TEMPERATURE))
    device = draw_device(warm, (64, 64), np.random.default_rng(1))
    dn = read_out(np.zeros((64, 64)), warm, device, 10.0, np.random.default_rng(2)).dn
    for hot, mean_e in ((False, 120.0), (True, 1720.0)):
        read_e = (dn[device.hot == hot] - warm.black_dn) * warm.gain_e_per_dn
        assert read_e.mean() == pytest.approx(mean_e, abs=4.5 * np.sqrt((mean_e + 30) / read_e.size))


@loop(
    ("text", "parts"),
    [
        ("", ("pixel is missing", "add it")),
        (LEAST + LENS + TEMPERATURE.replace("measured_c = 36\n", ""), ("temperature: measured_c is missing",)),
        (
            LEAST + LENS + TEMPERATURE.replace("doubling_k = 7", "doubling_k = 0"),
            ("temperature: doubling_k: 0", "kelvin"),
        ),
        (LEAST + LENS + TEMPERATURE.replace("chip_c = 50", "chip_c = 323"), ("temperature: chip_c: 323", "Celsius")),
        (LEAST, ("lens is missing", "add it")),
        ("pixel = 3\n" + LENS, ("pixel: the value is not a table",)),
        (LEAST + "read_nose_e = 3\n" + LENS, ("pixel key: 'read_nose_e' is unknown", "did you mean 'read_noise_e'?")),
        ("bit = 12\n" + LEAST + LENS, ("key: 'bit'", "did you mean 'bits'?")),
        (LEAST.replace("prnu = 0.01\n", "") + LENS, ("pixel: prnu is missing", "see rodcone new preset")),
        (LEAST.replace("prnu = 0.01", "prnu = 1.7") + LENS, ("prnu: 1.7", "1.7 % is 0.017")),
        ("bits = 20\n" + LEAST + LENS, ("bits: 20", "1 to 16")),
        ("window_nm = [400]\n" + LEAST + LENS, ("window_nm: [400]", "[shortest, longest]")),
        ('cfa = "bayr"\n' + LEAST + LENS, ("cfa: 'bayr'", "did you mean 'bayer'?")),
        ('cfa = ["RG", "B"]\n' + LEAST + LENS, ("cfa", "differ in length")),
        ("cfa = 3\n" + LEAST + LENS, ("cfa: 3",)),
        ('cfa = ["RQ"]\n' + LEAST + LENS, ("responses: channel: 'Q'",)),
        ("[pixel\n", ("can't be read", "rodcone new preset")),
    ],
)
def test_a_file_that_describes_no_camera_is_refused_in_one_line_with_its_name(tmp_path, text, parts):
    refusal(read_sensor, write(tmp_path, text), words=("camera.toml", *parts))


# Measured responses

CURVES = "wavelength_nm,R,G,B,W\n380,0,0,0.2,0.9\n500,0.1,0.8,0.8,0.9\n600,0.9,0.3,0,0.9\n780,0.8,0.1,0,0.9\n"
STATED = '[responses]\ncsv = "curves.csv"\nrange_nm = [400, 700]\n'


def test_measured_responses_are_read_beside_the_file_with_all_that_it_states(tmp_path):
    write(tmp_path, CURVES, "curves.csv")
    write(tmp_path, "wavelength_nm,t\n380,1\n600,1\n700,0\n", "cut.csv")
    write(tmp_path, "wavelength_nm,qe\n380,0.5\n780,0.4\n", "qe.csv")
    plain = read_sensor(write(tmp_path, LEAST + LENS + STATED + 'quantum_efficiency = "included"\n'))
    expected = read_csv(tmp_path / "curves.csv", range_nm=(400.0, 700.0))
    both = read_sensor(write(tmp_path, LEAST + LENS + STATED + 'quantum_efficiency = "qe.csv"\nir_cut = "cut.csv"\n'))
    numbers = read_sensor(write(tmp_path, LEAST + LENS + STATED + "quantum_efficiency = 0.5\nir_cut = 650\n"))
    cut = Spectrum([380.0, 600.0, 700.0], [1.0, 1.0, 0.0])
    efficiency = Spectrum([380.0, 780.0], [0.5, 0.4])
    for sensor, curves in (
        (plain, expected),
        (both, read_csv(tmp_path / "curves.csv", range_nm=(400, 700), ir_cut=cut, quantum_efficiency=efficiency)),
        (numbers, read_csv(tmp_path / "curves.csv", range_nm=(400, 700), ir_cut=650.0, quantum_efficiency=0.5)),
    ):
        for channel in "RGBW":
            one, other = sensor.responses.curves[channel], curves.curves[channel]
            np.testing.assert_array_equal(one.wavelength_nm, other.wavelength_nm)
            np.testing.assert_array_equal(one.values, other.values)
    assert plain.responses.curves["W"].values.max() == 0.9
    assert numbers.responses.curves["W"].values.max() == 0.45


@loop(
    ("text", "parts"),
    [
        (STATED, ("responses: quantum_efficiency is missing", '"included"')),
        ('[responses]\ncsv = "curves.csv"\nquantum_efficiency = 0.5\n', ("range_nm is missing",)),
        ("[responses]\nrange_nm = [400, 700]\nquantum_efficiency = 0.5\n", ("csv is missing",)),
        (STATED + 'quantum_efficency = "included"\n', ("responses key: 'quantum_efficency'", "did you mean")),
        (STATED + "quantum_efficiency = 56.0\n", ("quantum_efficiency: 56.0", "0 to 1")),
        (STATED + 'quantum_efficiency = "absent.csv"\n', ("absent.csv", "can't be read")),
        (STATED + 'quantum_efficiency = "curves.csv"\n', ("4 columns beside wavelength_nm",)),
        (
            STATED.replace("[400, 700]", "[300, 700]") + 'quantum_efficiency = "included"\n',
            ("range_nm: (300.0, 700.0)",),
        ),
        (STATED.replace('"curves.csv"', "3") + "quantum_efficiency = 0.5\n", ("csv: 3 is not a text in quotes",)),
        ("responses = 3\n", ("responses: the value is not a table",)),
    ],
)
def test_responses_that_leave_something_to_guess_are_refused(tmp_path, text, parts):
    write(tmp_path, CURVES, "curves.csv")
    whole = text + LEAST + LENS if text.startswith("responses =") else LEAST + LENS + text
    refusal(read_sensor, write(tmp_path, whole), words=("camera.toml", *parts))


def test_responses_take_every_spelling_and_unit_of_a_table(tmp_path):
    write(tmp_path, "380 0,1 0,2 0,3\n780 0,4 0,1 0,2\n", "x.spd")
    bayer = (
        'cfa = "bayer"\n' + LEAST + LENS + STATED.replace("curves.csv", "x.spd") + 'quantum_efficiency = "included"\n'
    )
    refusal(
        read_sensor,
        write(tmp_path, bayer),
        match=r"'x.spd' has the columns 1, 2, 3; allowed: one for each channel of the mosaic, R, G, B; rename them",
    )
    write(tmp_path, "nm R G B\n400 0,1 0,2 0,3\n700 0,4 0,1 0,2\n", "x.spd")
    per_photon = read_sensor(write(tmp_path, bayer)).responses.curves["R"]
    per_watt = read_sensor(write(tmp_path, bayer + 'unit = "per_watt"\n')).responses.curves["R"]
    assert per_photon.values == pytest.approx([0.1, 0.4])
    assert per_watt.values == pytest.approx([0.1 * 1239.841984 / 400, 0.4 * 1239.841984 / 700], rel=1e-9)
    refusal(read_sensor, write(tmp_path, bayer + 'unit = "per_lux"\n'), match="per_lux")


def test_a_window_that_is_not_stated_is_told_where_it_takes_some_of_a_response(tmp_path):
    write(tmp_path, "wavelength_nm,W\n350,0\n400,0.5\n700,0.5\n1000,0.2\n", "nir.csv")
    mono = 'cfa = "mono"\n' + LEAST + LENS
    stated = '[responses]\ncsv = "nir.csv"\nrange_nm = [350, 1000]\nquantum_efficiency = "included"\n'
    with pytest.warns(UserWarning, match=r"350 to 1000 nm it lets in 380 to 780; give window_nm = \[350, 1000\] too"):
        read_sensor(write(tmp_path, mono + stated))
    for first, fix in ((500, r"too, or range_nm = \[500, 780\]$"), (790, r"give window_nm = \[790, 1000\] too$")):
        with pytest.warns(UserWarning, match=fix):
            read_sensor(write(tmp_path, mono + stated.replace("350,", f"{first},")))
    for whole in ("window_nm = [380, 780]\n" + mono + stated, mono + stated + "ir_cut = 700\n"):
        read_sensor(write(tmp_path, whole.replace("350,", "375,")))


def test_a_prnu_in_per_cent_is_told(tmp_path):
    with pytest.warns(UserWarning, match=r"prnu = 0\.7 is 70% of the signal; if per cent were meant, .* give 0\.007$"):
        read_sensor(write(tmp_path, LEAST.replace("prnu = 0.01", "prnu = 0.7") + LENS))


def test_without_responses_the_project_s_own_are_used_and_c_is_w_s_curve():
    assert low_noise().responses is rgbw()
    clear = preset("low_noise", "rccc").responses
    assert clear.curves["C"] is rgbw().curves["W"]
    assert clear.curves["R"] is rgbw().curves["R"]


def test_an_unknown_preset_is_refused_by_name_also_for_its_file(tmp_path):
    for call in (preset, preset_file):
        refusal(call, "table1_pixl", match=r"sensor preset: 'table1_pixl' is unknown.*did you mean 'table1_pixel'")
    refusal(preset, Path(tmp_path) / "absent.toml", match=r"absent\.toml")


# Filters of other cameras: sums and densities of the own curves, and cameras that carry them.


NM = DEFAULT_WAVELENGTH_NM
WIDTH = np.full(NM.shape, 10.0)


def test_complementary_filters_pass_what_two_primaries_do() -> None:
    primaries = dict(zip("RGB", rgbw().band_average(("R", "G", "B"), NM, WIDTH), strict=True))
    cyan, magenta, yellow, white = complementary(rgbw()).band_average(("C", "M", "Y", "W"), NM, WIDTH)
    assert cyan == pytest.approx(primaries["G"] + primaries["B"])
    assert magenta == pytest.approx(primaries["R"] + primaries["B"])
    assert yellow == pytest.approx(primaries["R"] + primaries["G"])
    assert white == pytest.approx(rgbw().curves["W"].band_average(NM, WIDTH))
    # a filter is no brighter than none
    visible = (NM > 420) & (NM < 680)
    assert np.all(np.array([cyan, magenta, yellow])[:, visible] < white[visible])


def test_complementary_colours_lead_to_the_same_colours_as_the_primaries() -> None:
    # balanced C, Y and M are mixtures of balanced R, G and B, so the fitted matrices differ by exactly that mixture
    surfaces = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker_reflectances()])
    light = illuminant("D65").band_average(NM, WIDTH)
    primary = fit_matrix(rgbw().band_average(("R", "G", "B"), NM, WIDTH), NM, light, surfaces)
    curves = complementary(rgbw())
    other = fit_matrix(curves.band_average(("C", "Y", "M"), NM, WIDTH), NM, light, surfaces)
    averages = rgbw().band_average(("R", "G", "B"), NM, WIDTH)
    red, green, blue = averages @ (light * photons_per_joule(NM))
    mixture = np.array([[0, green, blue], [red, green, 0], [red, 0, blue]])
    mixture /= mixture.sum(axis=1, keepdims=True)
    assert other @ mixture == pytest.approx(primary, abs=1e-9)


def test_a_matched_density_gives_w_greens_electrons() -> None:
    share = matched_transmittance(rgbw())
    green, white = neutral_response(("G", "W"), neutral_density(rgbw()))
    assert white == pytest.approx(green, rel=1e-12)
    assert 1 / 7 < share < 1 / 4  # the paper: W gathers about 6 times green's light
    for channel in "RGB":
        assert neutral_density(rgbw()).curves[channel] is rgbw().curves[channel]


@loop("name", [*MOSAICS, *VARIATIONS])
def test_a_varied_camera_keeps_everything_but_mosaic_and_filters(name: str) -> None:
    camera = preset("low_noise")
    other = vary(camera, name)
    assert (other.pixel, other.lens, other.bits, other.window_nm) == (
        camera.pixel,
        camera.lens,
        camera.bits,
        camera.window_nm,
    )
    assert other.cfa == (VARIATIONS[name][0] if name in VARIATIONS else MOSAICS[name])
    assert set(channels(other.cfa)) <= set(other.responses.curves)


@loop("binning", ["charge", "digital"])
def test_a_camera_that_bins_shows_no_quad(binning: str) -> None:
    camera = binned(preset("low_noise", "quad_bayer"), binning)
    assert vary(camera, "rgbw").cfa == MOSAICS["rgbw"]
    assert vary(camera, "mono").cfa == ("W",)
    for name in ("quad_bayer", "quad_rgbw"):
        refusal(vary, camera, name, match=rf"cfa: '{name}' .*that bins.* such as {name[5:]}; give that")


def test_what_cannot_be_made_is_refused() -> None:
    refusal(vary, preset("low_noise"), "rgbwnd", match=r"cfa: 'rgbwnd' is unknown; .*did you mean 'rgbw_nd'")
    with pytest.raises(InputError, match=r"responses: no curve of B; allowed: R, G, B and W; add it"):
        complementary(Responses({channel: rgbw().curves[channel] for channel in "RG"}))
    dim = Responses({"G": rgbw().curves["W"], "W": rgbw().curves["G"]})
    without = Responses({name: rgbw().curves[name] for name in "RGB"})
    refusal(neutral_density, without, match=r"responses: no curve of W; allowed: R, G, B and W; add it")
    refusal(matched_transmittance, dim, match=r"responses: W collects .* allowed: W more than G")
    bright = {channel: Spectrum(np.array([400.0, 700.0]), np.array([0.6, 0.6])) for channel in "RGB"}
    refusal(complementary, Responses(bright), match=r"responses: C reaches 1.2 electrons a photon")


SENSORS = EXAMPLES / "sensors"


@loop(("name", "factor"), [("narrow", 0.5), ("wide", 2.0)])
def test_narrow_and_wide_curves_keep_their_peaks_and_gather_by_the_factor(name: str, factor: float) -> None:
    fine = np.arange(385.5, 780.0)
    own, other = (
        responses.band_average(("R", "G", "B", "W"), fine, np.ones_like(fine))
        for responses in (rgbw(), read_csv(SENSORS / f"curves_{name}.csv"))
    )
    assert other.max(axis=1) == pytest.approx(own.max(axis=1), rel=0.02)  # points 4 nm apart
    assert np.abs(fine[other.argmax(axis=1)] - fine[own.argmax(axis=1)]).max() <= 2.0
    # R lies far enough from the curves' ends for its whole area to grow by the factor; G and B lose a tail at 380 nm
    assert other[0].sum() == pytest.approx(factor * own[0].sum(), rel=0.01)
    assert (other[1:3].sum(axis=1) < 1.01 * factor * own[1:3].sum(axis=1)).all()
    np.testing.assert_allclose(other[3], own[3], atol=1e-4)


def test_colorimetric_curves_collect_in_proportion_to_xyz_under_any_light() -> None:
    curves = read_csv(SENSORS / "curves_xyz.csv")
    nm = np.arange(380.5, 780.0)
    width = np.ones_like(nm)
    found = []
    for light in ("D65", "A"):
        watts = illuminant(light).band_average(nm, width)
        electrons = curves.band_average(("R", "G", "B"), nm, width) @ (watts * photons_per_joule(nm))
        found.append(electrons / tristimulus(watts, nm, width))
    np.testing.assert_allclose(found[1], found[0], rtol=2e-3)  # points 4 nm apart, six places


def test_open_dyes_leave_the_visible_alone_and_meet_silicon_beyond() -> None:
    opened = read_csv(SENSORS / "curves_infrared_open.csv")
    visible, beyond = np.arange(400.0, 680.0, 4.0), np.arange(832.0, 1060.0, 4.0)
    for channel in "RGB":
        own, now = (
            np.interp(visible, one.curves[channel].wavelength_nm, one.curves[channel].values)
            for one in (rgbw(), opened)
        )
        np.testing.assert_allclose(now, own, atol=2e-3)  # 1 / (1 + exp(80 / 12)) is 0.0013
        far, silicon = (
            np.interp(beyond, opened.curves[x].wavelength_nm, opened.curves[x].values) for x in (channel, "W")
        )
        np.testing.assert_allclose(far, silicon, rtol=4e-3)  # 1 / (1 + exp(-70 / 12)) is 0.9971


def test_the_filter_keeps_the_infrared_out_and_half_of_660_nm() -> None:
    curve = read_curve(SENSORS / "infrared_filter.csv")
    np.testing.assert_allclose(curve.values, 1 / (1 + np.exp((curve.wavelength_nm - 660.0) / 5.0)), atol=6e-7)


def test_the_sensors_of_examples_are_low_noise_but_for_their_curves_and_window() -> None:
    own = preset("low_noise")
    cameras = {
        name: preset(SENSORS / f"{name}.toml") for name in ("narrow", "wide", "xyz", "with_filter", "without_filter")
    }
    for camera in cameras.values():
        assert (camera.pixel, camera.lens, camera.bits, camera.cfa) == (own.pixel, own.lens, own.bits, own.cfa)
    # W behind the filter, by the product of curve and transmittance on the points of both
    nm = np.array([500.0, 640.0, 660.0, 680.0, 900.0])
    kept, all_of_it = (
        np.interp(nm, cameras[name].responses.curves["W"].wavelength_nm, cameras[name].responses.curves["W"].values)
        for name in ("with_filter", "without_filter")
    )
    np.testing.assert_allclose(kept / all_of_it, 1 / (1 + np.exp((nm - 660) / 5)), atol=1e-5)
