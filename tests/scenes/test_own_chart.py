"""A chart of measured reflectances in the ColorChecker's place."""

from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.engine import render
from render.scene_range import check_range
from scenes.catalog import load
from scenes.reflectances import color_checker, read_reflectances

NM = np.arange(380.0, 781.0, 5.0)


def written(folder: Path, columns: dict[str, np.ndarray], nm: np.ndarray = NM) -> str:
    rows = [",".join(map(repr, map(float, row))) for row in zip(nm, *columns.values(), strict=True)]
    (folder / "mine.csv").write_text("\n".join([",".join(["wavelength_nm", *columns]), *rows]) + "\n", "utf-8")
    return str(folder / "mine.csv")


def test_the_colorcheckers_own_reflectances_give_the_colorchecker(tmp_path: Path) -> None:
    chart = written(
        tmp_path, {name: np.interp(NM, curve.wavelength_nm, curve.values) for name, curve in color_checker()}
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
        ({"a": [np.nan, 0.5]}, [400, 700], "reflectances from 0 to 1"),
        ({"a": [0.1, 0.5]}, [700, 400], "strictly increasing"),
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
