"""Training: signals of known surfaces, pictures that can be drawn again, and a mixture that is found again."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

from isp.design import spectral_prior
from isp.ple.prior import mixture, own_prior
from isp.ple.pyramid import reconstruct
from render.engine import render
from render.spectrum import luminous_efficiency
from scenes.catalogue import load
from sensor.capture import photograph_radiance
from sensor.optics import form_image
from sensor.presets import preset
from sensor.response import channel_electrons
from studies.training import pictures, spectral, train
from studies.training.pictures import PHOTOGRAPHS, draw_light, draw_surface, neutral_ratios, photograph_signals
from studies.training.train import draw_patches, fit_prior, train_prior


def test_white_reads_1_in_every_channel_where_the_camera_knows_the_light(monkeypatch):
    monkeypatch.setattr(pictures, "UNKNOWN", np.inf)
    for seed in range(10):
        light = draw_light(np.random.default_rng(seed), preset("low_noise"))
        assert light.signals(np.ones(40)) == pytest.approx(np.ones(4))


def test_a_photographs_grey_is_grey_but_for_the_metameric_factor():
    light = draw_light(np.random.default_rng(0), preset("low_noise"))
    signals = photograph_signals(np.random.default_rng(1), light, "camera")
    ratio = signals / signals[..., 3:]
    assert ratio.std(axis=(0, 1)).max() < 1e-3
    assert ratio.mean(axis=(0, 1)) == pytest.approx(np.ones(4), rel=0.4)


def test_surfaces_reflect_no_more_than_they_get():
    surfaces = np.array([draw_surface(np.random.default_rng(seed)) for seed in range(200)])
    assert 0 <= surfaces.min() < surfaces.max() <= 1


def test_a_seed_gives_the_same_pictures():
    light = draw_light(np.random.default_rng(0), preset("low_noise"))
    first, second = (pictures.gratings(np.random.default_rng(3), light) for _ in range(2))
    assert np.array_equal(first, second)
    assert first.shape == (pictures.SIDE, pictures.SIDE, 4)


def test_no_scene_that_is_judged_is_trained_on():
    # of the scenes' package only smooth reflectance curves, not the chart's
    names = {
        f"{node.module}.{alias.name}"
        for path in Path(pictures.__file__).parent.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("scenes")
        for alias in node.names
    }
    assert names == {f"scenes.reflectances.{name}" for name in ("band", "edge", "grey")}
    assert len(set(PHOTOGRAPHS)) == len(PHOTOGRAPHS)


def test_patches_are_in_roots_of_signal_over_their_mean_w():
    picture = np.random.default_rng(0).uniform(0.1, 1, (40, 50, 4)).astype(np.float32)
    patches = draw_patches([picture], np.random.default_rng(1)).reshape(-1, 64, 4)
    assert (patches[..., 3] ** 2).mean(axis=1) == pytest.approx(np.ones(len(patches)), rel=1e-5)


@pytest.mark.thorough
def test_the_mixtures_mean_and_covariance_are_the_patches(monkeypatch):
    monkeypatch.setattr(train, "COMPONENTS", 6)
    monkeypatch.setattr(train, "DIRECTIONS", 10)
    rng = np.random.default_rng(2)
    basis = np.linalg.qr(rng.standard_normal((256, 10)))[0]
    centres = rng.standard_normal((3, 10)) * 2
    patches = 1 + (centres[rng.integers(0, 3, 6000)] + rng.standard_normal((6000, 10)) * 0.3) @ basis.T
    patches += rng.standard_normal(patches.shape) * 0.01
    prior = fit_prior(patches.astype(np.float32), neutral_ratios(preset("low_noise"), ["D65"]), rng, "{}")
    held = mixture(prior)
    weights = np.exp(held.log_weights)
    assert weights.sum() == pytest.approx(1, abs=1e-4)
    mean = weights @ held.means
    assert mean == pytest.approx(patches.mean(axis=0), abs=0.01)
    off = held.means - mean
    covariance = np.tensordot(weights, held.covariances, 1) + (off.T * weights) @ off
    assert covariance == pytest.approx(np.cov(patches.T), abs=0.02)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_prior_trained_anew_is_as_good_as_the_one_that_ships():
    """Sums of another processor lead it elsewhere: one picture moves by 0.1 dB, the mean of four by less than 0.05."""
    ours, anew = own_prior(), train_prior(preset("low_noise"), "low_noise", 1)
    transport = render(load("still_life"), (96, 96), spp=64)
    gains_db = []
    for cfa, luminance_cd_m2 in (("rgbw", 0.2), ("rgbw", 25.0), ("bayer", 0.2), ("bayer", 25.0)):
        sensor, radiance = preset("low_noise", cfa), transport.relight(luminance_cd_m2=luminance_cd_m2)
        raw = photograph_radiance(radiance, sensor)
        truth = channel_electrons(form_image(radiance, sensor), sensor, raw.exposure_s)
        below = truth < 0.95 * sensor.pixel.full_well_e  # what is full no prior knows, and 20 such values decide a mean
        ours_e2, anew_e2 = (
            np.mean((reconstruct(raw, prior, prior.neutral_e)[0] - truth)[below] ** 2) for prior in (ours, anew)
        )
        gains_db.append(10 * np.log10(ours_e2 / anew_e2))
    assert abs(np.mean(gains_db)) < 0.05
    assert max(map(abs, gains_db)) < 0.2


@pytest.mark.thorough
def test_a_spectral_prior_trained_on_little_is_read_back_and_says_from_what(tmp_path, monkeypatch):
    monkeypatch.setattr(spectral, "KINDS_OF", {"drawn": ("gratings", "coins")})
    monkeypatch.setattr(spectral_prior, "PRIORS", {"drawn": tmp_path / "a.npz"})
    monkeypatch.setattr(spectral, "DIRECTIONS", 24)
    source = spectral.train_spectral_prior("drawn", 3, tmp_path / "a.npz")
    prior = spectral_prior.load_spectral_prior.__wrapped__("drawn")
    assert json.loads(prior.source) == json.loads(source)
    assert json.loads(source)["command"] == "rodcone train --spectral drawn --seed 3"
    # Patches were divided by their mean luminous reflectance: the mixture's is 1.
    luminous = luminous_efficiency((prior.edges_nm[1:] + prior.edges_nm[:-1]) / 2, np.diff(prior.edges_nm))
    mean = np.einsum("k,kpc->c", prior.patches.weights, prior.patches.means) / prior.patches.means.shape[1]
    assert (prior.spectra @ mean) @ luminous / luminous.sum() == pytest.approx(1.0, abs=0.01)
    assert np.all(np.diff(prior.reflectances) > 0)
