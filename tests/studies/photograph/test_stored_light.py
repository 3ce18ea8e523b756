"""A photograph whose render's light lies in files is that of light held in memory, to the bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from render.radiance_files.stored_planes import StoredPlanes
from render.transport import Transport
from sensor.raw_files.raw_file import read_raw
from studies.photograph import shot
from studies.photograph.shot import Order, Taken, take

MOVING = """<scene version="3.0.0">
  <default name="time_s" value="0"/>
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/>
    </film></sensor>
  <shape type="sphere"><float name="radius" value="0.6"/>
    <transform name="to_world"><translate x="$time_s" z="5"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.3, 0.1"/></bsdf></shape>
  <emitter type="constant" id="sky"/>
  <emitter type="point" id="bulb"><point name="position" x="3" y="2" z="3"/><rgb name="intensity" value="6, 4, 2"/>
    </emitter>
</scene>"""
ORDERS: dict[str, dict[str, Any]] = {
    "flicker": {"flicker": ("fluorescent@100Hz",), "row_time": "900us", "exposure": "2ms"},
    "flicker of one lamp": {"flicker": ("bulb=pwm@100Hz:0.4",), "row_time": "900us", "exposure": "2ms"},
    "moments": {"moments": 3, "exposure": "1s"},
    "moments, rows that roll": {"moments": 3, "exposure": "1s", "row_time": "50ms"},
    "lens": {"lens": "cooke_triplet", "exposure": "20ms"},
    "lens, by a rule": {"lens": "double_gauss", "exposure": "auto"},
}


def taken(order: Order, monkeypatch: pytest.MonkeyPatch, held_bytes: int) -> tuple[Taken, list[bool]]:
    """Photograph with arrays of up to so many bytes in memory; return whether the light was relit from files, too."""
    stored: list[bool] = []
    by_band = shot.relight_by_band

    def relit(transport: Transport, *terms: Any, **level: Any) -> Any:
        stored.append(isinstance(transport.light.mean, StoredPlanes))
        return by_band(transport, *terms, **level)

    with monkeypatch.context() as patch:
        patch.setattr(shot, "RENDER_BAND_NM", 100.0)  # few bands take little time
        patch.setattr(shot, "_MOST_HELD_BYTES", held_bytes)
        patch.setattr(shot, "relight_by_band", relit)
        return take(order), stored


@pytest.mark.thorough
@pytest.mark.parametrize("name", ORDERS)
def test_light_from_files_is_photographed_to_the_bits_of_light_in_memory(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tmp_path / "ball.xml"
    scene.write_text(MOVING)
    level = "0.05cd/m2" if "moments" in name else "20cd/m2"
    terms = {"cfa": "rgbw", "level": level, "spp": 2, "seed": 3, **ORDERS[name]}
    held, in_memory = taken(Order(scene, tmp_path / "memory" / "a.tif", **terms), monkeypatch, 1 << 28)
    filed, in_files = taken(Order(scene, tmp_path / "files" / "a.tif", **terms), monkeypatch, 0)
    assert (in_memory, in_files) == ([False], [True])
    of_memory, of_files = (read_raw(x.paths[0]) for x in (held, filed))
    assert np.ptp(of_memory.dn) > 100, "a picture of something"
    assert np.array_equal(of_files.dn, of_memory.dn)
    assert of_files.exposure_s == of_memory.exposure_s
    told = [{key: value for key, value in x.facts.items() if key != "paths"} for x in (held, filed)]
    assert told[1] == told[0]
    assert [x for x in filed.notes if "compil" not in x] == [x for x in held.notes if "compil" not in x]
