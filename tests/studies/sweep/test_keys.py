"""Whatever a frame, a picture or a stream of noise depends on is in its key: each input changed alone changes it."""

import hashlib
import json
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE

from isp.processors.catalogue import PROCESSORS
from render.illuminants import illuminant
from rodcone.digests import digest, digest_inputs
from sensor.exposure import auto_exposure_s
from sensor.flicker.waveform import Waveform
from sensor.lens.table import terms_of
from sensor.optics import form_image
from sensor.presets import low_noise, preset, preset_file
from sensor.response import expected_electrons
from studies.dataset import sample as sample_module
from studies.metrics.truth import light_in_bands, shown_white_cd_m2
from studies.photograph.camera import colour_fit
from studies.study.lit_scene import open_all, under
from studies.study.model import LensTerms
from studies.study.render_facts import RenderFacts, render_facts
from studies.study.study import Condition, RenderLimits, SceneChoice
from studies.sweep import frames as frames_module
from studies.sweep import prepare as prepare_module
from studies.sweep.cells import (
    RenderRecord,
    cell_keys,
    device_stream,
    exposure_stream,
    flicker_stream,
    labels,
    render_text,
    shake_stream,
)
from studies.sweep.database import open_results
from studies.sweep.frames import frame_key, load_frame
from studies.sweep.prepare import FRAMES, Job, scene_cells

CONDITION = Condition(SceneChoice("still_life"), "D65", "25cd/m2", "10ms", "low_noise")


def test_a_frames_key_changes_with_each_of_its_inputs_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with the content of a lamp's file, which keeps its name, and with the lamp's own name for an illuminant."""
    lamp = tmp_path / "lamp.csv"
    lamp.write_text("wavelength_nm,value\n380,1\n780,1\n")
    study, sensor = SAMPLE.small_study(tmp_path), low_noise()

    def key(**changes: Any) -> str:
        inputs = {"render": "a", "identity": "b", "spectrum": str(lamp), "study": study, "preset": sensor}
        inputs |= {"sensor": sensor} | changes
        opened = SimpleNamespace(identity=inputs.pop("identity"))
        return frame_key(inputs.pop("render"), opened, **inputs)  # type: ignore[arg-type]

    first = key()
    assert key() == first
    dim = replace(sensor, pixel=replace(sensor.pixel, fill_factor=0.5))
    found = [first, key(render="c"), key(identity="d"), key(spectrum="D65"), key(spectrum="A"), key(preset=dim)]
    found += [key(sensor=dim), key(study=replace(study, levels=("10lux",)))]
    found += [key(study=replace(study, sensor_side_um=side_um)) for side_um in (40.0, 50.0)]
    lamp.write_text("wavelength_nm,value\n380,1\n780,2\n")
    found.append(key())
    monkeypatch.setattr(frames_module, "versions", lambda: "another version")
    found.append(key())
    assert len(set(found)) == len(found)


def test_the_request_for_a_render_changes_with_each_of_its_inputs_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a render that is noted for a request nothing is made anew, whatever limits the study asks for now."""

    def request(identity: str = "a", model: str = "b", limits: RenderLimits | None = None, samples: int = 1) -> str:
        study = SimpleNamespace(render=limits or RenderLimits())
        job: Any = SimpleNamespace(plan=SimpleNamespace(renders={"scene": model}, samples_a_side=lambda _: samples))
        job.study = study
        opened: Any = SimpleNamespace(identity=identity, choice="scene")
        return prepare_module._request(job, opened)

    found = [request(), request("c"), request(model="c"), request(limits=RenderLimits(spp=17)), request(samples=2)]
    for name in ("backend", "versions"):
        monkeypatch.setattr(prepare_module, name, lambda: "another")
        found.append(request())
    assert len(set(found)) == len(found)


