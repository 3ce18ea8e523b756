"""Rendering against closed forms and against stock Mitsuba; stop rules, seeds, sizes and what is refused.

Monte Carlo values are compared in units of their own stated standard error. By chance each such test may fail at most
`FALSE_ALARM` of the time, over all the comparisons that it makes (Bonferroni); its seed is fixed.
"""

import gc
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest
from builders import block_means
from loop import loop
from refusal import refusal
from scipy.stats import chi2, norm
from scipy.stats import t as student
from stock_mitsuba import stock

from render import engine
from render.engine import render
from render.geometry import look_at, to_world, translate
from render.illuminants import illuminant
from render.limits import LEAST_POINTS
from render.scene import LightGroup, Scene, spectrum_node
from render.spectrum import Spectrum, flat
from rodcone.errors import InputError
from rodcone.jit import dr
from scenes.catalogue import load
from scenes.materials import floor, glossy, matte, panel
from scenes.reflectances import edge, grey

BANDS_NM = np.arange(405.0, 780.0, 50.0)  # eight bands fill 380-780 nm
WIDTH_NM = np.full(8, 50.0)
SIZE = (24, 32)
BLOCK = 8  # pixels each side: the mean of 64 pixels is close to normal
FALSE_ALARM = 1e-5
RAMP = spectrum_node(Spectrum(np.array([380.0, 780.0]), np.array([0.0, 1.0])))


def bound(comparisons):
    """Standard errors that normal errors exceed, on either side, `FALSE_ALARM` of the time in all comparisons."""
    return norm.isf(FALSE_ALARM / 2 / comparisons)


def planes_of(radiance):
    return np.moveaxis(radiance.values.astype(np.float64), -1, 0)


def noisy_wall():
    """The flat field with a point light behind the wall: no light more, but paths go to look for lights now.

    Under the sky alone they don't, and every path brings the same: the flat field is exact.
    """
    scene = load("flat_field")
    geometry = scene.geometry | {"behind": {"type": "point", "position": [0, 0, -1]}}
    groups = {"sky": replace(scene.groups["sky"], emitters=("sky", "behind"))}
    return replace(scene, geometry=geometry, groups=groups)


@pytest.fixture(scope="module")
def wall():
    return render(noisy_wall(), SIZE, wavelength_nm=BANDS_NM, spp=128, seed=1)


def test_one_number_of_pixels_is_the_longer_side_of_the_scenes_own_proportions():
    assert render(load("color_checker"), 24, spp=1).counts.shape == (16, 24)  # the chart's film is 170 x 256


def test_a_wall_under_a_constant_environment_is_exact():
    made = render(load("flat_field"), SIZE, wavelength_nm=BANDS_NM, spp=8, seed=1)
    assert made.radiance == pytest.approx(np.full((1, 8, *SIZE), 0.5), rel=1e-6)
    assert made.irradiance == pytest.approx(np.full((1, 8), np.pi), rel=1e-5)
    assert made.relative_mc_error < 1e-6
    assert not made.coverage.mean.any()


def two_lights():
    """A card that sees a round black-backed lamp and the sky around it; under it a coloured ball. All are in view.

    The lamp fills a cone of 30 degrees' half angle above the card: a quarter of the projected hemisphere.
    """
    camera = {"type": "perspective", "fov": 62.0, "to_world": to_world(look_at((0, 0.5, 2.2), (0, 0.15, 0)))}
    height = np.sqrt(3.0) * 0.5
    geometry = {
        "type": "scene",
        "sensor": camera,
        "card": panel(floor(0, 0, 0), 0.03, 0.03, matte(grey(0.4))),
        "tray": panel(translate(0, -0.35, -0.9), 2.4, 0.6, matte(edge(600, 15, 0.1, 0.7))),
        "ball": {
            "type": "sphere",
            "center": [0, -0.55, 0],
            "radius": 0.5,
            "bsdf": glossy(edge(520, 20, 0.7, 0.1), 0.3),
        },
        "lamp": {
            "type": "disk",
            "to_world": to_world(look_at((0, height, 0), (0, 0, 0), (0, 0, 1)), np.diag([0.5, 0.5, 1.0, 1.0])),
            "bsdf": matte(grey(1e-6)),
            "emitter": {"type": "area"},
        },
        "sky": {"type": "constant"},
    }
    groups = {
        "sky": LightGroup(("sky",), illuminant("D65"), 20.0),
        "lamp": LightGroup(("lamp/emitter",), illuminant("A"), 200.0),
    }
    return Scene("two_lights", geometry, groups, reference_plane="card")


