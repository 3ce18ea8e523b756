"""`rodcone reference`, and the demo that photographs what it made."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import call

from render.engine import render
from render.error_estimates import Halves
from render.reference import FOLDER, SHIPPED, find_reference, require_agreement, save_reference
from rodcone.progress import duration
from scenes.catalogue import load
from studies.budget.starting_points import plan_from_settings
from studies.commands import reference
from studies.study.lit_scene import film_of, open_choice
from studies.study.study_file import DEMO_STUDY, read_study

pytestmark = pytest.mark.thorough
DEMO = ["demo", "--size", "32", "--sensor", "low_noise", "--level", "100cd/m2", "--processor", "bayer"]


def stored(size: int = 32):  # type: ignore[no-untyped-def]
    """Reference of the demo's scene."""
    study = read_study(DEMO_STUDY)
    study = replace(study, render=replace(study.render, size=size))
    opened, model = open_choice(study.scenes[0], study), plan_from_settings(study).renders[study.scenes[0]]
    return find_reference(load("still_life"), film_of(opened, model))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """References, one of which was made."""
    made = tmp_path_factory.mktemp("references")
    assert call(["reference", "--size", "32", "--until", "100", "--out", made])[0] == 0
    return made


def test_the_file_has_its_certificate_and_the_same_command_goes_on(folder, monkeypatch):
    monkeypatch.setenv(FOLDER, str(folder))
    first = stored().certificate
    assert first["samples"] == pytest.approx(512, rel=0.15)
    assert list(first["shares"]["low_noise"]) == list(read_study(DEMO_STUDY).levels)
    assert first["share"] == max(first["shares"]["low_noise"].values())
    assert first["halves"]["chance"] > 1e-3
    assert {"mitsuba", "drjit", "rodcone"} <= set(first["versions"])
    until = str(first["share"] / 1.5)
    code, _, told = call(["reference", "--size", "32", "--until", until, "--out", folder])
    # Its first look is where the first call ended, at the file's one plane of error for all bands. Variance falls with
    # the samples, and these with the time.
    read_back = re.search(
        r" samples a pixel: ([\d.]+) of the sensor's variance in 95 % of pixels; about (.+) more", told
    )
    assert read_back is not None
    assert float(read_back[1]) == pytest.approx(first["share"], rel=0.2)
    assert read_back[2] == duration(first["seconds"] * (1.05 * float(read_back[1]) / float(until) - 1))
    assert code == 0
    second = stored().certificate
    assert second["share"] <= float(until)
    assert second["samples"] > first["samples"]
    assert second["seconds"] > first["seconds"]


def test_a_dry_run_says_what_the_first_samples_cost_or_how_far_the_light_has_come(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path / "none"))
    monkeypatch.setattr(reference, "render", lambda *_, **__: pytest.fail("rendered"))
    code, out, told = call(["reference", "still_life", "--size", "64", "--dry-run"])
    assert (code, told) == (0, "")
    assert re.match(r"about .+ GB: 64 x 64 pixels, 512 samples per pixel, 20 bands;", out)
    assert "share of 0.03" in out
    code, out, told = call(["reference", "still_life", "--until", "0.001", "--dry-run"])  # 256 px come with rodcone
    share = stored(size=256).certificate["share"]
    read_back = re.fullmatch(
        r"\d+ samples a pixel: ([\d.]+) of the sensor's variance in .+; about .+ more to 0.001\n", out
    )
    assert (code, told) == (0, "")
    assert read_back is not None
    assert float(read_back[1]) == pytest.approx(share, rel=0.1)
    assert list(tmp_path.iterdir()) == []


def test_the_demo_tests_the_reference_photographs_it_and_says_so(folder, tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(folder))
    code, _, told = call([*DEMO, "-o", tmp_path / "with"])
    assert (code, "agrees with it within its noise" in told) == (0, True)
    results = json.loads((tmp_path / "with" / "results.json").read_text("utf-8"))
    assert "light: the reference still_life-32x32x20" in json.dumps(results)
    assert "light: the reference still_life-32x32x20" in (tmp_path / "with" / "report.html").read_text("utf-8")
    assert {row["spp"] for row in results["rows"]} == {stored().transport.spp}
    # mean squared half difference in each frame's electrons over the sensor's variance
    assert all(0 < row["mc_share"] < stored().certificate["share"] for row in results["rows"])
    assert call([*DEMO, "--render", "--spp", "16", "-o", tmp_path / "without"])[0] == 0
    assert "light: the reference" not in (tmp_path / "without" / "results.json").read_text("utf-8")


def test_a_reference_of_other_light_is_refused_in_one_line(folder, tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(folder))
    made = stored()
    light = Halves(np.float32(1.05) * made.transport.light.mean, made.transport.light.difference)
    other = tmp_path / "others" / made.path.name
    save_reference(other, replace(made.transport, light=light), made.certificate)
    monkeypatch.setenv(FOLDER, str(other.parent))
    code, _, told = call([*DEMO, "-o", tmp_path / "out"])
    words = ("disagrees with still_life-32x32x20", "rodcone doctor", "--render")
    assert (code, [word in told.splitlines()[-1] for word in words]) == (2, [True] * 3)


def test_the_light_of_the_demo_comes_with_the_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    shipped = stored(size=256)
    assert shipped.path.parent == SHIPPED
    assert shipped.path.stat().st_size < 3e6
    assert shipped.certificate["samples"] == pytest.approx(shipped.transport.spp)
    # of the sensor's variance in 95 % of the pixels: the 288 samples that the demo rendered before left about 3
    assert shipped.certificate["share"] <= 0.03
    assert shipped.certificate["halves"]["chance"] > 1e-3
    assert shipped.certificate["command"] == "rodcone reference still_life --size 256"


@pytest.mark.slow
def test_the_light_of_the_demo_is_what_is_rendered_here() -> None:
    shipped = stored(size=256)
    film = {"wavelength_nm": shipped.transport.wavelength_nm, "width_nm": shipped.transport.width_nm}
    assert "agrees" in require_agreement(render(load("still_life"), (256, 256), spp=64, seed=1, **film), shipped)
