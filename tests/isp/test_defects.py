"""Defective pixels: the median of the nearest sound samples of their channel, and what a simulated chip lists."""

from dataclasses import replace

import numpy as np
import pytest
from builders import raw_image

from isp.defects import interpolate_defects
from isp.remosaic import remosaic
from rodcone.errors import InputError
from sensor.cfa import BAYER, RGBW
from sensor.device import draw_device
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.readout import read_out


def frame(dn: np.ndarray, cfa: tuple[str, ...], defects: list[tuple[int, int]]) -> RawImage:
    places = np.array(defects) if defects else None
    return raw_image(dn, cfa, black_dn=10.0, white_dn=1000.0, dsnu_e=0.0, defects=places)


def test_a_pixel_takes_the_median_of_its_letters_neighbours_and_the_list_is_gone() -> None:
    dn = np.arange(100).reshape(10, 10)
    raw = frame(dn, RGBW, [(4, 4)])
    mended = interpolate_defects(raw)
    assert mended.defects is None
    assert mended.dn[4, 4] == 44  # of 22 24 26 42 46 62 64 66: the mean of 42 and 46
    mended.dn[4, 4] = dn[4, 4]
    np.testing.assert_array_equal(mended.dn, dn)
    assert raw.dn[4, 4] == 44


def test_bayers_diagonal_greens_count() -> None:
    dn = np.zeros((8, 8))
    dn[[3, 3, 5, 5], [2, 4, 2, 4]] = 100  # greens of the other rows
    dn[[2, 2, 2, 4, 4, 6, 6, 6], [1, 3, 5, 1, 5, 1, 3, 5]] = 80
    assert interpolate_defects(frame(dn, BAYER, [(4, 3)])).dn[4, 3] == 80  # eight of 80, four of 100
    dn[[2, 2, 2, 6], [1, 3, 5, 1]] = 100
    assert interpolate_defects(frame(dn, BAYER, [(4, 3)])).dn[4, 3] == 100


def test_a_corner_and_a_cluster_look_further() -> None:
    dn = np.full((12, 12), 50)
    cluster = [(row, column) for row in range(3) for column in range(3)]
    for place in cluster:
        dn[place] = 1000
    np.testing.assert_array_equal(interpolate_defects(frame(dn, RGBW, cluster)).dn, np.full((12, 12), 50))


def test_a_letter_without_a_sound_sample_reads_black() -> None:
    dn = np.full((2, 2), 500)
    mended = interpolate_defects(frame(dn, RGBW, [(1, 1)]))
    np.testing.assert_array_equal(mended.dn, [[500, 500], [500, 10]])


def test_a_simulated_chip_lists_its_hot_pixels_and_mending_takes_them_out() -> None:
    for cfa in ["rgbw", "bayer"]:
        sensor = preset("low_noise", cfa)
        pixel = replace(sensor.pixel, hot_pixel_share=0.01, hot_pixel_dark_current_e_per_s=1e6)
        sensor = replace(sensor, pixel=pixel)
        device = draw_device(sensor, (64, 64), np.random.default_rng(0))
        raw = read_out(np.full((64, 64), 300.0), sensor, device, 0.01, np.random.default_rng(1))
        assert device.hot is not None, cfa
        assert raw.defects is not None, cfa
        np.testing.assert_array_equal(raw.defects, np.argwhere(device.hot))
        hot = tuple(raw.defects.T)
        assert raw.electrons[hot].min() > 9000, cfa
        # the median of 8 samples of 300 e- and 17.5 e- of noise: 5 standard deviations of 17.5 / sqrt(8 * 2 / pi)
        assert np.abs(interpolate_defects(raw).electrons[hot] - 300.0).max() < 5 * 17.5 / np.sqrt(16 / np.pi) + 0.5, cfa


def test_a_remosaiced_frame_holds_no_hot_pixel_and_no_list() -> None:
    dn = np.full((24, 24), 310)
    dn[8, 9], dn[8, 8] = 1000, 900
    raw = frame(dn, RGBW, [(8, 8), (8, 9)])
    bayer = remosaic(raw)
    assert bayer.defects is None
    assert np.abs(bayer.dn.astype(int) - 310).max() <= 1


def test_a_list_that_does_not_fit_the_frame_is_refused() -> None:
    for places in [[(0, 8)], [(-1, 0)], [(0, 0, 0)], [(0.5, 1.0)], [["a", "b"]]]:
        with pytest.raises(InputError, match=r"^defects: .* is not allowed; give rows and columns inside \(8, 8\)"):
            frame(np.zeros((8, 8)), RGBW, places)  # type: ignore[arg-type]