def test_a_frames_key_changes_with_a_lens_s_files_alone(tmp_path: Path) -> None:
    """Of a lens that the study names, and of one that a sensor's file does; a shipped one's is in the version."""
    table, spread, own = (tmp_path / name for name in ("mine.toml", "mine.csv", "camera.toml"))
    table.write_text('f_number = 4.0\nfield = [0.0, 1.0]\npoint_spread = "mine.csv"\n')
    spread.write_text("field,wavelength_nm,Z4\n0,550,10\n1,550,20\n")
    text = preset_file("low_noise").read_text("utf-8")
    own.write_text(text[: text.index("[lens]")] + '[lens]\ntable = "mine.toml"\n')
    study = SAMPLE.small_study(tmp_path)

    def keys() -> list[str]:
        terms, opened = LensTerms(table=str(table)), SimpleNamespace(identity="b")
        cameras = (terms.behind(low_noise()), replace(low_noise(), lens=terms.on(low_noise().lens)), preset(own))
        assert {camera.lens.f_number for camera in cameras} == {4.0}
        return [frame_key("a", opened, "D65", study, camera, camera) for camera in cameras]  # type: ignore[arg-type]

    found = [keys()]
    assert keys() == found[0]
    spread.write_text("field,wavelength_nm,Z4\n0,550,10\n1,550,21\n")
    found.append(keys())
    table.write_text(table.read_text() + "relative_illumination = [1.0, 0.9]\n")
    found.append(keys())
    for of_one_camera in zip(*found, strict=True):
        assert len(set(of_one_camera)) == 3
    assert terms_of("cooke_triplet")["table_digest"] == ""


def test_every_field_of_a_sensor_is_in_a_frames_key(tmp_path: Path) -> None:
    study, sensor = SAMPLE.small_study(tmp_path), low_noise()
    opened: Any = SimpleNamespace(identity="b")
    keys = {frame_key("a", opened, "D65", study, sensor, sensor)}
    changed = [
        replace(sensor, pixel=replace(sensor.pixel, **{x.name: getattr(sensor.pixel, x.name) * 0.5 + 1e-3}))
        for x in fields(sensor.pixel)
        if isinstance(getattr(sensor.pixel, x.name), float) and x.name != "binned_well_e"
    ]
    changed += [
        replace(sensor, lens=replace(sensor.lens, **{x.name: getattr(sensor.lens, x.name) * 0.5 + 1e-3}))
        for x in fields(sensor.lens)
        if isinstance(getattr(sensor.lens, x.name), float)
    ]
    changed += [replace(sensor, bits=10), low_noise("bayer"), preset("white_apart"), preset("dual_gain")]
    keys |= {frame_key("a", opened, "D65", study, x, x) for x in changed}
    assert len(changed) > 15
    assert len(keys) == 1 + len(changed)


def test_a_cells_key_changes_with_each_of_its_inputs_alone() -> None:
    inputs: dict[str, Any] = {
        "condition": CONDITION, "processor": "ple", "seeds": (0,), "frame": "f", "luminance_cd_m2": 1.0,
        "exposure_s": 0.01, "made_by": "m",
    }  # fmt: skip
    other = {
        "condition": replace(CONDITION, white_balance="gray-world"), "processor": "bayer", "seeds": (1,), "frame": "g",
        "luminance_cd_m2": 2.0, "exposure_s": 0.02, "made_by": "n",
    }  # fmt: skip
    keys = {*cell_keys(**inputs)}.union(*(cell_keys(**inputs | {name: value}) for name, value in other.items()))
    keys = keys.union(*(cell_keys(**inputs, flicker=lamp) for lamp in (Waveform(100.0, 0.5), Waveform(120.0, 0.5))))
    assert len(keys) == 3 + len(other)


def test_keys_are_digests_of_all_inputs_with_each_seed() -> None:
    named = [labels(CONDITION), "ple"]
    made_from = ["f", 0.1 + 0.2, 0.01, {"numpy": "2"}]
    keys = cell_keys(CONDITION, "ple", (3, 5), *made_from)  # type: ignore[arg-type]
    assert keys == [digest_inputs([*named, seed, *made_from]) for seed in (3, 5)]


