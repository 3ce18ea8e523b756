"""The command `rodcone new study`: an example of a study to change."""

from pathlib import Path

from rodcone.curve_file import is_curve_file
from rodcone.errors import InputError, require_keys
from rodcone.toml_file import read_toml
from studies.commands.new.example_files import copy_example
from studies.study.study_file import EXAMPLES


def study(name: str = "light_levels", /, *, out: Path | None = None) -> None:
    """Copy an example of a study to a TOML file to change, for `rodcone sweep`; sensors that it names come with it.

    Parameters
    ----------
    name
        light_levels (moonlight to daylight), spectra (one scene under several lights at equal lux), metamers (pairs
        that look alike under D65), infrared_cut (a filter in or out), responses (broad filters or narrow ones),
        exposures (exposure times and fixed patterns on Table 1's pixel), isos (speeds of a phone's pixel), flicker
        (exposure times under lamps of 100 Hz), motion (exposure times of a walker by night), glare (a street's lamps
        through a lens that scatters), lens (a lens by data wide open and stopped down), depth_of_field (f-numbers of a
        lens that is focused elsewhere), opponents (every processor), white_pixel (one method with and without W),
        white_pixel_lights (the same under four lights), real_cameras (five cameras that exist beside the paper's
        pixel), eye (rods and cones, interleaved and in blocks), benchmark (the frozen list of rodcone judge), demo
        (what rodcone demo makes), or paper_1b and paper_6 (of the paper's figures).
    out
        File to write, ending in .toml; one that exists is left alone. Sensors and their curves go into the folder
        sensors beside it, where files of the same content are kept.
    """
    if out is None:
        file = name if name.endswith(".toml") else "mine.toml"
        example = "" if name.endswith(".toml") else f" {name}"
        raise InputError(f"out: none is given; allowed: a new .toml file; write rodcone new study{example} -o {file}")
    examples = {path.stem: path for path in sorted(EXAMPLES.glob("*.toml"))}
    require_keys("study", [name], examples)
    beside = {out.parent / file_name: EXAMPLES / file_name for file_name in _named(examples[name])}
    copy_example(examples[name], out, ".toml", beside)


def _named(study_file: Path) -> list[str]:
    """Return the files that an example names, and those that its sensors name, relative to its folder."""
    files = []
    for name in read_toml(study_file).get("sensors", ()):
        if name.endswith(".toml"):
            responses = read_toml(study_file.parent / name).get("responses", {}).values()
            curves = [value for value in responses if isinstance(value, str) and is_curve_file(value)]
            files += [name, *(str(Path(name).parent / curve) for curve in curves)]
    return list(dict.fromkeys(files))
