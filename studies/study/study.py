"""A study: scenes, spectra, levels, exposures, sensors, ..., processors and seeds; every combination is a cell."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated

from isp.processors.catalogue import DEFAULT_PAIR
from isp.processors.own import processor_of, require_consent, user_file
from render.illuminants import illuminant
from render.radiance_files.radiance_source import ENDINGS, is_radiance_file, is_reflectance
from render.spectrum import VISIBLE_NM
from rodcone.curve_file import ENDINGS as CURVES
from rodcone.display import brief
from rodcone.errors import (
    InputError,
    in_place,
    require_absent,
    require_fields,
    require_keys,
    require_name,
    require_range,
    require_whole,
    unknown,
)
from sensor.config import LONGEST_S
from sensor.exposure import AUTO_INFORMATION
from sensor.flicker.rows import check_flicker
from sensor.flicker.waveform import waveform
from sensor.lens.table import lens_table
from sensor.presets import preset, vary
from sensor.shake import SHAKES
from studies.study.equal_area import EqualArea
from studies.study.gain import at_gain, gain_text
from studies.study.levels import check_known, check_rendered_range, parse_exposure, parse_level
from studies.study.model import LensTerms
from studies.study.motion import check_moving

OWN = "own"  # value of `spectra` that keeps the spectra of the scene's own lights
MOST_FRAMES = 64
# The neutral of the scene's light, which a camera notes in its raw files; or Gray World, found in the picture.
WHITE_BALANCES = AS_SHOT, GRAY_WORLD = "as-shot", "gray-world"
PAPER_METHOD = "interleaved_paper"  # the processor whose published method includes Gray World
_LISTS = ("scenes", "spectra", "levels", "exposures", "sensors", "white_balances", "processors", "frames", "seeds")
_GAINS = ("gains", "isos")
SPP = 1, 1 << 16, "give samples per pixel"
# Which effects a study's pictures include: those of the cheapest model within the budget, or of a starting point.
AUTOMATIC = "automatic"
STARTING_POINTS = FAST, DEFAULT, REFERENCE = "fast", "default", "reference"
FILES = (".xml", ".toml", *CURVES, *ENDINGS)  # endings of values that name a file


@dataclass(frozen=True)
class SceneChoice:
    """A scene of the catalogue by name, a Mitsuba scene (``.xml``) or a picture file.

    Such files hold radiance (``.exr``, ``.mat``, cubes), or reflectances (cubes, photographs) for any light.

    Attributes
    ----------
    source : str
    light : str, optional
        Option ``light`` of a catalogue scene's builder; for a picture file the light that its colours are judged under.
    extend : str, optional
        ``hold``: surfaces go on at their end values outside their tables.
    chart : str, optional
        File (``.csv``, ``.spd``) of reflectances of ``color_checker``'s patches, in place of the ColorChecker's.
    define : tuple of str
        ``NAME=VALUE`` of a Mitsuba scene's $parameters.
    spp : int, optional
        Samples per pixel, in place of `RenderLimits.spp`.
    spectra : str, optional
        Of a photograph's colours, ``surfaces``, which is the default, or ``srgb_basis``
        (`render.radiance_files.photo.read_photo`).
    focus_m : float, optional
        Distance of focus: the scene is rendered through a thin lens of the sensors' f-number, which must be one.
    focal_length_mm : float, optional
        Of that lens; left out, that of a sensor as wide as the picture's pixels.
    moments : int, optional
        Times at which a scene that moves is rendered, spread over the longest exposure; each costs a render, and the
        truth, which is the scene at the middle of all exposures, as many samples as all of them.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.SceneChoice("still_life", light="A").label
    'still_life'
    """

    source: str
    light: str | None = None
    extend: str | None = None
    chart: str | None = None
    define: tuple[str, ...] = ()
    spp: Annotated[int | None, SPP] = None
    spectra: str | None = None
    focus_m: Annotated[float | None, (1e-3, 1e6, "give metres")] = None
    focal_length_mm: Annotated[float | None, (1e-3, 1e5, "give millimetres")] = None
    moments: Annotated[int | None, (1, 256, "give times within the exposure")] = None

    @property
    def label(self) -> str:
        """Return the scene's name in rows: its own, its file's or its chart's.

        The lens that it is seen through, and the number of its times, are parts of the name.
        """
        focal = "" if self.focal_length_mm is None else f"{self.focal_length_mm:g} mm "
        lens = "" if self.focus_m is None else f", {focal}focused at {self.focus_m:g} m"
        moving = "" if self.moments is None else f", at {self.moments} times"
        return label(self.chart or self.source) + lens + moving

    def __post_init__(self) -> None:
        source: object = self.source  # a Path if it comes from Python
        object.__setattr__(self, "source", str(source) if isinstance(source, Path) else source)
        require_fields(self)
        if self.focus_m is None and self.focal_length_mm is not None:
            raise InputError(
                f"focal_length_mm: {self.focal_length_mm:g} without a distance of focus; allowed: both; give focus_m"
            )


@dataclass(frozen=True)
class RenderLimits:
    """Limits of the scenes' renders: the most that a plan may ask for, and the values used without a plan.

    Attributes
    ----------
    size : int, optional
        Longer side in pixels; left out, 256, or what a Mitsuba scene's film has. A picture file keeps its own size.
    band_nm : float
        Width of the bands without a plan; 20 nm do for smooth spectra.
    spp : int
        Samples per pixel.
    max_seconds : float, optional
        Time for each render; with it results depend on the machine's speed.
    seed : int
    range_nm : (float, float)
        Wavelengths that are rendered; a sensor whose window reaches beyond 380-780 nm needs them.
    noise_share : float, optional
        Stop earlier, once 95 % of the pixels see a Monte Carlo variance of this share of the sensor's own or less, in
        the brightest light that the study asks for; of the unbiased light, denoised or not.
    denoise : bool
        Photograph the denoised light (`render.denoised`): its measured error is then the pictures' Monte Carlo share.
    reference : bool
        Photograph the reference light (`render.reference`) where there is one of the scene, size and bands: a render of
        few samples is then made only to compare with it.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.RenderLimits(size=64, spp=32).band_nm
    20.0
    """

    size: Annotated[int | None, (16, 8192, "give the picture's longer side in pixels")] = None
    band_nm: Annotated[float, (1.0, 100.0, "give nanometres")] = 20.0
    spp: Annotated[int, SPP] = 512
    max_seconds: Annotated[float | None, (1e-3, 1e7, "give seconds")] = None
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0
    range_nm: tuple[float, float] = VISIBLE_NM
    noise_share: Annotated[float | None, (1e-6, 1e3, "give a share of the noise variance: 0.03")] = None
    denoise: bool = False
    reference: bool = False


@dataclass(frozen=True)
class BudgetShares:
    """Accuracy that a plan may give up, or the starting point that is taken in place of a plan's own choice.

    Attributes
    ----------
    total : float
        Noise variance that all approximations together may add, over the sensor's own.
    monte_carlo : float
        Part of `total` that the Monte Carlo noise of the render may add.
    model : str
        ``automatic``: the cheapest model within these shares. A starting point pays no heed to them: ``fast`` for a
        first look, ``default`` for the study and its sensors as they are stated, ``reference`` for everything.
    """

    total: Annotated[float, (1e-6, 1e3, "give a share of the noise variance: 10 % is 0.1")] = 0.10
    monte_carlo: float = 0.03
    model: str = AUTOMATIC


@dataclass(frozen=True)
class Condition:
    """A place in the study's grid: all that decides the expected electrons, except the mosaic.

    Attributes
    ----------
    scene : SceneChoice
    spectrum : str
        An illuminant's name or file, or ``own``.
    level : str
        ``25cd/m2`` (mean scene luminance) or ``500lux`` (on the reference plane).
    exposure : str
        A rule of `sensor.exposure.RULES` such as ``auto``, or a time such as ``10ms``.
    sensor : str
        Preset by name, or a ``.toml`` file.
    white_balance : str
        One of `WHITE_BALANCES`.
    frames : int
        Number of exposures, each of that time, that are merged before they are developed.
    gain : str
        ``own``, the sensor's gain, which a rule of exposure may raise; a factor such as ``8``; or ``ISO 400``.
    """

    scene: SceneChoice
    spectrum: str
    level: str
    exposure: str
    sensor: str
    white_balance: str = AS_SHOT
    frames: int = 1
    gain: str = OWN


@dataclass(frozen=True)
class Study:
    """Axes of a sweep, and how its pictures are made. Every combination of the ten axes is a cell.

    `trust_code` is the consent to run the user's own Python files among `processors`; no study file can give it.
    `sensor_side_um` gives all sensors one longer side: pixels follow from each pitch, and pictures are averaged to the
    pixels of the coarsest before they are measured. Left out, a pixel of the render is one of every sensor.
    `gains` are fixed gains between pixel and converter, `isos` saturation-based speeds in their place; without either
    each sensor has its own.
    `white_balances` left out are those that `default_balance` has for the processors.
    `flicker` is the waveform of all lamps, such as ``fluorescent@100Hz`` (`sensor.flicker.waveform`); left out, they
    are steady. Each seed starts its exposures at a time of its own.
    `title` heads the report; where it is empty, `name` does. `compare` names the two processors that the report sets
    beside each other at first; left out, the same method on both mosaics where the study holds it.

    Raises
    ------
    InputError
        For whatever isn't allowed, as far as that can be checked without opening the scenes.

    Examples
    --------
    >>> import rodcone
    >>> study = rodcone.Study([rodcone.SceneChoice("still_life")], ["1lux", "100lux"])
    >>> study.processors
    ('ple_rgbw', 'ple_bayer')
    """

    scenes: tuple[SceneChoice, ...]
    levels: tuple[str, ...]
    spectra: tuple[str, ...] = (OWN,)
    exposures: tuple[str, ...] = (AUTO_INFORMATION,)
    sensors: tuple[str, ...] = ("low_noise",)
    white_balances: tuple[str, ...] = ()
    processors: tuple[str, ...] = DEFAULT_PAIR
    seeds: tuple[int, ...] = (0,)
    frames: tuple[int, ...] = (1,)
    gains: tuple[float, ...] = ()
    isos: tuple[float, ...] = ()
    name: str = "study"
    title: str = ""
    flicker: str = ""
    compare: tuple[str, ...] = ()
    longest_exposure_s: Annotated[float, (1e-9, 1e6, "give seconds above 0")] = LONGEST_S
    sensor_side_um: Annotated[float | None, (1.0, 1e6, "give micrometres, or leave it out")] = None
    render: RenderLimits = field(default_factory=RenderLimits)
    lens: LensTerms = field(default_factory=LensTerms)
    budget: BudgetShares = field(default_factory=BudgetShares)
    trust_code: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in (*_LISTS, *_GAINS, "compare"):  # from Python they may be lists, and files Paths
            if isinstance(values := getattr(self, name), list | tuple):
                object.__setattr__(self, name, tuple(str(x) if isinstance(x, Path) else x for x in values))
        for place in ("", "render.", "lens.", "budget."):
            require_fields(getattr(self, place.rstrip("."), self), place)
        balances = self.white_balances or tuple(dict.fromkeys(map(default_balance, self.processors)))
        object.__setattr__(self, "white_balances", balances)
        _check_axes(self)
        _check_cameras(self)
        if self.compare and (len(set(self.compare)) != 2 or not set(self.compare) <= set(self.processors)):
            raise InputError(
                f"compare: {list(self.compare)} is no pair of the study's processors; allowed: two of "
                f"{', '.join(self.processors)}"
            )
        _check_gains(self)
        _check_shares_and_sizes(self)

    @property
    def gain_texts(self) -> tuple[str, ...]:
        """Return the values of the axis of gains, as texts for `Condition`."""
        texts = [gain_text(gain, None) for gain in self.gains] + [gain_text(None, iso) for iso in self.isos]
        return tuple(texts) or (OWN,)

    @cached_property
    def equal_area(self) -> EqualArea | None:
        """Return the size that all sensors share; None where each sensor has the render's pixels."""
        if self.sensor_side_um is None:
            return None
        return EqualArea(self.sensor_side_um, max(preset(name).pixel.pitch_um for name in self.sensors))


