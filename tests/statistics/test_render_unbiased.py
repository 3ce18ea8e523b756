"""The dense integrator against stock Mitsuba (`path` and `specfilm`): no bias, in blocks, bands, caustics and lines.

Welch's t-test of means over 8x8 pixels in each band, both sides' variance from the scatter of their own passes. All
comparisons of this file together fail by chance with probability `FALSE_ALARM` at most (Bonferroni); seeds are fixed.
Each test also states its power: the least bias that it catches nine times out of ten.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from builders import block_means
from scipy.ndimage import maximum_filter
from scipy.stats import chi2, norm
from scipy.stats import t as student
from stock_mitsuba import stock

from render.engine import render
from render.geometry import look_at, to_world, translate
from render.illuminants import illuminant, lines_nm
from render.scene import LightGroup, Scene
from render.spectrum import Spectrum, line_bands
from rodcone.jit import backend
from scenes.catalogue import load
from scenes.materials import ball, disk, floor, glass, matte, panel
from scenes.reflectances import band, edge, grey

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(backend() == "numpy", reason="no LLVM or CUDA here: stock Mitsuba is all there is"),
]

FALSE_ALARM = 1e-3
BANDS_NM, WIDTH_NM = np.arange(405.0, 780.0, 50.0), np.full(8, 50.0)
SIZE, BLOCK, DEPTH = (24, 24), 8, 8
PASSES = 16  # of stock; the engine makes more
SEED = 1_000_000  # of stock's passes, away from the engine's
COMPARISONS = 3 * 9 * 8 + 3 * 8 + 3 + 8 + 3 * 9  # blocks, totals and noise of three scenes; a caustic; a line
LEVEL = FALSE_ALARM / COMPARISONS
NINE_IN_TEN = norm.ppf(0.9)


@dataclass(frozen=True)
class Estimate:
    """Means, their variances and the degrees of freedom behind these; all of one shape."""

    mean: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray

    @staticmethod
    def of_pixels(mean, variance, passes, block):
        """Means over blocks of independent pixels of (band, h, w), whose variances come from `passes` passes."""
        first = block_means(variance, block) / block**2
        fourth = block_means(variance**2, block) / block**6
        return Estimate(block_means(mean, block), first, (passes - 1) * first**2 / np.maximum(fourth, 1e-300))

    @staticmethod
    def of_draws(draws):
        """Mean over draws, the first axis."""
        count = len(draws)
        return Estimate(draws.mean(0), draws.var(0, ddof=1) / count, np.full(draws.shape[1:], count - 1.0))


def difference(one, other):
    """Welch's test: t values, their probabilities under equality, and the bias caught, relative to `other`."""
    variance = one.variance + other.variance
    freedom = variance**2 / (one.variance**2 / one.freedom + other.variance**2 / other.freedom)
    t = (one.mean - other.mean) / np.sqrt(variance)
    caught = (student.isf(LEVEL / 2, freedom) + NINE_IN_TEN) * np.sqrt(variance) / other.mean
    return t, 2 * student.sf(np.abs(t), freedom), caught


def dense(scene, **options):
    """The engine's transport, and its radiance at the scene's own lights, (band, h, w)."""
    made = render(scene, SIZE, **({"wavelength_nm": BANDS_NM, "max_depth": DEPTH} | options))
    return made, np.moveaxis(made.relight().values, -1, 0).astype(np.float64)


def compared(block, made, lit, direct):
    """Welch's test of block means, lights in view left out: they are as bright in both, their rims drown the rest."""
    away = ~maximum_filter(made.coverage.mean > 0, 3)
    variance = made.relight_variance(luminance_cd_m2=made.level().value).astype(np.float64)
    ours = Estimate.of_pixels(lit * away, variance * away, 2, block)
    mean, variance = direct.mean(axis=0), direct.var(axis=0, ddof=1) / len(direct)
    return difference(ours, Estimate.of_pixels(mean * away, variance * away, len(direct), block))


def steps(values):
    """Light that is even within each band and another in each: band averages then multiply exactly."""
    edges = np.arange(380.0, 781.0, 50.0)
    nm = np.ravel([edges[:-1] + 1e-3, edges[1:] - 1e-3], order="F")
    return Spectrum(nm, np.repeat(values, 2))


def court():
    """Corner of a red, a blue and a white wall under sky and a lamp: two groups, colour bleeding from wall to wall."""
    camera = {"type": "perspective", "fov": 34.0, "to_world": to_world(look_at((1.9, 1.5, 2.3), (0.35, 0.3, 0.35)))}
    lamp = look_at((1.1, 1.9, 0.7), (0.4, 0.2, 0.4))
    geometry = {
        "type": "scene",
        "sensor": camera,
        "floor": panel(floor(0, 0, 0), 2.0, 2.0, matte(grey(0.8))),
        "left": panel(look_at((0, 0, 0), (1, 0, 0)), 2.0, 2.0, matte(edge(590, 10, 0.03, 0.9))),
        "back": panel(translate(0, 0, 0), 2.0, 2.0, matte(band(470, 30, 0.02, 0.8))),
        "ball": ball(0.4, 0.3, 0.4, 0.3, matte(edge(520, 15, 0.05, 0.8))),
        "lamp": panel(lamp, 0.4, 0.4, matte(grey(0.1)), emitter={"type": "area"}),
        "sky": {"type": "constant"},
    }
    groups = {
        "sky": LightGroup(("sky",), steps([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0]), 0.02),
        "lamp": LightGroup(("lamp/emitter",), steps([1.0, 0.2, 2.0, 3.0, 1.0, 4.0, 0.5, 2.0]), 3.0),
    }
    return Scene("court", geometry, groups)


