"""The prior's file, and the mixture that it holds."""

import json
from dataclasses import fields
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from isp.ple.prior import OWN, load_prior, mixture, own_prior, save_prior
from rodcone.errors import InputError
from sensor.presets import preset
from studies.training.pictures import LIGHTS, neutral_ratios, photograph_hashes


def test_the_shipped_prior_is_for_the_projects_own_curves_and_says_where_it_is_from():
    prior = own_prior()
    assert prior.neutrals_e == pytest.approx(neutral_ratios(preset("low_noise"), LIGHTS), rel=1e-6)
    assert prior.weights.sum() == pytest.approx(1, abs=1e-4)
    source = json.loads(prior.source)
    assert source["command"].startswith("rodcone train --sensor low_noise --seed ")
    assert source["photographs_sha256"] == photograph_hashes()
    assert {"numpy", "scikit-image", "colour-science"} <= set(source["versions"])
    assert OWN.stat().st_size < 1_400_000


@pytest.mark.thorough
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


def arrays(**changes):
    with np.load(OWN) as file:
        return {**file, **changes}


HOSTILE = {  # each a few kB on disk
    "zeros that take 256 MiB": lambda path: zeros_in_a_zip(path, 1 << 28),
    "a shape of 4 EiB": lambda path: shape_alone(path, (1 << 30, 1 << 30)),
    "pickles": lambda path: np.savez(path, **arrays(rest=np.array([{}, {}], dtype=object))),
    "not a number": lambda path: np.savez(path, **arrays(rest=np.full_like(own_prior().rest, np.nan))),
    "a negative weight": lambda path: np.savez(path, **arrays(weights=-own_prior().weights)),
    "a variance of 0": lambda path: np.savez(path, **arrays(rest=0 * own_prior().rest)),
    "dark neutrals": lambda path: np.savez(path, **arrays(neutrals_e=0 * own_prior().neutrals_e)),
    "other shapes": lambda path: np.savez(path, **arrays(rest=np.ones(3))),
    "a million Gaussians": lambda path: np.savez_compressed(path, **without_directions(1_000_000)),
}


def without_directions(components):
    """Shapes that fit each other: covariances of a million Gaussians would take 262 GB."""
    empty, ones = np.zeros((components, 0), np.float32), np.full(components, 1e-6, np.float32)
    return arrays(basis=np.zeros((256, 0)), centres=empty, factors=empty, weights=ones, rest=ones)


def zeros_in_a_zip(path, size):
    with ZipFile(path, "w", ZIP_DEFLATED) as file, file.open("mean.npy", "w", force_zip64=True) as entry:
        for _ in range(size >> 24):
            entry.write(bytes(1 << 24))


def shape_alone(path, shape):
    with ZipFile(path, "w") as file, file.open("neutrals_e.npy", "w") as entry:
        np.lib.format.write_array_header_1_0(entry, {"descr": "<f4", "fortran_order": False, "shape": shape})


def test_a_hostile_prior_is_refused_in_one_line(tmp_path):
    path = tmp_path / "prior.npz"
    for content in (b"", b"no zip", b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"\Aprior: .*prior.npz.* can't be read \(.*rodcone train.*\Z"):
            load_prior(path)
    for write in HOSTILE.values():
        write(path)
        with pytest.raises(InputError, match=r"\Aprior: .*prior.npz.*\Z"):
            load_prior(path)
