"""Models that a study asks for by name, in place of the one that a plan chooses by itself.

``fast`` is for a first look, ``default`` uses exactly what the study and its sensors state, and ``reference`` models
everything.
"""

from render.illuminants import illuminant
from render.spectrum import fine_bands
from sensor.config import without_terms
from sensor.presets import preset
from studies.budget.bands import band_groups, wide_bands
from studies.budget.effects import LENS_TERMS
from studies.budget.ledger import Plan
from studies.budget.pilot import full_lens, reference_bands
from studies.study.lit_scene import OpenedScene, open_all
from studies.study.model import ImageModel, in_bands
from studies.study.study import DEFAULT, FAST, OWN, REFERENCE, Study, conditions, most_spp

FAST_BANDS, FAST_SPP = 8, 128
REFERENCE_SAMPLES = 4  # the reference has this many times the study's most samples, so at most half of its noise
MOST_SPP = 1 << 16


def starting_point(study: Study, name: str) -> Plan:
    """Return the plan of a starting point by its name in `studies.study.study.STARTING_POINTS`, without a render."""
    return {FAST: fast_plan, DEFAULT: plan_from_settings, REFERENCE: reference_plan}[name](study)


def fast_plan(study: Study) -> Plan:
    """Plan few bands and samples, the fast readout, and only those effects of the lens that the study itself states."""
    renders, images = {}, {}
    for opened in open_all(study).values():
        if opened.scene is not None:
            nm, width_nm = reference_bands(opened, study)
            bands = wide_bands(nm, width_nm, band_groups(width_nm, FAST_BANDS))
            spp = min(FAST_SPP, most_spp(study, opened.choice))
            renders[opened.choice] = in_bands(bands, spp, study.render.denoise)
        for condition in conditions(study, opened.choice):
            without_effects = without_terms(preset(condition.sensor).lens, LENS_TERMS.values())
            images[condition] = ImageModel(study.lens.on(without_effects), exact=False)
    return Plan(renders=renders, images=images)


def plan_from_settings(study: Study) -> Plan:
    """Plan bands and samples as the study states them, and lenses as the study and its sensors state them."""
    renders = {}
    for scene in study.scenes:
        lights = (illuminant(name) for name in (*study.spectra, scene.light) if name not in (OWN, None))
        bands = fine_bands(lights, study.render.range_nm, study.render.band_nm)
        renders[scene] = in_bands(bands, most_spp(study, scene), study.render.denoise)
    lenses = {name: study.lens.on(preset(name).lens) for name in study.sensors}
    images = {condition: ImageModel(lenses[condition.sensor]) for condition in conditions(study)}
    return Plan(renders=renders, images=images)


def reference_plan(study: Study) -> Plan:
    """Plan the most exact model: fine bands, four times the study's samples, the whole lens and the exact readout."""
    renders, images = {}, {}
    for opened in open_all(study).values():
        if opened.scene is not None:
            spp = min(REFERENCE_SAMPLES * most_spp(study, opened.choice), MOST_SPP)
            renders[opened.choice] = in_bands(reference_bands(opened, study), spp)
        for condition in conditions(study, opened.choice):
            images[condition] = ImageModel(full_lens(study, preset(condition.sensor).lens, opened))
    return Plan(renders=renders, images=images)


def band_count(study: Study, name: str, opened: OpenedScene) -> int:
    """Return a starting point's number of bands, before those of the lamps' lines are added."""
    if name == FAST:
        return FAST_BANDS
    if name == DEFAULT:
        low, high = study.render.range_nm
        return max(1, round((high - low) / study.render.band_nm))
    return reference_bands(opened, study)[1].size
