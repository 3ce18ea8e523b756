"""Answers for one camera: figures, text and files."""

import sys
from collections.abc import Mapping, MutableMapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from render.illuminants import illuminant
from rodcone.errors import InputError
from sensor.raw_files.raw_file import write_raw
from studies.explore.chain import expose_scene
from studies.explore.controls import Controls, Lamp
from studies.explore.dropped import write_dropped
from studies.explore.memo import Memo
from studies.explore.messages import Header, sensor_terms
from studies.explore.render_noise import noise_note, noise_share
from studies.explore.source import Rendered, Source
from studies.explore.views import histogram, pixel
from studies.explore.written import python_of, study_of
from studies.photograph.calibrate import calibrate, iso_speed

Answer: TypeAlias = tuple[Header, Sequence[bytes]]
Dropped: TypeAlias = Mapping[str, TemporaryDirectory[str]]  # folders of the sensors that were dropped, by their file


def written(
    message: Header, controls: Controls, rendered: Rendered, source: Source, memo: Memo, dropped: Dropped
) -> Answer:
    """Figures and files of one camera."""
    kind = message["kind"]
    if kind == "study":
        return {"files": _study(controls, rendered, source, dropped)}, ()
    if kind == "dng":
        return {"name": "explored.dng"}, (_dng(rendered, controls, memo),)
    exposed = expose_scene(rendered.transport, controls, memo)
    if kind == "histogram":
        note = noise_note(noise_share(exposed, controls, memo), rendered.transport.spp) if rendered.last else ""
        if note and memo.kept("noise note", "") is None:
            memo.keep("noise note", "", note)
            print(note, file=sys.stderr)  # once for each render
        python = python_text(rendered, controls, kind, dropped)
        return {"histogram": histogram(exposed.raw), "python": python, "noise_note": note}, ()
    row, column = message["row"], message["column"]
    found = pixel(exposed, row, column)
    return {"pixel": found, "python": python_text(rendered, controls, f"pixel {row} {column}", dropped)}, ()


def python_text(rendered: Rendered, controls: Controls, view: str, dropped: Dropped) -> str:
    """Python of a view or a figure; a file that was dropped has its name alone, as it lies where that runs."""
    text = python_of(rendered.code, controls, view)
    return text.replace(controls.sensor, Path(controls.sensor).name) if controls.sensor in dropped else text


def take_sensor(files: Any, dropped: MutableMapping[str, TemporaryDirectory[str]]) -> Header:
    """Keep a sensor that was dropped; what the page's sliders begin with."""
    folder = TemporaryDirectory(prefix="rodcone-")
    try:
        path, sensor = write_dropped(files, folder)
    except InputError:
        folder.cleanup()
        raise
    dropped[str(path)] = folder
    return {"sensor": str(path), "terms": sensor_terms(sensor)}


def _dng(rendered: Rendered, controls: Controls, memo: Memo) -> bytes:
    """Digital negative of an exposure, its colours calibrated as `rodcone capture` does; of no burst."""
    if controls.frames > 1:  # merged samples are no whole numbers as a negative's are
        raise InputError("dng: a merged burst is no raw file; allowed: 1 frame; save the exposures one by one")
    exposed = expose_scene(rendered.transport, controls, memo)
    first = next(iter(exposed.transport.groups.values()))
    light = illuminant(controls.reference_light) if first.coloured else first.spectrum
    raw = replace(
        exposed.raw,
        camera=Path(controls.sensor).stem.encode("ascii", "replace").decode(),
        f_number=exposed.sensor.lens.f_number,
        iso=iso_speed(exposed.sensor),
        colour=calibrate(exposed.sensor, light),
    )
    memo.check()
    with TemporaryDirectory() as folder:
        (path,) = write_raw(raw, Path(folder) / "explored.dng")
        return path.read_bytes()


def _study(controls: Controls, rendered: Rendered, source: Source, dropped: Dropped) -> dict[str, str]:
    if source.scene is None:
        raise InputError("study: a transport has no name that a study could say; allowed: rodcone explore SCENE")
    judged = next(iter(rendered.transport.groups.values())).coloured
    lamps = {name: controls.lamps.get(name, Lamp()) for name in rendered.transport.groups}
    files = study_of(source.scene, source.render, replace(controls, lamps=lamps), judged)
    if folder := dropped.get(controls.sensor):
        path = Path(controls.sensor)
        files = {name: text.replace(str(path), path.name) for name, text in files.items()}
        files |= {each.name: each.read_text("utf-8") for each in Path(folder.name).iterdir()}
    return files
