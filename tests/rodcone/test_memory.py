"""Memory: what is free by every bound that the system sets, what a run needs, and the refusal before any work."""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import COST, call, check_refusals

from rodcone.memory import Limit, file_extent, memory, memory_limits

COMMANDS = {
    "render": ["render", "still_life", "--height", "4000", "--width", "4000", "-o", "out/picture.exr"],
    "capture": ["capture", "still_life", "--size", "4000", "-o", "out/shot.dng"],
    "demo": ["demo", "--size", "4000", "-o", "out"],
    "sweep": ["sweep", "study.toml", "--workers", "1", "-o", "out"],
}
STUDY = 'scenes = ["still_life"]\nlevels = ["25cd/m2"]\n[render]\nsize = 4000\n'
FIVE_GB = 5 * 10**9


def in_five_gb(arguments: list[str], folder: Path) -> tuple[int, str, str]:
    """Run a command whose address space is limited; what it prints ends with whether it came to load Mitsuba."""
    script = (
        "import atexit, sys; atexit.register(lambda: print('mitsuba' in sys.modules)); "
        "from studies.commands.cli import main; main(sys.argv[1:])"
    )
    (folder / "study.toml").write_text(STUDY, "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (FIVE_GB, FIVE_GB)),
    )
    return done.returncode, done.stdout, COST.sub("", done.stderr)


@pytest.mark.thorough
@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_of_4000_by_4000_in_5_gb_is_refused_in_one_line_before_it_renders(command: str, tmp_path: Path) -> None:
    code, out, err = in_five_gb(COMMANDS[command], tmp_path)
    assert (code, out, err.count("\n")) == (2, "False\n", 1)
    told = re.match(
        r"rodcone: memory: a process of the run needs about (\d+\.\d) GB; allowed: (\d\.\d) GB, which is what the "
        r"address-space limit of 5\.0 GB leaves \(ulimit -v\); take a smaller picture, fewer bands or workers, or go "
        r"on with --force\n$",
        err,
    )
    assert told is not None, err
    assert float(told[1]) > 10
    assert 3.5 < float(told[2]) < 5.0  # the interpreter and its libraries have mapped some
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


@pytest.mark.thorough
def test_the_need_is_the_one_that_a_dry_run_tells(tmp_path: Path) -> None:
    code, out, err = in_five_gb([*COMMANDS["sweep"], "--dry-run"], tmp_path)
    dry = re.search(r"at most (\d+\.\d) GB of memory", out)
    assert (code, err) == (0, "")
    assert dry is not None
    assert f"needs about {dry[1]} GB;" in in_five_gb(COMMANDS["sweep"], tmp_path)[2]


def test_force_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rodcone.memory.memory_limits", lambda: [Limit("a test's", -1e12)])
    arguments = "flat_field --size 32 --spp 4 -o shot.tif"
    check_refusals("capture", [(arguments, "allowed: -")], tmp_path)
    assert call(["capture", *arguments.split(), "--force"])[0] == 0
    assert sorted(os.listdir()) == ["shot.json", "shot.tif"]


def system(root: Path, **files: str) -> Path:
    """Root of a file system that holds some files, given as paths with two underscores for a slash."""
    for name, content in files.items():
        path = root / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, "utf-8")
    return root


def bounds(root: Path) -> dict[str, float]:
    return {limit.name: limit.free for limit in memory_limits(root) if not limit.per_process}


def test_what_is_available_is_the_kernel_s_own_estimate(tmp_path: Path) -> None:
    told = "MemTotal:  8000 kB\nMemFree:  100 kB\nMemAvailable:    4000 kB\nHugePages_Total: 0\n"
    assert bounds(system(tmp_path, proc__meminfo=told)) == {"what is available on this machine": 4000 * 1024}


def test_a_group_of_version_2_leaves_its_limit_less_its_use_and_parents_bind_too(tmp_path: Path) -> None:
    root = system(tmp_path, proc__self__cgroup="0::/jobs/mine\n")
    for place, most, used in (("jobs/mine", "max", 5), ("jobs", "3000000000", 10**9)):
        folder = root / "sys/fs/cgroup" / place
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "memory.max").write_text(f"{most}\n")
        (folder / "memory.current").write_text(f"{used}\n")
        (folder / "memory.stat").write_text("anon 1\nfile 5\ninactive_file 400000000\n")  # files that can be let go
    assert bounds(root) == {"what the control group's limit of 3.0 GB leaves": 2.4e9}


def test_a_system_that_tells_nothing_sets_no_bound(tmp_path: Path) -> None:
    assert bounds(tmp_path) == {}
    assert bounds(system(tmp_path, proc__meminfo="nonsense", proc__self__cgroup="0::/\n")) == {}


def test_workers_add_up_and_the_largest_process_counts_for_limits_that_each_has() -> None:
    alone, many = memory(10**6, 20, 1, workers=1), memory(10**6, 20, 1, workers=8)
    assert alone.total == alone.largest < many.total
    assert many.largest <= alone.largest
    assert (
        memory(10**6, 20, 3).total - memory(10**6, 20, 2).total == 3 * 4 * 20 * 10**6 + 2**27
    )  # three arrays of float32, and a run


def test_a_picture_file_counts_by_its_bytes_and_needs_no_render(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(bytes(160_000_000))  # a megapixel of 40 bands, were it not packed
    needed = memory(*file_extent(tmp_path / "a.exr")).total
    assert needed < memory(1_500_000, 40, 1).total
    assert needed > memory(10**6, 40, 0).total


MEASURED = {
    "render": (["render", "flat_field", "--height", "900", "--spp", "8", "-o", "a.exr"], memory(900**2, 20, 1).total),
    "capture": (["capture", "flat_field", "--size", "900", "--spp", "8", "-o", "a.dng"], memory(900**2, 20, 1).total),
    "demo": (
        ["demo", "--scene", "flat_field", "--size", "600", "--spp", "16", "--level", "5cd/m2", "--level", "50cd/m2"],
        memory(600**2, 20, 1, workers=1).total,
    ),
    "sweep": (["sweep", "study.toml", "--workers", "1", "--as-stated"], memory(600**2, 20, 1, workers=1).total),
}


@pytest.mark.slow
@pytest.mark.parametrize("command", MEASURED)
def test_the_estimate_is_within_a_factor_of_1_5_of_the_measured_peak(command: str, tmp_path: Path) -> None:
    arguments, estimated = MEASURED[command]
    study = STUDY.replace("still_life", "flat_field").replace("4000", "600\nspp = 16")
    (tmp_path / "study.toml").write_text(study, "utf-8")
    # Another process waits for the run and tells the system's own count of its peak.
    script = (
        "import json, resource, subprocess, sys; "
        "code = subprocess.run([sys.executable, '-c', 'from studies.commands.cli import main; main()', *sys.argv[1:]], "
        "stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode; "
        "print(json.dumps([code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    code, peak = json.loads(done.stdout)
    print(f"{command}: estimated {estimated / 1e9:.2f} GB, peak {peak / 1e9:.2f} GB")
    assert code == 0
    assert 1 / 1.5 < peak / estimated < 1.5
