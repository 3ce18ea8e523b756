"""What a row says that made it is what did: versions, engines, threads, counted another way; and nothing is mixed."""

import ast
import json
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from importlib import import_module, metadata
from pathlib import Path

import pytest
import sweep_sample as SAMPLE
from command_line import in_new_python
from refusal import refusal

from isp.processors.catalogue import PROCESSORS
from rodcone.jit import backend, dr
from rodcone.llvm import LIBLLVM
from studies.budget.ledger import Plan
from studies.pages.report_sweep import sweep_report
from studies.study.cost import cores
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.sweep import provenance
from studies.sweep.database import add, open_results
from studies.sweep.export import read_rows
from studies.sweep.provenance import ROOT, Provenance, code_version, deciding_modules, require_alike, versions
from studies.sweep.row import Row
from studies.sweep.run_cell import run_cell
from studies.sweep.run_sweep import sweep
from studies.sweep.workers import run_in_processes


def inexact(plan: Plan) -> Plan:
    """The same, read out in single precision where there is a backend."""
    return replace(plan, images={place: replace(model, exact=False) for place, model in plan.images.items()})


def test_versions_are_those_that_the_modules_tell_themselves() -> None:
    found = versions()
    own = {"scikit-image": "skimage", "colour-science": "colour"}
    for name in ("numpy", "scipy", "mitsuba", "drjit", *own):
        assert found[name] == import_module(own.get(name, name)).__version__
    assert found["rodcone"].startswith(metadata.version("rodcone") + "+")
    if backend() == "llvm":
        assert LIBLLVM is not None
        mapped = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "libLLVM" in line}
        assert any(Path(path).name.endswith(found["llvm"].rsplit(".", 1)[0]) for path in mapped), mapped
    else:
        assert found["llvm"] == "none"


def test_a_processors_own_libraries_are_among_its_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "libraries", lambda name: {"bayer": ("pytest", "ruff")}.get(name, ()))
    provenance.versions.cache_clear()
    own = {name: metadata.version(name) for name in ("pytest", "ruff")}
    assert versions("bayer") == versions() | own
    assert not own.keys() & versions().keys()
    assert versions("ple_rgbw") == versions()
    provenance.versions.cache_clear()


def test_a_row_tells_the_same_versions_in_whichever_order_a_users_own_are_given() -> None:
    """Text that differs would make a cell anew, and a report over both would be refused as mixed."""
    own = {"zeta": "1", "alpha": "2"}
    orders = own, dict(sorted(own.items()))
    told = [provenance.provenance("scalar_rgb", "bayer", False, given, True).versions for given in orders]
    assert told[0] == told[1]
    assert json.loads(told[0]) == versions("bayer") | own


def kernels_in(work: Callable[[], Row]) -> tuple[Row, int]:
    """Kernels that Dr.Jit launches meanwhile, by its own history."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history()
        row = work()
        return row, len([one for one in dr.kernel_history() if "cache_hit" in one])


@pytest.mark.sample(3)
@pytest.mark.skipif(backend() == "numpy", reason="no kernel runs without a backend")
@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("name", [name for name, one in PROCESSORS.items() if one.extra is None])
def test_a_row_names_the_engines_that_kernels_ran_on(name: str, exact: bool, tmp_path: Path) -> None:
    """Kernels are launched if readout or development say so, and twice where both do."""
    study = SAMPLE.small_study(tmp_path, processors=(name,), levels=("1cd/m2",), seeds=(0,))
    plan = SAMPLE.stated(study) if exact else inexact(SAMPLE.stated(study))
    made: list[tuple[Row, int]] = []

    def runner(cells):  # type: ignore[no-untyped-def]
        for cell in cells:
            run_cell(cell)  # compiles
            made.append(kernels_in(partial(run_cell, cell)))
            assert cell.made_by == Provenance(*(getattr(made[-1][0], field.name) for field in fields(Provenance)))
            yield made[-1][0]

    sweep(study, tmp_path / "out", plan, runner)
    (row, kernels), of_readout = made[0], 0 if exact else 1
    assert row.variant == "none", "a picture file is not rendered"
    assert row.readout_engine == ("numpy" if exact else backend())
    assert (kernels > of_readout) == (row.development_engine == backend())
    if row.development_engine == "numpy":
        assert kernels == of_readout


THREADS = """
import json, os, sys, time
import numpy as np
from pathlib import Path
from rodcone.jit import dr, arrays, backend
sys.path.insert(0, sys.argv[1])
import sweep_sample as SAMPLE
from studies.sweep.workers import InThisProcess, run
folder = Path(sys.argv[2])
study = SAMPLE.small_study(folder, processors=("interleaved",), levels=("1cd/m2",), seeds=(0,))
cells = SAMPLE.made_cells(folder, study)
def threads():  # once their number has stood still for half a second: one that ends takes its time
    seen = []
    while len(seen) < 6 or len(set(seen[-6:])) > 1:
        seen.append(len(os.listdir("/proc/self/task")))
        time.sleep(0.1)
    return seen[-1]
