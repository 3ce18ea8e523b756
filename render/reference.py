"""Reference light: a long render of a scene in one small file, and a test whether a short render agrees with it.

Transport doesn't depend on lamps' powers, level, sensor or exposure, so that it is computed once. The file holds light
in half floats, one plane of its error, and a certificate of how it was made. It is found by scene and film. Whether
the engine still gives that light is tested by a short render; no version is compared.
"""

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import ZipFile, is_zipfile

import numpy as np
import scipy

from render.cache import ENGINE_VERSION, read_arrays, scene_terms, write_arrays
from render.combine import emission
from render.denoised.relight import sums_over_blocks
from render.error_estimates import Halves
from render.geometry import horizontal_view_deg
from render.level import SceneMeans
from render.loader import Film
from render.meter import Meter
from render.runs import Means, fields_of
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.digests import digest_inputs
from rodcone.errors import InputError
from rodcone.jit import backend
from rodcone.types import Planes

SHIPPED = Path(__file__).parent / "data" / "references"
FOLDER = "RODCONE_REFERENCES"  # environment variable that names the folder of a user's own references
BLOCK = 16  # side of a block [pixels] over which errors are pooled: 256 differences give a variance within 9 %
FALSE_ALARM = 1e-3  # largest chance that a render which agrees with the reference fails the test
MOST_PACKED = 32  # largest allowed ratio of a file's unpacked to its packed size; light in half floats has 2 or 3
_MULTIPLES = (1, 2, 3, 4, 8)  # a reference's sides may be so many times the film's; it is then averaged
_LARGEST_HALF = np.float32(6e4)  # a little below the largest half float, 65504
_LEVELS = ("radiance", "uncovered", "covariance")


@dataclass(frozen=True)
class Reference:
    """Light of a long render, and its certificate: samples, test between its halves, command, versions and so on."""

    path: Path
    transport: Transport
    certificate: Mapping[str, Any]


@dataclass(frozen=True)
class Agreement:
    """Chi-square of two renders' difference over blocks, in the band where it is least likely.

    Attributes
    ----------
    wavelength_nm : float
    chi_square : float
    blocks : int
        Degrees of freedom.
    chance : float
        Chance that agreeing renders differ by as much or more in one band, times the number of bands.
    """

    wavelength_nm: float
    chi_square: float
    blocks: int
    chance: float


def reference_folders() -> Iterator[Path]:
    """Yield the folders of references: the user's own, then the one that comes with the program."""
    yield Path(os.environ.get(FOLDER) or Path.home() / ".local" / "share" / "rodcone" / "references")
    yield SHIPPED


def reference_path(folder: Path, scene: Scene, film: Film) -> Path:
    """Return the path of a scene and film's reference in a folder."""
    key = digest_inputs(scene_terms(scene, film))[:12]
    return folder / f"{Path(scene.name).stem}-{film.size[0]}x{film.size[1]}x{film.wavelength_nm.size}-{key}.npz"


def find_reference(scene: Scene, film: Film) -> Reference | None:
    """Find the reference of a scene and film, the user's own first; return None if there is no intact one."""
    paths = (reference_path(folder, scene, film) for folder in reference_folders())
    return next(filter(None, (read_reference(path, scene) for path in paths)), None)


def read_reference(path: Path, scene: Scene) -> Reference | None:
    """Read a scene's reference from a file; return None if it is missing or damaged."""
    arrays = read_arrays(path)
    return None if arrays is None else _unpacked(path, arrays, scene.groups, scene.geometry["sensor"])


def ready_light(scene: Scene, film: Film) -> Reference | None:
    """Find the reference of a scene and film, or a larger one (`_MULTIPLES`), which is averaged to the film's size.

    Return None if there is neither. The result has a meter of the scene's illuminance if the scene has a reference
    plane and a backend can trace. The irradiance is traced when it is first asked for.
    """
    height, width = film.size
    for times in _MULTIPLES:
        larger = replace(film, size=(height * times, width * times))
        for folder in reference_folders():
            path = reference_path(folder, scene, larger)
            if (arrays := read_arrays(path)) is None:
                continue
            found = _unpacked(path, averaged(arrays, times), scene.groups, scene.geometry["sensor"])
            meter = Meter(scene, film, 0, None) if scene.reference_plane and backend() != "numpy" else None
            return replace(found, transport=replace(found.transport, meter=meter))
    return None


