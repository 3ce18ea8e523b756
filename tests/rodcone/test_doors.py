"""The public names as a hasty caller finds them: one line for each wrong argument, and no silent nonsense."""

import re
import warnings
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import fields, replace
from functools import partial, wraps
from inspect import Parameter, getattr_static, isfunction, signature, unwrap
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

import rodcone as public
from render.loader import mitsuba_module
from rodcone.doors import door
from sensor.exposure import exposure_by_rule_s

NM = np.arange(385.0, 780.0, 10.0)
RADIANCE = public.SpectralRadiance(np.full((16, 16, 40), 1e-3), NM)
SENSOR, RNG = public.low_noise(), np.random.default_rng(0)
DEVICE = public.draw_device(SENSOR, (16, 16), RNG)
IRRADIANCE = public.form_image(RADIANCE, SENSOR)
TRANSPORT = public.render("flat_field", (4, 4), wavelength_nm=np.array([450.0, 550.0, 650.0]), spp=1)
RAW, RAW_BY_RULE = public.capture(RADIANCE, SENSOR, "10ms"), public.capture(RADIANCE)
# An argument of each name that is right, and what is no right argument of any.
RIGHT: dict[str, Any] = {
    "radiance": RADIANCE,
    "irradiance": IRRADIANCE,
    "sensor": "low_noise",
    "binned.sensor": public.low_noise("quad_bayer"),
    "way": "charge",
    "exposure_s": "10ms",
    "device": DEVICE,
    "rng": RNG,
    "shape": (16, 16),
    "raw": RAW,
    "finish.raw": public.capture(RADIANCE, public.low_noise("bayer"), "10ms"),
    "frames": [RAW, RAW],
    "light": "D65",
    "ratio": 10.0,
    "gain": 2.0,
    "iso": 400.0,
    "expected_e": np.ones((16, 16)),
    "electrons": np.ones(4),
    "linear": np.ones((4, 4, 3)),
    "picture": np.full((4, 4, 3), 0.5),
    "measure.picture": np.full((16, 16, 3), 0.5),
    "reference": public.reference_picture(RADIANCE),
    "planes": np.ones((16, 16, 3)),
    "matrix": np.eye(3),
    "balance": np.ones(3),
    "pixel": SENSOR.pixel,
    "with_channel_readings.readings": [public.ChannelReading("W", time_share=0.5)],
    "transports": [TRANSPORT, TRANSPORT],
    "count": 2,
    "readings": [public.Reading(1.5, 1.0, 1e4), public.Reading(1.5, 1.0, 1e4, time_share=0.1)],
    "name": "D65",
    "load.name": "flat_field",
    "preset.name": "low_noise",
    "reflectance": public.grey(0.5),
    "grey.reflectance": 0.5,
    "lines_nm": [589.0],
    "origin": (0, 0, 4),
    "target": (0, 0, 0),
    "tile": ("RG", "GB"),
    "channel": "G",
    "pose": np.eye(4),
    "width_m": 1.0,
    "height_m": 1.0,
    "bsdf": {"type": "diffuse"},
    "folder": "none",
    "transport": TRANSPORT,
    "scene": "flat_field",
    "size": (4, 4),
    "study": public.Study((public.SceneChoice("flat_field"),), ("1cd/m2",)),
    "order": public.Order("flat_field", "a.dng"),
    "cells": [],
    "workers": 1,
    "out": "none",
    "table": [],
    "levels_cd_m2": [1.0],
    "exposure": "10ms",
    "groups": list(TRANSPORT.groups),
    "waveform": "pwm@100Hz:0.5",
    "text": "fluorescent@100Hz",
    "prior": "drawn",
    "emission": {},
    "index": [0, 1, 2, 3],
    "values": np.ones((16, 16)),
    "dn": RAW.dn,
    "band_average.wavelength_nm": [550.0],
    "band_average.width_nm": [10.0],
}
NEVER: tuple[Any, ...] = (
    1j,
    b"x",
    object(),
    np.array([1j]),
    np.array([np.nan]),
    np.array([True]),
    np.ma.masked_array([0.5], mask=[True]),
    np.array(["a"]),
    [[1], [2, 3]],
)
WRONG: tuple[Any, ...] = (
    *NEVER,
    *(None, True, -1, 3.7, 10**400, float("nan"), float("inf"), "x", "", "a\nb", "a\0b.png", "1e9s", [], {}, (1, 2, 3)),
    *(np.empty(0), np.ones((2, 2)), int, len, Path("none.toml"), Path("none.exr")),
)
# Rendering or studies behind the door: what it lets through is checked with the commands.
SLOW = {
    *("characterise", "explore", "plan", "reference_plan", "relight_denoised", "render", "report", "run"),
    *("explorer_view", "run_in_processes", "score", "sweep", "take"),
}
# No file is there.
READING = {
    *("develop_file", "load_radiance", "load_scene_file", "load_transport", "read_raw", "read_rows", "read_study")
}
FUNCTIONS = {name: getattr(public, name) for name in public.__all__ if not isinstance(getattr(public, name), type)}