def default_balance(processor: str) -> str:
    """Return a processor's white balance where a study states none: Gray World for the paper's method, else as shot."""
    return GRAY_WORLD if processor == PAPER_METHOD else AS_SHOT


def conditions(study: Study, scene: SceneChoice | None = None) -> list[Condition]:
    """Return all conditions of a study, or of one of its scenes; the last axis varies fastest."""
    scenes = study.scenes if scene is None else (scene,)
    camera = study.exposures, study.sensors, study.white_balances, study.frames, study.gain_texts
    return [Condition(*place) for place in product(scenes, study.spectra, study.levels, *camera)]


def most_spp(study: Study, scene: SceneChoice) -> int:
    """Return the most samples per pixel that a scene's render may have."""
    return scene.spp or study.render.spp


def study_mosaics(study: Study) -> tuple[str, ...]:
    """Return the mosaics that the study's processors take, each once."""
    return tuple(dict.fromkeys(processor_of(name).mosaic for name in study.processors))


def label(value: object) -> str:
    """Return the name of an axis's value in rows and seeds: a file's name without folder; others stay as they are."""
    text = str(value)
    user_code = user_file(text)
    if user_code is not None:
        return f"{user_code[0].name}:{user_code[1]}"
    return Path(text).name if Path(text).suffix.lower() in FILES else text