dr.set_thread_count(1)
others = threads() - 1
(row,) = run(cells[:1], InThisProcess(), threads=int(sys.argv[3]))
dr.eval(dr.arange(arrays().Float, 1 << 20) * 2)
dr.sync_thread()
print(json.dumps([row.threads, threads() - others, backend()]))
"""


@pytest.mark.thorough
@pytest.mark.skipif(backend() != "llvm", reason="Dr.Jit's threads are LLVM's")
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
@pytest.mark.parametrize("count", [1, 3])
def test_threads_told_are_those_that_the_working_process_has(count: int, tmp_path: Path) -> None:
    tests, one = Path(__file__).resolve().parents[2], {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    said = in_new_python(THREADS, tests, tmp_path, count, **one)
    assert json.loads(said.splitlines()[-1]) == [count, count, "llvm"]


@pytest.mark.thorough
def test_rows_of_two_processes_tell_their_own_threads_not_the_parents(tmp_path: Path) -> None:
    SAMPLE.swept(SAMPLE.small_study(tmp_path), tmp_path / "out", partial(run_in_processes, workers=2))
    found = read_rows(tmp_path / "out")
    assert [row.threads for row in found] == 4 * [max(1, cores() // 2) if backend() == "llvm" else 1]
    assert os.getpid() not in {row.worker for row in found}


def test_a_rows_variant_is_the_one_that_mitsuba_has_set(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=16, band_nm=50.0)
    study = Study((SceneChoice("flat_field"),), ("1cd/m2",), processors=("bayer",), render=limits)
    SAMPLE.swept(study, tmp_path)
    (row,) = read_rows(tmp_path)
    assert row.variant == import_module("mitsuba").variant()


def versions_of_numpy(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    tell = metadata.version
    monkeypatch.setattr(provenance.metadata, "version", lambda name: version if name == "numpy" else tell(name))
    provenance.versions.cache_clear()


@pytest.fixture
def restored() -> Iterator[None]:
    yield
    provenance.versions.cache_clear()


@pytest.mark.thorough
@pytest.mark.usefixtures("restored")
def test_cells_of_other_versions_are_made_anew_and_the_old_ones_removed(tmp_path, monkeypatch):
    """A sweep ended after one cell, gone on with under another NumPy: no mean holds cells of both."""
    study, out = SAMPLE.small_study(tmp_path), tmp_path / "out"
    with monkeypatch.context() as patched:
        versions_of_numpy(patched, "1.9")
        with pytest.raises(KeyboardInterrupt):
            SAMPLE.swept(study, out, partial(SAMPLE.ended_after, 1))
    provenance.versions.cache_clear()
    assert [json.loads(row.versions)["numpy"] for row in read_rows(out, everything=True)] == ["1.9"]
    assert SAMPLE.swept(study, out).made == 4
    assert {json.loads(row.versions)["numpy"] for row in read_rows(out)} == {metadata.version("numpy")}
    assert sweep_report(out)[0].environment["numpy"] == metadata.version("numpy")
    assert SAMPLE.swept(study, out).made == 0
    assert len(read_rows(out, everything=True)) == 4


def test_a_report_over_mixed_cells_is_refused_in_one_line(tmp_path: Path) -> None:
    study, out = SAMPLE.small_study(tmp_path), tmp_path / "out"
    SAMPLE.swept(study, out)
    for change, words in (
        ({"versions": json.dumps(versions() | {"scipy": "0.1"})}, "scipy"),
        ({"variant": "llvm_ad_spectral"}, "Mitsuba variant none and llvm_ad_spectral"),
        ({"readout_engine": "llvm"}, "engine of captures numpy and llvm"),
        ({"development_engine": "llvm"}, "engine of development numpy and llvm"),
    ):
        found = read_rows(out)
        mixed = [*found[:-1], replace(found[-1], **change)]  # type: ignore[arg-type]
        refusal(require_alike, mixed, match=words)
    with open_results(out) as base:
        add(base, replace(found[-1], variant="llvm_ad_spectral"))
    refusal(sweep_report, out, match="Mitsuba variant")


# A cell's key changes with the code that decides a picture, and with no other.

PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def changed(folder: Path, path: Path) -> bool:
    """Whether one byte more in a file gives another version."""
    before, content = code_version(folder), path.read_bytes()
    path.write_bytes(content + b"#")
    after = code_version(folder)
    path.write_bytes(content)
    return after != before


@pytest.mark.thorough
def test_all_that_making_a_picture_imports_decides_it() -> None:
    """Measured in a process of its own: whatever of `studies` making a frame and running a cell load."""
    script = (
        "import studies.sweep.run_cell, studies.sweep.frames, sys\n"
        "found = {name: module for name, module in sys.modules.items() if name.startswith('studies.')}\n"
        "print(*(module.__file__ for module in found.values() if not hasattr(module, '__path__')))"
    )
    assert {Path(file).resolve() for file in in_new_python(script).split()} <= set(deciding_modules())


def test_modules_that_decide_are_those_that_the_syntax_trees_tell() -> None:
    paths, waiting = set[Path](), ["studies.sweep.run_cell", "studies.sweep.frames"]
    while waiting:
        path = ROOT.joinpath(*waiting.pop().split(".")).with_suffix(".py")
        if path.is_file() and path not in paths:
            paths.add(path)
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("studies."):
                    waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    assert deciding_modules() == sorted(paths)


@pytest.mark.sample(2)
@pytest.mark.parametrize("package", ["rodcone", "render", "scenes", "sensor", "isp"])
def test_every_module_before_the_studies_decides(copy: Path, package: str) -> None:
    paths = sorted((copy / package).rglob("*.py"))
    assert [path for path in (paths[0], paths[-1]) if not changed(copy, path)] == []


def test_tables_and_priors_that_pictures_are_made_with_decide(copy: Path) -> None:
    for name in ("isp/ple/prior.npz", "render/data/published_spectra.json"):
        assert changed(copy, copy / name), name


@pytest.mark.thorough
def test_a_byte_of_any_deciding_module_changes_the_version(copy: Path) -> None:
    deciding = deciding_modules(copy)
    known = {"appearance", "truth", "camera", "picture_file", "lit_scene", "run_cell"}
    assert known <= {path.stem for path in deciding}
    assert [path for path in deciding if not changed(copy, path)] == []


@pytest.mark.thorough
@pytest.mark.parametrize("folder", ["pages", "commands", "paper"])
def test_what_shows_results_decides_nothing(copy: Path, folder: str) -> None:
    paths = sorted((copy / "studies" / folder).rglob("*.py"))
    assert paths
    assert [path for path in paths if changed(copy, path)] == []
