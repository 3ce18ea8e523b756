"""Facts of a study: which engine made the numbers, and what fell back, in words."""

import pytest

from studies.pages import results
from studies.pages.results import engines_told, notes


def test_what_drew_and_developed_is_told_of_the_cells_that_there_are() -> None:
    made = [{"engines": {"capture": one, "develop": two}} for one, two in (("a", "x"), ("b", "x"), ("a", "x"))]
    assert engines_told([*made, {"engines": None}]) == {"engine of captures": "a, b", "engine of development": "x"}


def test_what_ran_in_numpy_is_told_for_render_captures_and_reconstruction(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "backend", lambda: "llvm")
    assert notes() == []
    monkeypatch.setattr(results, "backend", lambda: "numpy")
    (line,) = notes()
    for part in ("scalar_spectral", "captures", "reconstruction", "NumPy"):
        assert part in line
