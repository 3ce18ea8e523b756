"""The staged chain: what is kept changes no bit, stages are the public chain's, sliding compiles no kernel."""

import pickle
import random
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from explore_sample import GAUSSIAN, RENDER, lamps_apart, ran, random_controls, small_transport
from loop import loop
from refusal import refusal

import rodcone as public
import studies.explore.chain as CHAIN
import studies.explore.controls as CONTROLS
import studies.photograph.shot as SHOT
from isp.processors.catalogue import PROCESSORS, default_processor, libraries
from isp.processors.piecewise import takes
from render.spectrum import luminance
from rodcone.jit import backend, dr
from sensor.cfa import MOSAICS
from sensor.lens.table import with_lens
from sensor.optics import form_image
from sensor.presets import preset, preset_file
from studies.explore.answers import noise_share, python_of
from studies.explore.chain import development_of, expose_scene, photograph, true_picture_of
from studies.explore.controls import LENS, PIXEL, TIME, Controls, Lamp, camera_of, controls_from, mosaics_of, only_group
from studies.explore.memo import Memo, never_cancel
from studies.explore.slow import is_slow, stand_in
from studies.explore.source import GIVEN, RenderOptions, of_transport, open_source
from studies.explore.views import VIEWS, histogram, pixel
from studies.metrics.truth import light_in_bands, shown_white_cd_m2, true_srgb
from studies.study.gain import iso_speed


@pytest.mark.thorough
def test_what_is_kept_changes_no_bit():
    """After any changes, in any order, pictures and figures are those of an empty memory."""
    transport, memo, rng = small_transport(), Memo(), random.Random(1)
    for _ in range(40):
        controls = random_controls(rng)
        kept, fresh = photograph(transport, controls, memo), photograph(transport, controls)
        assert np.array_equal(kept.exposed.raw.dn, fresh.exposed.raw.dn), controls
        assert np.array_equal(kept.linear, fresh.linear), controls
        assert np.array_equal(kept.true, fresh.true), controls
        assert kept.exposed.exposure_s == fresh.exposed.exposure_s


# A value of each control that differs from the default; a table of all, so that a new control has to be named here.
MOVED = {
    "lamps": {"sun": Lamp("A", 2.0)}, "level_cd_m2": 3.0, "exposure": "auto:W", "exposure_s": 0.001,
    "sensor": "table1_output", "mosaic": "rgbw_4x4", "bits": 10, "shot_noise": False, "seed": 3, "exposure_number": 4,
    "frames": 2, "reference_light": "A", "processor": "ple_rgbw", "white_balance": "gray-world",
    "settings": {"sigma_s": 2.0}, "gain": 4.0, "iso": 200.0, "pixel": {}, "lens": {}, "lens_table": "cooke_triplet",
    "flicker_depth": 0.2, "flicker_hz": 9.0, "row_time_us": 300.0,
}  # fmt: skip
PIXEL_MOVED = {
    "read_noise_e": 20.0, "dsnu_e": 30.0, "prnu": 0.1, "dark_current_e_per_s": 3e5, "column_gain_spread": 0.1,
    "column_offset_e": 30.0, "hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 1e5, "crosstalk": 0.1,
    "full_well_e": 3000.0,
}  # fmt: skip
LIGHT_AND_LENS = {"lamps", "sensor", "mosaic", "lens", "lens_table", "level_cd_m2"}
LENS_MOVED = {"f_number": 8.0, "defocus_um": 10.0, "diffraction": 2.0, "veiling_glare": 0.1}


@pytest.fixture
def bent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A lens by data without a point spread, which the page's menu would hold: quick."""
    path = tmp_path / "bent.toml"
    terms = "distortion = [0.0, -0.1]", "relative_illumination = [1.0, 0.5]"
    path.write_text("\n".join(("f_number = 4.0", "field = [0.0, 1.0]", *terms)))
    monkeypatch.setattr(CONTROLS, "shipped", lambda: (str(path),))
    return str(path)


