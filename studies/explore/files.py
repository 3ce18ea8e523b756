"""A shot as a file: its raw negative."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from render.illuminants import illuminant
from rodcone.errors import InputError
from sensor.raw_files.raw_file import write_raw
from studies.explore.chain import Exposed
from studies.explore.controls import Controls
from studies.photograph.calibrate import calibrate, iso_speed


def dng_of(exposed: Exposed, controls: Controls) -> bytes:
    """Digital negative of an exposure, its colours calibrated as `rodcone capture` does.

    Raises
    ------
    InputError
        For a burst, whose merged samples are no whole numbers as a negative's are, or a mosaic that DNG doesn't hold.
    """
    if controls.frames > 1:
        raise InputError("dng: a merged burst is no raw file; allowed: 1 frame; save the exposures one by one")
    first = next(iter(exposed.transport.groups.values()))
    light = illuminant(controls.reference_light) if first.coloured else first.spectrum
    raw = replace(
        exposed.raw,
        camera=Path(controls.sensor).stem.encode("ascii", "replace").decode(),
        f_number=exposed.sensor.lens.f_number,
        iso=iso_speed(exposed.sensor),
        colour=calibrate(exposed.sensor, light),
    )
    with TemporaryDirectory() as folder:
        (path,) = write_raw(raw, Path(folder) / "explored.dng")
        return path.read_bytes()
