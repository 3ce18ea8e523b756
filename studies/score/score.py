"""Score a camera: compute every figure of merit by formula, and measure the same figure on simulated frames."""

from collections.abc import Iterator, Sequence
from math import nan

from rodcone.errors import InputError, require_whole
from rodcone.progress import Step, progress_bar
from sensor.config import SensorConfig
from sensor.emva1288.characterise import characterise
from sensor.readings.resolve import at_channel, chip_readings
from studies.metrics.truth import named_light
from studies.score.colour import colour_figures
from studies.score.contrast import contrast_figures
from studies.score.developed import developed_figures
from studies.score.even_field import even_field
from studies.score.figure import Definition, Merit, measured
from studies.score.flare import corner_illumination, flare
from studies.score.flicker import flicker
from studies.score.light_reach import EVERYWHERE, unlit, with_reach, without_light
from studies.score.noise_figures import field_words, noise_figures
from studies.score.output_speeds import output_speeds
from studies.score.print_figures import print_figures
from studies.score.sharpness import sharpness
from studies.score.texture import texture
from studies.score.visual_noise import raw_visual_noise

# Groups of figures, by the first part of their names.
GROUPS = (
    "oecf",
    "iso_12232",
    "snr10",
    "snr1s",
    "iso_15739",
    "print",
    "iso_9358",
    "lens",
    "iso_12233",
    "iso_19567",
    "ieee_1858",
    "information",
    "ieee_2020",
    "flicker",
    "iso_17321",
    "color_checker",
    "emva_1288",
    "developed",
)
Processing = tuple[str, bool]  # a processor, and whether the user consents to run it if it is a file
NORMAL_95 = 1.959964  # half the width of a 95 % interval, in standard errors


def score(
    sensor: SensorConfig,
    light: str = "D65",
    exposure_s: float = 0.033,
    only: Sequence[str] = (),
    seed: int = 0,
    *,
    processor: str | None = None,
    trust_code: bool = False,
    step: Step | None = None,
) -> list[Merit]:
    """Compute a camera's figures of merit, and measure each on simulated frames.

    Parameters
    ----------
    sensor : SensorConfig
    light : str
        Illuminant of all figures whose definition doesn't name another one.
    exposure_s : float
        Exposure time of those figures [s].
    only : sequence of str
        Groups of figures, such as ``iso_12232``, or whole names of figures; all figures by default.
    seed : int
        Seed of the chips and frames.
    processor : str, optional
        Name in `rodcone.processors()`, or ``mine.py:develop``; its pictures are measured too (``developed``).
    trust_code : bool
        Consent to run ``mine.py``, which may do all that its user may.
    step : callable, optional
        Function that is called with what is measured, and the share of the work that is done, 0 to 1.

    Returns
    -------
    list of Merit
        The figures. `Merit.missing` says why a camera doesn't have one: colours with fewer than three channels, light
        for a ratio that no light reaches, flare for a lens that states none.

    Raises
    ------
    InputError
        For a name that isn't known, ``developed`` without a processor, a seed below 0, or a processor that is unknown
        or a file of one's own without consent.

    Examples
    --------
    >>> import rodcone
    >>> (row,) = rodcone.score(rodcone.low_noise(), only=["snr10"])
    >>> row.title, row.agrees
    ('SNR10: light for a ratio of 10', True)
    """
    # What is asked for.
    require_whole("seed", seed, 0, 2**31, "give a whole number")
    for name in only:
        if name.partition(".")[0] not in GROUPS:
            raise InputError(f"only: {name!r} is not known; allowed: {', '.join(GROUPS)}; write one of them")
    if processor is None and any(name.partition(".")[0] == "developed" for name in only):
        raise InputError("only: 'developed' without a processor; allowed beside one; name it, as --processor ple")
    wanted = [
        definition
        for definition in definitions(sensor, light, exposure_s, only, (processor, trust_code) if processor else None)
        if any(_wanted(merit.name, only) for merit in definition.merits)
    ]
    # How it is measured.
    found: list[Merit] = []
    with progress_bar(step) as tell:
        for number, definition in enumerate(wanted):
            tell(definition.merits[0].title, number / (len(wanted) + 1))
            found += measured(definition, seed)
        if _group_wanted("emva_1288", only):
            tell("EMVA 1288", len(wanted) / (len(wanted) + 1))
            found += _emva(sensor, exposure_s, seed)
    in_order = sorted(found, key=lambda merit: GROUPS.index(merit.name.partition(".")[0]))
    return [merit for merit in in_order if _wanted(merit.name, only)]


