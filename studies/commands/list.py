"""The command `rodcone list`."""

from importlib import import_module
from pathlib import Path
from typing import Literal

from rodcone.errors import InputError
from rodcone.files import check_place
from studies.commands.console import print_json, print_table, require_ending, write_text

# Each list imports its own catalogue: all of them together take a second to load.

# CIE 015:2018, with the correlated colour temperatures that it states.
LIGHTS = {
    "A": "incandescent lamp, 2856 K",
    **{f"D{n}": f"daylight, {n}00 K" for n in (50, 55, 65, 75)},
    "E": "the same power at every wavelength",
    "F2": "fluorescent lamp, cool white",
    "F11": "fluorescent lamp of narrow bands, 4000 K",
    **{f"LED-B{n}": f"white LED (blue with phosphor), {k} K" for n, k in enumerate((2733, 2998, 4103, 5109, 6598), 1)},
    "LED-BH1": "white and red LED, 2851 K",
    "LED-RGB1": "red, green and blue LED, 2840 K",
    "LED-V1": "white LED (violet with phosphor), 2724 K",
    "LED-V2": "white LED (violet with phosphor), 4070 K",
    "sodium_high": "high-pressure sodium lamp",
    "sodium_low": "low-pressure sodium lamp: two lines at 589 nm",
    "moonlight": "sunlight from the full moon",
    "sunlight": "the sun without the sky (ASTM G173)",
    "3000K": "black body of that temperature; any number",
    "D7000K": "daylight of that colour temperature; any number from 4000",
}

TEMPERATURES = ("3000K", "D7000K")  # that stand for any

Kind = Literal["scenes", "lights", "sensors", "mosaics", "processors", "metrics"]


def list_names(kind: Kind | None = None, /, *, out: Path | None = None, json: bool = False) -> None:
    """Print what the other commands know by name, with what each is.

    Parameters
    ----------
    kind
        scenes, lights, sensors, mosaics, processors or metrics; all of them by default.
    out
        With lights or sensors, gallery of their curves to write as well (.svg).
    json
        Print one JSON object: kinds, and in each the names with their texts.
    """
    if out is not None:
        _write_gallery(kind, out)
    lists = {name: LISTS[name]() for name in ([kind] if kind else LISTS)}
    if json:
        print_json(lists)
        return
    for index, (name, lines) in enumerate(lists.items()):
        print(f"{chr(10) * (index > 0)}{name}")
        print_table(("", ""), [(f"  {key}", text) for key, text in lines.items()], words=2)


def _write_gallery(kind: Kind | None, out: Path) -> None:
    """Draw the spectra of the lights, or the responses of the sensors."""
    from render import illuminants
    from sensor.cameras.library import measured_cameras
    from sensor.presets import low_noise
    from studies.pages.plots import lights_svg, responses_svg

    require_ending(out, ".svg")
    if kind not in ("lights", "sensors"):
        raise InputError(f"out: {str(out)!r} has no curves to show; allowed: with lights or sensors; leave it out")
    check_place(out)
    if kind == "lights":
        text = lights_svg({name: illuminants.illuminant(name) for name in lights()})
    else:  # a * where channels don't share a unit
        measured = {
            f"{name}{'' if camera.balanced else '*'}": camera.responses for name, camera in measured_cameras().items()
        }
        text = responses_svg({"the presets": low_noise().responses, **measured})
    write_text(out, text)


def scenes() -> dict[str, str]:
    """Scenes of the catalogue, each by its module's first line, and its light groups."""
    from scenes import catalog

    lines = {}
    for name in catalog.names():
        text = first_line(import_module(f"scenes.{name}").__doc__)
        lines[name] = f"{text} Lights: {', '.join(catalog.load(name).groups)}."
    return lines


def lights() -> dict[str, str]:
    """Illuminants."""
    from render import illuminants

    return {name: LIGHTS[name] for name in (*illuminants.names(), *TEMPERATURES)}


def sensors() -> dict[str, str]:
    """Presets, each by the remark that its file begins with, and cameras whose response was measured."""
    from sensor import presets
    from sensor.cameras.library import measured_cameras

    texts = {}
    for name in presets.names():
        remark, _ = presets.preset_file(name).read_text("utf-8").split("\n\n", 1)
        texts[name] = " ".join(remark.replace("#", " ").split())
    for name, camera in measured_cameras().items():
        ratios = "" if camera.balanced else ", each channel by itself"
        texts[name] = f"Measured response, relative{ratios}: {camera.text}. rodcone new preset --camera."
    return texts


def mosaics() -> dict[str, str]:
    """Mosaics by their tile's rows."""
    from sensor import cfa

    return {name: "/".join(cfa.tile_of(name)) for name in cfa.mosaics()}


def processors() -> dict[str, str]:
    """Processors with mosaic, source, and the extra that they need."""
    from isp.processors.catalogue import PROCESSORS

    return {
        name: f"{processor.mosaic}: {processor.source}"
        + (f"; pip install rodcone[{processor.extra}]" if processor.extra else "")
        for name, processor in PROCESSORS.items()
    }


def metrics() -> dict[str, str]:
    """Columns of a sweep that tell cameras apart."""
    from studies.metrics.metric import METRICS

    units = {x.key: f" [{x.unit}]" if x.unit else "" for x in METRICS}
    return {x.key: f"{x.name}{units[x.key]}, {'higher' if x.higher else 'lower'} is better" for x in METRICS}


def first_line(text: str | None) -> str:
    """First sentence of a text."""
    return (text or "").strip().split("\n", 1)[0]


LISTS = {
    "scenes": scenes,
    "lights": lights,
    "sensors": sensors,
    "mosaics": mosaics,
    "processors": processors,
    "metrics": metrics,
}
