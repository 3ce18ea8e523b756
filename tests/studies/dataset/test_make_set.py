"""A study becomes shards: the same bits whoever makes them, read alike by two readers, nothing lost or overwritten."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import time
from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from refusal import refusal

from render.radiance_files.radiance_source import extent_of
from render.surfaces import see_surfaces
from rodcone.digests import digest
from scenes.catalogue import load
from sensor.response import imaged_electrons
from studies.dataset import make_set as make_set_module
from studies.dataset import order as order_module
from studies.dataset import sample as sample_module
from studies.dataset import shards as shards_module
from studies.dataset.make_set import CARD, make_set
from studies.dataset.order import SetOrder
from studies.dataset.sample import Sample
from studies.dataset.shards import MANIFEST, Shard, read_manifest, read_shard, split_of
from studies.study.lit_scene import open_all, photographed, under
from studies.study.model import LensTerms
from studies.study.study import RenderLimits, SceneChoice
from studies.study.study_file import read_study
from studies.sweep.cluster import on_cluster
from studies.sweep.database import open_results
from studies.sweep.prepare import Job, scene_cells, scene_transport
from studies.sweep.provenance import versions
from studies.sweep.run_sweep import sweep
from studies.sweep.workers import InThisProcess, run, run_in_processes

ORDER = SetOrder(shards=3, crop=16)
LISTED = "key scene scene_hash spectrum level luminance_cd_m2 exposure sensor mosaic tile snr_db saturated render_noise"
HERE = partial(run, executor=InThisProcess())
STUDY = """
scenes = [{{ source = "scene.exr", light = "E" }}]
levels = ["1cd/m2", "25cd/m2"]
processors = ["bayer", "interleaved"]
seeds = 2
"""


def made(folder: Path, out: str = "out", runner: Any = HERE, order: SetOrder = ORDER, **changes: Any) -> Path:
    """Set of the small study: 16x20 pixels at two levels, two seeds, Bayer and RGBW."""
    study = SAMPLE.small_study(folder, processors=("bayer", "interleaved"), **changes)
    return Path(make_set(study, folder / out, order, "rodcone dataset", runner)["folder"])


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("set"))


def test_two_readers_give_the_same_arrays(stored: Path, tmp_path: Path) -> None:
    """The other one is tar itself."""
    shards = sorted(stored.glob("*.tar"))
    samples = [sample for path in shards for sample in read_shard(path)]
    assert len(samples) == 2 * 2 * 2
    for path in shards:
        subprocess.run(["tar", "-xf", path, "-C", tmp_path], check=True)
    files = list(tmp_path.iterdir())
    assert {path.stat().st_mtime for path in files} == {0.0}
    assert len(files) == len(samples) * (1 + 1 + 5)  # raw, facts, and planes of a picture without surfaces
    for arrays, facts in samples:
        assert arrays["raw"].shape == (16, 16)
        assert arrays["raw"].dtype == np.uint16
        assert {array.dtype for name, array in arrays.items() if name != "raw"} == {np.dtype(np.float32)}
        assert set(arrays) == {"raw", "mosaic_e", "channels_e", "rgb", "xyz", "shares"}
        for name, array in arrays.items():
            other = np.load(tmp_path / f"{facts['key']}.{name}.npy")
            np.testing.assert_array_equal(array, other, strict=True)
        assert facts == json.loads((tmp_path / f"{facts['key']}.json").read_text("utf-8"))


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # it leaves files open
def test_webdataset_reads_them_too(stored: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    ours = {facts["key"]: arrays for path in sorted(stored.glob("*.tar")) for arrays, facts in read_shard(path)}
    urls = [str(path) for path in sorted(stored.glob("*.tar"))]
    theirs = {x["__key__"]: x for x in webdataset.WebDataset(urls, shardshuffle=False).decode()}
    assert set(theirs) == set(ours)
    for key, arrays in ours.items():
        for name, array in arrays.items():
            np.testing.assert_array_equal(theirs[key][f"{name}.npy"], array, strict=True)


def test_planes_are_what_the_light_says(tmp_path: Path) -> None:
    folder = made(tmp_path, order=SetOrder(shards=1))
    for arrays, facts in read_shard(next(folder.glob("*.tar"))):
        tile, order = facts["tile"], facts["channels"]
        for row, column in np.ndindex(4, 4):
            behind = arrays["channels_e"][row, column, order.index(tile[row % 2][column % 2])]
            assert arrays["mosaic_e"][row, column] == pytest.approx(behind, rel=1e-6)
        assert arrays["xyz"][..., 1].mean() == pytest.approx(facts["luminance_cd_m2"], rel=1e-6)
        np.testing.assert_allclose(arrays["shares"], 1.0, atol=1e-6)
        light = facts["illuminants"]
        per_nm = np.array(light["groups"][facts["groups"][0]])
        assert per_nm.shape == SAMPLE.NM.shape == np.array(light["wavelength_nm"]).shape


@pytest.mark.thorough
def test_a_rendered_scene_has_its_surfaces_versions_and_the_licences_of_its_pictures(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=4, band_nm=50.0)
    folder = made(tmp_path, order=SetOrder(shards=1), scenes=(SceneChoice("diorama-5"),), render=limits)
    seen = see_surfaces(load("diorama-5"), (16, 16))
    head, scene = read_manifest(folder)[:2]
    samples = list(read_shard(next(folder.glob("*.tar"))))
    assert len(samples) == 8
    for arrays, facts in samples:
        np.testing.assert_array_equal(arrays["depth"], seen.depth_m, strict=True)
        np.testing.assert_array_equal(arrays["normals"], seen.normal, strict=True)
        np.testing.assert_array_equal(arrays["ids"], np.stack([seen.object_id, seen.material_id], -1), strict=True)
        assert facts["rodcone"] == head["rodcone"]
    assert (tuple(scene["objects"]), tuple(scene["materials"])) == (seen.objects, seen.materials)
    assert head["versions"] == versions()
    assert "scikit-image" in scene["licence"]
    assert scene["licence"] in (folder / CARD).read_text("utf-8")


@pytest.mark.thorough
def test_the_same_bits_over_workers(stored: Path, tmp_path: Path) -> None:
    assert content(made(tmp_path, runner=partial(run_in_processes, workers=4))) == content(stored)


@pytest.mark.parametrize("name", ["versions", "code_digests"])
def test_a_worker_with_another_rodcone_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def elsewhere(shards: Sequence[Shard], make: Any) -> Generator[Shard, None, None]:
        monkeypatch.setattr(shards_module, name, lambda: {"rodcone": "another"})
        yield from map(make, shards)

    refusal(made, tmp_path, runner=elsewhere, match=r"worker on .*: its rodcone or packages aren't the set's")
    assert not list((tmp_path / "out" / "set").glob("*.tar"))


def test_a_shards_key_covers_all_code_that_decides_its_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_module, "digest_file", lambda path: path.name)
    covered = set(sample_module.code_digests.__wrapped__())
    assert {"shards.py", "sample.py", "render_noise.py", "frames.py"} <= covered


@pytest.mark.slow
def test_the_same_bits_over_a_cluster(stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # workers import nothing of the folder in which they start
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        on_cluster(cluster.scheduler_address) as runner,
    ):
        assert content(made(tmp_path, runner=runner)) == content(stored)


def test_a_set_goes_on_where_it_was_stopped_and_mends_a_shard_cut_in_half(stored: Path, tmp_path: Path) -> None:
    calls: list[str] = []

    def stopped(shards: Sequence[Shard], make: Any, most: int = 1) -> Generator[Shard, None, None]:
        for count, shard in enumerate(shards):
            if count == most:
                raise KeyboardInterrupt
            calls.append(shard.path.name)
            yield make(shard)

    with pytest.raises(KeyboardInterrupt):
        made(tmp_path, runner=stopped)
    assert len([line for line in read_manifest(tmp_path / "out" / "set") if line["kind"] == "shard"]) == 1
    folder = made(tmp_path, runner=partial(stopped, most=99))
    assert len(calls) == len(set(calls)) == 3  # none twice
    assert content(folder) == content(stored)
    half = next(folder.glob("*.tar"))
    half.write_bytes(half.read_bytes()[: half.stat().st_size // 2 + 100])
    refusal(list, read_shard(half), match=f"{half.name}: it is no whole shard")
    made(tmp_path, runner=partial(stopped, most=99))
    assert calls[3:] == [half.name]
    assert content(folder) == content(stored)


@pytest.mark.thorough
def test_the_same_bits_after_a_kill(stored: Path, tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr")
    (tmp_path / "study.toml").write_text(STUDY.format())
    command = [sys.executable, "-m", "rodcone", "dataset", "study.toml", "-o", "out", "--shards", "3", "--crop", "16"]
    first = subprocess.Popen([*command, "--workers", "2"], cwd=tmp_path, start_new_session=True)
    folder, end = tmp_path / "out" / "set", time.monotonic() + 120
    while not list(folder.glob("*.tar")) and first.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    subprocess.run([*command, "--workers", "1"], cwd=tmp_path, check=True, capture_output=True)
    found, whole = content(folder), content(stored)
    assert found.keys() == whole.keys()
    assert {x: found[x] for x in whole if x.endswith(".tar")} == {x: whole[x] for x in whole if x.endswith(".tar")}


@pytest.mark.thorough
def test_the_whole_frame_is_that_of_the_sweep(tmp_path: Path) -> None:
    """The same study swept in the same folder develops the frames that the set holds: nothing is rendered twice."""
    folder = made(tmp_path, order=SetOrder(truth="rgb", shards=1))
    frames = {path.name for path in (tmp_path / "out" / "frames").rglob("*.npy")}
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "interleaved"))
    sweep(study, tmp_path / "out", SAMPLE.stated(study), SAMPLE.here)
    assert {path.name for path in (tmp_path / "out" / "frames").rglob("*.npy")} == frames
    assert len(list(read_shard(next(folder.glob("*.tar"))))) == 8


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"order": SetOrder(crop=32)}, "crop: 32 exceeds the frames' side"),
        ({"order": SetOrder(crop=17)}, "crop: 17 cuts the tile of 2x2 pixels; allowed: its multiples; give 16"),
        ({"sensors": ("dual_gain",)}, "'dual_gain' bins or merges readings"),
        ({"frames": (2,)}, r"frames: \[2\] in a data set"),
        ({"sensor_side_um": 100.0}, "sensor-side-um: 100.0 in a data set"),
        ({"lens": LensTerms(shake="hand")}, "shake: 'hand' in a data set"),
        ({"flicker": "pwm@1000Hz:0.25"}, "flicker: .* in a data set"),
    ],
)
def test_what_no_set_can_hold_is_told_in_a_line(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    refusal(made, tmp_path, **changes, match=words)


def test_parts_that_exceed_a_scenes_frame_are_refused_before_its_render(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(make_set_module, "scene_cells", lambda *_: pytest.fail("a scene is rendered"))
    drawn = {"scenes": (SceneChoice("generated-1f"),), "render": RenderLimits(size=32)}
    refusal(made, tmp_path, **drawn, order=SetOrder(crop=34), match="crop: 34 exceeds the frames' side, 32; allowed")
    drawn["scenes"] += (SceneChoice(str(SAMPLE.picture(tmp_path / "scene.exr")), "E"),)
    refusal(made, tmp_path, **drawn, order=SetOrder(crop=18), match="crop: 18 exceeds the frames' side, 16; allowed")


def test_scenes_whose_samples_would_share_a_key_are_told_in_a_line(tmp_path: Path) -> None:
    scenes = [SceneChoice(str(SAMPLE.picture(tmp_path / name)), "E") for name in ("a b.exr", "a-b.exr")]
    words = r"two frames would be named 'a-bpexr_own_1cd-m2_.*_s0'; allowed: names that differ; rename one"
    refusal(made, tmp_path, scenes=tuple(scenes), match=words)


def test_a_wrong_order_is_told_in_a_line() -> None:
    for values, words in (
        ({"truth": "rgb,depht"}, "did you mean 'depth'"),
        ({"generated": -1}, "generated: -1"),
        ({"shards": 0}, "shards: 0"),
        ({"crop": 3}, "crop: 3"),
    ):
        refusal(SetOrder, **values, match=words)  # type: ignore[arg-type]


def test_another_set_and_foreign_files_are_refused_before_any_render_and_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "out" / "set"
    made(tmp_path)
    before = content(folder)
    monkeypatch.setattr(make_set_module, "scene_cells", lambda *_: pytest.fail("a scene is rendered"))
    other_scene = (SceneChoice(str(SAMPLE.picture(tmp_path / "scene.exr", (16, 24))), "E"),)
    orders = [SetOrder(shards=2, crop=16), SetOrder(shards=3, crop=16, truth="rgb")]
    for changes in ({"seeds": (0, 1, 2)}, *({"order": order} for order in orders), {"scenes": other_scene}):
        refusal(made, tmp_path, **changes, match="holds another set, 'rodcone dataset'")
    SAMPLE.picture(tmp_path / "scene.exr")
    (folder / "thesis.tar").write_bytes(b"mine")
    refusal(made, tmp_path, match=r"holds a foreign file, 'thesis.tar'; allowed: a set; move it away")
    assert content(folder) == before | {"thesis.tar": b"mine"}
    strange = tmp_path / "strange"
    strange.mkdir()
    (strange / "letter.txt").write_text("mine")
    refusal(made, tmp_path, out="strange", match=r"holds other files, such as 'letter.txt'")


def test_a_set_of_other_parts_is_another_set(tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr", (32, 32))
    made(tmp_path, order=SetOrder(shards=3, crop=32))
    for other in (SetOrder(shards=3, crop=16), SetOrder(shards=2, crop=32), SetOrder(shards=3, crop=32, truth="rgb")):
        refusal(made, tmp_path, order=other, match="holds another set, 'rodcone dataset'")


def test_a_disk_too_small_is_told_before_anything_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type(shutil.disk_usage(tmp_path))
    monkeypatch.setattr(order_module.shutil, "disk_usage", lambda _: usage(100_000, 0, 100_000))
    refusal(made, tmp_path, match=r"out: the set needs about [\d.e-]+ GB more; allowed: 0.0001 GB")
    assert list((tmp_path / "out" / "set").iterdir()) == []


def test_the_room_asked_for_is_that_of_the_set(tmp_path: Path) -> None:
    """It is over what is written, and not by more than heads and rounding: 20 kB a sample."""
    folder = made(tmp_path, order=SetOrder(shards=1))
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "interleaved"))
    needed = order_module.bytes_needed(study, SAMPLE.stated(study), open_all(study).values(), SetOrder(shards=1))
    written = sum(path.stat().st_size for path in (tmp_path / "out").rglob("*.npy")) + sum(
        path.stat().st_size for path in folder.glob("*.tar")
    )
    assert 0.5 * needed < written < 1.3 * needed


def test_the_room_asked_for_is_the_sum_of_its_parts(tmp_path: Path) -> None:
    """Bayer has three channels and RGBW four; one light group, eight frames."""
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "interleaved"))
    pixels, frames, spectra = extent_of(tmp_path / "scene.exr")[0], 2 * 2, 1  # by the file's bytes
    needed = order_module.bytes_needed(study, SAMPLE.stated(study), open_all(study).values(), SetOrder())
    fixed = 2 + 12 + 12 + 4 + 12 + 4 + 4  # raw, rgb, xyz, depth, normals, ids, mosaic
    parts = [frames * (pixels * (fixed + 4 * n + 4) + 20_000) + spectra * 4 * pixels * (20 + n) for n in (3, 4)]
    assert needed == sum(parts), "a file's light is there already"


def test_a_set_of_one_frame_is_the_frame_of_the_study(tmp_path: Path) -> None:
    study = SAMPLE.small_study(tmp_path, levels=("25cd/m2",), seeds=(4,))
    told = make_set(study, tmp_path / "out", SetOrder(truth="rgb"), "rodcone dataset", HERE)
    assert (told["samples"], told["shards"], told["made"]) == (1, 1, 1)
    ((arrays, facts),) = [x for path in Path(told["folder"]).glob("*.tar") for x in read_shard(path)]
    assert (arrays["raw"].shape, facts["window"], facts["seed"], facts["level"]) == (
        *(SAMPLE.SIZE, [0, 0, *SAMPLE.SIZE]),
        *(4, "25cd/m2"),
    )
    (line,) = [x for x in read_manifest(Path(told["folder"])) if x["kind"] == "sample"]
    assert {name: facts[name] for name in line if name != "kind"} == {k: v for k, v in line.items() if k != "kind"}
    assert "1 raw frames" in (Path(told["folder"]) / CARD).read_text("utf-8")


def test_planes_are_by_the_names_of_the_page() -> None:
    """All eight without an order, in the order in which they are cut; one alone where it is asked for."""
    names = ("mosaic_e", "channels_e", "rgb", "xyz", "depth", "normals", "ids", "shares")
    assert SetOrder().planes == names
    assert [SetOrder(truth=name).planes for name in names] == [(name,) for name in names]


def test_a_value_at_a_bound_of_the_cards_histograms_is_counted_above_it(stored: Path) -> None:
    lines = [dict(line) for line in read_manifest(stored)]
    for line, snr_db, share in zip((x for x in lines if x["kind"] == "sample"), (0, 10, 10, 20, 30, 29, -1, 5),
                                   (0.01, 0.03, 0.1, 0.3, 1.0, 0.99, 0.0, 0.02), strict=True):  # fmt: skip
        line |= {"snr_db": snr_db, "render_noise": {"mean": share, "of_95_percent": share}}
    text = make_set_module.card(lines)
    for words in ("under 0 | 1", "0 to 10 | 2", "10 to 20 | 2", "20 to 30 | 2", "30 and more | 1"):
        assert f"| {words} |" in text, words
    for words in ("under 0.01 | 1", "0.01 to 0.03 | 2", "0.03 to 0.1 | 1", "0.1 to 0.3 | 1", "0.3 to 1 | 2"):
        assert f"| {words} |" in text, words


def test_splits_hold_their_shares_and_no_scene_twice() -> None:
    # digests of 4 000 names: 3 200 in train with a standard deviation of 25, of which 5 are one in 2 million
    names = [split_of(digest(index)) for index in range(4000)]
    assert abs(names.count("train") - 3200) < 5 * 25.3
    assert abs(names.count("test") - 400) < 5 * 19.0
    # the bounds themselves
    assert split_of("0" * 32) == "train"
    assert split_of(f"{int(0.85 * 16**12):012x}" + 20 * "0") == "validation"
    assert split_of("f" * 32) == "test"


def test_manifest_and_card_count_what_is_there(stored: Path) -> None:
    lines = read_manifest(stored)
    samples = [line for line in lines if line["kind"] == "sample"]
    scenes = {line["hash"]: line["split"] for line in lines if line["kind"] == "scene"}
    shards = [line for line in lines if line["kind"] == "shard"]
    assert lines[0]["samples"] == len(samples) == sum(line["samples"] for line in shards) == 8
    assert {scenes[line["scene_hash"]] for line in samples} == {line["split"] for line in shards}
    assert [line["name"] for line in shards] == sorted(path.name for path in stored.glob("*.tar"))
    assert [line["bytes"] for line in shards] == [(stored / line["name"]).stat().st_size for line in shards]
    text = (stored / CARD).read_text("utf-8")
    assert "8 raw frames" in text
    assert "| 1cd/m2 | 4 |" in text
    noisy = sum(line["render_noise"]["of_95_percent"] >= 1 for line in samples)
    assert f"| 1 and more | {noisy} |" in text


def test_a_samples_snr_is_counted_from_what_its_shard_holds(stored: Path) -> None:
    """Ten times the logarithm of a ratio of powers: mean square of the light over that of its stated noise."""
    for line in read_manifest(stored):
        if line["kind"] != "shard":
            continue
        for arrays, facts in read_shard(stored / line["name"]):
            variance = np.zeros(arrays["mosaic_e"].shape)
            tile, gain = facts["tile"], facts["gain_e_per_dn"]
            for row, column in np.ndindex(len(tile), len(tile[0])):
                at, noise = np.s_[row :: len(tile), column :: len(tile[0])], facts["noise"][tile[row][column]]
                dn = arrays["mosaic_e"][at] / gain
                variance[at] = (noise["a"] * dn + noise["b"] + noise["c"] * dn**2) * gain**2
            power = float((arrays["mosaic_e"].astype(float) ** 2).mean() / variance.mean())
            assert facts["snr_db"] == pytest.approx(10 * np.log10(power), abs=0.01)


def test_a_manifest_that_lacks_what_is_read_is_refused(stored: Path, tmp_path: Path) -> None:
    lines = read_manifest(stored)
    for kind, names in (
        ("set", "kind name rodcone command identity samples planes"),
        ("scene", "kind split licence"),
        ("shard", "kind name split samples bytes digest made_from"),
        ("sample", f"kind {LISTED}"),
    ):
        index, line = next((index, line) for index, line in enumerate(lines) if line["kind"] == kind)
        for name in names.split():
            short = {key: value for key, value in line.items() if key != name}
            text = "".join(f"{json.dumps(x)}\n" for x in (*lines[:index], short, *lines[index + 1 :]))
            (tmp_path / MANIFEST).write_text(text)
            words = "no manifest of a set" + ("" if name == "kind" else f".*line {index + 1} has no '{name}'")
            refusal(read_manifest, tmp_path, match=words)


def test_what_is_no_manifest_is_refused(tmp_path: Path) -> None:
    """Nothing, no lines, no JSON, a number for a line, a line of another kind, and one that begins with a scene."""
    whole = {"kind": "set", "name": "a", "rodcone": "1", "command": "c", "identity": "i", "samples": 0, "planes": []}
    refusal(read_manifest, tmp_path, match=f"{MANIFEST}: it is no manifest of a set")
    for text in ("", "kind", "17\n", '{"kind": "scene"}\n', f'{json.dumps(whole)}\n{{"kind": "holiday"}}\n'):
        (tmp_path / MANIFEST).write_text(text)
        refusal(read_manifest, tmp_path, match=f"{MANIFEST}: it is no manifest of a set.*run that again")
    (tmp_path / MANIFEST).write_text(json.dumps(whole))
    assert read_manifest(tmp_path) == [whole]


def test_what_is_no_shard_is_refused(tmp_path: Path) -> None:
    """No tar file, an array without a byte, one that is cut, facts that are no JSON, a member without an ending."""
    path = tmp_path / "train-000000.tar"
    cut = BytesIO()
    np.save(cut, np.arange(9))
    for name, content in (
        *(("a.raw.npy", b""), ("a.raw.npy", cut.getvalue()[:-4])),
        *(("a.json", b"{"), ("json", b"{}")),
    ):
        with tarfile.open(path, "w") as tar:
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, BytesIO(content))
        refusal(list, read_shard(path), match=f"{path.name}: it is no whole shard")
    path.write_bytes(b"mine")
    refusal(list, read_shard(path), match=f"{path.name}: it is no whole shard")


def test_a_shards_key_has_all_that_decides_it(stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each field of a sample that its bytes follow is changed alone; the folder of its files doesn't matter."""
    cells = SAMPLE.made_cells(tmp_path)
    files = {"rgb": Path("a/one.npy"), "xyz": Path("a/two.npy")}
    sample = Sample("k", cells[0], "bayer", "0" * 32, "train", files, {}, None, (0, 0, 16, 20))
    changes: list[dict[str, Any]] = [
        {"key": "l"},
        {"cell": cells[1]},
        {"part": 0},
        *({"window": window} for window in ((1, 0, 16, 20), (0, 1, 16, 20), (0, 0, 15, 20), (0, 0, 16, 19))),
        {"files": files | {"xyz": Path("a/three.npy")}},
        {"files": {"rgb": files["rgb"]}},
    ]
    keys = [shards_module.shard_key([replace(sample, **change)]) for change in ({}, *changes)]
    keys += [shards_module.shard_key([]), shards_module.shard_key([sample, sample])]
    assert len(set(keys)) == len(keys)
    elsewhere = {name: Path("b") / path.name for name, path in files.items()}
    assert shards_module.shard_key([replace(sample, files=elsewhere)]) == keys[0]
    for name in ("versions", "code_digests"):
        with monkeypatch.context() as other:
            other.setattr(shards_module, name, lambda: ["another"])
            assert shards_module.shard_key([sample]) != keys[0]


