"""Without LLVM and CUDA nothing is rendered, the rest runs; and what an import of Mitsuba before rodcone does."""

import json

import pytest
from command_line import in_new_python, new_python

FALLBACK = """
import json
import numpy as np
from rodcone.jit import backend
from render.loader import variant
from render.engine import render
from render.user_scene.scene_file import load_scene_file
from rodcone.errors import InputError
from render.radiance import SpectralRadiance
from scenes.catalogue import load
from sensor.capture import photograph_radiance
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.cfa import RGBW
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.settings import Settings

said = []
for ask in (lambda: render(load("flat_field"), (12, 16)), lambda: load_scene_file("scene.xml")):
    try:
        ask()
    except InputError as error:
        said.append(str(error))
raw = RawImage(np.full((8, 10), 1000, np.uint16), RGBW, 100.0, 4000.0, 1.0, 2.0, 0.0, 0.0, 0.01)
result = reconstruct_with_noise(raw, Settings(neighbourhood=7))
light = SpectralRadiance(np.full((8, 10, 40), 0.003, np.float32), np.arange(385.0, 780.0, 10.0))
device = draw_device(low_noise(), (8, 10), np.random.default_rng(2))
shots = [
    photograph_radiance(light, low_noise(), 0.02, device, np.random.default_rng(3), exact=exact)
    for exact in (False, True)
]
print(json.dumps({
    "backend": backend(),
    "variant": variant(),
    "said": said,
    "engines": [result.engine, shots[0].engine],
    "exact": bool(np.array_equal(shots[0].dn, shots[1].dn) and np.ptp(shots[0].dn) > 100),
    "flat": float(np.abs(result.estimate / 900.0 - 1).max()),
}))
"""


@pytest.fixture(scope="module")
def fallback(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.xml").write_text('<scene version="3.0.0"/>')
    printed = in_new_python(FALLBACK, DRJIT_LIBLLVM_PATH="/nonexistent/libLLVM.so", folder=folder)
    said = json.loads(printed.splitlines()[-1])
    if said["backend"] == "cuda":
        pytest.skip("a CUDA device answers here, whatever the LLVM library")
    return said


def test_without_llvm_a_render_and_a_scene_file_are_refused_in_one_line(fallback):
    assert fallback["variant"] == "none"
    assert len(fallback["said"]) == 2
    for words in fallback["said"]:
        assert "neither LLVM nor CUDA" in words
        assert "rodcone doctor" in words
        assert "\n" not in words


def test_without_llvm_numpy_shoots_as_the_exact_form_does_and_reconstructs_a_flat_field_as_flat(fallback):
    assert (fallback["backend"], *fallback["engines"]) == ("numpy",) * 3
    assert fallback["exact"]
    assert fallback["flat"] < 1e-6


@pytest.mark.thorough
@pytest.mark.parametrize(
    "before", ["import mitsuba", "import drjit", "import mitsuba; mitsuba.set_variant('scalar_rgb')"]
)
def test_importing_mitsuba_first_works_or_is_refused_behind_one_warning(before):
    code = (
        f"{before}\n"
        "import numpy as np\n"
        "from rodcone.jit import backend\n"
        "from render.engine import render\n"
        "from scenes.catalogue import load\n"
        "made = render(load('flat_field'), (2, 2), wavelength_nm=np.arange(405.0, 780.0, 50.0), spp=8)\n"
        "print(backend(), made.variant, made.radiance.shape)"
    )
    done = new_python(code)
    warnings = [line for line in done.stderr.splitlines() if "Warning" in line]
    if warnings:  # Dr.Jit has looked for an LLVM by itself
        assert len(warnings) == 1
        assert "RuntimeWarning: Dr.Jit was imported before rodcone" in warnings[0]
    if done.returncode:
        assert warnings
        assert "InputError: render: Dr.Jit has neither LLVM nor CUDA here" in done.stderr.splitlines()[-1]
    else:
        kind, variant, *shape = done.stdout.splitlines()[-1].split()
        assert variant == f"{kind}_ad_spectral"
        assert "".join(shape) == "(1,8,2,2)"
