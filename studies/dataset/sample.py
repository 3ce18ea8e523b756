"""A sample of a data set: a raw frame, or a part of one, with its truth, which is cut from files of its scene."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, lru_cache
from importlib import metadata
from math import log10
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from render.band_weights import transport_weights
from render.cache import file_digests
from render.combine import emission
from render.radiance_files.radiance_source import files_of
from render.spectrum import OBSERVER_NM, observer, tristimulus
from render.surfaces import see_surfaces
from render.transport import Transport
from rodcone.digests import digest, digest_file, digest_inputs
from rodcone.types import Progress
from sensor.cfa import mask
from sensor.device import draw_device
from sensor.raw import RawImage
from sensor.readings.resolve import PlainReading, at_channel, resolve
from sensor.readout import frame_variance, light_variance, read, sources_of
from sensor.response import imaged_electrons
from studies.study.equal_area import area_average, in_pixels
from studies.study.lit_scene import OpenedScene, photographed, under
from studies.study.render_noise import OF_PIXELS, monte_carlo_bound
from studies.study.study import OWN, Condition
from studies.sweep.cells import Cell, device_stream, exposure_stream, labels
from studies.sweep.prepare import PLANES, Job, scene_transport
from studies.sweep.provenance import deciding_modules, versions
from studies.sweep.stored import is_whole, keep_array, keep_facts, read_facts

# Planes of truth that a sample may hold besides its raw frame. Their first axes are row and column; channel, group or
# colour is the last one.
TRUTH = {
    "mosaic_e": "expected photo-electrons of the mosaic",
    "channels_e": "expected photo-electrons behind every filter at every pixel, in the order of `channels`",
    "rgb": "linear sRGB adapted to D65, 1 is white, not clipped",
    "xyz": "CIE XYZ under the scene's own light, Y in cd/m2",
    "depth": "distance along the camera's axis in m, 0 for none",
    "normals": "unit normals: x right, y down, z into the scene",
    "ids": "numbers of object and material in the scene's lists, from 1; 0 for none",
    "shares": "share of each light group in Y, in the order of `groups`",
}

VERSION = metadata.version("rodcone")
Arrays = dict[str, NDArray[Any]]
Facts = Mapping[str, Any]


@dataclass(frozen=True)
class Sample:
    """Sample to make, with all that it is made from. It is sent to a worker by pickle, with paths in place of arrays.

    Attributes
    ----------
    key : str
        Name in the set: letters, digits, ``-`` and ``_``.
    cell : Cell
        The frame. Its processor and white balance don't matter.
    mosaic : str
        Mosaic as in `sensor.presets.vary`.
    scene_hash : str
        Hash of the scene's shapes, which doesn't depend on its light.
    split : str
    files : mapping of str to Path
        For each plane of `TRUTH` in the sample, the file of the whole frame from which it is cut. Electrons are those
        at 1 cd/m^2 and 1 s, XYZ is that at 1 cd/m^2.
    illuminants : mapping of str to any
        Bands [nm], and for each light group its emission in them if the scene has a mean luminance of 1 cd/m^2.
    part : int or None
        Number of the part among those of the frame; each is exposed as a frame of its own. None for a whole frame,
        which is the same as the sweep's, bit for bit.
    window : (int, int, int, int)
        First row and column of the part, its height and width.
    """

    key: str
    cell: Cell
    mosaic: str
    scene_hash: str
    split: str
    files: Mapping[str, Path]
    illuminants: Mapping[str, Any]
    part: int | None
    window: tuple[int, int, int, int]


def make_sample(sample: Sample) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays of a sample by name, the raw frame first, and its facts as values for JSON."""
    cell = sample.cell
    frame = sample.cell.frame
    row, column, height, width = sample.window
    place = np.s_[row : row + height, column : column + width]
    light = cell.luminance_cd_m2 * cell.exposure_s
    expected_e = np.asarray(_opened(frame.electrons)[place], dtype=np.float64) * light
    sensor = frame.sensor
    # The whole frame decides the exposure time of a metered channel, also for its parts.
    readings = resolve(sensor, np.asarray(_opened(frame.electrons) * light), cell.exposure_s)
    stream = exposure_stream(cell.condition, sample.mosaic, cell.seed)
    if sample.part is not None:
        stream = stream.spawn(sample.part + 1)[-1]
    device = draw_device(sensor, (height, width), device_stream(cell.condition.sensor, sample.mosaic, cell.seed))
    raw = read(expected_e, readings, device, stream)
    arrays: Arrays = {"raw": raw.dn}
    scales = {"mosaic_e": light, "channels_e": light, "xyz": cell.luminance_cd_m2}
    for name, path in sample.files.items():
        plane = _opened(path)[place] * scales.get(name, 1)
        arrays[name] = np.ascontiguousarray(plane, dtype=np.uint16 if name == "ids" else np.float32)
    return arrays, _facts(sample, readings, raw, expected_e, _opened(frame.errors)[:, *place] * light)