def test_shards_are_as_many_as_a_splits_samples_are_in_proportion(tmp_path: Path) -> None:
    """Of ten shards for 31, 6 and 3 samples: 7.75, 1.5 and 0.75, rounded to even; the parts differ by one at most."""
    cell = SAMPLE.made_cells(tmp_path)[0]
    splits = ["train"] * 31 + ["validation"] * 6 + ["test"] * 3
    samples = [
        Sample(f"k{n}", cell, "bayer", "0" * 32, split, {}, {}, None, (0, 0, 16, 20)) for n, split in enumerate(splits)
    ]
    shards = shards_module.into_shards(samples, 10, tmp_path)
    counts = {split: [len(x.samples) for x in shards if x.path.name.startswith(split)] for split in set(splits)}
    assert {split: len(of) for split, of in counts.items()} == {"train": 8, "validation": 2, "test": 1}
    assert {split: sum(of) for split, of in counts.items()} == {"train": 31, "validation": 6, "test": 3}
    assert all(max(of) - min(of) <= 1 for of in counts.values())
    assert [x.path for x in shards[:2]] == [tmp_path / "train-000000.tar", tmp_path / "train-000001.tar"]
    assert all({x.split for x in shard.samples} == {shard.path.name.split("-")[0]} for shard in shards)
    assert all(shard.key == shards_module.shard_key(shard.samples) for shard in shards)
    first = [int(x.key[1:]) for x in shards[0].samples]
    assert max(np.diff(sorted(first))) > 1, "a shard mixes scenes"
    # one sample of a split has a file even where its share is small, and none has more files than samples
    assert [len(shards_module.into_shards(samples, n, tmp_path)) for n in (1, 1000)] == [3, 40]


