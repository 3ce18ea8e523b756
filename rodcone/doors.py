"""Checks that run before a public function: of each argument's kind, and of names, which become the objects they name.

`rodcone.capture`, for example, is a function of a package with these checks before it; the packages themselves don't
check again. A parameter's own annotation says what it may be: a class, or a number within limits. The table `CHECKS`
holds the rules that no annotation can state. Both this table and that of public names refer to higher packages by
strings, which are imported when they are needed, because imports run downwards only.
"""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, wraps
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter, signature
from math import inf
from numbers import Integral
from os import PathLike
from pathlib import Path
from types import MappingProxyType, ModuleType, NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from rodcone.errors import InputError, require_kind, require_range
from rodcone.time_text import parse_time

F = TypeVar("F", bound=Callable[..., Any])
PACKAGES = ("render", "scenes", "sensor", "isp", "studies")
Check = Callable[[str, Any], Any]  # function of an argument's name and value; it returns the value for the call


def at(place: str) -> Any:
    """Import the object that ``module:name`` names."""
    module, _, name = place.partition(":")
    return getattr(imported(module), name)


def require_no_shadow() -> None:
    """Raise `ImportError` if a file beside the user's script has a package's name; its one line names the file.

    Python finds a script `render.py` before the package `render`. If another distribution's package hides it instead,
    `rodcone doctor` says so.
    """
    for name in PACKAGES:
        found = getattr(sys.modules.get(name), "__spec__", None) or (None if name in sys.modules else find_spec(name))
        if found is None or found.submodule_search_locations is not None or not found.has_location:
            continue
        if "site-packages" not in Path(str(found.origin)).parts:
            raise ImportError(_shadow_words(str(found.origin), name))


def _shadow_words(file: str, package: str) -> str:
    """Return the line that names a file in a package's place, and the remedy."""
    return (
        f"rodcone: {file} stands in the place of rodcone's package {package}; allowed: a file of another name "
        "beside your script; rename it"
    )


