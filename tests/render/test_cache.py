"""Finished renders on disk: found again to the bit, made again where anything differs or the file is damaged."""

from dataclasses import replace
from importlib import metadata
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest

from render import engine, runs
from render.cache import read_transport, save_transport
from render.denoised.denoise import Denoised
from render.engine import render
from render.error_estimates import Halves, SharedPaths
from render.illuminants import illuminant
from render.loader import Film
from render.scene import LightGroup
from render.spectrum import flat
from scenes.catalogue import load

BANDS_NM = np.arange(405.0, 780.0, 50.0)
NARROWER_NM = np.linspace(410.0, 750.0, 8)
SIZE = (3, 4)
ARRAYS = ("radiance", "light.difference", "variance", "irradiance", "coverage.mean", "wavelength_nm", "width_nm")
VALUES = ("spp", "stopped_by", "seconds", "integrator", "variant", "relative_mc_error")


def small(folder, scene=None, **options):
    settings = {"wavelength_nm": BANDS_NM, "spp": 8, "seed": 0} | options
    return render(scene or load("flat_field"), settings.pop("size", SIZE), cache=folder, **settings)


@pytest.fixture(scope="module")
def rendered():
    return small(None)


@pytest.fixture
def renders(rendered, monkeypatch):
    """Counts the renders made, and hands out one made before in their place."""
    made = []
    monkeypatch.setattr(engine, "_render", lambda *args: made.append(args) or rendered)
    return made


def assert_equal(one, other):
    for name in ARRAYS:
        a, b = attrgetter(name)(one), attrgetter(name)(other)
        assert a is b is None or (a.dtype == b.dtype and np.array_equal(a, b)), name
    for a, b in zip(one.seen, other.seen, strict=True):
        assert np.array_equal(a.mean, b.mean)
        assert np.array_equal(a.difference, b.difference)
    assert one.level() == other.level()
    assert [getattr(one, name) for name in VALUES] == [getattr(other, name) for name in VALUES]
    assert list(one.groups) == list(other.groups)
    assert np.array_equal(one.relight().values, other.relight().values)
    assert one.relight().relative_mc_error == other.relight().relative_mc_error


def test_a_scene_without_a_reference_plane_is_found_again(tmp_path, rendered, monkeypatch):
    scene = replace(load("flat_field"), reference_plane=None)
    monkeypatch.setattr(engine, "_render", lambda *args: rendered)
    one = small(tmp_path, scene)
    monkeypatch.setattr(engine, "_render", None)
    assert_equal(one, small(tmp_path, scene))


def test_the_folder_is_made_and_holds_one_whole_file_an_entry(tmp_path, renders):
    folder = tmp_path / "deep" / "cache"
    small(folder)
    small(str(folder), seed=1)  # a path may be text
    files = sorted(path.name for path in folder.iterdir())
    assert len(files) == len(renders) == 2
    assert all(name.startswith("flat_field-") and not name.endswith(".part") for name in files)


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 1},
        {"size": (4, 3)},
        {"max_depth": 7},
        {"wavelength_nm": NARROWER_NM},
        {"width_nm": 40.0},
        {"scene": load("flat_field", reflectance=0.25)},
        {"scene": replace(load("flat_field"), name="other")},
        {"scene": replace(load("flat_field"), reference_plane=None)},
        {"scene": replace(load("flat_field"), rr_depth=6)},
    ],
)
def test_anything_else_asked_for_is_another_entry(change, tmp_path, renders):
    small(tmp_path)
    small(tmp_path, **change)
    assert len(renders) == 2
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("fine_enough", [{}, {"spp": 4}, {"spp": None, "max_spp": 8}, {"noise": 10.0, "spp": 8}])
def test_a_render_that_is_fine_enough_is_returned(fine_enough, tmp_path, renders):
    one = small(tmp_path)
    assert_equal(small(tmp_path, **fine_enough), one)
    assert len(renders) == 1


def test_a_time_that_is_spent_is_not_spent_again(tmp_path, renders, rendered):
    small(tmp_path)
    small(tmp_path, spp=None, max_seconds=rendered.seconds)
    assert len(renders) == 1
    small(tmp_path, spp=None, max_seconds=10 * rendered.seconds)
    assert len(renders) == 2


