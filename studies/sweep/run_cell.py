"""One cell: exposed, developed, measured; its picture on disk before its row is given back."""

import json
import platform
import threading
from datetime import UTC, datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import encode_srgb
from rodcone.errors import InputError
from rodcone.jit import backend, dr
from sensor.cfa import channels
from sensor.device import Device, draw_device
from sensor.kernel.kernel import read_frame
from sensor.optics import falloff
from sensor.random import draw_key
from sensor.raw import RawImage
from sensor.readout import as_raw, noise_variance, read_out
from studies.metrics.appearance import TruePicture, appearance, true_picture
from studies.metrics.quality import measure
from studies.metrics.target_figures import target_figures
from studies.metrics.truth import neutral_electrons
from studies.photograph.camera import mean_electrons
from studies.photograph.clock import timed
from studies.photograph.png import to_png
from studies.sweep.cells import Cell, device_stream, exposure_stream
from studies.sweep.provenance import machine, provenance, threads, told
from studies.sweep.row import Row
from studies.sweep.stored import is_whole, keep

Image = NDArray[np.float64]


def run_cell(cell: Cell, most_threads: int | None = None) -> Row:
    """Make the picture of a cell and measure it against the truth.

    Parameters
    ----------
    cell : Cell
    most_threads : int, optional
        For Dr.Jit in this process; left out, as many as it has.

    Raises
    ------
    InputError
        Where this process has other code, versions or engines than the one that asks, or can't read the arrays by
        their paths.
    OSError
        Where the picture can't be written.
    """
    _check_provenance(cell)
    if most_threads is not None:
        limit_threads(most_threads)
    truth = _truth(cell.truth)
    expected_e = np.asarray(_array(cell.electrons), dtype=np.float64) * (cell.luminance_cd_m2 * cell.exposure_s)
    raw, picture, seconds = _photograph(cell, expected_e)
    linear = _linear(cell, picture.rgb)
    encoded = encode_srgb(linear)
    figures, measure_s, first_s = timed(
        lambda: _figures(cell, linear, encoded, truth), "measure", cell.at.scene, raw.shape
    )
    seconds["first_s"] += first_s
    return Row(
        key=cell.key,
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
        variant=cell.made_by.variant,
        readout_engine=raw.engine,
        development_engine=picture.engine,
        versions=cell.made_by.versions,
        picture=keep(cell.pictures, to_png(encoded), ".png"),
        truth=keep(cell.pictures, _true_png(cell.truth, cell.truth.stat().st_mtime_ns), ".png"),
        render_s=cell.render_s,
        measure_s=measure_s,
        **seconds,
        threads=threads(),
        finished=datetime.now(UTC).isoformat(timespec="milliseconds"),
        host=platform.node(),
        machine=machine(),
        worker=threading.get_native_id(),
    )


def _photograph(cell: Cell, expected_e: Image) -> tuple[RawImage, Picture, dict[str, Any]]:
    """Raw image, developed picture, and the seconds of both."""
    at, shape = cell.at, (expected_e.shape[0], expected_e.shape[1])
    processor, engine = PROCESSORS[at.processor], cell.made_by.readout_engine
    device = draw_device(cell.sensor, shape, device_stream(at, processor.mosaic))
    raw, capture_s, first_capture_s = timed(
        lambda: _expose(cell, expected_e, device, exposure_stream(at, processor.mosaic)),
        *("capture", engine, at.sensor, shape),
    )
    neutral, saturated = neutral_electrons(cell.sensor, cell.light, cell.exposure_s), raw.saturated
    picture, develop_s, first_develop_s = timed(
        lambda: processor.develop(raw, cell.colours, neutral=neutral),
        *("develop", at.processor, shape, bool(saturated.any()), bool(saturated.all())),
    )
    first_s = first_capture_s + first_develop_s
    return raw, picture, {"capture_s": capture_s, "develop_s": develop_s, "first_s": first_s}


def _figures(cell: Cell, linear: Image, encoded: Image, truth: TruePicture) -> dict[str, Any]:
    return {
        **vars(measure(encoded, truth.encoded, truth.lab)),
        **vars(appearance(linear, truth, cell.white_cd_m2)),
        **vars(target_figures(cell.at.scene, linear, truth.linear)),
    }


@cache
def limit_threads(most: int) -> None:
    """Give Dr.Jit in this process so many threads; on the LLVM backend alone does it matter."""
    if backend() == "llvm":
        dr.set_thread_count(most)


def _check_provenance(cell: Cell) -> None:
    own = told(provenance(cell.made_by.variant, cell.at.processor, exact=cell.made_by.readout_engine == "numpy"))
    for name, asked in told(cell.made_by).items():
        if own.get(name) != asked:
            raise InputError(
                f"worker on {platform.node()}: its {name} is {own.get(name)}, the sweep's is {asked}; allowed: the "
                "same; install the same rodcone with the same packages and start the worker again"
            )


def _linear(cell: Cell, rgb: Image) -> Image:
    """Linear sRGB, in which white is 1, of a developed picture in the unit of its processor."""
    neutral = neutral_electrons(cell.sensor, cell.light, cell.exposure_s)  # of 1 cd/m^2
    unit_e = float(neutral[channels(cell.sensor.cfa).index(PROCESSORS[cell.at.processor].unit)])
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
    if not is_whole(path):
        raise InputError(
            f"{path}: can't be read on {platform.node()}, or isn't what was written; allowed: a folder that all "
            "workers see under the same path; give one with --out, or run the sweep again where the file is damaged"
        )
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def _expose(cell: Cell, expected_e: Image, device: Device, rng: np.random.Generator) -> RawImage:
    if cell.made_by.readout_engine == "numpy":
        return read_out(expected_e, cell.sensor, device, cell.exposure_s, rng)
    single = expected_e.astype(np.float32)
    dn = read_frame(single, cell.sensor, device, cell.exposure_s, draw_key(rng))
    return as_raw(dn, cell.sensor, cell.exposure_s, engine=backend(), hot=device.hot)


def _monte_carlo_share(cell: Cell, expected_e: Image) -> float:
    """As `studies.budget.budget.monte_carlo_share`, from the half difference that the frame keeps."""
    inside = expected_e < cell.sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    error_e = _array(cell.half_difference) * (cell.luminance_cd_m2 * cell.exposure_s)
    own = noise_variance(expected_e, cell.sensor, cell.exposure_s)[inside].mean()
    return float((error_e[inside] ** 2).mean() / own)
