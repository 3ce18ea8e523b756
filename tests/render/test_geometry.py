"""Transforms: closed forms, and Mitsuba's own transforms as the independent reference."""

import numpy as np
import pytest

from render.geometry import look_at, rotate, scale, to_world, translate
from render.loader import mitsuba_module
from rodcone.jit import Matrix4

POINT = np.array([0.3, -1.2, 2.5, 1.0])


def mitsubas():
    mitsuba_module()
    import mitsuba.scalar_rgb as mi

    return mi.ScalarTransform4f


def test_to_world_applies_the_last_transform_first():
    matrix = np.array(to_world(translate(1, 0, 0), scale(2, 2, 2)))
    assert matrix @ [1, 1, 1, 1] == pytest.approx([3, 2, 2, 1])
    assert np.array(to_world(translate(1, 2, 3))) == pytest.approx(translate(1, 2, 3))


def test_to_world_gives_the_type_that_every_variant_loads():
    assert isinstance(to_world(np.eye(4)), Matrix4)


def test_transforms_equal_mitsubas():
    theirs = mitsubas()
    pairs = [
        (translate(1, -2, 0.5), theirs().translate([1, -2, 0.5])),
        (scale(1, 2, 3), theirs().scale([1, 2, 3])),
        (rotate((0.4, 2, -6), 71.0), theirs().rotate((np.array([0.2, 1, -3]) / np.sqrt(10.04)).tolist(), 71.0)),
        (look_at((1, 2, 3), (-0.5, 0.1, 0.2)), theirs().look_at([1, 2, 3], [-0.5, 0.1, 0.2], [0, 1, 0])),
        (
            look_at((1, 2, 3), (0, 9, 0), up=(0, 0, 1)),
            theirs().look_at(origin=[1, 2, 3], target=[0, 9, 0], up=[0, 0, 1]),
        ),
    ]
    for ours, transform in pairs:
        assert ours @ POINT == pytest.approx(np.array(transform.matrix) @ POINT, rel=1e-5, abs=1e-5)  # theirs: float32
