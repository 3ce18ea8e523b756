"""What values show: one short line in a console, a picture in a notebook, their own numbers in a plot."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from builders import raw_image
from matplotlib import pyplot
from PIL import Image
from refusal import refusal

from isp.picture import Picture
from render.engine import render
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from rodcone.colour_spaces import WHITE_AT
from rodcone.display import CHANNEL_COLOURS, MOST_NESTED, brief, preview_png
from scenes.catalogue import load
from sensor.burst import merge_frames
from sensor.curves import rgbw
from sensor.device import draw_device
from sensor.emva1288.characterise import characterise
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
        *(sensor, sensor.pixel, sensor.lens, rgbw(), illuminant("D65"), raw, merge_frames([raw, raw])),
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


# What values show in a notebook: a picture that a PNG reader opens.


def pixels(png: bytes) -> np.ndarray:
    with Image.open(BytesIO(png)) as picture:
        return np.asarray(picture)


def test_a_preview_is_srgb_in_its_own_scale() -> None:
    """An even grey is at 90 % of white whatever its unit; IEC 61966-2-1 encodes 0.9 as 243."""
    encoded = round(255 * (1.055 * WHITE_AT ** (1 / 2.4) - 0.055))
    for value in (1e-9, 1.0, 1e12):
        assert np.array_equal(pixels(preview_png(np.full((4, 6, 3), value))), np.full((256, 384, 3), encoded))
    assert pixels(preview_png(np.full((4, 6), 3.0))).shape == (256, 384)
    assert not pixels(preview_png(np.zeros((4, 6, 3)))).any()


def test_a_small_picture_is_shown_by_whole_multiples() -> None:
    for width, shown in ((64, 384), (300, 300), (500, 500)):
        checks = np.indices((8, width)).sum(axis=0) % 2 * 1.0
        picture = pixels(preview_png(checks))
        times = shown // width
        assert picture.shape == (8 * times, shown)
        assert np.array_equal(picture[::times, ::times] > 0, checks > 0)
        assert np.array_equal(picture[times - 1 :: times, times - 1 :: times], picture[::times, ::times])


def test_radiance_shows_its_colour_and_luminance() -> None:
    nm = np.arange(405.0, 780.0, 50.0)
    values = np.zeros((6, 8, nm.size))
    values[:, :4, nm > 600] = 1.0  # red on the left, blue on the right
    values[:, 4:, nm < 500] = 1.0
    radiance = SpectralRadiance(values, nm)
    shown = pixels(radiance._repr_png_())[::48, ::48]
    assert (shown[:, :4, 0] > shown[:, :4, 2]).all()
    assert (shown[:, 4:, 2] > shown[:, 4:, 0]).all()


def test_a_raw_image_shows_electrons_above_black() -> None:
    dn = np.full((8, 8), 64, np.uint16)
    dn[2, 3] = 1064
    raw = raw_image(dn, black_dn=64.0, white_dn=16383.0, gain_e_per_dn=2.0, prnu=0.01)
    shown = pixels(raw._repr_png_())[::48, ::48]
    assert shown[2, 3] == 255
    assert np.count_nonzero(shown) == 1


def test_a_transport_shows_its_own_lights() -> None:
    from render.engine import render
    from scenes.catalogue import load

    made = render(load("flat_field"), (8, 8), wavelength_nm=np.arange(405.0, 780.0, 50.0), spp=2)
    assert np.array_equal(pixels(made._repr_png_()), pixels(made.relight()._repr_png_()))


def test_nothing_is_drawn_before_it_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "fromarray", lambda *_: pytest.fail("drawn"))
    radiance = SpectralRadiance(np.ones((4, 4, 3)), np.array([450.0, 550.0, 650.0]))
    assert radiance.shape == (4, 4)


# Plots of values: the lines that Matplotlib is given are the values themselves.


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    pyplot.close("all")  # another file's tests may have left some
    yield
    pyplot.close("all")


def test_a_spectrum_is_its_points_in_new_axes_or_in_given_ones() -> None:
    light = Spectrum(np.array([400.0, 500.0, 700.0]), np.array([1.0, 3.0, 2.0]))
    axes = light.plot()
    assert light.plot(axes) is axes
    assert [line.get_xydata().tolist() for line in axes.lines] == [[[400, 1], [500, 3], [700, 2]]] * 2
    assert (axes.get_xlabel(), axes.get_legend()) == ("wavelength, nm", None)


def test_responses_are_a_curve_a_channel_in_its_colour() -> None:
    axes = rgbw().plot()
    assert [line.get_label() for line in axes.lines] == ["R", "G", "B", "W"]
    assert [line.get_color() for line in axes.lines] == [CHANNEL_COLOURS[name] for name in "RGBW"]
    assert axes.lines[1].get_ydata().max() == rgbw().curves["G"].values.max()


def test_a_line_through_a_picture_is_its_row() -> None:
    rgb = np.random.default_rng(0).random((6, 9, 3))
    picture = Picture(rgb, {"R": "given"})
    for axes, cut in ((picture.plot_line(), rgb[3]), (picture.plot_line(row=1), rgb[1])):
        assert np.array_equal(np.transpose([line.get_ydata() for line in axes.lines]), cut)


def test_a_line_through_a_raw_image_holds_each_channels_own_samples() -> None:
    raw = raw_image(np.arange(64, dtype=np.uint16).reshape(8, 8), black_dn=0.0, gain_e_per_dn=2.0)  # RG / BW
    lines = {line.get_label(): line for line in raw.plot_line(row=1).lines}
    assert list(lines) == ["B", "W"]
    assert lines["W"].get_xdata().tolist() == [1, 3, 5, 7]
    assert lines["W"].get_ydata().tolist() == [18, 22, 26, 30]


def test_a_line_through_radiance_is_luminance() -> None:
    radiance = SpectralRadiance(np.random.default_rng(0).random((4, 5, 3)), np.array([500.0, 550.0, 600.0]))
    assert np.array_equal(radiance.plot_line(row=0).lines[0].get_ydata(), radiance.luminance()[0])


def test_a_line_outside_the_picture_is_refused() -> None:
    for asked, words in (({"row": 6}, "row: 6.* 0 to 5"), ({"row": -1}, "row: -1"), ({"row": 1.5}, "row: 1.5")):
        refusal(Picture(np.ones((6, 9, 3)), {"R": "given"}).plot_line, **asked, match=words)
    assert not pyplot.get_fignums()


def test_photon_transfer_is_noise_over_signal() -> None:
    found = characterise(low_noise(), (64, 64))
    axes = found.plot()
    shot, measured, dark = axes.lines
    assert np.allclose(shot.get_ydata(), np.sqrt(shot.get_xdata()))
    assert dark.get_ydata()[0] == pytest.approx(np.sqrt(found.dark_variance_dn2) / found.gain_dn_per_e)
    # where shot noise rules, 10 e- to half the well: 4096 pixels tell a standard deviation to 1.1 %, five of those
    signal, noise = measured.get_data()
    ruled = (signal > 1000) & (signal < 7500)
    assert noise[ruled] == pytest.approx(np.sqrt(signal[ruled]), rel=0.055)
