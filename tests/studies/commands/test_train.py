"""`rodcone train`: what it writes, and what it refuses; the fit itself is tests/studies/training's."""

import json

import pytest

from isp.ple.prior import load_prior, own_prior
from studies.commands import train
from studies.commands.cli import main


def test_it_writes_a_prior_and_prints_its_path(tmp_path, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(train, "train_prior", lambda *given: asked.append(given[1:]) or own_prior())
    with pytest.raises(SystemExit, match="0"):
        main(["train", "--sensor", "low_noise", "-o", str(tmp_path / "prior.npz"), "--json"])
    assert asked == [("low_noise", 1)]
    facts = json.loads(capsys.readouterr().out)
    assert load_prior(tmp_path / "prior.npz").source == own_prior().source
    assert facts["path"] == str(tmp_path / "prior.npz")
    assert facts["seed"] == json.loads(own_prior().source)["seed"]


@pytest.mark.parametrize(("name", "message"), [("prior.txt", "doesn't end in .npz"), ("prior", "doesn't end in .npz")])
def test_another_ending_is_refused(tmp_path, capsys, name, message):
    with pytest.raises(SystemExit, match="2"):
        main(["train", "--sensor", "low_noise", "-o", str(tmp_path / name)])
    assert message in capsys.readouterr().err
