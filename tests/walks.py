"""Walks: the calls through which one value passes on its way through the project, counted over a call trace.

A *stay* is a call that hands the value, or something made from it, to another module; each place of call counts once,
however often a loop comes by, and the first call of all counts. Fewer stays mean less leafing back and forth for a
reader who follows one value. What counts as made from the value:

- its fields, and elements of tuples, lists and dictionaries;
- what a function returns that was given any of these, and a dataclass that was built of them;
- every array that such a function holds besides its other parameters.

Lambdas and comprehensions are part of the function that they stand in. Properties and special methods count as fields:
what they call is no part of the walk. Run as a program, this module prints the walks of the process's engine as JSON.
"""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
_SPECS = {name: find_spec(name) for name in PACKAGES}
_FOLDERS = {Path(spec.submodule_search_locations[0]): name for name, spec in _SPECS.items() if spec is not None}
_LARGEST = 64  # elements of a container that are looked at
_DEEPEST = 4  # containers within containers
_PLAIN = (int, float, complex, str, bytes, type(None), type, np.generic)  # too small, and too often shared, to follow

# Where the call stands, `module:line`; the module and the function that it enters.
Stay = tuple[str, str, str]


def walk(run: Callable[[], Any], value: object) -> list[Stay]:
    """Stays of `value` while `run()` goes on, in the order of the first call."""
    tracer = _Tracer(value)
    before = sys.getprofile()
    sys.setprofile(tracer)
    try:
        run()
    finally:
        sys.setprofile(before)
    return list(dict.fromkeys(tracer.stays))


def visits(stays: list[Stay]) -> Counter[str]:
    """How often each module is entered."""
    return Counter(module for _, module, _ in stays)


class _Tracer:
    """Callback of `sys.setprofile`; objects are told apart by their ids, so every one that it follows is kept alive."""

    def __init__(self, value: object) -> None:
        self.stays: list[Stay] = []
        self._made: dict[int, object] = {}
        self._given: dict[int, set[int]] = {}  # frames that were given the value -> their other parameters
        self._closed: set[int] = set()  # frames of properties and special methods, and of all that they call
        self._properties = set(_property_codes())
        self._modules: dict[str, str | None] = {}
        self._follow(value)

    def __call__(self, frame: FrameType, event: str, result: object) -> None:
        if event == "call":
            self._call(frame)
        elif event == "return":
            self._closed.discard(id(frame))
            if self._given.pop(id(frame), None) is not None:
                self._follow(result)

    def _call(self, frame: FrameType) -> None:
        code = frame.f_code
        module = self._module(code)
        caller = self._project_frame(frame.f_back)
        if caller is not None and id(caller) in self._given:
            self._follow_arrays(caller)
        parameters = _parameters(frame)
        if code.co_filename == "<string>" and code.co_name == "__init__":  # of a dataclass
            if any(self._carries(one) for name, one in parameters.items() if name != "self"):
                self._made[id(parameters["self"])] = parameters["self"]
            return
        if module is None:
            return
        if caller is not None and id(caller) in self._closed:
            self._closed.add(id(frame))
            return
        if code.co_name.startswith("<"):
            if caller is not None and id(caller) in self._given:
                self._given[id(frame)] = set()
            return
        of_value = [one for one in parameters.values() if self._carries(one)]
        if code.co_name.startswith("__") or code in self._properties:
            self._closed.add(id(frame))
        if not of_value:
            return
        self._given[id(frame)] = {id(one) for one in parameters.values() if not self._carries(one)}
        for one in of_value:
            self._follow(one)
        home = None if caller is None else self._module(caller.f_code)
        if home != module and id(frame) not in self._closed:
            line = 0 if caller is None else caller.f_lineno
            self.stays.append((f"{home}:{line}", module, code.co_qualname))

    def _carries(self, value: object, depth: int = _DEEPEST) -> bool:
        return id(value) in self._made or (depth > 0 and any(self._carries(one, depth - 1) for one in _elements(value)))

    def _follow(self, value: object, depth: int = _DEEPEST) -> None:
        if id(value) in self._made or isinstance(value, _PLAIN) or callable(value):
            return
        self._made[id(value)] = value
        if depth:
            parts = (getattr(value, one.name) for one in fields(value)) if is_dataclass(value) else _elements(value)
            for part in parts:
                self._follow(part, depth - 1)

    def _follow_arrays(self, caller: FrameType) -> None:
        others = self._given[id(caller)]
        for value in list(caller.f_locals.values()):
            if id(value) not in others and (_is_array(value) or any(_is_array(one) for one in _elements(value))):
                self._follow(value)

    def _project_frame(self, frame: FrameType | None) -> FrameType | None:
        while frame is not None and self._module(frame.f_code) is None:
            frame = frame.f_back
        return frame

    def _module(self, code: CodeType) -> str | None:
        """Name of the project's module that code stands in, or None."""
        file = code.co_filename
        if file not in self._modules:
            path = Path(file)
            found = next(((folder, name) for folder, name in _FOLDERS.items() if folder in path.parents), None)
            parts = () if found is None else (found[1], *path.relative_to(found[0]).with_suffix("").parts)
            self._modules[file] = ".".join(parts) or None
        return self._modules[file]


