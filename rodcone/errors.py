"""The one exception for bad input: a single line with the name, the value, what is allowed and the likely fix."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cache
from math import isfinite, nan
from numbers import Integral, Real
from types import UnionType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

MOST_TOLD = 2000  # longest message [characters]; a quoted file may have megabytes
Kinds = type[Exception] | tuple[type[Exception], ...]


class InputError(ValueError):
    """Bad input from the caller. The message is one line; the command line prints it and exits with code 2.

    A message may quote a hostile file. Therefore characters on which a terminal would act (control characters, changes
    of writing direction) are replaced by Python's escapes, and the middle of an overlong message is left out.

    Examples
    --------
    >>> import rodcone
    >>> try:
    ...     rodcone.preset("low_nose")
    ... except rodcone.InputError as error:
    ...     print(str(error).rpartition("; ")[2])
    did you mean 'low_noise'?
    """

    def __init__(self, message: str) -> None:
        plain = "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in message)
        super().__init__(cut(plain))


def cut(text: str) -> str:
    """Leave the middle of an overlong text out."""
    half = MOST_TOLD // 2
    return text if len(text) <= MOST_TOLD else f"{text[: half - 5]} ... {text[-half:]}"


def one_line(error: BaseException) -> str:
    """Return the words of an error on one line; if they quote a traceback, as Mitsuba does, only its last line."""
    words, quoted, traceback = str(error).partition("Traceback (most recent call last):")
    last = (traceback.strip() or " ").splitlines()[-1] if quoted else ""
    return " ".join(f"{words} {last}".split())


def is_out_of_memory(error: RuntimeError) -> bool:
    """Return whether Dr.Jit reports that the machine or device is out of memory: it has no error class for that."""
    return "out of memory" in str(error).lower()


@contextmanager
def read_errors(what: str, fix: str, kinds: Kinds = (OSError, ValueError)) -> Iterator[None]:
    """Turn errors within into an `InputError`, ``what (the error's words); fix``.

    An error that is an `InputError` already is raised unchanged.
    """
    try:
        yield
    except InputError:
        raise
    except kinds as error:
        raise InputError(f"{what} ({one_line(error)}); {fix}") from error


@contextmanager
def in_place(place: str) -> Iterator[None]:
    """Put a place, such as a file's path, before the words of an `InputError` within."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def unknown(what: str, value: object, allowed: Iterable[str]) -> InputError:
    """Build the error for a name that is not in a list, naming the nearest one that is."""
    names = sorted(allowed)
    near = get_close_matches(str(value), names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return InputError(f"{what}: {value!r} is unknown; allowed: {', '.join(names)}{hint}")


def require_range(name: str, value: object, low: float, high: float, fix: str) -> None:
    """Raise `InputError` unless `value` is a finite number and ``low <= value <= high``."""
    try:
        number = float(value) if not isinstance(value, bool) and isinstance(value, Real) else nan
    except OverflowError:  # Python's whole numbers may exceed the range of floats
        number = nan
    exact = int(value) if isinstance(value, Integral) else number  # 2^53 + 1 is no float
    if not (isfinite(number) and low <= exact <= high):
        raise InputError(f"{name}: {value!r} is outside {low:g} to {high:g}; {fix}")


def require_whole(name: str, value: Any, low: int, high: int, fix: str) -> None:
    """Raise `InputError` unless `value` is a whole number and ``low <= value <= high``."""
    require_range(name, value, low, high, fix)
    if value != int(value):
        raise InputError(f"{name}: {value!r} is not a whole number; allowed: {low} to {high}; round it")


def require_kind(name: str, value: object, kind: type, fix: str) -> None:
    """Raise `InputError` unless `value` is of a kind."""
    if not isinstance(value, kind):
        article = "an" if type(value).__name__[0] in "AEIOUaeiou" else "a"
        raise InputError(f"{name}: {article} {type(value).__name__} is none; allowed: {kind.__name__}; {fix}")


def require_absent(place: str, **options: object) -> None:
    """Raise `InputError` for the first of some options that is given where it has no meaning; `place` says where."""
    for name, value in options.items():
        if value is not None and value is not False and value != ():
            raise InputError(f"{name.replace('_', '-')}: {value!r} {place}; leave it out")


def require_name(what: str, value: object, allowed: Collection[str]) -> None:
    """Raise `InputError` for a name that is not in `allowed`."""
    if value not in allowed:
        raise unknown(what, value, allowed)


def require_keys(what: str, keys: Iterable[str], allowed: Collection[str]) -> None:
    """Raise `InputError` for the first key that is not in `allowed`."""
    for key in keys:
        require_name(what, key, allowed)


def require_fields(value: object, place: str = "") -> None:
    """Raise `InputError` if a field of a dataclass is of another kind than its annotation says, or out of range.

    It checks numbers, text, flags, classes and tuples of these. Arrays and mappings need more than an annotation, and
    are left out. ``Annotated[float, (low, high, fix)]`` is a number from low to high, `int` a whole one; `place` is put
    before the field's name.
    """
    owner: object = type(value)
    for name, kind in _kinds(owner).items():
        given = getattr(value, name)
        if get_origin(kind) is Annotated:
            if given is not None or not _fits(None, kind.__origin__):
                check = require_range if _fits(0.5, kind.__origin__) else require_whole
                check(f"{place}{name}", given, *kind.__metadata__[0])
        elif not _fits(given, kind):
            words = kind.__name__ if isinstance(kind, type) else str(kind)
            raise InputError(f"{place}{name}: {str(given)[:80]!r} is not allowed; give {words}")


@cache
def _kinds(owner: object) -> dict[str, Any]:
    return get_type_hints(owner, include_extras=True)


def _fits(value: object, kind: object) -> bool:
    """Return whether a value is of the kind that an annotation states.

    The answer is always yes for arrays and for kinds that aren't classes.
    """
    parts = get_args(kind)
    if isinstance(kind, UnionType):
        return any(_fits(value, part) for part in parts)
    if kind in (float, int):
        return not isinstance(value, bool) and isinstance(value, Real if kind is float else Integral)
    if get_origin(kind) is Literal:
        return isinstance(value, str) and value in parts
    if get_origin(kind) is tuple:
        kinds = parts[:1] * len(value) if parts[-1] is ... and isinstance(value, tuple) else parts
        return isinstance(value, tuple) and len(value) == len(kinds) and all(map(_fits, value, kinds))
    origin = get_origin(kind) or kind
    return not isinstance(origin, type) or hasattr(origin, "__array__") or isinstance(value, origin)
