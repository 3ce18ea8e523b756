"""Samples where they are needed: rates of the pixels by closed forms, and no bias against uniform samples."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t

from render import engine, runs
from render.combine import combine, emission
from render.engine import render
from render.integrator.allocation import LEAST_SHARE, POOL, rates_of
from render.integrator.wavefront import Span
from render.runs import MOST_FLOATS, PILOT
from scenes.catalogue import load

NM = np.arange(450.0, 700.0, 60.0)


def regions(deviations, means, size=12):
    """Sets of two, a region each of a deviation and a mean: the variance of two values a, -a about a mean is 2 a^2."""
    deviation = np.repeat(np.asarray(deviations, np.float32), size)[None] * np.ones((size, 1), np.float32)
    mean = np.repeat(np.asarray(means, np.float32), size)[None] * np.ones((size, 1), np.float32)
    return np.stack([mean + deviation, mean - deviation])[None]


def inside(rates, size=12):
    """Rates of the regions, away from where pooling mixes them."""
    regions = np.split(rates, rates.shape[1] // size, axis=1)
    edge = POOL // 2
    found = [np.unique(region[:, edge:-edge]) for region in regions]
    assert all(len(values) == 1 for values in found)
    return [int(values[0]) for values in found]


def test_samples_follow_the_root_of_variance_over_mean():
    sets = regions([0.1, 0.1, 0.1, 0.1, 0.2], [1e4, 1e4, 1e4, 1e4, 1e4])
    assert inside(rates_of(sets, np.zeros(sets.shape[2:])[None])) == [1, 1, 1, 1, 2]
    # four times the light at one deviation: half the weight's root
    sets = regions([0.1, 0.1, 0.1, 0.1, 0.1], [4e4, 4e4, 4e4, 4e4, 1e4])
    floor = 0.01 * 3.4e4
    assert inside(rates_of(sets, np.zeros(sets.shape[2:])[None])) == [1, 1, 1, 1, 2]
    assert np.sqrt((4e4 + floor) / (1e4 + floor)) == pytest.approx(2, abs=0.05)


def test_every_pixel_gets_a_quarter_of_the_mean_and_few_get_most():
    sets = regions([1e-3] * 40 + [1.0], [1.0] * 41)
    rates = rates_of(sets, np.zeros(sets.shape[2:])[None])
    assert rates.min() == 1
    assert rates.mean() <= LEAST_SHARE
    # weights of 0 and 1, and 0.3 of their mean: roots of 0.3 / 41 and 1 + 0.3 / 41 are to each other as 1 to 11.7
    assert rates.max() == 16
    assert set(np.unique(rates)) <= {1, 2, 4, 8, 16}


def test_without_noise_all_pixels_are_alike():
    sets = regions([0.0, 0.0], [1.0, 0.0])
    assert (rates_of(sets, np.zeros(sets.shape[2:])[None]) == 1).all()
    assert (rates_of(regions([0.2, 0.2], [1.0, 1.0]), np.zeros((1, 12, 24))) == 1).all()


def test_the_noisiest_light_group_decides_each_at_its_power():
    """The second group is a hundred times weaker: it counts where the first is quiet, by its own noise and light."""
    first, second = regions([0.1, 0, 0, 0, 0.1], [1.0] * 5), regions([0, 0, 0.005, 0, 0], [0.01] * 5)
    rates = rates_of(np.concatenate([first, second]), np.zeros((2, *first.shape[2:])))
    alone = rates_of(first, np.zeros((1, *first.shape[2:])))
    # weights of 1, 0, 0.25 and 0, and 0.3 of their mean; the first group alone: 1 and 0
    assert inside(rates) == [4, 1, 2, 1, 4]
    assert inside(alone) == [4, 1, 1, 1, 4]


def test_a_lamp_in_view_adds_light_and_no_weight():
    sets = regions([0.1, 0.1, 0.1], [1.0, 1.0, 1.0])
    lamps = np.zeros((1, *sets.shape[2:]), np.float32)
    lamps[..., 24:] = 1e4
    left, _, right = (rates_of(sets, lamps)[6, column] for column in (3, 18, 33))
    assert left > right


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["cornell_box", "night_street"])
def test_pixels_with_more_samples_are_not_biased(name, monkeypatch):
    """Blocks of 4x4 pixels against uniform samples: one false alarm in a thousand runs, over all of them together."""
    scene, size, repeats = load(name), (24, 32), 8
    blocks = {}
    for uniform in (False, True):
        monkeypatch.setattr(engine, "PILOT_FROM", 1 << 30 if uniform else 64)
        found = []
        for seed in range(repeats):
            made = render(scene, size, wavelength_nm=NM, spp=128, seed=100 * uniform + seed)
            assert (made.counts.max() == made.counts.min()) == uniform
            light = made.radiance - np.stack([seen.mean + np.zeros((NM.size, 1, 1)) for seen in made.seen])
            lights = emission(made.groups, made.wavelength_nm, made.width_nm)
            maps = lights[:, :, None] * np.eye(NM.size)
            found.append(combine(maps, light.astype(np.float32)).sum(axis=0).reshape(6, 4, 8, 4).mean(axis=(1, 3)))
        blocks[uniform] = np.array(found)
    one, other = blocks[False], blocks[True]
    error = np.sqrt((one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / repeats)
    lit = error > 0
    assert np.array_equal(one.mean(axis=0)[~lit], other.mean(axis=0)[~lit])
    z = (one.mean(axis=0) - other.mean(axis=0))[lit] / error[lit]
    assert np.abs(z).max() < t.isf(1e-3 / 2 / z.size, 2 * repeats - 2)


@pytest.mark.parametrize("most_floats", [MOST_FLOATS, 64])
def test_a_pilot_weighs_each_bands_light_by_its_lamp_and_width(
    most_floats: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both chunks in one launch, or one by one; of the second light what is seen directly is the same in both bands."""
    widths, lights, size = np.array([10.0, 30.0]), np.array([[1.0, 2.0], [3.0, 0.5]]), (2, 3)
    rng, chunks = np.random.default_rng(1), PILOT.chunks
    halves = [
        SimpleNamespace(
            radiance=rng.uniform(1, 2, (chunks, 2, 2, *size)).astype(np.float32),
            seen=[rng.uniform(0, 1, (chunks, bands, *size)).astype(np.float32) for bands in (2, 1)],
        )
        for _ in range(2)
    ]
    asked: list[np.ndarray] = []

    def drawn(half: SimpleNamespace, _: np.ndarray, span: Span, __: int) -> tuple[np.ndarray, list[np.ndarray]]:
        chunks = slice(span.start // span.chunk, span.start // span.chunk + span.chunks)
        planes = [x[chunks].reshape(*x[chunks].shape[:-2], -1) for x in (half.radiance, *half.seen)]
        return planes[0], planes[1:]

    monkeypatch.setattr(runs, "_halves", lambda *_: halves)
    monkeypatch.setattr(runs, "_drawn_everywhere", drawn)
    monkeypatch.setattr(runs, "MOST_FLOATS", most_floats)
    monkeypatch.setattr(runs, "rates_of", lambda *planes: asked.extend(planes))
    film = SimpleNamespace(size=size, width_nm=widths, wavelength_nm=np.array([450.0, 470.0]))
    loaded = SimpleNamespace(groups=(1, 0), channels=lambda *_, **__: 8)
    runs.pilot_rates([loaded], film, lights, 0)  # type: ignore[list-item, arg-type]
    scattered, seen = asked
    for slot, group in enumerate(loaded.groups):
        energy = lights[group] * widths
        sets = [(half.radiance[n, slot], half.seen[slot][n]) for half in halves for n in range(chunks)]
        direct = [energy[0] * lamp[0] + energy[1] * lamp[-1] for _, lamp in sets]
        whole = [energy[0] * light[0] + energy[1] * light[1] for light, _ in sets]
        np.testing.assert_allclose(scattered[group], np.subtract(whole, direct), rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(seen[group], np.mean(direct, axis=0), rtol=1e-5)


def test_a_short_render_without_a_pilot_is_made_anew_where_more_is_asked_for():
    scene, options = load("cornell_box"), {"wavelength_nm": NM, "seed": 5}
    part = render(scene, (16, 16), spp=64, **options)
    assert part.counts.max() == part.counts.min() == 64
    on, whole = (render(scene, (16, 16), spp=128, resume=earlier, **options) for earlier in (part, None))
    assert np.array_equal(on.radiance, whole.radiance)
    assert on.seconds > part.seconds
