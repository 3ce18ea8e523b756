"""What `make verify` keeps: a part that is done is not done again, one that failed or met other code is."""

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent / "verification"))

import verify


class Steps:
    """Two parts that count how often they run; the second is kept where it is told so."""

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.second_kept = False

    def parts(self, wanted: str | None) -> list[tuple[str, Any]]:
        return [("first", lambda: self.run("first", True)), ("second", lambda: self.run("second", self.second_kept))]

    def run(self, name: str, kept: bool) -> tuple[bool, str]:
        self.ran.append(name)
        return kept, f"{name} ran"


@pytest.fixture
def steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Steps:
    made = Steps()
    monkeypatch.setattr(verify, "parts", made.parts)
    monkeypatch.setattr(verify, "code_digest", lambda: "one state")
    monkeypatch.setattr(verify, "RESULTS", tmp_path / "out" / "verify.json")
    monkeypatch.setattr(sys, "argv", ["verify.py"])
    return made


def test_a_part_that_failed_is_tried_again_and_one_that_is_done_is_not(steps, capsys):
    assert verify.main() == 1
    assert "| second | NO | second ran |" in capsys.readouterr().out
    steps.second_kept = True
    assert verify.main() == 0
    assert steps.ran == ["first", "second", "second"]
    assert verify.main() == 0
    assert steps.ran == ["first", "second", "second"]


def test_other_code_is_tried_anew(steps: Steps, monkeypatch: pytest.MonkeyPatch) -> None:
    steps.second_kept = True
    verify.main()
    monkeypatch.setattr(verify, "code_digest", lambda: "another state")
    verify.main()
    assert steps.ran == ["first", "second"] * 2
