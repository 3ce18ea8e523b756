"""The search's figures against `expect`, its symmetry, what it keeps, and filters that it makes better."""

from dataclasses import replace

import numpy as np
import pytest

from isp.design.spectral_prior import PRIORS, load_prior
from sensor.cfa import Tile
from sensor.presets import preset, vary
from studies.design import search as searching
from studies.design.expect import drawn_pixels
from studies.design.filters import best_filters
from studies.design.search import Goal, best_tile, camera_db, standing_for

SENSOR = preset("low_noise")
BAYER: Tile = ("RG", "GB")
TWO = Goal(over="moonlight:street", behind_in_luminance=0.1)


def test_exposure_meters_no_surface_that_reflects_more_than_all_light() -> None:
    for prior in PRIORS:
        reflectances = drawn_pixels(prior) @ load_prior(prior).spectra.T
        assert reflectances.max() == pytest.approx(1.0)  # some would, and are taken down to that


def test_turned_mirrored_and_shifted_tiles_are_one() -> None:
    assert standing_for(("GB", "RG")) == standing_for(("BG", "GR")) == standing_for(BAYER) == ("BG", "GR")
    tile = np.array([list(row) for row in ("RBWB", "GRGR", "RWBB", "BGRG")])
    for turned in (np.rot90(tile), tile.T, np.roll(tile, (1, 3), (0, 1)), tile[::-1]):
        assert standing_for(tuple("".join(row) for row in turned)) == standing_for(tuple("".join(r) for r in tile))
    assert standing_for(("RG", "BW")) != standing_for(BAYER)


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
    assert again == [BAYER]  # what gains are over


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
    camera = best_filters(wanted, SENSOR, BAYER, lambda *_: None)
    after = camera_db(wanted, camera)
    assert after[0, 0] > before[0, 0] + 0.3
    clear = SENSOR.responses.curves["W"]
    for name in "RGB":
        curve = camera.responses.curves[name]
        assert np.all(curve.values >= 0)
        assert np.all(curve.values <= np.interp(curve.wavelength_nm, clear.wavelength_nm, clear.values) + 1e-12)
