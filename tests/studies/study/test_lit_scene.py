"""A study's scene: opened with its faults told, and lit by another spectrum at the luminance of its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from loop import loop
from PIL import Image
from refusal import refusal

from render.error_estimates import Halves
from render.illuminants import illuminant, spectral_luminance
from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.radiance_files.radiance_source import as_transport, load_radiance
from render.scene import LightGroup
from render.transport import Transport
from scenes.catalogue import load
from studies.budget.pilot import make_pilot
from studies.budget.plan import plan
from studies.budget.starting_points import plan_from_settings
from studies.study.equal_area import EqualArea, area_average
from studies.study.lit_scene import (
    digest_scene,
    level_luminance,
    make_transport,
    open_all,
    open_choice,
    under,
    white_spectrum,
)
from studies.study.scene_source import file_white, open_radiance_file
from studies.study.study import OWN, RenderLimits, SceneChoice, Study
from studies.sweep.cost import estimate_cost

NM = np.arange(385.0, 780.0, 10.0)
STUDY = Study((SceneChoice("still_life"),), ("25cd/m2",))
STUDY_OF_FILES = Study((SceneChoice("still_life"),), ("1cd/m2",))


def transport(luminances: tuple[float, float] = (100.0, 3.0)) -> Transport:
    """Two lights of which each fills one half of the picture, in equal shares at every wavelength."""
    flat = as_transport(SpectralRadiance(np.ones((2, 2, NM.size), dtype=np.float32), NM))
    halves = np.zeros((2, NM.size, 2, 2), dtype=np.float32)
    halves[0, :, :, 0] = halves[1, :, :, 1] = 1.0
    groups = {name: LightGroup((), illuminant("D65") * x) for name, x in zip("ab", luminances, strict=True)}
    return replace(flat, light=Halves(halves, 0 * halves), variance=0 * halves, groups=groups)


def test_another_spectrum_keeps_the_luminance_of_each_light() -> None:
    for spectrum in ["A", "F11", "LED-B3"]:
        lit = under(transport(), spectrum).relight()
        # bands of 10 nm against the 1 nm in which an illuminant is brought to 1 cd/m^2: 1 % with the lines of F11
        np.testing.assert_allclose(lit.luminance(), [[100.0, 3.0]] * 2, rtol=0.01)
        shape = illuminant(spectrum).band_average(NM, np.full(NM.size, 10.0))
        np.testing.assert_allclose(lit.values[0, 0], shape * 100.0, rtol=1e-6)


def test_own_changes_nothing_and_a_spectrum_has_its_luminance() -> None:
    given = transport()
    assert under(given, OWN) is given
    assert spectral_luminance(illuminant("A") * 7.0) == pytest.approx(7.0, rel=1e-9)


def test_levels_become_luminances() -> None:
    for level, per_cd_m2, luminance in [("25cd/m2", None, 25.0), ("25cd/m2", 4.0, 25.0), ("500lux", 4.0, 125.0)]:
        assert level_luminance(level, per_cd_m2) == luminance, (level, per_cd_m2, luminance)


def test_lux_need_light_on_a_plane() -> None:
    for per_cd_m2 in [None, 0.0]:
        refusal(level_luminance, "500lux", per_cd_m2, match="give it in cd/m2")


def test_the_longer_side_is_as_asked_and_a_file_keeps_its_own_proportions(tmp_path: Path) -> None:
    assert open_choice(SceneChoice("still_life"), STUDY).size == (256, 256)
    study = replace(STUDY, render=replace(STUDY.render, size=96))
    assert open_choice(SceneChoice("still_life"), study).size == (96, 96)
    text = """<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm"><integer name="width" value="80"/>
        <integer name="height" value="40"/></film></sensor><emitter type="constant"/></scene>"""
    (tmp_path / "wide.xml").write_text(text, "utf-8")
    choice = SceneChoice(str(tmp_path / "wide.xml"))
    assert open_choice(choice, STUDY).size == (40, 80)
    assert open_choice(choice, study).size == (48, 96)
    refusal(open_choice, replace(choice, light="A"), STUDY, match="a file that has its own")


def test_what_a_scene_cannot_do_is_told_when_it_is_opened(tmp_path: Path) -> None:
    refusal(open_choice, SceneChoice("stil_life"), STUDY, match="did you mean 'still_life'")
    sky = SceneChoice(str(tmp_path / "sky.xml"))
    Path(sky.source).write_text(
        '<scene version="3.0.0"><sensor type="perspective"/><emitter type="sunsky"/></scene>', "utf-8"
    )
    study = replace(STUDY, render=replace(STUDY.render, range_nm=(380.0, 720.0)))
    assert white_spectrum(open_choice(sky, study), OWN) is illuminant("D65")
    refusal(open_choice, sky, STUDY, match="a sunsky is known over 320-720 nm alone")
    refusal(open_choice, sky, replace(study, spectra=("own", "A")), match="colours of their own")


def test_colours_are_set_to_the_scenes_light_or_the_one_that_is_put_in_its_place(tmp_path: Path) -> None:
    opened = open_choice(SceneChoice("color_checker", "A"), STUDY)
    assert opened.scene is not None
    own = next(iter(opened.scene.groups.values())).spectrum
    assert white_spectrum(opened, OWN) is own
    assert white_spectrum(opened, "D65") is illuminant("D65")
    file = replace(opened, scene=None, choice=SceneChoice(str(ramp(tmp_path / "x.exr")), "A"))
    assert white_spectrum(file, OWN) is illuminant("A")


def test_a_scenes_identity_is_its_content() -> None:
    first, other = (open_choice(SceneChoice("color_checker", light), STUDY).identity for light in ("A", "D65"))
    assert first == open_choice(SceneChoice("color_checker", "A"), STUDY).identity
    assert first != other


def test_files_that_a_scene_names_count_by_their_content(tmp_path: Path) -> None:
    scene, mesh = load("flat_field"), tmp_path / "mesh.ply"
    mesh.write_bytes(b"one")
    with_mesh = replace(scene, geometry={**scene.geometry, "bunny": {"type": "ply", "filename": str(mesh)}})
    before = digest_scene(with_mesh)
    assert before == digest_scene(with_mesh)
    mesh.write_bytes(b"two")
    assert digest_scene(with_mesh) != before


# A study of a spectral picture file: what is assumed of it, and the sizes that are taken.


def ramp(path: Path, height: int = 20, width: int = 26, error: float = 0.0) -> Path:
    """Picture in equal-energy greys, darker from left to right."""
    values = np.broadcast_to(np.linspace(1.0, 0.05, width)[None, :, None], (height, width, NM.size))
    write_exr(SpectralRadiance(values * 1e-3, NM, error), path)
    return path


def test_what_is_assumed_of_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    uneven = np.array([450.0, 500.0, 600.0])
    write_exr(SpectralRadiance(np.ones((16, 16, 3)), uneven, width_nm=np.ones(3)), path)
    path.write_bytes(path.read_bytes().replace(b"rodconeBands_nm", b"elsewhereTold_x"))
    white = file_white(path, None)
    transport, notes = open_radiance_file(path, white)
    assert transport.width_nm.tolist() == [50, 75, 100]
    assert [("half-way" in note, "D65" in note) for note in notes] == [(True, False), (False, True)]
    assert all(note.startswith("a.exr: ") for note in notes)
    assert white.spectrum.band_average([450.0], [5.0]) > white.spectrum.band_average([650.0], [5.0])
    assert [note for note in open_radiance_file(path, file_white(path, "D65"))[1] if "D65" in note] == []


def test_a_photographs_spectra_go_by_name(tmp_path: Path) -> None:
    Image.new("RGB", (16, 16), (150, 140, 120)).save(tmp_path / "pale.png")
    lit, said, identity = [], [], []
    for spectra in (None, "surfaces", "srgb_basis"):
        choice = SceneChoice(str(tmp_path / "pale.png"), spectra=spectra)
        study = Study((choice,), ("1cd/m2",))
        opened = open_choice(choice, study)
        transport, notes = make_transport(opened, study, None, tmp_path, lambda share, error: None)
        pilot = make_pilot(opened, study, (7,)).transport
        assert np.array_equal(pilot.relight().values, transport.relight().values)
        lit.append(transport.relight().values[0, 0])
        said.append([note for note in notes if "doesn't tell spectra" in note])
        identity.append(opened.identity)
    assert lit[0] == pytest.approx(lit[1], rel=1e-12)
    assert np.abs(lit[2] / lit[0] - 1).max() > 0.02
    basis = load_radiance(tmp_path / "pale.png", spectra="srgb_basis")
    assert lit[2] == pytest.approx(basis.values[0, 0], rel=1e-6)
    assert said[0] == said[1]
    assert ["Otsu" in said[0][0], "Mallett" in said[2][0]] == [True, True]
    assert identity[2] not in identity[:2]


def test_spectra_are_a_photographs_alone(tmp_path: Path) -> None:
    exr = SceneChoice(str(ramp(tmp_path / "a.exr")), spectra="srgb_basis")
    refusal(open_choice, exr, STUDY_OF_FILES, match="spectra: 'srgb_basis' for .*which has its own")
    refusal(open_choice, SceneChoice("still_life", spectra="surfaces"), STUDY, match="allowed: with a photograph")
    Image.new("RGB", (16, 16)).save(tmp_path / "a.png")
    wrong = SceneChoice(str(tmp_path / "a.png"), spectra="surface")
    refusal(open_choice, wrong, STUDY_OF_FILES, match="spectra: .*did you mean 'surfaces'")


@pytest.mark.parametrize("size", [None, 16])
def test_a_size_that_a_picture_does_not_take_is_told(tmp_path: Path, size: int | None) -> None:
    choice = SceneChoice(str(ramp(tmp_path / "a.exr")))
    study = Study((choice,), ("1cd/m2",), render=RenderLimits(size=size))
    lit, notes = make_transport(open_choice(choice, study), study, None, tmp_path, lambda share, error: None)
    assert lit.counts.shape == (20, 26)
    assert any("render.size" in note for note in notes) == (size is not None)


@pytest.mark.parametrize(("height", "width"), [(15, 20), (20, 4097)])
def test_picture_of_a_size_that_no_camera_takes_is_refused(tmp_path: Path, height: int, width: int) -> None:
    path = ramp(tmp_path / "a.exr", height, width)
    refusal(open_radiance_file, path, file_white(path, "E"), match=r"a\.exr: side")


# Sensors of one size: means over pixels of another grid, by hand, and the pixels that a pitch makes.


RNG = np.random.default_rng(3)
CENTRES_NM = np.array([450.0, 550.0, 650.0])


def test_whole_factors_are_means_of_blocks_and_a_finer_grid_repeats() -> None:
    picture = RNG.random((6, 8, 3))
    blocks = picture.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    assert area_average(picture, (3, 4)) == pytest.approx(blocks, rel=1e-12)
    assert area_average(blocks, (6, 8)) == pytest.approx(blocks.repeat(2, 0).repeat(2, 1), rel=1e-12)
    assert area_average(picture, (6, 8)) == pytest.approx(picture, rel=1e-12)


def test_pixels_follow_from_the_pitch_in_the_pictures_proportions() -> None:
    area = EqualArea(side_um=883.2, coarsest_um=6.9)
    assert area.shape((300, 400), 6.9) == (96, 128)
    assert area.shape((400, 300), 2.2) == (401, 301)
    assert area.shape((400, 300), 2.2, block=2) == (402, 302)
    view = area.view(SpectralRadiance(RNG.random((30, 40, 3)), CENTRES_NM), 6.9)
    assert view.shape == (96, 128)
    assert view.wavelength_nm == pytest.approx(CENTRES_NM)


def test_a_render_of_fewer_pixels_than_a_sensor_is_refused_and_memory_counts_the_sensors() -> None:
    asked = Study(
        scenes=(SceneChoice("flat_field"),),
        levels=("1cd/m2",),
        sensors=("low_noise",),
        sensor_side_um=220.0,
        render=RenderLimits(size=64),
    )
    refusal(open_all, asked, match=r"render\.size: 64, and low_noise has 100 pixels on 220 um; allowed: 100")
    need = [
        estimate_cost(study, plan_from_settings(study), open_all(study), 1, 0).largest_bytes
        for study in (replace(asked, render=RenderLimits(size=size)) for size in (100, 400))
    ]
    assert need[1] > need[0]


def test_a_plan_of_sensors_of_one_size_is_refused() -> None:
    asked = Study(scenes=(SceneChoice("flat_field"),), levels=("1cd/m2",), sensors=("low_noise",), sensor_side_um=220.0)
    refusal(plan, asked, match="sensor_side_um: 220 can't be planned")


@loop(
    ("picture", "pitch_um", "block", "shape"),
    [
        ((30, 40), 10.0, 1, (60, 80)),  # 800 um by 600 um
        ((40, 30), 10.0, 1, (80, 60)),
        ((30, 40), 33.0, 1, (18, 24)),  # 18.2 and 24.2
        ((30, 40), 10.0, 4, (60, 80)),
        ((30, 40), 10.0, 7, (63, 77)),  # 8.6 and 11.4 blocks
        ((1, 400), 10.0, 1, (1, 80)),  # 0.2 of a pixel, which stays one
        ((400, 1), 10.0, 3, (81, 3)),  # 26.7 blocks, and one
    ],
)
def test_a_sensor_of_a_side_has_whole_blocks_in_the_pictures_proportions(picture, pitch_um, block, shape):
    assert EqualArea(side_um=800.0, coarsest_um=33.0).shape(picture, pitch_um, block) == shape