def test_a_sets_progress_is_that_of_its_renders_then_of_its_shards(tmp_path: Path) -> None:
    """Renders are 0.9 of it, scene by scene; then a tenth by shards."""
    told: list[tuple[str, float]] = []
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "interleaved"))
    make_set(study, tmp_path / "out", ORDER, "rodcone dataset", HERE, lambda *asks: told.append(asks))
    shards = [(words, share) for words, share in told if words.startswith("shard")]
    assert [words for words, _ in shards] == [f"shard {n} of 3" for n in (1, 2, 3)]
    assert [share for _, share in shards] == pytest.approx([0.9 + 0.1 * n / 3 for n in (1, 2, 3)])
    told.clear()
    for index, share in ((0, 0.0), (0, 0.5), (2, 0.25), (3, 1.0)):
        make_set_module._show_render(lambda *asks: told.append(asks), index, 4, share, 0.01)
    assert [share for _, share in told] == pytest.approx([0.0, 0.1125, 0.50625, 0.9])
    assert [words.split(": ")[0] for words, _ in told] == [f"scene {n} of 4" for n in (1, 1, 3, 4)]


def test_parts_are_numbered_where_there_are_several(tmp_path: Path) -> None:
    """A frame of 16 by 20 pixels is one part of 16, and a whole; one of 40 by 36 holds four of 16 without its rest."""
    asked: list[Sample] = []

    def asking(shards: Sequence[Shard], make: Any) -> Generator[Shard, None, None]:
        asked.extend(x for shard in shards for x in shard.samples)
        yield from map(make, shards)

    windows = [(row, column, 16, 16) for row in (0, 16) for column in (0, 16)]
    for crop, size, wanted in (
        *((None, (16, 20), {None: (0, 0, 16, 20)}), (16, (16, 20), {None: (0, 0, 16, 16)})),
        (16, (40, 36), dict(enumerate(windows))),
        (16, (31, 47), {0: (0, 0, 16, 16), 1: (0, 16, 16, 16)}),
    ):
        asked.clear()
        out, order = f"{crop} {size[0]}", SetOrder(shards=1, crop=crop, truth="rgb")
        SAMPLE.picture(tmp_path / "scene.exr", size)
        study = SAMPLE.small_study(tmp_path, levels=("1cd/m2",), seeds=(0,))
        make_set(study, tmp_path / out, order, "rodcone dataset", asking)
        assert {x.part: x.window for x in asked} == wanted
        for x in asked:
            place = "" if crop is None else f"_{x.window[0]}-{x.window[1]}"
            assert x.key == f"scenepexr_own_1cd-m2_auto-information_low_noise_bayer_s0{place}"


