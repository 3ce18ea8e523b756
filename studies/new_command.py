"""`rodcone new`: files to start from."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from render.errors import InputError, unknown
from render.files import replacing
from sensor.presets import preset_file

app = App(name="new", help="Write files to start from.")
Out = Annotated[Path, Parameter(name=["--out", "-o"])]
_STUDIES = Path(__file__).parent / "configs"
_CLUSTER = Path(__file__).parent / "data" / "dask.yaml"


@app.command
def preset(name: str, /, *, out: Out) -> None:
    """Copy a sensor preset to a TOML file to change: pixel, lens, mosaic, responses, every number with its source.

    Parameters
    ----------
    name
        Preset by name: low_noise, table1_pixel, table1_output, or table1_output_6um, _3um and _2um for the paper's
        Figures 1 and 5.
    out
        File to write, ending in .toml; one that exists is left alone. Wherever a preset's name goes, so does this path.
    """
    _copy(preset_file(name), out, ".toml")


@app.command
def study(name: str = "light_levels", /, *, out: Out) -> None:
    """Copy an example of a study to a TOML file to change, for `rodcone sweep`.

    Parameters
    ----------
    name
        light_levels (moonlight to daylight), spectra (one scene under several lights), or exposures (exposure times
        and fixed patterns on Table 1's pixel).
    out
        File to write, ending in .toml; one that exists is left alone.
    """
    examples = {path.stem: path for path in sorted(_STUDIES.glob("*.toml"))}
    if name not in examples:
        raise unknown("study", name, examples)
    _copy(examples[name], out, ".toml")


@app.command
def cluster(*, out: Out) -> None:
    """Copy settings of dask.distributed that suit sweeps, with the commands that start a cluster.

    Parameters
    ----------
    out
        File to write, ending in .yaml; one that exists is left alone.
    """
    _copy(_CLUSTER, out, ".yaml")


def _copy(source: Path, out: Path, ending: str) -> None:
    """Copy a text to a new file and print its path."""
    text = source.read_text("utf-8")
    if out.suffix != ending:
        raise InputError(f"out: {str(out)!r} doesn't end in {ending}; allowed: that ending; write {out.stem}{ending}")
    if out.exists():
        raise InputError(f"out: {str(out)!r} exists; allowed: a new file; choose another name or remove it")
    with replacing(out) as (place,):
        place.write_text(text, "utf-8")
    print(out)