SCENES = {
    "cornell_box": lambda: load("cornell_box", light="E"),
    "color_checker": lambda: load("color_checker", light="E"),
    "court": court,
}


@pytest.fixture(scope="module", params=SCENES)
def renders(request):
    """Scene, our transport and radiance, and stock's passes."""
    scene = SCENES[request.param]()
    made, lit = dense(scene, max_spp=1536, seed=11)
    return scene, made, lit, stock(scene, SIZE, BANDS_NM, WIDTH_NM, spp=1024, passes=PASSES, seed=SEED)


def test_blocks_and_bands_of_diffuse_scenes_are_those_of_stock_mitsuba(renders):
    _, *both = renders
    t, chance, caught = compared(BLOCK, *both)
    assert t.size == 9 * 8
    assert chance.min() > LEVEL
    # Noise as stated: were all bands of a block one, nine independent squares would follow chi-squared's law.
    assert chi2.ppf(LEVEL / 2, 9) / 9 < np.mean(t**2) < chi2.isf(LEVEL / 2, 9) / 9
    print(f"least bias caught in a block and band: median {np.median(caught):.2%}, worst {caught.max():.2%}")
    assert np.median(caught) < 0.02


def test_whole_pictures_of_diffuse_scenes_are_those_of_stock_mitsuba(renders):
    _, *both = renders
    _, chance, caught = compared(SIZE[0], *both)
    assert chance.min() > LEVEL
    print(f"least bias caught in a picture's band: worst {caught.max():.2%}")
    assert caught.max() < 0.01


def focus():
    """Glass ball over a red floor under a lamp; the camera looks beneath it, where all light has come through glass."""
    camera = {"type": "perspective", "fov": 8.0, "to_world": to_world(look_at((0, 1.2, 1.6), (0, 0, 0)))}
    lamp = disk(look_at((0, 2.4, 0), (0, 0, 0), (0, 0, 1)), 0.35, matte(grey(1e-6)), emitter={"type": "area"})
    geometry = {
        "type": "scene",
        "sensor": camera,
        "floor": panel(floor(0, 0, 0), 4.0, 4.0, matte(edge(560, 20, 0.1, 0.8))),
        "ball": ball(0, 0.75, 0, 0.35, glass()),
        "lamp": lamp,
    }
    return Scene("focus", geometry, {"lamp": LightGroup(("lamp/emitter",), steps(np.arange(1.0, 9.0)), 50.0)})


def test_a_caustic_has_the_total_energy_that_stock_mitsuba_gives_it():
    # Values of single pixels have a heavy tail: totals over the picture are compared, drawn 32 times over.
    scene, draws = focus(), 32
    ours = np.stack([dense(scene, spp=128, seed=20 + k)[1].mean(axis=(1, 2)) for k in range(draws)])
    theirs = stock(scene, SIZE, BANDS_NM, WIDTH_NM, spp=512, passes=draws, seed=SEED).mean(axis=(2, 3))
    _, unlit = dense(scene, spp=16, max_depth=2)
    assert unlit.mean() < 0.01 * ours.mean()  # without the way through the ball it is dark there
    _, chance, caught = difference(Estimate.of_draws(ours), Estimate.of_draws(theirs))
    assert chance.min() > LEVEL
    print(f"least bias caught in a caustic's energy: worst {caught.max():.2%}")
    assert caught.max() < 0.02


def test_a_sodium_lamp_relit_on_line_bands_is_what_stock_mitsuba_renders_directly():
    scene = court()
    spectra = {"sky": illuminant("E") * 20.0, "lamp": illuminant("sodium_low") * 300.0}
    groups = {name: LightGroup(group.emitters, spectra[name]) for name, group in scene.groups.items()}
    scene = Scene("court", scene.geometry, groups)
    nm, width_nm = line_bands(lines_nm("sodium_low"), (587.0, 592.0))  # the doublet's band, and one to either side
    made, lit = dense(scene, wavelength_nm=nm, width_nm=width_nm, max_spp=768, seed=60)
    assert nm.size == 3
    assert lit[1].mean() > 10 * lit[[0, 2]].mean()  # the line stays in its band
    direct = stock(scene, SIZE, nm, width_nm, spp=2560, passes=PASSES, seed=SEED)
    t, chance, caught = compared(BLOCK, made, lit, direct)
    assert t.size == 3 * 9
    assert chance.min() > LEVEL
    print(f"least bias caught in a block of the line's band: median {np.median(caught[1]):.2%}")
    assert np.median(caught[1]) < 0.02
