"""A picture beside the scene without noise: the metrics of a study, and what their one factor does."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from refusal import refusal

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from studies.metrics import metric as metric_module
from studies.metrics.appearance import appearance
from studies.metrics.appearance import picture_quality as quality_of
from studies.metrics.compare import ReferencePicture, _brightness, measure, reference_picture
from studies.photograph.camera import capture
from studies.photograph.develop import develop
from studies.photograph.picture_file import write_picture

NM = np.arange(385.0, 780.0, 10.0)


def grey_field(lamp: str, luminance_cd_m2: float) -> SpectralRadiance:
    """Steps of grey under a lamp, the brightest at a luminance."""
    steps = np.linspace(0.2, 1.0, 24)[None, :, None] * np.ones((24, 1, 1))
    return SpectralRadiance(steps * luminance_cd_m2 * illuminant(lamp).band_average(NM, np.full(NM.size, 10.0)), NM)


def test_a_neutral_under_its_own_lamp_is_grey_and_white_is_known() -> None:
    reference = reference_picture(grey_field("A", 50.0), illuminant("A"))
    assert reference.white_cd_m2 == pytest.approx(50 / 0.9, rel=0.01)  # the 99th percentile shows at 90 %
    assert reference.linear[0, -1] == pytest.approx([0.9] * 3, rel=0.01)
    assert np.ptp(reference.linear, axis=2).max() < 1e-3
    assert np.ptp(reference_picture(grey_field("A", 50.0)).linear[0, -1]) > 0.1  # by D65, A is orange


def test_the_same_picture_of_another_scale_has_no_difference_and_a_known_one_has_the_studys_figures() -> None:
    rng = np.random.default_rng(3)
    reference = ReferencePicture(rng.uniform(0.05, 0.9, (32, 32, 3)), 100.0)
    same = measure(reference.linear * 1234.5, reference)
    assert same["psnr_db"] > 200
    assert (same["ssim"], same["delta_e_p95"], same["flip_mean"]) == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)
    other = reference.linear[:, ::-1]
    told = measure(other, reference)
    assert {name: told[name] for name in ("psnr_db", "ssim")} == pytest.approx(
        {
            name: asdict(quality_of(encode_srgb(other), encode_srgb(reference.linear)))[name]
            for name in ("psnr_db", "ssim")
        },
        rel=1e-9,
    )
    assert set(told) == set(same)
    assert len(told) == 8


def test_a_lamp_that_the_camera_clips_says_nothing_of_the_brightness() -> None:
    scene = np.random.default_rng(5).uniform(0.05, 0.6, (32, 40, 3))
    scene[8:16, 8:16] = 4000.0  # a lamp: its light is most of the picture's
    reference = ReferencePicture(scene, 100.0)
    told = measure(7.0 * np.minimum(scene, 1.0), reference)
    assert told["psnr_db"] > 200  # by the mean luminance 5 dB: all is white
    noisy = np.minimum(scene + np.random.default_rng(6).normal(0, 0.3, scene.shape), 1.0)
    assert measure(noisy * 7.0, reference)["psnr_db"] == pytest.approx(measure(noisy, reference)["psnr_db"], abs=1e-6)


def test_a_reference_is_written_as_it_is_shown(tmp_path: Path) -> None:
    """Encoded, and white is 1: a grey of 0.2 is sRGB's 124 of 255."""
    reference = ReferencePicture(np.full((8, 8, 3), 0.2), 100.0)
    write_picture(reference, tmp_path / "truth.tif")
    assert np.unique(tifffile.imread(tmp_path / "truth.tif")).tolist() == [124]
    np.testing.assert_array_equal(reference.encode(), encode_srgb(reference.linear))


@pytest.mark.thorough
def test_four_lines_measure_a_photograph_and_more_light_is_better() -> None:
    radiances = [grey_field("D65", level) for level in (2.0, 200.0)]
    figures = []
    for radiance in radiances:
        picture = develop(capture(radiance, exposure_s=0.01, rng=np.random.default_rng(1)))
        figures.append(measure(picture, reference_picture(radiance)))
    assert figures[1]["psnr_db"] > figures[0]["psnr_db"] + 10


def test_what_is_no_picture_of_the_reference_is_refused() -> None:
    reference = reference_picture(grey_field("D65", 50.0))
    refusal(measure, np.ones((3, 3, 3)), reference, match="is not the reference's")
    refusal(measure, np.zeros(reference.linear.shape), reference, match="its mean luminance is 0")
    refusal(reference_picture, SpectralRadiance(np.zeros((4, 4, NM.size)), NM), match="it is dark")


@pytest.mark.parametrize("lamp", ["A", "F11"])
def test_a_camera_and_its_reference_are_balanced_to_the_lamp_that_the_radiance_states(lamp: str) -> None:
    radiance = replace(grey_field(lamp, 200.0), light=illuminant(lamp))
    picture = develop(capture(radiance, exposure_s=0.01, rng=np.random.default_rng(1)))
    told = measure(picture, reference_picture(radiance))
    assert told["delta_e_median"] < 3  # noise leaves 1.7; by D65, which `capture` took for every lamp, it was 20


