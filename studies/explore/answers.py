"""Answer the page's questions: pictures for one or two cameras; figures, files and Python for one."""

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from rodcone.errors import InputError
from sensor.raw_files.raw_file import write_raw
from sensor.response import behind_filters, imaged_electrons
from studies.explore.chain import Exposure, Shot, development_of, expose_scene, photograph, true_picture_of
from studies.explore.controls import Controls, Lamp, only_group, to_json
from studies.explore.memo import Memo
from studies.explore.messages import Header, sensor_terms, write_dropped
from studies.explore.slow import stand_in
from studies.explore.source import RenderState
from studies.explore.views import VIEWS, Bytes, facts, histogram, pixel
from studies.photograph.camera import calibrate, with_notes
from studies.study.render_noise import monte_carlo_share, noise_note
from studies.study.scene_source import first_light

Answer: TypeAlias = tuple[Header, Sequence[bytes]]


def written(message: Header, controls: Controls, rendered: RenderState, memo: Memo, drops: Path) -> Answer:
    """Answer a message with a figure or a file of one camera."""
    kind = message["kind"]
    if kind == "dng":
        return {"name": "explored.dng"}, (_dng(rendered, controls, memo),)
    exposed = expose_scene(rendered.transport, controls, memo)
    if kind == "histogram":
        note = noise_note(noise_share(exposed, controls, memo), rendered.transport.spp) if rendered.last else ""
        if note and memo.kept("noise note", "") is None:
            memo.keep("noise note", "", note)
            print(f"rodcone: {note}", file=sys.stderr)  # printed once per render
        python = python_text(rendered, controls, kind, drops)
        return {"histogram": histogram(exposed.raw), "python": python, "noise_note": note}, ()
    row, column = message["row"], message["column"]
    budget = pixel(exposed, row, column)
    return {"pixel": budget, "python": python_text(rendered, controls, f"pixel {row} {column}", drops)}, ()


def shown(
    cameras: Sequence[Controls], views: Sequence[tuple[int, str]], rendered: RenderState, memo: Memo, drops: Path
) -> tuple[Header, list[Bytes], bool]:
    """Return a header, a picture for each view, and whether the result of a slow processor is still missing."""
    shots, used = [], []
    for controls in cameras:
        exposed = expose_scene(rendered.transport, controls, memo)
        shot = _shot(controls, exposed, memo)
        taken = controls
        if shot is None:
            taken = stand_in(controls, exposed.raw.dn.size)
            shot = photograph(rendered.transport, taken, memo)
        shots.append(shot)
        used.append(taken)
    pictures = []
    for camera, view in views:
        memo.check()
        pictures.append(VIEWS[view](shots[camera]))
    header = {
        "cameras": [
            {"controls": to_json(taken), "waiting_for": None if taken == controls else controls.processor}
            for taken, controls in zip(used, cameras, strict=True)
        ],
        "views": [list(view) for view in views],
        "python": [python_text(rendered, used[camera], view, drops) for camera, view in views],
        "facts": [facts(shot) for shot in shots],
        "size": list(pictures[0].shape[:2]),
        "spp": rendered.transport.spp,
        "render_error": rendered.transport.relative_mc_error,
    }
    return header, pictures, used != list(cameras)


def _shot(controls: Controls, exposed: Exposure, memo: Memo) -> Shot | None:
    """Develop an exposure; return None if its processor is slow and has no result yet."""
    if stand_in(controls, exposed.raw.dn.size) == controls:
        development = development_of(exposed, controls, memo)
        memo.check()
        developed = development()
    else:
        developed = memo.kept("slow", repr(controls))
        if developed is None:
            return None
        if isinstance(developed, InputError):
            raise developed
    linear, picture = developed
    return Shot(exposed, linear, *true_picture_of(exposed, controls, memo), picture)


def python_text(rendered: RenderState, controls: Controls, view: str, drops: Path) -> str:
    """Write the Python that makes a view or a figure; it expects a dropped sensor's file in its working folder."""
    text = python_of(rendered.code, controls, view)
    path = Path(controls.sensor)
    return text.replace(str(path), path.name) if drops in path.parents else text


