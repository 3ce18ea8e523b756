"""Relit equals directly rendered: what the eye collects in wide bands is what it does in bands of 1 nm.

"Directly" means that the lamp keeps its own spectrum in the scene (`coloured`), so that transport and emission are
multiplied along each path, within the bands. Both trace the same paths, so that their noise is nearly the same.
"""

import numpy as np
import pytest
from builders import block_means

from render.engine import render
from render.geometry import look_at, to_world, translate
from render.illuminants import illuminant, lines_nm
from render.scene import LightGroup, Scene, spectrum_node
from render.spectrum import flat, line_bands, observer_weights
from scenes.materials import floor, matte, panel
from scenes.reflectances import band, edge

SIZE, BLOCK = (16, 16), 4
RANGE_NM = (570.0, 610.0)  # about the sodium lines, where the scene's colours turn


def stall():
    """Corner of a red and a blue-green wall on a yellow floor, under one lamp: saturated colours, many bounces."""
    camera = {"type": "perspective", "fov": 34.0, "to_world": to_world(look_at((1.9, 1.5, 2.3), (0.35, 0.3, 0.35)))}
    lamp = look_at((1.1, 1.9, 0.7), (0.4, 0.2, 0.4))
    geometry = {
        "type": "scene",
        "sensor": camera,
        "floor": panel(floor(0, 0, 0), 3.0, 3.0, matte(edge(560, 12, 0.04, 0.85))),
        "left": panel(look_at((0, 0, 0), (1, 0, 0)), 3.0, 3.0, matte(edge(600, 8, 0.03, 0.9))),
        "back": panel(translate(0, 0, 0), 3.0, 3.0, matte(band(520, 30, 0.02, 0.8))),
        "lamp": panel(lamp, 0.8, 0.8, matte(edge(600, 8, 0.1, 0.1)), emitter={"type": "area"}),
    }
    return Scene("stall", geometry, {"lamp": LightGroup(("lamp/emitter",), flat())})


def with_lamp(scene, name):
    """The same scene whose lamp has its spectrum in the scene's own dict."""
    emitter = {"type": "area", "radiance": spectrum_node(illuminant(name))}
    geometry = scene.geometry | {"lamp": scene.geometry["lamp"] | {"emitter": emitter}}
    return Scene("direct", geometry, {"lamp": LightGroup(("lamp/emitter",), flat(), coloured=True)})


def blocks(radiance):
    """Means over blocks of pixels, (band, block)."""
    return block_means(np.moveaxis(radiance.values, -1, 0), BLOCK).reshape(radiance.wavelength_nm.size, -1)


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=-1))


def collected(radiance):
    """What the eye's x, y and z collect of each block, (3, block)."""
    weights = observer_weights(radiance.wavelength_nm, radiance.widths_nm, radiance.light)
    return weights @ blocks(radiance)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:bands")
@pytest.mark.parametrize(
    ("name", "width", "most"), [("sodium_low", 10.0, 0.01), ("sodium_low", 20.0, 0.03), ("LED-B3", 20.0, 0.003)]
)
def test_wide_bands_collect_what_1_nm_bands_do_within_the_error_told(name, width, most):
    """The lamp keeps its own spectrum in the scene of 1 nm bands; both scenes trace the same paths.

    A line of 0.1 nm within a band of 1 nm is drawn with 8 % of noise there, so that it has a band to itself, relit.
    """
    options = {"spp": 64, "seed": 3}
    edges = np.arange(RANGE_NM[0] - 110.0, RANGE_NM[1] + 90.0 + width, width)
    middle = (edges[1:] + edges[:-1]) / 2
    coarse = render(stall(), SIZE, wavelength_nm=middle, width_nm=np.full(middle.size, width), **options)
    lights = {"lamp": name}
    if lines := lines_nm(name):
        nm, width_nm = line_bands(lines, (edges[0], edges[-1]))
        fine = render(stall(), SIZE, wavelength_nm=nm, width_nm=width_nm, **options).relight(lights)
    else:
        nm = np.arange(edges[0] + 0.5, edges[-1])
        fine = render(with_lamp(stall(), name), SIZE, wavelength_nm=nm, **options).relight()
    found = rms(collected(coarse.relight(lights)) / collected(fine) - 1)
    told = list(coarse.band_error(lights).values())
    print(f"{name}: told {np.round(told, 4)}, found {found.round(4)}")
    assert found[:2].max() < most
    for off, said in zip(found[:2], told[:2], strict=True):  # z collects too little of these lamps
        assert off < 3 * said + 2e-3
