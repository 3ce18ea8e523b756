"""`rodcone sweep`, `export`, `new study` and `new cluster`: results alone on stdout, one line for whatever is wrong."""

import json
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
import sweep_sample as SAMPLE
from any_cpu.configurations import environment
from command_line import call, check_refusals

from rodcone.memory import memory
from studies.study.cost import render_seconds

TEXT = """
scenes = [{source = "scene.exr", light = "E"}]
levels = ["1cd/m2", "25cd/m2"]
processors = ["bayer"]
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    SAMPLE.picture(tmp_path / "scene.exr")
    path = tmp_path / "study.toml"
    path.write_text(TEXT, "utf-8")
    return path


def test_sweep_prints_the_ledger_alone_and_the_table_follows(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ["sweep", str(study), "-o", str(out), "--workers", "1", "--as-stated"]
    told = f"rodcone: its report is {out / 'report.html'}\n"
    assert call(command) == (0, f"{out / 'ledger.sqlite'}\n", told)
    assert (out / "report.html").read_text("utf-8").lstrip().startswith("<!doctype html>")
    code, text, err = call([*command, "--json"])
    assert (code, err) == (0, told)
    facts = json.loads(text)
    assert (facts["cells"], facts["made"], facts["ledger"]) == (2, 0, str(out / "ledger.sqlite"))
    assert facts["report"] == str(out / "report.html")
    assert call(["export", str(out), "-o", str(tmp_path / "t.csv")]) == (0, f"{tmp_path / 't.csv'}\n", "")
    header, *table = (tmp_path / "t.csv").read_text("utf-8").splitlines()
    assert header.startswith(
        "key,scene,spectrum,level,exposure,sensor,white_balance,frames,gain,processor,seed,luminance_cd_m2,illuminance"
    )
    assert [line.split(",")[3] for line in table] == ["1cd/m2", "25cd/m2"]


@pytest.mark.thorough
def test_a_run_that_makes_no_cell_leaves_the_report_where_it_says_what_is_stored(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ["sweep", str(study), "-o", str(out), "--workers", "1", "--as-stated"]
    page, results = out / "report.html", out / "results.json"

    def written() -> list[bool]:
        before = [path.stat().st_ino if path.exists() else 0 for path in (page, results)]  # a new file is renamed there
        assert call(command)[0] == 0
        return [path.stat().st_ino != old for path, old in zip((page, results), before, strict=True)]

    assert written() == [True, True]
    assert written() == [False, False]
    page.write_bytes(page.read_bytes().replace(b"PSNR", b"PSNX"))  # changed, but as long as it was
    assert written() == [True, True]
    results.unlink()
    assert written() == [True, True]
    study.write_text(TEXT.replace('"25cd/m2"', '"1cd/m2"').replace('"1cd/m2", ', ""), "utf-8")  # asks for one cell
    assert written() == [True, True]
    assert len(json.loads(results.read_text("utf-8"))["rows"]) == 1


@pytest.mark.thorough
def test_a_sweep_follows_the_plan_and_reference_models_everything(study: Path, tmp_path: Path) -> None:
    command = ["sweep", str(study), "-o", str(tmp_path / "out"), "--workers", "1"]
    for option in ([], ["--reference"], ["--as-stated"]):
        code, _, err = call([*command, *option])
        assert (code, err) == (0, f"rodcone: its report is {tmp_path / 'out' / 'report.html'}\n")
    with closing(sqlite3.connect(tmp_path / "out" / "ledger.sqlite")) as base:
        table = base.execute("SELECT lens, budget_share FROM cells").fetchall()
    planned = [share for _, share in table if share is not None]
    assert len(planned) == 2
    assert max(planned) <= 0.10
    lenses = [
        (json.loads(lens)["diffraction"], json.loads(lens)["veiling_glare"]) for lens, share in table if not share
    ]
    assert sorted(lenses) == [(1.0, 0.0)] * 2 + [(1.0, 0.01)] * 2


@pytest.mark.thorough
def test_what_one_processor_made_another_finds(tmp_path: Path) -> None:
    """A sweep goes on on another machine: neither the render nor a picture is made again."""
    path = tmp_path / "study.toml"
    path.write_text(
        'scenes = ["metamers"]\nspectra = ["F11"]\nlevels = ["1lux"]\nprocessors = ["bayer", "interleaved"]\n'
        'exposures = ["auto", "auto:information"]\n[render]\nsize = 16\nspp = 1\n',
        "utf-8",
    )
    command = ["sweep", str(path), "-o", str(tmp_path / "out"), "--workers", "1", "--as-stated", "--json"]
    code, text, _ = call(command)
    assert (code, json.loads(text)["made"]) == (0, 4)
    renders = sorted((tmp_path / "out" / "renders").iterdir())
    again = [sys.executable, "-c", "from studies.commands.cli import main; main()", *command]
    other = environment("nehalem", "numpy-baseline")
    assert json.loads(subprocess.check_output(again, env=other, text=True, stderr=subprocess.DEVNULL))["made"] == 0
    assert sorted((tmp_path / "out" / "renders").iterdir()) == renders


def test_dry_run_counts_and_computes_nothing(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ["sweep", str(study), "-o", str(out), "--dry-run", "--set", "seeds=[0, 1, 2]"]
    code, text, err = call(command)
    assert (code, err) == (0, "")
    assert text.startswith("6 cells, at most 0 kept from the last run; 0 to render; about ")
    assert not out.exists()
    still = ["--set", 'scenes=["still_life"]', "--set", "render.spp=64", "--json", "--workers", "2"]
    code, text, _ = call([*command, *still])
    facts = json.loads(text)
    assert (code, facts["cells"], facts["renders"], facts["workers"]) == (0, 6, 1, 2)
    more = json.loads(call([*command, *still, "--set", "render.spp=512"])[1])
    render_s = [render_seconds(256**2, 20, 1, spp) for spp in (64, 512)]
    assert more["seconds"] - facts["seconds"] == pytest.approx(render_s[1] - render_s[0])
    larger = json.loads(call([*command, *still, "--set", "render.size=1024"])[1])
    for told, side in ((facts, 256), (larger, 1024)):
        assert told["bytes"] == memory(side**2, 20, 1, 2, spp=64).total


def test_dry_run_counts_cells_of_this_code_alone_as_kept(study, tmp_path, monkeypatch):
    command = ["sweep", str(study), "-o", str(tmp_path / "out"), "--json"]
    made = json.loads(call([*command, "--workers", "1", "--as-stated"])[1])["made"]
    assert json.loads(call([*command, "--dry-run"])[1])["kept"] == made > 0
    monkeypatch.setattr("studies.sweep.cost.versions", lambda: {"rodcone": "0.2.0+other"})
    assert json.loads(call([*command, "--dry-run"])[1])["kept"] == 0


def test_faults_are_one_line_and_nothing_is_begun(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(study.parent)
    Path("damaged.xml").write_text("<scene", "utf-8")
    rows = (
        ("--set lvels=3", "did you mean 'levels'?"),
        ("--set scenes=absent.exr", "absent.exr"),
        ("--set scenes=damaged.xml", "damaged.xml"),
        ("--set scenes=stil_life", "did you mean 'still_life'?"),
        ("--set levels=10lux", "needs a reference plane"),
        ("--workers 0", "workers: 0 is outside 1 to 1024"),
        ("--workers 2 --cluster tcp://127.0.0.1:1", "workers: 2 beside --cluster"),
        ("--reference --as-stated", "as-stated: True beside --reference"),
        ("--cluster 127.0.0.1", "is not an address"),
        ("--cluster tcp://127.0.0.1:x", "is not an address"),
        ("--workers 1.5", "'1.5' is not a whole number"),
    )
    check_refusals("sweep study.toml", rows, study.parent)
    bad_place = [("-o study.toml/out --as-stated", "choose another place with --out")]
    check_refusals("sweep study.toml", bad_place, study.parent, code=1)


def test_a_full_disk_is_one_line_that_says_what_is_kept(study, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", str(tmp_path / "out" / "pictures"))

    monkeypatch.setattr("studies.sweep.run_cell.keep", full)
    code, out, err = call(["sweep", str(study), "-o", str(tmp_path / "out"), "--workers", "1", "--as-stated"])
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "pictures: No space left on device; make room: " in err
    assert "keeps what is done" in err


def test_new_cluster_writes_settings_and_both_refuse_what_they_cannot_do(tmp_path: Path) -> None:
    assert call(["new", "cluster", "-o", tmp_path / "dask.yaml"])[0] == 0
    assert "MALLOC_TRIM_THRESHOLD_: 67108864" in (tmp_path / "dask.yaml").read_text("utf-8")
    rows = (
        ("study spectrum -o s.toml", "did you mean 'spectra'?"),
        ("cluster -o dask.toml", "allowed: .yaml; rename it"),
    )
    check_refusals("new", rows, tmp_path)
