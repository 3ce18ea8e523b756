"""Plots of values: the lines that Matplotlib is given are the values themselves."""

from collections.abc import Iterator

import numpy as np
import pytest
from builders import raw_image
from matplotlib import pyplot
from refusal import refusal

from isp.picture import Picture
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from rodcone.display import CHANNEL_COLOURS
from sensor.curves import rgbw
from sensor.emva1288.characterise import characterise
from sensor.presets import low_noise


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
