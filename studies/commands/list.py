"""The command `rodcone list`."""

from pathlib import Path
from typing import Literal, get_args

from rodcone.errors import InputError
from rodcone.files import check_place, require_ending, write_files
from studies.commands.console import print_json, print_table
from studies.study.name_texts import texts_of

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
    lists = {name: texts(name) for name in ([kind] if kind else get_args(Kind))}
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
        text = lights_svg({name: illuminants.illuminant(name) for name in texts(kind)})
    else:  # sensors, with a * if their channels don't share a unit
        measured = {
            f"{name}{'' if camera.balanced else '*'}": camera.responses for name, camera in measured_cameras().items()
        }
        text = responses_svg({"the presets": low_noise().responses, **measured})
    write_files({out: text})


def texts(kind: Kind) -> dict[str, str]:
    """Return the names of one kind, each with a description."""
    if kind == "sensors":
        return _sensors()
    if kind == "mosaics":
        from sensor.presets import tile_named

        return {name: f"{'/'.join(tile_named(name))}: {text}" for name, text in texts_of(kind).items()}
    if kind == "metrics":
        from studies.metrics.metric import METRICS

        units = {x.key: f" [{x.unit}]" if x.unit else "" for x in METRICS}
        return {x.key: f"{x.name}{units[x.key]}, {'higher' if x.higher else 'lower'} is better" for x in METRICS}
    return texts_of(kind)


def _sensors() -> dict[str, str]:
    """Return the presets, each with the comment that its file begins with, and the cameras with a measured response."""
    from sensor import presets
    from sensor.cameras.library import measured_cameras

    lines = {}
    for name in presets.preset_names():
        remark, _ = presets.preset_file(name).read_text("utf-8").split("\n\n", 1)
        lines[name] = " ".join(remark.replace("#", " ").split())
    for name, camera in measured_cameras().items():
        ratios = "" if camera.balanced else ", each channel by itself"
        lines[name] = f"Measured response, relative{ratios}: {camera.text}. rodcone new preset --camera."
    return lines
