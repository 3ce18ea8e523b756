"""Files of a scene's truth that its samples are cut from: light, surfaces, and electrons behind every filter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from render.cache import file_digests
from render.combine import emission
from render.photometry import luminance, tristimulus
from render.radiance import SpectralRadiance
from render.radiance_files.radiance_source import files_of
from render.surfaces import see_surfaces
from render.transport import Transport
from rodcone.digests import digest, digest_file, digest_inputs
from rodcone.types import Floats
from sensor.optics import form_image
from sensor.response import channel_electrons
from studies.dataset.sample import TruthFiles
from studies.study.lit_scene import OpenedScene, photographed, under
from studies.sweep.cells import Cell
from studies.sweep.prepare import PLANES, Job, Progress, scene_transport
from studies.sweep.provenance import versions
from studies.sweep.stored import is_whole, keep_array, keep_facts, read_facts

Facts = Mapping[str, Any]


def scene_facts(job: Job, opened: OpenedScene, cells: Sequence[Cell], progress: Progress) -> Facts:
    """Names of the files of a scene, of its objects and materials; made where one is missing or damaged.

    Parameters
    ----------
    cells : sequence of Cell
        Of the scene, with their frames.
    progress : callable
        As of `studies.sweep.prepare.scene_transport`.
    """
    folder = job.out / PLANES
    frames = {_frame_name(cell): cell for cell in cells}
    terms = [cells[0].render.content, opened.identity, job.study.spectra, sorted(frames), versions(), code_digests()]
    key = digest_inputs(terms)
    facts = read_facts(folder, key)
    if facts is None or not all(is_whole(folder / name) for name in facts["files"].values()):
        folder.mkdir(parents=True, exist_ok=True)
        facts = _made(job, opened, frames, scene_transport(job, opened, progress)[0])
        keep_facts(folder, key, facts)
    return facts


def truth_of(job: Job, facts: Facts, cell: Cell) -> TruthFiles:
    """Files that samples of a cell's frame are cut from."""
    folder, files, spectrum = (job.out / PLANES).resolve(), facts["files"], cell.condition.spectrum
    return TruthFiles(
        channels=folder / files[f"channels of {_frame_name(cell)}"],
        lit=folder / files[f"light of {spectrum}"],
        surfaces=folder / files["surfaces"] if "surfaces" in files else None,
        illuminants=facts["illuminants"][spectrum],
    )


def scene_hash(opened: OpenedScene) -> str:
    """Hash of a scene's shapes, whatever lights them and in whatever size; of a picture that of its file."""
    if opened.scene is None:
        return digest([digest_file(file) for file in files_of(opened.choice.source)])
    return digest_inputs([opened.scene.geometry, file_digests(opened.scene.geometry)])


def _frame_name(cell: Cell) -> str:
    return f"{cell.electrons.stem} {'/'.join(cell.sensor.cfa)}"


def code_digests() -> list[str]:
    """Digests of the modules of this package that decide a sample's bytes: with other code a set is made anew."""
    return [digest_file(Path(__file__).with_name(f"{name}.py")) for name in ("sample", "shards", "truth_files")]


def _made(job: Job, opened: OpenedScene, frames: Mapping[str, Cell], transport: Transport) -> dict[str, Any]:
    folder, files, illuminants = job.out / PLANES, dict[str, str](), dict[str, Any]()
    objects: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    if opened.scene is not None:
        seen = see_surfaces(opened.scene, opened.size)
        ids = np.stack([seen.object_id, seen.material_id], axis=-1).astype(np.float32)
        planes = np.concatenate([seen.depth_m[..., None], seen.normal, ids], axis=-1)
        files["surfaces"], objects, materials = keep_array(folder, planes), seen.objects, seen.materials
    for spectrum in job.study.spectra:
        lit = under(transport, spectrum)
        view = photographed(lit, 1.0)
        xyz = tristimulus(view.values, view.wavelength_nm, view.widths_nm)
        planes = np.concatenate([xyz, group_shares(lit)], axis=-1).astype(np.float32)
        files[f"light of {spectrum}"] = keep_array(folder, planes)
        illuminants[spectrum] = _illuminants(lit)
        for name, cell in frames.items():
            if cell.condition.spectrum == spectrum:
                files[f"channels of {name}"] = keep_array(folder, _channels(view, cell))
    return {"files": files, "illuminants": illuminants, "objects": objects, "materials": materials}


def _channels(view: SpectralRadiance, cell: Cell) -> Any:
    return channel_electrons(form_image(view, cell.sensor), cell.sensor, 1.0).astype(np.float32)


def group_shares(lit: Transport) -> Floats:
    """Share of each light group in the luminance of each pixel, (h, w, group); 0 in pixels without light."""
    weights = emission(lit.groups, lit.wavelength_nm, lit.width_nm)
    weights = weights * luminance(np.eye(lit.wavelength_nm.size), lit.wavelength_nm, lit.width_nm)
    planes = np.einsum("gb,gbhw->hwg", weights, (lit.denoised or lit).radiance, dtype=np.float64, optimize=True)
    total = planes.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(planes, total, out=np.zeros_like(planes), where=total > 0))


def _illuminants(lit: Transport) -> dict[str, Any]:
    at_1_cd_m2 = emission(lit.groups, lit.wavelength_nm, lit.width_nm) / lit.level().value
    return {
        "wavelength_nm": lit.wavelength_nm.tolist(),
        "width_nm": lit.width_nm.tolist(),
        "groups": dict(zip(lit.groups, at_1_cd_m2.tolist(), strict=True)),
    }
