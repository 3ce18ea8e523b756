"""`rodcone train`: what it writes, and what it refuses; the fit itself is tests/studies/training's."""

import json

from command_line import call, check_refusals

from isp.ple.prior import load_prior, own_prior
from studies.commands import train


def test_it_writes_a_prior_and_prints_its_path(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(train, "train_prior", lambda *given: asked.append(given[1:]) or own_prior())
    code, out, _ = call(["train", "--sensor", "low_noise", "-o", tmp_path / "prior.npz", "--json"])
    assert (code, asked) == (0, [("low_noise", 1)])
    facts = json.loads(out)
    assert load_prior(tmp_path / "prior.npz").source == own_prior().source
    assert facts["path"] == str(tmp_path / "prior.npz")
    assert facts["seed"] == json.loads(own_prior().source)["seed"]


def test_another_ending_is_refused(tmp_path):
    rows = [(f"--sensor low_noise -o {name}", "has another ending; allowed: .npz") for name in ("prior.txt", "prior")]
    check_refusals("train", rows, tmp_path)
