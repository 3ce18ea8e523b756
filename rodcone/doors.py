"""What stands before a public function: names become the values they stand for, and each argument's kind is checked.

`rodcone.capture` is a function of the packages with these checks before it; the packages themselves trust what they are
given. One table says what a parameter may be, whichever function it belongs to. Like the table of public names it
points up by strings, which are imported when they are needed.
"""

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter, signature
from math import inf
from numbers import Integral
from os import PathLike
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, TypeVar, cast

from rodcone.errors import InputError, require_kind, require_range
from rodcone.time_text import parse_time

F = TypeVar("F", bound=Callable[..., Any])
PACKAGES = ("render", "scenes", "sensor", "isp", "studies")
Check = Callable[[str, Any], Any]  # takes the argument's name and value, gives what the function is called with


def at(place: str) -> Any:
    """Object at ``module:name``."""
    module, _, name = place.partition(":")
    return getattr(imported(module), name)


def require_no_shadow() -> None:
    """Raise `ImportError` in one line that names the file, where a file beside the user's script has a package's name.

    Python finds a script `render.py` before the package `render`. Where another distribution's package stands in its
    place, `rodcone doctor` says so.
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
    """Import a module; where a file of the user's has the name of a package of ours, name the file."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        file = getattr(sys.modules.get(package), "__file__", None)
        if "." not in str(error.name) or file is None or Path(file).name == "__init__.py":
            raise
        raise ImportError(_shadow_words(file, package)) from None


def _value(kind: str, fix: str, by_name: str = "") -> Check:
    """Check for an object of the class at ``module:name``; the function at `by_name` makes one of a name or path."""

    def check(name: str, value: Any) -> Any:
        if by_name and isinstance(value, str | Path):
            return at(by_name)(str(value))
        require_kind(name, value, at(kind), fix)
        return value

    return check


def _range(low: float, high: float, fix: str) -> Check:
    """Check for a number within limits."""

    def check(name: str, value: Any) -> Any:
        require_range(name, value, low, high, fix)
        return value

    return check


def _plain(kind: Any, words: str) -> Check:
    """Check for an object of one of Python's own classes; True and False are no numbers."""

    def check(name: str, value: Any) -> Any:
        wrong = not isinstance(value, kind) or (kind is Integral and isinstance(value, bool))
        if wrong or value == "" or (isinstance(value, str | PathLike) and "\0" in str(value)):
            raise InputError(f"{name}: {_shown(value)} is not allowed; give {words}")
        return value

    return check


def _seconds(name: str, value: Any) -> Any:
    time_s = parse_time(value, name) if isinstance(value, str) else value
    require_range(name, time_s, 0.0, 1e7, "give seconds, or a time such as '20ms'")
    return time_s


def _some_seconds(name: str, value: Any) -> Any:
    time_s = _seconds(name, value)
    require_range(name, time_s, 1e-9, 1e7, "give a time above 0, such as '33ms'")
    return time_s


def _exposure(name: str, value: Any) -> Any:
    return value if isinstance(value, str) and value in at("sensor.exposure:RULES") else _seconds(name, value)


def _array(*shape: int, or_kind: str = "", least: float = -inf) -> Check:
    """Check for an array of finite real numbers from `least` on, of a shape where one is given; or for an `or_kind`."""

    def check(name: str, value: Any) -> Any:
        import numpy as np

        if or_kind and isinstance(value, at(or_kind)):
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


def _spectra(name: str, value: Any) -> Any:
    """Lamps by light group, or one in place of all lights."""
    if isinstance(value, Mapping):
        return value
    return _value("render.spectrum:Spectrum", "give a dict by light group, or an illuminant", _ILLUMINANT)(name, value)


def _size(name: str, value: Any) -> Any:
    sides = list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping) else []
    if len(sides) != 2 or not all(_passes(_WHOLE, x) and x > 0 for x in sides):
        raise InputError(f"{name}: {_shown(value)} is not allowed; give (height, width) in pixels")
    return int(sides[0]), int(sides[1])


def _size_or_side(name: str, value: Any) -> Any:
    """Height and width, or the longer side."""
    return int(value) if _passes(_WHOLE, value) and value > 0 else _size(name, value)


def _paths(name: str, value: Any) -> Any:
    return [_PATH(name, one) for one in (value if isinstance(value, list | tuple) else [value])]


def _each(kind: Check, least: int = 0) -> Check:
    """Check for a sequence, at least so long, of which `kind` takes each."""

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) < least:
            raise InputError(f"{name}: {_shown(value)} is not allowed; give a list{' of one or more' * least}")
        return [kind(f"{name}[{place}]", one) for place, one in enumerate(value)]

    return check


