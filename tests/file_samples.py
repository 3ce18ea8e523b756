"""Files that tests and the fuzzer begin from: raw images with hard numbers, and what other programs write."""

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from builders import raw_image

from sensor.calibration import ColourCalibration
from sensor.cfa import BAYER, Tile, channels
from sensor.raw import RawImage
from sensor.raw_files.dng import rational
from sensor.raw_files.raw_file import write_raw
from sensor.raw_files.tiff import CFA, Values, write_mosaic
from sensor.raw_files.tiff import text as ascii_text


def colour(count: int) -> ColourCalibration:
    """Numbers without a short decimal or a small fraction."""
    rng = np.random.default_rng(count)
    a, d65 = (np.eye(count, 3) + 0.1 * rng.standard_normal((count, 3)) for _ in range(2))
    back = np.linalg.pinv(a), np.linalg.pinv(d65)
    return ColourCalibration(rng.uniform(0.3, 2.0, count), np.eye(3) + 0.1 * rng.random((3, 3)), a, d65, *back)


def exposure(cfa: Tile = BAYER, shape: tuple[int, int] = (30, 41), bits: int = 14) -> RawImage:
    """Raw image that holds its lowest and its highest number; colours where the mosaic has R, G and B."""
    dn = np.random.default_rng(bits).integers(0, 2**bits, shape, dtype=np.uint16)
    dn.flat[:2] = 0, 2**bits - 1
    names = channels(cfa)
    return RawImage(
        dn,
        cfa,
        black_dn=10 if bits > 4 else 0,
        white_dn=2**bits - 1,
        gain_e_per_dn=0.1 + 0.2,
        read_noise_e=1.5,
        dsnu_e=1 / 3,
        prnu=0.017,
        exposure_s=1 / 30,
        camera="low_noise",
        f_number=2.8,
        iso=51.56,
        colour=colour(len(names)) if set("RGB") <= set(names) else None,
        engine="numpy",
    )


def profiled(path: Path) -> Path:
    """Bayer negative of 0.8 electrons a DN over black 100, read noise 3 e-, with colours and so a noise profile."""
    plain = ColourCalibration(np.ones(3), np.eye(3), *[np.eye(3)] * 4)
    dark = {"gain_e_per_dn": 0.8, "read_noise_e": 3.0, "dsnu_e": 0.0, "iso": 400.0}
    write_raw(raw_image(np.full((16, 16), 500), BAYER, colour=plain, **dark), path)
    return path


def same(one: RawImage, other: RawImage) -> bool:
    """Whether every field is equal, numbers bit for bit and of the same type."""
    for field in fields(RawImage):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "dn":
            equal = a.dtype == b.dtype and np.array_equal(a, b)
        elif field.name == "colour" and None not in (a, b):
            equal = all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(ColourCalibration))
        else:
            equal = a == b and type(a) is type(b)
        if not equal:
            return False
    return True


# A digital negative of another camera: a black level a site, row by row, and XYZ under D65 to the camera.
CAMERA_BLACK, CAMERA_WHITE = (512.0, 514.0, 510.0, 520.0), 16_000
CAMERA_MATRIX = np.array([[0.9, -0.3, -0.1], [-0.4, 1.2, 0.2], [-0.05, 0.15, 0.6]])


