"""Rendering until the render's noise is small beside the sensor's: what is asked for, and when it stops."""

from dataclasses import replace

import numpy as np
import pytest
from builders import transport_of

from render.engine import render
from render.illuminants import illuminant
from render.scene import LightGroup
from scenes.catalogue import load
from sensor.presets import low_noise, table1_output
from sensor.readout import noise_variance
from studies.study import render_noise
from studies.study.render_noise import noise_note, render_quietly, render_share, speckle_sizes

NM, WIDTH_NM = np.arange(405.0, 780.0, 50.0), np.full(8, 50.0)
LONGEST_S = 0.066
MOST_SHARE = 0.03  # decided: a render's noise counts as none up to there (docs/decisions)


def grey(relative_error, size=(8, 10), spp=128, **changes):
    """An even picture whose bands all have the same relative standard error."""
    shape = (1, NM.size, *size)
    made = transport_of(
        np.full(shape, 0.5, np.float32),
        {"sky": LightGroup(("sky",), illuminant("D65"), 100.0)},
        NM,
        WIDTH_NM,
        variance=np.full(shape, (0.5 * relative_error) ** 2, np.float32),
        spp=spp,
    )
    return replace(made, **changes)


def test_an_even_picture_has_the_share_of_its_fullest_pixels():
    for sensor in [low_noise(), low_noise("bayer"), table1_output()]:
        # Auto exposure brings an even grey to 80 % of the well in its brightest channel that doesn't saturate; a
        # channel of n electrons has Monte Carlo variance (error n)^2, and the share grows with n.
        share = render_share(grey(0.01), sensor, 1e5, LONGEST_S)
        most = sensor.pixel.full_well_e
        bound = (0.01 * most) ** 2 / noise_variance(np.array(most), sensor, 1e-3)
        assert 0.2 * bound < share < bound, sensor
        assert render_share(grey(0.02), sensor, 1e5, LONGEST_S) == pytest.approx(4 * share, rel=1e-4), sensor


def test_the_share_is_of_the_noisiest_pixels_but_a_twentieth():
    """Noisy columns at the edge are pooled with their neighbour: 4 of 100 don't count, and 6 do."""
    even = grey(0.01, size=(8, 100))
    shares = {}
    for columns in (3, 5):
        variance = even.variance.copy()
        variance[:, :, :, :columns] *= 1e4
        shares[columns] = render_share(replace(even, variance=variance), low_noise(), 100.0, LONGEST_S)
    plain = render_share(even, low_noise(), 100.0, LONGEST_S)
    assert shares[3] == pytest.approx(plain, rel=1e-3)
    assert shares[5] > 100 * plain


@pytest.fixture
def calls(monkeypatch):
    """What is asked of the engine; each answer has the samples asked for."""
    asked = []

    def answer(scene, size, *, max_spp, max_seconds, resume, **options):
        asked.append((max_spp, resume.spp if resume else None))
        return grey(0.1, spp=max_spp, stopped_by="seconds" if max_spp > 5000 else "samples")

    monkeypatch.setattr(render_noise, "render", answer)
    return asked


def quietly(share_at_128, max_spp=100_000):
    limits = {"most_share": MOST_SHARE, "max_seconds": 9.0}
    return render_quietly(None, (8, 10), lambda made: share_at_128 * 128 / made.spp, **limits, max_spp=max_spp)


def test_a_quiet_render_is_left_as_it_is(calls):
    assert quietly(0.9 * MOST_SHARE).spp == 128
    assert calls == [(128, None)]


def test_a_noisy_one_goes_on_for_as_many_samples_as_it_takes(calls):
    made = quietly(2 * MOST_SHARE)
    assert calls == [(128, None), (269, 128)]  # 128 x 2 x 1.05, rounded up
    assert made.spp == 269


def test_the_caps_stop_it(calls):
    assert quietly(1e6, max_spp=100).spp == 100
    assert quietly(1e6, max_spp=600).spp == 600
    assert quietly(1e6).stopped_by == "seconds"


def test_a_real_render_reaches_the_share_it_is_asked_for():
    scene = load("cornell_box")
    share = lambda made: render_share(made, table1_output(), 0.1, LONGEST_S)  # noqa: E731
    bands = {"wavelength_nm": np.arange(405.0, 780.0, 50.0), "seed": 3}
    limits = {"most_share": MOST_SHARE, "max_spp": 1024, "max_seconds": 60.0}
    made = render_quietly(scene, (8, 8), share, **limits, **bands)
    assert share(made) <= MOST_SHARE
    assert made.spp > 128
    once = render(scene, (8, 8), max_spp=int(made.spp), **bands)  # the last chunk is drawn whole
    assert np.array_equal(once.radiance, made.radiance)


def test_the_note_tells_what_shows_and_the_samples_that_would_do():
    assert noise_note(0.99, 64) == ""
    assert "3.2 times the sensor's" in noise_note(3.2, 64)
    assert noise_note(3.2, 64).endswith("; 256 samples a pixel would do")  # 64 x 3.2 = 205, in powers of two
    assert noise_note(3.2, 0).endswith("in pictures and reference")  # of a file
    bright = noise_note(0.2, 64, np.array([5.5, 12.0]))
    assert "2 pixels are speckles" in bright
    assert bright.endswith("; 256 samples a pixel would do")  # 64 x 12 / 5 = 154


def test_single_bright_samples_are_counted_where_the_well_is_not_full():
    """Errors of 4 and 6 standard deviations of 400 e- and the dark, on pixels below the well and beyond."""
    sensor = low_noise("bayer")
    expected_e = np.full((4, 6), 400.0)
    expected_e[:, 3:] = 2 * sensor.pixel.full_well_e
    deviation = np.sqrt(noise_variance(np.full((4, 6), 400.0), sensor, 0.01)[0, 0])
    error_e = np.zeros((4, 6))
    error_e[0, 0], error_e[1, 1], error_e[2, 4] = 4 * deviation, -6 * deviation, 60 * deviation
    assert speckle_sizes(error_e, expected_e, sensor, 0.01) == pytest.approx([6.0], rel=1e-6)