def arguments(name: str, function: Callable[..., Any], folder: Path) -> dict[str, Any]:
    given = {"path": folder / f"a{ {'write_raw': '.tif', 'write_exr': '.exr'}.get(name, '.png') }"}
    variable = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    named = {key: one for key, one in signature(function).parameters.items() if one.kind not in variable}
    needed = [key for key, one in named.items() if one.default is Parameter.empty]
    given |= {
        key: RIGHT.get(f"{name}.{key}", RIGHT.get(key)) for key in needed if key not in ("path", "options", "more")
    }
    return {key: given[key] for key in needed if key in given}


def said(call: Callable[[], Any], quiet: bool = True) -> str:
    """What is raised, as one line; nothing where the call goes through."""
    try:
        with warnings.catch_warnings() if quiet else nullcontext(), np.errstate(all="ignore"):
            if quiet:
                warnings.simplefilter("ignore")
            call()
    except public.InputError as error:
        return str(error)
    return ""


def with_wrong(function: Callable[..., Any], given: dict[str, Any], key: str, value: Any) -> str:
    if signature(function).parameters[key].kind is Parameter.VAR_POSITIONAL:
        return said(lambda: function(value))
    return said(lambda: function(**(given | {key: value})))


def faults_of(calls: Iterable[tuple[str, Any, Callable[[], str]]], never: tuple[Any, ...] = NEVER) -> str:
    """Of calls by what they are given: errors of Python's own, refusals of many lines, nonsense that goes through."""
    faults = []
    for name, value, call in calls:
        try:
            refused = call()
        except Exception as error:
            faults.append(f"{name}={value!r}: {type(error).__name__}: {error}"[:150])
        else:
            if not refused.isprintable() or (not refused and any(value is one for one in never)):
                faults.append(f"{name}={value!r}: {refused or 'goes through'}")
    return "\n".join(faults)


def check_function(name: str, folder: Path) -> None:
    """Every parameter of a public function, with each wrong value."""
    function = FUNCTIONS[name]
    if name in SLOW:
        function = door(name, wraps(unwrap(function))(lambda *_, **__: None))
    given = arguments(name, function, folder)
    assert name in READING or not said(lambda: function(*([np.eye(4)] if name == "to_world" else []), **given)), name
    parameters = signature(function).parameters.items()
    keys = [key for key, parameter in parameters if parameter.kind is not Parameter.VAR_KEYWORD]
    calls = (
        (f"{name}: {key}", value, partial(with_wrong, function, given, key, value)) for key in keys for value in WRONG
    )
    assert not (faults := faults_of(calls)), faults