def imported(module: str) -> ModuleType:
    """Import a module; if a user's file has the name of one of our packages, the error names that file."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        file = getattr(sys.modules.get(package), "__file__", None)
        if "." not in str(error.name) or file is None or Path(file).name == "__init__.py":
            raise
        raise ImportError(_shadow_words(file, package)) from None


def _value(kind: str | type, fix: str, by_name: str = "") -> Check:
    """Return a check that an argument is an object of a class, which is given itself or as ``module:name``.

    `by_name` is the ``module:name`` of a function that makes the object from a name or a path, if a user may give one.
    """

    def check(name: str, value: object) -> Any:
        if by_name and isinstance(value, str | Path):
            return at(by_name)(str(value))
        require_kind(name, value, at(kind) if isinstance(kind, str) else kind, fix)
        return value

    return check


def _range(low: float, high: float, fix: str) -> Check:
    """Return a check for a number within limits."""

    def check(name: str, value: object) -> Any:
        require_range(name, value, low, high, fix)
        return value

    return check


def _plain(kind: Any, words: str) -> Check:
    """Return a check for an object of one of Python's own classes; True and False don't count as numbers."""

    def check(name: str, value: Any) -> Any:
        wrong = not isinstance(value, kind) or (kind is Integral and isinstance(value, bool))
        if wrong or value == "" or (isinstance(value, str | PathLike) and "\0" in str(value)):
            raise InputError(f"{name}: {_shown(value)} is not allowed; give {words}")
        return value

    return check


def _seconds(name: str, value: object) -> Any:
    time_s = parse_time(value, name) if isinstance(value, str) else value
    require_range(name, time_s, 0.0, 1e7, "give seconds, or a time such as '20ms'")
    return time_s


def _some_seconds(name: str, value: object) -> Any:
    time_s = _seconds(name, value)
    require_range(name, time_s, 1e-9, 1e7, "give a time above 0, such as '33ms'")
    return time_s


def _exposure(name: str, value: object) -> Any:
    return value if isinstance(value, str) and value in at("sensor.exposure:RULES") else _seconds(name, value)


def _array(*shape: int, or_kinds: tuple[str, ...] = (), least: float = -inf) -> Check:
    """Return a check for an array of finite real numbers that are at least `least`, or for an object of `or_kinds`."""

    def check(name: str, value: object) -> Any:
        import numpy as np

        if any(isinstance(value, at(kind)) for kind in or_kinds):
            return value
        array = at("rodcone.types:real_array")(name, value)
        if shape and array.shape != shape:
            raise InputError(f"{name}: shape {array.shape} is not allowed; give {shape}")
        wrong = array.size - int(np.isfinite(array).sum())
        if wrong:
            raise InputError(f"{name}: {wrong} of {array.size} values are NaN or infinite; allowed: finite; mend them")
        if array.size and array.min() < least:
            raise InputError(f"{name}: {array.min():g} is not allowed; give {least:g} or more")
        return array

    return check


def _spectra(name: str, value: object) -> Any:
    """Check lamps by light group, or one illuminant in place of all lights."""
    if isinstance(value, Mapping):
        return value
    return _value("render.spectrum:Spectrum", "give a dict by light group, or an illuminant", _ILLUMINANT)(name, value)


def _size(name: str, value: Any) -> Any:
    sides = list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping) else []
    if len(sides) != 2 or not all(_passes(_WHOLE, x) and x > 0 for x in sides):
        raise InputError(f"{name}: {_shown(value)} is not allowed; give (height, width) in pixels")
    return int(sides[0]), int(sides[1])


def _size_or_side(name: str, value: Any) -> Any:
    """Check a height and width, or the longer side alone."""
    return int(value) if _passes(_WHOLE, value) and value > 0 else _size(name, value)


def _paths(name: str, value: object) -> Any:
    return [_PATH(name, one) for one in (value if isinstance(value, list | tuple) else [value])]


def _each(kind: Check, least: int = 0) -> Check:
    """Return a check for a sequence of at least some length, whose items `kind` checks."""

    def check(name: str, value: object) -> Any:
        if not isinstance(value, list | tuple) or len(value) < least:
            raise InputError(f"{name}: {_shown(value)} is not allowed; give a list{' of one or more' * least}")
        return [kind(f"{name}[{place}]", one) for place, one in enumerate(value)]

    return check


def _each_in_turn(kind: Check) -> Check:
    """Return a check for a list or a generator, whose items `kind` checks one by one as they are used."""

    def check(name: str, value: object) -> Any:
        if not isinstance(value, list | tuple | Iterator):
            raise InputError(f"{name}: {_shown(value)} is not allowed; give a list or a generator")
        return (kind(f"{name}[{place}]", one) for place, one in enumerate(value))

    return check


def _as_it_is(_: str, value: object) -> Any:
    """Accept any argument."""
    return value


def _shown(value: Any) -> str:
    """Return a value as an error names it: itself if it is short, otherwise its class."""
    text = repr(value) if isinstance(value, str | bytes | int | float | complex | tuple | list) else ""
    return text if 0 < len(text) <= 80 else f"a {type(value).__name__}"


_ILLUMINANT = "render.illuminants:illuminant"
_PICTURE = "isp.picture:Picture"
_WHOLE, _NUMBER = _plain(Integral, "a whole number"), _range(-1e12, 1e12, "give a number")
_TEXT, _FLAG = _plain(str, "text in quotes"), _plain(bool, "True or False")
_PATH, _CALL = _plain((str, PathLike), "a path in quotes"), _plain(Callable, "a function")

# For each class: the remedy that an error states if an argument isn't of that class, and the function that makes an
# object from a name or a path, if a user may give one.
KINDS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "ChannelReading": ("give rodcone.ChannelReading(...)", ""),
        "Clock": ("leave it out", ""),
        "ColourCalibration": ("give calibrate(sensor, light)", ""),
        "Device": ("give draw_device(sensor, radiance.shape, rng)", ""),
        "Generator": ("give numpy.random.default_rng(1)", ""),
        "Order": ("give rodcone.Order(...)", ""),
        "Plan": ("give rodcone.plan(study)", ""),
        "RawImage": ("give what capture or read_raw gives", ""),
        "Reading": ("give rodcone.Reading(...)", ""),
        "ReferencePicture": ("give rodcone.reference_picture(radiance)", ""),
        "Scene": ("give rodcone.load(name), or the name alone", "scenes.catalogue:load"),
        "SensorConfig": ("give a preset's name or file", "sensor.presets:preset"),
        "SpectralIrradiance": ("give form_image(radiance, sensor)", ""),
        "SpectralRadiance": ("give SpectralRadiance(...), or call its relight()", ""),
        "Spectrum": ("give rodcone.illuminant(name)", _ILLUMINANT),
        "Study": ("give a study's file", "studies.study.study_file:read_study"),
        "Transport": ("give rodcone.render(...)", ""),
        "Waveform": ("give a text such as 'fluorescent@100Hz'", "sensor.flicker.waveform:waveform"),
    }
)
# Checks that a type can't state, by the parameter's name, or by the function's and the parameter's name if the
# parameter means something else there. All other parameters are checked by their types: a class of `KINDS`, a number
# within the limits of its `Annotated`, a text, a path.
CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "resume": _value("render.transport:Transport", "give what render gave before"),
        "readings": _each(_value("sensor.pixel:Reading", "give rodcone.Reading(...)"), least=1),
        "with_channel_readings.readings": _each(
            _value("sensor.pixel:ChannelReading", "give rodcone.ChannelReading(...)")
        ),
        "frames": _each(_value("sensor.raw:RawImage", "give what capture or read_raw gives"), least=1),
        "transports": _each_in_turn(_value("render.transport:Transport", "give what render gave")),
        "cells": _each(_value("studies.sweep.cells:Cell", "give what sweep gives its runner")),
        "matte.reflectance": _value("render.spectrum:Spectrum", "give rodcone.grey(0.5) or rodcone.Spectrum(...)"),
        "spectra": _spectra,
        "load_radiance.spectra": _TEXT,
        "exposure_s": _seconds,
        **dict.fromkeys(("light_for_snr.exposure_s", "score.exposure_s", "flicker_figures.exposure_s"), _some_seconds),
        "exposure": _exposure,
        "picture": _array(or_kinds=(_PICTURE,)),
        "write_picture.picture": _array(or_kinds=(_PICTURE, "studies.metrics.compare:ReferencePicture")),
        "matrix": _array(or_kinds=("isp.colour.colour_fit:ColourFit",)),
        "balance": _array(or_kinds=("isp.colour.white_balance:WhiteBalance",)),
        **dict.fromkeys(("neutral", "wavelength_nm", "width_nm", "lines_nm"), _array()),
        "line_bands.width_nm": _range(0.01, 1e4, "give nanometres"),
        **dict.fromkeys(("origin", "target", "up"), _array(3)),
        "transforms": _each(_array(4, 4)),
        "pose": _array(4, 4),
        "range_nm": _array(2),
        **dict.fromkeys(("electrons", "expected_e"), _array(least=0.0)),
        "levels_cd_m2": lambda name, value: _array(least=1e-9)(name, value).ravel(),
        "values": _value("numpy:ndarray", "give an array (..., h, w)"),
        **dict.fromkeys(("render.size", "load_transport.size"), _size_or_side),
        **dict.fromkeys(("cfa", "tile"), lambda _, value: at("sensor.cfa:tile_of")(value)),
        "develop_file.path": _paths,
        "develop.calibration": _value(
            "sensor.calibration:ColourCalibration",
            "give calibrate(sensor, light), and a processor by its keyword: develop(raw, processor='ple')",
        ),
        "bsdf": _plain(dict, "a Mitsuba node such as rodcone.matte(...)"),
        "define": _plain(Mapping, "a dict of texts by name"),
        "where": _plain(Mapping, "a dict of values by axis"),
        "axes": _value("matplotlib.axes:Axes", "give axes of Matplotlib, or leave it out"),
        **dict.fromkeys(("more", "Picture.encode.white", "row"), _as_it_is),  # checked where they are used
    }
)
# Functions that check the result of a public function, and warn.
RESULTS = MappingProxyType(
    {
        "capture": ("sensor.exposure:warn_if_full", "sensor.exposure:warn_if_dark"),
        "expose": ("sensor.exposure:warn_if_full",),
    }
)


def check_of(name: str, parameter: str, hint: Any) -> Check:
    """Return the check of a function's parameter: that of `CHECKS` where it has one, else what its type says."""
    return CHECKS.get(f"{name}.{parameter}") or CHECKS.get(parameter) or _by_type(hint)