def test_a_stream_of_noise_has_a_draw_of_its_own_for_each_of_its_coordinates() -> None:
    """A chip belongs to sensor, mosaic and seed, an exposure to its place in the study, a hand to its seed."""
    chips = [("low_noise", "bayer", 0), ("low_noise", "bayer", 1), ("low_noise", "rgbw", 0), ("dual_gain", "bayer", 0)]
    conditions = [CONDITION] + [
        replace(CONDITION, **change)
        for change in (
            {"scene": SceneChoice("night_street")}, {"spectrum": "A"}, {"level": "5cd/m2"}, {"level": "25lux"},
            {"exposure": "20ms"}, {"sensor": "dual_gain"},
        )
    ]  # fmt: skip
    exposures = [(condition, "bayer", 0) for condition in conditions] + [
        (CONDITION, "rgbw", 0),
        (CONDITION, "bayer", 1),
    ]
    for streams in (
        [device_stream(*chip) for chip in chips],
        [exposure_stream(*exposure) for exposure in exposures],
        [shake_stream(seed) for seed in range(5)],
    ):
        draws = [int(stream.integers(2**63)) for stream in streams]
        assert len(set(draws)) == len(draws)
    again = exposure_stream(*exposures[0]), exposure_stream(*exposures[0])
    assert np.array_equal(again[0].random(3), again[1].random(3))


def test_streams_are_seeded_by_the_hash_of_their_coordinates_as_json() -> None:
    """Of the 128 bits as one number: with others all pictures that were made would be made anew, of other noise."""

    def seeded(*parts: Any) -> int:
        text = json.dumps(list(parts)).encode()
        number = int.from_bytes(hashlib.sha256(text).digest()[:16], "big")
        return int(np.random.default_rng(number).integers(2**63))

    exposure = replace(CONDITION, white_balance="gray-world", frames=4)
    named = ("still_life", "D65", 25.0, "cd/m2", 0.01, "low_noise", "rgbw", 5)
    for stream, parts in (
        (device_stream("low_noise", "rgbw", 5), ("device", "low_noise", "rgbw", 5)),
        (device_stream("folder/mine.toml", "rgbw", 5), ("device", "mine.toml", "rgbw", 5)),
        (exposure_stream(exposure, "rgbw", 5), ("exposure", *named)),
        (exposure_stream(replace(exposure, exposure="auto:W"), "rgbw", 5), ("exposure", *named[:4], None, *named[5:])),
        (shake_stream(5), ("shake", 5)),
        (flicker_stream(5), ("flicker", 5)),
    ):
        assert int(stream.integers(2**63)) == seeded(*parts), parts


def test_a_digest_is_of_values_whatever_holds_them_and_of_their_order_where_it_counts() -> None:
    """Of a mapping's order nothing, of a list's all; arrays, tuples and lists of the same numbers are one."""
    assert digest({"a": 1, "b": [2.5, None]}) == digest({"b": (2.5, None), "a": np.int64(1)})
    assert digest([1, 2]) == digest(np.array([1, 2])) == digest((1, 2)) != digest([2, 1])
    assert digest([1, 2]) == hashlib.sha256(b"[1, 2]").hexdigest()[:32]
    assert digest(Waveform(100.0, 0.5)) == digest(vars(Waveform(100.0, 0.5)))
    last = 2.0**-29  # of a float's thirty bits, the last one of 0.5 to 1 is 2^-30
    assert digest_inputs([0.75]) == digest_inputs([0.75 + last / 8]) != digest_inputs([0.75 + last])
    assert digest_inputs("0.25,0.5") == digest_inputs("0.25, 0.5") == digest_inputs([0.25, 0.5])
    assert digest_inputs([-0.0, np.inf]) == digest_inputs([0.0, np.inf])
    assert digest_inputs(np.array([1.0, 1e-12])) == digest_inputs(np.array([1.0, 0.0]))
    assert digest_inputs([1.0, 1e-12]) != digest_inputs([1.0, 0.0]), "a list's floats by themselves"


