"""Denoised light: closed forms with a denoiser that does nothing, and the real one where it is installed."""

from types import SimpleNamespace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.denoised import denoise as module
from render.denoised.denoise import denoised, first_surfaces
from render.denoised.relight import measured_error
from render.engine import _checked_film
from render.loader import load_groups
from scenes.catalogue import load

SIZE = (40, 48)
BANDS_NM = np.arange(400.0, 780.0, 20.0)


@pytest.fixture
def idle(monkeypatch):
    """A denoiser that gives what it gets; the pictures that it got."""
    got = []

    def denoise(picture, **options):
        got.append((picture, options))
        return picture

    library = SimpleNamespace(denoise=denoise, Device=lambda kind: kind, DeviceType=SimpleNamespace(CPU="CPU"))
    monkeypatch.setattr(module, "denoiser", lambda: library)
    return got


def real():
    pytest.importorskip("mitsuba_oidn", reason="rodcone[denoise] is not installed")


def few_spectra(bands, rank, seed=1):
    """Light of so many spectra, and a textured albedo."""
    rng = np.random.default_rng(seed)
    smooth = np.tensordot(rng.uniform(0.1, 1, (bands, rank)), rng.uniform(0.1, 1, (rank, *SIZE)), 1)
    return smooth.astype(np.float32), rng.uniform(0.05, 0.9, (bands, *SIZE)).astype(np.float32)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("bands", "rank", "calls"), [(20, 6, 2), (20, 2, 2), (6, 6, 2), (4, 4, 2), (3, 3, 1), (1, 1, 1)]
)
def test_light_of_few_spectra_comes_back_from_a_denoiser_that_does_nothing(bands, rank, calls, idle) -> None:
    smooth, albedo = few_spectra(bands, rank)
    normal = np.zeros((3, *SIZE), np.float32)
    assert denoised(smooth * albedo, 0 * albedo, albedo, normal) == pytest.approx(smooth * albedo, rel=2e-3)
    assert len(idle) == 3 * calls  # the whole and each half
    assert all(picture.shape == (*SIZE, 3) for picture, _ in idle)


@pytest.mark.thorough
def test_what_the_denoiser_gets_knows_no_texture_and_no_unit(idle) -> None:
    """Light over albedo, whatever the texture and the power; the guide is the normal, and grey."""
    _, albedo = few_spectra(20, 1)
    normal = np.broadcast_to(np.float32([[[0.0]], [[0.6]], [[0.8]]]), (3, *SIZE))
    made = denoised(np.float32(1e-7) * albedo, 0 * albedo, albedo, normal)
    assert made == pytest.approx(1e-7 * albedo, rel=1e-4)
    for picture, options in idle:
        assert picture == pytest.approx(np.ones((*SIZE, 3)), rel=1e-4)
        assert np.array_equal(np.moveaxis(options["normal"], -1, 0), normal)
        assert (options["albedo"] == 0.5).all()


def halves_of(noise, seed=4):
    """A flat grey surface under light of 1, bands of common paths: mean of two halves and half their difference."""
    rng = np.random.default_rng(seed)
    albedo, normal = np.full((20, 96, 96), 0.5, np.float32), np.zeros((3, 96, 96), np.float32)
    normal[2] = 1
    even, odd = (albedo * np.maximum(1 + noise * rng.standard_normal((96, 96)), 0).astype(np.float32) for _ in range(2))
    return (even + odd) / 2, (even - odd) / 2, albedo, normal


@pytest.mark.thorough
def test_noise_goes_and_light_stays() -> None:
    """A fifth of the noise is left at most (what is mixed in), and 1 % of the light moves."""
    real()
    light, difference, albedo, normal = halves_of(0.7)
    made = denoised(light, difference, albedo, normal)
    assert made.mean() == pytest.approx(light.mean(), rel=0.01)
    assert made.std() < 0.2 * light.std()


def test_what_a_denoiser_spoils_is_taken_from_the_noisy_light(idle, monkeypatch) -> None:
    """A denoiser that gives 1.5 everywhere, and light of 1 with a noise of 0.1 a half: the mean's variance is 0.005,
    the denoised's squared error 0.25. So 0.005 / (0.005 + 0.25 - 0.2 x 0.01) of the difference is taken."""
    library = module.denoiser()
    monkeypatch.setattr(library, "denoise", lambda picture, **options: np.full_like(picture, 1.5))
    light, difference, albedo, normal = halves_of(0.1)
    made = denoised(light, difference, albedo, normal) / albedo
    noise = 0.5 * 0.1**2
    share = noise / (noise + 0.5**2 - 2 * noise * (2 / (16 * np.pi)) ** 0.5)
    assert (made - light / albedo).mean() == pytest.approx(share * 0.5, rel=0.05)


