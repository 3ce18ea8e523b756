"""Every processor alike: flat fields in every phase, highlights, balance, defects, and what is refused."""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from builders import mosaic_of, raw_image, require_library
from refusal import refusal

from isp.colour.calibrated_colours import fit_of_calibration
from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.processors.any_mosaic import picture_any_mosaic
from isp.processors.catalogue import NAMED, PROCESSORS, libraries
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.colour_spaces import luminance_of_srgb
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import BAYER, MOSAICS, OWN, RGBW, Tile, channels, unit_channel
from sensor.presets import VARIATIONS, preset
from sensor.raw import RawImage
from studies.metrics.truth import light_in_bands, neutral_electrons
from studies.photograph.camera import calibrate, colour_fit

IDENTITY = np.eye(3)
FULL_E = 15_000.0
# A neutral's relative electrons; behind its density W collects what G does.
NEUTRAL = {"R": 0.5, "G": 1.0, "B": 0.4, "W": 5.0, "C": 0.8, "M": 0.7, "Y": 1.0}
ENDS_IN_W = ("rgbw_sato", "rgbw_yamagami", "cmyw_yamagami")  # whose luminance is W
SLOW = [name for name in PROCESSORS if PROCESSORS[name].extra == "bm3d"]  # that library takes seconds: test_sub_images
# ple leans on a prior, by up to 1 % where there is no noise: a file of its own
QUICK = [name for name in PROCESSORS if name not in SLOW and not name.startswith("ple")]
AVAILABLE = [name for name in QUICK if not libraries(name)]


def neutral_of(name: str) -> Mapping[str, float]:
    return NEUTRAL | {"W": 1.0} if PROCESSORS[name].mosaic == "rgbw_nd" else NEUTRAL


def tile_of(name: str) -> Tile:
    mosaic = PROCESSORS[name].mosaic
    if mosaic == OWN:
        return ("YC", "BY")  # as odd as any
    return VARIATIONS[mosaic][0] if mosaic in VARIATIONS else MOSAICS[mosaic]


def unit_of(name: str) -> str:
    return PROCESSORS[name].unit or unit_channel(tile_of(name))


def phases(tile: Tile) -> Iterator[Tile]:
    """Tile turned by each row and column."""
    for row in range(len(tile)):
        turned = tile[row:] + tile[:row]
        for column in range(len(tile[0])):
            yield tuple(line[column:] + line[:column] for line in turned)


def grey(name: str, tile: Tile, level_e: np.ndarray) -> RawImage:
    """Noise-free exposure of a neutral scene whose unit collects `level_e` (h, w), one electron a DN, black 100."""
    share = mosaic_of(neutral_of(name), tile, level_e.shape) / neutral_of(name)[unit_of(name)]
    return raw_image(np.clip(np.rint(level_e * share) + 100, 0, FULL_E + 100), tile, white_dn=FULL_E + 100)


def balanced(name: str, level_e: np.ndarray) -> np.ndarray:
    """Picture of a grey scene, balanced by its neutral."""
    tile = tile_of(name)
    balance = [neutral_of(name)[channel] for channel in channels(tile)]
    return PROCESSORS[name].develop(grey(name, tile, level_e), IDENTITY, balance=balance).rgb


@pytest.mark.sample(4)
@pytest.mark.parametrize("shape", [(30, 33), (17, 16)])
@pytest.mark.parametrize("name", QUICK)
def test_a_flat_grey_field_stays_flat_and_grey_to_the_border_in_every_phase(name: str, shape: tuple[int, int]) -> None:
    require_library(name)
    for tile in phases(tile_of(name)):
        picture = PROCESSORS[name].develop(grey(name, tile, np.full(shape, 1000.0)), IDENTITY)
        assert picture.rgb == pytest.approx(np.full((*shape, 3), 1000.0), rel=1e-5)
        assert picture.balance == dict.fromkeys(channels(tile), "gray world")


def test_a_grey_ramp_into_saturation_takes_no_colour() -> None:
    for name in AVAILABLE:
        # Colours clip one after the other: G at its full well, R and B (balanced) at twice and 2.5 times it. What
        # doesn't hold highlights shows G 15 000 e- beside R and B of up to 37 500. Interpolating across the kink where
        # the ramp ends, or at the frame's border, may miss by one step of the ramp: 500 e-.
        ramp = 5000.0 + 500.0 * np.indices((24, 80))[1]
        rgb = balanced(name, ramp)
        assert np.abs(rgb - rgb[..., 1:2]).max() <= 500.0 * (1 + 1e-6), name
        bright = rgb[:, -20:]
        assert bright == pytest.approx(np.full(bright.shape, bright[0, 0, 0]), rel=1e-5), name


