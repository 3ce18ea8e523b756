"""The prior over patches: a mixture of Gaussians, the file that holds it, and the Gaussians in a patch's own pixels.

A patch is 8x8 pixels of R, G, B and W. Its values are square roots of signals over the patch's mean W, so that one
prior serves at every level of light. A signal is a channel's electrons over those that white gives in this channel.
White depends on the camera's curves and on the lamp, but not on noise, full well, exposure and mosaic.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, read_errors
from rodcone.files import replacing

PATCH = 8  # side of a patch [pixels]
LETTERS = ("R", "G", "B", "W")
OWN = Path(__file__).with_name("prior.npz")  # prior of the project's own curves, `sensor.curves.rgbw`
MOST_BYTES = 1 << 26  # largest size of a file's arrays, checked before they are read; the project's own have 0.7 MB
MOST_COMPONENTS = 4096
_FIELDS = ("neutrals_e", "mean", "basis", "weights", "centres", "factors", "rest")


@dataclass(frozen=True, eq=False)
class Prior:
    """A mixture of Gaussians over patches, in a basis of the patches' principal directions.

    Attributes
    ----------
    neutrals_e : (light, 4) float64
        Electrons of R, G, B and W from white under D65 and other lights, relative to G, with the curves that the prior
        is for.
    mean : (256,) float32
        Mean of all patches: pixels row by row, four channels per pixel.
    basis : (256, direction) float32
        Orthonormal columns.
    weights : (component,) float32
        Probability of each component.
    centres : (component, direction) float32
        Means of the components minus `mean`, in the basis.
    factors : (component, direction, direction) float32
        Lower triangular matrices; the covariance in the basis is a factor times its transpose.
    rest : (component,) float32
        Variance in each direction outside the basis.
    source : str
        Command, versions, seed and hashes of the training data, as JSON.
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
        """Return the electrons of R, G, B and W from white under D65, relative to G: a signal of 1, shape (4,)."""
        return np.asarray(self.neutrals_e[0])


@dataclass(frozen=True, eq=False)
class Mixture:
    """The prior's Gaussians over the pixels of a patch.

    Attributes
    ----------
    size : int
        Side of the patch [pixels].
    log_weights : (component,) float64
    means : (component, size * size * 4) float64
    covariances : (component, size * size * 4, size * size * 4) float32
    lines : int
        How many of the components, the last ones, are fine lines (`isp.ple.fine_lines`) and were not trained.
    """

    size: int
    log_weights: NDArray[np.float64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float32]
    lines: int = 0


@cache
def mixture(prior: Prior, size: int = PATCH) -> Mixture:
    """Return the Gaussians over the middle `size` x `size` pixels of the prior's patches."""
    inside = np.zeros((PATCH, PATCH, 4), dtype=bool)
    edge = (PATCH - size) // 2
    inside[edge : edge + size, edge : edge + size] = True
    middle = inside.ravel()
    basis = prior.basis[middle]
    means = prior.mean[middle] + prior.centres @ basis.T
    spread = basis @ prior.factors
    covariances = spread @ spread.swapaxes(1, 2)
    outside = np.eye(len(basis), dtype=np.float32) - basis @ basis.T
    covariances += prior.rest[:, None, None] * outside
    return Mixture(size, np.log(prior.weights.astype(np.float64)), means.astype(np.float64), covariances)


@cache
def own_prior() -> Prior:
    """Return the prior of the project's own curves."""
    return load_prior(OWN)


def load_prior(path: Path) -> Prior:
    """Read a prior that `save_prior` wrote.

    Raises
    ------
    InputError
        For a file that isn't a prior or holds over 64 MiB, arrays of other shapes, more than 4096 components, values
        that aren't finite, or neutrals, weights or variances that aren't above 0.
    """
    # NumPy parses headers as Python's literals, which fail in many ways
    with read_errors(f"prior: {str(path)!r} can't be read", "give a file of `rodcone train`", Exception):
        if not path.is_file():
            raise ValueError("it is a folder or a device, or isn't there")
        with ZipFile(path) as archive:
            needed = sum(entry.file_size for entry in archive.infolist())
        if needed > MOST_BYTES:
            raise ValueError(f"its arrays take {needed} bytes; allowed: {MOST_BYTES}")
        with path.open("rb") as place, np.load(place, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name]) for name in _FIELDS}
            source = str(file["source"])
        if not all(np.issubdtype(array.dtype, np.floating) and np.all(np.isfinite(array)) for array in arrays.values()):
            raise ValueError("it holds values that are no finite numbers")
        if not all(np.all(arrays[name] > 0) for name in ("neutrals_e", "weights", "rest")):
            raise ValueError("it holds a neutral, a weight or a variance that isn't above 0")
    rows = 4 * PATCH**2
    components, directions = (*arrays["centres"].shape, 0, 0)[:2]
    lower = directions * (directions + 1) // 2
    shapes = {
        "neutrals_e": (*arrays["neutrals_e"].shape[:1], 4),
        "mean": (rows,),
        "basis": (rows, directions),
        "weights": (components,),
        "centres": (components, directions),
        "factors": (components, lower),
        "rest": (components,),
    }
    wrong = [name for name, shape in shapes.items() if arrays[name].shape != shape]
    if wrong or directions > rows or not 0 < components <= MOST_COMPONENTS:
        raise InputError(
            f"prior: {str(path)!r} holds {', '.join(wrong) or 'Gaussians'} of other patches than {PATCH}x{PATCH}; "
            "train one anew"
        )
    factors = np.zeros((components, directions, directions), np.float32)
    factors[:, *np.tril_indices(directions)] = arrays["factors"]
    single: dict[str, Any] = {name: arrays[name].astype(np.float32) for name in _FIELDS[1:] if name != "factors"}
    return Prior(neutrals_e=arrays["neutrals_e"], factors=factors, source=source, **single)


def save_prior(prior: Prior, path: Path) -> None:
    """Write a prior, with factors and basis in half precision."""
    lower = prior.factors[:, *np.tril_indices(prior.factors.shape[1])].astype(np.float16)
    arrays = {name: getattr(prior, name) for name in _FIELDS} | {
        "factors": lower,
        "basis": prior.basis.astype(np.float16),
    }
    with replacing(path) as (place,), place.open("wb") as file:
        np.savez_compressed(file, source=prior.source, allow_pickle=False, **arrays)