@pytest.mark.parametrize("part", range(4))
def test_a_wrong_argument_is_refused_in_one_line_or_means_something(part: int, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in list(FUNCTIONS)[part::4]:
        check_function(name, tmp_path)


VALUES = (
    public.LightGroup(("sky",), public.illuminant("D65")),
    public.Order("flat_field", "a.dng"),
    SENSOR.pixel,
    RIGHT["readings"][0],
    RAW,
    RADIANCE,
    public.grey(0.5),
    public.load("flat_field"),
    public.SceneChoice("flat_field"),
    RIGHT["study"],
    public.Picture(np.ones((4, 4, 3)), {}),
)


def test_a_wrong_field_of_a_value_is_refused_in_one_line_or_means_something() -> None:
    calls = (
        (f"{type(value).__name__}: {field.name}", wrong, partial(said, partial(replace, value, **{field.name: wrong})))
        for value in VALUES
        for field in fields(value)
        for wrong in WRONG
    )
    assert not (faults := faults_of(calls)), faults


def methods_of(value: object) -> Iterable[tuple[str, Callable[..., Any]]]:
    names = (name for name in dir(type(value)) if not name.startswith("_"))
    return ((name, getattr(value, name)) for name in names if isfunction(getattr_static(type(value), name)))


def test_a_wrong_argument_of_a_method_is_refused_in_one_line_or_means_something() -> None:
    picture = public.develop(RAW)
    found = (*VALUES, SENSOR, DEVICE, IRRADIANCE, TRANSPORT, picture, public.calibrate("low_noise", "A"))
    by_class = {type(value).__name__: value for value in found}
    calls = [
        (f"{of}.{name}: {key}", wrong, partial(with_wrong, method, given, key, wrong))
        for of, value in by_class.items()
        for name, method in methods_of(value)
        for given in [arguments(name, method, Path())]
        for key in signature(method).parameters
        for wrong in WRONG
    ]
    assert len(calls) > 700
    arrays = tuple(one for one in NEVER if not isinstance(one, np.ndarray))  # a pixel's sum may be of any of them
    assert not (faults := faults_of(calls, never=arrays)), faults


def test_a_wrong_light_is_refused_in_one_line_or_is_the_power_of_all() -> None:
    wrong = (*WRONG, *({group: value} for group in TRANSPORT.groups for value in WRONG))
    for name in ("spectra", "powers"):
        calls = ((name, value, partial(said, partial(TRANSPORT.relight, **{name: value}))) for value in wrong)
        assert not (faults := faults_of(calls, never=(*NEVER, True))), faults


PICTURES = {
    "values over white": (np.full((2, 3, 3), 1.003), "UserWarning", "18 of 18 values"),
    "values under black": (np.array([[0.5, -0.1]]), "UserWarning", "1 of 2 values"),
    "what rounds to white": (np.full((2, 2), 1.000001), "", ""),
    "planes first": (np.ones((3, 4, 5)), "InputError", "shape (3, 4, 5)"),
    "four channels": (np.ones((4, 5, 4)), "InputError", "shape (4, 5, 4)"),
    "nothing": (np.ones((0, 5)), "InputError", "shape (0, 5)"),
    "bytes": (np.ones((4, 5, 3), np.uint8), "InputError", "values / 255"),
    "NaN": (np.full((2, 2), np.nan), "InputError", "4 of 4 values"),
    "complex": (np.full((2, 2), 0.5 + 1j), "InputError", "complex128"),
    "truth values": (np.full((2, 2), True), "InputError", "bool"),
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_written_picture_never_wraps(name: str, tmp_path: Path) -> None:
    values, raised, words = PICTURES[name]
    for path, bits in product((tmp_path / "a.png", tmp_path / "a.tif"), (8, 16)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            refused = said(partial(public.write_picture, values, path, bits), quiet=False)
        assert (refused != "") == (raised == "InputError")
        assert words in refused + "".join(str(one.message) for one in caught)
        assert bool(caught) == (raised == "UserWarning")
        if refused:
            continue
        most = 2**bits - 1
        wanted = np.rint(np.clip(values, 0, 1) * most)
        wanted = wanted if wanted.ndim == 3 else np.stack([wanted] * 3, axis=-1)
        np.testing.assert_array_equal(read(path), wanted)


def read(path: Path) -> np.ndarray:
    """Samples as programs that didn't write them read them; Pillow, for one, takes 8 of 16 bits."""
    return tifffile.imread(path) if path.suffix == ".tif" else np.array(mitsuba_module().Bitmap(str(path)))


def test_a_linear_picture_encodes_itself(tmp_path: Path) -> None:
    """Its 99th percentile comes to 90 % of white, or `white` to white; half of white is 188 (IEC 61966-2-1)."""
    rgb = np.full((10, 10, 3), 300.0)
    picture = public.Picture(rgb, {})
    public.write_picture(picture, tmp_path / "a.png")
    assert (read(tmp_path / "a.png") == round(255 * (1.055 * 0.9 ** (1 / 2.4) - 0.055))).all()
    public.write_picture(picture.encode(white=600.0), tmp_path / "b.png")
    assert (read(tmp_path / "b.png") == 188).all()
    assert (public.Picture(0 * rgb, {}).encode() == 0).all()


def test_a_frame_that_is_all_full_or_all_dark_is_told() -> None:
    """Of 256 pixels in the dark one may lie above its noise by chance; 20 s of 750 e-/s are the well's 15 000 e-."""
    for side, luminance_cd_m2, exposure, words in (
        (64, 25.0, 10, "saturated at 10 s; give less (a number is seconds"),
        (64, 1e-4, "1us", "no more than dark noise"),
        (16, 1e-4, "1us", "no more than dark noise"),
        (64, 25.0, "10ms", ""),
        (1, 25.0, "10ms", ""),
        (1, 1e-9, "20s", "dark current fills the well in 20 s"),
        (64, 0.0, 0, ""),
    ):
        values = np.full((side, side, 40), 1e-3 * luminance_cd_m2 / RADIANCE.luminance().mean())
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            sensor = public.low_noise("rgbw" if side > 1 else "mono")
            dark = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=0.0 if side > 1 else 750.0))
            public.capture(public.SpectralRadiance(values, NM), dark, exposure)
        assert [words in str(one.message) for one in caught] == [True] * bool(words)


def test_an_exposure_that_is_left_out_is_by_the_rule_of_the_demo() -> None:
    bright = public.SpectralRadiance(RADIANCE.values * np.float32(100 / RADIANCE.luminance().mean()), NM)
    image = public.form_image(bright, "low_noise")
    time_s = exposure_by_rule_s("auto:information", image, public.low_noise())
    assert public.auto_exposure_s(image, "low_noise") != time_s, "the two rules agree here"
    assert public.capture(bright).exposure_s == pytest.approx(time_s, rel=1e-6)  # `capture` adds bands before the lens


def test_names_stand_for_values_and_a_frame_for_its_picture() -> None:
    raw = public.capture(RADIANCE, "low_noise", "20ms")
    same = public.capture(RADIANCE, SENSOR, 0.02, light=public.illuminant("D65"))
    np.testing.assert_array_equal(raw.dn, same.dn)
    np.testing.assert_array_equal(raw.colour.neutral, public.calibrate("low_noise", "D65").neutral)
    np.testing.assert_array_equal(public.develop(public.capture(RADIANCE)).rgb, public.develop(RAW_BY_RULE).rgb)


def test_a_wrong_number_of_arguments_shows_the_right_call() -> None:
    rows: tuple[tuple[Callable[[], Any], str], ...] = (
        (public.capture, "capture: missing a required argument: 'radiance'; call it as capture(radiance, sensor"),
        (lambda: public.scenes(1), "scenes: too many positional arguments; call it as scenes()"),
        (lambda: public.write_raw(RAW, "a.dng", 8), "call it as write_raw(raw, path, frame)"),
        (lambda: public.capture(RADIANCE, time=1), "unexpected keyword argument 'time'"),
    )
    for call, words in rows:
        with pytest.raises(TypeError, match=re.escape(words)):
            call()


def test_arguments_in_each_others_place_are_told_so() -> None:
    for call, words in {
        (
            lambda: public.write_raw("a.dng", RAW)
        ): "raw and path stand in each other's place; write write_raw(raw, path, frame)",
        (lambda: public.write_exr("a.exr", RADIANCE)): "write write_exr(radiance, path, scene)",
        (lambda: public.write_picture("a.png", np.ones((2, 2)))): "write write_picture(picture, path",
        (lambda: public.capture("low_noise", RADIANCE)): "radiance and sensor stand in each other's place",
        (lambda: public.develop(RAW, "ple")): "a processor by its keyword: develop(raw, processor='ple')",
    }.items():
        assert words in said(call)
