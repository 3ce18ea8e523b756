"""Processors by name: of the catalogue, from a Python file of the user's own, ``mine.py:develop``, or from a wheel.

A wheel holds weights (`isp.processors.network`), read as arrays. A Python file is code that runs with all that its user
may do. The doors (studies, `develop`) ask for consent before anything here loads one; a worker of a sweep loads a file
only where its bytes are those that the sweep began with.
"""

import platform
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from isp.picture import Picture
from isp.processors import network
from isp.processors.catalogue import NAMED, PROCESSORS, Processor
from rodcone.digests import digest_bytes
from rodcone.errors import InputError, one_line, read_errors, unknown
from rodcone.files import read_bounded
from sensor.cfa import OWN
from sensor.raw import RawImage

MOST_BYTES = 1 << 20  # of a file; a processor takes some thousand
_NAME = re.compile(r"(.+\.(?:py|whl)):([A-Za-z_]\w*)")
_RENAMED = {"bayer_fair": "bayer_bilinear", "kriging": "ple or any_mosaic"}  # others resemble their new names


def user_file(name: str) -> tuple[Path, str] | None:
    """File and function of a name such as ``mine.py:develop`` or ``FILE.whl:bayer_net``; None for any other name."""
    match = _NAME.fullmatch(name)
    return None if match is None else (Path(match[1]), match[2])


def require_consent(what: str, name: str, trust_code: bool) -> None:
    """Raise `InputError` for an unknown processor, or one of the user's own without consent to run it."""
    user_code = user_file(name)
    if user_code is None and name in _RENAMED:
        raise InputError(
            f"{what}: {name!r} of rodcone 0.1.0 is gone; allowed: rodcone list processors; use {_RENAMED[name]}"
        )
    if user_code is None and name.endswith((".py", ".whl")):
        function = "develop" if name.endswith(".py") else network.NAMES[0]
        raise InputError(f"{what}: {name!r} names no function; allowed: FILE:NAME; write {name}:{function}")
    if user_code is None and name not in NAMED:
        raise unknown(what, name, PROCESSORS)
    if user_code is not None and user_code[0].suffix == ".py" and not trust_code:
        raise InputError(
            f"{what}: {name!r} is Python code, which may do all that you may; allowed with consent: read "
            f"{user_code[0]}, then add --trust-code (in Python trust_code=True)"
        )


def own_version(name: str) -> dict[str, str]:
    """File of a user's own processor, with the hash of its bytes; nothing for one of the catalogue.

    Raises
    ------
    InputError
        For a file that can't be read.
    """
    user_code = user_file(name)
    return {} if user_code is None else {user_code[0].name: digest_bytes(_read(user_code[0]))}


def processor_of(name: str, expected: Mapping[str, str] | None = None) -> Processor:
    """Processor by name.

    Parameters
    ----------
    name : str
        Of `NAMED`, or ``FILE.py:NAME`` with a function ``develop(raw, matrix, *, balance)`` that gives a `Picture`
        or linear sRGB (h, w, 3), or with a `Processor`, which states more. A function develops the sensor's own mosaic.
        Or ``FILE.whl:bayer_net``, as `isp.processors.network.network_processor`.
        The file's folder is not searched for what it imports.
    expected : mapping of str to str, optional
        `own_version` that the file has to have; other bytes are refused before they run.

    Raises
    ------
    InputError
        For a file that can't be read, is another than expected, fails, or holds no such function.
    """
    user_code = user_file(name)
    if user_code is None:
        return NAMED[name]
    path, attribute = user_code
    content = _read(path)
    if expected is not None and expected.get(path.name) != digest_bytes(content):
        raise InputError(
            f"processors: {str(path)!r} on {platform.node()} isn't the file that the sweep began with; allowed: the "
            "same bytes; run rodcone sweep again, or give the workers the same file"
        )
    if path.suffix == ".whl":
        fix = "allowed: the wheel of demosaicnet with :bayer_net or :bayer_net_bm3d; pip download --no-deps demosaicnet"
        with read_errors(f"processors: {str(path)!r} can't be used", fix):
            return network.network_processor(attribute, content)
    value = getattr(_module(path, content), attribute, None)
    processor = value if isinstance(value, Processor) else Processor(OWN, value, path.name, colours=(), unit="")  # type: ignore[arg-type]
    if not callable(processor.picture) or isinstance(value, type):
        raise InputError(
            f"processors: {path} has no function {attribute!r}; allowed: def {attribute}(raw, matrix, *, balance), or "
            f"a Processor of that name; name what the file defines"
        )

    def picture(raw: RawImage, colours: Any, **options: Any) -> Picture:
        return _checked(name, raw, _run(path, processor.picture, raw, colours, **options))

    return replace(processor, picture=picture)


def _read(path: Path) -> bytes:
    allowed = "FILE.py:FUNCTION, or a wheel that pip download --no-deps demosaicnet fetched"
    with read_errors(f"processors: {str(path)!r} can't be read", f"allowed: {allowed}; correct the path"):
        return read_bounded(path, network.MOST_BYTES if path.suffix == ".whl" else MOST_BYTES)


@cache
def _module(path: Path, content: bytes) -> ModuleType:
    """Module made of a file's bytes, once for each content; what it prints or warns goes where it sends it."""
    module = ModuleType(f"own_{path.stem}_{digest_bytes(content)}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses look their module up by its name
    try:
        exec(compile(content, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        raise InputError(f"processors: {_failure(path, error)}") from error
    return module


def _run(path: Path, function: Any, raw: RawImage, colours: Any, **options: Any) -> Any:
    try:
        return function(raw, colours, **options)
    except (Exception, SystemExit) as error:
        failure = f"{_failure(path, error)}; it was given a mosaic of {'/'.join(raw.cfa)}"
        raise InputError(f"processors: {failure}") from error


def _failure(path: Path, error: BaseException) -> str:
    """Words for an error in a user's file, with the last line of that file that was running."""
    line = getattr(error, "lineno", None)
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    where = f" at line {line}" if line else ""
    return f"{path} fails{where} ({type(error).__name__}: {one_line(error)}); mend it there"


def _checked(name: str, raw: RawImage, output: Any) -> Picture:
    """Picture of what a user's function gave, or `InputError` where that is none."""
    picture = output if isinstance(output, Picture) else None
    try:
        rgb = np.asarray(output.rgb if picture is not None else output, dtype=np.float64)
    except (TypeError, ValueError):
        rgb = np.empty(0)
    if rgb.shape != (*raw.shape, 3) or not np.isfinite(rgb).all():
        raise InputError(
            f"processors: {name!r} gave {type(output).__name__} of shape {rgb.shape}; allowed: a Picture, or finite "
            f"linear sRGB of shape {(*raw.shape, 3)}; return that"
        )
    return picture or Picture(rgb, {})