def test_white_balances_of_a_frame_make_no_other_set(stored: Path, tmp_path: Path) -> None:
    other = made(tmp_path, white_balances=("gray-world", "as-shot"))
    lines, own = read_manifest(other), read_manifest(stored)
    assert lines[0]["identity"] == own[0]["identity"]
    assert lines[0]["samples"] == own[0]["samples"] == 8


def test_the_manifests_head_and_the_card_tell_the_study(stored: Path) -> None:
    head, scene = read_manifest(stored)[:2]
    text = (stored / CARD).read_text("utf-8")
    assert head["axes"] == {
        "levels": ["1cd/m2", "25cd/m2"], "spectra": ["own"], "exposures": ["auto:information"],
        "sensors": ["low_noise"], "processors": ["bayer", "interleaved"], "seeds": ["0", "1"],
    }  # fmt: skip
    assert set(head) == {*("kind", "name", "rodcone", "versions", "command", "identity", "samples", "planes", "axes")}
    assert (head["command"], head["planes"]) == ("rodcone dataset", list(SetOrder().planes))
    assert (scene["name"], scene["licence"]) == ("scene.exr", "its owner's")
    assert scene["split"] == split_of(scene["hash"])
    for name, meaning in sample_module.TRUTH.items():
        assert f"| `KEY.{name}.npy` | {meaning} |" in text
    assert f"`{MANIFEST}` lists scenes" in text
    assert "| 1 | its owner's |" in text
    samples = [line for line in read_manifest(stored) if line["kind"] == "sample"]
    assert [" ".join(line) for line in samples] == [f"kind {LISTED}"] * 8