def averaged(arrays: Mapping[str, Any], times: int) -> dict[str, Any]:
    """Average the arrays of a reference's file over blocks of `times` x `times` pixels, and add up their samples."""

    def blocks(planes: Any) -> Any:
        *rest, height, width = planes.shape
        return planes.reshape(*rest, height // times, times, width // times, times)

    if times == 1:
        return dict(arrays)
    light = (arrays["light"] * arrays["scale"]).astype(np.float32)
    mean = blocks(light).mean(axis=(-3, -1), dtype=np.float32)
    # The error plane is relative to the light of all bands, so that this light weighs it within a block.
    total = light.sum(axis=1)
    weights = np.maximum(mean.sum(axis=1) * times**2, np.float32(1e-30))
    return {
        **arrays,
        "light": mean,
        "scale": np.float32(1.0),
        "error": blocks(arrays["error"] * total).sum(axis=(-3, -1)) / weights,
        "rates": blocks(arrays["rates"]).sum(axis=(-3, -1), dtype=np.uint32),
        **{name: blocks(arrays[name]).mean(axis=(-3, -1)) for name in arrays if name.startswith(("coverage", "seen_"))},
    }


def open_reference(path: str | Path) -> Reference:
    """Open the reference in a file without knowing its scene, because the file states its lights itself.

    Raises
    ------
    InputError
        For a file that isn't there or isn't what `rodcone reference` wrote.
    """
    file = Path(path)
    arrays = read_arrays(file) if file.is_file() and is_zipfile(file) and _unpacks(file) else None
    if arrays is None or "groups" not in (certificate := json.loads(str(arrays.get("certificate", "{}")))):
        raise InputError(f"{path}: there is no intact reference light; allowed: a file of rodcone reference; make it")
    groups = {
        name: LightGroup(**group | {"emitters": tuple(group["emitters"]), "spectrum": Spectrum(*group["spectrum"])})
        for name, group in certificate["groups"].items()
    }
    return _unpacked(file, arrays, groups)


def _unpacks(file: Path) -> bool:
    """Return whether a file, by its list of contents, unpacks to at most `MOST_PACKED` times its size."""
    with ZipFile(file) as packed:
        return sum(part.file_size for part in packed.infolist()) <= MOST_PACKED * file.stat().st_size


def save_reference(path: Path, transport: Transport, certificate: Mapping[str, Any]) -> None:
    """Write a reference; its error includes the rounding to half floats."""
    stored, scale = _half(transport.light.mean)
    rounding = stored * scale - transport.light.mean
    arrays = {
        "light": stored,
        "scale": scale,
        "error": _error_plane(transport.light, transport.light.difference + rounding),
        "rates": transport.counts // transport.counts.min(),
        "points": transport.counts.min() // 2,
        "coverage": np.stack([transport.coverage.mean, transport.coverage.difference]),
        "shared": np.array(transport.shared.groups if transport.shared else (), np.int64),
        **{f"mean_{name}": getattr(transport.scene_means, name) for name in _LEVELS},
        **{f"seen_{group}": np.stack([seen.mean, seen.difference]) for group, seen in enumerate(transport.seen)},
    }
    made_by = {name: getattr(transport, name) for name in ("seconds", "integrator", "variant")}
    groups = {
        name: vars(group) | {"spectrum": [group.spectrum.wavelength_nm.tolist(), group.spectrum.values.tolist()]}
        for name, group in transport.groups.items()
    }
    bands = {"wavelength_nm": transport.wavelength_nm.tolist(), "width_nm": transport.width_nm.tolist()}
    facts = {**made_by, "engine": ENGINE_VERSION, "groups": groups, **bands, **certificate}
    write_arrays(path, arrays | {"certificate": np.array(json.dumps(facts))}, packed=True)


def _half(planes: Planes) -> tuple[Any, Planes]:
    """Return planes as half floats, and the factors (group, band, 1, 1) that turn them back into light.

    A plane's largest value is stored as `_LARGEST_HALF`. Light of 1e-9 of it still has 11 bits. That is enough, because
    a visible lamp is a million times brighter than what it lights.
    """
    largest = planes.max(axis=(2, 3), keepdims=True)
    scale = np.where(largest > 0, largest / _LARGEST_HALF, np.float32(1))
    return (planes / scale).astype(np.float16), scale


def _error_plane(light: Halves, error: Planes) -> Planes:
    """Sum errors over bands, which share their paths, to each group's relative error: (group, h, w) float32.

    In the sum some of the bands' errors cancel. The plane is scaled up so that the bands' variance over the picture is
    right.
    """
    total = light.mean.sum(axis=1)
    plane = np.divide(error.sum(axis=1), total, out=np.zeros_like(total), where=total > 0)
    spread = (plane[:, None] * light.mean).astype(np.float64)
    lost = (error.astype(np.float64) ** 2).sum(axis=(1, 2, 3)) / np.maximum((spread**2).sum(axis=(1, 2, 3)), 1e-300)
    return np.asarray(plane * np.sqrt(np.maximum(lost, 1.0))[:, None, None], np.float32)


def _unpacked(
    path: Path, arrays: Mapping[str, Any], groups: Mapping[str, LightGroup], camera: Node | None = None
) -> Reference:
    """Rebuild a reference from a file's arrays; the error plane serves as the difference of a render's halves."""
    certificate = json.loads(str(arrays["certificate"]))
    wavelength_nm, width_nm = (np.array(certificate[name]) for name in ("wavelength_nm", "width_nm"))
    light = arrays["light"] * arrays["scale"]
    rates = arrays["rates"]
    means = Means(
        count=int(arrays["points"]),
        rates=rates,
        light=Halves(light, arrays["error"][:, None] * light),
        seen=[Halves(*arrays[f"seen_{group}"]) for group in range(len(groups))],
        coverage=Halves(*arrays["coverage"]),
        shared=tuple(arrays["shared"].tolist()) or None,
    )
    transport = Transport(
        **fields_of(emission(groups, wavelength_nm, width_nm), means),
        scene_means=SceneMeans(**{name: arrays[f"mean_{name}"] for name in _LEVELS}),
        groups=dict(groups),
        wavelength_nm=wavelength_nm,
        width_nm=width_nm,
        counts=2 * means.count * rates,
        stopped_by="samples",
        seconds=certificate["seconds"],
        integrator=f"reference light: {certificate['integrator']}",
        variant=certificate["variant"],
        horizontal_view_deg=None if camera is None else horizontal_view_deg(camera, rates.shape) or None,
    )
    return Reference(path, transport, certificate)


def agreement(live: Transport, reference: Transport) -> Agreement:
    """Compare a short render with a reference of other paths, band by band, by chi-square over blocks of pixels.

    A block's variance is the sum of its squared half differences. If a short render has not yet met a rare path that
    brings part of the light, its halves don't show that variance. The reference's variance, scaled to as many samples,
    does. The larger of the two counts, so that the rate of false alarms is at most `FALSE_ALARM`.
    """
    ratio = (reference.counts / live.counts).astype(np.float32)
    sums = partial(sums_over_blocks, side=BLOCK)
    tests: list[Agreement] = []
    count = live.light.mean.shape[0] * live.light.mean.shape[1]
    for group, band in np.ndindex(live.light.mean.shape[:2]):
        planes = [x.light[group][band] for x in (live, reference)]
        gap = sums(planes[0].mean.astype(np.float64) - planes[1].mean)
        short, long = (np.square(x.difference.astype(np.float64)) for x in planes)
        variance = np.maximum(sums(short), sums(long * ratio)) + sums(long)
        lit = variance > 0
        chi_square = float((gap[lit] ** 2 / variance[lit]).sum())
        blocks = int(lit.sum())
        chance = min(1.0, count * float(scipy.special.gammaincc(blocks / 2, chi_square / 2))) if blocks else 1.0
        tests.append(Agreement(float(live.wavelength_nm[band]), chi_square, blocks, chance))
    return min(tests, key=lambda test: test.chance)


def require_agreement(live: Transport, reference: Reference) -> str:
    """Return a sentence that says how well a render of this machine agrees with a reference.

    Raises
    ------
    InputError
        If it disagrees, because the engine, its libraries or the file have changed.
    """
    test = agreement(live, reference.transport)
    words = (
        f"chi-square {test.chi_square:.0f} over {test.blocks} blocks at {test.wavelength_nm:g} nm, "
        f"false alarms at most 1 in {1 / FALSE_ALARM:.0f}"
    )
    if test.chance < FALSE_ALARM:
        raise InputError(
            f"light: this machine's render of {live.spp:.0f} samples disagrees with {reference.path.name} ({words}); "
            "report this line with what rodcone doctor prints; rodcone demo --render goes on without the file"
        )
    return (
        f"light: the reference {reference.path.name}, {reference.transport.spp:.0f} samples a pixel; a render of "
        f"{live.spp:.0f} made here agrees with it within its noise ({words})"
    )


def halves_agree(transport: Transport) -> Agreement:
    """Compare a render's halves by chi-square, which tests whether errors of neighbouring pixels are independent."""
    # A half's error is sqrt(2) times that of the mean, which the halves' difference estimates.
    light = transport.light
    root = np.float32(np.sqrt(2))
    even, odd = (
        replace(transport, light=Halves(light.mean + sign * light.difference, root * light.difference))
        for sign in (1, -1)
    )
    return agreement(even, odd)
