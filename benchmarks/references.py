"""Reference pictures of `bench_share.py`: rendered once, kept in files that say what they are.

A file's name holds a hash of all that determines the light: the scene with its own lights, size, bands, depth, seed and
samples. The engine that made it isn't in the hash, as a reference has no error but its noise: the file tells its
version, and a later engine is judged against the same picture.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.cache import ENGINE_VERSION, file_digests
from render.combine import emission
from render.engine import render
from render.radiance import SpectralRadiance
from render.scene import Scene
from render.spectrum import band_widths
from rodcone.digests import digest
from rodcone.errors import InputError
from rodcone.files import replacing

SEEDS = (900_000_001, 900_000_002)  # of the two references; no render that is judged may have them
DEPTH = 8
SLICE = 1024  # samples, after which a render is kept


@dataclass(frozen=True)
class Film:
    """Side of a square picture in pixels, and the number of bands over 380-780 nm."""

    size: int
    bands: int

    @property
    def wavelength_nm(self) -> NDArray[np.float64]:
        """Centres of the bands."""
        return 380.0 + 400.0 / self.bands * (np.arange(self.bands) + 0.5)


@dataclass(frozen=True)
class Reference:
    """A picture under the scene's own lights.

    Attributes
    ----------
    radiance : SpectralRadiance
    deviation : SpectralRadiance
        Monte Carlo standard deviation of each value.
    lamps : (h, w) bool
        Pixels that see a light directly.
    level_cd_m2 : float
        Mean luminance of what is no light.
    facts : dict
        Scene, size, bands, seed, samples drawn, seconds, and the engine's version, integrator and variant.
    """

    radiance: SpectralRadiance
    deviation: SpectralRadiance
    lamps: NDArray[np.bool_]
    level_cd_m2: float
    facts: dict[str, Any]


def make(folder: Path, scene: Scene, film: Film, samples: int) -> None:
    """Render both references, in slices that go on from each other; a file is written when one is complete."""
    for seed in SEEDS:
        present = find(folder, scene, film, seed)
        if present and _samples(present) >= samples:
            print(f"{present} is there")
            continue
        for asked in (*range(SLICE, samples, SLICE), samples):
            made = render(
                scene,
                (film.size, film.size),
                wavelength_nm=film.wavelength_nm,
                spp=asked,
                max_depth=DEPTH,
                seed=seed,
                cache=folder / "renders",
            )
            print(f"{scene.name}, seed {seed}: {made.spp:.0f} of {samples} samples, {made.seconds:.0f} s", flush=True)
            if made.spp < asked:
                raise InputError("references: interrupted; what was drawn is kept; run the same command again")
        level_cd_m2 = made.level().value
        facts = {
            "scene": scene.name,
            "size": film.size,
            "bands": film.bands,
            "seed": seed,
            "samples": round(made.spp),
            "seconds": made.seconds,
            "engine_version": ENGINE_VERSION,
            "integrator": made.integrator,
            "variant": made.variant,
            "level_cd_m2": level_cd_m2,
        }
        path = folder / _name(scene, film, seed, round(made.spp))
        with replacing(path) as (place,), place.open("wb") as file:
            np.savez(
                file,
                radiance=np.moveaxis(made.relight().values, -1, 0),
                variance=made.relight_variance(luminance_cd_m2=level_cd_m2),
                coverage=made.coverage.mean,
                facts=np.array(json.dumps(facts)),
            )
        print(path)


def both(folder: Path, scene: Scene, film: Film) -> tuple[Reference, Reference]:
    """Read the two references of most samples.

    Raises
    ------
    InputError
        Where one is missing; the command that makes it is named.
    """
    found = [find(folder, scene, film, seed) for seed in SEEDS]
    if None in found:
        command = (
            f"references --scene {scene.name} --size {film.size} --reference-bands {film.bands} --references {folder}"
        )
        raise InputError(
            f"references: {folder} lacks a render of {scene.name} with seed {SEEDS[found.index(None)]}; allowed: two, "
            f"of one scene, size and bands; make them: python benchmarks/bench_share.py {command} --samples 16384"
        )
    one, other = (_read(path) for path in found if path)
    return one, other


def find(folder: Path, scene: Scene, film: Film, seed: int) -> Path | None:
    """Return the file of most samples whose name fits; None where there is none."""
    paths = folder.glob(f"{scene.name}_{film.size}_{seed}_*.npz")
    fitting = [path for path in paths if path.name == _name(scene, film, seed, _samples(path))]
    return max(fitting, key=_samples, default=None)


def _read(path: Path) -> Reference:
    with np.load(path) as file:
        arrays = dict(file)
    facts = json.loads(str(arrays["facts"]))
    nm = Film(facts["size"], facts["bands"]).wavelength_nm
    radiance, deviation = (
        SpectralRadiance(np.moveaxis(planes, 0, -1), nm) for planes in (arrays["radiance"], np.sqrt(arrays["variance"]))
    )
    return Reference(radiance, deviation, arrays["coverage"] > 0, facts["level_cd_m2"], facts)


def _name(scene: Scene, film: Film, seed: int, samples: int) -> str:
    width_nm = band_widths(film.wavelength_nm, None)
    lights = [[name, group.emitters, group.coloured] for name, group in scene.groups.items()]
    emitted = emission(scene.groups, film.wavelength_nm, width_nm)
    key = digest(
        [
            *(scene.name, scene.geometry, file_digests(scene.geometry), lights, emitted),
            *(film.size, film.wavelength_nm, width_nm, DEPTH, seed, samples),
        ]
    )
    return f"{scene.name}_{film.size}_{seed}_{samples}_{key[:16]}.npz"


def _samples(path: Path) -> int:
    return int(path.stem.split("_")[-2])
