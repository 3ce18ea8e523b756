"""What a console prints of a value: one short line, whatever arrays it holds."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from builders import raw_image

from isp.picture import Picture
from render.engine import render
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from rodcone.display import MOST_NESTED, brief
from scenes.catalog import load
from sensor.burst import merge
from sensor.curves import rgbw
from sensor.device import draw_device
from sensor.presets import low_noise
from studies.photograph.camera import calibrate
from studies.study.study import SceneChoice, Study


@dataclass(frozen=True)
class Held:
    """Something of every kind."""

    value: Any
    size: int = 3
    names: tuple[str, ...] = ()
    more: Any = field(default_factory=dict)

    __repr__ = brief


FIELDS = [
    (2.0, "2"),
    (np.float32(0.1), "0.1"),
    (1 / 3, "0.333333"),
    (True, "True"),
    (None, "None"),
    ("D65", "'D65'"),
    (np.arange(3), "[0, 1, 2]"),
    (np.array([0.5, np.nan]), "[0.5, nan]"),
    (np.zeros(0), "<0 float64>"),
    (np.arange(7.0), "<7 float64, 0 to 6>"),
    (np.append(np.arange(7.0), np.nan), "<8 float64, 0 to 6>"),
    (np.full((2, 4), np.nan), "<2 x 4 float64, all NaN>"),
    (np.zeros((2, 3), bool), "<2 x 3 bool>"),
    (np.zeros((2, 3, 4), np.float32), "<2 x 3 x 4 float32>"),
    ({"a": 1, "b": 2.5}, "{a: 1, b: 2.5}"),
    ({"a": np.zeros(9)}, "{a}"),
    ({str(i): i for i in range(9)}, "{0, 1, 2, 3, 4, ... 9 in all}"),
    (list(range(9)), "(0, 1, 2, 3, 4, ... 9 in all)"),
    (("x" * 90, "y" * 90), "<tuple of 2>"),
    ("x" * 500, "'" + "x" * (MOST_NESTED - 1) + "...'"),
    (len, "<builtin_function_or_method>"),
    (Held(1), "Held(value=1, more={})"),
]


def test_a_field_is_told_by_its_kind() -> None:
    for value, text in FIELDS:
        assert brief(Held(value)) == f"Held(value={text}, more={{}})"


def test_fields_at_their_defaults_are_left_out_and_others_are_not() -> None:
    assert repr(Held(0, size=3, names=())) == "Held(value=0, more={})"
    assert repr(Held(0, size=4, names=("a",), more=None)) == "Held(value=0, size=4, names=('a'), more=None)"


def test_values_of_the_chain_are_short_lines() -> None:
    sensor = low_noise()
    transport = render(load("flat_field"), (8, 8), spp=2)
    raw = raw_image(np.full((8, 8), 64, np.uint16))
    values = (
        *(load("still_life"), load("still_life").groups["softbox"], transport, transport.relight()),
        *(sensor, sensor.pixel, sensor.lens, rgbw(), illuminant("D65"), raw, merge([raw, raw])),
        *(draw_device(sensor, (64, 64), np.random.default_rng(1)), calibrate(sensor, illuminant("D65"))),
        *(Picture(np.ones((8, 8, 3)), {"R": "given"}), SpectralRadiance(np.ones((4, 4, 3)), np.array([400, 500, 600]))),
        Study((SceneChoice("still_life"),), ("moonlight",)),
    )
    for value in values:
        text = repr(value)
        assert text.startswith(f"{type(value).__name__}("), text
        assert len(text) < 750, text  # a transport has fourteen arrays
        assert "\n" not in text
    assert repr(load("still_life")).startswith("Scene(name='still_life', geometry={type, sensor, ")
    assert "lens=LensConfig(f_number=2.8, diffraction=1), responses=Responses(curves={R, G, B, W})" in repr(sensor)