def test_a_picture_is_seen_at_the_references_own_luminance() -> None:
    """PU21 weighs the same error of a picture by its light: in the dark less of it is seen."""
    rng = np.random.default_rng(4)
    linear = rng.uniform(0.05, 0.9, (32, 32, 3))
    other = linear * rng.uniform(0.9, 1.1, linear.shape)
    dark, bright = (ReferencePicture(linear, white_cd_m2) for white_cd_m2 in (0.1, 1000.0))
    found = [measure(other, reference)["pu21_psnr_db"] for reference in (dark, bright)]
    assert found[0] > found[1] + 3.0
    factor = luminance_of_srgb(linear).mean() / luminance_of_srgb(other).mean()
    for reference, told in zip((dark, bright), found, strict=True):
        seen = appearance(other * factor, reference.truth, reference.white_cd_m2)
        assert told == pytest.approx(seen.pu21_psnr_db, abs=0.05)


def test_the_brightness_is_that_at_which_white_takes_as_much_from_both() -> None:
    """Halves of 0.5 and 4, of which white leaves 1; of 0.25 and 0.9: twice that is 0.5 and, clipped, 1.

    By the means alone it would be 1.3 times. Cells at the edge are smaller and count by their pixels: in the last 4 of
    20 columns a cell of 0.1 and of 0.05 takes the factor with it.
    """
    reference, picture = np.full((16, 16), 0.5), np.full((16, 16), 0.25)
    reference[:8], picture[:8] = 4.0, 0.9
    assert _brightness(picture, reference) == pytest.approx(2.0)
    assert _brightness(reference / 5.0, reference / 4.0) == pytest.approx(1.25)
    wider, dimmer = (np.pad(x, ((0, 0), (0, 4)), constant_values=y) for x, y in ((reference, 0.1), (picture, 0.04)))
    # noise above white is evened out within its cell: rows of 0.1 and 1.5 by turns are 0.8, and nothing clips
    stripes = np.where(np.arange(16)[:, None] % 2, 1.5, 0.1) * np.ones((16, 16))
    assert _brightness(stripes, np.full((16, 16), 0.4)) == pytest.approx(0.5)
    # cells are of 8 x 8: a cell of 1.6 is cut to 1, the same light in half of it and in half of its neighbour isn't
    for first, shown in ((0, (1.0 + 0.0) / 2), (4, 0.8)):
        lit = np.zeros((8, 16))
        lit[:, first : first + 8] = 1.6
        assert _brightness(np.full((8, 16), 0.25), lit) == pytest.approx(4 * shown), first
        assert _brightness(np.full((16, 8), 0.25), lit.T) == pytest.approx(4 * shown), first
    # 8 columns of (1 + 0.5) / 2 each and 4 of 0.1: 8 (1 + 0.25 k) + 4 (0.04 k) = 8 x 1.5 + 4 x 0.1
    assert _brightness(dimmer, wider) == pytest.approx((8 * 1.5 + 4 * 0.1 - 8) / (8 * 0.25 + 4 * 0.04))


def test_every_metric_is_told_by_its_name_digits_unit_and_direction() -> None:
    """In the order of the tables; those of targets at their end."""
    told = {
        "psnr_db": ("PSNR", 1, "dB", True, 0.5),
        "ssim": ("SSIM", 3, "", True, 0.02),
        "delta_e_median": ("ΔE2000, median", 1, "", False, 1.0),
        "delta_e_p95": ("ΔE2000, 95 %", 1, "", False, 1.0),
        "s_cielab_median": ("S-CIELAB, median", 1, "", False, 1.0),
        "s_cielab_p95": ("S-CIELAB, 95 %", 1, "", False, 1.0),
        "flip_mean": ("FLIP", 3, "", False, 0.02),
        "pu21_psnr_db": ("PU21-PSNR", 1, "dB", True, 0.5),
        "mtf50_cy_per_px": ("MTF50", 3, "cy/px", True, 0.02),
        "chart_delta_e_mean": ("ΔE2000 of the chart", 1, "", False, 1.0),
        "patch_snr_db": ("SNR of the patches", 1, "dB", True, 0.5),
    }
    found = {x.key: (x.name, x.digits, x.unit, x.higher, x.threshold) for x in metric_module.METRICS}
    assert list(found.items()) == list(told.items())
    assert [x.key for x in metric_module.HEADLINE] == ["psnr_db", "delta_e_median", "flip_mean"]
    assert [x.key for x in metric_module.DECIDING] == ["psnr_db", "ssim", "delta_e_median", "flip_mean"]
    assert [x.key for x in metric_module.ON_TARGETS] == list(told)[8:]
    assert set(metric_module.MEANINGS) == set(told)
