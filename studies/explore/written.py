"""What a shot is written as: Python that makes it again to the bit, and a study that asks the same question."""

import json
import re
from dataclasses import fields, replace
from pathlib import Path

from isp.processors.catalogue import PROCESSORS
from render.radiance_files.radiance_source import is_radiance_file
from rodcone.errors import InputError
from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.presets import preset, preset_file
from studies.explore.controls import TIME, Controls, Lamp
from studies.explore.equipment import camera_of
from studies.study.radiance_file import LIGHT
from studies.study.study import FILES, OWN, RenderLimits, SceneChoice

GIVEN = "transport = ...  # the one that was given to rodcone.explore\n"


def python_of(render: str, controls: Controls, view: str = "picture") -> str:
    """Python that makes a picture of the page again, to the bit.

    Parameters
    ----------
    render : str
        Lines that make `transport` (`studies.explore.source.Source`), or `GIVEN`.
    controls : Controls
    view : str
        Of `studies.explore.views.VIEWS`, ``histogram``, or ``pixel ROW COLUMN``.
    """
    changed = {
        each.name: getattr(controls, each.name)
        for each in fields(controls)
        if getattr(controls, each.name) != getattr(Controls(), each.name)
    }
    written = "".join(f"    {name}={value!r},\n" for name, value in changed.items())
    lamp = ", Lamp" if "lamps" in changed else ""
    name, *place = view.split(" ") if view.startswith("pixel ") else (view,)
    if name == "pixel":
        row, column = map(int, place)
        taken, last = "pixel", f"figure = pixel(shot.exposed, {row}, {column})\n"
    elif name == "histogram":
        taken, last = "histogram", "figure = histogram(shot.exposed.raw)\n"
    else:
        taken, last = "VIEWS", f"picture = VIEWS[{view!r}](shot)  # (h, w, 3) uint8\n"
    lines = (
        f"{render}controls = Controls({f'{chr(10)}{written}' if written else ''})\n"
        f"shot = photograph(transport, controls)\n{last}"
    ).splitlines()
    own = (
        "from studies.explore.chain import photograph",
        f"from studies.explore.controls import Controls{lamp}",
        f"from studies.explore.views import {taken}",
    )
    imports = sorted(line for line in (*own, *lines) if line.startswith("from "))
    numpy = ["import numpy as np"] if "import numpy as np" in lines else []
    code = [line for line in lines if line and not line.startswith(("from ", "import "))]
    return "\n".join([*numpy, "import rodcone", *imports, "", *code, ""])