def _facts(
    sample: Sample,
    readings: Sequence[PlainReading],
    raw: RawImage,
    expected_e: NDArray[np.float64],
    errors_e: NDArray[Any],
) -> dict[str, Any]:
    cell = sample.cell
    sensor = sample.cell.frame.sensor
    variance_e2, light_e2 = frame_variance(expected_e, readings), light_variance(expected_e, readings)
    # The square of one draw is a very noisy estimate of a pixel's variance. It is therefore averaged over 3x3 pixels,
    # as a render's variance is.
    shares = uniform_filter(errors_e[0] * errors_e[-1] / light_e2, 3)
    mean_e = {name: float(expected_e[mask(sensor.cfa, name, raw.shape)].mean()) for name in sensor.channels}
    by_channel = {name: at_channel(readings, name) for name in mean_e}
    return {
        "rodcone": VERSION,
        **{name: getattr(sample, name) for name in ("key", "split", "scene_hash")},
        **frame_labels(cell.condition),
        "mosaic": sample.mosaic,
        "tile": list(sensor.cfa),
        "channels": list(sensor.channels),
        "seed": cell.seed,
        "window": list(sample.window),
        **{name: getattr(cell, name) for name in ("luminance_cd_m2", "exposure_s", "white_cd_m2")},
        **{name: getattr(raw, name) for name in ("black_dn", "white_dn", "gain_e_per_dn")},
        "noise": noise_coefficients(readings, raw.gain_e_per_dn),
        "sources_e": {name: sources_of(value, by_channel[name]) for name, value in mean_e.items()},
        "mean_e": mean_e,
        "dark_above_black_e": {name: x.dark_e - raw.noise_of(name).dark_current_e for name, (x,) in by_channel.items()},
        "gain": sensor.gain,
        "full_well_e": {name: x.full_well_e for name, (x,) in by_channel.items()},
        "snr_db": 10 * log10(max(float((expected_e**2).mean() / variance_e2.mean()), 1e-12)),
        "saturated": float(raw.saturated.mean()),
        "render_noise": {
            "mean": monte_carlo_bound(errors_e, expected_e, readings),
            "of_95_percent": float(np.quantile(shares, OF_PIXELS)),
        },
        "groups": list(sample.illuminants["groups"]),
        "illuminants": dict(sample.illuminants),
        "lens": asdict(sensor.lens),
    }


def frame_labels(condition: Condition) -> dict[str, Any]:
    """Return those names of a condition that decide a single frame: scene, spectrum, level, exposure and sensor.

    The gain is included unless it is the sensor's own; the white balance and the number of frames never are.
    """
    left_out = ("white_balance", "frames", *(["gain"] if condition.gain == OWN else []))
    return {name: value for name, value in labels(condition).items() if name not in left_out}


def noise_coefficients(readings: Sequence[PlainReading], gain_e_per_dn: float) -> dict[str, dict[str, float]]:
    """Return a, b and c of each channel's noise: the variance of a pixel is a x + b + c x^2 [DN^2].

    x is the pixel's mean above black [DN]. The variance of shot noise is a x, that of PRNU c x^2. b is the variance of
    all noise that doesn't depend on light, except the noise of the dark current, which is left out.
    """
    result = {}
    for name in readings[0].sensor.channels:
        law = at_channel(readings, name)[0].law
        dark_e2 = law.dark_e**2 + law.fixed_e**2
        figures = law.shot / gain_e_per_dn, dark_e2 / gain_e_per_dn**2, law.prnu**2
        result[name] = {key: float(value) for key, value in zip("abc", figures, strict=True)}
    return result


