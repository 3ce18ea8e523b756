"""The prior over patches of spectral reflectance, which applies to any response curves, and its file."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from isp.design.expected_error import Gaussians
from rodcone.types import Floats

PATCH = 8  # side of a patch [pixels]
PRIORS = {"drawn": Path(__file__).with_name("drawn.npz"), "photographs": Path(__file__).with_name("photographs.npz")}


@dataclass(frozen=True, eq=False)
class SpectralPrior:
    """A mixture of Gaussians over patches of 8x8 pixels, each given by some coefficients of a basis of reflectances.

    Attributes
    ----------
    edges_nm : (band + 1,) float64
        Edges of the basis's bands.
    spectra : (band, coefficient) float64
        Reflectance in each band that a coefficient of 1 adds.
    patches : Gaussians
        Mixture over patches whose mean luminous reflectance is 1.
    reflectances : (quantile,) float64
        Quantiles of the mean luminous reflectance of patches, all equally likely.
    source : str
        Command, versions, seed and hashes of the training data, as JSON.
    """

    edges_nm: Floats
    spectra: Floats
    patches: Gaussians
    reflectances: Floats
    source: str


@cache
def load_spectral_prior(name: str) -> SpectralPrior:
    """Read one of `PRIORS` by its name."""
    with np.load(PRIORS[name], allow_pickle=False) as file:
        arrays = {key: np.asarray(file[key], dtype=np.float64) for key in file.files if key != "source"}
        source = str(file["source"])
    shape = (len(arrays["weights"]), PATCH**2, arrays["spectra"].shape[1])
    directions = arrays["basis"].shape[1]
    factors = np.zeros((shape[0], directions, directions))
    factors[:, *np.tril_indices(directions)] = arrays["factors"]
    return SpectralPrior(
        edges_nm=arrays["edges_nm"],
        spectra=arrays["spectra"],
        patches=Gaussians(
            weights=arrays["weights"] / arrays["weights"].sum(),
            means=(arrays["mean"] + arrays["centres"] @ arrays["basis"].T).reshape(shape),
            factors=(arrays["basis"] @ factors).reshape(*shape, directions),
            rest=arrays["rest"],
            brightness=float(arrays["reflectances"].std() / arrays["reflectances"].mean()),
        ),
        reflectances=arrays["reflectances"],
        source=source,
    )
