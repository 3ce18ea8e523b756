"""One cell: exposed, developed, measured; its picture on disk before its row is given back."""

import json
import platform
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.colour import encode_srgb
from isp.processors import PROCESSORS
from render.errors import InputError
from render.files import replacing
from render.jit import backend, dr
from sensor.cfa import channels
from sensor.device import Device, draw_device
from sensor.lanes import read_frame
from sensor.noise import noise_variance
from sensor.optics import falloff
from sensor.random import draw_key
from sensor.raw import RawImage
from sensor.readout import as_raw, read_out
from studies.appearance import TruePicture, appearance, true_picture
from studies.camera import mean_electrons
from studies.cells import Cell, device_stream, exposure_stream
from studies.digests import code_version, digest_bytes
from studies.metrics import measure
from studies.png import to_png
from studies.target_figures import target_figures
from studies.truth import neutral_electrons

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """What the ledger holds of a cell. Times and host alone differ from run to run.

    Attributes
    ----------
    key, code : str
        Of `Cell`.
    scene ... seed
        Of `studies.cells.Coordinates`.
    luminance_cd_m2, illuminance_lux, exposure_s : float
        The level in both units (lux where the scene states a plane), and the time.
    spp, bands : int
        Of the render.
    lens : str
        Terms of the modelled lens, as JSON.
    budget_share : float or None
        Share of the noise variance that a plan predicts for its approximations.
    psnr_db, ssim, delta_e_median, delta_e_p95 : float
        Of `studies.metrics.Quality`.
    s_cielab_median, s_cielab_p95, flip_mean, pu21_psnr_db : float
        Of `studies.appearance.Appearance`.
    mtf50_cy_per_px, chart_delta_e_mean, patch_snr_db : float or None
        Of `studies.target_figures.TargetFigures`.
    mc_share : float
        Monte Carlo variance over the sensor's own, means over the pixels below saturation.
    snr_db : float or None
        Green's, where the processor measures it.
    substitution : int or None
        Whether W stood for luminance.
    saturated : float
        Share of the pixels.
    balance, mean_electrons : str
        By channel, as JSON.
    engine : str
        What developed it.
    picture, truth : str
        Files of the developed and the noise-free picture below the folder of pictures.
    render_s, capture_s, develop_s, measure_s : float
        Of the render that the cell shares with others, and of its own steps.
    finished : str
        UTC.
    host : str
    """

    key: str
    code: str
    scene: str
    spectrum: str
    level: str
    exposure: str
    sensor: str
    processor: str
    seed: int
    luminance_cd_m2: float
    illuminance_lux: float | None
    exposure_s: float
    spp: int
    bands: int
    lens: str
    budget_share: float | None
    psnr_db: float
    ssim: float
    delta_e_median: float
    delta_e_p95: float
    s_cielab_median: float
    s_cielab_p95: float
    flip_mean: float
    pu21_psnr_db: float
    mtf50_cy_per_px: float | None
    chart_delta_e_mean: float | None
    patch_snr_db: float | None
    mc_share: float
    snr_db: float | None
    substitution: int | None
    saturated: float
    balance: str
    mean_electrons: str
    engine: str
    picture: str
    truth: str
    render_s: float
    capture_s: float
    develop_s: float
    measure_s: float
    finished: str
    host: str


TIME_AND_HOST = ("render_s", "capture_s", "develop_s", "measure_s", "finished", "host")