def _check_axes(study: Study) -> None:
    """Check that no axis is empty or repeats a value, and that levels, times, seeds and lights are valid."""
    for name in _LISTS:
        values = getattr(study, name)
        labels = [value.label if isinstance(value, SceneChoice) else label(value) for value in values]
        if not labels or len(set(labels)) != len(labels):
            raise InputError(
                f"{name}: {labels!r} is not allowed; give one or more, each once, files under names of their own"
            )
    for level in study.levels:
        parse_level(level)
    for exposure in study.exposures:
        parse_exposure(exposure)
    for count in study.frames:
        require_whole("frames", count, 1, MOST_FRAMES, "give exposures of a burst, 1 for none")
    for seed in study.seeds:
        require_whole("seeds", seed, 0, 2**63 - 1, "give whole numbers")
    for scene in study.scenes:
        if scene.light is not None:
            illuminant(scene.light)
    check_rendered_range(study.render.range_nm)
    for spectrum in study.spectra:
        if spectrum != OWN:
            check_known(spectrum, study.render.range_nm)
            for scene in study.scenes:
                if is_radiance_file(scene.source) and not is_reflectance(scene.source):
                    raise InputError(
                        f"spectra: {spectrum!r} can't relight {scene.source}, a picture whose light is in it; "
                        f"allowed: {OWN}; put the scene into a study of its own"
                    )