def _by_type(hint: Any) -> Check:  # noqa: PLR0911  one for each kind of type
    """Return the check that belongs to a type; raise `KeyError` for a type that has none."""
    origin = get_origin(hint)
    parts = [x for x in get_args(hint) if x is not NoneType]
    if origin is Annotated:
        return _range(*hint.__metadata__[0])
    if origin in (Union, UnionType):
        return _PATH if set(parts) == {str, Path} else _by_type(*parts)
    if origin is Literal:
        return _TEXT
    if origin is Sequence:
        return _each(_by_type(*parts))
    if hint in _OF_TYPE:
        return _OF_TYPE[hint]
    if origin is not None:  # Callable, Mapping, or NumPy's array, which isn't imported here
        return _OF_ORIGIN[origin.__name__]
    fix, by_name = KINDS[hint.__name__]
    return _value(hint, fix, by_name)


_OF_TYPE = {
    bool: _FLAG,
    int: _WHOLE,
    float: _NUMBER,
    str: _TEXT,
    tuple[int, int]: _size,
    Any: _as_it_is,
    object: _as_it_is,
}
_OF_ORIGIN = {"Callable": _CALL, "Mapping": _plain(Mapping, "a dict by light group"), "ndarray": _array()}


def door(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a public function that checks its arguments before it runs.

    Raises
    ------
    InputError
        At a call: for an argument of another kind.
    TypeError
        At a call: for too many or too few arguments.
    """
    call = signature(function)
    order = f"{name}({', '.join(call.parameters)})"

    @cache  # made at the first call, because the class of a method doesn't exist before
    def checks() -> dict[str, Check]:
        hints = get_type_hints(function, include_extras=True)
        return {parameter: check_of(name, parameter, hints.get(parameter, Any)) for parameter in call.parameters}

    @wraps(function)
    def checked(*arguments: object, **named: object) -> Any:
        try:
            bound = call.bind(*arguments, **named)
        except TypeError as error:
            raise TypeError(f"{name}: {error}; call it as {order}") from None
        given = {key: value for key, value in bound.arguments.items() if not _left_out(call.parameters[key], value)}
        for key, value in given.items():
            try:
                bound.arguments[key] = checks()[key](key, value)
            except InputError:
                for other, other_value in given.items():
                    if other != "self" and _passes(checks()[key], other_value) and _passes(checks()[other], value):
                        raise InputError(
                            f"{name}: {key} and {other} stand in each other's place; write {order}"
                        ) from None
                raise
        result = function(*bound.args, **bound.kwargs)
        for warning in RESULTS.get(name, ()):
            at(warning)(result)
        return result

    return checked


def method(function: F) -> F:
    """Check the arguments of a public value's method before it runs, as `door` does for functions."""
    return cast(F, door(function.__qualname__, function))


def _left_out(parameter: Parameter, value: object) -> bool:
    return value is None and parameter.default is None


def _passes(check: Check, value: object) -> bool:
    try:
        check("", value)
    except InputError:
        return False
    return True
