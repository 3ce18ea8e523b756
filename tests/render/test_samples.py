"""Samples that a render tells of are those that it drew: counted by the paths that its integrator was handed."""

from dataclasses import replace

import numpy as np
import pytest
from path_counter import count_paths, pixels_of_paths

from render.engine import render
from render.integrator.dense import Tracer
from scenes.catalogue import load, scene_names

SIZE = (3, 4)
METER_PATHS = 64 * 64 * 2 * 16  # of a light group: its film, in two halves of 16 samples
BANDS = {"wavelength_nm": [450.0, 550.0, 650.0], "width_nm": 100.0}


@pytest.fixture
def paths(monkeypatch):
    return count_paths(monkeypatch)


PILOT = 32  # samples a pixel, where more than 64 are asked for


def drawn(paths, groups):
    """Samples a pixel that the camera's paths make in the mean, since the last count."""
    return paths.pop("camera", 0) / (SIZE[0] * SIZE[1] * groups)


@pytest.mark.sample(1)
@pytest.mark.parametrize("plane", [True, False], ids=["plane", "no plane"])
@pytest.mark.parametrize("name", scene_names())
def test_every_scene_tells_the_samples_it_drew(name, plane, paths):
    scene = load(name)
    if not plane:
        scene = replace(scene, reference_plane=None)
    made = render(scene, SIZE, spp=17, **BANDS)
    units = len(scene.groups) - (made.shared is not None)
    assert drawn(paths, units) == made.spp == 18
    assert "meter" not in paths, "nobody asked for an illuminance"
    assert (made.irradiance is not None) == plane
    assert paths.pop("meter", 0) == plane * units * METER_PATHS


@pytest.mark.sample(6)
@pytest.mark.parametrize("asked", [1, 2, 3, 4, 5, 7, 9, 11, 13, 17, 23, 33, 41, 67, 100, 128, 136, 512, 1000])
@pytest.mark.parametrize("limit", ["spp", "max_spp"])
def test_at_most_an_eighth_more_is_drawn_than_asked_for(limit, asked, paths):
    made = render(replace(load("flat_field"), reference_plane=None), SIZE, **{limit: asked}, **BANDS)
    assert drawn(paths, 1) == made.spp + PILOT * (asked > 64)
    assert asked <= made.spp
    assert made.spp <= 1.125 * (asked + 1)


@pytest.mark.thorough
def test_each_pixel_has_the_samples_that_its_count_tells(monkeypatch):
    """By the numbers of the pixels that the tracer was handed, two light groups and both halves together."""
    scene, size = replace(load("night_street"), reference_plane=None), (12, 18)
    own, found = Tracer.camera, np.zeros(size[0] * size[1], int)

    def camera(self, pixel, points):
        found[:] += np.bincount(pixels_of_paths(pixel, points).astype(int), minlength=found.size)
        return own(self, pixel, points)

    monkeypatch.setattr(Tracer, "camera", camera)
    made = render(scene, size, spp=200, **BANDS)
    groups = len(scene.groups) - (made.shared is not None)
    assert np.array_equal(found.reshape(size), groups * (made.counts.astype(int) + PILOT))
    assert made.counts.max() > made.counts.min(), "the lamps' neighbourhood is noisier than the sky"
    assert made.counts.min() >= made.spp / 4
    assert (made.counts % 2 == 0).all(), "both halves alike"


def test_parts_count_by_their_samples(paths):
    """A mean over all samples: that of the parts, weighed by the samples that were counted."""
    scene = load("cornell_box")
    part = render(scene, SIZE, spp=128, seed=3, **BANDS)
    first = drawn(paths, 1)
    whole = render(scene, SIZE, spp=144, seed=3, resume=part, **BANDS)
    more = drawn(paths, 1)
    assert first - PILOT == part.spp > 64, "with a pilot, which isn't in the mean"
    assert more == pytest.approx(whole.spp - part.spp, rel=1e-12)
    first -= PILOT
    added = (whole.radiance.astype(np.float64) * (first + more) - part.radiance.astype(np.float64) * first) / more
    # What was added has the same expectation: six standard errors, and no pixel is weighed twice.
    error = np.sqrt(part.variance.astype(np.float64) * first * (1 / more + 1 / first))
    assert np.abs(added - part.radiance).max() < 6 * error.max()
    scattered = whole.radiance - np.stack([seen.mean for seen in whole.seen])
    assert scattered.mean(axis=(2, 3)) == pytest.approx(whole.scene_means.radiance, rel=1e-5)
