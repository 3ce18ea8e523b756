"""Pairs that are one colour under D65: by the sums that define colour, in bands of any width, and to a camera."""

from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal
from skimage.color import deltaE_ciede2000, xyz2lab

from render.engine import render
from render.illuminants import illuminant
from render.scene_range import check_range
from render.spectrum import Spectrum, colour_matching_functions, tristimulus
from rodcone.colour_spaces import adapt_to_d65
from rodcone.types import Floats
from scenes.catalogue import load
from scenes.metamers import HIGH, LOW, OTHER_LIGHT, PAIRS, TWINS_UNDER, pairs
from scenes.reflectances import color_checker_reflectances, read_reflectances
from sensor.curves import Responses, rgbw


def edges_of(width_nm: float) -> tuple[Floats, Floats]:
    nm = np.arange(380.0 + width_nm / 2, 780.0, width_nm)
    return nm, np.full(nm.shape, width_nm)


def xyz(surface: Spectrum, light: str, width_nm: float) -> Floats:
    """Colour as a share of the light's luminance."""
    nm, width = edges_of(width_nm)
    watts = illuminant(light).band_average(nm, width)
    return tristimulus(surface.band_average(nm, width) * watts, nm, width) / tristimulus(watts, nm, width)[1]


def delta_e(one: Spectrum, other: Spectrum, light: str, width_nm: float) -> float:
    nm, width = edges_of(width_nm)
    watts = illuminant(light).band_average(nm, width)
    white = tristimulus(watts, nm, width)
    lab = [xyz2lab(adapt_to_d65(xyz(each, light, width_nm), white)) for each in (one, other)]
    return float(deltaE_ciede2000(*lab))


def electrons(surface: Spectrum, responses: Responses, light: str) -> Floats:
    nm, width = edges_of(1.0)
    photons = illuminant(light).band_average(nm, width) * nm
    return np.asarray(
        responses.band_average(("R", "G", "B", "W"), nm, width) @ (photons * surface.band_average(nm, width))
    )


@loop(("width_nm", "most"), [(1.0, 1e-9), (10.0, 1e-4)])  # of white's Y: an eye sees 5e-4
def test_a_pair_has_one_xyz_under_d65_and_two_under_other_lights(width_nm: float, most: float) -> None:
    assert len(pairs()) == PAIRS
    for one, other in pairs():
        np.testing.assert_allclose(xyz(one, TWINS_UNDER, width_nm), xyz(other, TWINS_UNDER, width_nm), atol=most)
        for light, least in ((OTHER_LIGHT, 1.0), ("F11", 1.0), ("sodium_high", 3.0)):  # 1 can just be seen
            assert least < delta_e(one, other, light, width_nm) < 30.0, light


def test_bands_of_20_nm_part_a_pair_by_less_than_an_eye_sees() -> None:
    # 0.0005 of white's Y is under 0.1 in CIELAB for these colours (L* rises by at most 116 / 3 / 0.02^(2/3) a unit)
    for one, other in pairs():
        assert np.abs(xyz(one, TWINS_UNDER, 20.0) - xyz(other, TWINS_UNDER, 20.0)).max() < 5e-4


def test_a_colorimetric_camera_sees_a_pair_as_one_and_the_projects_own_as_two() -> None:
    matching = colour_matching_functions()
    observer = {
        channel: Spectrum(curve.wavelength_nm, 200 * curve.values / curve.wavelength_nm)  # a photon, under 1
        for channel, curve in zip("RGB", matching, strict=True)
    }
    colorimetric = Responses({**observer, "W": rgbw().curves["W"]})
    for one, other in pairs():
        same = electrons(one, colorimetric, TWINS_UNDER) / electrons(other, colorimetric, TWINS_UNDER)
        np.testing.assert_allclose(same[:3], 1.0, atol=1e-5)
        ratio = electrons(one, rgbw(), TWINS_UNDER) / electrons(other, rgbw(), TWINS_UNDER)
        assert 0.004 < np.abs(ratio - 1).max() < 0.5