def _shown(value: Any) -> str:
    """A value as an error names it: itself where that is short, its class elsewhere."""
    text = repr(value) if isinstance(value, str | bytes | int | float | complex | tuple | list) else ""
    return text if 0 < len(text) <= 80 else f"a {type(value).__name__}"


_ILLUMINANT, _WAVEFORM = "render.illuminants:illuminant", "sensor.flicker.waveform:waveform"
_WHOLE, _NUMBER = _plain(Integral, "a whole number"), _range(-1e12, 1e12, "give a number")
_METRES = _range(1e-9, 1e9, "give metres")
_TEXT, _FLAG = _plain(str, "text in quotes"), _plain(bool, "True or False")
_PATH, _CALL = _plain((str, PathLike), "a path in quotes"), _plain(Callable, "a function")
_RAW = _value("sensor.raw:RawImage", "give what capture or read_raw gives")

# By the parameter's name, or the function's and the parameter's where it means something else there. What may be left
# out may be None.
CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "radiance": _value("render.radiance:SpectralRadiance", "give SpectralRadiance(...), or call its relight()"),
        "irradiance": _value("sensor.optics:SpectralIrradiance", "give form_image(radiance, sensor)"),
        "transport": _value("render.transport:Transport", "give rodcone.render(...)"),
        "resume": _value("render.transport:Transport", "give what render gave before"),
        "scene": _value("render.scene:Scene", "give rodcone.load(name), or the name alone", "scenes.catalogue:load"),
        "sensor": _value("sensor.config:SensorConfig", "give a preset's name or file", "sensor.presets:preset"),
        "with_channel_readings.readings": _each(
            _value("sensor.pixel:ChannelReading", "give rodcone.ChannelReading(...)")
        ),
        "readings": _each(_value("sensor.pixel:Reading", "give rodcone.Reading(...)"), least=1),
        "device": _value("sensor.device:Device", "give draw_device(sensor, radiance.shape, rng)"),
        "rng": _value("numpy.random:Generator", "give numpy.random.default_rng(1)"),
        "light": _value("render.spectrum:Spectrum", "give rodcone.illuminant(name)", _ILLUMINANT),
        **dict.fromkeys(("light_for_snr.exposure_s", "score.exposure_s"), _some_seconds),
        **dict.fromkeys(
            ("flicker", "flicker_figures.waveform"),
            _value("sensor.flicker.waveform:Waveform", "give a text such as 'fluorescent@100Hz'", _WAVEFORM),
        ),
        "flicker_figures.exposure_s": _some_seconds,
        "only": _each(_TEXT),
        **dict.fromkeys(
            (
                "load_radiance.light",
                "load_radiance.spectra",
                "load_transport.light",
                "light_for_snr.light",
                "score.light",
                "expect.light",
            ),
            _TEXT,
        ),
        "reflectance": _value("render.spectrum:Spectrum", "give rodcone.grey(0.5) or rodcone.Spectrum(...)"),
        "grey.reflectance": _range(0.0, 1.0, "give a share of the light"),
        "raw": _RAW,
        "frames": _each(_RAW, least=1),
        "calibration": _value("sensor.calibration:ColourCalibration", "give calibrate(sensor, light)"),
        "picture": _array(or_kind="isp.picture:Picture"),
        "matrix": _array(or_kind="isp.colour.colour_fit:ColourFit"),
        "balance": _array(or_kind="isp.colour.white_balance:WhiteBalance"),
        "reference": _value("studies.metrics.compare:ReferencePicture", "give rodcone.reference_picture(radiance)"),
        "order": _value("studies.photograph.shot:Order", "give rodcone.Order(...)"),
        "study": _value("studies.study.study:Study", "give a study's file", "studies.study.study_file:read_study"),
        "plan": _value("studies.budget.ledger:Plan", "give rodcone.plan(study)"),
        "clock": _value("studies.photograph.clock:Clock", "leave it out"),
        **dict.fromkeys(("origin", "target", "up"), _array(3)),
        "transforms": _each(_array(4, 4)),
        "pose": _array(4, 4),
        "range_nm": _array(2),
        **dict.fromkeys(("linear", "planes", "neutral", "noise_gain"), _array()),
        **dict.fromkeys(("wavelength_nm", "width_nm", "lines_nm"), _array()),
        **dict.fromkeys(("width_m", "height_m"), _METRES),
        "line_bands.width_nm": _range(0.01, 1e4, "give nanometres"),
        "ratio": _range(1e-6, 1e6, "give signal over noise"),
        **dict.fromkeys(("ev", "noise", "max_seconds", "longest_s", "percentile", "well_share"), _NUMBER),
        "tolerance": _NUMBER,
        "gain": _range(1.0, 1024.0, "give a factor, 1 where a full well reads the converter's top"),
        "iso": _range(1e-3, 1e9, "give a speed, such as 400"),
        **dict.fromkeys(("electrons", "expected_e"), _array(least=0.0)),
        "levels_cd_m2": lambda name, value: _array(least=1e-9)(name, value).ravel(),
        "exposure": _exposure,
        "exposure_s": _seconds,
        **dict.fromkeys(("spp", "max_spp", "max_depth", "seed", "samples_per_pixel", "bits", "height"), _WHOLE),
        **dict.fromkeys(("width", "workers", "pictures", "frame"), _WHOLE),
        **dict.fromkeys(("render.size", "load_transport.size"), _size_or_side),
        **dict.fromkeys(("size", "shape"), _size),
        **dict.fromkeys(("cfa", "tile"), lambda _, value: at("sensor.cfa:tile_of")(value)),
        **dict.fromkeys(
            ("name", "encoding", "channel", "isp", "readout", "way", "shake", "prior", "view", "text"), _TEXT
        ),
        **dict.fromkeys(("white_balance", "extend", "engine", "processor", "write_exr.scene"), _TEXT),
        **dict.fromkeys(("exact", "denoise", "trust", "trust_code", "everything", "blur"), _FLAG),
        **dict.fromkeys(("path", "cache", "out", "folder", "preset.name"), _PATH),
        **dict.fromkeys(("progress", "step", "runner", "make"), _CALL),
        "develop_file.path": _paths,
        "read_study.changes": _each(_TEXT),
        "cells": _each(_value("studies.sweep.cells:Cell", "give what sweep gives its runner")),
        "spectra": _spectra,
        "powers": _plain(Mapping, "a dict by light group"),
        **dict.fromkeys(("luminance_cd_m2", "illuminance_lux", "lux"), _NUMBER),
        "bsdf": _plain(dict, "a Mitsuba node such as rodcone.matte(...)"),
        **dict.fromkeys(("self", "options", "more", "controls"), lambda _, value: value),
        **dict.fromkeys(("Picture.encode.white", "row"), lambda _, value: value),  # checked where they are used
        "axes": _value("matplotlib.axes:Axes", "give axes of Matplotlib, or leave it out"),
        "emission": _plain(Mapping, "a dict by light group"),
        "define": _plain(Mapping, "a dict of texts by name"),
        "index": _each(_WHOLE),
        "values": _value("numpy:ndarray", "give an array (..., h, w)"),
    }
)
# Functions that look at the result, and warn.
RESULTS = MappingProxyType(
    {
        "capture": ("sensor.exposure:warn_if_full", "sensor.exposure:warn_if_dark"),
        "expose": ("sensor.exposure:warn_if_full",),
    }
)