def test_the_files_of_a_data_sets_scene_are_made_anew_for_each_input_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = SAMPLE.small_study(tmp_path)
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        cells = scene_cells(job, opened, lambda *_: None)
        (tmp_path / prepare_module.PLANES).mkdir(exist_ok=True)
        made: list[int] = []

        def facts(**changes: Any) -> None:
            inputs = {"job": job, "opened": opened, "cells": cells} | changes
            sample_module.scene_facts(**inputs, progress=lambda *_: None)  # type: ignore[arg-type]

        monkeypatch.setattr(sample_module, "scene_transport", lambda *_: (None,))
        monkeypatch.setattr(sample_module, "_make_files", lambda *_: made.append(1) or {"files": {}})
        facts()
        facts()
        assert len(made) == 1
        frame = cells[0].frame
        other_tile = replace(frame, sensor=low_noise("rgbw"))
        changes: list[dict[str, Any]] = [
            {"cells": [replace(cells[0], render=replace(cells[0].render, content="another"))]},
            {"opened": replace(opened, identity="another")},
            {"job": replace(job, study=SimpleNamespace(spectra=("A",)))},
            {"cells": [replace(cells[0], frame=replace(frame, electrons=tmp_path / "other.npy"))]},
            {"cells": [replace(cells[0], frame=other_tile)]},
        ]
        for number, change in enumerate(changes, 2):
            facts(**change)
            assert len(made) == number, change
        for name in ("versions", "code_digests"):
            monkeypatch.setattr(sample_module, name, lambda: "another")
            facts()
        assert len(made) == len(changes) + 3


def test_a_row_tells_of_its_render_what_no_column_of_its_own_does() -> None:
    """Eleven facts of a render, of which four stand in columns; each told under its name with its own value."""
    facts = RenderFacts(
        integrator="path", variant="llvm", seconds=1.5, spp=64.0, stopped_by="samples", relative_mc_error=0.25,
        relative_level_error=None, bands=7, first_nm=400.0, last_nm=700.0, width_nm=50.0,
    )  # fmt: skip
    told = json.loads(render_text(RenderRecord("content", facts, 0.125, ("a note", "another"))))
    assert told == {
        "integrator": "path", "stopped_by": "samples", "relative_mc_error": 0.25, "relative_level_error": None,
        "first_nm": 400.0, "last_nm": 700.0, "width_nm": 50.0, "brightest_share": 0.125,
        "notes": ["a note", "another"],
    }  # fmt: skip
    nm, widths = np.array([410.0, 440.0, 500.0]), np.array([20.0, 40.0, 80.0])
    transport: Any = SimpleNamespace(
        integrator="path", variant="llvm", seconds=2.0, spp=8.0, stopped_by="time", wavelength_nm=nm, width_nm=widths
    )
    radiance: Any = SimpleNamespace(relative_mc_error=0.5, relative_level_error=0.0625)
    assert render_facts(transport, radiance) == RenderFacts(
        "path", "llvm", 2.0, 8.0, "time", 0.5, 0.0625, bands=3, first_nm=410.0, last_nm=500.0, width_nm=20.0
    )