def take_sensor(files: object, drops: Path) -> Header:
    """Store a sensor file that was dropped on the page; return the values at which the page's sliders begin."""
    path, sensor = write_dropped(files, drops)
    return {"sensor": str(path), "terms": sensor_terms(sensor)}


def _dng(rendered: RenderState, controls: Controls, memo: Memo) -> bytes:
    """Return an exposure as a digital negative, with colours calibrated as by `rodcone capture`; refuse a burst."""
    if controls.frames > 1:  # a negative holds whole numbers, but merged samples are means
        raise InputError("dng: a merged burst is no raw file; allowed: 1 frame; save the exposures one by one")
    exposed = expose_scene(rendered.transport, controls, memo)
    light = first_light(exposed.transport.groups, illuminant(controls.reference_light))
    raw = with_notes(exposed.raw, exposed.sensor, calibrate(exposed.sensor, light), controls.sensor)
    memo.check()
    with TemporaryDirectory() as folder:
        (path,) = write_raw(raw, Path(folder) / "explored.dng")
        return path.read_bytes()


def python_of(render: str, controls: Controls, view: str = "picture") -> str:
    """Write the Python that makes a picture of the page again, bit for bit.

    Parameters
    ----------
    render : str
        Lines that make `transport` (`studies.explore.source.RenderState`), or `studies.explore.source.GIVEN`.
    controls : Controls
    view : str
        Name in `studies.explore.views.VIEWS`, ``histogram``, or ``pixel ROW COLUMN``.
    """
    settings = to_json(controls)
    defaults = to_json(Controls())
    default_lamp = vars(Lamp())
    settings["lamps"] = {
        group: {name: value for name, value in lamp.items() if value != default_lamp[name] and value != []}
        for group, lamp in settings["lamps"].items()
    }
    changed = {name: value for name, value in settings.items() if value != defaults[name]}
    given = "".join(f"    {name}={value!r},\n" for name, value in changed.items())
    made, comment = ("picture", "  # (h, w, 3) uint8") if view in VIEWS else ("figure", "")
    arguments = f"\n    transport,\n    {view!r},\n{given}" if given else f"transport, {view!r}"
    lines = f"{render}{made} = rodcone.explorer_view({arguments}){comment}".splitlines()
    imports = [line for line in lines if line.startswith(("from ", "import "))]
    code = [line for line in lines if line and line not in imports]
    return "\n".join([*imports, "import rodcone", "", *code, ""])


def noise_share(exposed: Exposure, controls: Controls, memo: Memo) -> float:
    """Return the Monte Carlo variance of the raw electrons over the sensor's own, like the `mc_share` of a sweep's row.

    The error is half the difference of the render's halves, imaged by the lens and the filters as the light is.
    """
    errors_e = []
    for name in exposed.frames:
        lamp = controls.lamps.get(name, Lamp())
        camera = (controls.sensor, controls.mosaic, tuple(sorted(controls.lens.items())), controls.lens_table)
        errors_e.append(memo.of("error", (name, lamp.spectrum, lamp.table, camera), _error_e, exposed, name))
    powers = [exposed.transport.groups[name].power for name in exposed.frames]
    error_e = behind_filters(np.tensordot(powers, errors_e, axes=1), exposed.sensor) * exposed.scale
    share = monte_carlo_share(error_e * exposed.exposure_s, exposed.expected_e, exposed.sensor, exposed.exposure_s)
    return controls.frames * share


def _error_e(exposed: Exposure, name: str) -> NDArray[np.float64]:
    """Return the Monte Carlo error of one light group at power 1 in 1 s, behind the filters, (h, w, channel) [e-]."""
    even, odd = (
        imaged_electrons(half, exposed.sensor, 1.0) for half in only_group(exposed.transport, name).relight_halves()
    )
    return (even - odd) / 2