def test_a_card_says_where_the_renders_noise_shows_and_a_scenes_licence(stored: Path) -> None:
    lines = [dict(line) for line in read_manifest(stored)]
    assert "the render's noise has" not in make_set_module.card(lines)
    (last,) = [x for x in lines if x["kind"] == "sample"][-1:]
    last["render_noise"] = {"mean": 2.5, "of_95_percent": 0.0}
    (note,) = [x for x in make_set_module.card(lines).splitlines() if x.startswith("the render's noise has")]
    assert note == "the render's noise has 2.5 times the sensor's variance: it shows in pictures and reference"
    for source, words in (
        ("still_life", "MIT, as rodcone; no texture of others"),
        ("diorama-5", f"MIT, as rodcone; {make_set_module.PICTURES_LICENCE}"),
        ("own/street.exr", "its owner's"),
    ):
        opened: Any = SimpleNamespace(choice=SimpleNamespace(source=source, label="a label"))
        facts = {"hash": "f" * 32, "objects": ["ball"], "materials": ["red"], "files": {}}
        assert make_set_module._scene_line(opened, facts) == {
            "kind": "scene", "name": "a label", "hash": "f" * 32, "split": "test", "licence": words,
            "objects": ["ball"], "materials": ["red"],
        }  # fmt: skip


