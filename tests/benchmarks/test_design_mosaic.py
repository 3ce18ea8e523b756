"""The search for a mosaic: what it writes commands take, its symmetry, what it keeps, and filters that get better."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import design_mosaic
import design_search as searching
import numpy as np
import pytest
from command_line import call
from design_filters import best_filters
from design_search import Goal, best_tile, camera_db, standing_for

from rodcone import read_study
from rodcone.digests import digest_file
from rodcone.errors import InputError
from sensor.cfa import Tile
from sensor.presets import preset, preset_file, vary
from studies.design import expect as expect_module
from studies.design.expect import ExpectedError, expect
from studies.sweep import provenance

FEW = ["low_noise", "--tile", "2x2", "--letters", "RGB", "--over", "classroom:classroom"]
FIGURES = [ExpectedError(25.0, 0.01, 30.0, 29.0, 31.0, 2.0, 3.0)]


def design(tokens: Iterable[object]) -> None:
    design_mosaic.app([str(token) for token in tokens], result_action="return_value", exit_on_error=False)


@pytest.mark.thorough
def test_the_camera_found_is_a_preset_and_its_study_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [*FEW, "--out", tmp_path / "found", "--behind", "9", "--behind-in-luminance", "9"]
    design(asked)
    out = capsys.readouterr().out
    design(asked)
    assert capsys.readouterr().out == out  # from the tiles that were tried
    tile = tuple(out.splitlines()[0].split("/"))
    camera = preset(tmp_path / "found" / "sensor.toml")
    assert camera.cfa == tile
    assert camera.pixel == preset("low_noise").pixel
    tried = json.loads((tmp_path / "found" / "tried.json").read_text("utf-8"))
    held = tried["gains_db"]
    one, other = (expect(preset("low_noise", rows), [25.0])[0].psnr_db for rows in (tile, ("BG", "GR")))
    assert abs(held["/".join(tile)][0][0] - (one - other)) < 0.05  # a tile's place in the patch
    assert max(gains[0][0] for gains in held.values()) == held["/".join(tile)][0][0]
    assert read_study(tmp_path / "found" / "study.toml").processors[0] == "ple"
    printed = dict(line.split(maxsplit=1) for line in out.splitlines()[3:])
    assert float(printed["design"]) == pytest.approx(held["/".join(tile)][0][0], abs=0.05)
    assert "rgbw_4x4" in printed
    # What another version of the forecast tried doesn't count.
    (tmp_path / "found" / "tried.json").write_text(json.dumps(tried | {"gains_db": {"BB/BB": [[99.0]] * 3}}))
    mine = {Path(expect_module.__file__): "changed"}
    monkeypatch.setattr(provenance, "digest_file", lambda path: mine.get(path) or digest_file(path))
    design(asked)
    assert capsys.readouterr().out == out


@pytest.mark.thorough
def test_a_camera_with_curves_of_its_own_takes_them_along(tmp_path: Path) -> None:
    """Into another folder, with a mosaic over several lines and no W; a damaged file of tiles is refused."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "c.csv").write_text("wavelength_nm,R,G,B\n380,0,0,.3\n580,.1,.4,.1\n780,.4,0,0\n")
    table = '[responses]\ncsv = "c.csv"\nrange_nm = [380, 780]\nquantum_efficiency = "included"\n'
    text = preset_file("white_apart").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = [\n  "RG",\n  "GB"]')
    text = text.replace('channel = "W"', 'channel = "G"') + '\n[[channels]]\nchannel = "B"\nlight_share = 0.5\n'
    (tmp_path / "mine" / "s.toml").write_text(text.replace("\n[lens]", f"\n{table}\n[lens]"), "utf-8")
    few = [tmp_path / "mine" / "s.toml", "--tile", "BR/RB", *FEW[3:], "--out", tmp_path / "found"]
    design(few)
    given, taken = (preset(path) for path in (tmp_path / "mine" / "s.toml", tmp_path / "found" / "sensor.toml"))
    assert taken.responses.curves["G"].values.tolist() == given.responses.curves["G"].values.tolist() == [0, 0.4, 0]
    assert (taken.lens, taken.pixel) == (given.lens, given.pixel)
    assert [x.channel for x in taken.chip.channels] == ["B"]  # G is read apart where there is one
    assert call(["sweep", tmp_path / "found" / "study.toml", "--as-stated", "--dry-run"])[0] == 0
    with pytest.raises(InputError, match="no W"):
        design([tmp_path / "mine" / "s.toml", "--letters", "RGB", "--filters", "--out", tmp_path / "no"])
    assert not (tmp_path / "no").exists()
    (tmp_path / "found" / "tried.json").write_text("[1, 2]")
    with pytest.raises(InputError, match="isn't what this program wrote"):
        design(few)


@pytest.mark.thorough
def test_what_was_tried_with_other_curves_of_the_same_letters_does_not_count(tmp_path, monkeypatch):
    monkeypatch.setattr(design_mosaic, "expected", lambda *_: FIGURES)  # of the cameras beside the tiles
    table = '[responses]\ncsv = "c.csv"\nrange_nm = [380, 780]\nquantum_efficiency = "included"\n'
    text = preset_file("low_noise").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = ["RG", "GB"]')
    (tmp_path / "s.toml").write_text(text.replace("\n[lens]", f"\n{table}\n[lens]"), "utf-8")
    gains = []
    for most in (0.4, 0.2):
        (tmp_path / "c.csv").write_text(f"wavelength_nm,R,G,B\n380,0,0,.3\n580,.1,{most},.1\n780,.4,0,0\n")
        few = ["--tile", "2x2", "--letters", "G", "--over", "classroom:classroom", "--out", tmp_path / "found"]
        design([tmp_path / "s.toml", *few])
        gains.append(json.loads((tmp_path / "found" / "tried.json").read_text("utf-8"))["gains_db"]["GG/GG"])
    assert gains[0] != gains[1]


