"""The error budget of a study: which effects its pictures have to model, and which the sensor's noise hides."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rodcone.errors import InputError
from rodcone.progress import Step
from sensor.config import without_terms
from sensor.presets import preset
from studies.budget.bands import possible_counts, wide_bands
from studies.budget.effects import KERNEL, LENS_TERMS
from studies.budget.how_many_bands import Choice, choose
from studies.budget.ledger import Ledger, Plan, ledger
from studies.budget.pilot import Pilot, full_lens, make_pilot, reference_bands, scaled_effects_of
from studies.budget.scaled_effects import ScaledEffects
from studies.budget.starting_points import band_count, reference_plan, starting_point
from studies.budget.summary import summary
from studies.study.lit_scene import open_all
from studies.study.model import ImageModel, RenderModel, in_bands
from studies.study.study import AUTOMATIC, Condition, SceneChoice, Study, conditions, most_spp


def plan(study: Study, *, cache: str | Path | None = None, step: Step | None = None) -> Plan:
    """Compute a study's error budget on pilot renders, for the cheapest model within it or for a starting point.

    Parameters
    ----------
    study : Study
        Its `budget` holds the shares and the starting point, `lens` all effects of the lens, `render.spp` the most
        samples. The shares are for unbiased light, because the error of denoised light isn't known before the render.
    cache : str or Path, optional
        Folder of renders.
    step : callable, optional
        Function that is called with what is being done and the share that is done; left out, a notebook shows a bar for
        each pilot's render.

    Returns
    -------
    Plan
        The plan. It depends on the study alone, not on the machine's speed. Picture files have no entry in `renders`.

    Raises
    ------
    InputError
        For a scene that can't be opened or rendered, or sensors of one size, whose pixels aren't the pilots'.
    """
    if study.sensor_side_um is not None:
        raise InputError(
            f"sensor_side_um: {study.sensor_side_um:g} can't be planned; allowed: sweep --as-stated; add it, or leave "
            "sensor_side_um out"
        )
    name = study.budget.model
    named = None if name == AUTOMATIC else starting_point(study, name)
    renders: dict[SceneChoice, RenderModel] = {}
    images: dict[Condition, ImageModel] = {}
    ledgers: list[Ledger] = []
    opened_scenes = open_all(study)
    for index, (scene, opened) in enumerate(opened_scenes.items()):
        if step:
            step(f"pilot of {scene.source}", index / len(opened_scenes))
        possible = (
            possible_counts(reference_bands(opened, study)[1]) if named is None else (band_count(study, name, opened),)
        )
        pilot = make_pilot(opened, study, possible, None if cache is None else Path(cache))
        rows = list(scaled_effects_of(pilot, study))
        if named is None:
            sizes = {count: len(groups) for count, groups in pilot.groups.items()}
            choice = choose(rows, sizes, study.budget, most_spp(study, scene) if pilot.rendered else 0)
            models = _chosen_models(choice, pilot, study)
        else:
            choice = _choice_of(named, rows, pilot)
            models = named
        if pilot.rendered:
            renders[scene] = models.renders[scene]
        images |= {condition: models.images[condition] for condition in conditions(study, scene)}
        ledgers += [ledger(row, choice.count, choice.spp, choice.left_out[row.condition]) for row in rows]
    by_share = sorted(ledgers, key=lambda row: row.share)  # so that each condition keeps its worst mosaic's share
    shares = {row.condition: row.share for row in by_share}
    made = Plan(renders=renders, images=images, shares=shares, ledgers=tuple(ledgers))
    return replace(made, summary=summary(study, made, reference_plan(study)))


def _chosen_models(choice: Choice, pilot: Pilot, study: Study) -> Plan:
    """Return the models of one scene's render and images that follow from a choice."""
    images = {}
    for condition, left_out in choice.left_out.items():
        lens = full_lens(study, preset(condition.sensor).lens, pilot.opened)
        without = [field for name, field in LENS_TERMS.items() if name in left_out]
        images[condition] = ImageModel(without_terms(lens, without), exact=KERNEL not in left_out)
    fine = pilot.transport.wavelength_nm, pilot.transport.width_nm
    bands = wide_bands(*fine, pilot.groups[choice.count])
    return Plan(renders={pilot.opened.choice: in_bands(bands, choice.spp, study.render.denoise)}, images=images)


def _choice_of(named: Plan, rows: Sequence[ScaledEffects], pilot: Pilot) -> Choice:
    """Return a starting point's choice for a pilot's scene; the pilot was made with that one number of bands."""
    (count,) = pilot.groups
    left_out = {}
    for row in rows:
        image = named.images[row.condition]
        effects = {name for name in row.lens if not getattr(image.lens, LENS_TERMS[name])}
        left_out[row.condition] = frozenset(effects if image.exact else effects | {KERNEL})
    return Choice(count, named.renders[pilot.opened.choice].spp if pilot.rendered else 0, left_out)