def _wanted(name: str, only: Sequence[str]) -> bool:
    return not only or any(name == one or name.startswith(f"{one}.") for one in only)


def _group_wanted(group: str, only: Sequence[str]) -> bool:
    return not only or any(one.partition(".")[0] == group for one in only)


def definitions(
    sensor: SensorConfig, light: str, exposure_s: float, only: Sequence[str], processor: Processing | None = None
) -> Iterator[Definition]:
    """Define the figures of the requested groups, except EMVA's; each is computed, and not measured yet.

    Raises
    ------
    InputError
        For a camera that collects nothing under any light of the program.
    """
    if only and all(name.partition(".")[0] == "emva_1288" for name in only):
        return
    if not (reason := unlit(sensor, light)):
        yield from (with_reach(each, sensor, light) for each in _lit(sensor, light, exposure_s, only, processor))
    elif dark := unlit(sensor, EVERYWHERE):
        raise InputError(f"light: {dark}, nor do other lights go on; allowed: --only emva_1288, which needs none")
    else:
        reason += "; measure under a light that goes on, such as 3000K"
        yield from without_light(_lit(sensor, EVERYWHERE, exposure_s, only, processor), reason)


def _lit(
    sensor: SensorConfig, light: str, exposure_s: float, only: Sequence[str], processor: Processing | None
) -> Iterator[Definition]:
    channel = sensor.unit_channel
    if any(_group_wanted(group, only) for group in ("oecf", "iso_12232", "snr10", "snr1s", "iso_15739")):
        yield from noise_figures(sensor, light, exposure_s, channel)
    field = even_field(sensor, named_light(light, sensor.window_nm), exposure_s, channel)
    if _group_wanted("iso_12232", only):
        yield from output_speeds(field, field_words(field, light))
    if _group_wanted("print", only):
        yield from print_figures(field, field_words(field, light))
    if _group_wanted("iso_9358", only):
        yield flare(sensor, light, exposure_s, channel)
    if _group_wanted("lens", only):
        yield corner_illumination(sensor, light, exposure_s, channel)
    if _group_wanted("iso_15739", only):
        yield raw_visual_noise(sensor, light, exposure_s)
    if any(_group_wanted(group, only) for group in ("iso_12233", "ieee_1858", "information")):
        yield sharpness(sensor, light, exposure_s, channel)
    if _group_wanted("iso_19567", only):
        yield texture(sensor, light, exposure_s, channel)
    if _group_wanted("ieee_2020", only):
        yield from contrast_figures(sensor, light, exposure_s, channel)
    if _group_wanted("flicker", only):
        yield flicker(field, light)
    if any(_group_wanted(group, only) for group in ("iso_17321", "color_checker")):
        yield colour_figures(sensor, light, exposure_s)
    if processor is not None and _group_wanted("developed", only):
        yield from developed_figures(sensor, light, exposure_s, processor[0], trust_code=processor[1])


def _emva(sensor: SensorConfig, exposure_s: float, seed: int) -> list[Merit]:
    """Return the figures of the unit channel's reading, measured as an EMVA 1288 laboratory measures a chip."""
    reading = at_channel(chip_readings(sensor, exposure_s), sensor.unit_channel)[0].sensor
    chip = characterise(reading, seed=seed)
    conditions = "a chip of 256 x 320 pixels, photon transfer of even fields"
    scores = []
    for figure in chip.figures:
        half = NORMAL_95 * figure.error if figure.error > 0 else nan
        name = "emva_1288." + "_".join("".join(x if x.isalnum() else " " for x in figure.name.lower()).split())
        stated = (name, figure.name, figure.unit, "EMVA 1288, release 4", conditions)
        scores.append(
            Merit(*stated, figure.configured, figure.measured, figure.measured - half, figure.measured + half)
        )
    return scores
