"""Expose, develop and measure one cell; save its picture, then return the row."""

import json
import platform
import threading
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

import numpy as np

from isp.colour.encoding import quantise
from isp.processors.own import processor_of
from rodcone.colour_spaces import encode_srgb
from sensor.burst import merged_raw, merged_sensor
from sensor.capture import expose
from sensor.cfa import block_sums, mask
from sensor.device import draw_device
from sensor.flicker.photograph import frame_starts_s
from sensor.flicker.rows import flickering
from sensor.raw import RawImage
from sensor.readings.resolve import resolve
from sensor.response import behind_filters
from sensor.shake import shaken
from studies.metrics.appearance import TruePicture, appearance, picture_quality, true_picture
from studies.metrics.target_figures import target_figures
from studies.metrics.truth import neutral_electrons
from studies.photograph.camera import balance_delta_e, develop_to_scale
from studies.photograph.clock import machine, timed
from studies.photograph.picture_file import to_png
from studies.study.equal_area import area_average
from studies.study.gain import iso_speed
from studies.study.render_noise import monte_carlo_bound
from studies.study.study import AS_SHOT
from studies.sweep.cells import Cell, device_stream, exposure_stream, flicker_stream, shake_stream, stated_columns
from studies.sweep.provenance import require_same, threads
from studies.sweep.row import Row
from studies.sweep.stored import keep, read_array


def run_cell(cell: Cell) -> Row:
    """Make the picture of a cell and measure it against the truth.

    Raises
    ------
    InputError
        If this process has other code, versions or engines than the one that runs the sweep, or can't read the arrays
        by their paths.
    OSError
        Where the picture can't be written.
    """
    processor = processor_of(cell.processor, json.loads(cell.made_by.versions))
    require_same(cell.made_by, cell.processor, processor.on_backend, processor.file_version)
    frame, sensor, engine = cell.frame, cell.frame.sensor, cell.made_by.readout_engine
    stated = stated_columns(cell)
    # Expose. The frame's electrons are those at 1 cd/m^2 and 1 s, which are multiplied by `light`.
    light = cell.luminance_cd_m2 * cell.exposure_s
    electrons, true_linear, errors = (read_array(path) for path in (frame.electrons, frame.truth, frame.errors))
    unmoved_e = np.asarray(electrons, dtype=np.float64) * light
    expected_e = behind_filters(unmoved_e, sensor) if sensor.lens.shake_um else unmoved_e
    # If the truth has a pixel per photodiode, it is binned as the sensor bins. With `sensor_side_um` it already has the
    # pixels of the coarsest sensor.
    bins_truth = sensor.sites > 1 and true_linear.shape[:2] == expected_e.shape
    truth, truth_png = _true_picture(frame.truth, bins_truth)
    pixels_e = sensor.pixel_sums(expected_e)
    errors_e = sensor.pixel_sums(errors) * light
    shape = (expected_e.shape[0], expected_e.shape[1])
    device = draw_device(sensor, shape, device_stream(cell.condition.sensor, processor.mosaic, cell.seed))
    frames = cell.condition.frames

    def burst() -> RawImage:
        stream = exposure_stream(cell.condition, processor.mosaic, cell.seed)
        hand = shake_stream(cell.seed)
        raws = []
        for start_s in frame_starts_s(sensor, shape, cell.exposure_s, flicker_stream(cell.seed), frames):
            frame_e = expected_e
            if cell.flicker is not None:
                frame_e = flickering(expected_e, [(cell.flicker, expected_e)], sensor, cell.exposure_s, start_s)
            if sensor.lens.shake_um:
                frame_e = behind_filters(shaken(unmoved_e, sensor, cell.exposure_s, hand), sensor)
            raws.append(expose(frame_e, sensor, cell.exposure_s, device, stream, exact=engine == "numpy"))
        return merged_raw(raws)

    raw, capture_s, first_capture_s = timed(burst, *("capture", engine, stated["sensor"], shape, frames))
    # Develop to linear sRGB in which white is 1.
    saturated = raw.saturated
    # The neutral of the scene's light, which a raw file would state, sets the picture's scale. If the white balance is
    # as shot, the neutral sets that too.
    neutral = neutral_electrons(sensor, frame.light, raw.exposure_s)
    options = {"balance": neutral} if stated["white_balance"] == AS_SHOT else {}
    (linear, picture), develop_s, first_develop_s = timed(
        lambda: develop_to_scale(raw, processor, cell.fit, sensor, neutral, cell.white_cd_m2, **options),
        *("develop", cell.processor, shape, bool(saturated.any()), bool(saturated.all())),  # these decide the kernels
    )
    if linear.shape != truth.linear.shape:  # sensors of one size are compared in the pixels of the coarsest
        linear = area_average(linear, truth.linear.shape[:2])
    encoded = encode_srgb(linear)
    # Measure.
    figures, measure_s, first_measure_s = timed(
        lambda: {
            **vars(picture_quality(encoded, truth)),
            **vars(appearance(linear, truth, cell.white_cd_m2)),
            **vars(target_figures(stated["scene"], linear, truth.linear)),
        },
        *("measure", stated["scene"], raw.shape),
    )
    kept, kept_truth = (keep(cell.pictures, png, ".png") for png in (to_png(quantise(encoded)), truth_png))
    return Row(
        **stated,
        iso=iso_speed(sensor),
        **figures,
        mc_share=monte_carlo_bound(
            errors_e * frames,
            pixels_e * frames,
            resolve(merged_sensor(sensor, frames), pixels_e * frames, cell.exposure_s * frames),
        ),
        snr_db=picture.snr_db,
        substitution=None if picture.substituted is None else int(picture.substituted),
        saturated=float(saturated.mean()),
        balance_delta_e=(balance_delta_e(raw, cell.fit, sensor, frame.light, **options) if picture.balance else None),
        balance=json.dumps(dict(picture.balance)),
        mean_electrons=json.dumps(
            {name: float(pixels_e[mask(sensor.cfa, name, raw.shape)].mean()) for name in sensor.channels}
        ),
        readout_engine=raw.engine,
        development_engine=picture.engine,
        picture=kept,
        truth=kept_truth,
        capture_s=capture_s,
        develop_s=develop_s,
        measure_s=measure_s,
        first_s=first_capture_s + first_develop_s + first_measure_s,
        threads=threads(),
        finished=datetime.now(UTC).isoformat(timespec="milliseconds"),
        host=platform.node(),
        machine=machine(),
        worker=threading.get_native_id(),
    )


@lru_cache(maxsize=2)  # because cells of one scene and spectrum follow each other
def _true_picture(path: Path, binned: bool) -> tuple[TruePicture, bytes]:
    """Return the true picture, binned by 2x2 pixels if the camera bins, and its PNG."""
    linear = np.array(read_array(path))
    if binned:
        linear = np.moveaxis(block_sums(np.moveaxis(linear, -1, 0)) / 4, 0, -1)
    truth = true_picture(linear)
    return truth, to_png(quantise(truth.encoded))
