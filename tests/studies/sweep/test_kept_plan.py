"""A plan that was kept is the plan that was made, and only where all that it is made from is the same."""

from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
import sweep_sample as SAMPLE

from sensor.presets import preset_file
from studies.budget import plan as module
from studies.budget.ledger import Plan
from studies.study.model import LensTerms
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.sweep import kept_plan as kept
from studies.sweep.kept_plan import kept_plan


def test_a_kept_plan_is_the_plan_and_another_study_sensor_or_scene_has_its_own(tmp_path, monkeypatch):
    sensor = tmp_path / "mine.toml"
    sensor.write_text(preset_file("low_noise").read_text("utf-8"), "utf-8")
    study, pilots = SAMPLE.small_study(tmp_path, sensors=(str(sensor),), seeds=(0,)), tmp_path / "pilots"
    made, make = list[Plan](), module.plan

    def counted(*given: Any, **named: Any) -> Plan:
        made.append(make(*given, **named))
        return made[-1]

    monkeypatch.setattr(module, "plan", counted)
    first = kept_plan(study, pilots)
    assert kept_plan(study, pilots) == first == made[0]
    assert first.ledgers
    assert len(made) == 1
    kept_plan(replace(study, levels=("1cd/m2",)), pilots)
    assert len(made) == 2
    sensor.write_text(sensor.read_text("utf-8").replace("pitch_um = 2.2", "pitch_um = 2.3"), "utf-8")
    assert kept_plan(study, pilots) != first
    assert len(made) == 3
    SAMPLE.picture(Path(study.scenes[0].source), (24, 20))
    kept_plan(study, pilots)
    assert len(made) == 4
    for path in pilots.glob("*.json"):  # damaged: made again
        path.write_bytes(path.read_bytes()[:-9])
    kept_plan(study, pilots)
    assert len(made) == 5


def test_a_lens_file_that_changes_makes_another_plan(tmp_path, monkeypatch):
    """The plan itself is a stand-in: a lens by data takes seconds."""
    for path in resources.files("sensor.lens").joinpath("data").iterdir():
        if path.name.startswith("cooke_triplet"):
            (tmp_path / path.name).write_bytes(path.read_bytes())
    table, made = tmp_path / "cooke_triplet.toml", list[int]()
    study = replace(SAMPLE.small_study(tmp_path, seeds=(0,)), lens=LensTerms(table=str(table)))
    plan = Plan(renders={}, images={}, shares={}, ledgers=(), summary=())
    monkeypatch.setattr(module, "plan", lambda *given, **named: made.append(1) or plan)
    monkeypatch.setattr(kept, "_facts", lambda study, plan: {})
    monkeypatch.setattr(kept, "_plan", lambda study, facts: plan)
    for _ in range(2):
        kept_plan(study, tmp_path / "pilots")
    assert len(made) == 1
    table.write_text(table.read_text("utf-8").replace("0.9939", "0.9938"), "utf-8")
    kept_plan(study, tmp_path / "pilots")
    assert len(made) == 2


@pytest.mark.thorough
def test_a_rendered_scenes_kept_plan_is_the_plan(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=16)
    study = Study((SceneChoice("flat_field"),), ("1cd/m2",), spectra=("own", "A"), render=limits)
    first = kept_plan(study, tmp_path)
    assert first.renders
    assert kept_plan(study, tmp_path) == first