def study_of(scene: SceneChoice, render: RenderLimits, controls: Controls, coloured: bool = False) -> dict[str, str]:
    """Files of a study that asks for this scene, light and camera: ``study.toml`` and, with own terms, ``sensor.toml``.

    Parameters
    ----------
    scene : SceneChoice
    render : RenderLimits
    controls : Controls
    coloured : bool
        Whether the first light group has colours of its own, which are judged under ``reference_light``.

    Raises
    ------
    InputError
        Where a study can't say it: lamps of their own, another mosaic than the processor's, settings of the processor,
        no shot noise, or another reference light of a scene's own colours.
    """
    spectrum, own_mosaic = _one_spectrum(controls), PROCESSORS[controls.processor].mosaic
    if controls.settings:
        raise InputError("study: it has no settings of a processor; allowed: none; set them back, or copy the Python")
    if not controls.shot_noise:
        raise InputError("study: no camera is without shot noise; allowed: with it; switch it on, or copy the Python")
    if controls.mosaic != own_mosaic:
        raise InputError(
            f"study: mosaic {controls.mosaic!r} with {controls.processor}; allowed: {own_mosaic!r}, the processor's "
            "own; choose it, or copy the Python"
        )
    if is_radiance_file(scene.source):
        if coloured:  # a file's light is the one that its colours are judged under
            scene = replace(scene, light=controls.reference_light)
    elif coloured and controls.reference_light != LIGHT:
        raise InputError(
            f"study: reference_light {controls.reference_light!r} for a scene with colours of its own; allowed: "
            f"{LIGHT}; choose it, or copy the Python"
        )
    own = preset(controls.sensor)
    sensor = camera_of(controls)
    terms = dict(controls.lens) | dict(controls.pixel)
    changed = bool(terms.keys() - {"diffraction", "veiling_glare"}) or controls.bits is not None
    exposure = f"{controls.exposure_s * 1e6!r}us" if controls.exposure == TIME else controls.exposure
    longest = "" if controls.exposure == TIME else f"longest_exposure_s = {controls.exposure_s!r}\n"
    lines = (
        f"# From the explorer: seed {controls.seed}, exposure {controls.exposure_number}.\n"
        f"#   rodcone sweep study.toml -o out/study\n\n"
        f'name = "explored"\nscenes = [{_scene(scene)}]\nspectra = [{_file(spectrum)}]\n'
        f'levels = ["{controls.level_cd_m2:.12g}cd/m2"]\nexposures = [{_text(exposure)}]\n'
        f"sensors = [{_text('sensor.toml') if changed else _file(controls.sensor)}]\n"
        f"white_balances = [{_text(controls.white_balance)}]\nprocessors = [{_text(controls.processor)}]\n"
        f"seeds = [{controls.seed}]\nframes = [{controls.frames}]\n{longest}\n"
        f"[render]\nsize = {render.size}\nband_nm = {render.band_nm!r}\nspp = {render.spp}\nseed = {render.seed}\n"
        f"range_nm = {[float(nm) for nm in render.range_nm]!r}\n\n"
        f"[lens]\ndiffraction = {sensor.lens.diffraction!r}\nveiling_glare = {sensor.lens.veiling_glare!r}\n"
        f"horizontal_view_deg = {sensor.lens.horizontal_view_deg!r}\n"
    )
    if not changed:
        return {"study.toml": lines}
    return {"study.toml": lines, "sensor.toml": _sensor_file(controls, own, sensor)}


def _one_spectrum(controls: Controls) -> str:
    """The spectrum of all lamps as a study names it."""
    lamps = list(controls.lamps.values()) or [Lamp()]
    if len({lamp.spectrum for lamp in lamps}) > 1 or any(lamp.table or lamp.power != 1 for lamp in lamps):
        raise InputError(
            "study: its lights have one spectrum for all, by name, and their own powers; allowed: such lamps; set "
            "them so, or copy the Python"
        )
    return lamps[0].spectrum if lamps else OWN


def _sensor_file(controls: Controls, own: SensorConfig, sensor: SensorConfig) -> str:
    """Sensor file of a preset with other terms: the preset's lines, with the numbers that differ."""
    if controls.sensor.endswith(".toml"):
        raise InputError(
            f"study: {controls.sensor} with other terms is no preset; allowed: a preset; change the file itself"
        )
    text = re.sub(r"(?m)^bits\s*=.*$", f"bits = {sensor.bits}", preset_file(controls.sensor).read_text("utf-8"))
    for part, kind in (("pixel", PixelConfig), ("lens", LensConfig)):
        for each in fields(kind):
            before, now = (getattr(getattr(x, part), each.name) for x in (own, sensor))
            if before != now:
                line = f"{each.name} = {now!r}"
                text, found = re.subn(rf"(?m)^{each.name}\s*=.*$", line, text)
                text = text if found else text.replace(f"[{part}]\n", f"[{part}]\n{line}\n")
    return text


def _scene(scene: SceneChoice) -> str:
    """A scene as a study names it: by its source alone, or as a table."""
    given = {name: value for name, value in vars(scene).items() if value is not None}
    if given.keys() == {"source"}:
        return _file(scene.source)
    return "{ " + ", ".join(f"{name} = {_file(value)}" for name, value in given.items()) + " }"


def _file(value: str) -> str:
    """A text in which a file has its whole path: a study looks for files in its own folder."""
    return _text(str(Path(value).absolute()) if Path(value).suffix.lower() in FILES else value)


def _text(value: str) -> str:
    """A text as TOML quotes it: as JSON does, and DEL escaped too."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