def _elements(value: object) -> Iterator[object]:
    """Elements of a small container."""
    if isinstance(value, (tuple, list, dict)) and len(value) <= _LARGEST:
        yield from value.values() if isinstance(value, dict) else value


def _is_array(value: object) -> bool:
    return isinstance(value, np.ndarray) or type(value).__module__.startswith("drjit")


def _parameters(frame: FrameType) -> dict[str, object]:
    code = frame.f_code
    count = code.co_argcount + code.co_kwonlyargcount + bool(code.co_flags & 0x04) + bool(code.co_flags & 0x08)
    held = frame.f_locals
    return {name: held[name] for name in code.co_varnames[:count] if name in held}


def _property_codes() -> Iterator[CodeType]:
    """Code of every property, cached or not, of the project's classes that are imported so far."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in PACKAGES:
            for kind in vars(module).values():
                for member in vars(kind).values() if isinstance(kind, type) else ():
                    getter = getattr(member, "fget", None) or getattr(member, "func", None)
                    if hasattr(getter, "__code__"):
                        yield getter.__code__


def walk_of_raw() -> list[Stay]:
    """`raw` through `isp.interleaved.reconstruct`; kernels are compiled and tables made before."""
    from isp.interleaved import reconstruct
    from sensor.cfa import RGBW
    from sensor.raw import RawImage

    raw = RawImage(
        dn=np.random.default_rng(1).integers(64, 1000, (48, 64)).astype(np.uint16),
        cfa=RGBW,
        black_dn=64,
        white_dn=4095,
        gain_e_per_dn=1.0,
        read_noise_e=2.0,
        dsnu_e=1.0,
        prnu=0.01,
        exposure_s=0.01,
    )
    reconstruct(raw)
    return walk(lambda: reconstruct(raw), raw)


def walk_of_radiance() -> list[Stay]:
    """`radiance` through `sensor.capture.capture`, with a lens that spreads no light and with one that does."""
    from render.radiance import SpectralRadiance
    from sensor.capture import capture
    from sensor.device import draw_device
    from sensor.presets import low_noise

    nm = np.arange(385.0, 780.0, 10.0)
    radiance = SpectralRadiance(values=np.full((40, 48, nm.size), 0.05, np.float32), wavelength_nm=nm)
    plain = low_noise()
    spreading = replace(plain, lens=replace(plain.lens, diffraction=1.0, veiling_glare=0.01, horizontal_view_deg=30.0))
    device = draw_device(plain, radiance.shape, np.random.default_rng(0))
    stays: list[Stay] = []
    for sensor in (plain, spreading):

        def run(sensor: Any = sensor) -> object:
            return capture(radiance, sensor, 0.01, device, np.random.default_rng(1))

        run()
        stays += walk(run, radiance)
    return list(dict.fromkeys(stays))


if __name__ == "__main__":
    print(json.dumps({"raw": walk_of_raw(), "radiance": walk_of_radiance()}))