def test_a_ramp_takes_no_colour_where_red_is_full_before_green(monkeypatch: pytest.MonkeyPatch) -> None:
    """As under a lamp: R is full at two thirds of green's well, 10 000 e-, in column 10 of 80."""
    monkeypatch.setitem(NEUTRAL, "R", 1.5)
    for name in AVAILABLE:
        rgb = balanced(name, 5000.0 + 500.0 * np.indices((24, 80))[1])[:, 4:]
        assert np.abs(rgb - rgb[..., 1:2]).max() <= 500.0 * (1 + 1e-6), name


def test_bright_ends_at_greens_full_well_or_where_w_alone_is_the_luminance_at_w_s() -> None:
    for name in AVAILABLE:
        rgb = balanced(name, np.full((24, 24), 1e5))
        ends_with_w = name in ("rgbw_sato", "cmyw_yamagami")
        assert rgb == pytest.approx(np.full((24, 24, 3), FULL_E / 5 if ends_with_w else FULL_E), rel=1e-5), name


def test_nothing_beside_a_highlight_is_brighter_than_it() -> None:
    for name in AVAILABLE:
        # filters with negative weights overshoot at the edge of a square of saturated grey
        rows, columns = np.indices((32, 34))
        square = np.where((abs(rows - 16) < 7) & (abs(columns - 16) < 7), 1e5, 2000.0)
        rgb = balanced(name, square)
        if name in ENDS_IN_W:  # differences of colours from a luminance of their own
            assert luminance_of_srgb(rgb).max() <= FULL_E * (1 + 1e-6), name
        else:
            assert rgb.max() <= FULL_E * (1 + 1e-6), name


def test_listed_defects_are_mended_before_any_processor_sees_them() -> None:
    for name in AVAILABLE:
        raw = grey(name, tile_of(name), np.full((20, 20), 800.0))
        places = np.array([(0, 0), (7, 8), (7, 9), (19, 19)])
        raw.dn[tuple(places.T)] = 15_100
        listed = replace(raw, defects=places)
        rgb = PROCESSORS[name].develop(listed, IDENTITY).rgb
        assert rgb == pytest.approx(np.full((20, 20, 3), 800.0), rel=1e-5), name
        assert np.abs(PROCESSORS[name].develop(raw, IDENTITY).rgb - 800.0).max() > 200.0, name


def test_another_mosaic_is_refused_in_one_line() -> None:
    fit = ColourFit(("R", "G", "B"), np.ones(3), np.eye(3), np.eye(3))
    for name in (name for name in PROCESSORS if PROCESSORS[name].mosaic != OWN):
        raw = raw_image(np.full((16, 16), 500), MOSAICS["rccc"] if "bayer" in name else BAYER)
        for matrix in (IDENTITY, fit):
            refusal(PROCESSORS[name].develop, raw, matrix, match=r"\Araw: mosaic .* allowed here: .*\Z")


@pytest.mark.parametrize("name", SLOW)
def test_without_its_library_a_processor_is_refused_in_one_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bm3d", None)
    raw = grey(name, tile_of(name), np.full((16, 16), 500.0))
    refusal(PROCESSORS[name].develop, raw, IDENTITY, match=r"^bm3d: not installed .*pip install 'rodcone\[bm3d\]'")


def test_every_processor_says_what_it_is() -> None:
    assert list(PROCESSORS)[:3] == ["ple", "interleaved", "bayer"]
    assert tile_of("interleaved") == RGBW
    for name, processor in PROCESSORS.items():
        assert processor.source
        assert {*processor.colours, unit_of(name)} <= set(channels(tile_of(name)))


def test_a_processor_whose_matrix_was_published_plain_is_named_with_and_without_what_it_knows_of_noise() -> None:
    # The others' matrix knows the noise of itself, or is the paper's.
    plain = {name for name, processor in PROCESSORS.items() if processor.noise_gains is None}
    assert plain == {
        *("interleaved", "interleaved_paper", "bayer", "bayer_nlm"),
        *("rccb", "rccc", "ryyb", "mono", "any_mosaic", "ple_rgbw", "ple_bayer", "ple"),
        *("ple_rgbw_net", "ple_bayer_net"),
    }
    assert set(NAMED) == {*PROCESSORS, *(f"{name}_published" for name in {*PROCESSORS} - plain - {"bayer_bilinear"})}
    for name in set(NAMED) - set(PROCESSORS):
        assert NAMED[name].noise_gains is None
        assert NAMED[name].picture is PROCESSORS[name.removesuffix("_published")].picture