def test_without_the_extra_the_line_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr("rodcone.optional.import_module", missing)
    refusal(module.denoiser, match=r"mitsuba_oidn: not installed .*pip install 'rodcone\[denoise\]'")


def test_first_surfaces_of_a_flat_wall() -> None:
    """The flat field's wall has a reflectance of 0.5 and looks at the camera."""
    scene = load("flat_field")
    film = _checked_film(scene, SIZE, BANDS_NM, None, 8)
    albedo, normal = first_surfaces(load_groups(scene, film)[0], film, 3)
    assert albedo == pytest.approx(np.full((BANDS_NM.size, *SIZE), 0.5), rel=1e-5)
    assert np.linalg.norm(normal, axis=0) == pytest.approx(np.ones(SIZE), rel=1e-5)
    assert np.ptp(normal, axis=(1, 2)) == pytest.approx(np.zeros(3), abs=1e-5)


@pytest.mark.thorough
def test_first_surfaces_are_seen_through_glass_and_by_mirrors() -> None:
    """Bands beyond 40 come in parts; the still life's glass ball shows what is behind it, never a black hole."""
    scene = load("still_life")
    nm = np.linspace(400.0, 770.0, 50)
    film = _checked_film(scene, SIZE, nm, None, 8)
    albedo, normal = first_surfaces(load_groups(scene, film)[0], film, 3)
    assert albedo.shape == (50, *SIZE)
    assert normal.shape == (3, *SIZE)
    assert albedo.min() > 0.01
    assert albedo.max() <= 1 + 1e-5


# The squared error of a picture, measured against two independent pictures: known errors are recovered.


# Student's 95 % quantile with 15 degrees of freedom (Fisher and Yates, table III).
STUDENT_15 = 1.753


def test_closed_form_of_blocks() -> None:
    block_error = np.arange(16.0).reshape(4, 4)
    picture = np.sqrt(np.kron(block_error, np.ones((16, 16))))
    found = measured_error(picture, picture, np.ones((64, 64)))
    assert found.mean == pytest.approx(7.5)
    error = np.std(np.arange(16.0), ddof=1) / 4  # of a mean of 16 blocks
    assert found.standard_error == pytest.approx(error)
    assert found.upper == pytest.approx(7.5 + STUDENT_15 * error, rel=1e-3)


def test_weights_and_channels() -> None:
    picture = np.stack([np.full((32, 32), 2.0), np.full((32, 32), 3.0)])
    weight = np.stack([np.full((32, 32), 0.5), np.zeros((32, 32))])
    found = measured_error(picture, picture, weight)
    assert found.mean == pytest.approx(0.5 * 2**2 / 2)  # of two channels one counts, by half
    assert found.standard_error == pytest.approx(0.0, abs=1e-12)


def test_blocks_at_the_edge_count_by_their_pixels() -> None:
    even = np.full((70, 45), 3.0)
    found = measured_error(even, even, np.ones_like(even))
    assert (found.mean, found.standard_error) == pytest.approx((9.0, 0.0), abs=1e-9)


def test_a_negative_estimate_charges_no_negative_limit() -> None:
    one = np.ones((64, 64))
    found = measured_error(one, -one, one)
    assert found.mean == pytest.approx(-1.0)
    assert found.upper == 0.0


@loop("bias", [0.0, 0.3])
def test_known_bias_and_noise_are_recovered(bias: float) -> None:
    """A picture with a smooth bias and its own noise, folds of four times its variance; 400 frames.

    The mean of the estimates lies within 4 of its standard errors of the truth (false alarms: 6e-5). The limit is under
    the truth in 5 % of the frames: in 400 of a binomial at most 36, and 6 or more, but for 1e-3 on each side. The
    bias is the frame's own and doesn't vary from draw to draw, so that blocks take it for noise: with it fewer.
    """
    rng, frames, noise = np.random.default_rng(5), 400, 0.1
    shape = 0.2 + np.abs(np.sin(np.linspace(0, 3, 96))[:, None] * np.cos(np.linspace(0, 5, 80)))
    means, under = [], 0
    for _ in range(frames):
        truth = bias * shape
        picture, one, other = (rng.normal(0, scale * noise, shape.shape) for scale in (1, 2, 2))
        found = measured_error(picture + truth - one, picture + truth - other, np.ones(shape.shape))
        means.append(found.mean)
        # The error of this frame's picture is what is asked for, its own noise included.
        under += found.upper < np.mean((picture + truth) ** 2)
    expected = np.mean(truth**2) + noise**2
    assert abs(np.mean(means) - expected) < 4 * np.std(means, ddof=1) / frames**0.5
    assert under <= 36
    if bias == 0:
        assert under >= 6