@pytest.fixture(scope="module")
def two():
    return render(two_lights(), SIZE, wavelength_nm=BANDS_NM, spp=256, seed=2)


def test_the_stated_variance_is_the_scatter_of_pixels_about_the_closed_form(wall):
    # All bands of a path rise and fall together on a grey wall: one band tells. The scatter over n pixels and the
    # stated variance, n degrees of freedom of one difference each, both follow chi-squared laws.
    count = wall.radiance[0, 0].size
    scatter = ((wall.radiance[0, 0].astype(np.float64) - 0.5) ** 2).sum()
    stated = wall.variance[0, 0].mean(dtype=np.float64)
    rate = FALSE_ALARM / 4
    low, high = chi2.ppf(rate, count) / count, chi2.isf(rate, count) / count
    assert low / high < scatter / count / stated < high / low


def test_the_half_difference_has_the_stated_variance(wall):
    count = wall.radiance[0, 0].size
    half = (wall.light.difference[0, 0].astype(np.float64) ** 2).sum() / wall.variance[0, 0].mean(dtype=np.float64)
    # The one is the other, but for what pooling counts twice at the picture's edge.
    assert half / count == pytest.approx(1.0, abs=0.02)


def test_the_stated_relative_error_is_the_standard_error_over_the_mean(wall):
    truth = np.sqrt(wall.variance.mean(dtype=np.float64)) / 0.5
    # A median of values pooled over 9 pixels of one degree of freedom each lies 3.6 % low.
    assert wall.relight().relative_mc_error == pytest.approx(np.sqrt(chi2.median(9) / 9) * truth, rel=0.03)


@pytest.mark.thorough
def test_a_lamp_of_half_angle_30_degrees_gives_a_quarter_of_pi_and_hides_that_much_sky(two):
    sky, lamp = two.irradiance / np.pi
    # The card is 3 cm wide, the lamp 87 cm away: the form factor at its middle holds within 1e-3.
    assert lamp == pytest.approx(np.full(8, 0.25), rel=5e-3)
    assert sky == pytest.approx(np.full(8, 0.75), rel=5e-3)


@pytest.mark.sample(2)
@pytest.mark.parametrize("max_depth", [2, 16, 1 << 16])
def test_a_glowing_cavity_is_the_geometric_series_of_its_reflectance(max_depth):
    made = render(replace(cavity(), max_depth=max_depth), (8, 8), wavelength_nm=BANDS_NM, spp=512)
    truth = (1 - 0.8**max_depth) / (1 - 0.8)
    error = np.sqrt(made.variance[0, 0].sum(dtype=np.float64)) / 64
    assert error < 0.01 * truth
    assert np.abs(made.radiance[0].mean(axis=(1, 2), dtype=np.float64) - truth).max() < bound(1) * error
    assert (made.coverage.mean == 1).all()


@pytest.mark.thorough
def test_roulette_adds_its_noise_from_the_depth_that_the_scene_states():
    """Light over 16 segments of a cavity of 0.8: from the first surface on their number is 1 to 16, geometric."""
    variances = []
    for rr_depth in (1, 5, 1 << 16):
        asked = replace(cavity(), rr_depth=rr_depth, max_depth=16)
        made = render(asked, (8, 8), wavelength_nm=BANDS_NM, spp=64)
        variances.append(64 * made.variance[0, 0].mean(dtype=np.float64))
    beyond = 0.8 ** np.arange(16)  # chance of more than 0, 1, ... segments
    geometric = ((2 * np.arange(16) + 1) * beyond).sum() - beyond.sum() ** 2
    # 64 pixels' variances from two halves each scatter by 18 %. Later roulette thins darker paths, none leaves only the
    # choice between lamp and surface.
    assert variances[0] == pytest.approx(geometric, rel=0.7)
    assert variances[0] > variances[1] > 5 * variances[2]


