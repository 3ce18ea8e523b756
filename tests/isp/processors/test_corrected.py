"""A picture corrected by a network: its layers beside plain sums, each phase of a tile, and what is left as it is."""

from dataclasses import replace

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_PHASES, raw_image
from refusal import refusal
from scipy.signal import correlate

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.processors import corrected
from isp.processors.catalogue import PROCESSORS
from isp.processors.piecewise import PiecewisePicture
from render.radiance import SpectralRadiance
from render.spectrum import band_widths
from rodcone.colour_spaces import decode_srgb, encode_srgb, white_of
from scenes.reflectances import color_checker_reflectances
from sensor.capture import expose_channels
from sensor.cfa import channels, mask
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.response import imaged_electrons
from studies.metrics.truth import named_light, neutral_electrons
from studies.photograph.camera import colour_fit

TRANSPOSED = [("RB", "GW"), ("GW", "RB"), ("BR", "WG"), ("WG", "BR")]
WHITE_FOR_GREEN = [("RG", "WB"), ("GR", "BW"), ("WB", "RG"), ("BW", "GR"), ("RW", "GB"), ("GB", "RW")]
GREEN_DIAGONAL = [("RW", "BG"), ("RB", "WG"), ("GB", "WR")]
SHAPES = {
    "first": (7, 36, 3),
    "fine1": (7, 7, 3),
    "fine2": (7, 7, 3),
    "half1": (5, 7, 3),
    "half2": (5, 5, 3),
    "quarter1": (6, 5, 3),
    "quarter2": (6, 6, 3),
    "quarter3": (6, 6, 3),
    "quarter4": (5, 6, 1),
    "up1": (5, 5, 3),
    "up2": (5, 5, 3),
    "up3": (7, 5, 1),
    "last1": (7, 7, 3),
    "last2": (7, 7, 3),
    "residual": (12, 7, 3),
}


def random_network(seed=3):
    rng, weights = np.random.default_rng(seed), {}
    for name, (out, seen, side) in SHAPES.items():
        spread = (2 / (seen * side**2)) ** 0.5
        weights[f"{name}.weight"] = rng.normal(0.0, spread, (out, seen, side, side)).astype(np.float32)
        weights[f"{name}.bias"] = rng.normal(0.0, 0.1, out).astype(np.float32)
    return weights


def developed(tile, shape=(20, 30), seed=5):
    """Raw image of noise about a picture of chance, and what is taken for `ple`'s."""
    rng = np.random.default_rng(seed)
    planes = rng.uniform(50.0, 2000.0, (*shape, len(channels(tile))))
    at_site = np.zeros(shape)
    for index, name in enumerate(channels(tile)):
        at = mask(tile, name, shape)
        at_site[at] = planes[..., index][at]
    raw = raw_image(np.rint(at_site + rng.normal(0.0, 20.0, shape)) + 100, tile)
    picture = Picture(planes[..., :3] @ np.array([[1.5, -0.3, -0.2], [-0.2, 1.4, -0.2], [0.1, -0.6, 1.5]]).T, {})
    return raw, PiecewisePicture(picture, planes, np.linspace(0.5, 2.0, planes.shape[-1]))


def by_sums(values, weights, name, step):
    """Layer by correlations of whole planes in double precision, zeros beyond the frame."""
    filters = weights[f"{name}.weight"].astype(np.float64)
    edge = filters.shape[-1] // 2
    wide = np.pad(values.astype(np.float64), [(edge, edge), (edge, edge), (0, 0)])
    planes = [
        sum(correlate(wide[..., i], one[i], "valid", "direct") for i in range(len(one))) + bias
        for one, bias in zip(filters, weights[f"{name}.bias"], strict=True)
    ]
    return np.stack(planes, axis=-1)[::step, ::step]


