"""`rodcone characterise`: table, JSON and a plot that stands alone."""

import json
import re
from dataclasses import replace
from math import pi
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import call, check_refusals

from sensor.capture import expose
from sensor.device import draw_device
from sensor.emva1288.characterise import characterise, configured
from sensor.presets import low_noise
from sensor.raw_files.raw_file import write_raw
from studies.photograph.snr import electrons_at_snr

SMALL = ["--height", "32", "--width", "48"]


@pytest.fixture(scope="module")
def found():
    return characterise(low_noise(), (32, 48))


def test_the_table_sets_every_figure_beside_its_configured_value(found):
    code, out, err = call(["characterise", "low_noise", *SMALL])
    assert (code, err) == (0, "")
    rows = {line[:18].strip(): line.split() for line in out.splitlines()}
    for figure in found.figures:
        assert f"{figure.configured:.5g}" in rows[figure.name]
        assert f"{figure.measured:.5g}" in rows[figure.name]
        assert figure.unit in rows[figure.name]
        if figure.error:  # the last column, counted from the three before it, which have five and two digits
            configured, measured, error, off = map(float, rows[figure.name][-4:])
            assert off == pytest.approx((measured - configured) / error, abs=0.2, rel=0.06)
    assert all(note in out for note in found.notes)


def test_json_holds_the_figures_and_the_series_and_no_nan(found):
    code, out, _ = call(["characterise", "low_noise", "--json", *SMALL])
    assert code == 0
    data = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    truth = configured(low_noise(), 0.01)
    assert {figure["name"]: figure["configured"] for figure in data["figures"]} == truth
    assert [figure["measured"] for figure in data["figures"]] == [figure.measured for figure in found.figures]
    assert data["series"]["variance_dn2"] == found.transfer.variance_dn2.tolist()
    assert {len(values) for values in data["series"].values()} == {found.transfer.light_e.size}
    assert None in data["series"]["linearity_share"]  # outside 5-95 % of saturation


@pytest.mark.thorough
def test_the_plot_is_one_svg_with_nothing_from_outside(tmp_path):
    path = tmp_path / "new" / "plot.svg"
    assert call(["characterise", "low_noise", "-o", str(path), *SMALL])[0] == 0
    text = path.read_text("utf-8")
    assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    assert set(re.findall(r"(?:href=\"|url\()(.)|src=|@import", text)) == {"#"}
    assert "nan" not in text.lower()
    assert list(tmp_path.rglob("*")) == [tmp_path / "new", path]


def test_bad_input_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("low_nois", "did you mean 'low_noise'?"),
        ("low_noise -o plot.png", "allowed: .svg"),
        ("low_noise --height 4", "height: 4"),
        ("absent.toml", "can't be read"),
        ("", "PRESET"),
        ("dual_gain", "sensor: 2 readings of a pixel; allowed: one"),
        ("white_apart", "channel: none given for a camera that reads W apart; allowed: R, G, B, W; give one"),
        ("white_apart --channel V", "channel of 'white_apart', which reads channels apart: 'V' is unknown"),
        ("dual_gain --reading 3", "reading: 3 is outside 1 to 2"),
        ("low_noise --reading 1", "reading: 1 of 'low_noise', whose pixels are read once"),
        ("--from a.dng b.dng --reading 1", "reading: 1 beside raw files"),
    )
    check_refusals("characterise", rows, tmp_path)


def test_of_several_readings_one_is_measured():
    code, out, _ = call(["characterise", "dual_gain", "--reading", "2", *SMALL])
    assert code == 0
    assert re.search(r"^dark noise +e- +5\.56", out, re.MULTILINE)


# `rodcone characterise --from`: a real camera's raw files measured, and a preset of them.

SENSOR = replace(low_noise("bayer"), pixel=replace(low_noise().pixel, read_noise_e=3.0, dsnu_e=2.0))


@pytest.fixture
def frames(tmp_path):
    shape = (64, 64)
    device, rng = draw_device(SENSOR, shape, np.random.default_rng(1)), np.random.default_rng(2)
    paths = [tmp_path / name for name in ("flat1.tif", "flat2.tif", "dark1.tif", "dark2.tif")]
    for path, light_e in zip(paths, (7000.0, 7000.0, 0.0, 0.0), strict=True):
        write_raw(expose(np.full(shape, light_e), SENSOR, 0.01, device, rng, exact=True), path)
    return paths[:2], paths[2:]


