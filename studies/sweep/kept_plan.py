"""Store a study's plan beside its pilot renders, so that a sweep that is continued doesn't compute the plan again."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from render.illuminants import illuminant
from rodcone.digests import digest_file, digest_inputs
from rodcone.progress import Step
from sensor.config import LensConfig
from sensor.presets import preset
from studies.budget.ledger import Ledger, Plan, Term
from studies.study.lit_scene import open_all
from studies.study.model import ImageModel, RenderModel
from studies.study.study import OWN, Study, conditions, study_mosaics
from studies.sweep.provenance import deciding_modules, versions
from studies.sweep.stored import keep_facts, read_facts


def kept_plan(study: Study, folder: Path, step: Step | None = None) -> Plan:
    """Return a study's plan: from the folder of pilots if it was made there before, else made and kept there.

    Raises
    ------
    InputError
        As `studies.budget.plan.plan`.
    OSError
        Where the folder can't be written.
    """
    key = _key(study)
    facts = read_facts(folder, key)
    if facts is not None:
        return _plan(study, facts)
    from studies.budget.plan import plan  # imported here, because a sweep that finds its plan doesn't need it

    made = plan(study, cache=folder, step=step)
    folder.mkdir(parents=True, exist_ok=True)
    keep_facts(folder, key, _facts(study, made))
    return made


def _key(study: Study) -> str:
    """Return the hash of all that a plan is made from: the study, its files' contents, and the code that makes it."""
    lights = [illuminant(name) for name in study.spectra if name != OWN]
    scenes = [opened.identity for opened in open_all(study).values()]
    code = [digest_file(path) for path in deciding_modules(names=("studies.budget.plan",))]
    sensors = [study.lens.behind(preset(name)) for name in study.sensors]
    return digest_inputs([study, study_mosaics(study), scenes, sensors, lights, versions(), code])


def _facts(study: Study, plan: Plan) -> dict[str, Any]:
    """Return a plan as JSON holds it, with the numbers of scenes and conditions in the study for their names."""
    places = {condition: place for place, condition in enumerate(conditions(study))}
    return {
        "renders": [asdict(plan.renders[scene]) if scene in plan.renders else None for scene in study.scenes],
        "images": [asdict(plan.images[condition]) for condition in places],
        "shares": [plan.shares.get(condition) for condition in places],
        "ledgers": [asdict(row) | {"condition": places[row.condition]} for row in plan.ledgers],
        "summary": plan.summary,
    }


def _plan(study: Study, facts: Mapping[str, Any]) -> Plan:
    of_study = conditions(study)
    images = (ImageModel(LensConfig(**image["lens"]), image["exact"]) for image in facts["images"])
    return Plan(
        renders={
            scene: RenderModel(**of | {name: tuple(of[name]) for name in ("wavelength_nm", "width_nm")})
            for scene, of in zip(study.scenes, facts["renders"], strict=True)
            if of is not None
        },
        images=dict(zip(of_study, images, strict=True)),
        shares={
            condition: share for condition, share in zip(of_study, facts["shares"], strict=True) if share is not None
        },
        ledgers=tuple(
            Ledger(
                **row | {"condition": of_study[row["condition"]], "terms": tuple(Term(**term) for term in row["terms"])}
            )
            for row in facts["ledgers"]
        ),
        summary=tuple(facts["summary"]),
    )
