"""Reference light: the file gives back light and error, and chi-square tells another light from noise."""

from dataclasses import replace
from hashlib import sha256
from io import BytesIO

import numpy as np
import pytest
from refusal import refusal
from scipy.stats import binom

from render.engine import render
from render.error_estimates import Halves
from render.loader import Film
from render.reference import (
    FALSE_ALARM,
    FOLDER,
    agreement,
    find_reference,
    halves_agree,
    open_reference,
    reference_path,
    require_agreement,
    save_reference,
)
from rodcone import load_radiance, load_transport
from rodcone.errors import InputError
from scenes.catalogue import load
from studies.photograph.shot import Order, take
from studies.study.lit_scene import open_choice
from studies.study.study import SceneChoice, Study

SIZE = (64, 64)
BANDS_NM, WIDTH_NM = np.array([450.0, 550.0, 650.0]), np.full(3, 100.0)
NOISE = 0.04  # of a pixel in `still_life` at 64 samples
SEEDS = 200


@pytest.fixture(scope="module")
def small():
    """A real render of few samples, its scene and film."""
    scene = load("still_life")
    film = Film((24, 32), BANDS_NM, WIDTH_NM, scene.max_depth, scene.rr_depth)
    made = render(scene, film.size, wavelength_nm=BANDS_NM, width_nm=WIDTH_NM, spp=64, seed=5)
    return scene, film, made


def noisy(like, light, samples, rng):
    """Transport of a known light with normal noise, the same in all bands of a pixel but for a tenth."""
    share = NOISE * np.sqrt(64 / samples)
    draws = [rng.standard_normal((1, 1, *SIZE)) + 0.1 * rng.standard_normal(light.shape) for _ in range(2)]
    mean, difference = (
        np.asarray(base + share * light * draw, np.float32) for base, draw in zip((light, 0), draws, strict=True)
    )
    return replace(like, light=Halves(mean, difference), counts=np.full(SIZE, samples, np.uint32))


