"""Without LLVM and CUDA the slow forms run and say so; and what an import of Mitsuba before rodcone's modules does."""

import json
import os
import subprocess
import sys

import pytest
from scipy.stats import norm

FALSE_ALARM = 1e-5

FALLBACK = """
import json
import numpy as np
from rodcone.jit import backend
from render.loader import variant
from render.engine import render
from rodcone.errors import InputError
from scenes.catalog import load
from sensor.raw import RawImage
from sensor.cfa import RGBW
from isp.interleaved import reconstruct_with_noise
from isp.settings import Settings

nm, width_nm = np.array([450.0, 550.0, 650.0]), np.array([100.0, 100.0, 40.0])
made = render(load("flat_field"), (12, 16), wavelength_nm=nm, width_nm=width_nm, spp=64, seed=1)
again = render(load("flat_field"), (12, 16), wavelength_nm=nm, width_nm=width_nm, spp=64, seed=1)
far = render(load("color_checker"), (12, 12), wavelength_nm=[900.0], width_nm=100.0, spp=256, seed=1)
raw = RawImage(np.full((8, 10), 1000, np.uint16), RGBW, 100.0, 4000.0, 1.0, 2.0, 0.0, 0.0, 0.01)
result = reconstruct_with_noise(raw, Settings(neighbourhood=7))
print(json.dumps({
    "backend": backend(),
    "variant": [variant(), made.variant, made.integrator],
    "mean": made.radiance[0].mean(axis=(1, 2), dtype=np.float64).tolist(),
    "error": (np.sqrt(made.variance[0].sum(axis=(1, 2), dtype=np.float64)) / made.radiance[0, 0].size).tolist(),
    "scatter": made.radiance[0].var(axis=(1, 2), dtype=np.float64).tolist(),
    "plane": made.irradiance[0].tolist(),
    "stop": [made.spp, made.stopped_by, bool(made.coverage.mean.any())],
    "same": bool(np.array_equal(made.radiance, again.radiance)),
    "far": [float(far.radiance[0, 0, 0].mean()), float(far.irradiance[0, 0])],
    "engine": result.engine,
    "flat": float(np.abs(result.estimate / 900.0 - 1).max()),
}))
"""


def in_new_python(code, **variables):
    kept = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run(
        [sys.executable, "-c", code], env=kept | variables, capture_output=True, text=True, timeout=240, check=False
    )


@pytest.fixture(scope="module")
def fallback():
    done = in_new_python(FALLBACK, DRJIT_LIBLLVM_PATH="/nonexistent/libLLVM.so")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    if said["backend"] == "cuda":
        pytest.skip("a CUDA device answers here, whatever the LLVM library")
    return said


def test_without_llvm_the_scalar_variant_and_numpy_run_and_are_named(fallback):
    assert fallback["backend"] == "numpy"
    assert fallback["variant"] == ["scalar_spectral", "scalar_spectral", "path + specfilm"]
    assert fallback["engine"] == "numpy"


def test_a_wall_rendered_without_llvm_is_its_reflectance_within_the_stated_error(fallback):
    z = [(mean - 0.5) / error for mean, error in zip(fallback["mean"], fallback["error"], strict=True)]
    assert max(map(abs, z)) < norm.isf(FALSE_ALARM / 2 / len(z))
    # 192 pixels scatter as their own stated errors say: the variance of a variance is 2 / 192 (1 + 1 / 7), 5 sigma.
    for scatter, error in zip(fallback["scatter"], fallback["error"], strict=True):
        assert scatter / (192 * error**2) == pytest.approx(1.0, abs=0.55)


def test_illuminance_without_llvm_is_pi_times_the_skys_radiance(fallback):
    # specfilm scatters even under a constant environment
    assert fallback["plane"] == pytest.approx([3.14159265] * 3, rel=0.02)


def test_a_render_without_llvm_keeps_its_stop_rule_and_seed(fallback):
    assert fallback["stop"] == [64, "samples", False]
    assert fallback["same"]


def test_a_flat_field_reconstructed_without_llvm_stays_flat(fallback):
    assert fallback["flat"] < 1e-6


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "before", ["import mitsuba", "import drjit", "import mitsuba; mitsuba.set_variant('scalar_rgb')"]
)
def test_importing_mitsuba_first_works_or_warns_in_one_line(before):
    code = (
        f"{before}\n"
        "import numpy as np\n"
        "from rodcone.jit import backend\n"
        "from render.engine import render\n"
        "from scenes.catalog import load\n"
        "made = render(load('flat_field'), (2, 2), wavelength_nm=np.arange(405.0, 780.0, 50.0), spp=8)\n"
        "print(backend(), made.variant, made.radiance.shape)"
    )
    done = in_new_python(code)
    assert done.returncode == 0, done.stderr
    kind, variant, *shape = done.stdout.splitlines()[-1].split()
    assert variant == {"numpy": "scalar_spectral"}.get(kind, f"{kind}_ad_spectral")
    assert "".join(shape) == "(1,8,2,2)"
    warnings = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert len(warnings) <= 1
    assert all("RuntimeWarning: Dr.Jit was imported before rodcone" in line for line in warnings)


def test_stock_mitsuba_renders_the_infrared_too(fallback):
    # the card around the chart reflects 0.2 of a constant environment, less what the board hides from the first row
    radiance, irradiance = fallback["far"]
    assert radiance == pytest.approx(0.2, rel=0.02)
    assert irradiance == pytest.approx(3.14159, rel=0.02)
