"""Sharp edges: the best linear estimate from nine samples, and light of unknown colour."""

from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, behind, raw_image, white_reading
from scipy.ndimage import gaussian_filter

from isp.interleaved import edges
from isp.interleaved.edges import sharpen
from isp.interleaved.panchromatic import read_as_white
from isp.processors.catalogue import NAMED
from rodcone.jit import backend
from sensor.cfa import RGBW, channels, mask, quad

GAINS = np.array([2.0, 1.0, 3.0, 0.25])
COLOUR = np.array([500.0, 1000.0, 300.0, 4000.0])  # electrons of a surface that reflects all light


@pytest.fixture(autouse=True, params=["kernel", "numpy"])
def engine(request, monkeypatch):
    """Everything holds for both engines."""
    if request.param == "numpy":
        monkeypatch.setattr(edges, "backend", lambda: "numpy")
    elif backend() == "numpy":
        pytest.skip("needs LLVM or CUDA")
    return request.param


def frame(picture, tile=RGBW):
    """What the mosaic reads of a picture's channels."""
    return raw_image(np.rint(behind(picture, tile)) + 100, tile)


def read(raw):
    """The frame as `isp.interleaved.panchromatic` reads it where all around has one colour."""
    return white_reading(raw, COLOUR)


def shaded(light):
    """Channels of one colour under some light."""
    return light[..., None] * COLOUR


def by_hand(raw, planes, gains, noise_gain, row, column):
    """The formula of `sharpen` at a pixel inside the frame, sample by sample."""
    names, cells = raw.channels, len(raw.cfa)
    window = planes[row - 2 : row + 3, column - 2 : column + 3].reshape(25, 4)
    mean, dark = window.mean(axis=0), raw.dark_noise_e**2
    covariance, noise = np.cov(window.T, bias=True), mean + dark
    contrast = np.sum(np.diag(covariance) / noise) / (1.0 + np.sum(mean**2 / noise))
    covariance = 0.75 * covariance + 1.75 * contrast * np.outer(mean, mean)
    places = list(product((row - 1, row, row + 1), (column - 1, column, column + 1)))
    own = [names.index(raw.cfa[i % cells][j % cells]) for i, j in places]
    apart = [[np.exp(-((i - k) ** 2 + (j - m) ** 2) / 2.0) for k, m in places] for i, j in places]
    samples = np.array([raw.electrons[place] for place in places])
    kept = np.flatnonzero(samples < 0.95 * raw.full_well_e)
    on_planes = np.array([planes[place][o] for place, o in zip(places, own, strict=True)])
    read = on_planes + dark  # noise of a sample on its plane
    matrix = np.array([[covariance[own[a], own[b]] * apart[a][b] + read[a] * (a == b) for b in kept] for a in kept])
    to_pixel = np.array([[covariance[c, own[a]] * apart[4][a] for a in kept] for c in range(4)])
    estimate = mean + to_pixel @ np.linalg.inv(matrix) @ (samples - mean[own])[kept]
    mirrored = np.pad(np.arange(16), 24, mode="reflect")
    around = planes[np.ix_(*(mirrored[x : x + 49 : 12] for x in (row, column)))].reshape(25, 4)
    steps = 2.0 * (np.sqrt(around + dark) - np.sqrt(mean + dark))  # in samples' noise
    alike = np.exp(-0.5 * (steps**2).sum(axis=1))
    tint = alike @ around / max(alike @ around[:, 3], alike.sum() * np.sqrt(noise_gain[3] * noise[3]), 1e-9)
    tint[3] = 1.0
    squares = (samples - on_planes) ** 2 / read
    near = [np.exp(-2.0 * ((i - row) ** 2 + (j - column) ** 2)) for i, j in places]
    counts = max(0.0, 1.0 - contrast**4 / (1.0 + np.average(squares, weights=near)))
    beyond = estimate[3] - np.clip(estimate[3], window[:, 3].min(), window[:, 3].max())
    estimate -= beyond * mean / mean[3] / max(1.0, squares.mean())
    distances = ((window - tint * window[:, 3:]) ** 2).mean(axis=0)
    sharp = planes[row, column] + counts * (estimate - planes[row, column])
    even = planes[row, column] + max(0.0, 1.0 - contrast) * (sharp - planes[row, column])
    beside = alike @ (around - tint * around[:, 3:]) ** 2 / max(alike.sum(), 1e-9)
    coloured = max(1.0, (beside / noise_gain / noise).sum() / 3.5)
    sharp -= min(1.0, 7.0 / coloured / (distances / noise_gain / noise).sum()) * (even - tint * even[3])
    full = [any(o == c and a not in kept for a, o in enumerate(own)) for c in range(4)]
    white = window[:, 3].reshape(5, 5)
    between = white[1:4, 1:4].mean() - 1.5 * min(white[i::2, j::2].mean() for i, j in product((0, 1), repeat=2))
    lamp = (1.0 - 1.0 / max(contrast, 1.0) ** 2) * min(1.0, max(squares.mean() / 30.0, between / mean[3]))
    unknown = np.where(full, 1.0, min(1.0, contrast) ** (1 if any(full[:3]) else 4) if any(full) else lamp)
    sharp = sharp + unknown * ((gains * sharp).max() / gains - sharp)
    shares = gains[3] / gains if 4 not in kept and any(full[:3]) else COLOUR / COLOUR[3]
    difference = samples[4] / shares[own[4]] - planes[row, column, 3]
    noise_as_white = (planes[row, column, 3] + dark / shares[own[4]]) / shares[own[4]]
    seen = max(0.0, 1.0 - 9.0 * noise_as_white / max(difference**2, 1e-9))
    light = planes[row, column, 3] + seen * difference
    small = 1.0 - 1.0 / (1.0 + (contrast / 1.5) ** 4)
    return sharp + min(1.0, 4.0 * noise_gain.max()) * small * (light * shares - sharp)


