"""Processors by name: those of the catalogue, and users' own from a Python file, ``mine.py:develop``, or a wheel.

A wheel holds weights (`isp.processors.network`), which are read as arrays. A Python file is code that may do all that
its user may do. Studies and `develop` therefore ask for consent before this module loads one. A worker of a sweep loads
a file only if its bytes are those with which the sweep began.
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

MOST_BYTES = 1 << 20  # largest file that is read; a processor has a few thousand bytes
_NAME = re.compile(r"(.+\.(?:py|whl)):([A-Za-z_]\w*)")
_RENAMED = {"bayer_fair": "bayer_bilinear", "kriging": "ple or any_mosaic"}  # other old names resemble their new ones


def user_file(name: str) -> tuple[Path, str] | None:
    """Split a name such as ``mine.py:develop`` or ``FILE.whl:bayer_net`` into file and function; None for others."""
    match = _NAME.fullmatch(name)
    return None if match is None else (Path(match[1]), match[2])


def require_consent(what: str, name: str, trust_code: bool) -> None:
    """Raise `InputError` for an unknown processor, or for a user's own without consent to run it."""
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
    """Return the file name of a user's own processor with the hash of its bytes; empty for one of the catalogue.

    Raises
    ------
    InputError
        For a file that can't be read.
    """
    user_code = user_file(name)
    return {} if user_code is None else {user_code[0].name: digest_bytes(_read(user_code[0]))}


def processor_of(name: str, expected: Mapping[str, str] | None = None) -> Processor:
    """Return a processor by name; a user's own is loaded from its file.

    Parameters
    ----------
    name : str
        A name in `NAMED`; ``FILE.py:NAME``, where NAME is a function ``develop(raw, matrix, *, balance)`` that returns
        a `Picture` or linear sRGB (h, w, 3), or a `Processor`; or ``FILE.whl:bayer_net``
        (`isp.processors.network.network_processor`). A function develops the sensor's own mosaic; a `Processor` may
        state another. Imports in the file are not looked for in its folder.
    expected : mapping of str to str, optional
        Required `own_version` of the file. A file with other bytes is refused before it runs.

    Raises
    ------
    InputError
        For a file that can't be read, isn't the expected one, fails, or holds no such function.
    """
    user_code = user_file(name)
    if user_code is None:
        return NAMED[name]
    path, attribute = user_code
    content = _read(path)
    file_version = {path.name: digest_bytes(content)}
    if expected is not None and expected.get(path.name) != file_version[path.name]:
        raise InputError(
            f"processors: {str(path)!r} on {platform.node()} isn't the file that the sweep began with; allowed: the "
            "same bytes; run rodcone sweep again, or give the workers the same file"
        )
    if path.suffix == ".whl":
        fix = "allowed: the wheel of demosaicnet with :bayer_net or :bayer_net_bm3d; pip download --no-deps demosaicnet"
        with read_errors(f"processors: {str(path)!r} can't be used", fix):
            return replace(network.network_processor(attribute, content), file_version=file_version)
    value = getattr(_module(path, content), attribute, None)
    processor = value if isinstance(value, Processor) else Processor(OWN, value, path.name, colours=(), unit="")  # type: ignore[arg-type]
    if not callable(processor.picture) or isinstance(value, type):
        raise InputError(
            f"processors: {path} has no function {attribute!r}; allowed: def {attribute}(raw, matrix, *, balance), or "
            f"a Processor of that name; name what the file defines"
        )

    def picture(raw: RawImage, colours: object, **options: object) -> Picture:
        return _checked(name, raw, _run(path, processor.picture, raw, colours, **options))

    return replace(processor, picture=picture, file_version=file_version)


def _read(path: Path) -> bytes:
    allowed = "FILE.py:FUNCTION, or a wheel that pip download --no-deps demosaicnet fetched"
    with read_errors(f"processors: {str(path)!r} can't be read", f"allowed: {allowed}; correct the path"):
        return read_bounded(path, network.MOST_BYTES if path.suffix == ".whl" else MOST_BYTES)


@cache
def _module(path: Path, content: bytes) -> ModuleType:
    """Execute a file's bytes as a module, once for each content; its output isn't redirected."""
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
    """Describe an error in a user's file, with the last line of that file that was running."""
    line = getattr(error, "lineno", None)
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    where = f" at line {line}" if line else ""
    return f"{path} fails{where} ({type(error).__name__}: {one_line(error)}); mend it there"


def _checked(name: str, raw: RawImage, output: Any) -> Picture:
    """Convert the result of a user's function to a `Picture`, or raise `InputError` if that isn't possible."""
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