def test_it_prints_intervals_and_writes_a_preset(frames, tmp_path):
    flats, darks = frames
    out = tmp_path / "mine.toml"
    code, printed, err = call(["characterise", "--from", *flats, "--dark", *darks, "-o", out])
    assert code == 0
    table = printed.splitlines()[:5]
    assert [line.split()[0] for line in table] == ["figure", "gain", "read", "DSNU", "PRNU"]
    assert "fewer than 3 lights, or lights that leave" in printed
    for line in table[1:]:
        measured, low, high = map(float, line.split()[-3:])
        assert low < measured < high
    assert "add pitch_um and fill_factor, which" in err
    assert out.read_text("utf-8").startswith("# A camera measured from flat1.tif and others.")
    found = json.loads(call(["characterise", "--from", *flats, "--dark", *darks, "--json"])[1])
    assert found["gain_dn_per_e"]["low"] < 1 / SENSOR.gain_e_per_dn < found["gain_dn_per_e"]["high"]


def test_what_is_not_allowed_is_told_in_one_line(frames, tmp_path):
    pytest.importorskip("rawpy", reason="rodcone[photographs] (LibRaw) is not installed")
    flats, darks = frames
    (tmp_path / "taken.toml").write_text("mine", "utf-8")
    (tmp_path / "broken.dng").write_bytes(b"II*\0" + b"\xff" * 60)
    flat, dark = (" ".join(map(str, paths)) for paths in (flats, darks))
    rows = (
        ("", "preset: none is given"),
        (f"low_noise --from {flat} --dark {dark}", "beside raw files"),
        (f"--from {flat}", "dark frames: 0 given"),
        (f"--dark {dark}", "flat frames: 0 given"),
        (f"--from {flat} --dark {dark} -o a.svg", ".toml"),
        (f"--from {flat} --dark {dark} -o {tmp_path / 'taken.toml'}", "exists"),
        (f"--from {flat} --dark {darks[0]} {tmp_path / 'absent.dng'}", "there is no such file"),
        (f"--from {flat} --dark {darks[0]} {tmp_path / 'broken.dng'}", "broken.dng"),
        (f"--from {flat} --dark {dark} --window 0", "window: 0 pixels"),
        (f"--from {tmp_path}", "no descriptor"),
        (f"--from {tmp_path} --dark {dark}", "is a set of frames; allowed: alone"),
        ("low_noise --window 20", "window: 20"),
    )
    check_refusals("characterise", rows, tmp_path)


# `rodcone snr`: a table, JSON, a plot, and what isn't allowed.


def test_a_faster_lens_needs_less_light_as_the_camera_equation_has_it() -> None:
    needed = {}
    for number in ("2", "4"):
        code, out, _ = call(["snr", "low_noise", "--at", "10", "--f-number", number, "--json"])
        assert code == 0
        needed[number] = json.loads(out)["low_noise"][1]["luminance_cd_m2"]
    # irradiance is pi L / (1 + 4 N^2) of a far scene
    assert needed["4"] / needed["2"] == pytest.approx((1 + 4 * 16) / (1 + 4 * 4), rel=1e-9)


def test_the_table_holds_the_light_of_each_channel() -> None:
    head, _, green, *_ = call(["snr", "low_noise", "--at", "10"])[1].splitlines()
    assert head.split()[2:4] == ["electrons", "cd/m2"]
    name, channel, *figures = green.split()
    electrons, luminance_cd_m2, lux = map(float, figures)
    assert (name, channel) == ("low_noise", "G")
    assert electrons == pytest.approx(electrons_at_snr(10.0, low_noise(), 0.033), rel=1e-3)
    assert lux == pytest.approx(luminance_cd_m2 * pi / 0.18, rel=1e-3)


def test_several_sensors_stand_in_one_table_and_one_plot(tmp_path: Path) -> None:
    code, out, _ = call(["snr", "low_noise", "table1_output", "--at", "90", "-o", str(tmp_path / "snr.svg")])
    assert code == 0
    assert len(out.splitlines()) == 1 + 8 + 1  # table1_output's PRNU of 1.7 % ends at an SNR of 59
    assert "no light is enough" in out
    drawn = (tmp_path / "snr.svg").read_text("utf-8")
    assert "low_noise G" in drawn
    assert "table1_output W" in drawn


def test_what_is_not_allowed_is_refused(tmp_path: Path) -> None:
    rows = (
        ("low_nois", "did you mean 'low_noise'?"),
        ("low_noise --at 0", "at:"),
        ("low_noise --exposure 20", "write 20ms or 20s"),
        ("low_noise --light D64", "D65"),
        ("low_noise -o snr.png", ".svg"),
    )
    check_refusals("snr", rows, tmp_path)
