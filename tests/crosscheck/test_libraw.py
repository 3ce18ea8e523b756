"""LibRaw develops a noise-free ColorChecker from our negatives as their own tags predict, and as our pipeline does.

LibRaw balances with AsShotNeutral, goes to sRGB through ColorMatrix2 (D65) alone whatever the light, each row of
camera-from-sRGB scaled to sum 1, and calls the least amplified channel's white level 1. The prediction here does the
same arithmetic on the patches' expected signals, from tags read by tifffile. What separates the two: the raw
data's and the output's rounding. Under D65 our own white balance by AsShotNeutral and our fitted matrix are the same
line.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from builders import mosaic_of, raw_image
from loop import loop

from isp.planes import bilinear
from isp.remosaic import remosaic
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.types import Image
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import mask
from sensor.device import draw_device
from sensor.presets import low_noise, preset
from sensor.raw import RawImage
from sensor.raw_files.raw_file import write_raw
from sensor.readout import read_out
from sensor.response import electrons_per_irradiance
from studies.photograph.camera import calibrate

rawpy = pytest.importorskip("rawpy", reason="rawpy (LibRaw) is not installed")

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
# Patches and their side [pixels]; left out of each is what the reconstruction, its patches and LibRaw together reach.
ROWS, COLUMNS, SIDE, EDGE = 4, 6, 36, 14
SRGB_TO_XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]  # IEC 61966-2-1


def surfaces() -> Image:
    return np.array([curve.band_average(NM, WIDTH) for _, curve in color_checker_reflectances()])


def chart(cfa: str, light: str) -> tuple[RawImage, Image]:
    """Noise-free exposure of the chart, white at 95 % of the well of the fullest channel; its signals (24, channel)."""
    sensor = low_noise(cfa)
    spectrum = illuminant(light).band_average(NM, WIDTH)
    weights = electrons_per_irradiance(sensor, NM, WIDTH, 1.0)
    scale = 0.95 * sensor.pixel.full_well_e / (weights @ spectrum).max()
    electrons = (surfaces() * spectrum) @ weights.T * scale
    shape = (ROWS * SIDE, COLUMNS * SIDE)
    patches_e = electrons.T.reshape(-1, ROWS, COLUMNS)
    planes = {name: np.kron(part, np.ones((SIDE, SIDE))) for name, part in zip(sensor.channels, patches_e, strict=True)}
    mosaic = mosaic_of(planes, sensor.cfa, shape)
    raw = raw_image(
        np.rint(mosaic / sensor.gain_e_per_dn + sensor.black_dn),
        sensor.cfa,
        black_dn=sensor.black_dn,
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=sensor.pixel.read_noise_e,
        dsnu_e=sensor.pixel.dsnu_e,
        prnu=sensor.pixel.prnu,
        colour=calibrate(sensor, illuminant(light)),
    )
    return raw, electrons


def patches(picture: Image) -> Image:
    """Every pixel of the patches' inner parts, shape (24, pixel, 3)."""
    tiles = picture.reshape(ROWS, SIDE, COLUMNS, SIDE, 3).swapaxes(1, 2)[:, :, EDGE:-EDGE, EDGE:-EDGE]
    return tiles.reshape(ROWS * COLUMNS, -1, 3)


def by_libraw(path: Path) -> Image:
    with rawpy.imread(str(path)) as raw:
        picture = raw.postprocess(
            adjust_maximum_thr=0, no_auto_bright=True, gamma=(1, 1), use_camera_wb=True, output_bps=16
        )
    return np.asarray(picture / 65_535)


def predicted(path: Path, share_of_full: Image) -> Image:
    """Linear sRGB of signals given as shares of full scale (patch, channel), by the file's tags."""
    with tifffile.TiffFile(path) as file:
        tags = {tag.name: tag.value for tag in file.pages[0].tags}
    matrix, neutral = (
        np.array(tags[name][::2]) / np.array(tags[name][1::2]) for name in ("ColorMatrix2", "AsShotNeutral")
    )
    camera = matrix.reshape(-1, 3) @ SRGB_TO_XYZ
    camera /= camera.sum(axis=1, keepdims=True)
    return np.clip(share_of_full / neutral * neutral.max() @ np.linalg.pinv(camera).T, 0.0, 1.0)


@loop("name", ["low_noise", "table1_output", "table1_pixel"])
@loop("cfa", ["bayer", "rgbw"])
def test_the_dark_has_no_tint_under_libraw_s_own_black_level(name: str, cfa: str, tmp_path: Path) -> None:
    """A black level cut by 0.84 DN would lift every channel of `low_noise` by 0.77 e-, 60 standard errors here."""
    sensor = preset(name, cfa)
    shape = (256, 256)
    device = draw_device(sensor, shape, np.random.default_rng(1))
    dark = read_out(np.zeros(shape), sensor, device, 0.0, np.random.default_rng(2))
    raw = replace(dark, colour=calibrate(sensor, illuminant("D65")))
    (path,) = write_raw(raw, tmp_path / "dark.dng")
    with rawpy.imread(str(path)) as theirs:
        assert theirs.black_level_per_channel == [sensor.black_dn] * 4
        lifted_e = (theirs.raw_image.astype(float) - theirs.black_level_per_channel[0]) * sensor.gain_e_per_dn
    spread_e = np.hypot(sensor.pixel.read_noise_e, sensor.gain_e_per_dn / np.sqrt(12))
    for channel in sensor.channels:
        here = mask(sensor.cfa, channel, shape)
        # 21 comparisons within 4 standard errors: false-alarm rate 1.3e-3
        assert abs((lifted_e - device.dark_offset_e)[here].mean()) < 4 * spread_e / np.sqrt(here.sum())


# The issue asks for 0.005. A Bayer file leaves 2.3e-4 (D65) and 4.7e-4 (A); in RGBW LibRaw's four-colour interpolation
# and W's signal, which amplifies the others' black by 5 and 11, leave more.
@loop(
    ("cfa", "light", "bound"),
    [
        *[(f"bayer_{phase}", "D65", 1e-3) for phase in ("rggb", "bggr", "grbg", "gbrg")],
        ("bayer", "A", 1e-3),
        ("rgbw", "D65", 5e-3),
        ("rgbw", "A", 5e-3),
    ],
)
def test_libraw_develops_the_chart_as_the_tags_predict(cfa: str, light: str, bound: float, tmp_path: Path) -> None:
    raw, electrons = chart(cfa, light)
    (path,) = write_raw(raw, tmp_path / "chart.dng")
    difference = patches(by_libraw(path)) - predicted(path, electrons / raw.full_well_e)[:, None]
    assert np.abs(difference).max() < bound


def test_libraw_and_our_own_development_agree_under_d65(tmp_path: Path) -> None:
    raw, _ = chart("bayer", "D65")
    assert raw.colour is not None
    balanced = bilinear(raw) / raw.full_well_e / raw.colour.neutral * raw.colour.neutral.max()
    ours = np.clip(balanced @ raw.colour.to_srgb.T, 0.0, 1.0)
    (path,) = write_raw(raw, tmp_path / "chart.dng")
    assert np.abs(patches(by_libraw(path)) - patches(ours)).max() < 1e-3


def test_libraw_develops_the_bayer_file_beside_an_rgbw_one(tmp_path: Path) -> None:
    raw, electrons = chart("rgbw", "D65")
    (path,) = write_raw(remosaic(raw), tmp_path / "chart_bayer.dng")
    difference = patches(by_libraw(path)) - predicted(path, electrons[:, :3] / raw.full_well_e)[:, None]
    assert np.abs(difference).max() < 1e-3