def cavity():
    camera = {"type": "perspective", "fov": 60.0, "to_world": to_world(look_at((0.3, 0, 0), (0, 0, 1)))}
    # A cube: Mitsuba samples a sphere from inside with a bias of 5e-4, in its own integrator too.
    cavity = {"type": "cube", "flip_normals": True, "bsdf": matte(grey(0.8)), "emitter": {"type": "area"}}
    groups = {"glow": LightGroup(("cavity/emitter",), flat())}
    return Scene("furnace", {"type": "scene", "sensor": camera, "cavity": cavity}, groups)


@pytest.mark.sample(1)
@pytest.mark.parametrize("lamp", [{}, {"power": 600.0}, {"power": 600.0, "spectrum": illuminant("D50")}])
def test_relit_groups_sum_to_what_stock_mitsuba_renders_directly(two, lamp):
    scene = two_lights()
    groups = dict(scene.groups) | {"lamp": replace(scene.groups["lamp"], **lamp)}
    options = {"spp": 32, "passes": 16, "seed": 4, "sampler": "independent"}
    passes = stock(replace(scene, groups=groups), SIZE, BANDS_NM, WIDTH_NM, **options)
    direct, variance = passes.mean(axis=0), passes.var(axis=0, ddof=1) / 16
    relit = planes_of(
        two.relight({"lamp": groups["lamp"].spectrum}, powers={name: group.power for name, group in groups.items()})
    )
    own = replace(two, groups=groups)
    both = block_means(variance + own.relight_variance(luminance_cd_m2=own.level().value)) / BLOCK**2
    noisy = both > 1e-10 * block_means(direct) ** 2  # the others see the sky alone
    assert block_means(relit)[~noisy] == pytest.approx(block_means(direct)[~noisy], rel=1e-4)
    z = ((block_means(relit) - block_means(direct)) / np.sqrt(both))[noisy]
    assert z.size > 40
    assert np.abs(z).max() < bound(z.size)
    # A dozen blocks count, whose bands are partly correlated: 0.41 is the standard error of the mean square.
    assert 0.25 < np.mean(z**2) < 2.75


def test_a_lamp_in_view_is_taken_out_of_the_light_and_what_it_covers_out_of_the_area(two):
    """The lamp has 200 cd/m^2, a little less in these bands, and nothing that it lights more than 40."""
    dark = two.relight(powers={"sky": 0.0}).luminance()
    sky, lamp = (seen.mean[0] for seen in two.seen)
    assert two.coverage.mean == pytest.approx(sky + lamp, abs=1e-6)
    assert 5 < (lamp == 1).sum() < 200
    assert 5 < ((lamp > 0) & (lamp < 1)).sum() < 100
    assert (dark[lamp == 1] > 150).all()
    assert (dark[lamp == 0] < 40).all()
    left = dark - lamp * dark[lamp == 1].min()
    assert (left > -1e-3).all()
    level = two.level(powers={"sky": 0.0})
    assert level.value == pytest.approx(left.sum() / (1 - two.coverage.mean).sum(), rel=1e-4)
    assert level.relative_error < 0.01
    lit = two.relight(powers={"sky": 0.0}, luminance_cd_m2=10.0)
    assert lit.luminance() == pytest.approx(dark * 10.0 / level.value, rel=1e-5)


def small(seed=0, **options):
    return render(noisy_wall(), (3, 4), **({"wavelength_nm": BANDS_NM, "spp": 8, "seed": seed} | options))


def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    one, again, other = small(7), small(7), small(8)
    for name in ("radiance", "variance", "light.difference", "irradiance", "coverage.mean"):
        assert np.array_equal(attrgetter(name)(one), attrgetter(name)(again)), name
    assert not (one.radiance == other.radiance).any()