def test_made_reflectances_are_smooth_and_could_be_dyes() -> None:
    for curve in (curve for pair in pairs() for curve in pair):
        assert LOW <= curve.values.min() < curve.values.max() <= HIGH
        assert np.abs(np.diff(curve.values)).max() < 0.1  # in steps of 5 nm


def test_the_scene_holds_the_pairs_side_by_side() -> None:
    scene = load("metamers", light="A")
    for index, curve in enumerate(curve for pair in pairs() for curve in pair):
        values = scene.geometry[f"patch{index:02d}"]["bsdf"]["bsdf"]["reflectance"]["values"]
        assert np.array(values.split(","), dtype=float) == pytest.approx(curve.values)
    left, right = (np.array(scene.geometry[f"patch{index:02d}"]["to_world"])[:3, 3] for index in (0, 1))
    assert right - left == pytest.approx([0.045, 0.0, 0.0])


# A chart of measured reflectances in the ColorChecker's place.


NM = np.arange(380.0, 781.0, 5.0)


def written(folder: Path, columns: dict[str, np.ndarray], nm: np.ndarray = NM) -> str:
    rows = [",".join(map(repr, map(float, row))) for row in zip(nm, *columns.values(), strict=True)]
    (folder / "mine.csv").write_text("\n".join([",".join(["wavelength_nm", *columns]), *rows]) + "\n", "utf-8")
    return str(folder / "mine.csv")


def test_the_colorcheckers_own_reflectances_give_the_colorchecker(tmp_path: Path) -> None:
    chart = written(
        tmp_path,
        {name: np.interp(NM, curve.wavelength_nm, curve.values) for name, curve in color_checker_reflectances()},
    )
    asked = {"spp": 4, "wavelength_nm": (450.0, 550.0, 650.0), "seed": 1}
    own, known = (render(load("color_checker", **options), (12, 18), **asked) for options in ({"chart": chart}, {}))
    assert own.radiance == pytest.approx(known.radiance, rel=1e-5)


def test_two_reflectances_fill_the_first_two_patches_and_are_unknown_beyond_their_wavelengths(tmp_path: Path) -> None:
    nm = np.array([400.0, 700.0])
    scene = load("color_checker", chart=written(tmp_path, {"half": np.full(2, 0.5), "black": np.zeros(2)}, nm))
    assert scene.name == "mine"
    assert [key for key in scene.geometry if key.startswith("patch")] == ["patch00", "patch01"]
    check_range(scene, 400.0, 700.0)
    refusal(check_range, scene, 380.0, 780.0, match=r"known over 400-700 nm alone; .*extend")


@loop(
    ("columns", "nm", "words"),
    [
        (
            {"a": [50.0, 60.0]},
            [400, 700],
            "a has values of 50 to 60; allowed: reflectances from 0 to 1; divide per cent",
        ),
        ({"a": [-0.1, 0.5]}, [400, 700], "reflectances from 0 to 1"),
        ({"a": [np.nan, 0.5]}, [400, 700], "no row of numbers"),
        ({"a": [0.1, 0.5]}, [400, 400], "strictly increasing"),
        ({"a": [0.1, 0.5]}, [0.4, 0.7], "mine.csv"),
        ({f"p{n}": [0.1, 0.5] for n in range(25)}, [400, 700], "25 reflectances; allowed: 1 to 24"),
    ],
)
def test_what_is_no_chart_is_refused_in_one_line(columns, nm, words, tmp_path):
    path = written(tmp_path, {name: np.array(values) for name, values in columns.items()}, np.array(nm))
    assert words in refusal(load, "color_checker", chart=path)


def test_other_scenes_have_no_chart(tmp_path: Path) -> None:
    refusal(
        load, "still_life", chart=written(tmp_path, {"a": np.full(NM.shape, 0.5)}), match="option: 'chart' is unknown"
    )
    refusal(read_reflectances, tmp_path / "absent.csv", match="No such file")
