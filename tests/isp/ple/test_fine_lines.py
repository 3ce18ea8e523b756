"""Grey lines two pixels apart: their moments term by term, grey pictures of them, and colours that stay."""

import numpy as np
import pytest
from builders import raw_image

from isp.ple import fine_lines, pick, pyramid, tables
from isp.ple.prior import LETTERS, PATCH, mixture, own_prior
from sensor.cfa import BAYER, MOSAICS, RGBW, Tile, channel_map
from sensor.raw import RawImage

NEUTRAL = own_prior().neutral_e


def exposure(signal: np.ndarray, level_e: float, tile: Tile, seed: int) -> RawImage:
    """Expose (64, 64) or (64, 64, 4) signals, R, G, B and W over white's, of which G holds `level_e`."""
    channel = np.vectorize(LETTERS.index)(channel_map(tile, (64, 64)))
    by_channel = np.broadcast_to(signal[..., None] if signal.ndim == 2 else signal, (64, 64, 4))
    expected_e = level_e * NEUTRAL[channel] * np.take_along_axis(by_channel, channel[..., None], axis=-1)[..., 0]
    rng = np.random.default_rng(seed)
    held_e = np.minimum(rng.poisson(expected_e), 15_000) + rng.normal(0, np.sqrt(2), (64, 64))
    return raw_image(np.clip(np.round(100 + held_e), 0, 15_100), tile)


def reconstruct(raw: RawImage) -> np.ndarray:
    """R, G and B of each pixel over white's."""
    names = raw.channels
    planes, _ = pyramid.reconstruct(raw, own_prior(), NEUTRAL)
    return planes[..., [names.index(name) for name in "RGB"]] / NEUTRAL[:3]