def over_black(electrons: np.ndarray) -> np.ndarray:
    """DN of that camera's mosaic at one electron a DN, each site over its own black level."""
    black = np.tile(np.array(CAMERA_BLACK).reshape(2, 2), (electrons.shape[0] // 2, electrons.shape[1] // 2))
    return np.rint(np.minimum(electrons + black, CAMERA_WHITE)).astype(np.uint16)


def other_camera(
    path: Path,
    dn: np.ndarray,
    *,
    pattern: tuple[int, ...] = (0, 1, 1, 2),
    repeat: tuple[int, int] = (2, 2),
    orientation: int = 1,
    noise: tuple[float, ...] | None = None,
    colours: bool = True,
    more: Mapping[int, tuple[str, Values]] | None = None,
) -> Path:
    """Digital negative of some camera, without a word from rodcone."""
    tags: dict[int, tuple[str, Values]] = {
        254: ("I", (0,)),
        271: ascii_text("Other"),
        272: ascii_text("Model X"),
        274: ("H", (orientation,)),
        33421: ("H", repeat),
        33422: ("B", bytes(pattern)),
        50706: ("B", bytes((1, 4, 0, 0))),
        50707: ("B", bytes((1, 1, 0, 0))),
        50708: ascii_text("Other Model X"),
        50710: ("B", bytes((0, 1, 2))),
        50711: ("H", (1,)),
        50713: ("H", (2, 2)),
        50714: ("2I", rational(CAMERA_BLACK)),
        50717: ("I", (CAMERA_WHITE,)),
    }
    if colours:
        tags[50721] = ("2i", rational(CAMERA_MATRIX))
        tags[50728] = ("2I", rational((0.5, 1.0, 0.7)))
        tags[50778] = ("H", (21,))
    if noise is not None:
        tags[51041] = ("d", noise)
    tags |= more or {}
    write_mosaic(path, dn, CFA, dict(sorted(tags.items())), {33434: ("2I", rational(0.01)), 33437: ("2I", rational(4))})
    return path


# An EMVA 1288 report: where it is from, and its symbols.
REPORT_HEAD = 'camera = "X1"\nmaker = "M"\nsource = "report 7"\ndate = "2020-01-02"\n'
REPORT = """bits = 12
black_level_dn = 95
[report]
pixel_pitch_um = 3.5
K = 0.4
sigma_d = 5.0
DSNU1288 = 2.0
PRNU1288 = 0.5
mu_e_sat = 9500
mu_I = 100.0
exposure_s = 0.09
eta = 60
lambda_nm = 530
SNR_max_dB = 39.8
"""
LIBRARY_NM = np.arange(380, 785, 5)


def camera_json(**changes: Any) -> dict[str, Any]:
    """One camera as rawtoaces-data has it: bell curves, of equal power, green's greatest 1; `a__b` is b within a."""
    peaks = {"R": (600, 0.6), "G": (540, 1.0), "B": (460, 0.8)}
    curves = [peak * np.exp(-(((LIBRARY_NM - at) / 40) ** 2)) for at, peak in peaks.values()]
    header = {
        "manufacturer": "Maker",
        "model": "Model One",
        "document_creator": "lab",
        "document_creation_date": "2025-11-09T20:35:04Z",
        "license": "Apache-2.0",
        "measurement_equipment": "double monochromator",
    }
    rows = {str(nm): [float(curve[index]) for curve in curves] for index, nm in enumerate(LIBRARY_NM)}
    data = {"units": "relative", "index": {"main": ["R", "G", "B"]}, "data": {"main": rows}}
    content: dict[str, Any] = {"header": header, "spectral_data": data}
    for path, value in changes.items():
        part = content
        *parents, key = path.split("__")
        for parent in parents:
            part = part[parent]
        part[key] = value
    return content


def library_copy(folder: Path, *cameras: Any) -> Path:
    """Copy of rawtoaces-data with these cameras: their JSON, or its text."""
    (folder / "data" / "camera").mkdir(parents=True)
    (folder / "LICENSE").write_text("Apache License, Version 2.0", "utf-8")
    for index, each in enumerate(cameras):
        held = each if isinstance(each, str) else json.dumps(each)
        (folder / "data" / "camera" / f"{index}.json").write_text(held, "utf-8")
    return folder


ENVI_NM = np.arange(400.0, 701.0, 50.0)
_ENVI = """ENVI
description = { of a desk,
  in two lines }
samples = 6
lines = 5
bands = 7
header offset = {offset}
data type = {kind}
interleave = {order}
byte order = {big}
wavelength units = {unit}
wavelength = { {nm} }
"""


def envi_header(**changes: object) -> str:
    """Header of a cube of 5 rows, 6 columns and 7 bands: by default float32, one plane after the other."""
    held = {
        "offset": 0,
        "kind": 4,
        "order": "bsq",
        "big": 0,
        "unit": "Nanometers",
        "nm": ",\n ".join(map(str, ENVI_NM)),
    }
    text = _ENVI
    for name, value in (held | changes).items():
        text = text.replace(f"{{{name}}}", str(value))
    return text
