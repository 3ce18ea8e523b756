"""`rodcone characterise --from`: a real camera's raw files measured, and a preset of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import call, check_refusals

from sensor.capture import expose
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw_files.raw_file import write_raw

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
    assert [line.split()[0] for line in printed.splitlines()] == ["figure", "gain", "read", "DSNU", "PRNU"]
    for line in printed.splitlines()[1:]:
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
        ("low_noise --window 20", "window: 20"),
    )
    check_refusals("characterise", rows, tmp_path)