def test_a_control_changed_alone_gives_what_a_fresh_session_gives_with_it(bent):
    """Whatever is kept from the settings before: exposure, chip, light, truth and what develops the raw image."""
    hot = {"hot_pixel_share": 0.05, "hot_pixel_dark_current_e_per_s": 1e4}  # so that each term of a pair is seen
    # Lamps too slow for a rule to cut its time to their periods, so that depth and frequency are seen.
    slow = {"flicker_depth": 0.5, "flicker_hz": 7.0}
    start = Controls(processor="interleaved", exposure="auto:information", pixel=hot, **slow)
    memo, transport = Memo(), small_transport()
    first = expose_scene(transport, start, memo)
    true_picture_of(first, start, memo)
    assert {x.name for x in fields(Controls)} == set(MOVED), "a control without a line in MOVED"
    moved = [{name: bent if name == "lens_table" else value} for name, value in MOVED.items() if value != {}]
    moved += [{"lamps": {name: Lamp("A")}} for name in transport.groups]
    moved += [{"pixel": hot | {name: PIXEL_MOVED[name]}} for name in PIXEL]
    moved += [{"lens": {name: LENS_MOVED[name]}} for name in LENS]
    for change in moved:
        controls = replace(start, **change)
        kept, fresh = expose_scene(transport, controls, memo), expose_scene(transport, controls, Memo())
        assert kept.exposure_s == fresh.exposure_s, change
        assert np.array_equal(kept.raw.dn, fresh.raw.dn), change
        assert np.array_equal(kept.light.spectrum, fresh.light.spectrum), change
        if LIGHT_AND_LENS & change.keys():
            assert noise_share(kept, controls, memo) == noise_share(fresh, controls, Memo()), change
        at = pixel(kept, 3, 5), pixel(fresh, 3, 5)
        assert at[0] == at[1], change
        true, true_anew = true_picture_of(kept, controls, memo), true_picture_of(fresh, controls, Memo())
        assert np.array_equal(true[0], true_anew[0]), change
        developed, anew = development_of(kept, controls, memo), development_of(fresh, controls, Memo())
        assert developed.keywords.keys() == anew.keywords.keys(), change
        for mine, theirs in zip((*developed.args, *developed.keywords.values()),
                                (*anew.args, *anew.keywords.values()), strict=True):  # fmt: skip
            assert pickle.dumps(mine) == pickle.dumps(theirs), change
        if not {"reference_light", "processor", "white_balance", "settings"} & change.keys():
            assert kept.raw.dn.shape != first.raw.dn.shape or not np.array_equal(kept.raw.dn, first.raw.dn), change


