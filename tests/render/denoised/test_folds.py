"""Denoised light of a render: beside the unbiased, to the same bits when resumed, with an error that is measured."""

from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from render.denoised.relight import measured_error, relight_denoised
from render.engine import render
from scenes.catalogue import load

pytest.importorskip("mitsuba_oidn", reason="rodcone[denoise] is not installed")
SIZE = (32, 32)
BANDS_NM = np.arange(420.0, 740.0, 40.0)
ASKED = {"wavelength_nm": BANDS_NM, "seed": 5}


@pytest.fixture(scope="module")
def box():
    return load("cornell_box")


@pytest.fixture(scope="module")
def made(box):
    return render(box, SIZE, spp=32, denoise=True, **ASKED)


def planes(transport):
    of = transport.denoised
    halves = {"indirect": of.indirect, "folds": of.folds}
    return {"radiance": of.radiance} | {
        f"{name} {k}": x for name, both in halves.items() for k, x in vars(both).items()
    }


@pytest.mark.thorough
def test_the_unbiased_light_keeps_its_bits(box, made) -> None:
    plain = render(box, SIZE, spp=32, **ASKED)
    assert plain.denoised is None
    for one, other in ((plain.light, made.light), (plain.coverage, made.coverage)):
        assert np.array_equal(one.mean, other.mean)
        assert np.array_equal(one.difference, other.difference)
    for name in ("variance", "relative_mc_error", "spp"):
        assert np.array_equal(getattr(plain, name), getattr(made, name))


@pytest.mark.thorough
@pytest.mark.parametrize(("first", "spp"), [(16, 32), (96, 192)], ids=["uniform", "after a pilot"])
def test_stopped_and_resumed_or_cached_gives_the_bits_of_one_go(first, spp, box, tmp_path) -> None:
    made = render(box, SIZE, spp=spp, denoise=True, **ASKED)
    part = render(box, SIZE, spp=first, denoise=True, cache=tmp_path, **ASKED)
    resumed = render(box, SIZE, spp=spp, denoise=True, resume=part, **ASKED)
    continued, cached = (render(box, SIZE, spp=spp, denoise=True, cache=tmp_path, **ASKED) for _ in range(2))
    for again in (resumed, continued, cached):
        assert again.denoised.fold_points == made.denoised.fold_points > part.denoised.fold_points
        assert np.array_equal(again.radiance, made.radiance)
        for name, expected in planes(made).items():
            assert np.array_equal(planes(again)[name], expected), name
    raw = render(box, SIZE, spp=spp, cache=tmp_path, **ASKED)  # an entry of its own
    assert raw.denoised is None
    assert len(list(tmp_path.iterdir())) == 2


def test_only_indirect_light_is_changed(made) -> None:
    direct = np.maximum(made.radiance - made.denoised.indirect.mean, 0)
    smooth = made.denoised.radiance - direct
    assert smooth.min() >= -1e-6
    # A denoiser keeps the light but for some hundredths: it takes single bright samples for noise.
    assert smooth.mean() == pytest.approx(made.denoised.indirect.mean.mean(), rel=0.05)


def test_a_single_scattering_has_nothing_to_denoise(box) -> None:
    direct = render(box, SIZE, spp=8, denoise=True, max_depth=2, **ASKED)
    assert np.array_equal(direct.denoised.radiance, direct.radiance)
    assert not direct.denoised.indirect.mean.any()


def test_folds_are_independent_of_the_render_and_of_each_other(made) -> None:
    """Correlations of the errors of single pixels, 1024 x 8 bands which share paths: under 5 of 1/sqrt(1024)."""
    folds, error = made.denoised.folds[0], made.light.difference[0]
    apart = [folds.mean + sign * folds.difference - made.denoised.radiance[0] for sign in (1, -1)]
    for one, other in ((error, apart[0]), (error, apart[1]), (error, folds.difference)):
        for band in range(BANDS_NM.size):
            a, b = (np.clip(x[band] / np.sqrt(made.radiance[0, band]), -0.2, 0.2).ravel() for x in (one, other))
            assert abs(np.corrcoef(a, b)[0, 1]) < 5 / 32


def test_levels_are_those_of_the_unbiased_light(made) -> None:
    factor = made.relight(luminance_cd_m2=100.0).luminance().sum() / made.relight().luminance().sum()
    at_level, own = relight_denoised(made, luminance_cd_m2=100.0), relight_denoised(made)
    for view, other in zip(at_level, own, strict=True):
        assert view.values == pytest.approx(factor * other.values, rel=1e-4)
    assert 0 < own[0].relative_mc_error < 1


@pytest.mark.thorough
def test_the_told_error_is_the_true_one(box) -> None:
    """Told less true mean squared error of luminance, 16 renders: within 4 of its standard errors (6e-5).

    True against a reference of 2048 samples whose halves are independent of each other.
    """
    reference = render(box, SIZE, wavelength_nm=BANDS_NM, spp=2048, seed=99)
    truths = [view.luminance() for view in reference.relight_halves()]
    told, true, raw = [], [], []
    for seed in range(16):
        transport = render(box, SIZE, wavelength_nm=BANDS_NM, spp=8, seed=seed, denoise=True)
        views = [view.luminance() for view in relight_denoised(transport)]
        weight = np.ones(SIZE)
        told.append(measured_error(views[0] - views[1], views[0] - views[2], weight).mean)
        true.append(measured_error(views[0] - truths[0], views[0] - truths[1], weight).mean)
        plain = transport.relight().luminance()
        raw.append(measured_error(plain - truths[0], plain - truths[1], weight).mean)
    difference = np.subtract(told, true)
    assert abs(difference.mean()) < 4 * difference.std(ddof=1) / 4
    assert np.mean(true) < np.mean(raw)


def test_what_is_refused(box, made) -> None:
    plain = replace(made, denoised=None)
    refusal(relight_denoised, plain, match=r"denoised: the render has none; .*denoise=True")
    refusal(render, box, SIZE, spp=64, denoise=True, resume=plain, match="resume: it wasn't denoised", **ASKED)
