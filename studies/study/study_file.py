"""Read studies from TOML files, strictly: a misspelt key is an error, so that it doesn't waste a night of computing."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, get_args

from cattrs.gen import make_dict_structure_fn

from isp.processors.own import user_file
from rodcone.errors import InputError, read_errors, require_whole
from rodcone.toml_file import is_tuple, parse_toml, read_toml, strict_converter, structured
from studies.study.study import FILES, SceneChoice, Study

_VALUES = {"levels": '"1lux" or "25cd/m2"', "exposures": '"10ms"'}
EXAMPLES = Path(__file__).parents[1] / "configs"
DEMO_STUDY = EXAMPLES / "demo.toml"  # the study that `rodcone demo` and `rodcone reference` begin with
MOST_SEEDS = 100_000


def read_study(path: str | Path, changes: Sequence[str] = (), *, trust_code: bool = False) -> Study:
    """Read and check a study.

    Parameters
    ----------
    path : str or Path
        TOML with the fields of `Study`; names of files in it are relative to its folder. Where no such file is, a name
        of `EXAMPLES`.
    changes : sequence of str
        ``key=value`` such as ``render.spp=64``, with the value in TOML's notation; it replaces the file's own value.
    trust_code : bool
        Consent to run the user's own Python files among the processors; the study file itself can't give it.

    Raises
    ------
    InputError
        For a file that can't be read, an unknown key (the message names a similar one), or a value that isn't allowed.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.read_study("light_levels", ["seeds=1"]).seeds
    (0,)
    """
    example = EXAMPLES / f"{path}.toml"
    if not Path(path).exists() and example.parent == EXAMPLES and example.is_file():
        path = example
    with read_errors(f"study: {str(path)!r} can't be read", "start from one of: rodcone new study -o FILE"):
        content = read_toml(Path(path))
    if "pixel" in content:
        raise InputError(
            f"study {str(path)!r}: it is a sensor; allowed: a study (rodcone new study -o FILE), in which it stands as "
            f'sensors = ["{Path(path).name}"]'
        )
    try:
        for change in changes:
            _set(content, change)
        seeds = content.get("seeds")
        if isinstance(seeds, int) and not isinstance(seeds, bool):
            require_whole("seeds", seeds, 1, MOST_SEEDS, "give how many, from 0 on, or a list such as [7]")
            content["seeds"] = list(range(seeds))
        if "trust_code" in content:
            raise InputError("trust_code: no file may ask for it; leave it out, and give --trust-code")
        content["trust_code"] = trust_code
        for axis in ("scenes", "sensors", "spectra", "processors", "compare", "flicker"):
            content |= {axis: _beside(content[axis], Path(path).parent)} if axis in content else {}
        if isinstance(lens := content.get("lens"), dict) and "table" in lens:
            content["lens"] = lens | {"table": _beside(lens["table"], Path(path).parent)}
        return structured(content, Study, _CONVERTER, "see rodcone new study")
    except InputError as error:
        words = str(error)
        value = _VALUES.get(words.partition(":")[0])
        if value and "not a text" in words:
            words = f"{words}; write {value}"
        raise InputError(f"study {str(path)!r}: {words}") from error


def _set(content: dict[str, Any], change: str) -> None:
    """Write one ``key=value`` into the content; a value that isn't TOML is used as a text."""
    key, equals, text = change.partition("=")
    if not equals or not key:
        raise InputError(f"set: {change!r} is not allowed; write KEY=VALUE, such as render.spp=64")
    try:
        value = parse_toml(f"value = {text}")["value"]
    except ValueError:
        value = text
    *way, last = key.strip().split(".")
    table = content
    for step in way:
        table = table.setdefault(step, {})
        if not isinstance(table, dict):
            raise InputError(f"set: {step!r} of {key!r} is not a table; leave what comes after it out")
    table[last] = value


def _beside(value: Any, folder: Path) -> Any:
    """Return an axis's value in which names of files, which are relative to the study's folder, become paths."""
    if isinstance(value, list):
        return [_beside(item, folder) for item in value]
    if isinstance(value, dict):
        return value | {key: _beside(value[key], folder) for key in ("source", "light", "chart") if key in value}
    named = isinstance(value, str) and (Path(value).suffix.lower() in FILES or user_file(value))
    return str(folder / value) if named else value


def _scene(value: object, _: object) -> SceneChoice:
    """Read a scene, which is given by its name alone or as a table."""
    if isinstance(value, str):
        return SceneChoice(value)
    if not isinstance(value, dict):
        raise InputError(f"{value!r} is not a scene; give a name, a file, or {{ source = NAME, light = LIGHT }}")
    return _scene_of_table(value, SceneChoice)


def _axis(kind: object) -> Callable[[Any, Any], Any]:
    """Return a hook that reads a list into a tuple; a single value is read like a list with one value."""
    item = get_args(kind)[0]
    return lambda value, _: tuple(
        _CONVERTER.structure(entry, item) for entry in (value if isinstance(value, list) else [value])
    )


_CONVERTER = strict_converter()
_CONVERTER.register_structure_hook_factory(is_tuple, _axis)
_scene_of_table = make_dict_structure_fn(SceneChoice, _CONVERTER, _cattrs_forbid_extra_keys=True)
_CONVERTER.register_structure_hook(SceneChoice, _scene)
