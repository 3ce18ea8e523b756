"""`rodcone new`: files to start from."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from render.errors import InputError
from render.files import replacing
from sensor.presets import preset_file

app = App(name="new", help="Write files to start from.")


@app.command
def preset(name: str, /, *, out: Annotated[Path, Parameter(name=["--out", "-o"])]) -> None:
    """Copy a sensor preset to a TOML file to change: pixel, lens, mosaic, responses, every number with its source.

    Parameters
    ----------
    name
        Preset by name: low_noise, table1_pixel, table1_output, or table1_output_6um, _3um and _2um for the paper's
        Figures 1 and 5.
    out
        File to write, ending in .toml; one that exists is left alone. Wherever a preset's name goes, so does this path.
    """
    text = preset_file(name).read_text("utf-8")
    if out.suffix != ".toml":
        raise InputError(f"out: {str(out)!r} doesn't end in .toml; allowed: a .toml file; write {out.stem}.toml")
    if out.exists():
        raise InputError(f"out: {str(out)!r} exists; allowed: a new file; choose another name or remove it")
    with replacing(out) as (place,):
        place.write_text(text, "utf-8")
    print(out)
