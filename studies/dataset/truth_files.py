"""Files of a scene's truth that its samples are cut from: light, surfaces, and electrons behind every filter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.cache import file_digests
from render.combine import emission
from render.photometry import luminance, tristimulus
from render.radiance_files.radiance_source import files_of
from render.surfaces import see_surfaces
from render.transport import Transport
from rodcone.digests import digest, digest_file, digest_inputs
from rodcone.types import Floats
from sensor.optics import form_image
from sensor.response import channel_electrons
from studies.dataset.shards import code_digests
from studies.study.lit_scene import OpenedScene, photographed, under
from studies.sweep.cells import Cell
from studies.sweep.prepare import PLANES, Job, Progress, scene_transport
from studies.sweep.provenance import versions
from studies.sweep.stored import is_whole, keep_array, keep_facts, read_facts

Facts = Mapping[str, Any]


def scene_facts(job: Job, opened: OpenedScene, cells: Sequence[Cell], progress: Progress) -> Facts:
    """Facts of a scene; its files are made where one is missing or damaged.

    Parameters
    ----------
    cells : sequence of Cell
        Of the scene, with their frames.
    progress : callable
        As of `studies.sweep.prepare.scene_transport`.

    Returns
    -------
    dict
        The scene's `hash`, names of its `objects` and `materials`, `illuminants` by spectrum, and the names of its
        `files` by frame and plane.
    """
    folder = job.out / PLANES
    frames = {_frame_key(cell): cell for cell in cells}
    terms = [cells[0].render.content, opened.identity, job.study.spectra, sorted(frames), versions(), code_digests()]
    key = digest_inputs(terms)
    facts = read_facts(folder, key)
    if facts and all(is_whole(folder / name) for names in facts["files"].values() for name in names.values()):
        return facts
    made = _made(job, opened, frames, scene_transport(job, opened, progress)[0])
    keep_facts(folder, key, made)
    return made


def plane_files(job: Job, facts: Facts, cell: Cell, planes: Sequence[str]) -> dict[str, Path]:
    """Files that planes of a cell's frame are cut from; a picture file has none of surfaces."""
    folder = (job.out / PLANES).resolve()
    names = facts["files"][_frame_key(cell)]
    paths = {"mosaic_e": cell.electrons, "rgb": cell.truth, **{plane: folder / name for plane, name in names.items()}}
    return {plane: paths[plane] for plane in planes if plane in paths}


def scene_hash(opened: OpenedScene) -> str:
    """Hash of a scene's shapes, whatever lights them and in whatever size; of a picture that of its file."""
    if opened.scene is None:
        return digest([digest_file(file) for file in files_of(opened.choice.source)])
    return digest_inputs([opened.scene.geometry, file_digests(opened.scene.geometry)])


def _frame_key(cell: Cell) -> str:
    return f"{cell.condition.spectrum} {cell.electrons.stem} {'/'.join(cell.sensor.cfa)}"


def _made(job: Job, opened: OpenedScene, frames: Mapping[str, Cell], transport: Transport) -> dict[str, Any]:
    def kept(**planes: NDArray[Any]) -> dict[str, str]:
        return {name: keep_array(job.out / PLANES, plane) for name, plane in planes.items()}

    facts: dict[str, Any] = {"hash": scene_hash(opened), "illuminants": {}, "objects": (), "materials": (), "files": {}}
    surfaces = {}
    if opened.scene is not None:
        seen = see_surfaces(opened.scene, opened.size)
        ids = np.stack([seen.object_id, seen.material_id], axis=-1)
        surfaces = kept(depth=seen.depth_m, normals=seen.normal, ids=ids)
        facts |= {"objects": seen.objects, "materials": seen.materials}
    for spectrum in job.study.spectra:
        lit = under(transport, spectrum)
        view = photographed(lit, 1.0)
        xyz = tristimulus(view.values, view.wavelength_nm, view.widths_nm)
        of_light = kept(xyz=xyz.astype(np.float32), shares=group_shares(lit).astype(np.float32))
        facts["illuminants"][spectrum] = _illuminants(lit)
        for name, cell in frames.items():
            if cell.condition.spectrum == spectrum:
                electrons = channel_electrons(form_image(view, cell.sensor), cell.sensor, 1.0)
                facts["files"][name] = surfaces | of_light | kept(channels_e=electrons.astype(np.float32))
    return facts


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
