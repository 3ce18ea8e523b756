"""Answers for one camera: figures, text and files."""

import sys
from collections.abc import Mapping, MutableMapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from rodcone.errors import InputError
from studies.explore.chain import expose_scene
from studies.explore.controls import Controls, Lamp
from studies.explore.dropped import write_dropped
from studies.explore.files import dng_of
from studies.explore.memo import Memo
from studies.explore.messages import Header, sensor_terms
from studies.explore.render_noise import noise_note, noise_share
from studies.explore.source import Rendered, Source
from studies.explore.views import histogram, pixel
from studies.explore.written import python_of, study_of

Answer: TypeAlias = tuple[Header, Sequence[bytes]]
Dropped: TypeAlias = Mapping[str, TemporaryDirectory[str]]  # folders of the sensors that were dropped, by their file


def written(
    message: Header, controls: Controls, rendered: Rendered, source: Source, memo: Memo, dropped: Dropped
) -> Answer:
    """Figures and files of one camera."""
    kind = message["kind"]
    if kind == "study":
        return {"files": _study(controls, rendered, source, dropped)}, ()
    exposed = expose_scene(rendered.transport, controls, memo)
    if kind == "dng":
        return {"name": "explored.dng"}, (dng_of(exposed, controls),)
    if kind == "histogram":
        note = noise_note(noise_share(exposed, controls, memo), rendered.transport.spp) if rendered.last else ""
        if note and memo.kept("noise note", "") is None:
            print(memo.of("noise note", "", lambda: note), file=sys.stderr)  # once for each render
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
