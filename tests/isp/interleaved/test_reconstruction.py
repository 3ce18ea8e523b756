"""The reconstruction: closed forms, a transcription of eqs. (1)-(6), and the kernel against the reference."""

import math
import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, mosaic_of, raw_image, single_precision

from isp.colour.white_balance import WhiteBalance
from isp.interleaved.kernel.schedule import list_threads, make_pattern
from isp.interleaved.numpy_form import reference_with_noise, sum_weights
from isp.interleaved.reconstruction import reconstruct, reconstruct_with_noise
from isp.interleaved.saturation import saturated_fraction
from isp.processors.catalogue import NAMED
from isp.settings import PAPER, PAPER_5X5, Settings
from rodcone.errors import InputError
from rodcone.jit import backend, dr
from sensor.cfa import BAYER, RGBW, Tile, channel_map, channels
from sensor.raw import RawImage

BLACK, FULL = 100.0, 4000.0
EXP2_ERROR = (
    1.6e-4  # of a ratio of two weights: each is right to 7.5e-5 (isp.interleaved.kernel.accumulate), and rounded
)


def exposure(electrons, tile=RGBW, read_noise_e=2.0):
    dn = np.clip(np.round(electrons + BLACK), 0, 65535)
    return raw_image(dn, tile, black_dn=BLACK, white_dn=BLACK + FULL, read_noise_e=read_noise_e, dsnu_e=0.0)


