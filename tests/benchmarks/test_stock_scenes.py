"""A folder of Mitsuba scenes beside stock Mitsuba: what agrees, what is refused, and what is only a part."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENE = """<scene version="3.0.0">
<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="$side"/>
<integer name="height" value="8"/></film></sensor>
<include filename="part.xml"/><shape type="rectangle"><transform name="to_world"><translate z="3"/></transform>
<ref id="paint"/></shape><emitter type="constant"/></scene>"""
PART = '<scene version="3.0.0"><bsdf type="twosided" id="paint"><bsdf type="diffuse"/></bsdf></scene>'


@pytest.mark.thorough
def test_a_folder_is_told_scene_by_scene_and_counted(tmp_path: Path) -> None:
    (tmp_path / "wall.xml").write_text(SCENE)
    (tmp_path / "part.xml").write_text(PART)
    (tmp_path / "fog.xml").write_text(SCENE.replace("constant", "projector"))
    command = [sys.executable, str(ROOT / "benchmarks" / "stock_scenes.py"), str(tmp_path), "--side", "8"]
    command += ["--samples", "16", "--define", "side=8", "--out", str(tmp_path / "out" / "table.csv")]
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert lines[-1] == "1 refused, 1 part, 1 agrees"
    assert "emitter type 'projector' is refused" in lines[0]
    assert lines[1] == "part.xml: part"
    assert lines[2].startswith("wall.xml: agrees")
    assert len((tmp_path / "out" / "table.csv").read_text().splitlines()) == 4