def _check_gains(study: Study) -> None:
    """Check that gains or speeds are given, not both, each once, and that every sensor has them."""
    for name in _GAINS:
        for value in getattr(study, name):
            require_range(name, None if isinstance(value, bool) else value, 1e-3, 1e9, "give factors or speeds above 0")
    if len(set(study.gain_texts)) < len(study.gain_texts) or (study.gains and study.isos):
        raise InputError(
            f"gains: {list(study.gains)} and isos: {list(study.isos)} are not allowed; give values of one of the two, "
            "each once"
        )
    for name, gain in product(study.sensors, study.gain_texts):
        with in_place(f"sensor {label(name)}"):
            at_gain(preset(name), gain)


def _check_cameras(study: Study) -> None:
    """Check white balances, processors, and each sensor with the mosaics that the processors develop."""
    require_keys("white_balances", study.white_balances, WHITE_BALANCES)
    for name in study.processors:
        require_consent("processors", name, study.trust_code)
        processor_of(name)
    if study.flicker:
        waveform(study.flicker)
    for name in study.sensors:
        sensor = preset(name)
        if study.lens.table:
            with in_place("lens.table"):
                lens_table(study.lens.on(sensor.lens))
        if study.flicker:
            with in_place(f"sensor {label(name)}"):
                check_flicker(replace(sensor, lens=study.lens.on(sensor.lens)))
        # Sensors of one size are compared in the pixels of the coarsest sensor.
        if study.sensor_side_um is None and sensor.sites != preset(study.sensors[0]).sites:
            raise InputError(
                f"sensors: of {name!r} and {study.sensors[0]!r} one bins, so that its pictures are half as large; "
                "allowed: all bin, or none; give each a study of its own"
            )
        for mosaic in study_mosaics(study):
            with in_place(f"sensor {label(name)} with the mosaic {mosaic}, which a processor takes"):
                vary(sensor, mosaic)


def _check_shares_and_sizes(study: Study) -> None:
    budget, side_um = study.budget, study.sensor_side_um
    if study.lens.shake is not None and study.lens.shake not in SHAKES:
        raise unknown("lens.shake", study.lens.shake, SHAKES)
    require_name("budget.model", budget.model, (AUTOMATIC, *STARTING_POINTS))
    require_range("budget.monte_carlo", budget.monte_carlo, 1e-6, budget.total, "give a share within budget.total")
    _check_moments(study)
    if side_um is None:
        return
    for name in study.sensors:
        pitch_um = preset(name).site_pitch_um
        across = round(side_um / pitch_um)
        fix = f"give {16 * pitch_um:g} to {8192 * pitch_um:g}"
        require_whole(
            f"sensor_side_um: pixels across {label(name)}", across, 16, 8192, f"{side_um:g} um is given; {fix}"
        )


def _check_moments(study: Study) -> None:
    """Check that exposures of scenes that move are times, not rules, and that no setting excludes motion."""
    moving = [scene for scene in study.scenes if scene.moments is not None]
    if not moving:
        return
    beside = f"beside scene {moving[0].label}, which moves"
    for exposure in study.exposures:
        if parse_exposure(exposure) is None:
            raise InputError(
                f"exposures: {exposure!r} {beside}; allowed: times, such as 100ms, because a rule needs the light that "
                "the exposure itself blurs; give times"
            )
    limits = study.render
    rolls = any(preset(name).row_time_us for name in study.sensors)
    require_absent(
        beside,
        **{
            "frames": None if study.frames == (1,) else list(study.frames),
            "render.noise_share": limits.noise_share,
            "render.max_seconds": limits.max_seconds,
            "render.denoise": limits.denoise,
            "sensor_side_um": study.sensor_side_um if rolls else None,  # its rows aren't the render's
        },
    )
    longest_s = max(parse_exposure(exposure) or 0.0 for exposure in study.exposures)
    lamps = [waveform(study.flicker)] if study.flicker else []
    for name in study.sensors:
        with in_place(f"sensor {label(name)}"):
            for scene in moving:
                check_moving(preset(name), lamps, longest_s, scene.moments or 1)
