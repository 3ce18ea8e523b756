"""A photograph of a scene that moves: what may be ordered, what it costs, and what is rendered at each time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

from sensor.raw_files.raw_file import read_raw
from studies.photograph.shot import Order, check, take
from studies.study.cost import pace, render_seconds
from studies.study.scene_source import open_scene

MOVING = """<scene version="3.0.0">
  <default name="time_s" value="0"/>
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
    </film></sensor>
  <shape type="sphere"><float name="radius" value="0.2"/>
    <transform name="to_world"><translate x="$time_s" z="5"/></transform></shape>
  <emitter type="constant"/>
</scene>"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "ball.xml"
    path.write_text(MOVING)
    return path


def test_the_scene_stands_at_the_middles_of_equal_parts_of_the_exposure() -> None:
    checked = check(Order("walker", exposure="0.4s", moments=4, size=32))
    heads_m = [scene.geometry["walker_head"]["center"][0] for scene in checked.moving]
    assert np.diff(heads_m) == pytest.approx([1.4 * 0.1] * 3)
    middle = checked.opened
    assert middle is not None
    assert middle.scene.geometry["walker_head"]["center"][0] == pytest.approx(np.mean(heads_m))
    assert checked.ready is None


def test_where_rows_roll_the_times_reach_to_the_last_row_s_end() -> None:
    """32 rows of 5 ms start within 155 ms: of a tenth of a second the last ends at 255 ms."""
    checked = check(Order("walker", exposure="0.1s", moments=4, size=32, row_time="5ms"))
    heads_m = [scene.geometry["walker_head"]["center"][0] for scene in checked.moving]
    assert np.diff(heads_m) == pytest.approx([1.4 * 0.255 / 4] * 3)
    assert checked.shares is not None
    assert checked.shares.shape == (4, 32)
    assert checked.shares[0, 0] > 0.5 > checked.shares[0, -1] == 0
    assert check(Order("walker", exposure="0.1s", moments=4, size=32)).shares is None


def test_each_time_costs_a_render() -> None:
    still, moving = (check(Order("walker", exposure="0.4s", size=32, spp=1600, moments=k)) for k in (None, 8))
    assert still.moving == ()
    assert moving.cost == replace(still.cost, times=8)
    lit = 32 * 32 * moving.cost.bands * 4
    render_s = render_seconds(32 * 32, moving.cost.bands, 4, 1600)
    assert moving.cost.seconds - still.cost.seconds == pytest.approx(7 * (render_s + pace() * (0.8 + 1.2e-7 * lit)))
    assert moving.cost.memory.total - still.cost.memory.total == 3 * 4 * lit
    assert "1600 samples per pixel at each of 8 times" in moving.cost.words()


def test_a_scene_file_moves_by_its_parameter(scene_file: Path) -> None:
    order = Order(scene_file, exposure="2s", moments=2, level="5cd/m2")
    places_m = []
    for scene in check(order).moving:
        (ball,) = (node for node in scene.geometry.values() if isinstance(node, dict) and node.get("type") == "sphere")
        places_m.append(float(np.array(ball["to_world"])[0, 3]))
    assert places_m == [0.5, 1.5]


def test_what_does_not_move_or_has_no_time_is_refused(scene_file: Path) -> None:
    still = scene_file.with_name("still.xml")
    still.write_text(MOVING.replace("$time_s", "0").replace('<default name="time_s" value="0"/>', ""))
    for order, words in (
        (Order("still_life", exposure="20ms", moments=2), "moments: scene still_life doesn't move; allowed: walker"),
        (Order("walker", moments=2), "exposure: 'auto:information' beside moments = 2; allowed: a time"),
        (Order("walker", exposure="20ms", moments=2, frames=2), "frames: 2 beside moments = 2"),
        (Order(still, exposure="20ms", moments=2), "time_s"),
        (Order("light.exr", exposure="20ms", moments=2), "moments"),
    ):
        refusal(check, order, match=words)
    refusal(Order, "walker", moments=0, match="moments")
    refusal(open_scene, "walker", time_s=1e3, match="time_s: 1000")


def test_what_counts_other_than_by_time_is_refused_beside_motion() -> None:
    """A cosine of depth 0.284 at 100 Hz swings by 0.284 |sinc(1/4)| in 2.5 ms, and by 0 in the 20 ms of two periods."""
    swing = 100 * 0.284 * np.sin(np.pi / 4) / (np.pi / 4)
    lamp = Order("walker", exposure="10ms", moments=4, size=32, flicker=("fluorescent@100Hz",))
    refusal(
        check, lamp, match=f"flicker: beside moments = 4.*2.5 ms.*100 Hz swings by {swing:.0f}%;.*exposure of 40 ms"
    )
    for steady in (
        replace(lamp, exposure="80ms"),
        replace(lamp, exposure="89ms"),
        replace(lamp, moments=1),
        replace(lamp, exposure="10ms", row_time="2258.0645us"),  # 31 of them are 70 ms
        replace(lamp, exposure="0s"),
    ):
        assert len(check(steady).moving) == steady.moments
    for sensor in ("staggered", "white_apart"):
        parts = Order("walker", exposure="100ms", moments=4, size=32, sensor=sensor)
        refusal(check, parts, match="moments: the camera reads some charge after a part of the time")
        assert check(replace(parts, moments=None)).moving == ()
    assert check(Order("walker", exposure="100ms", moments=4, size=32, sensor="split_pixel")).moving


@pytest.mark.thorough
def test_a_photograph_of_a_scene_file_that_moves_is_blurred(scene_file: Path, tmp_path: Path) -> None:
    """The ball's shadow side is spread over its way: fewer pixels are as dark as those of the ball that stands."""
    ways = {"still": None, "moving": 8}
    darkest = {}
    for name, moments in ways.items():
        out = tmp_path / f"{name}.dng"
        take(Order(scene_file, out, cfa="bayer", exposure="1s", level="0.01cd/m2", spp=16, moments=moments))
        darkest[name] = np.ptp(read_raw(out).electrons)
    assert darkest["moving"] < darkest["still"]