@pytest.mark.sample(5)
@pytest.mark.parametrize("tile", [*RGBW_PHASES, RGBW_4X4, quad(RGBW)])
def test_the_estimate_is_the_formula_s(tile):
    """On edges, noise, a lamp and full samples, each 1e-3 of the pixel's light and more off without its part."""
    rng = np.random.default_rng(3)
    planes = shaded(rng.choice([0.1, 0.5, 1.0], (16, 16))) * rng.uniform(0.7, 1.3, (16, 16, 4))
    planes[4, 5] *= 30.0
    planes[9:12, 9:12, 3] = 15_000.0
    planes = np.minimum(planes, 15_000.0)
    picture = np.minimum(shaded(rng.choice([0.1, 0.5, 1.0, 4.0], (16, 16))), 15_000.0)
    picture[2:7, 3:8] = planes[2:7, 3:8]  # on its planes the lamp is known to be small alone
    raw = frame(picture, tile)
    averaged = np.array([0.05, 0.1, 0.15, 0.2])
    got = sharpen(read(raw), planes, GAINS, np.broadcast_to(averaged, planes.shape))
    for row, column in product(range(2, 14), repeat=2):
        assert got[row, column] == pytest.approx(by_hand(raw, planes, GAINS, averaged, row, column), rel=1e-3, abs=0.1)


def test_a_lamp_in_the_surroundings_gives_the_dark_no_colour():
    planes = np.full((64, 64, 4), COLOUR / 1000.0)
    planes[20:25, 20:25] = [5000.0, 9000.0, 300.0, 14_000.0]
    got = sharpen(read(frame(planes)), planes, GAINS, np.full(planes.shape, 1 / 74))
    assert got[44:49, 44:49] == pytest.approx(planes[44:49, 44:49], abs=1e-3)  # 24 pixels away