def test_the_network_is_what_plain_sums_give() -> None:
    weights, rng = random_network(), np.random.default_rng(4)
    packed = rng.normal(0.0, 1.0, (12, 16, 36)).astype(np.float32)

    def through(values, *names):
        for name in names:
            values = by_sums(np.maximum(values, 0.1 * values), weights, name, corrected.STEPS[name])
        return values

    def doubled(values):
        return np.kron(values, np.ones((2, 2, 1)))

    fine = by_sums(packed, weights, "first", 1)
    fine = fine + through(fine, "fine1", "fine2")
    half = through(fine, "half1", "half2")
    half = half + doubled(through(half, "quarter1", "quarter2", "quarter3", "quarter4"))
    fine = fine + doubled(through(half, "up1", "up2", "up3"))
    expected = through(fine + through(fine, "last1", "last2"), "residual")
    found = corrected.residual(packed, weights)
    assert np.abs(expected).max() > 1
    assert found == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def test_strips_of_a_frame_are_what_the_whole_gives(monkeypatch) -> None:
    weights = random_network()
    # A thirtieth of the residual, on a picture that isn't near black: most of the whole would lie beyond black or
    # white, where no difference shows.
    weights |= {name: weights[name] / 30 for name in ("residual.weight", "residual.bias")}
    raw, made = developed(RGBW_PHASES[3], (233, 26))
    made = replace(made, picture=replace(made.picture, rgb=200.0 + np.abs(made.picture.rgb)))
    whole = corrected.corrected(raw, made, weights).rgb
    for rows in (8, 72, 128):
        monkeypatch.setattr(corrected, "STRIP_ROWS", rows)
        assert corrected.corrected(raw, made, weights).rgb == pytest.approx(whole, rel=1e-4), rows
    monkeypatch.setattr(corrected, "REACH", 32)
    assert corrected.corrected(raw, made, weights).rgb != pytest.approx(whole, rel=1e-4), "pixels there depend on it"


def test_the_picture_of_a_turned_frame_is_the_turned_picture() -> None:
    """Only the middle is compared, because zeros lie beyond the frame at other distances. One pass isn't symmetric."""
    weights, size = random_network(), 142  # so that the coarsest pixels, of 8 x 8, are the same from either end
    raw, made = developed(BAYER_PHASES[0], (size, size))
    picture = corrected.corrected(raw, made, weights).rgb
    turned_raw = replace(raw, dn=raw.dn[::-1, ::-1], cfa=tuple(row[::-1] for row in raw.cfa[::-1]))
    turned = replace(made.picture, rgb=made.picture.rgb[::-1, ::-1])
    found = corrected.corrected(turned_raw, PiecewisePicture(turned, made.planes[::-1, ::-1], made.gains), weights).rgb
    assert found[::-1, ::-1][63:79, 63:79] == pytest.approx(picture[63:79, 63:79], rel=1e-4)


def test_a_network_without_a_residual_leaves_the_picture_to_the_bit() -> None:
    weights = random_network()
    weights |= {name: np.zeros_like(weights[name]) for name in ("residual.weight", "residual.bias")}
    for tile in (RGBW_PHASES[0], BAYER_PHASES[0]):
        raw, made = developed(tile)
        assert np.array_equal(corrected.corrected(raw, made, weights).rgb, made.picture.rgb)


def test_the_network_sees_every_tile_as_one_that_begins_with_red_and_then_green(monkeypatch) -> None:
    """A residual that is a tenth of the picture it is given: each pixel's own, whatever the phase and the size."""
    seen = []

    def tenth(packed, weights):
        seen.append(packed)
        return 0.1 * packed[..., :12]

    monkeypatch.setattr(corrected, "residual", tenth)
    white_below = [0, 0, 1, 0]
    for tile in [*RGBW_PHASES, *TRANSPOSED, *BAYER_PHASES, *WHITE_FOR_GREEN]:
        raw, made = developed(tile, (21, 30))
        white = white_of(made.picture.rgb)
        change = 0.1 * encode_srgb(made.picture.rgb / white)
        found = corrected.corrected(raw, made, {}).rgb
        assert found == pytest.approx(corrected.added(made.picture.rgb, change, white), rel=1e-5, abs=1e-3), tile
        of_white = seen[-1][..., 32:].mean(axis=(0, 1))
        last = [0, 0, 0, 1 if "W" in "".join(tile) else 0]
        assert of_white.tolist() == (white_below if tile in WHITE_FOR_GREEN else last), tile
        assert not np.any(np.array(seen[-1].shape[:2]) % 4)