def test_a_speed_is_taken_as_the_gain_that_has_it_and_is_told_of_the_exposure():
    """Of a pixel of half the well, whose speed at gain 1 is twice as high, and of a gain that the exposure raised."""
    transport, shallow = small_transport(), {"full_well_e": preset("low_noise").pixel.full_well_e / 2}
    base = iso_speed(preset("low_noise"))
    by_iso = expose_scene(transport, Controls(pixel=shallow, iso=8 * base), Memo())
    by_gain = expose_scene(transport, Controls(pixel=shallow, gain=4.0), Memo())
    assert by_iso.sensor.gain == pytest.approx(4.0, rel=1e-9)
    assert np.array_equal(by_iso.raw.dn, by_gain.raw.dn)
    assert by_iso.iso == pytest.approx(8 * base, rel=1e-9)
    refusal(Controls, gain=4.0, iso=200.0, match="one of the two")
    refusal(expose_scene, transport, Controls(iso=base / 2), Memo(), match="speed at gain 1")
    dim = camera_of(Controls(), replace(preset("low_noise"), gain_limit=8.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CHAIN, "camera_of", lambda *_: dim)
        raised = expose_scene(transport, Controls(exposure="auto", exposure_s=1e-4), Memo())
    assert raised.sensor.gain > 2.0
    assert raised.iso == pytest.approx(iso_speed(raised.sensor), rel=1e-9)


def test_frames_of_a_burst_have_noise_of_their_own():
    """Four frames of read noise alone have half its deviation: within four standard errors over 1920 pixels."""
    terms = {"read_noise_e": 20.0, "dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0}
    still = Controls(pixel=terms, shot_noise=False, bits=16, exposure=TIME, exposure_s=0.002)
    spread_e = []
    for frames in (1, 4):
        exposed = photograph(small_transport(), replace(still, frames=frames)).exposed
        raw, scale = exposed.raw, frames if exposed.raw.exposure_s > 0.003 else 1
        off_e = raw.electrons / scale - exposed.expected_e
        spread_e.append(off_e[exposed.expected_e < 0.5 * exposed.sensor.pixel.full_well_e].std())
    assert spread_e[1] / spread_e[0] == pytest.approx(0.5, rel=0.09)


def test_in_the_hand_each_frame_has_a_path_of_its_own_and_the_light_of_the_still_one(tmp_path):
    """Nothing but the path moves: a sharp edge is blurred more by a longer time, and the sum of light is kept."""
    path = tmp_path / "held.toml"
    text = preset_file("low_noise").read_text("utf-8")
    assert text.count("[lens]") == 1
    path.write_text(text.replace("[lens]", "[lens]\nshake_um = 100.0"), "utf-8")
    quiet = {"read_noise_e": 0.0, "dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0}
    start = Controls(
        processor="interleaved", pixel=quiet, shot_noise=False, bits=16, exposure=TIME, exposure_s=0.02, level_cd_m2=1.0
    )

    def sharpness(**changes):
        controls = replace(start, **{"sensor": str(path)} | changes)
        raw = expose_scene(small_transport(), controls, Memo()).raw
        white_e = raw.electrons[1::2, 1::2]
        return np.abs(np.diff(white_e)).mean() / white_e.mean(), raw

    (still, fixed), (moved, first) = sharpness(sensor="low_noise"), sharpness()
    assert first.electrons.sum() == pytest.approx(fixed.electrons.sum(), rel=0.01)
    assert sharpness(exposure_s=0.2, level_cd_m2=0.1)[0] < moved < still
    assert np.array_equal(first.dn, sharpness()[1].dn)
    for other in ({"exposure_number": 1}, {"seed": 1}):
        assert np.abs(sharpness(**other)[1].electrons - first.electrons).max() > 5


def test_rows_that_roll_under_lamps_that_flicker_have_bands_and_whole_periods_none():
    """Each row collects its own mean of the cosine, whose amplitude is depth x sinc(f T); frames follow the readout."""
    still = Controls(exposure=TIME, exposure_s=0.003, row_time_us=400.0, seed=5)
    flickering, transport = replace(still, flicker_depth=0.8, flicker_hz=120.0), small_transport()
    steady_e, first_e, second_e = (
        expose_scene(transport, controls, Memo()).expected_e
        for controls in (still, flickering, replace(flickering, exposure_number=1))
    )
    x = np.pi * 120.0 * 0.003
    starts = np.arange(40) * 4e-4
    turns = 2 * np.pi * 120.0 * starts[:, None]
    for found_e in (first_e, second_e):
        rows = found_e.sum(axis=1) / steady_e.sum(axis=1) - 1
        fit, *_ = np.linalg.lstsq(np.concatenate([np.cos(turns), np.sin(turns)], axis=1), rows)
        assert np.hypot(*fit) == pytest.approx(0.8 * np.sin(x) / x, rel=1e-6)
    both_e = expose_scene(transport, replace(flickering, frames=2), Memo()).expected_e
    np.testing.assert_allclose(both_e, (first_e + second_e) / 2, rtol=1e-12)
    assert np.abs(first_e - second_e).max() > 0.01 * steady_e.max()
    rule = replace(flickering, exposure="auto", exposure_s=0.1, level_cd_m2=0.1)
    cut = expose_scene(transport, rule, Memo())
    assert (cut.exposure_s * 120.0) % 1 == pytest.approx(0.0, abs=1e-9)
    refusal(expose_scene, transport, replace(flickering, sensor="staggered", mosaic="rgbw"), Memo(), match="flicker: ")


def test_a_lens_by_data_images_each_light_as_a_capture_does_and_brings_its_f_number(bent):
    transport, controls = small_transport(), Controls(lens_table=bent, lens={"veiling_glare": 0.05})
    sensor = with_lens(preset("low_noise"), bent)
    sensor = replace(sensor, lens=replace(sensor.lens, veiling_glare=0.05))
    exposed = expose_scene(transport, controls, Memo())
    assert exposed.sensor.lens == sensor.lens
    for name, frame in exposed.frames.items():
        image = form_image(only_group(exposed.transport, name).relight(), sensor)
        assert np.array_equal(frame.irradiance.values, image.values), name
    refusal(Controls, lens_table="tessar", match="lens_table: 'tessar'")
    refusal(Controls, lens_table=bent, lens={"f_number": 4.0}, match="lens: f_number beside the lens")
    refusal(controls_from, {"lens_table": "mine.toml"}, match="lens_table: 'mine.toml'")


@pytest.mark.sample(2)
@pytest.mark.parametrize("processor", [name for name in PROCESSORS if not libraries(name) and not is_slow(name)])
def test_every_mosaic_that_the_page_offers_is_developed(processor):
    for mosaic in mosaics_of(PROCESSORS[processor]):
        controls = controls_from({"processor": processor, "mosaic": mosaic})
        assert np.ptp(photograph(small_transport(), controls).picture) > 0, mosaic


def test_without_shot_noise_read_noise_is_all_that_moves():
    """Its standard deviation over 1920 pixels of a grey frame is known to 1.6 %; four of these are allowed."""
    terms = {"read_noise_e": 6.0, "dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0}
    still = Controls(pixel=terms | {"read_noise_e": 0.0}, shot_noise=False, bits=16, exposure=TIME, exposure_s=0.002)
    expected = photograph(small_transport(), still).exposed
    first = photograph(small_transport(), replace(still, pixel=terms)).exposed
    noise_e = first.raw.electrons - expected.expected_e
    kept = expected.expected_e < 0.9 * expected.raw.full_well_e
    assert noise_e[kept].std() == pytest.approx(6.0, rel=0.065)
    again = photograph(small_transport(), replace(still, pixel=terms, exposure_number=1)).exposed
    assert not np.array_equal(first.raw.dn, again.raw.dn)
    steady = photograph(small_transport(), replace(still, exposure_number=1)).exposed
    assert np.array_equal(steady.raw.dn, expected.raw.dn)


def test_a_lamps_start_is_drawn_from_a_captures_stream_which_is_no_frames(monkeypatch):
    """A stream [7, 1] is also [7, 1, 0], the first frame's: its noise would tell where in its period a lamp was."""
    drawn, starts = [], CHAIN.frame_starts_s
    monkeypatch.setattr(CHAIN, "frame_starts_s", lambda *x: drawn.append(x[-1].bit_generator.state) or starts(*x))
    expose_scene(small_transport(), Controls(flicker_depth=1.0, seed=7, frames=2), Memo())
    of_start, *of_frames = (np.random.default_rng([7, *x]).bit_generator.state for x in ([2], [1], [1, 0], [1, 1]))
    assert drawn
    assert all(state == of_start for state in drawn)
    assert of_start not in of_frames
    assert (CHAIN._CHIP, CHAIN._FRAME, CHAIN._START) == (SHOT._DEVICE, SHOT._FRAME, SHOT._START)


@pytest.mark.thorough
def test_the_memory_is_bounded():
    transport, memo = small_transport(), Memo()
    for seed in range(30):
        photograph(transport, Controls(seed=seed, level_cd_m2=1.0 + seed, lens={"f_number": 2.0 + seed}), memo)
    assert max(len(kept) for kept in memo.stages.values()) <= 8


@loop(("level_cd_m2", "dark_e_per_s"), [(3.0, 0.0), (300.0, 3e5)])
def test_the_stages_are_the_public_chain(level_cd_m2, dark_e_per_s):
    """Light, exposure and truth of the scene's own lamps, against the functions that a script would call."""
    terms = {"lens": {"diffraction": 1.0}, "pixel": {"dark_current_e_per_s": dark_e_per_s}}
    transport, controls = small_transport(), Controls(level_cd_m2=level_cd_m2, exposure="auto", **terms)
    exposed = photograph(transport, controls).exposed
    radiance = transport.relight(luminance_cd_m2=level_cd_m2)
    sensor = public.low_noise()
    pixel = replace(sensor.pixel, dark_current_e_per_s=dark_e_per_s)
    sensor = replace(sensor, pixel=pixel, lens=replace(sensor.lens, diffraction=1.0))
    exposure_s = public.auto_exposure_s(form_image(radiance, sensor), sensor)
    # The undershoot of a group alone is not that of the sum: a hundredth of the brightest pixels' light at most.
    assert exposed.exposure_s == pytest.approx(exposure_s, rel=1e-3)
    from sensor.response import expected_electrons

    expected = expected_electrons(form_image(radiance, sensor), sensor, exposed.exposure_s)
    assert np.abs(exposed.expected_e - expected).max() < 0.01 * expected.max()
    assert np.sum(exposed.expected_e) == pytest.approx(expected.sum(), rel=1e-5)
    first = next(iter(transport.groups.values()))
    light = light_in_bands(first.spectrum, transport.wavelength_nm, transport.width_nm)
    white_cd_m2, true = shown_white_cd_m2(transport, level_cd_m2), photograph(transport, controls).true
    # The explorer keeps lamps apart, each with its own light within the bands; together they follow their mixture.
    truth = sum(true_srgb(lamp, light, white_cd_m2) for lamp in lamps_apart(transport, level_cd_m2))
    assert np.allclose(true, truth, rtol=1e-4, atol=1e-6)
    assert np.allclose(true, true_srgb(radiance, light, white_cd_m2), rtol=2e-3, atol=2e-3)  # in bands of 50 nm


def test_the_level_is_reached_and_powers_are_shares():
    transport = small_transport()
    exposed = photograph(transport, Controls(lamps={"sun": Lamp(power=0.25)}, level_cd_m2=7.0)).exposed
    lit = exposed.transport
    assert lit.level().value * exposed.scale == pytest.approx(7.0, rel=1e-12)
    ratios = {name: lit.groups[name].power / group.power for name, group in transport.groups.items()}
    assert ratios == {"sun": 0.25, "sky": 1.0}  # who isn't named shines as the scene states
    twice = photograph(transport, Controls(lamps={name: Lamp(power=2.0) for name in transport.groups}))
    once = photograph(transport, Controls())
    assert np.allclose(twice.exposed.expected_e, once.exposed.expected_e, rtol=1e-12)


def test_another_spectrum_keeps_the_groups_luminance():
    for lamp in [Lamp("A"), Lamp("6500K"), Lamp(table=GAUSSIAN)]:
        transport = small_transport()
        lit = photograph(transport, Controls(lamps={"sky": lamp})).exposed.transport
        nm, width = np.arange(360.5, 830.0), np.ones(470)
        before, after = (
            luminance(each.groups["sky"].spectrum.band_average(nm, width), nm, width) for each in (transport, lit)
        )
        assert after == pytest.approx(before, rel=1e-9), lamp


def test_lamps_that_give_no_light_are_refused():
    transport = small_transport()
    for lamps, words in (
        ({name: Lamp(power=0.0) for name in transport.groups}, "all are off"),
        ({"moon": Lamp()}, "'moon' is unknown"),
        ({"sun": Lamp(table=((900.0, 1.0), (950.0, 1.0)))}, "no light"),
    ):
        refusal(photograph, transport, Controls(lamps=lamps), match=words)


def test_another_exposure_is_of_the_same_chip_and_another_seed_is_another_chip():
    transport = small_transport()
    first, second, other = (
        photograph(transport, controls).exposed
        for controls in (Controls(), Controls(exposure_number=1), Controls(seed=1))
    )
    assert np.array_equal(first.device.dark_offset_e, second.device.dark_offset_e)
    assert not np.array_equal(first.raw.dn, second.raw.dn)
    assert not np.array_equal(first.device.dark_offset_e, other.device.dark_offset_e)


@pytest.mark.thorough
@pytest.mark.skipif(backend() == "numpy", reason="no Dr.Jit backend, no kernels")
def test_no_kernel_is_compiled_after_the_first_changes():
    """Of 60 changes of all controls the last 40 compile nothing: every value is an argument of a kernel."""
    transport, memo, rng = small_transport(), Memo(), random.Random(3)
    moves = [random_controls(rng) for _ in range(20)] + [random_controls(rng) for _ in range(40)]

    def compiled() -> int:
        return sum(not kernel["cache_hit"] for kernel in dr.kernel_history([dr.KernelType.JIT]))

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for controls in moves[:20]:
            photograph(transport, controls, memo)
        assert len(dr.kernel_history([dr.KernelType.JIT])) > 100
        for controls in moves[20:]:
            photograph(transport, controls, memo)
            assert compiled() == 0, controls


def test_every_view_is_a_picture_of_the_frames_size():
    shot = photograph(small_transport(), Controls(frames=2, pixel={"column_gain_spread": 0.01}))
    for name, view in VIEWS.items():
        picture = view(shot)
        assert (picture.shape, picture.dtype) == ((40, 48, 3), np.uint8), name
        assert picture.std() > 1, name


def test_the_page_opens_with_one_method_for_every_mosaic():
    """Camera B is camera A with another mosaic: both have the default processor, and stand-ins of one name."""
    default = Controls()
    assert {default_processor(tile) for tile in MOSAICS.values() if takes(tile)} == {default.processor}
    assert {stand_in(replace(default, mosaic=name), 1000).processor for name in ("rgbw", "bayer")} == {"any_mosaic"}


def test_each_slow_processor_has_a_quick_one_of_its_mosaic():
    slow = [name for name in PROCESSORS if is_slow(name)]
    assert {"ple", "ple_rgbw", "ple_bayer", "bayer_bm3d", "rgbw_park"} <= set(slow)
    assert "interleaved" not in slow
    for name in slow:
        quick = stand_in(Controls(processor=name, mosaic=PROCESSORS[name].mosaic), 1000).processor
        assert not is_slow(quick)
        assert PROCESSORS[name].mosaic in mosaics_of(PROCESSORS[quick])


# Python that the explorer writes: it makes the same bits.


ROOM = """<scene version="3.0.0">
  <sensor type="perspective"/><shape type="sphere"><transform name="to_world"><translate z="4"/></transform></shape>
  <emitter type="constant"><spectrum name="radiance" filename="../$lamp.spd"/></emitter>
</scene>
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize("view", [*VIEWS])
def test_the_python_of_a_view_makes_its_bits(view):
    controls = random_controls(random.Random(view))
    shot = photograph(small_transport(), controls)
    assert np.array_equal(ran(python_of(RENDER, controls, view))["picture"], VIEWS[view](shot))


@pytest.mark.thorough
def test_the_python_of_figures_makes_their_numbers():
    lamps = {"sun": Lamp("A", 3.0), "sky": Lamp(table=GAUSSIAN)}
    controls = replace(random_controls(random.Random(7)), lamps=lamps)
    exposed = photograph(small_transport(), controls).exposed
    assert ran(python_of(RENDER, controls, "histogram"))["figure"] == histogram(exposed.raw)
    assert ran(python_of(RENDER, controls, "pixel 3 5"))["figure"] == pixel(exposed, 3, 5)


@pytest.mark.thorough
def test_the_python_of_a_source_makes_its_transport():
    source = open_source("still_life", RenderOptions(size=20, spp=20, band_nm=80.0))
    states = list(source.states(never_cancel))
    assert [state.last for state in states] == [False, True]
    for state in states:
        names = ran(python_of(state.code, Controls()))
        assert np.array_equal(names["transport"].radiance, state.transport.radiance)


def test_the_python_of_a_file_opens_it_with_what_it_names_anywhere(tmp_path: Path):
    path = tmp_path / "room" / "room.xml"
    path.parent.mkdir()
    path.write_text(ROOM, "utf-8")
    (tmp_path / "lamp.spd").write_text("300 1\n900 2\n", "utf-8")
    options = RenderOptions(size=16, spp=1, band_nm=100.0, trust_scene=True, define=("lamp=lamp",))
    (state,) = open_source(str(path), options).states(never_cancel)
    names = ran(python_of(state.code, Controls()))
    lit, wanted = (each.relight().values for each in (names["transport"], state.transport))
    assert np.array_equal(lit, wanted)


def test_a_wrong_view_or_control_is_refused_in_one_line():
    for view, controls, words in (
        ("pictures", {}, "did you mean 'picture'"),
        ("pixel 3", {}, "pixel ROW COLUMN"),
        ("pixel 3 500", {}, "column: 500"),
        ("raw", {"level_cd_m": 3.0}, "level_cd_m2"),
        ("raw", {"lamps": {"sun": {"spectrum": 3}}}, "lamps"),
        ("raw", {"lens": 1j}, "lens"),
    ):
        refusal(public.explorer_view, small_transport(), view, **controls, match=rf"\A.*{words}.*\Z")


def test_a_transports_python_says_that_it_was_given():
    (state,) = of_transport(small_transport()).states(never_cancel)
    assert state.code == GIVEN
    assert "transport = ..." in python_of(state.code, Controls())


def test_the_python_is_laid_out_as_a_file_is():
    """Imports, sorted as they come, an empty line, the code without empty lines, and one at the end."""
    render = "import numpy as np\n\nfrom pathlib import Path\n\nbands = 3\n\ntransport = ...\n"
    assert python_of(render, Controls(seed=3), "raw") == (
        "import numpy as np\nfrom pathlib import Path\nimport rodcone\n\nbands = 3\ntransport = ...\n"
        "picture = rodcone.explorer_view(\n    transport,\n    'raw',\n    seed=3,\n)  # (h, w, 3) uint8\n"
    )