def test_a_frame_that_is_read_back_is_the_frame_that_was_made(tmp_path: Path) -> None:
    """Each fact of a rendered scene's frame: its own light, two rules' times, lux, and half the halves' difference."""
    limits = RenderLimits(size=16, spp=8, band_nm=50.0)
    study = SAMPLE.small_study(
        tmp_path, scenes=(SceneChoice("still_life"),), levels=("10lux",), processors=("interleaved",), render=limits
    )
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        frame = scene_cells(job, opened, lambda *_: None)[0].frame
        transport = under(prepare_module.scene_transport(job, opened, lambda *_: None)[0], "own")
    first = next(iter(transport.groups.values())).spectrum
    light = light_in_bands(first, transport.wavelength_nm, transport.width_nm)
    for name in ("wavelength_nm", "width_nm", "spectrum"):
        assert np.array_equal(getattr(frame.light, name), getattr(light, name)), name
    assert np.array_equal(frame.light.lamp.values, first.values)
    assert frame.lux_per_cd_m2 == pytest.approx(1 / transport.relight(illuminance_lux=1.0).luminance().mean(), rel=0.05)
    assert frame.white_cd_m2 == pytest.approx(shown_white_cd_m2(transport, 1.0))

    def electrons(view: Any, sensor: Any = frame.sensor) -> np.ndarray:
        return expected_electrons(form_image(view, sensor), sensor, 1.0)

    halves = [electrons(half) for half in transport.relight_halves(luminance_cd_m2=1.0)]
    (error,) = np.load(frame.errors)
    assert np.allclose(error, (halves[0] - halves[1]) / 2, rtol=1e-4, atol=1e-4 * halves[0].max())
    assert np.load(frame.electrons) == pytest.approx(electrons(transport.relight(luminance_cd_m2=1.0)), rel=1e-5)
    image = form_image(transport.relight(luminance_cd_m2=1.0), replace_diffraction(frame.sensor))
    assert frame.auto_s == pytest.approx(auto_exposure_s(image, frame.sensor, 1e6), rel=1e-3)
    assert frame.auto_w_s == pytest.approx(auto_exposure_s(image, frame.sensor, 1e6, channel="W"), rel=1e-3)
    assert frame.auto_w_s < 0.8 * frame.auto_s
    for name in ("truth", "electrons", "errors"):  # one that is damaged alone
        path = getattr(frame, name)
        content = path.read_bytes()
        path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        assert load_frame(tmp_path / FRAMES, frame.key, frame.sensor) is None, name
        path.write_bytes(content)
    assert load_frame(tmp_path / FRAMES, frame.key, frame.sensor) is not None


def replace_diffraction(sensor: Any) -> Any:
    """One time for all models of the lens."""
    return replace(sensor, lens=replace(sensor.lens, diffraction=0.0))


def test_the_brightest_share_is_asked_for_in_the_brightest_light_over_the_longest_burst(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the sensor of as many frames, over their time together; the largest of the answers is the share."""
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(
        prepare_module, "render_share", lambda *asks, samples: asked.append(asks) or (3.0, 7.0, 5.0)[len(asked) - 1]
    )
    levels, exposures = ("1cd/m2", "25cd/m2", "9cd/m2"), ("auto", "20ms", "5ms")
    study = SAMPLE.small_study(
        tmp_path, levels=levels, exposures=exposures, frames=(1, 4, 2), longest_exposure_s=0.125
    )  # fmt: skip
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        transport, _ = prepare_module.scene_transport(job, opened, lambda *_: None)
        assert prepare_module._brightest_share(job, opened, transport) == 7.0
    assert [(level, longest_s, time_s) for _, _, level, longest_s, time_s in asked] == [
        (25.0, 0.5, None),
        (25.0, 0.5, pytest.approx(0.08)),
        (25.0, 0.5, pytest.approx(0.02)),
    ]
    for _, sensor, *_ in asked:
        assert sensor.pixel.full_well_e == pytest.approx(4 * low_noise().pixel.full_well_e)
        assert sensor.pixel.read_noise_e == pytest.approx(2 * low_noise().pixel.read_noise_e)


def test_a_sweeps_colours_are_those_of_fine_bands() -> None:
    """10 nm are near 2 nm: a matrix that differs by less than 2 % of white."""
    sensor, processor, lamp = low_noise("bayer"), PROCESSORS["bayer"], illuminant("A")
    nm = np.arange(360.0, 801.0, 2.0)
    fine = colour_fit(sensor, processor, light_in_bands(lamp, nm, np.full(nm.size, 2.0)))
    found = frames_module.colours_under(sensor, processor, lamp)
    np.testing.assert_allclose(found.matrix("RGB"), fine.matrix("RGB"), atol=0.02)
