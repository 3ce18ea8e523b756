"""How often a reader who follows one value has to change the module; counted over a call trace.

At commit 35f5fbe `raw` made 56 stays (42 with LLVM, the others in the NumPy reference) and entered one module 12
times; `radiance` made 18. Counted from the program's text, every branch included, they were 62, 12 and 18: the limits
are half, a third and two thirds of these.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders import raw_image
from walks import Stay, visits, walk

MOST_OF_RAW = 33  # with both engines: a step of the method more takes two
MOST_VISITS = 4  # of one module, with either engine
MOST_OF_RADIANCE = 14  # the lens transfer among them, which a thread called before, where no trace sees it


def walks_of(**environment: str) -> dict[str, list[Stay]]:
    """Walks in a process of its own: whatever else this one has traced, cached or patched stays out."""
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("walks.py")],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=240,
    )
    return {name: [tuple(stay) for stay in stays] for name, stays in json.loads(done.stdout).items()}


@pytest.fixture(scope="module")
def walked() -> dict[str, dict[str, list[Stay]]]:
    return {"llvm": walks_of(), "numpy": walks_of(DRJIT_LIBLLVM_PATH="/nonexistent/libLLVM.so")}


@pytest.mark.thorough
@pytest.mark.parametrize("engine", ["llvm", "numpy"])
@pytest.mark.thorough
def test_the_walks_begin_where_they_say(walked, engine):
    assert walked[engine]["raw"][0][1:] == ("isp.interleaved", "reconstruct")
    assert walked[engine]["radiance"][0][1:] == ("sensor.capture", "capture")
    assert len(walked[engine]["raw"]) > 5
    assert len(walked[engine]["radiance"]) > 5


@pytest.mark.thorough
def test_raw_makes_few_stays_on_its_way_through_reconstruct(walked):
    stays = list(dict.fromkeys(walked["llvm"]["raw"] + walked["numpy"]["raw"]))
    assert len(stays) <= MOST_OF_RAW, "\n".join(map(str, stays))


@pytest.mark.parametrize("engine", ["llvm", "numpy"])
@pytest.mark.thorough
def test_raw_enters_no_module_often(walked, engine):
    counts = visits(walked[engine]["raw"])
    assert max(counts.values()) <= MOST_VISITS, counts


@pytest.mark.thorough
def test_radiance_makes_few_stays_on_its_way_through_capture(walked):
    stays = walked["llvm"]["radiance"]
    assert len(stays) <= MOST_OF_RADIANCE, "\n".join(map(str, stays))


@pytest.mark.thorough
def test_a_stay_is_a_call_with_the_value_into_another_module():
    """Three functions are given the mosaic, one of them in a loop; the fourth isn't."""
    from sensor import cfa

    raw = raw_image(np.full((4, 4), 100), black_dn=64, white_dn=4095, read_noise_e=2.0, prnu=0.01)

    def run() -> None:
        for _ in range(3):
            cfa.channels(raw.cfa)
        cfa.check_covers(raw.cfa, (4, 4))
        cfa.mask(raw.cfa, "W", raw.shape)
        cfa.tile_of("bayer")

    stays = walk(run, raw)
    assert [name for _, _, name in stays] == ["channels", "check_covers", "mask"]
    assert set(visits(stays)) == {"sensor.cfa"}
