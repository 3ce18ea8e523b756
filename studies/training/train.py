"""Train the prior of a camera's curves, with its provenance."""

import json
from hashlib import sha256
from importlib import metadata

import numpy as np

from isp.ple.prior import Prior
from sensor.config import SensorConfig
from studies.training.em import draw_patches, fit_prior
from studies.training.pictures import LIGHTS, draw_pictures, neutral_electrons, photograph_hashes

_LIBRARIES = ("rodcone", "numpy", "scipy", "scikit-image", "colour-science")


def train_prior(sensor: SensorConfig, name: str, seed: int) -> Prior:
    """Draw the training pictures as a camera's channels see them, and fit the mixture.

    Parameters
    ----------
    sensor : SensorConfig
        Its responses count, and nothing else of it.
    name : str
        What the provenance calls it.
    seed : int
        Of the pictures, their patches and the fit's start.
    """
    digest, pictures = sha256(), []
    for _, picture in draw_pictures(sensor, seed):
        digest.update(picture.tobytes())
        pictures.append(picture)
    rng = np.random.default_rng([seed, 1])
    patches = draw_patches(pictures, rng)
    source = {
        "command": f"rodcone train --sensor {name} --seed {seed}",
        "versions": {library: metadata.version(library) for library in _LIBRARIES},
        "seed": seed,
        "pictures": len(pictures),
        "pictures_sha256": digest.hexdigest(),
        "photographs_sha256": photograph_hashes(),
        "patches": len(patches),
    }
    return fit_prior(patches, neutral_electrons(sensor, LIGHTS), rng, json.dumps(source))