def test_moments_are_those_of_the_formula_term_by_term():
    trained = mixture(own_prior())
    mix = fine_lines.with_fine_lines(trained)
    first = len(trained.means)
    assert mix.lines == len(mix.means) - first == 2 + fine_lines.SECTORS
    assert np.array_equal(mix.covariances[:first], trained.covariances)
    assert mix.means[first:] == pytest.approx(np.full((mix.lines, 256), 0.9))
    rng = np.random.default_rng(1)
    for (y, x, c), (v, w, d) in [*rng.integers(0, (PATCH, PATCH, 4), (40, 2, 3)).tolist(), [[3, 2, 1]] * 2]:
        square_px2, same = (y - v) ** 2 + (x - w) ** 2, (y, x) == (v, w)
        even = 0.3**2 * np.exp(-square_px2 / (2 * 5.0**2)) + 1e-4 * same
        contrast = 0.6**2 * np.exp(-square_px2 / (2 * 2.5**2))
        colour = (c == d) * (0.015**2 + 1e-5 * same)
        upright, lying, *oblique = mix.covariances[first:, 4 * (PATCH * y + x) + c, 4 * (PATCH * v + w) + d]
        assert upright == pytest.approx(even + (-1) ** (x - w) * contrast + colour, rel=1e-5)
        assert lying == pytest.approx(even + (-1) ** (y - v) * contrast + colour, rel=1e-5)
        for sector, found in enumerate(oblique):
            waves = [
                np.cos(number * (np.cos(angle) * (x - w) + np.sin(angle) * (y - v)))
                for number in np.linspace(2 * np.pi / 6.0, 2 * np.pi / 1.6, 25)
                for angle in np.pi / 6 * (sector + np.linspace(-4, 4, 9) / 9)
            ]
            assert found == pytest.approx(even + 0.4**2 * np.mean(waves) + colour, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(
    ("tile", "upright", "lying"),
    [  # R, G, B, W: 1 in bright columns (or rows) alone, 0 in as many of both
        (("RG", "BW"), (1, -1, 1, -1), (1, 1, -1, -1)),
        (("RG", "GB"), (1, 0, -1, 0), (1, 0, -1, 0)),
        (MOSAICS["quad_bayer"], (0, 0, 0, 0), (0, 0, 0, 0)),
    ],
)
def test_a_tile_of_two_reads_lines_as_a_colour_and_one_of_four_as_none(tile, upright, lying):
    letters = channel_map(tile, (PATCH, PATCH)).ravel()
    rows = np.array([4 * place + LETTERS.index(letter) for place, letter in enumerate(letters)])
    assert fine_lines.aliased(rows, PATCH).tolist() == [list(upright), list(lying)]


def chroma(raw: RawImage) -> float:
    """Largest difference between R, G and B over their mean, in means over 4x4 pixels: their median."""
    means = reconstruct(raw).reshape(16, 4, 16, 4, 3).mean(axis=(1, 3))
    return float(np.median(np.ptp(means, axis=-1) / means.mean(axis=-1)))


@pytest.mark.parametrize("tile", [RGBW, BAYER])
@pytest.mark.parametrize("level_e", [300.0, 9000.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_grey_lines_about_two_pixels_apart_are_grey(tile, level_e, axis, monkeypatch):
    """Their period changes over the frame as in a Siemens star; at 9000 e- every bright W is full.

    Without the two Gaussians the same lines differ by more than a third of their mean from channel to channel.
    """
    across, along = np.indices((64, 64))[:: 1 - 2 * axis] - 32
    raw = exposure(0.6 + 0.35 * np.cos(np.pi * across * (1 + 0.0012 * along)), level_e, tile, seed=2)
    found = chroma(raw)
    tables.table.cache_clear()
    monkeypatch.setattr(tables, "with_fine_lines", lambda mix: mix)
    before = chroma(raw)
    tables.table.cache_clear()
    assert found < 0.07
    assert before > 0.35


@pytest.mark.parametrize("level_e", [50.0, 2000.0])
def test_oblique_grey_lines_are_grey(level_e, monkeypatch):
    """Without the sectors' Gaussians rings around a corner have more than twice the chroma."""
    y, x = np.indices((64, 64))
    raw = exposure(0.6 + 0.35 * np.cos(2 * np.pi * np.hypot(y + 20, x + 20) ** 2 / 400), level_e, RGBW, seed=6)

    def chroma_of_pixels() -> float:
        rgb = reconstruct(raw)
        return float(np.mean(np.ptp(rgb, axis=-1) / rgb.mean(axis=-1)))

    found = chroma_of_pixels()
    monkeypatch.setattr(pick, "UNEXPLAINED", np.inf)
    assert chroma_of_pixels() > 2.0 * found


@pytest.mark.parametrize("level_e", [300.0, 9000.0])
def test_coloured_surfaces_keep_their_colour(level_e, monkeypatch):
    """R like G and a quarter of B is what lying lines show to R, G and B; at 9000 e- W is full and says nothing."""
    texture = np.exp(0.25 * np.random.default_rng(5).normal(size=(64, 64, 1)))
    raw = exposure(texture * np.array([1.0, 1.0, 0.25, 0.9]), level_e, RGBW, seed=3)
    red, green, blue = reconstruct(raw).mean(axis=(0, 1))
    assert blue / red == pytest.approx(0.25, abs=0.05)
    tables.table.cache_clear()
    monkeypatch.setattr(tables, "with_fine_lines", lambda mix: mix)
    assert reconstruct(raw).mean(axis=(0, 1)) == pytest.approx([red, green, blue], rel=0.01)
    tables.table.cache_clear()


def test_pictures_without_lines_two_pixels_apart_keep_all_of_their_bits(monkeypatch):
    """Oblique lines may be the likeliest at an edge, so that these pictures keep their bits only without them."""
    shades = np.add.outer(np.linspace(0.2, 1, 64), 0.3 * (np.arange(64) // 9 % 2))
    raw = exposure(shades, 300.0, RGBW, seed=4)
    with_all = reconstruct(raw)
    with monkeypatch.context() as patch:
        patch.setattr(pick, "UNEXPLAINED", np.inf)
        found = reconstruct(raw)
    tables.table.cache_clear()
    monkeypatch.setattr(tables, "with_fine_lines", lambda mix: mix)
    before = reconstruct(raw)
    tables.table.cache_clear()
    assert np.array_equal(before, found)
    error, error_before = (np.sqrt(np.mean((rgb / 300 - shades[..., None]) ** 2)) for rgb in (with_all, before))
    assert error < 1.01 * error_before