def smooth_light():
    """Light that falls over the picture, with a spectrum that rises by a few percent a band."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    return (0.2 + 0.1 * np.sin(rows / 20) + columns / 400) * (1 + 0.03 * np.arange(3))[None, :, None, None]


def changed(transport, factor):
    return replace(transport, light=Halves(transport.light.mean * np.float32(factor), transport.light.difference))


@pytest.mark.thorough
def test_no_alarm_beyond_the_stated_rate_over_200_seeds(small):
    chances, ratios = [], []
    for seed in range(SEEDS):
        rng = np.random.default_rng([34, seed])
        test = agreement(noisy(small[2], smooth_light(), 64, rng), noisy(small[2], smooth_light(), 4096, rng))
        chances.append(test.chance)
        ratios.append(test.chi_square / test.blocks)
        assert test.blocks == 16
    alarms = int(np.sum(np.array(chances) < FALSE_ALARM))
    assert binom.sf(alarms - 1, SEEDS, FALSE_ALARM) > 1e-4
    # the worst of three bands that err together; the larger of two variances: near 1, so that the test isn't idle
    assert 0.85 < np.mean(ratios) < 1.15


def test_another_light_is_found(small):
    """In all of 10 seeds each: 1 % more light, a surface of 14 % of the picture 2 % lighter, two bands swapped."""
    surface = np.ones((1, 1, *SIZE))
    surface[..., 16:40, 20:44] = 1.02
    for seed in range(10):
        rng = np.random.default_rng([35, seed])
        reference = noisy(small[2], smooth_light(), 4096, rng)
        live = noisy(small[2], smooth_light(), 64, rng)
        swapped = replace(live, light=Halves(live.light.mean[:, [0, 2, 1]], live.light.difference))
        for other in (changed(live, 1.01), changed(live, surface), swapped):
            assert agreement(other, reference).chance < FALSE_ALARM


def with_caustic(transport, light, samples, rng):
    """The transport with 2 % more light that one sample in 100 000 brings: a block of 64 samples a pixel has 0.16."""
    met = rng.poisson(samples / 2 * 1e-5, (2, 1, 1, *SIZE)) / (samples / 2 * 1e-5) * 0.02
    mean = transport.light.mean + np.float32(light * met.mean(axis=0))
    return replace(
        transport, light=Halves(mean, transport.light.difference + np.float32(light * (met[0] - met[1]) / 2))
    )


def test_a_rare_path_that_the_short_render_has_not_met_is_no_alarm(small):
    light, chances = smooth_light(), []
    for seed in range(50):
        rng = np.random.default_rng([36, seed])
        live, long = (with_caustic(noisy(small[2], light, n, rng), light, n, rng) for n in (64, 4096))
        chances.append(agreement(live, long).chance)
    assert min(chances) > FALSE_ALARM


def test_halves_of_independent_pixels_agree_and_a_common_error_is_found(small):
    rng = np.random.default_rng(37)
    made = noisy(small[2], smooth_light(), 64, rng)
    assert halves_agree(made).chance > FALSE_ALARM
    biased = replace(made, light=Halves(made.light.mean, made.light.difference + np.float32(0.02) * made.light.mean))
    assert halves_agree(biased).chance < FALSE_ALARM


def test_a_file_gives_light_to_half_floats_and_its_error(small, tmp_path, monkeypatch):
    scene, film, made = small
    monkeypatch.setenv(FOLDER, str(tmp_path))
    assert find_reference(scene, film) is None
    save_reference(reference_path(tmp_path, scene, film), made, {"command": "rodcone reference"})
    stored = find_reference(scene, film)
    read = stored.transport
    assert stored.certificate["command"] == "rodcone reference"
    assert {"seconds", "integrator", "variant", "engine"} <= set(stored.certificate)
    np.testing.assert_allclose(read.radiance, made.radiance, rtol=2.0**-10, atol=1e-6 * made.radiance.max())
    assert read.level().value == made.level().value
    assert np.array_equal(read.counts, made.counts)
    # error of a flat channel, counted from the halves: that of the bands, or more where bands differ
    error, known = (x.light.difference.sum(axis=(0, 1), dtype=np.float64) for x in (read, made))
    assert 0.9 < np.mean(error**2) / np.mean(known**2) < 1.6
    assert np.corrcoef(error.ravel(), known.ravel())[0, 1] > 0.95
    # pooled over pixels and bands it has the variance of the render's own
    assert read.variance.sum() == pytest.approx(made.variance.sum(), rel=0.1)


def test_what_a_lamp_in_view_lights_keeps_its_digits(small, tmp_path, monkeypatch):
    """A moon of 0.5 degrees in view is 6e5 times as bright as the ground that it lights."""
    scene, film, made = small
    monkeypatch.setenv(FOLDER, str(tmp_path))
    light = made.light.mean / made.light.mean.max(axis=(2, 3), keepdims=True)
    light = np.maximum(light, np.float32(0.1)) * np.float32(1e-6)
    light[..., 0, 0] = 1.0  # the lamp
    save_reference(reference_path(tmp_path, scene, film), replace(made, light=Halves(light, 0 * light)), {})
    read = find_reference(scene, film).transport
    np.testing.assert_allclose(read.light.mean, light, rtol=2.0**-11)


def test_rounding_is_charged_where_it_is_all_the_error_there_is(small, tmp_path, monkeypatch):
    scene, film, made = small
    monkeypatch.setenv(FOLDER, str(tmp_path))
    exact = replace(made, light=Halves(made.light.mean, 0 * made.light.difference))
    save_reference(reference_path(tmp_path, scene, film), exact, {})
    read = find_reference(scene, film).transport
    rounding = read.radiance.astype(np.float64) - exact.radiance
    assert np.mean(rounding**2) > 0
    assert np.mean(read.light.difference.astype(np.float64) ** 2) == pytest.approx(np.mean(rounding**2), rel=0.01)


def test_a_damaged_file_another_size_and_another_surface_are_not_found(small, tmp_path, monkeypatch):
    scene, film, made = small
    monkeypatch.setenv(FOLDER, str(tmp_path))
    path = reference_path(tmp_path, scene, film)
    save_reference(path, made, {})
    assert find_reference(scene, film) is not None
    assert find_reference(scene, replace(film, size=(32, 24))) is None
    lighter = scene.geometry | {"wall": {**scene.geometry["wall"], "bsdf": scene.geometry["table"]["bsdf"]}}
    assert find_reference(replace(scene, geometry=lighter), film) is None
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert find_reference(scene, film) is None


@pytest.mark.thorough
def test_a_render_of_other_paths_agrees_and_a_scaled_one_is_refused_in_one_line(small, tmp_path, monkeypatch):
    scene, film, made = small
    monkeypatch.setenv(FOLDER, str(tmp_path))
    longer = render(scene, film.size, wavelength_nm=BANDS_NM, width_nm=WIDTH_NM, spp=512, seed=34)
    save_reference(reference_path(tmp_path, scene, film), longer, {})
    stored = find_reference(scene, film)
    assert "agrees with it within its noise" in require_agreement(made, stored)
    refusal(require_agreement, changed(made, 1.05), stored, match=r"disagrees with .*; report this line")
    # the error that the file states against an independent seed: of squares over their sum, in blocks of pixels
    other = render(scene, film.size, wavelength_nm=BANDS_NM, width_nm=WIDTH_NM, spp=512, seed=35)
    gap = (other.radiance - stored.transport.radiance).sum(axis=(0, 1), dtype=np.float64)
    stated = sum(x.light.difference.sum(axis=(0, 1), dtype=np.float64) ** 2 for x in (other, stored.transport))
    ratios = gap**2 / stated.mean()
    assert np.mean(np.minimum(ratios, 9)) == pytest.approx(np.mean(np.minimum(stated / stated.mean(), 9)), rel=0.5)


@pytest.mark.filterwarnings("ignore:bands. luminance")  # three bands of 100 nm
def test_a_file_gives_its_light_without_the_scene_and_its_lamps_can_be_replaced(small, tmp_path, monkeypatch):
    scene, film, made = small
    path = reference_path(tmp_path, scene, film)
    save_reference(path, made, {})
    monkeypatch.setenv(FOLDER, str(tmp_path))
    by_scene = find_reference(scene, film).transport
    transport = load_transport(path)
    assert list(transport.groups) == list(scene.groups)
    name = next(iter(scene.groups))
    for change in ({}, {name: "A"}):
        np.testing.assert_array_equal(transport.relight(change).values, by_scene.relight(change).values)
    np.testing.assert_array_equal(load_radiance(path).values, by_scene.relight().values)
    assert not transport.groups[name].coloured  # so the explorer's lamps replace it
    with pytest.warns(UserWarning, match="don't fill the camera's window"):
        taken = take(Order(str(path), tmp_path / "shot.dng", exposure="20ms", light=("A",)))
    assert taken.facts["size"] == list(film.size)
    assert any("reference light, 64 samples a pixel" in note for note in taken.notes)


def test_what_is_no_reference_is_refused_in_a_line(small, tmp_path):
    made = small[2]
    path = tmp_path / "light.npz"
    save_reference(path, made, {})
    whole = path.read_bytes()
    np.savez(tmp_path / "other.npz", light=np.zeros(4))
    (tmp_path / "bomb.npz").write_bytes(_zeros_in_a_zip(1 << 26))
    (tmp_path / "cut.npz").write_bytes(whole[:-100])
    (tmp_path / "flipped.npz").write_bytes(whole[:500] + bytes([whole[500] ^ 1]) + whole[501:])
    for name in ("other", "bomb", "cut", "flipped", "missing"):
        refusal(open_reference, tmp_path / f"{name}.npz", match=f"{name}.npz: there is no intact reference light")
    with pytest.raises(InputError, match=r"is reference light, which a study finds by itself"):
        open_choice(SceneChoice(str(path)), Study((SceneChoice(str(path)),), ("25cd/m2",)))


def _zeros_in_a_zip(size):
    """A small file that unpacks into many bytes, behind its right digest."""
    file = BytesIO()
    np.savez_compressed(file, light=np.zeros(size, np.uint8))
    return sha256(file.getvalue()).digest() + file.getvalue()