@lru_cache(maxsize=64)
def _opened(path: Path) -> NDArray[Any]:
    """Open an array as a memory map, so that only the part that is used is read."""
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def scene_facts(job: Job, opened: OpenedScene, cells: Sequence[Cell], progress: Progress) -> Facts:
    """Return the facts of a scene; if one of its files is missing or damaged, make all of them anew.

    Parameters
    ----------
    cells : sequence of Cell
        Cells of the scene, with their frames.
    progress : callable
        As in `studies.sweep.prepare.scene_transport`.

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
    made = _make_files(job, opened, frames, scene_transport(job, opened, progress)[0])
    keep_facts(folder, key, made)
    return made


@cache
def code_digests() -> list[str]:
    """Return the digests of the modules of `studies` that decide a sample; if they change, a set is made anew."""
    return [digest_file(path) for path in deciding_modules(names=("studies.dataset.shards",))]


def plane_files(job: Job, facts: Facts, cell: Cell, planes: Sequence[str]) -> dict[str, Path]:
    """Return the files from which planes of a cell's frame are cut; a picture file has no planes about surfaces."""
    folder = (job.out / PLANES).resolve()
    paths = {"mosaic_e": cell.frame.electrons, "rgb": cell.frame.truth}
    paths |= {plane: folder / name for plane, name in facts["files"][_frame_key(cell)].items()}
    return {plane: paths[plane] for plane in planes if plane in paths}


def scene_hash(opened: OpenedScene) -> str:
    """Return a hash of a scene's shapes, which depends on neither light nor size; for a picture, one of its files."""
    if opened.scene is None:
        return digest([digest_file(file) for file in files_of(opened.choice.source)])
    return digest_inputs([opened.scene.geometry, file_digests(opened.scene.geometry)])


def _frame_key(cell: Cell) -> str:
    return f"{cell.condition.spectrum} {cell.frame.electrons.stem} {'/'.join(cell.frame.sensor.cfa)}"


def _make_files(job: Job, opened: OpenedScene, frames: Mapping[str, Cell], transport: Transport) -> dict[str, Any]:
    def kept(**planes: NDArray[Any]) -> dict[str, str]:
        return {name: keep_array(job.out / PLANES, plane) for name, plane in planes.items()}

    facts: dict[str, Any] = {"hash": scene_hash(opened), "illuminants": {}, "objects": (), "materials": (), "files": {}}
    surfaces = {}
    samples = job.plan.samples_a_side(opened.choice)
    if opened.scene is not None:
        seen = see_surfaces(opened.scene, opened.size)
        ids = np.stack([seen.object_id, seen.material_id], axis=-1)
        surfaces = kept(depth=seen.depth_m, normals=seen.normal, ids=ids)
        facts |= {"objects": seen.objects, "materials": seen.materials}
    for spectrum in job.study.spectra:
        lit = under(transport, spectrum)
        view = photographed(lit, 1.0)
        of_pixels = in_pixels(view, samples)
        xyz = tristimulus(of_pixels.values, view.wavelength_nm, view.widths_nm, view.light)
        of_light = kept(xyz=xyz.astype(np.float32), shares=group_shares(lit, xyz.shape[:2]).astype(np.float32))
        facts["illuminants"][spectrum] = _illuminants(lit)
        for name, cell in frames.items():
            if cell.condition.spectrum == spectrum:
                electrons = imaged_electrons(view, cell.frame.sensor, 1.0, samples)
                facts["files"][name] = surfaces | of_light | kept(channels_e=electrons.astype(np.float32))
    return facts


def group_shares(lit: Transport, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return the share of each light group in the luminance of each pixel, (h, w, group); 0 in pixels without light.

    `shape` is the number of pixels, (h, w).
    """
    bands = OBSERVER_NM, lit.wavelength_nm, lit.width_nm
    # The eye's weights of the bands follow the spectrum of each group's own lamp, even its lines.
    weights = [x.power * transport_weights(observer, *bands, x.spectrum)[0][1] for x in lit.groups.values()]
    radiance = (lit.denoised or lit).radiance
    planes = area_average(np.einsum("gb,gbhw->hwg", weights, radiance, dtype=np.float64, optimize=True), shape)
    total = planes.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(planes, total, out=np.zeros_like(planes), where=total > 0))


def _illuminants(lit: Transport) -> dict[str, Any]:
    at_1_cd_m2 = emission(lit.groups, lit.wavelength_nm, lit.width_nm) / lit.level().value
    return {
        "wavelength_nm": lit.wavelength_nm.tolist(),
        "width_nm": lit.width_nm.tolist(),
        "groups": dict(zip(lit.groups, at_1_cd_m2.tolist(), strict=True)),
    }