def test_an_order_that_says_nothing_draws_no_scene_and_fills_64_files() -> None:
    order = SetOrder()
    assert (order.drawn_scenes, order.shards, order.crop) == ((), 64, None)
    assert SetOrder(generated=2).drawn_scenes == SetOrder(generated=2, seed=0, diorama=0).drawn_scenes


def test_what_a_scenes_surfaces_are_is_kept_by_plane(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Depth, normals and numbers of object and material of each pixel, beside the light of its file."""
    rng, size = np.random.default_rng(8), SAMPLE.SIZE
    seen = SimpleNamespace(
        object_id=rng.integers(0, 9, size).astype(np.uint16), material_id=rng.integers(0, 9, size).astype(np.uint16),
        depth_m=rng.uniform(1, 2, size).astype(np.float32), normal=rng.uniform(-1, 1, (*size, 3)).astype(np.float32),
        objects=("ball", "floor"), materials=("red",),
    )  # fmt: skip
    study = SAMPLE.small_study(tmp_path, seeds=(0,), levels=("1cd/m2",))
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        cells = scene_cells(job, opened, lambda *_: None)
        transport = scene_transport(job, opened, lambda *_: None)[0]
        monkeypatch.setattr(sample_module, "see_surfaces", lambda scene, size: seen)
        monkeypatch.setattr(sample_module, "scene_hash", lambda opened: "a hash")
        scene: Any = SimpleNamespace()
        frames = {sample_module._frame_key(cell): cell for cell in cells}
        facts = sample_module._make_files(job, replace(opened, scene=scene, size=size), frames, transport)
        assert (facts["hash"], facts["objects"], facts["materials"]) == ("a hash", seen.objects, seen.materials)
        files = sample_module.plane_files(job, facts, cells[0], tuple(sample_module.TRUTH))
    assert set(files) == set(sample_module.TRUTH)
    ids = np.stack([seen.object_id, seen.material_id], axis=2)
    for name, plane in (("depth", seen.depth_m), ("normals", seen.normal), ("ids", ids)):
        np.testing.assert_array_equal(np.load(files[name]), plane, strict=True)
    assert np.load(files["xyz"])[..., 1].mean() == pytest.approx(1.0, rel=1e-5)
    electrons, behind = np.load(files["mosaic_e"]), np.load(files["channels_e"])
    np.testing.assert_allclose(behind[::2, ::2, 0], electrons[::2, ::2], rtol=1e-5)


def test_planes_of_a_scene_that_is_sampled_within_its_pixels_are_of_whole_pixels(tmp_path: Path) -> None:
    """Four samples of light a pixel: XYZ, shares and electrons are means over them, in the frame's own size."""
    study = SAMPLE.small_study(tmp_path, seeds=(0,), levels=("1cd/m2",))
    with open_results(tmp_path) as base:
        job = Job(study, SAMPLE.stated(study), tmp_path, base)
        (opened,) = open_all(study).values()
        cells = scene_cells(job, opened, lambda *_: None)
        transport = scene_transport(job, opened, lambda *_: None)[0]
        fine: Any = SimpleNamespace(out=tmp_path, study=study, plan=SimpleNamespace(samples_a_side=lambda _: 2))
        frames = {sample_module._frame_key(cell): cell for cell in cells}
        (tmp_path / "planes").mkdir(exist_ok=True)
        whole, halved = (sample_module._make_files(x, opened, frames, transport) for x in (job, fine))

    def planes(facts: dict[str, Any]) -> dict[str, np.ndarray]:
        ((_, names),) = facts["files"].items()
        return {name: np.load(job.out / sample_module.PLANES / path) for name, path in names.items()}

    def means(plane: np.ndarray) -> np.ndarray:
        height, width, *rest = plane.shape
        return plane.reshape(height // 2, 2, width // 2, 2, *rest).mean(axis=(1, 3))

    large, small = planes(whole), planes(halved)
    assert set(small) == {"xyz", "shares", "channels_e"}
    np.testing.assert_allclose(small["xyz"], means(large["xyz"]), rtol=1e-5)
    np.testing.assert_allclose(small["shares"], 1.0, atol=1e-6)
    assert small["shares"].shape == (*small["xyz"].shape[:2], 1)
    height, width = SAMPLE.SIZE
    view = photographed(under(transport, "own"), 1.0)
    electrons = imaged_electrons(view, cells[0].frame.sensor, 1.0, 2)
    assert small["channels_e"].shape == (height // 2, width // 2, 3)
    np.testing.assert_allclose(small["channels_e"], electrons, rtol=1e-5)
    assert halved["illuminants"] == whole["illuminants"]
    (told,) = halved["illuminants"].values()
    for name, emitted in told["groups"].items():
        lamp = transport.groups[name].spectrum.band_average(np.array(told["wavelength_nm"]), np.array(told["width_nm"]))
        assert np.array(emitted) == pytest.approx(lamp * transport.groups[name].power / transport.level().value)


def test_an_orders_numbers_have_their_limits() -> None:
    limits = {"generated": (0, 100_000), "diorama": (0, 100_000), "shards": (1, 100_000), "crop": (16, 8192)}
    for name, (least, most) in limits.items():
        for value in (least, most):
            assert getattr(SetOrder(**{name: value}), name) == value
        for value in (least - 1, most + 1):
            refusal(SetOrder, **{name: value}, match=f"{name}: {value} is outside {least} to {most:g}")


def test_a_disk_holds_a_set_to_the_byte_less_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type(shutil.disk_usage(tmp_path))
    monkeypatch.setattr(order_module.shutil, "disk_usage", lambda _: usage(9 * 10**9, 0, 2_500_000_000))
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "a.npy").write_bytes(bytes(1000))
    order_module.require_room(2_500_001_000, tmp_path)
    refusal(order_module.require_room, 2_500_001_001, tmp_path, match=r"needs about 2\.5 GB more; allowed: 2\.5 GB")
    refusal(order_module.require_room, 7_250_001_000, tmp_path, match=r"needs about 7\.25 GB more; allowed: 2\.5 GB")


def test_the_room_of_rendered_scenes_is_counted_by_planes_bands_lamps_and_channels(tmp_path: Path) -> None:
    """By hand: three planes of float32 for each lamp and band; raw, truth and 20 kB for each sample."""
    choice = SceneChoice("diorama-5")
    levels, seeds = ("1cd/m2", "9cd/m2", "25cd/m2"), (0, 1)
    study = SAMPLE.small_study(
        tmp_path, levels=levels, seeds=seeds, exposures=("auto", "20ms"), processors=("bayer", "interleaved")
    )  # fmt: skip
    groups = {"sun": None, "sky": None, "lamp": None}
    opened: Any = SimpleNamespace(choice=choice, size=(30, 50), scene=SimpleNamespace(groups=groups))
    plan: Any = SimpleNamespace(
        renders={choice: SimpleNamespace(wavelength_nm=np.arange(7.0))}, samples_a_side=lambda *_: 3
    )
    order = SetOrder(truth="mosaic_e,channels_e,rgb,depth,normals,ids,shares")
    wanted = 3 * 4 * (9 * 1500) * 7 * 3  # nine samples of light a pixel
    for channels in (3, 4):
        planes = 2 + 4 + 4 * channels + 12 + 4 + 12 + 4 + 4 * 3
        wanted += 3 * 2 * 2 * (1500 * planes + 20_000) + 4 * 1500 * (20 + channels)
    assert order_module.bytes_needed(study, plan, [opened], order) == wanted


def test_drawn_scenes_are_counted_from_a_seed() -> None:
    first, more, other = (SetOrder(generated=n, seed=x).drawn_scenes for n, x in ((3, 0), (5, 0), (3, 1)))
    assert more[:3] == first
    assert not {x.source for x in first} & {x.source for x in other}
    assert len({x.source for x in more}) == 5
    names = [x.source.split("-")[0] for x in SetOrder(generated=1, diorama=2).drawn_scenes]
    assert names == ["generated", "diorama", "diorama"]


def test_the_frozen_list_is_counted_from_37_without_two() -> None:
    counted = {x.source for x in SetOrder(generated=32, seed=37).drawn_scenes}
    too_noisy = {"generated-aaee6ca8b349", "generated-05288180474c"}
    assert sorted(x.source for x in read_study("benchmark").scenes) == sorted(counted - too_noisy)


def test_a_shard_that_could_run_code_is_refused(tmp_path: Path) -> None:
    """Arrays of Python's objects are pickled: whoever opens one runs what it says."""
    path, array = tmp_path / "train-000000.tar", BytesIO()
    np.save(array, np.array([{"an": "object"}], dtype=object), allow_pickle=True)
    with tarfile.open(path, "w") as tar:
        for name, content in (("0.raw.npy", array.getvalue()), ("0.json", b"{}")):
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, BytesIO(content))
    assert "it is no whole shard" in refusal(lambda: list(read_shard(path)))