def test_a_coarser_render_is_gone_on_from_and_the_finer_one_kept(tmp_path):
    coarse = small(tmp_path, spp=16)
    fine = small(tmp_path, spp=48)
    assert fine.spp == 48
    assert fine.seconds > coarse.seconds
    assert_equal(small(tmp_path, spp=48), fine)
    assert_equal(small(tmp_path, spp=16), fine)
    assert len(list(tmp_path.iterdir())) == 2, "a render, and the irradiance that `assert_equal` asks for"
    assert np.array_equal(fine.radiance, small(None, spp=48, resume=small(None, spp=16)).radiance)


def test_other_lights_in_the_same_places_share_an_entry(tmp_path, renders):
    small(tmp_path)
    other = small(tmp_path, load("flat_field", light="A"))
    assert len(renders) == 1
    assert other.groups["sky"].spectrum is illuminant("A")


def test_a_mesh_whose_file_changed_is_another_entry(tmp_path, renders):
    mesh = tmp_path / "ball.ply"
    scene = load("flat_field")
    scene = replace(scene, geometry=scene.geometry | {"ball": {"type": "ply", "filename": str(mesh)}})
    for content in (b"one", b"two", b"two"):
        mesh.write_bytes(content)
        small(tmp_path / "cache", scene)
    assert len(renders) == 2


def test_the_same_lights_in_other_groups_or_another_order_are_another_entry(tmp_path, renders):
    one = load("flat_field")
    geometry = one.geometry | {"lamp": {"type": "point", "position": [0, 0, 2]}}
    sky, lamp = LightGroup(("sky",), flat()), LightGroup(("lamp",), flat())
    together = {"all": LightGroup(("sky", "lamp"), flat())}
    for groups in ({"sky": sky, "lamp": lamp}, {"lamp": lamp, "sky": sky}, together):
        small(tmp_path, replace(one, geometry=geometry, groups=groups))
    assert len(renders) == 3


def test_a_render_of_other_versions_is_another_entry(tmp_path, renders, monkeypatch):
    told = metadata.version
    small(tmp_path)
    for library in ("mitsuba", "drjit"):
        monkeypatch.setattr(metadata, "version", lambda name, old=library: "0.1" if name == old else told(name))
        small(tmp_path)
    monkeypatch.setattr("render.cache.compiler_version", lambda: "0.1")
    small(tmp_path)
    monkeypatch.setattr("render.cache.ENGINE_VERSION", 10**6)
    small(tmp_path)
    monkeypatch.setattr("render.cache.INTEGRATOR", "another")
    small(tmp_path)
    monkeypatch.setattr("render.cache.variant", lambda: "another")
    small(tmp_path)
    assert len(renders) == 7


def test_lights_that_share_their_paths_do_so_when_they_are_read_back(tmp_path, rendered):
    """Or the error of both together would be told as that of independent ones."""
    scene = load("flat_field")
    (name, group), sun = next(iter(scene.groups.items())), "a second"
    scene = SimpleNamespace(**vars(scene) | {"groups": {name: group, sun: group}})
    twice = {field: np.repeat(getattr(rendered, field), 2, axis=0) for field in ("variance", "counts")}
    halves = Halves(*(np.repeat(getattr(rendered.light, field), 2, axis=0) for field in ("mean", "difference")))
    correlation = np.linspace(0.1, 0.9, twice["variance"][0].size, dtype=np.float32).reshape(
        twice["variance"].shape[1:]
    )
    shared = SharedPaths((0, 1), correlation)
    made = replace(rendered, light=halves, seen=rendered.seen * 2, groups=dict(scene.groups), shared=shared, **twice)
    film = Film(SIZE, BANDS_NM, np.full(BANDS_NM.size, 50.0), max_depth=8)
    save_transport(tmp_path, scene, film, 3, made)
    found = read_transport(tmp_path, scene, film, 3)
    assert found.shared.groups == (0, 1)
    assert np.array_equal(found.shared.correlation, correlation)
    assert read_transport(tmp_path, scene, film, 4) is None


