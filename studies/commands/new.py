"""`rodcone new`: files to start from."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from cyclopts import App

from rodcone.errors import InputError, require_keys
from rodcone.files import replacing
from rodcone.toml_file import read_toml
from sensor.presets import preset_file
from studies.commands.console import Out, require_ending

app = App(name="new", help="Write files to start from.")
_STUDIES = Path(__file__).parent.parent / "configs"
_CLUSTER = Path(__file__).parent.parent / "data" / "dask.yaml"


@app.command
def preset(name: str, /, *, out: Out) -> None:
    """Copy a sensor preset to a TOML file to change: pixel, lens, mosaic, responses, every number with its source.

    Parameters
    ----------
    name
        Preset by name: low_noise, table1_pixel, table1_output, or table1_output_6um, _3um and _2um for the paper's
        Figures 1 and 5.
    out
        File to write, ending in .toml; one that exists is left alone. Its path can replace any preset name.
    """
    _copy(preset_file(name), out, ".toml")


@app.command
def study(name: str = "light_levels", /, *, out: Out) -> None:
    """Copy an example of a study to a TOML file to change, for `rodcone sweep`; sensors that it names come with it.

    Parameters
    ----------
    name
        light_levels (moonlight to daylight), spectra (one scene under several lights at equal lux), metamers (pairs
        that look alike under D65), infrared_cut (a filter in or out), responses (broad filters or narrow ones),
        exposures (exposure times and fixed patterns on Table 1's pixel), opponents (every processor, for rodcone
        opponents), white_pixel (one method with and without W), demo (what rodcone demo makes), or paper_1b and paper_6
        (of the paper's figures).
    out
        File to write, ending in .toml; one that exists is left alone. Sensors and their curves go into the folder
        sensors beside it, where files of the same content are kept.
    """
    examples = {path.stem: path for path in sorted(_STUDIES.glob("*.toml"))}
    require_keys("study", [name], examples)
    beside = {out.parent / each: _STUDIES / each for each in _named(examples[name])}
    for target, source in beside.items():
        if target.exists() and target.read_bytes() != source.read_bytes():
            raise InputError(
                f"out: {str(target)!r} exists and differs from the example's; allowed: no such file, or the same; "
                "choose another folder"
            )
    _copy(examples[name], out, ".toml", beside)


@app.command
def cluster(*, out: Out) -> None:
    """Copy settings of dask.distributed that suit sweeps, with the commands that start a cluster.

    Parameters
    ----------
    out
        File to write, ending in .yaml; one that exists is left alone.
    """
    _copy(_CLUSTER, out, ".yaml")


def _named(study_file: Path) -> list[str]:
    """Files that an example names, and those that its sensors name, relative to its folder."""
    found = []
    for name in read_toml(study_file).get("sensors", ()):
        if name.endswith(".toml"):
            responses = read_toml(study_file.parent / name).get("responses", {}).values()
            curves = [value for value in responses if isinstance(value, str) and value.endswith(".csv")]
            found += [name, *(str(Path(name).parent / curve) for curve in curves)]
    return list(dict.fromkeys(found))


def _copy(source: Path, out: Path, ending: str, beside: Mapping[Path, Path] = MappingProxyType({})) -> None:
    """Copy a file to a new one, after the files that belong beside it, and print its path."""
    require_ending(out, ending)
    if out.exists():
        raise InputError(f"out: {str(out)!r} exists; allowed: a new file; choose another name or remove it")
    for target, other in {**beside, out: source}.items():
        if target != out:
            target.parent.mkdir(exist_ok=True)
        with replacing(target) as (place,):
            place.write_bytes(other.read_bytes())
    print(out)
