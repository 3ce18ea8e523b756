"""What the eye sees of a difference: each figure against the module that computes it, and where one scale matters."""

import numpy as np
import pytest

from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from studies.metrics.appearance import appearance, flip, true_picture
from studies.metrics.pu21 import pu21_psnr_db
from studies.metrics.s_cielab import s_cielab

RNG = np.random.default_rng(3)
TRUTH = RNG.uniform(0.0, 1.4, (24, 32, 3))  # brighter than white here and there
PICTURE = TRUTH + RNG.normal(0, 0.1, TRUTH.shape)


def test_each_figure_is_its_own_module_s() -> None:
    picture, truth = encode_srgb(PICTURE), encode_srgb(TRUTH)
    found = appearance(PICTURE, picture, true_picture(TRUTH), 40.0)
    seen = s_cielab(picture, truth)
    assert found.s_cielab_median == pytest.approx(np.median(seen), rel=1e-12)
    assert found.s_cielab_p95 == pytest.approx(np.percentile(seen, 95), rel=1e-12)
    assert found.flip_mean == pytest.approx(flip(picture, truth).mean(), rel=1e-12)
    luminances = 40.0 * luminance_of_srgb(PICTURE), 40.0 * luminance_of_srgb(TRUTH)
    assert found.pu21_psnr_db == pytest.approx(pu21_psnr_db(*luminances), rel=1e-12)
    assert 0 < found.flip_mean < 1
    assert found.s_cielab_median < found.s_cielab_p95


def test_absolute_luminance_counts_for_pu21_alone_and_an_error_above_white_too() -> None:
    encoded, truth = encode_srgb(PICTURE), true_picture(TRUTH)
    dim, bright = (appearance(PICTURE, encoded, truth, white) for white in (0.4, 4000.0))
    assert (dim.flip_mean, dim.s_cielab_p95) == (bright.flip_mean, bright.s_cielab_p95)
    assert dim.pu21_psnr_db > bright.pu21_psnr_db + 10  # at 0.4 cd/m^2 the eye tells few steps apart
    glaring = np.full((24, 32, 3), 2.0)
    above = appearance(glaring, encode_srgb(glaring), true_picture(glaring * 1.5), 40.0)
    assert above.flip_mean == 0.0  # a display clips both
    assert 10 < above.pu21_psnr_db < 30