def test_colours_that_noise_hides_are_the_surroundings_and_others_stay():
    """Planes of one colour and their noise lose half of its spread; a patch bluer by ten times as much keeps it."""
    rng, light = np.random.default_rng(4), 0.1 * COLOUR
    planes = rng.normal(light, np.sqrt(0.01 * light), (96, 96, 4))
    planes = light + 7.0 * gaussian_filter(planes - light, (2.0, 2.0, 0.0))  # as wide as planes have it
    patch = planes[16:24, 16:24]
    patch[..., 2] += 10.0 * np.sqrt(0.01 * light[2])
    got = sharpen(read(frame(planes)), planes, np.ones(4), np.full(planes.shape, 0.01))
    before, after = (part / part[..., 3:] for part in (planes, got))
    assert (after[48:, 48:].std(axis=(0, 1)) < 0.5 * before[48:, 48:].std(axis=(0, 1)))[:3].all()
    assert got[18:22, 18:22, 2].mean() == pytest.approx(patch[2:6, 2:6, 2].mean(), rel=0.1)


def test_noise_makes_no_dark_pixels_beside_a_bright_wall():
    """Planes as the light is, and samples of 7 to 48 e- in W: no dark pixel under half of its own light.

    Of 4608 dark pixels 110 were, when the estimate could be darker than all planes of its window.
    """
    light = 0.012 * np.where(np.arange(96) % 16 < 8, 1.0, 0.15)
    truth = shaded(np.broadcast_to(light, (96, 96)))
    raw = frame(np.random.default_rng(5).poisson(truth))
    planes = gaussian_filter(truth, (0.0, 0.5, 0.0))
    got = sharpen(read(raw), planes, GAINS, np.full(truth.shape, 0.02))[..., 3]
    dark = light == light.min()
    assert (got > 0.5 * truth[..., 3])[:, dark].all()