def test_what_the_network_sees_is_the_sample_in_units_of_its_noise() -> None:
    raw, made = developed(RGBW_PHASES[0])
    white = 1000.0
    seen = corrected.correction_inputs(raw, made, white)
    at = mask(raw.cfa, "W", raw.shape)
    expected_e, gain = made.planes[at][:, 3], made.gains[3]
    noise_e = np.sqrt(expected_e + raw.dark_noise_e**2 + (raw.prnu * expected_e) ** 2)
    misfit = np.clip((raw.electrons[at] - expected_e) / noise_e, -5, 5) / 3
    assert seen[at][:, 5] == pytest.approx(misfit, abs=1e-4)
    # The noise is that of the encoded value, to first order.
    step = 1e-4
    linear = expected_e * gain / white
    kept = linear < 0.99
    slope = (encode_srgb(linear + step) - encode_srgb(linear)) / step
    assert seen[at][kept, 4] == pytest.approx(np.minimum(noise_e * gain / white * slope, 1)[kept], rel=1e-3)
    assert seen[at][:, 3] == pytest.approx(encode_srgb(raw.electrons[at] * gain / white), abs=1e-6)


def test_a_change_of_encoded_values_is_added_to_light() -> None:
    rgb = np.array([[[-5.0, 20.0, 150.0]]])  # white is 100
    assert np.array_equal(corrected.added(rgb, np.zeros((1, 1, 3)), 100.0), rgb)
    up = corrected.added(rgb, np.full((1, 1, 3), 0.1), 100.0)[0, 0]
    assert up == pytest.approx(
        [100 * decode_srgb(np.array(0.1)), 100 * decode_srgb(encode_srgb(np.array(0.2)) + 0.1), 150]
    )
    down = corrected.added(rgb, np.full((1, 1, 3), -0.1), 100.0)[0, 0]
    assert down[0] == -5.0, "what is under black stays"
    assert down[2] == pytest.approx(50 + 100 * decode_srgb(np.array(0.9))), "the excess over white stays"


def test_pixels_of_a_tile_go_side_by_side_and_back() -> None:
    pixels = np.arange(4 * 6 * 5, dtype=np.float32).reshape(4, 6, 5)
    packed = corrected.pack(pixels)
    assert packed.shape == (2, 3, 20)
    assert packed[1, 2, 4:8].tolist() == pixels[2:4, 4:6, 1].ravel().tolist()
    assert np.array_equal(corrected.unpack(packed), pixels)


def test_green_diagonal_to_red_is_refused() -> None:
    fit = ColourFit.of(np.eye(3))
    for tile in GREEN_DIAGONAL:
        raw = raw_image(np.full((16, 16), 500), tile)
        refusal(corrected.picture_corrected_rgbw, raw, fit, balance=WhiteBalance(), match="G beside R")


@pytest.mark.parametrize("tile", ["RG/BW", "RG/GB", "RG/WB"])
def test_the_weights_come_closer_to_exact_planes_than_ple_on_each_tile(tile) -> None:
    """Rectangles of the ColorChecker's reflectances in D65, photographed at 5 cd/m^2."""
    rng, light = np.random.default_rng(8), named_light("D65")
    nm, width = light.wavelength_nm, band_widths(light.wavelength_nm)
    curves = [curve.band_average(nm, width) for _, curve in color_checker_reflectances()]
    values = np.empty((96, 96, len(nm)))
    values[:] = curves[0]
    for _ in range(200):
        (top, left), (high, wide) = rng.integers(-5, 96, 2).clip(0), rng.integers(3, 20, 2)
        values[top : top + high, left : left + wide] = curves[rng.integers(24)] * rng.uniform(0.3, 1.0)
    radiance = SpectralRadiance(values * light.spectrum, nm)
    radiance = SpectralRadiance(5.0 * radiance.values / radiance.luminance().mean(), nm)
    sensor = low_noise(tile)
    sensor = replace(sensor, lens=replace(sensor.lens, diffraction=0.0))
    expected_e = imaged_electrons(radiance, sensor, 0.02)
    raw = expose_channels(expected_e, sensor, 0.02, draw_device(sensor, (96, 96), rng), rng, exact=True)
    neutral = neutral_electrons(sensor, light, 0.02)
    names = ("ple_bayer", "ple_bayer_net") if tile == "RG/GB" else ("ple_rgbw", "ple_rgbw_net")
    fit = colour_fit(sensor, PROCESSORS[names[0]], light)
    exact = (expected_e / neutral)[..., [sensor.channels.index(name) for name in "RGB"]] @ fit.matrix().T
    scale = neutral[sensor.channels.index("G")]
    found = [PROCESSORS[name].develop(raw, fit, balance=WhiteBalance.of(raw, neutral, neutral)) for name in names]
    white = exact.max()
    errors = [
        np.mean((encode_srgb(picture.rgb / scale / white) - encode_srgb(exact / white)) ** 2) for picture in found
    ]
    assert 10 * np.log10(errors[0] / errors[1]) > 0.5