def door(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A public function with the checks of its arguments before it.

    Raises
    ------
    InputError
        At a call: for an argument of another kind.
    TypeError
        At a call: for too many or too few arguments.
    """
    call = signature(function)
    checks = {parameter: CHECKS.get(f"{name}.{parameter}") or CHECKS[parameter] for parameter in call.parameters}
    order = f"{name}({', '.join(call.parameters)})"

    @wraps(function)
    def checked(*arguments: Any, **named: Any) -> Any:
        try:
            bound = call.bind(*arguments, **named)
        except TypeError as error:
            raise TypeError(f"{name}: {error}; call it as {order}") from None
        given = {key: value for key, value in bound.arguments.items() if not _left_out(call.parameters[key], value)}
        for key, value in given.items():
            try:
                bound.arguments[key] = checks[key](key, value)
            except InputError:
                for other, its in given.items():
                    if other != "self" and _passes(checks[key], its) and _passes(checks[other], value):
                        raise InputError(
                            f"{name}: {key} and {other} stand in each other's place; write {order}"
                        ) from None
                raise
        result = function(*bound.args, **bound.kwargs)
        for place in RESULTS.get(name, ()):
            at(place)(result)
        return result

    return checked


def method(function: F) -> F:
    """A method of a public value with the checks of its arguments before it, as `door` has them."""
    return cast(F, door(function.__qualname__, function))


def _left_out(parameter: Parameter, value: Any) -> bool:
    return value is None and parameter.default is None


def _passes(check: Check, value: Any) -> bool:
    try:
        check("", value)
    except InputError:
        return False
    return True