# Mosaics without R, G and B: what a fit of their channels can tell, and what guides them.


D65 = light_in_bands(illuminant("D65"), DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM))
ODD = ("rccb", "rccc", "ryyb", "mono")


def patch(mosaic: str, number: int) -> tuple[RawImage, np.ndarray, np.ndarray]:
    """Noise-free exposure of an even patch of the ColorChecker under D65, its neutral, and the fit's own prediction."""
    sensor = preset("low_noise", mosaic)
    light = replace(D65, spectrum=D65.spectrum * color_checker_reflectances()[number][1].band_average(*vars_of(D65)))
    neutral, seen = neutral_electrons(sensor, D65, 1.0), neutral_electrons(sensor, light, 1.0)
    unit = sensor.channels.index(sensor.unit_channel)
    level_e = 1e6 / neutral[unit]
    fit = colour_fit(sensor, PROCESSORS[mosaic], D65)
    expected = fit.matrix(sensor.channels) @ (seen / neutral) * 1e6
    e = mosaic_of(dict(zip(sensor.channels, seen * level_e, strict=True)), sensor.cfa, (12, 12))
    quiet = {"white_dn": 60_000.0, "black_dn": 0.0, "gain_e_per_dn": 100.0, "read_noise_e": 0.0, "dsnu_e": 0.0}
    return replace(raw_image(np.zeros((12, 12)), sensor.cfa, **quiet), dn=e / 100.0), neutral, expected


def vars_of(light):
    return light.wavelength_nm, light.width_nm


@pytest.mark.sample(6)
@pytest.mark.parametrize("number", [0, 8, 12, 13, 14, 15, 20])
@pytest.mark.parametrize("mosaic", ODD)
def test_an_even_colour_is_what_the_fit_of_its_channels_says(mosaic: str, number: int) -> None:
    raw, neutral, expected = patch(mosaic, number)
    fit = colour_fit(preset("low_noise", mosaic), PROCESSORS[mosaic], D65)
    rgb = PROCESSORS[mosaic].develop(raw, fit, neutral=neutral, balance=neutral).rgb
    # 1e6 e- of shot noise, ten times as much in the fit, still move the matrix a little
    assert rgb == pytest.approx(np.broadcast_to(expected, rgb.shape), abs=0.01 * 1e6)


def test_three_channels_give_colour_and_fewer_give_grey_of_the_same_luminance() -> None:
    for mosaic in ODD:
        sensor = preset("low_noise", mosaic)
        names = sensor.channels
        fit = colour_fit(sensor, PROCESSORS[mosaic], D65)
        matrix = fit.matrix(names)
        assert matrix.sum(axis=1) == pytest.approx(np.ones(3), abs=1e-12), mosaic
        assert (np.ptp(matrix, axis=0).max() < 1e-12) == (len(names) < 3), mosaic
        of_file = fit_of_calibration(calibrate(sensor, illuminant("D65")), names)
        assert (np.ptp(of_file.matrix(names), axis=0).max() < 1e-12) == (len(names) < 3), mosaic
        assert luminance_of_srgb(of_file.matrix(names).T) == pytest.approx(luminance_of_srgb(matrix.T), abs=0.15), (
            mosaic
        )


def test_the_clear_pixel_guides_as_w_does() -> None:
    """The same samples with the channel named C or W, G and W apart: the same picture of the three channels."""
    rng = np.random.default_rng(2)
    raw = raw_image(rng.poisson(300.0, (24, 26)) + 100, ("RC", "CB"))
    white = replace(raw, cfa=("RW", "WB"))
    balance = WhiteBalance(None, np.ones(3))
    fit = colour_fit(preset("low_noise", "rccb"), PROCESSORS["rccb"], D65)
    as_c = picture_any_mosaic(raw, fit, balance=balance)
    as_w = picture_any_mosaic(white, replace(fit, channels=("R", "B", "W")), balance=balance)
    assert fit.channels == ("R", "B", "C")
    assert np.array_equal(as_c.rgb, as_w.rgb)
