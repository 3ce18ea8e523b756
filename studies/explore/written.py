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
from studies.explore.controls import TIME, Controls, Lamp, to_json
from studies.explore.equipment import camera_of
from studies.explore.views import VIEWS
from studies.study.radiance_file import LIGHT
from studies.study.study import FILES, OWN, RenderLimits, SceneChoice

GIVEN = "transport = ...  # the one that was given to rodcone.explore\n"


def python_of(render: str, controls: Controls, view: str = "picture") -> str:
    """Python that makes a picture of the page again, to the bit.

    Parameters
    ----------
    render : str
        Lines that make `transport` (`studies.explore.source.Rendered`), or `GIVEN`.
    controls : Controls
    view : str
        Of `studies.explore.views.VIEWS`, ``histogram``, or ``pixel ROW COLUMN``.
    """
    settings, own, own_lamp = to_json(controls), to_json(Controls()), vars(Lamp())
    settings["lamps"] = {
        group: {name: value for name, value in lamp.items() if value != own_lamp[name] and value != []}
        for group, lamp in settings["lamps"].items()
    }
    changed = {name: value for name, value in settings.items() if value != own[name]}
    given = "".join(f"    {name}={value!r},\n" for name, value in changed.items())
    made, comment = ("picture", "  # (h, w, 3) uint8") if view in VIEWS else ("figure", "")
    arguments = f"\n    transport,\n    {view!r},\n{given}" if given else f"transport, {view!r}"
    lines = f"{render}{made} = rodcone.explorer_view({arguments}){comment}".splitlines()
    imports = [line for line in lines if line.startswith(("from ", "import "))]
    code = [line for line in lines if line and line not in imports]
    return "\n".join([*imports, "import rodcone", "", *code, ""])


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