def test_denoised_light_is_read_back_beside_the_unbiased(tmp_path, rendered):
    pytest.importorskip("mitsuba_oidn", reason="rodcone[denoise] is not installed")  # its version is in the key
    planes = np.arange(rendered.radiance.size, dtype=np.float32).reshape(rendered.radiance.shape)
    light = Denoised(planes, Halves(2 * planes, 3 * planes), Halves(4 * planes, 5 * planes), fold_points=6)
    scene, film = load("flat_field"), Film(SIZE, BANDS_NM, np.full(BANDS_NM.size, 50.0), max_depth=8)
    save_transport(tmp_path, scene, film, 3, replace(rendered, denoised=light))
    found = read_transport(tmp_path, scene, film, 3, denoised=True).denoised
    assert np.array_equal(found.radiance, planes)
    for times, values in enumerate(
        (found.indirect.mean, found.indirect.difference, found.folds.mean, found.folds.difference), 2
    ):
        assert np.array_equal(values, times * planes)
    assert found.fold_points == 6
    assert read_transport(tmp_path, scene, film, 3) is None  # an entry of its own


def after(folder, damage):
    """Renders, damages the file, renders twice again."""
    small(folder)
    (file,) = folder.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    results = small(folder), small(folder)
    assert [path.name for path in folder.iterdir()] == [file.name]
    return results


def flipped(position, bit=3):
    def damage(stored):
        stored = bytearray(stored)
        stored[position] ^= 1 << bit
        return bytes(stored)

    return damage


@pytest.mark.parametrize("kept", [0, 0.5, -1])
def test_a_truncated_file_is_rendered_again(kept, tmp_path, renders, rendered):
    results = after(tmp_path, lambda stored: stored[: int(kept * len(stored)) if 0 < kept < 1 else kept])
    assert len(renders) == 2
    for result in results:
        assert_equal(result, rendered)


@pytest.mark.thorough
def test_a_flipped_bit_anywhere_never_changes_a_result(tmp_path, renders, rendered):
    small(tmp_path)
    (file,) = tmp_path.iterdir()
    stored = file.read_bytes()
    for position in [*range(0, len(stored), 61), *range(len(stored) - 600, len(stored), 3)]:  # the directory is last
        for bit in (0, 3, 6):
            file.write_bytes(flipped(position, bit)(stored))
            assert_equal(small(tmp_path), rendered)
    assert len(renders) > 100  # most places are read


def test_a_scenes_name_can_not_lead_out_of_the_folder(tmp_path, renders):
    small(tmp_path / "cache", replace(load("flat_field"), name="../../a b/c"))
    (file,) = (tmp_path / "cache").iterdir()
    assert file.name.startswith(".._.._a_b_c-")
    assert sorted(path.name for path in tmp_path.rglob("*")) == sorted(["cache", file.name])


def test_a_file_that_can_not_be_written_leaves_nothing(tmp_path, renders, monkeypatch):
    def fail(*args):
        raise OSError("disk full")

    monkeypatch.setattr("rodcone.files.os.replace", fail)  # the last step: the whole file is under its other name
    with pytest.raises(OSError, match="disk full"):
        small(tmp_path)
    assert list(tmp_path.iterdir()) == []


class Killed(Exception):
    """Stands for a signal that ends the process."""


@pytest.mark.parametrize("spp", [40, pytest.param(100, marks=pytest.mark.thorough)])
def test_a_render_killed_on_its_way_goes_on_from_what_was_kept(spp, tmp_path, monkeypatch):
    """To the bits of one go, with a pilot and without; what was drawn before isn't drawn again."""
    monkeypatch.setattr(runs, "MOST_FLOATS", 1 << 13)
    scene = replace(load("cornell_box"), reference_plane=None)
    given = {"scene": scene, "size": (7, 9), "spp": spp}
    whole = small(None, **given)
    monkeypatch.setattr(engine, "KEEP_EVERY_S", 0.0)
    monkeypatch.setattr(engine, "KEEP_SHARE", np.inf)
    shares = []

    def killed(share, _):
        shares.append(share)
        if share > 0.6:
            raise Killed

    with pytest.raises(Killed):
        small(tmp_path, **given, progress=killed)
    kept = small(tmp_path, **given | {"spp": 2})
    assert 2 <= kept.spp <= 0.6 * whole.spp
    assert kept.stopped_by == "interrupt"
    on = []
    made = small(tmp_path, **given, progress=lambda share, _: on.append(share))
    assert on[0] > kept.spp / whole.spp
    for name in ("radiance", "light.difference", "variance", "coverage.mean", "coverage.difference", "counts"):
        assert np.array_equal(attrgetter(name)(made), attrgetter(name)(whole)), name
    assert (made.spp, made.stopped_by) == (whole.spp, "samples")


def test_a_short_render_is_kept_once(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(engine, "save_transport", lambda *given: kept.append(given))
    small(tmp_path, spp=40)
    assert len(kept) == 1
