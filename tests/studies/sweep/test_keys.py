"""Whatever a frame, a picture or a stream of noise depends on is in its key: each input changed alone changes it."""

from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE

from sensor.presets import low_noise, preset
from studies.study.study import Condition, RenderLimits, SceneChoice
from studies.sweep import frames as frames_module
from studies.sweep import prepare as prepare_module
from studies.sweep.cells import cell_key, device_stream, exposure_stream, shake_stream
from studies.sweep.frames import frame_key

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
    lamp.write_text("wavelength_nm,value\n380,1\n780,2\n")
    found.append(key())
    monkeypatch.setattr(frames_module, "versions", lambda: "another version")
    found.append(key())
    assert len(set(found)) == len(found)


def test_the_request_for_a_render_changes_with_each_of_its_inputs_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a render that is noted for a request nothing is made anew, whatever limits the study asks for now."""

    def request(identity: str = "a", model: str = "b", limits: RenderLimits | None = None) -> str:
        study = SimpleNamespace(render=limits or RenderLimits())
        job: Any = SimpleNamespace(plan=SimpleNamespace(renders={"scene": model}), study=study)
        opened: Any = SimpleNamespace(identity=identity, choice="scene")
        return prepare_module._request(job, opened)

    found = [request(), request("c"), request(model="c"), request(limits=RenderLimits(spp=17))]
    for name in ("backend", "versions"):
        monkeypatch.setattr(prepare_module, name, lambda: "another")
        found.append(request())
    assert len(set(found)) == len(found)


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
        "condition": CONDITION, "processor": "ple", "seed": 0, "frame": "f", "luminance_cd_m2": 1.0,
        "exposure_s": 0.01, "made_by": "m",
    }  # fmt: skip
    other = {
        "condition": replace(CONDITION, white_balance="gray-world"), "processor": "bayer", "seed": 1, "frame": "g",
        "luminance_cd_m2": 2.0, "exposure_s": 0.02, "made_by": "n",
    }  # fmt: skip
    keys = {cell_key(**inputs)} | {cell_key(**inputs | {name: value}) for name, value in other.items()}
    assert len(keys) == 1 + len(other)


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