def apart(scene):
    """The scene with a light of no power in the sky's group, which then is rendered by itself."""
    geometry = scene.geometry | {"off": {"type": "point", "position": [0, -9, 0]}}
    return replace(
        scene, geometry=geometry, groups=scene.groups | {"sky": replace(scene.groups["sky"], emitters=("sky", "off"))}
    )


def test_groups_and_halves_draw_from_seeds_of_their_own():
    made = render(apart(two_lights()), SIZE, wavelength_nm=BANDS_NM[:4], width_nm=50.0, spp=64, seed=2)
    assert made.shared is None
    sky, lamp = (made.light.difference[g, 0] / np.sqrt(np.maximum(made.variance[g, 0], 1e-20)) for g in (0, 1))
    noisy = (made.variance[:, 0] > 1e-8).all(axis=0)
    assert noisy.sum() > 60
    assert abs(np.corrcoef(sky[noisy], lamp[noisy])[0, 1]) < bound(1) / np.sqrt(noisy.sum())


def test_samples_asked_for_are_drawn():
    made = small(spp=64)
    assert (made.spp, made.stopped_by) == (64, "samples")
    assert made.seconds > 0
    assert small(spp=1).spp == 2  # one in each half at least, for the error
    assert small(spp=9).spp == 10
    assert small(spp=None).spp == 64


def test_an_error_asked_for_is_reached():
    made = small(noise=0.006, spp=None)
    assert made.stopped_by == "noise"
    assert made.relight().relative_mc_error <= 0.006 * (1 + 1e-5)
    assert made.spp > 2 * LEAST_POINTS
    assert made.relight().relative_mc_error > 0.006 / 2.5  # and not by far more work than it needs


def test_an_error_is_not_believed_before_eight_samples_in_each_half():
    assert small(noise=10.0, spp=None, max_spp=4096).spp == 16