def scene(shape, level, tile=RGBW, seed=0):
    """A noisy frame with edges and texture; W's mean is `level`, the colours' a sixth to a tenth of it."""
    rng = np.random.default_rng(seed)
    y, x = np.indices(shape)
    base = 1.0 + 0.5 * np.sin(x / 3.0) * np.cos(y / 5.0) + 0.8 * ((x // 7 + y // 9) % 2)
    response = mosaic_of({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}, tile, shape)
    electrons = np.minimum(rng.poisson(level * base * response), FULL)
    return exposure(electrons + rng.normal(0.0, 2.0, shape), tile)


@pytest.mark.sample(2)
@pytest.mark.parametrize("sigma_d", [1.5, 4.0, math.inf])
@pytest.mark.parametrize("tile", [RGBW, BAYER])
def test_without_similarity_an_impulse_is_the_spatial_weight_in_closed_form(tile, sigma_d):
    shape, place, height = (15, 18), (6, 9), 1000.0
    electrons = np.zeros(shape)
    electrons[place] = height
    result = reconstruct_with_noise(
        exposure(electrons, tile), Settings(sigma_d=sigma_d, sigma_s=math.inf, neighbourhood=9)
    )
    letters = channel_map(tile, shape)
    for i, letter in enumerate(channels(tile)):
        for x in np.ndindex(shape):
            omega = [
                y for y in np.ndindex(shape) if letters[y] == letter and max(abs(y[0] - x[0]), abs(y[1] - x[1])) <= 4
            ]
            weights = {y: math.exp(-(math.dist(x, y) ** 2) / (2 * sigma_d**2)) for y in omega}
            total = sum(weights.values())
            expected = height * weights.get(place, 0.0) / total
            assert result.estimate[(*x, i)] == pytest.approx(expected, rel=EXP2_ERROR, abs=1e-9)
            gain = sum(w**2 for w in weights.values()) / total**2
            assert result.noise_gain[(*x, i)] == pytest.approx(gain, rel=2 * EXP2_ERROR)


def by_reference(raw, settings):
    """The kernel's result, the reference's on the same guide, and the reference's sums."""
    kernel = reconstruct_with_noise(raw, settings)
    if kernel.white is None:
        return kernel, reference_with_noise(raw, settings), sum_weights(raw, settings)
    guided = kernel.white.raw, settings, np.float64(kernel.white.guide)
    return kernel, reference_with_noise(*guided), sum_weights(*guided)


def transcription(raw, settings, guide=None):
    """Log weights and samples of eq. (1) by pixel and channel, from eqs. (2) to (6); for RGBW in a 2x2 tile alone.

    With a guide it alone is compared, and samples over a bound don't count. By the paper's own method each channel has
    a plane, distances are in electrons, every sample counts, and alpha is counted over the patch.
    """
    height, width = raw.shape
    plain, half, reach = guide is None, settings.patch // 2, settings.reach
    letters, sigma_s = channel_map(raw.cfa, raw.shape), settings.sigma_s

    def plane(values, letter, y):
        if letters[y] == letter:
            return values[y]
        total = weight = 0.0
        for a in product((-1, 0, 1), repeat=2):
            s = (y[0] + a[0], y[1] + a[1])
            if 0 <= s[0] < height and 0 <= s[1] < width and letters[s] == letter:
                w = (2 - abs(a[0])) * (2 - abs(a[1]))
                total, weight = total + w * values[s], weight + w
        return total / weight

    h = {i: {y: plane(raw.electrons, i, y) if plain else guide[y] for y in np.ndindex(raw.shape)} for i in "RGBW"}
    white = {y: plane(raw.electrons, "W", y) for y in np.ndindex(raw.shape)}
    steps = list(product(range(-half, half + 1), repeat=2))

    def reflect(k, size):
        while not 0 <= k < size:
            k = -k if k < 0 else 2 * (size - 1) - k
        return k

    def distance(i, x, y):
        at = lambda p, a: h[i][reflect(p[0] + a[0], height), reflect(p[1] + a[1], width)]  # noqa: E731
        return math.sqrt(sum((at(x, a) - at(y, a)) ** 2 for a in steps))

    def counts(x, y):
        """Whether y isn't brighter than the brightest of its letter around x allows."""
        if plain:
            return True
        steps = [[a for a in range(-3, 4) if (a - (d - c)) % 2 == 0] for c, d in zip(x, y, strict=True)]
        near = [(x[0] + a, x[1] + b) for a, b in product(*steps)]
        most = max(raw.electrons[s] for s in near if s in white)
        spread = math.sqrt(max(most, 0.0) + raw.dark_noise_e**2)
        return raw.electrons[y] <= most + max(2.5, sigma_s / 1.2) * spread + 2.25 / (1 + raw.dark_noise_e**2) ** 2

    full = {y: raw.electrons[y] >= raw.saturation_e and letters[y] == "W" for y in np.ndindex(raw.shape)}

    def filled_from_full(y):
        around = [y] if letters[y] == "W" else [(y[0] + a, y[1] + b) for a, b in product((-1, 0, 1), repeat=2)]
        return any(full.get(s, False) for s in around)

    def alpha(y):
        near = [filled_from_full(s) for a in steps if (s := (y[0] + a[0], y[1] + a[1])) in white]
        return sum(near) / len(near)

    for x in np.ndindex(raw.shape):
        for k, i in enumerate("RGBW"):
            log_weights, values = [], []
            for y in np.ndindex(raw.shape):
                if letters[y] == i and max(abs(y[0] - x[0]), abs(y[1] - x[1])) <= reach and counts(x, y):
                    share = alpha(y) if plain else 0.0
                    beta_s = share * distance(i, x, y) + (1 - share) * distance("W", x, y)
                    spatial = math.dist(x, y) ** 2 / (2 * settings.sigma_d**2)
                    log_weights.append(-spatial - beta_s**2 / (2 * sigma_s**2))
                    values.append(raw.electrons[y])
            yield (*x, k), np.array(log_weights), np.array(values)


CASES = [
    (Settings(neighbourhood=7, patch=1, sigma_d=2.5, sigma_s=3.0), 0),
    (Settings(neighbourhood=7, patch=5, sigma_d=2.5, sigma_s=2.0), 0),
    (replace(PAPER, neighbourhood=7), 2),
    (replace(PAPER_5X5, neighbourhood=7), 2),
]


@pytest.mark.parametrize(("settings", "seed"), CASES)
def test_the_reference_is_the_paper_pixel_by_pixel(settings, seed):
    raw = scene((7, 8), 2500.0, seed=seed)  # partly saturated
    assert 0 < raw.saturated.mean() < 0.5
    kernel, reference, _ = by_reference(raw, settings)
    guided = (raw, settings) if kernel.white is None else (kernel.white.raw, settings, np.float64(kernel.white.guide))
    for place, log_weights, values in transcription(*guided):
        expected = np.average(values, weights=np.exp(log_weights - log_weights.max()))
        assert reference.estimate[place] == pytest.approx(expected, rel=1e-10)
        assert kernel.estimate[place] == pytest.approx(expected, abs=0.2)


KERNEL_CASES = [
    (shape, tile, level, seed)
    for tile, shapes in {
        RGBW: [(2, 2), (3, 2), (23, 34), (40, 31)],
        ("WB", "GR"): [(17, 26)],
        BAYER: [(2, 3), (21, 30)],
        RGBW_4X4: [(4, 4), (19, 30)],
    }.items()
    for seed, shape in enumerate(shapes)
    for level in (1.0, 60.0, 2500.0, 1e7)  # dark, ordinary, partly saturated, all saturated
]


@pytest.mark.sample(1)
@pytest.mark.parametrize("settings", [Settings(patch=5, sigma_s=x) for x in (0.1, 4.0)] + [PAPER_5X5])
@pytest.mark.parametrize(("shape", "tile", "level", "seed"), KERNEL_CASES)
def test_kernel_is_the_reference_in_single_precision(shape, tile, level, seed, settings):
    kernel, reference, sums = by_reference(scene(shape, level, tile, seed), settings)
    assert kernel.engine == backend()
    bound = single_precision(sums.largest, FULL)
    assert (np.abs(kernel.estimate - reference.estimate) < bound).all()
    assert np.abs(kernel.noise_gain - reference.noise_gain).max() < 2e-3


def test_all_three_guides_occur_in_the_partly_saturated_frames():
    alpha = saturated_fraction(scene((40, 31), 2500.0, seed=3), 5)
    assert (alpha == 0.0).any()
    assert ((alpha > 0.0) & (alpha < 1.0)).any()
    assert (alpha == 1.0).any()


def half_saturated(turns=0):
    """Bright left, saturated right, or turned: wide enough for threads of every guide, away from the border too."""
    electrons = np.random.default_rng(4).uniform(3000.0, 3900.0, (42, 130))
    electrons[:, 80:] = FULL
    return exposure(np.rot90(electrons, turns))


@pytest.mark.sample(1)
@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_threads_of_every_guide_are_the_reference(turns):
    raw, settings = half_saturated(turns), replace(PAPER_5X5, sigma_s=2000.0)  # so large that both halves count
    alpha = saturated_fraction(raw, settings.patch)
    work = list_threads(make_pattern(RGBW), raw.shape, (0, raw.shape[0]), alpha, 0, settings.reach)
    assert {guide for guide, threads in work.items() if len(threads.row)} == {"shared", "channel", "mixed"}
    error = np.abs(reconstruct(raw, settings) - reference_with_noise(raw, settings).estimate)
    assert error.max() < 4e-5 * FULL


@pytest.mark.skipif(backend() == "numpy", reason="nothing is compiled without Dr.Jit")
def test_other_sizes_sigmas_and_phases_run_the_kernels_that_are_compiled_already():
    # Narrow weights of raw samples also run the form whose scale moves along with them.
    narrow = Settings(patch=5, sigma_d=2.0, sigma_s=4.0, distance="raw")
    for settings in (Settings(patch=5), PAPER_5X5, narrow):
        reconstruct(half_saturated(), settings)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        for turns, sigma in ((1, 3.0), (3, math.inf)):
            for distance in ("noise", "raw"):
                settings = Settings(patch=5, sigma_d=sigma, sigma_s=2.0 * sigma, distance=distance)
                reconstruct(half_saturated(turns), settings)
        history = [kernel for kernel in dr.kernel_history() if "cache_hit" in kernel]
    assert len(history) > 6
    assert all(kernel["cache_hit"] for kernel in history)


def test_the_result_does_not_depend_on_the_number_of_threads():
    # One thread is the caller's own, which keeps subnormal numbers, where workers take them as 0. A sample of exactly 0
    # that nothing resembles shows the difference: its own weight is 1, and what is left are the smallest weights.
    lonely = half_saturated()
    lonely.dn[20, 20] = BLACK
    threads = dr.thread_count()
    for raw, sigma_s in ((half_saturated(), 8.0), (lonely, 0.5)):
        first = reconstruct_with_noise(raw, Settings(patch=5, sigma_s=sigma_s))
        try:
            dr.set_thread_count(1)
            second = reconstruct_with_noise(raw, Settings(patch=5, sigma_s=sigma_s))
        finally:
            dr.set_thread_count(threads)
        assert np.array_equal(first.estimate, second.estimate)
        assert np.array_equal(first.noise_gain, second.noise_gain)


@pytest.mark.thorough
@pytest.mark.parametrize("sigma_s", [1e-3, 1e-2])
def test_with_a_tiny_sigma_the_result_lies_among_the_samples_that_tie_for_the_best(sigma_s):
    """Single precision can't tell log weights apart that differ by its rounding: any mean of those samples is right."""
    settings = Settings(neighbourhood=11, patch=5, sigma_s=sigma_s)
    result = reconstruct_with_noise(scene((8, 9), 2500.0), settings)
    largest = float(result.white.guide.max())
    for place, log_weights, values in transcription(result.white.raw, settings, np.float64(result.white.guide)):
        distance = -log_weights.max() * 2 * sigma_s**2
        # Rounding of 25 squares and their sum, and of the planes they come from: 2 d (delta x - delta y).
        rounding = (32 * distance + 2 * math.sqrt(25 * distance) * 2 * largest) * 2.0**-24 / (2 * sigma_s**2)
        tied = values[log_weights >= log_weights.max() - 2 * rounding - 20.0]  # 20: a weight of 2e-9 is nothing
        slack = 1e-5 * np.abs(values).max()
        assert tied.min() - slack <= result.estimate[place] <= tied.max() + slack


@pytest.mark.parametrize("function", [reconstruct, reference_with_noise])
def test_bad_parameters_are_one_line_of_advice(function):
    for wrong, message in (
        ({"neighbourhood": 20}, "neighbourhood: 20 isn't allowed"),
        ({"neighbourhood": -3}, "neighbourhood: -3 isn't allowed"),
        ({"neighbourhood": 1}, "neighbourhood: 1 may miss a channel"),
        ({"patch": 4}, "patch: 4 isn't allowed"),
        ({"patch": 0}, "patch: 0 isn't allowed"),
        ({"patch": 5.0}, "patch: 5.0 isn't allowed"),
        ({"sigma_d": 0.0}, "sigma_d: 0.0 isn't allowed"),
        ({"sigma_d": math.nan}, "sigma_d: nan isn't allowed"),
        ({"sigma_s": -1.0}, "sigma_s: -1.0 isn't allowed"),
        ({"sigma_s": 1e-9}, "sigma_s: 1e-09 isn't allowed"),
        ({"distance": "noisy"}, "distance: 'noisy' is unknown; allowed: noise, raw; did you mean 'noise'"),
    ):
        with pytest.raises(InputError, match=rf"\A.*{re.escape(message)}.*\Z"):
            function(exposure(np.zeros((6, 6))), Settings(**wrong))
    with pytest.raises(InputError, match="odd numbers from 7"):
        function(exposure(np.full((4, 4), 300.0), RGBW_4X4), Settings(neighbourhood=5))


def test_without_dr_jit_the_reference_runs_and_the_result_says_so(monkeypatch):
    monkeypatch.setattr("isp.interleaved.reconstruction.backend", lambda: "numpy")
    raw = scene((9, 8), 300.0)
    result = reconstruct_with_noise(raw)
    assert result.engine == "numpy"
    assert result.estimate.dtype == np.float64
    assert np.array_equal(
        result.estimate, reference_with_noise(result.white.raw, Settings(), result.white.guide).estimate
    )
    assert reconstruct(raw).dtype == np.float32


# Both pipelines: decisions, the balance, saturation, errors.


INTERLEAVED, CONVENTIONAL = NAMED["interleaved"].develop, NAMED["bayer"].develop
IDENTITY = np.eye(3)


def raw(cfa: Tile, levels_e: dict[str, float], shape: tuple[int, int] = (32, 32), noise_e: float = 0.0) -> RawImage:
    """Raw image at one electron a DN with a black level of 100."""
    electrons = mosaic_of(levels_e, cfa, shape) + noise_e * np.random.default_rng(0).standard_normal(shape)
    return raw_image(np.clip(np.rint(electrons + 100), 0, 15_100), cfa, read_noise_e=max(noise_e, 1.0))


def test_interleaved_says_which_engine_ran() -> None:
    assert INTERLEAVED(raw(RGBW, dict.fromkeys("RGBW", 100.0)), IDENTITY).engine == backend()


def test_substitution_follows_its_threshold() -> None:
    image = raw(RGBW, {"R": 10, "G": 20, "B": 8, "W": 100}, noise_e=20.0)
    picture = INTERLEAVED(image, IDENTITY)
    assert picture.snr is not None
    assert picture.snr < 4.95
    assert picture.substituted is True
    assert INTERLEAVED(image, IDENTITY, substitution_snr=0.0).substituted is False
    bright = raw(RGBW, {"R": 500, "G": 1000, "B": 400, "W": 5000})
    assert INTERLEAVED(bright, IDENTITY).substituted is False


def test_dark_frame_is_balanced_by_calibration_and_says_so() -> None:
    image = raw(RGBW, {"R": 0.0, "G": 0.1, "B": 0.0, "W": 0.5}, noise_e=20.0)
    picture = INTERLEAVED(image, IDENTITY)
    assert set(picture.balance.values()) == {"calibrated"}
    assert np.all(np.isfinite(picture.rgb))


def test_saturated_w_does_not_shift_the_colours_balance() -> None:
    # Grey on average; W saturates on the reddish half alone, which has to count all the same.
    image = raw(RGBW, {"R": 1000, "G": 3000, "B": 1500, "W": 9000})
    image.dn[:, :16] = raw(RGBW, {"R": 2000, "G": 3000, "B": 900, "W": 15_000}).dn[:, :16]
    planes = reconstruct(image)
    gains, _ = WhiteBalance.of(image, None).gains(image, planes)
    assert (planes * gains)[..., :3].mean(axis=(0, 1)) == pytest.approx([3000.0] * 3, rel=1e-4)
    # Away from the seam, whose sharpening moves the frame's mean, the picture has these gains.
    picture, half = INTERLEAVED(image, IDENTITY), (planes * gains)[..., :3]
    for columns in (slice(0, 12), slice(20, 32)):
        assert picture.rgb[:, columns] == pytest.approx(half[:, columns], rel=1e-3)


def test_a_given_balance_takes_the_place_of_gray_world() -> None:
    matrix = np.array([[1.5, -0.5, 0.0], [0.0, 1.0, 0.0], [0.25, -0.25, 1.0]])
    four = raw(RGBW, {"R": 500, "G": 1000, "B": 400, "W": 5000})
    three = raw(BAYER, {"R": 500, "G": 1000, "B": 400})
    # response 1 : 2 : 1 (: 4): R and B doubled, so that balanced signals are 1000, 1000 and 800
    expected = [1000.0, 1000.0, 800.0]
    for picture, names in (
        (INTERLEAVED(four, matrix, balance=[1, 2, 1, 4]), "RGBW"),
        (CONVENTIONAL(three, matrix, neutral=[7, 1, 7], balance=[1, 2, 1]), "RGB"),
    ):
        assert picture.rgb == pytest.approx(np.full((32, 32, 3), expected), rel=1e-5)
        assert picture.balance == dict.fromkeys(names, "given")


def test_a_picture_is_its_linear_rgb_to_numpy() -> None:
    linear = CONVENTIONAL(raw(BAYER, {"R": 500, "G": 1000, "B": 400}, (16, 18)), IDENTITY)
    assert linear.shape == (16, 18, 3)
    assert np.asarray(linear) is linear.rgb
    assert np.asarray(linear, dtype=np.float32).dtype == np.float32
    assert np.percentile(linear, 99) == pytest.approx(1000.0)
    for scale in (1000.0, np.float64(1000.0), np.full(3, 1000.0)):
        np.testing.assert_array_equal(linear / scale, linear.rgb / scale)


def test_wrong_matrix_or_neutral_is_refused() -> None:
    image = raw(BAYER, {"R": 1, "G": 1, "B": 1})
    with pytest.raises(InputError, match=r"^matrix: shape \(2, 3\)"):
        CONVENTIONAL(image, np.ones((2, 3)))
    with pytest.raises(InputError, match=r"^neutral: \[1.0, 0.0, 1.0\]"):
        CONVENTIONAL(image, IDENTITY, neutral=[1, 0, 1])
    with pytest.raises(InputError, match=r"^balance: \[1.0, inf, 1.0\]"):
        CONVENTIONAL(image, IDENTITY, balance=[1, np.inf, 1])
