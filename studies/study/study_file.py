"""Studies as TOML files: read strictly, so that a misspelt key can't go unnoticed for a night of computing."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args, get_origin

from cattrs import AttributeValidationNote, ClassValidationError, Converter, ForbiddenExtraKeysError

from rodcone.errors import InputError, one_line, require_whole, unknown
from rodcone.toml_file import parse_toml, read_toml
from studies.study.study import SceneChoice, Study, check

MOST_SEEDS = 100_000
_FILES = (".xml", ".exr", ".mat", ".toml")  # values that name a file beside the study's


def read_study(path: str | Path, changes: Sequence[str] = ()) -> Study:
    """Read and check a study.

    Parameters
    ----------
    path : str or Path
        TOML with the fields of `Study`; names of files in it are relative to its folder.
    changes : sequence of str
        ``key=value`` such as ``render.spp=64``, the value in TOML's notation, in place of the file's own.

    Raises
    ------
    InputError
        For a file that can't be read, an unknown key (the likely one is named), or a value that isn't allowed.
    """
    try:
        content = read_toml(Path(path))
    except (OSError, ValueError) as error:
        raise InputError(
            f"study: {str(path)!r} can't be read ({one_line(error)}); start from one of: rodcone new study -o FILE"
        ) from error
    try:
        for change in changes:
            _set(content, change)
        study = _beside(study_of(content), Path(path).parent)
        check(study)
    except InputError as error:
        raise InputError(f"study {str(path)!r}: {error}") from error
    return study


def study_of(content: Mapping[str, Any]) -> Study:
    """Study of a TOML file's content, its values not checked beyond their types; ``seeds = 3`` are seeds 0, 1 and 2.

    Raises
    ------
    InputError
        For an unknown key, a missing one, or a value of another type.
    """
    seeds = content.get("seeds")
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        require_whole("seeds", seeds, 1, MOST_SEEDS, "give how many, from 0 on, or a list such as [7]")
        content = {**content, "seeds": list(range(seeds))}
    try:
        return _CONVERTER.structure(content, Study)
    except ClassValidationError as error:
        raise _told(error) from error


def _set(content: dict[str, Any], change: str) -> None:
    """Put one ``key=value`` into the content; a value that is no TOML stands for the text that it is."""
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


def _beside(study: Study, folder: Path) -> Study:
    """Study whose files are found from anywhere."""

    def place(name: str) -> str:
        return str(folder / name) if Path(name).suffix.lower() in _FILES else name

    scenes = tuple(replace(scene, source=place(scene.source)) for scene in study.scenes)
    return replace(study, scenes=scenes, sensors=tuple(place(name) for name in study.sensors))


def _strict(kind: type, allowed: tuple[type, ...], words: str) -> Callable[[Any, Any], Any]:
    """Hook that refuses what Python would convert: a text that reads as a number, True as 1."""

    def take(value: Any, _: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, allowed):
            raise InputError(f"{value!r} is not {words}")
        return kind(value)

    return take


def _scene(value: Any, _: Any) -> SceneChoice:
    """Scene by its name alone, or as a table."""
    if isinstance(value, str):
        return SceneChoice(value)
    if not isinstance(value, dict):
        raise InputError(f"{value!r} is not a scene; give a name, a file, or {{ source = NAME, light = LIGHT }}")
    return _TABLE_CONVERTER.structure(value, SceneChoice)


def _axis(kind: Any, converter: Converter) -> Callable[[Any, Any], Any]:
    """Hook for a tuple, in which one value stands for a list of one."""
    item = get_args(kind)[0]
    return lambda value, _: tuple(
        converter.structure(each, item) for each in (value if isinstance(value, list) else [value])
    )


def _is_tuple(kind: Any) -> bool:
    origin: Any = get_origin(kind)
    return origin is tuple


def _converter() -> Converter:
    made = Converter(forbid_extra_keys=True)
    made.register_structure_hook(str, _strict(str, (str,), "a text in quotes"))
    made.register_structure_hook(int, _strict(int, (int,), "a whole number"))
    made.register_structure_hook(float, _strict(float, (int, float), "a number"))
    made.register_structure_hook_factory(_is_tuple, lambda kind: _axis(kind, made))
    return made


_TABLE_CONVERTER = _converter()
_CONVERTER = _converter()
_CONVERTER.register_structure_hook(SceneChoice, _scene)


def _told(error: ClassValidationError) -> InputError:
    """First fault on one line; an unknown key comes with the one that was likely meant."""
    fault = min(error.exceptions, key=lambda each: not isinstance(each, ForbiddenExtraKeysError))
    if isinstance(fault, ForbiddenExtraKeysError):
        return unknown("key", sorted(fault.extra_fields)[0], [field.name for field in fields(fault.cl)])
    if isinstance(fault, KeyError):
        return InputError(f"key {fault.args[0]!r} is missing; add it, or see rodcone new study")
    where = [note.name for note in getattr(fault, "__notes__", []) if isinstance(note, AttributeValidationNote)]
    told = _told(fault) if isinstance(fault, ClassValidationError) else _type_fault(fault)
    return InputError(f"{where[0]}: {told}" if where else str(told))


def _type_fault(fault: BaseException) -> str:
    if isinstance(fault, InputError):
        return str(fault)
    return "what stands there is not a table; allowed: a table of keys; see rodcone new study"