def test_a_hidden_colour_is_that_of_like_surroundings():
    """Stripes of 12 pixels: of the 25 places 10 lie on those of another colour, four times as bright."""
    bright = (np.arange(96) // 12 % 2 == 1)[:, None]
    planes = np.broadcast_to(np.where(bright, 0.2 * COLOUR, 0.05 * COLOUR * [2.0, 1.0, 0.5, 1.0]), (96, 96, 4)).copy()
    got = sharpen(read(frame(planes)), planes, GAINS, np.ones(planes.shape))
    middle = np.arange(96) % 12 // 4 == 1  # whose window lies on one stripe
    assert got[:, middle] == pytest.approx(planes[:, middle], rel=0.01)


def test_edges_of_light_lose_most_of_their_fringes():
    """A mean over each channel's own samples, and edges between pixels: a fifth of the fringe is left at most."""
    light = np.where(np.arange(24) < 12, 0.2, 1.0)
    for tile, turned in product(RGBW_PHASES, (False, True)):
        truth = shaded(np.broadcast_to(light, (24, 24)))
        planes = truth.copy()
        for index, moved in enumerate((-1, 0, 1, 0)):
            planes[..., index] = np.roll(truth[..., index], moved, axis=1)
        planes[:, :4], planes[:, -4:] = truth[:, :4], truth[:, -4:]
        if turned:
            truth, planes = (part.transpose(1, 0, 2) for part in (truth, planes))
        got = sharpen(read(frame(truth, tile)), planes, GAINS, np.zeros(planes.shape))
        before, after = (np.abs((part - truth) / COLOUR)[4:-4, 4:-4].max() for part in (planes, got))
        assert after < 0.3 * before, (tile, turned)


def test_noise_is_not_added():
    """Of planes and samples with noise alone: each pixel's error has no more than the planes'."""
    rng = np.random.default_rng(0)
    planes = 1000.0 + rng.normal(0.0, 10.0, (64, 64, 4))
    raw = frame(1000.0 + rng.normal(0.0, np.sqrt(1000.0), (64, 64, 4)))
    got = sharpen(read(raw), planes, np.ones(4), np.zeros(planes.shape))
    assert np.std(got, axis=(0, 1)) == pytest.approx([6.0] * 4, abs=4.0)


def test_a_lamp_stays_where_it_is():
    """Two pixels away and further samples lie on their planes; there nothing changes."""
    rng = np.random.default_rng(0)
    for row, column in product((7, 8), repeat=2):
        planes = rng.uniform(1.0, 3.0, (16, 16, 4))
        planes[row, column] = [3000.0, 6000.0, 2000.0, 15_000.0]
        away = np.ones((16, 16), bool)
        away[row - 1 : row + 2, column - 1 : column + 2] = False
        got = sharpen(read(frame(planes)), planes, np.ones(4), np.zeros(planes.shape))
        around = (slice(row - 2, row + 3), slice(column - 2, column + 3))
        far = away.copy()
        far[around] = False
        assert got[far] == pytest.approx(planes[far], abs=3.0)
        assert got[away].max() < 4.0  # of the brightest channel around


def test_a_lamp_of_a_pixel_has_the_colour_around():
    """Of 25 pixels one is lit: e = 24, and F'' is L but for one part in 65 000. Planes have half of it, in no W."""
    planes = np.zeros((16, 16, 4))
    planes[8, 8] = [3000.0, 6000.0, 1000.0, 0.0]
    got = sharpen(read(frame(2.0 * planes)), planes, GAINS, np.ones(planes.shape))[8, 8]
    assert got / COLOUR == pytest.approx(np.full(4, 6000.0 / COLOUR[0]), rel=0.01)  # an R site: 6000 electrons


def test_a_lamp_that_red_and_blue_miss_is_white():
    """On a column of G and W, full or not, planes are as the samples are: the lamp was green."""
    levels = np.array([0.5, 1.0, 0.5, 4.8])
    for field_e, lamp_e in ((20.0, 6000.0), (2.0, 300.0)):
        light = np.full((32, 32), field_e)
        light[15:18, 15] = lamp_e
        raw = frame(np.minimum(light[..., None] * levels, 15_000.0))
        rgb = NAMED["interleaved"].develop(raw, np.eye(3), balance=levels).rgb
        assert np.ptp(rgb[16, 15]) < 0.1 * rgb[16, 15].max()


def test_what_fills_half_of_a_window_keeps_its_colour():
    planes = np.broadcast_to(COLOUR * 1e-3, (16, 16, 4)).copy()
    planes[:, 8:] = COLOUR
    got = sharpen(read(frame(planes)), planes, GAINS, np.zeros(planes.shape))[4:-4, 9:-4]
    assert got / COLOUR == pytest.approx(np.broadcast_to(got[..., 1:2] / 1000.0, got.shape), rel=0.1)


def test_a_full_channel_rises_to_the_brightest():
    planes = np.broadcast_to([9000.0, 15_000.0, 4000.0, 15_000.0], (16, 16, 4))
    got = sharpen(read(frame(planes)), planes, GAINS, np.zeros(planes.shape))[8, 8]
    assert got == pytest.approx([9000.0, 18_000.0, 4000.0, 72_000.0], rel=1e-4)


def test_a_lamp_full_in_every_colour_ends_in_white():
    """The smallest case of a magenta lamp: green's plane, a mean with the dark around, had half of what it read."""
    levels = np.array([0.62, 1.0, 0.36, 5.8])
    for row, column in product((0, 1), repeat=2):
        light = np.zeros((32, 32))
        light[14 + row : 17 + row, 14 + column : 17 + column] = 1.0
        light = 20.0 + 150_000.0 * gaussian_filter(light, 0.8)
        raw = frame(np.minimum(light[..., None] * levels, 15_000.0))
        rgb = NAMED["interleaved"].develop(raw, np.eye(3), balance=levels).rgb
        assert rgb[light > 45_000.0] == pytest.approx(15_000.0), (row, column)


def test_dark_beside_a_window_keeps_its_colour():
    """Its light, fifty times as much, fills less than half of their 5 x 5 pixels: walls were grey for two around."""
    planes = np.broadcast_to(0.02 * COLOUR * [1.0, 0.5, 0.2, 0.7], (24, 24, 4)).copy()
    planes[16:, 14:] = COLOUR
    got = sharpen(read_as_white(frame(planes), COLOUR), planes, GAINS, np.zeros(planes.shape))
    assert got == pytest.approx(planes, rel=0.02)


@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
def test_a_wall_beside_a_window_takes_none_of_its_light():
    """Developed from samples: within two pixels of windows 50 times as bright each channel is 0.16 off (2.1 before)."""
    off, levels = list[float](), COLOUR / COLOUR[1]
    for wall, window in (([1, 0.5, 0.2, 0.7], [1, 1, 1, 1]), ([1, 1, 1, 1], [1, 0.5, 0.1, 0.7])):
        for row, column in product((16, 17), (22, 23)):
            light = np.broadcast_to(60.0 * levels * wall, (48, 48, 4)).copy()
            beside = np.zeros((48, 48), bool)
            beside[row - 2 : row + 14, column - 2 : column + 11] = True
            beside[row : row + 12, column : column + 9] = False
            light[row : row + 12, column : column + 9] = 3000.0 * levels * window
            raw = frame(np.random.default_rng(1).poisson(light))
            rgb = NAMED["interleaved"].develop(raw, np.eye(3), balance=levels).rgb
            off.extend((rgb[beside] / (light[..., :3] / levels[:3])[beside] - 1.0).ravel())
    assert np.sqrt(np.mean(np.square(off))) < 0.25


SHAPES = [(129, 9), (2, 2), (2, 7), (5, 2), (4, 3)]


@pytest.mark.sample(3)
@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
@pytest.mark.parametrize(("tile", "shape"), [*product([RGBW], SHAPES), (RGBW_4X4, (129, 9)), (RGBW_4X4, (4, 5))])
def test_both_engines_agree(monkeypatch, tile, shape):
    """Noise and full samples everywhere; single precision, by L D L^T, beside double, by LAPACK."""
    rng = np.random.default_rng(2)
    planes = rng.uniform(0.0, 5000.0, (*shape, 4))
    planes[:, shape[1] // 2 :] += [0.0, 10_000.0, 0.0, 12_000.0]
    averaged = 1e3 * rng.uniform(size=planes.shape)
    raw, gains = frame(rng.uniform(0.0, 16_000.0, (*shape, 4)), tile), np.array([1.5, 1.0, 2.0, 0.3])
    with monkeypatch.context() as patch:
        patch.setattr(edges, "backend", lambda: "numpy")
        expected = sharpen(read(raw), planes, gains, averaged)
        patch.setattr(edges, "STRIP_ROWS", 1)
        assert sharpen(read(raw), planes, gains, averaged) == pytest.approx(expected, rel=1e-6)
    assert (np.abs(expected / planes - 1.0) > 0.01).mean() > 0.1
    assert sharpen(read(raw), planes, gains, averaged) == pytest.approx(expected, rel=1e-4, abs=0.1)


def test_tiny_frames_and_frames_without_light_or_noise():
    for shape, light in product(SHAPES[1:], (0.0, 5000.0)):
        rng = np.random.default_rng(2)
        planes, raw = light * rng.uniform(size=(*shape, 4)), frame(light * rng.uniform(size=(*shape, 4)))
        assert np.isfinite(sharpen(read(raw), planes, np.ones(4), np.zeros(planes.shape))).all(), shape


def test_a_small_full_patch_shows_no_tile():
    """The smallest case: a neutral patch, full in W, in a field of a hundredth of it.

    Green, red and blue agree within a quarter of the patch at every pixel, where each channel's own plane has 0.8 of
    it. The shared edges of before had a tenth.
    """
    for size, row, column in product((3, 4, 5), (0, 1), (0, 1)):
        levels, shape = dict(zip(channels(RGBW), (0.1, 0.2, 0.1, 1.0), strict=True)), (32, 32)
        light = np.full(shape, 400.0)
        light[14 + row : 14 + row + size, 14 + column : 14 + column + size] = 40_000.0
        electrons = np.zeros(shape)
        for name, level in levels.items():
            electrons[mask(RGBW, name, shape)] = level * light[mask(RGBW, name, shape)]
        raw = raw_image(np.minimum(np.rint(electrons), 15_000) + 100)
        rgb = NAMED["interleaved"].develop(raw, np.eye(3), balance=np.array(list(levels.values()))).rgb
        assert np.ptp(rgb, axis=2).max() < 0.25 * 8000.0, (size, row, column)