def run_cell(cell: Cell, threads: int | None = None) -> Row:
    """Make the picture of a cell and measure it against the truth.

    Parameters
    ----------
    cell : Cell
    threads : int, optional
        For Dr.Jit in this process; left out, as many as it has.

    Raises
    ------
    InputError
        Where this process has other code than the one that asks, or can't read the arrays by their paths.
    OSError
        Where the picture can't be written.
    """
    _check_code(cell)
    if threads is not None:
        limit_threads(threads)
    truth = _truth(cell.truth)
    expected_e = np.asarray(_array(cell.electrons), dtype=np.float64) * (cell.luminance_cd_m2 * cell.exposure_s)
    processor, mosaic = PROCESSORS[cell.at.processor], PROCESSORS[cell.at.processor].mosaic
    shape = (truth.linear.shape[0], truth.linear.shape[1])
    device = draw_device(cell.sensor, shape, device_stream(cell.at, mosaic))
    start = time.perf_counter()
    raw = _expose(cell, expected_e, device, exposure_stream(cell.at, mosaic))
    exposed = time.perf_counter()
    neutral = neutral_electrons(cell.sensor, cell.light, cell.exposure_s)
    picture = processor.develop(raw, cell.colours, neutral=neutral)
    developed = time.perf_counter()
    linear = _linear(cell, picture.rgb, float(neutral[channels(cell.sensor.cfa).index(processor.unit)]))
    encoded = encode_srgb(linear)
    figures = _figures(cell, linear, encoded, truth)
    measured = time.perf_counter()
    return Row(
        key=cell.key,
        code=cell.code,
        **vars(cell.at),
        luminance_cd_m2=cell.luminance_cd_m2,
        illuminance_lux=cell.illuminance_lux,
        exposure_s=cell.exposure_s,
        spp=cell.spp,
        bands=cell.bands,
        lens=json.dumps(vars(cell.sensor.lens)),
        budget_share=cell.budget_share,
        **figures,
        mc_share=_monte_carlo_share(cell, expected_e),
        snr_db=picture.snr_db,
        substitution=None if picture.substituted is None else int(picture.substituted),
        saturated=float(raw.saturated.mean()),
        balance=json.dumps(dict(picture.balance)),
        mean_electrons=json.dumps(mean_electrons(cell.sensor, expected_e)),
        engine=picture.engine,
        picture=_keep(cell.pictures, to_png(encoded)),
        truth=_keep(cell.pictures, _true_png(cell.truth, cell.truth.stat().st_mtime_ns)),
        render_s=cell.render_s,
        capture_s=exposed - start,
        develop_s=developed - exposed,
        measure_s=measured - developed,
        finished=datetime.now(UTC).isoformat(timespec="milliseconds"),
        host=platform.node(),
    )


def _figures(cell: Cell, linear: Image, encoded: Image, truth: TruePicture) -> dict[str, Any]:
    return {
        **vars(measure(encoded, truth.encoded, truth.lab)),
        **vars(appearance(linear, truth, cell.white_cd_m2)),
        **vars(target_figures(cell.at.scene, linear, truth.linear)),
    }


@cache
def limit_threads(threads: int) -> None:
    """Give Dr.Jit in this process so many threads; on the LLVM backend alone does it matter."""
    if backend() == "llvm":
        dr.set_thread_count(threads)


def _check_code(cell: Cell) -> None:
    if cell.code != code_version():
        raise InputError(
            f"worker on {platform.node()}: its code is {code_version()}, the sweep's is {cell.code}; "
            "allowed: the same; install the same rodcone and start the worker again"
        )


def _linear(cell: Cell, rgb: Image, unit_e: float) -> Image:
    """Linear sRGB, in which white is 1, of a developed picture, in which a neutral of 1 cd/m^2 reads `unit_e`."""
    linear = rgb / (unit_e * cell.white_cd_m2)
    if cell.sensor.lens.horizontal_view_deg:  # a camera corrects the falloff that it knows of its lens
        linear = linear / falloff(cell.sensor.lens, linear.shape[:2])[..., None]
    return linear


def _truth(path: Path) -> TruePicture:
    _array(path)  # tells what can't be read
    return _worked_out(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)  # cells of one scene under one spectrum come one after the other
def _worked_out(path: Path, changed_ns: int) -> TruePicture:
    return true_picture(np.array(_array(path)))


@lru_cache(maxsize=2)
def _true_png(path: Path, changed_ns: int) -> bytes:
    return to_png(_worked_out(path, changed_ns).encoded)


def _array(path: Path) -> Image:
    try:
        return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: can't be read on {platform.node()} ({error}); allowed: a folder that all workers see under the "
            "same path; give one with --out, or run the sweep again where the file is damaged"
        ) from error


def _expose(cell: Cell, expected_e: Image, device: Device, rng: np.random.Generator) -> RawImage:
    if cell.exact or backend() == "numpy":
        return read_out(expected_e, cell.sensor, device, cell.exposure_s, rng)
    single = expected_e.astype(np.float32)
    dn = read_frame(single, cell.sensor, device, cell.exposure_s, draw_key(rng))
    return as_raw(dn, cell.sensor, cell.exposure_s, engine=backend(), hot=device.hot)


def _monte_carlo_share(cell: Cell, expected_e: Image) -> float:
    """As `studies.budget.monte_carlo_share`, from the half difference that the frame keeps."""
    inside = expected_e < cell.sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    error_e = _array(cell.half_difference) * (cell.luminance_cd_m2 * cell.exposure_s)
    own = noise_variance(expected_e, cell.sensor, cell.exposure_s)[inside].mean()
    return float((error_e[inside] ** 2).mean() / own)


def _keep(folder: Path, content: bytes) -> str:
    """Write a picture under the hash of its content; gives its name below the folder."""
    name = digest_bytes(content)
    place = folder / name[:2] / f"{name}.png"
    place.parent.mkdir(parents=True, exist_ok=True)
    with replacing(place) as (part,):
        part.write_bytes(content)
    return f"{name[:2]}/{name}.png"
