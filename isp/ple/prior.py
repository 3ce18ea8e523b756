"""The prior over patches: a mixture of Gaussians, the file that holds it, and the Gaussians in a patch's own pixels.

A patch is 8x8 pixels of R, G, B and W, in roots of signal over the patch's mean W, so that one prior serves at every
light. A signal is electrons over those of what the camera takes for white; its curves and the light decide what that
is, its noise, well, exposure and mosaic don't.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.files import replacing

PATCH = 8  # pixels a side
LETTERS = ("R", "G", "B", "W")
OWN = Path(__file__).with_name("prior.npz")  # of the project's own curves, `sensor.curves.rgbw`
_FIELDS = ("neutrals_e", "mean", "basis", "weights", "centres", "factors", "rest")


@dataclass(frozen=True, eq=False)
class Prior:
    """A mixture of Gaussians over patches, in a basis of the patches' principal directions.

    Attributes
    ----------
    neutrals_e : (light, 4) float64
        Electrons of R, G, B and W from white under D65 and other lights, relative to G: the curves that it is for.
    mean : (256,) float32
        Of all patches; pixels row by row, four channels each.
    basis : (256, direction) float32
        Orthonormal columns.
    weights : (component,) float32
        Sum 1.
    centres : (component, direction) float32
        Means, from `mean` on.
    factors : (component, direction, direction) float32
        Lower triangular; covariance is factor times its transpose.
    rest : (component,) float32
        Variance in each direction outside the basis.
    source : str
        Command, versions, seed and hashes of what it was trained from, as JSON.
    """

    neutrals_e: NDArray[np.float64]
    mean: NDArray[np.float32]
    basis: NDArray[np.float32]
    weights: NDArray[np.float32]
    centres: NDArray[np.float32]
    factors: NDArray[np.float32]
    rest: NDArray[np.float32]
    source: str

    @property
    def neutral_e(self) -> NDArray[np.float64]:
        """Electrons of R, G, B and W from white under D65, relative to G, shape (4,): a signal of 1 in each."""
        return np.asarray(self.neutrals_e[0])


@dataclass(frozen=True, eq=False)
class Mixture:
    """The prior's Gaussians over the pixels of a patch.

    Attributes
    ----------
    size : int
        Pixels a side of the patch.
    log_weights : (component,) float64
    means : (component, size * size * 4) float64
    covariances : (component, size * size * 4, size * size * 4) float32
    """

    size: int
    log_weights: NDArray[np.float64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float32]


@cache
def mixture(prior: Prior, size: int = PATCH) -> Mixture:
    """The prior of the middle `size` pixels of its patches."""
    inside = np.zeros((PATCH, PATCH, 4), dtype=bool)
    edge = (PATCH - size) // 2
    inside[edge : edge + size, edge : edge + size] = True
    kept = inside.ravel()
    basis = prior.basis[kept]
    means = prior.mean[kept] + prior.centres @ basis.T
    spread = basis @ prior.factors
    covariances = spread @ spread.swapaxes(1, 2)
    outside = np.eye(len(basis), dtype=np.float32) - basis @ basis.T
    covariances += prior.rest[:, None, None] * outside
    return Mixture(size, np.log(prior.weights.astype(np.float64)), means.astype(np.float64), covariances)


@cache
def own_prior() -> Prior:
    """The prior of the project's own curves."""
    return load_prior(OWN)


def load_prior(path: Path) -> Prior:
    """Read a prior that `save_prior` wrote.

    Raises
    ------
    InputError
        For a file that isn't one.
    """
    try:
        with path.open("rb") as place, np.load(place, allow_pickle=False) as file:
            held = {name: np.asarray(file[name]) for name in _FIELDS}
            source = str(file["source"])
    except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(f"prior: {str(path)!r} can't be read: {error}; give a file of `rodcone train`") from error
    size = held["mean"].size // 4
    components, directions = held["centres"].shape
    factors = np.zeros((components, directions, directions), np.float32)
    factors[:, *np.tril_indices(directions)] = held["factors"]
    if size != PATCH**2 or held["basis"].shape != (4 * size, directions):
        raise InputError(f"prior: {str(path)!r} is of other patches than {PATCH}x{PATCH}; train one anew")
    single = {name: held[name].astype(np.float32) for name in _FIELDS[1:] if name != "factors"}
    return Prior(neutrals_e=held["neutrals_e"], factors=factors, source=source, **single)


def save_prior(prior: Prior, path: Path) -> None:
    """Write a prior; factors and basis in half precision."""
    lower = prior.factors[:, *np.tril_indices(prior.factors.shape[1])].astype(np.float16)
    held = {name: getattr(prior, name) for name in _FIELDS} | {
        "factors": lower,
        "basis": prior.basis.astype(np.float16),
    }
    with replacing(path) as (place,), place.open("wb") as file:
        np.savez_compressed(file, source=prior.source, allow_pickle=False, **held)
