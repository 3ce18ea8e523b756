"""The prior's file, and the mixture that it holds."""

import json
from dataclasses import fields

import numpy as np
import pytest

from isp.ple.prior import OWN, load_prior, mixture, own_prior, save_prior
from rodcone.errors import InputError
from sensor.presets import preset
from studies.training.pictures import LIGHTS, neutral_electrons, photograph_hashes


def test_the_shipped_prior_is_for_the_projects_own_curves_and_says_where_it_is_from():
    prior = own_prior()
    assert prior.neutrals_e == pytest.approx(neutral_electrons(preset("low_noise"), LIGHTS), rel=1e-6)
    assert prior.weights.sum() == pytest.approx(1, abs=1e-4)
    source = json.loads(prior.source)
    assert source["command"].startswith("rodcone train --sensor low_noise --seed ")
    assert source["photographs_sha256"] == photograph_hashes()
    assert {"numpy", "scikit-image", "colour-science"} <= set(source["versions"])
    assert OWN.stat().st_size < 1_400_000


def test_covariances_are_symmetric_and_positive_in_the_patch_and_in_its_middle():
    for size in (8, 4):
        held = mixture(own_prior(), size).covariances
        assert np.abs(held - held.swapaxes(1, 2)).max() < 1e-5
        assert np.linalg.eigvalsh(held.astype(np.float64)).min() > 0
    whole, middle = mixture(own_prior()), mixture(own_prior(), 4)
    kept = np.arange(256).reshape(8, 8, 4)[2:6, 2:6].ravel()
    assert middle.covariances == pytest.approx(whole.covariances[:, kept[:, None], kept], abs=1e-6)


def test_a_prior_is_read_as_it_was_written_but_for_half_precision(tmp_path):
    save_prior(own_prior(), tmp_path / "prior.npz")
    again = load_prior(tmp_path / "prior.npz")
    for field in fields(again):
        first, second = getattr(own_prior(), field.name), getattr(again, field.name)
        assert first == second if field.name == "source" else np.array_equal(first, second), field.name


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04"])
def test_a_file_that_is_no_prior_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "prior.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"^prior: .*prior.npz.* can't be read: .*rodcone train") as error:
        load_prior(tmp_path / "prior.npz")
    assert "\n" not in str(error.value)