def test_seconds_are_those_of_all_the_calls_that_a_render_took(monkeypatch):
    """By a clock that runs alone move on, 3 s each."""
    clock, add = SimpleNamespace(now=1000.0), engine.add_run

    def add_slowly(*given):
        add(*given)
        clock.now += 3.0

    monkeypatch.setattr(engine, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(engine, "add_run", add_slowly)
    part = small(spp=8)
    assert (part.spp, part.seconds) == (8, 3.0)
    clock.now += 500.0  # between the calls
    on = small(spp=16, resume=part)
    assert (on.spp, on.seconds) == (16, 6.0)


def test_a_ceiling_of_samples_ends_a_render():
    assert small(spp=None, max_spp=24).spp == 24
    made = small(spp=None, max_spp=200, noise=1e-6)
    assert (made.stopped_by, made.spp) == ("samples", 208)  # 100 points of each half lie within a chunk of eight
    text = refusal(small, spp=8, max_spp=16)
    assert text == "spp and max_spp: 8 and 16 are both given; allowed: one; leave spp out"


@pytest.mark.sample(1)
@pytest.mark.parametrize("stops", [[8, 10], [2], [16, 18, 36], [36, 40, 80, 144]])
def test_a_render_that_is_gone_on_from_has_the_bits_of_one_that_was_not_interrupted(stops):
    """Stopped anywhere, with another number of threads each time, and by another rule at the end."""
    whole, part, seconds = small(5, spp=160), None, 0.0
    threads = dr.thread_count()
    try:
        for index, spp in enumerate(stops):
            dr.set_thread_count(1 + index % 3)
            part = small(5, spp=spp, resume=part)
            assert part.spp == spp
            assert part.seconds > seconds
            seconds = part.seconds
        on = small(5, spp=None, max_spp=160, noise=1e-6, resume=part)
    finally:
        dr.set_thread_count(threads)
    assert on.spp == whole.spp == 160
    for name in ("radiance", "light.difference", "variance", "coverage.mean", "coverage.difference", "irradiance"):
        assert np.array_equal(attrgetter(name)(on), attrgetter(name)(whole)), name
    for one, other in zip(on.seen, whole.seen, strict=True):
        assert np.array_equal(one.mean, other.mean)
        assert np.array_equal(one.difference, other.difference)
    assert on.level() == whole.level()
    assert part.spp == stops[-1], "what was gone on from is untouched"


def test_glass_seen_by_pixels_of_several_rates_has_those_bits_too():
    """Embree's last bits depend on which paths share a packet: of glass a value in a hundred was another."""
    scene, options = load("still_life"), {"wavelength_nm": [550.0], "width_nm": [10.0]}
    part = render(scene, (16, 16), spp=128, **options)
    on, whole = (render(scene, (16, 16), spp=256, resume=earlier, **options) for earlier in (part, None))
    assert len(np.unique(whole.counts)) > 2
    assert np.array_equal(on.radiance, whole.radiance)


def test_control_c_keeps_what_was_made_so_far(tmp_path):
    def press(share, error):
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    made = small(spp=None, max_spp=4096, cache=tmp_path, progress=press)
    assert (made.stopped_by, made.spp) == ("interrupt", 32)
    assert signal.getsignal(signal.SIGINT) is before
    on = small(spp=None, max_spp=128, cache=tmp_path)
    assert (on.spp, on.stopped_by) == (128, "samples")
    assert np.array_equal(on.radiance, small(spp=None, max_spp=128).radiance)


def test_a_callback_that_raises_keyboard_interrupt_ends_a_render_in_another_thread_as_control_c_does(tmp_path):
    def stop(share, error):
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as pool:
        made = pool.submit(small, spp=None, max_spp=4096, cache=tmp_path, progress=stop).result()
    assert (made.stopped_by, made.spp) == ("interrupt", 32)
    on = small(spp=None, max_spp=128, cache=tmp_path)
    assert (on.spp, on.stopped_by) == (128, "samples")
    assert np.array_equal(on.radiance, small(spp=None, max_spp=128).radiance)


def test_a_render_in_another_thread_leaves_control_c_alone():
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(small).result().stopped_by == "samples"


def test_progress_rises_to_one_with_the_error_so_far():
    calls = []
    made = small(spp=64, progress=lambda share, error: calls.append((share, error)))
    shares, errors = zip(*calls, strict=True)
    assert shares == (0.5, 1.0)
    assert errors[-1] == pytest.approx(made.relight().relative_mc_error, rel=1e-4)


@loop("size", [(1, 1), (1, 7), (7, 1)])
def test_images_of_one_pixel_or_one_row_are_rendered(size):
    made = render(noisy_wall(), size, wavelength_nm=BANDS_NM, spp=64, seed=9)
    assert made.radiance.shape == (1, 8, *size)
    assert made.relight().shape == size
    error = np.sqrt(made.variance[0, 0].sum(dtype=np.float64)) / made.radiance[0, 0].size
    # Student's bound: a difference of the halves for each pixel.
    freedom = made.radiance[0, 0].size
    assert abs(made.radiance[0, 0].mean() - 0.5) < student.isf(FALSE_ALARM / 2, freedom) * error


def test_bands_of_any_number_and_width_are_rendered():
    reflectance = Spectrum(np.array([380.0, 780.0]), np.array([0.2, 0.6]))
    scene = load("flat_field")
    scene = replace(scene, geometry=scene.geometry | {"wall": scene.geometry["wall"] | {"bsdf": matte(reflectance)}})
    nm, width_nm = np.array([400.0, 450.0, 546.1, 600.0, 700.0]), np.array([10.0, 40.0, 1.0, 20.0, 100.0])
    made = render(scene, (8, 8), wavelength_nm=nm, width_nm=width_nm, spp=256)
    ratio = made.radiance[0].mean(axis=(1, 2)) / made.radiance[0, 0].mean()
    expected = reflectance.band_average(nm, width_nm) / reflectance.band_average(nm[0], width_nm[0])
    # All bands share their paths: only the jitter inside the bands scatters, (100 nm / sqrt 12) / sqrt(64 x 256).
    assert ratio == pytest.approx(expected, rel=5e-3)


@loop("size", [(0, 5), (5, -1), (5,), (5, 5, 3), (2.0, 3.0), (40_000, 2), -5, 2.5])
def test_a_bad_size_is_refused_with_its_value(size):
    text = refusal(render, load("flat_field"), size)
    assert text == f"size: {size!r} is not allowed; give (height, width) in pixels, each 1 to 32768"


@loop(
    ("name", "value", "words"),
    [
        ("spp", 0, "spp: 0 is outside 1 to 65536"),
        ("spp", 1 << 17, "spp: 131072 is outside 1 to 65536"),
        ("spp", 2.5, "spp: 2.5 "),
        ("noise", 0.0, "noise: 0.0 is outside 1e-06 to 10"),
        ("max_seconds", 0.0, "max_seconds: 0.0 is outside 0.001 to 1e+07"),
        ("max_depth", 0, "max_depth: 0 is outside 1 to 65536"),
        ("max_depth", 2.5, "max_depth: 2.5 "),
        ("seed", -1, "seed: -1 is outside 0 to 9"),
        ("wavelength_nm", [500.0, 400.0], "wavelength_nm"),
        ("width_nm", -1.0, "width_nm"),
    ],
)
def test_a_limit_or_a_band_that_cannot_be_is_refused_with_its_value(name, value, words):
    assert words in refusal(small, **{name: value})


def test_a_scene_without_light_or_with_a_node_that_mitsuba_does_not_know_is_refused():
    geometry = {name: node for name, node in load("flat_field").geometry.items() if name != "sky"}
    text = refusal(render, Scene("cave", geometry, {}), (2, 2))
    assert text == "scene cave: it has no light; allowed: one light group or more; add one"
    text = refusal(render, ball_under_the_sky({"type": "velvet"}), (2, 2))
    assert text.startswith("scene ball: Mitsuba can't load it: ")
    assert "velvet" in text


@pytest.fixture
def freed():
    """Lets go of refused scenes at the end: Dr.Jit compiles every live material into the next render, theirs too."""
    yield
    gc.collect()


def ball_under_the_sky(bsdf):
    camera = {"type": "perspective", "fov": 40.0, "to_world": to_world(look_at((0, 0, 3), (0, 0, 0)))}
    ball = {"type": "sphere", "radius": 0.8, "bsdf": bsdf}
    geometry = {"type": "scene", "sensor": camera, "ball": ball, "sky": {"type": "constant"}}
    return Scene("ball", geometry, {"sky": LightGroup(("sky",), flat())})


def test_a_refused_scene_does_not_spoil_the_next_render_while_its_error_is_kept():
    blend = {"type": "blendbsdf", "weight": RAMP, "matte": {"type": "diffuse"}, "mirror": {"type": "conductor"}}
    with pytest.raises(InputError, match="not implemented") as kept:  # Mitsuba's reason
        render(ball_under_the_sky(blend), (2, 2), wavelength_nm=BANDS_NM, spp=8)
    assert render(ball_under_the_sky({"type": "diffuse"}), (2, 2), wavelength_nm=BANDS_NM, spp=8).radiance.any()
    assert "\n" not in str(kept.value)


def test_a_material_that_chooses_by_wavelength_is_refused(freed, monkeypatch):
    hair = {"type": "hair", "eumelanin": 1.0}  # picks lobes by the attenuation of the path's first wavelengths
    text = refusal(render, ball_under_the_sky(hair), (6, 6), wavelength_nm=BANDS_NM, spp=16)
    assert text.startswith("scene ball: ball/bsdf of type 'hair' chooses where light goes by wavelength")
    assert "allowed: 4 bands a render; replace it, nearest: principled or roughplastic" in text
    monkeypatch.setattr("render.loader.walk", lambda node: ())  # as a plug-in that isn't known by its name
    text = refusal(render, ball_under_the_sky(hair), (6, 6), wavelength_nm=BANDS_NM, spp=16)
    assert text.startswith("scene: a material chooses where light goes by wavelength")
    assert "allowed: materials whose sampling doesn't depend on wavelength; replace it" in text
