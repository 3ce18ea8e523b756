"""Strips: the same bits whatever their height, and memory that stays bounded."""

import json

import numpy as np
import pytest
from builders import RGBW_4X4, raw_image
from command_line import in_new_python

from isp.interleaved.kernel.schedule import make_pattern
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.settings import Settings
from rodcone.jit import backend
from sensor.cfa import BAYER, RGBW

pytestmark = pytest.mark.skipif(backend() == "numpy", reason="strips serve the kernel alone")


def frame(tile, shape=(85, 61)):
    """Noise over a ramp into saturation, with a full square, and a black corner."""
    rng = np.random.default_rng(5)
    level = np.linspace(10.0, 2200.0, shape[1])[None, :] * np.ones(shape)
    level[40:52, 20:33] = 1e5
    level[:9, :9] = 0.0
    dn = np.round(np.minimum(rng.poisson(level), 4000) + rng.normal(100.0, 2.0, shape))
    return raw_image(dn, tile, white_dn=4100.0, read_noise_e=2.0, dsnu_e=0.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4])
@pytest.mark.parametrize("sigma_s", [8.0, 0.5])  # the small one needs the running maximum in places
@pytest.mark.parametrize("distance", ["noise", "raw"])
def test_the_height_of_strips_changes_no_bit(tile, distance, sigma_s, monkeypatch):
    raw, settings = frame(tile), Settings(sigma_s=sigma_s, distance=distance)
    whole = reconstruct_with_noise(raw, settings)
    for height in (1, 2, 5):  # blocks a strip
        block = make_pattern(tile).block[0]
        monkeypatch.setattr("isp.interleaved.kernel.run.strip_rows", lambda *_, rows=height * block: rows)
        monkeypatch.setattr("isp.interleaved.kernel.panchromatic.BAND_PIXELS", height * block * raw.shape[1])
        strips = reconstruct_with_noise(raw, settings)
        assert np.array_equal(strips.estimate, whole.estimate)
        assert np.array_equal(strips.noise_gain, whole.noise_gain)


MEASURE = """
import json, resource, sys
import numpy as np
from isp.interleaved.reconstruction import reconstruct
from isp.settings import Settings
from sensor.raw import RawImage
height, width = int(sys.argv[1]), int(sys.argv[2])
dn = np.full((height, width), 120, np.uint16)
dn += np.random.default_rng(0).integers(0, 60, width, dtype=np.uint16)
dn[height // 2 : height // 2 + 64] = 4100
raw = RawImage(dn, ("RG", "BW"), 100.0, 4100.0, 1.0, 2.0, 0.0, 0.0, 0.01)
result = reconstruct(raw, Settings(neighbourhood=int(sys.argv[3])))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
print(json.dumps({"peak": peak, "finite": bool(np.isfinite(result).all()), "shape": result.shape}))
"""


def peak_bytes(height, width, neighbourhood):
    found = json.loads(in_new_python(MEASURE, height, width, neighbourhood))
    assert found["finite"]
    assert found["shape"] == [height, width, 4]
    return found["peak"]


@pytest.mark.slow
def test_memory_beside_the_result_is_32_bytes_per_pixel():
    """The gain of noise takes 16 bytes, the guide and the frame that it is made of 12; strips bound the rest."""
    small, large = (peak_bytes(rows, 4000, 5) - rows * 4000 * 18 for rows in (1500, 6000))
    assert large < small + 4500 * 4000 * 32 + 0.1e9