@pytest.mark.slow
def test_filters_are_written_as_curves_that_read_back(tmp_path: Path) -> None:
    design([*FEW, "--filters", "--out", tmp_path / "found", "--behind", "9", "--behind-in-luminance", "9"])
    camera = preset(tmp_path / "found" / "sensor.toml")
    given = preset("low_noise").responses.curves
    changes = [
        np.abs(curve.values - np.interp(curve.wavelength_nm, given[name].wavelength_nm, given[name].values)).max()
        for name, curve in camera.responses.curves.items()
    ]
    assert max(changes) > 0.02


def test_a_wrong_option_is_refused_and_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for wrong, said in (
        ({"tile": "3x3"}, "tile: '3x3' is unknown"),
        ({"tile": "RG/B"}, "differ in length"),
        ({"exposure": "20"}, "exposure: '20'"),
        ({"letters": "RGQ"}, "letters: 'Q' is unknown"),
        ({"letters": ""}, "letters: '' names no channel"),
        ({"over": "noon:midnight"}, "over: 'noon:midnight' is not a range of levels"),
        ({"weights": (1.0, 2.0)}, "for 7 levels"),
        ({"behind": -101.0}, "behind: -101"),
        ({"never_worse_than": "cmyw"}, "never_worse_than: 'C' is unknown"),
    ):
        with pytest.raises(InputError) as refused:
            design_mosaic.design("low_noise", Goal(**wrong), out=Path("found"))
        assert said in str(refused.value)
    assert not (tmp_path / "found").exists()


SENSOR = preset("low_noise")
ROWS: Tile = ("RG", "GB")
TWO = Goal(over="moonlight:street", behind_in_luminance=0.1)


def test_turned_mirrored_and_shifted_tiles_are_one() -> None:
    assert standing_for(("GB", "RG")) == standing_for(("BG", "GR")) == standing_for(ROWS) == ("BG", "GR")
    tile = np.array([list(row) for row in ("RBWB", "GRGR", "RWBB", "BGRG")])
    for turned in (np.rot90(tile), tile.T, np.roll(tile, (1, 3), (0, 1)), tile[::-1]):
        assert standing_for(tuple("".join(row) for row in turned)) == standing_for(tuple("".join(r) for r in tile))
    assert standing_for(("RG", "BW")) != standing_for(ROWS)


@pytest.mark.thorough
def test_all_small_tiles_are_tried_and_the_best_is_found_again_from_what_is_known(monkeypatch):
    # Three letters: 3^4 tiles are 21 but for turns, mirrors and shifts (Burnside's lemma over the 32 moves).
    wanted, known, shares = replace(TWO, tile="2x2", letters="RGB"), {}, []
    best = best_tile(wanted, SENSOR, known, lambda _, share: shares.append(share))
    assert len(known) == 21
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
    scores = {tile: wanted.score(np.array(gains)) for tile, gains in known.items()}
    assert scores["/".join(best)] == max(scores.values())

    again = []
    monkeypatch.setattr(searching, "camera_db", lambda _, camera: again.append(camera.cfa) or np.zeros((3, 2)))
    assert best_tile(wanted, SENSOR, known, lambda *_: None) == best
    assert again == [ROWS]  # what gains are over


def test_letters_of_no_published_mosaic_are_searched_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        searching, "camera_db", lambda _, camera: np.full((3, 2), float("".join(camera.cfa).count("W")))
    )
    known: searching.Known = {}
    best = best_tile(replace(TWO, letters="RW", steps=20), SENSOR, known, lambda *_: None)
    assert set("".join(best)) <= set("RW")
    assert len(known) > 5
    # what an earlier search found among more letters isn't among these
    known["G" * 4 + "/WWWW" * 3] = [[99.0] * 2] * 3
    assert best_tile(replace(TWO, letters="RW", steps=20), SENSOR, known, lambda *_: None) == best


def test_gains_are_over_the_reference_behind_its_own_filters() -> None:
    known: searching.Known = {}
    asked = Goal(tile="2x2", letters="W", over="classroom:classroom", never_worse_than="rgbw_nd")
    best_tile(asked, SENSOR, known, lambda *_: None)
    assert max(map(abs, known["BR/WG"][0])) > 0.05  # W at its full sensitivity


def test_a_design_behind_the_bound_scores_less_than_the_reference() -> None:
    gains = np.zeros((3, 2))
    assert TWO.score(gains) == 0.0
    gains[0], gains[1, 1] = 0.5, -0.1
    assert TWO.score(gains) == pytest.approx(0.5)
    gains[1, 1] = -0.2
    assert TWO.score(gains) < 0.0


@pytest.mark.thorough
def test_filters_get_better_and_stay_filters() -> None:
    wanted = Goal(over="classroom:classroom", behind=100.0, behind_in_luminance=100.0, rounds=1)
    before = camera_db(wanted, vary(SENSOR, "bayer"))
    camera = best_filters(wanted, SENSOR, ROWS, lambda *_: None)
    after = camera_db(wanted, camera)
    assert after[0, 0] > before[0, 0] + 0.3
    clear = SENSOR.responses.curves["W"]
    for name in "RGB":
        curve = camera.responses.curves[name]
        assert np.all(curve.values >= 0)
        assert np.all(curve.values <= np.interp(curve.wavelength_nm, clear.wavelength_nm, clear.values) + 1e-12)
