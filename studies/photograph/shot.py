"""Take one photograph of a scene or of a stored radiance, and write it as raw files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import prod
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from isp.converters import converter_note, write_with_bayer
from render.cache import kept_beside
from render.engine import render
from render.illuminants import illuminant
from render.radiance import BandRadiance, SpectralRadiance
from render.radiance_files.radiance_source import (
    comes_by_band,
    extent_of,
    is_radiance_file,
    is_reference,
    is_reflectance,
)
from render.radiance_files.stored_planes import with_stored_light
from render.scene import Scene, film_size
from render.spectrum import RENDER_BAND_NM, Spectrum, fine_bands
from render.transport import Transport, halves_by_band, light_alone, relight_by_band
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError, require_absent, require_fields
from rodcone.files import check_place
from rodcone.memory import VIEWED, LightMemory, imaged_by_band, require_memory
from rodcone.progress import Step, compile_note, render_words
from rodcone.time_text import parse_time
from rodcone.types import Floats
from sensor.capture import expose_channels
from sensor.config import SensorConfig, check_frame
from sensor.device import draw_device
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W, exposed_by_rule, warn_if_dark
from sensor.flicker.photograph import frame_starts_s, photograph_flickering
from sensor.flicker.rows import check_flicker, steady_exposure_s
from sensor.flicker.waveform import Waveform
from sensor.lens.table import with_lens
from sensor.optics import form_image, left_out, spreads
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.raw_file import check_ending
from sensor.response import behind_filters, imaged_electrons
from sensor.shake import held_lens
from studies.photograph.camera import calibrate, with_notes
from studies.photograph.lamps import flicker_of, lamp_parts
from studies.photograph.moments import rolling_average, rolling_moments, time_average
from studies.photograph.ready_light import Ready, find_ready
from studies.study.cost import TABLE_BAND_S, TABLE_S, PictureCost
from studies.study.focus import in_focus
from studies.study.gain import at_gain, gain_text
from studies.study.levels import parse_exposure, parse_level
from studies.study.lit_scene import asked_spectra, under
from studies.study.model import samples_a_side
from studies.study.motion import check_moving, longest_span_s, moments_s
from studies.study.render_noise import monte_carlo_share, noise_note, speckle_sizes
from studies.study.scene_source import (
    LIGHT,
    asked_level,
    asked_size,
    check_radiance_file,
    file_white,
    first_light,
    open_radiance_file,
    open_scene,
)
from studies.study.study import AS_SHOT, GRAY_WORLD, MOST_FRAMES

MOST_SATURATED = 0.5  # share of saturated pixels above which an exposure is probably a mistake
_LAMPS_IN_VIEW = 1.1  # ratio of the picture's mean luminance to the level above which a note explains the difference
_SPP = 64
_FILE_ARRAYS = 2  # arrays of a file's light with all bands: the light, and its variance or its source
_HALVES = 2  # arrays of a render's light: its mean, and half the difference of its halves
_MOST_HELD_BYTES = 1 << 28  # largest of these arrays that stays in memory; larger ones are read from files, by band
_AFTER_S = 3.5e-7  # processor seconds per pixel and band to relight, image, expose and judge the noise
# Second part of the seed of each random stream: the chip's patterns, the exposure's noise, the moment in the lamps'
# cycle at which the exposure starts, and the light's paths at its later times.
_DEVICE, _FRAME, _START, _MOMENT = 0, 1, 2, 3
_ALL_ROWS = (
    "flicker: all rows are exposed together, so that the lamps brighten or darken the whole frame; for bands state the "
    "time from row to row, such as --row-time 15us"
)


@dataclass(frozen=True, kw_only=True)
class Order:
    """Subject to photograph, and the settings of camera, light and render.

    Attributes
    ----------
    source : str or Path
        Scene by name such as color_checker, a Mitsuba scene (.xml), spectral radiance (.exr, or ISETCam's .mat), a cube
        described by a .toml (.npy, ENVI's .hdr, .mat), a photograph (.jpg, .png), or .npz of rodcone reference.
    out : str or Path
        Raw file to write: .dng for Bayer, 2x2 RGBW and quads of both (beside what not every raw converter develops a
        16-bit Bayer one for them, NAME_bayer.dng), .tif with a .json beside it for any mosaic.
    sensor : str or Path
        Sensor preset by name, or a preset file.
    cfa : str, optional
        Mosaic by name, or rows such as RG/BW; the preset's own by default.
    exposure : str
        Time such as 20ms or 1/50, 0s for a dark frame, or a rule: auto for the brightest green, auto:W for the
        brightest W, auto:information for the time of a ladder that leaves the least expected error in the picture.
    gain : float, optional
        Fixed gain between pixel and converter, 1 or more, at which the converter's top is the well over it; the
        sensor's own by default, which a rule of exposure raises up to its gain_limit once its time is the longest.
    iso : float, optional
        Saturation-based speed in the gain's place.
    level : str, optional
        Light, such as 25cd/m2 (mean scene luminance) or 500lux (on its reference plane); the scene's own by default.
    light : tuple of str
        ILLUMINANT, such as A, in place of all of the scene's lights, or GROUP=ILLUMINANT in place of one group, each at
        the same luminance; may be given several times. It is a name or a file, such as sky=led.csv. For a file of
        radiance the light that it was lit by.
    chart : str, optional
        File (.csv, .txt, .spd) of reflectances of color_checker's patches, 1 to 24: wavelength_nm and a column each.
    white_balance : str
        Illuminant, such as D65, under which grey is shown as grey; as-shot for the scene's first light, which is known
        here, and that of --light, or D65, for a file of radiance.
    size : int, optional
        Longer side of the render in pixels; by default that of the scene's light if it is there already, such as 512
        of still_life, or 256; a .xml scene's film and a file of radiance have their own.
    height : int, optional
        Pixels; with one of height and width the other keeps the proportions.
    width : int, optional
        Pixels; as height.
    spp : int, optional
        Samples per pixel of the render; 64 by default, where the scene's light isn't there already.
    render : bool
        Render the scene here, even if its light is there already; --spp does so too.
    frames : int
        Exposures of a burst, each in a file of its own, NAME_1, NAME_2 and so on; develop merges them.
    shake : str, optional
        hand: the camera is held in the hand, whose tremor moves the image during each exposure; none by default.
    flicker : tuple of str
        WAVEFORM of all lamps, or GROUP=WAVEFORM of one light group; may be given several times. A waveform is a lamp on
        the mains such as fluorescent@100Hz, sodium_high@120Hz or incandescent@100Hz, a switched lamp such as
        pwm@1000Hz:0.25 (lit for a quarter of each period), or a CSV of one period. Levels are means over time.
    row_time : str, optional
        Time from one row's exposure to the next's, such as 15us; the sensor's own by default, which is 0 unless its
        file states row_time_us. Where it isn't 0 lamps that flicker make bands, and a hand's shake leans upright lines.
    lens : str, optional
        Lens by data in place of the sensor's: cooke_triplet, double_gauss, double_gauss_f4, or a TOML file. Its point
        spread by image height, falloff, distortion and lateral colour then count; the sensor's own lens by default.
    focus_m : float, optional
        Distance of focus in metres: the scene is rendered through a thin lens of the sensor's f-number, a render for
        each f-number; by default all of it is sharp. A picture from a file has no depth.
    focal_length_mm : float, optional
        Of that lens; by default that of a sensor as wide as the picture's pixels, which for few of them is short.
    moments : int, optional
        Times, spread evenly over the exposure, at which a scene that moves is rendered: walker, or a .xml with a
        parameter $time_s. Each costs a render of its own, and the exposure must be a time. By default nothing moves.
    seed : int
        Seed of the render, the chip and the exposure.
    trust_scene : bool
        Let a .xml scene load plug-ins of its own, which are native code, and files from anywhere.
    define : tuple of str
        NAME=VALUE of a $parameter of the scene file; -D is short for it; may be given several times.
    extend : str, optional
        hold: surfaces keep their end values outside their tables' wavelengths; by default bands there are refused.
    force : bool
        Run even where more memory is needed than is free.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.Order("still_life", cfa="bayer", exposure="10ms").exposure
    '10ms'
    """

    source: str | Path = field(kw_only=False)
    out: str | Path = field(default="shot.dng", kw_only=False)
    sensor: str | Path = "low_noise"
    cfa: str | None = None
    exposure: str = AUTO_INFORMATION
    gain: float | None = None
    iso: float | None = None
    level: str | None = None
    light: tuple[str, ...] = ()
    chart: str | None = None
    white_balance: str = AS_SHOT
    size: Annotated[int | None, (1, 8192, "give the picture's longer side in pixels")] = None
    height: int | None = None
    width: int | None = None
    spp: Annotated[int | None, (1, 1 << 16, "give samples per pixel")] = None
    render: bool = False
    frames: Annotated[int, (1, MOST_FRAMES, "give exposures of a burst")] = 1
    shake: str | None = None
    flicker: tuple[str, ...] = ()
    row_time: str | None = None
    lens: str | None = None
    focus_m: Annotated[float | None, (1e-3, 1e6, "give metres")] = None
    focal_length_mm: Annotated[float | None, (1e-3, 1e5, "give millimetres")] = None
    moments: Annotated[int | None, (1, 256, "give times within the exposure")] = None
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0
    trust_scene: bool = False
    define: tuple[str, ...] = ()
    extend: str | None = None
    force: bool = False

    def __post_init__(self) -> None:
        require_fields(self)


@dataclass(frozen=True)
class Taken:
    """Paths of the files written, facts about the exposure for JSON, and notes on what had to be assumed."""

    paths: tuple[Path, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Checked:
    """Order that was checked and can be carried out.

    Attributes
    ----------
    order : Order
    sensor : SensorConfig
    opened : SceneFile or None
        None for a stored radiance.
    moving : tuple of Scene
        The scene at each time of the exposure; empty where it stands still.
    shares : (time, row) float64 or None
        Share of each time in the exposure of each row, for a scene that moves while rows roll; otherwise None
        (`studies.photograph.moments.rolling_moments`).
    exposure_s : float or None
        Exposure time; None if a rule chooses it.
    ready : Ready or None
        Light that was rendered before; None if the scene has to be rendered.
    samples : int
        Samples of the light along each side of a pixel.
    cost : PictureCost
    flicker : mapping of str to Waveform
        Waveforms of lamps that flicker, by light group.
    """

    order: Order
    sensor: SensorConfig
    opened: SceneFile | None
    exposure_s: float | None
    ready: Ready | None
    samples: int
    cost: PictureCost
    flicker: Mapping[str, Waveform]
    moving: tuple[Scene, ...] = ()
    shares: Floats | None = None


def take(order: Order, step: Step | None = None) -> Taken:
    """Take a photograph and write it; a negative that not every converter develops gets ``NAME_bayer.dng`` beside it.

    Parameters
    ----------
    order : Order
    step : callable, optional
        Function that is called with what is being done and the share that is done; left out, a notebook shows a bar for
        the render.

    Raises
    ------
    InputError
        For an unknown name or a value out of range, before anything is rendered.
    OSError
        Where the folder can't be written.
    """
    return carry_out(check(order), step)


def carry_out(checked: Checked, step: Step | None = None) -> Taken:
    """Take the photograph of a checked order, and write it; `step` and errors are as in `take`."""
    with kept_beside(Path(checked.order.out)) as kept:
        return _taken(checked, step, kept)


@dataclass(frozen=True)
class _Subject:
    """Scene or picture that is photographed.

    Attributes
    ----------
    transport : callable
        Function that returns the subject's light, which it may have to render, and notes on that.
    spectra, level : dict
        As in `Transport.relight`.
    light : Spectrum
        The light that the camera's colours are set to, unless another is asked for.
    notes : tuple of str
    """

    transport: Callable[[], tuple[Transport, list[str]]]
    spectra: dict[str, Spectrum]
    level: dict[str, Any]
    light: Spectrum
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Electrons:
    """Light to which the chip is exposed, in electrons.

    Attributes
    ----------
    per_second_e : (h, w, channel) float64
        Electrons per second behind every filter.
    error_e, expected_e : (h, w) float64, or None
        For each pixel of the raw image, one draw of the render's error and the expected electrons, both in the whole
        exposure; None for a stored picture.
    exposure_s : float
    sensor : SensorConfig
        The sensor at the gain that the exposure takes.
    """

    per_second_e: NDArray[np.float64]
    error_e: NDArray[np.float64] | None
    expected_e: NDArray[np.float64] | None
    exposure_s: float
    sensor: SensorConfig


def _taken(checked: Checked, step: Step | None, kept: Path) -> Taken:
    """Do what `carry_out` does, with `kept` as the folder for the render's files until the photograph is written."""
    order, samples = checked.order, checked.samples
    require_memory(checked.cost.memory, order.force)
    out = Path(order.out)
    balance = None if order.white_balance == AS_SHOT else illuminant(order.white_balance)
    subject = _of_file(checked, balance) if checked.opened is None else _of_scene(checked, balance, step, kept)
    colour = calibrate(checked.sensor, balance or subject.light)
    check_place(out)  # before the render, which may take minutes
    transport, more_notes = subject.transport()
    notes = [*subject.notes, *more_notes]
    spectra, level = subject.spectra, subject.level

    # The exposure.
    if step:
        step("exposure", 0.9)
    radiance = relight_by_band(transport, spectra, **level)
    transport = light_alone(transport)  # the relit light has its own error
    luminance_cd_m2 = radiance.mean_luminance
    if luminance_cd_m2 > _LAMPS_IN_VIEW * level.get("luminance_cd_m2", luminance_cd_m2):
        notes += [
            f"level: {order.level} is the mean of what is no lamp; with the lamps in view the picture's is "
            f"{luminance_cd_m2:.3g} cd/m2"
        ]
    errors = {"relative_mc_error": radiance.relative_mc_error, "relative_level_error": radiance.relative_level_error}
    spp = transport.spp
    lit = _electrons(checked, radiance, partial(halves_by_band, transport, spectra, **level))
    sensor, exposure_s = lit.sensor, lit.exposure_s
    lamps = lamp_parts(transport, spectra, level, checked.flicker)
    whole = radiance.whole() if lamps else None
    del subject, transport, radiance  # free all bands of the light, which nothing needs from here on
    taken = _frames(checked, lit, whole, lamps)
    notes += [_ALL_ROWS] * bool(lamps and sensor.row_time_us == 0)
    del whole, lamps
    raws = [with_notes(frame, sensor, colour, order.sensor) for frame in taken]
    raw = raws[0]
    warn_if_dark(raw)
    if lit.error_e is not None and lit.expected_e is not None:
        frame = lit.error_e, lit.expected_e, sensor, exposure_s
        notes += filter(None, [noise_note(monte_carlo_share(*frame), spp, speckle_sizes(*frame))])
    saturated = float(raw.saturated.mean())
    if saturated > MOST_SATURATED:
        notes += [f"{saturated:.0%} of the pixels are saturated at {exposure_s:g} s; shorten or omit --exposure"]
    del lit

    # The files.
    paths = _written(raws, order)
    if out.suffix.lower() == ".dng":
        notes += filter(None, [converter_note(raw, paths[0])])
    facts = {
        "paths": [str(path) for path in paths],
        "source": str(order.source),
        "sensor": str(order.sensor),
        "cfa": list(raw.cfa),
        "size": list(raw.shape),
        "seed": order.seed,
        "exposure_s": exposure_s,
        "gain": sensor.gain,
        "iso": raw.iso,
        "engine": raw.engine,
        "luminance_cd_m2": luminance_cd_m2,
        **errors,
        "saturated": saturated,
        "left_out": [x for x in left_out(sensor, samples) if order.focus_m is None or not x.startswith("defocus: a")],
    }
    return Taken(paths, facts, tuple(notes))


def _of_file(checked: Checked, balance: Spectrum | None) -> _Subject:
    """Open a stored picture."""
    order = checked.order
    light_name = order.light[0] if order.light else None
    light_of_file = light_name or (None if balance is None or is_reflectance(order.source) else order.white_balance)
    white = file_white(order.source, light_of_file)
    white = white if light_name else replace(white, named=False)  # --white-balance doesn't name the lamp
    transport, notes = open_radiance_file(order.source, white)
    light = white.spectrum
    if is_reference(order.source):
        light = light if light_of_file else first_light(transport.groups, light)
        transport = under(transport, light_name) if light_name else transport
    level: dict[str, Any] = {"luminance_cd_m2": parse_level(order.level)[0]} if order.level else {}
    return _Subject(lambda: (transport, []), {}, level, light, tuple(notes))


def _of_scene(checked: Checked, balance: Spectrum | None, step: Step | None, kept: Path) -> _Subject:
    """Find the lights of a scene; the scene is rendered only when the result's `transport` is called."""
    order, opened, ready = checked.order, checked.opened, checked.ready
    assert opened is not None
    spectra = asked_spectra(opened.scene, order.light)
    name, first = next(iter(opened.scene.groups.items()))
    light = spectra.get(name, first_light(opened.scene.groups, illuminant(LIGHT)))
    notes = [*opened.notes]
    if balance is None and first.coloured:
        assumed = f"scene {opened.scene.name}: light group {name!r} has colours of its own; white balance is set to"
        notes.insert(0, f"{assumed} {LIGHT}, --white-balance sets it otherwise")

    def transport() -> tuple[Transport, list[str]]:
        if ready:
            return ready.transport, [ready.line]
        rendered = _rendered(checked, opened, spectra, step, kept)
        if _lies_in_files(rendered.light.mean.nbytes):
            rendered = with_stored_light(rendered, kept)
        return rendered, [*filter(None, [compile_note(rendered.compile_s)])]

    return _Subject(transport, spectra, asked_level(opened.scene, order.level), light, tuple(notes))


def _written(raws: Sequence[RawImage], order: Order) -> tuple[Path, ...]:
    """Write the order's exposures, each with its Bayer negative where there is one."""
    out = Path(order.out)
    places = [out] if order.frames == 1 else [out.with_stem(f"{out.stem}_{n}") for n in range(1, order.frames + 1)]
    numbers = [None] if order.frames == 1 else range(1, order.frames + 1)
    parts = zip(raws, places, numbers, strict=True)
    return tuple(path for frame, place, number in parts for path in write_with_bayer(frame, place, frame=number))


def _electrons(
    checked: Checked, radiance: BandRadiance, halves: Callable[[], tuple[BandRadiance, BandRadiance]]
) -> _Electrons:
    """Image the light, and choose the exposure; the light's bands are made one at a time."""
    samples = checked.samples
    per_second_e = imaged_electrons(radiance, checked.sensor, 1.0, samples)
    exposure_s, sensor = _exposure(checked, per_second_e)
    if checked.opened is None:
        return _Electrons(per_second_e, None, None, exposure_s, sensor)
    # The render's error is half the difference of its halves, because the frame is their mean. Next to a lamp the image
    # of a lens that is sampled once per pixel falls below 0; `form_image` replaces that by 0.
    expected_e = _mosaic(per_second_e, sensor) * exposure_s
    even_e = _mosaic(imaged_electrons(halves()[0], sensor, exposure_s, samples), sensor)
    error_e = np.where(expected_e > 0, even_e - expected_e, 0.0)
    return _Electrons(per_second_e, error_e, expected_e, exposure_s, sensor)


def _frames(
    checked: Checked,
    lit: _Electrons,
    radiance: SpectralRadiance | None,
    parts: Sequence[tuple[Waveform, SpectralRadiance | None]],
) -> list[RawImage]:
    """Take the order's exposures. For lamps that flicker, `parts` come from `lamp_parts`, `radiance` is all light."""
    seed, frames = checked.order.seed, checked.order.frames
    sensor, exposure_s = lit.sensor, lit.exposure_s
    device = draw_device(sensor, lit.per_second_e.shape[:2], np.random.default_rng([seed, _DEVICE]))
    rng = np.random.default_rng([seed, _FRAME])
    if radiance is None:
        channels_e = lit.per_second_e
        channels_e *= exposure_s  # in place, because nothing needs the old values
        return [expose_channels(channels_e, sensor, exposure_s, device, rng) for _ in range(frames)]
    image = form_image(radiance, sensor, checked.samples)
    imaged = [(lamp, image if part is None else form_image(part, sensor, checked.samples)) for lamp, part in parts]
    starts_s = frame_starts_s(sensor, device.shape, exposure_s, np.random.default_rng([seed, _START]), frames)
    return photograph_flickering(image, imaged, sensor, exposure_s, device, rng, starts_s)


def _exposure(checked: Checked, per_second_e: NDArray[np.float64]) -> tuple[float, SensorConfig]:
    """Return the exposure time [s], given or chosen by a rule, and the camera at the gain that it then has.

    For lamps that flicker, a rule meters their mean light, and the exposure time is shortened to a whole number of the
    lamps' periods.
    """
    if checked.exposure_s is not None:
        return checked.exposure_s, checked.sensor
    exposure_s, sensor = exposed_by_rule(checked.order.exposure, per_second_e, checked.sensor)
    return steady_exposure_s(checked.flicker.values(), exposure_s), sensor


def _rendered(
    checked: Checked, opened: SceneFile, spectra: Mapping[str, Spectrum], step: Step | None, kept: Path
) -> Transport:
    """Render the light of a scene; for one that moves, average the light over the exposure.

    Each time of the exposure has paths of its own, so that their errors are independent.
    """
    order, samples = checked.order, checked.samples
    height, width = _size(order, opened)
    if step:
        step(render_words(np.inf), 0.0)
    bands = _bands(opened, spectra)
    scenes = checked.moving or (opened.scene,)

    def at(number: int, scene: Scene) -> Transport:
        first = number / len(scenes)
        seed = np.random.default_rng([order.seed, _MOMENT, number]).integers(2**31) if number else order.seed
        return render(
            scene,
            (samples * height, samples * width),
            wavelength_nm=bands[0],
            width_nm=bands[1],
            spp=order.spp or _SPP,
            seed=int(seed),
            cache=kept,
            progress=None
            if step is None
            else lambda share, error: step(render_words(error, share), 0.9 * (first + share / len(scenes))),
        )

    transports = (at(number, scene) for number, scene in enumerate(scenes))
    if not checked.moving:
        return next(transports)
    if checked.shares is None:
        return time_average(transports)
    return rolling_average(transports, np.repeat(checked.shares, samples, axis=1))


def _bands(opened: SceneFile, spectra: Mapping[str, Spectrum]) -> tuple[Floats, Floats]:
    """Return the centres and widths of the bands in which a scene is rendered [nm]."""
    lamps = [spectra.get(name, group.spectrum) for name, group in opened.scene.groups.items()]
    return fine_bands(lamps, width_nm=RENDER_BAND_NM)


def _ready(order: Order, opened: SceneFile, spectra: Mapping[str, Spectrum]) -> Ready | None:
    """Return light that is there already, unless an option asks for a render."""
    if order.render or order.spp is not None:
        return None
    asked = None if (order.size, order.height, order.width) == (None, None, None) else _size(order, opened)
    lights = (spectra.get(name, group.spectrum) for name, group in opened.scene.groups.items())
    return find_ready(opened.scene, opened.size, asked, lights)


def _mosaic(channels_e: NDArray[np.float64], sensor: SensorConfig) -> NDArray[np.float64]:
    """Return the expected electrons of the raw image's pixels, shape (h, w), from those behind every filter."""
    return sensor.pixel_sums(behind_filters(channels_e, sensor))


def check(order: Order) -> Checked:
    """Check an order, open its scene or picture, and estimate what the photograph costs; nothing is rendered.

    Raises
    ------
    InputError
        For an order that can't be carried out.
    """
    # The camera.
    sensor = at_gain(preset(order.sensor, order.cfa), gain_text(order.gain, order.iso))
    if order.lens is not None:
        sensor = with_lens(sensor, order.lens)
    sensor = replace(sensor, lens=held_lens(sensor.lens, order.shake))
    if order.row_time is not None:
        sensor = replace(sensor, row_time_us=parse_time(order.row_time, "row_time") * 1e6)
    if order.flicker:
        check_flicker(sensor, held=True)
    check_ending(Path(order.out), sensor.cfa)
    if order.size is not None:
        require_absent("beside --size", height=order.height, width=order.width)
    if order.white_balance == GRAY_WORLD:
        raise InputError(
            f"white_balance: {GRAY_WORLD!r} is found in a picture; allowed: {AS_SHOT} or an illuminant such as D65; "
            "give it to develop"
        )
    exposure_s = parse_exposure(order.exposure, "exposure", 0.0)
    if order.exposure == AUTO_W and "W" not in sensor.channels:
        raise InputError(
            f"exposure: {order.exposure!r} looks at W, which {sensor.channels} lacks; allowed: a mosaic with W; "
            f"give {AUTO}, or a time such as 20ms"
        )
    if order.focus_m is None and order.focal_length_mm is not None:
        raise InputError(
            f"focal_length_mm: {order.focal_length_mm:g} without a distance of focus; allowed: both; give --focus-m"
        )
    # A stored picture.
    if is_radiance_file(order.source):
        scene_options = (
            "trust_scene",
            "define",
            "chart",
            "extend",
            "size",
            "height",
            "width",
            "spp",
            "render",
            "focus_m",
            "moments",
        )
        place = f"for {str(order.source)!r}, a stored picture; allowed: with a scene that is rendered"
        require_absent(place, **{name: getattr(order, name) for name in scene_options})
        if len(order.light) > 1 or "=" in "".join(order.light):
            raise InputError(
                f"light: {' '.join(order.light)!r} for a picture, whose light is in it; allowed: the illuminant that "
                "it was lit by, such as A; give one"
            )
        check_radiance_file(order.source, () if order.level is None else (order.level,))
        pixels, bands, groups = extent_of(order.source)
        light = _light_memory(order, sensor, 0 if comes_by_band(order.source) else _FILE_ARRAYS)
        after_s, band_s = _after_s(sensor)
        cost = PictureCost((1, pixels), bands, groups, 0, after_s, light=light, band_s=band_s)
        return Checked(order, sensor, None, exposure_s, None, 1, cost, flicker_of(order.flicker, ()))
    # A scene, rendered or there already.
    opened, moving, shares = _opened(order, exposure_s, sensor)
    asked_level(opened.scene, order.level)
    spectra = asked_spectra(opened.scene, order.light)
    flicker = flicker_of(order.flicker, opened.scene.groups)
    # A scene that measures sharpness takes several samples along a pixel's side, which stored light doesn't have.
    samples = samples_a_side(str(order.source), [sensor])
    ready = _ready(order, opened, spectra) if samples == 1 and order.focus_m is None and not moving else None
    size = ready.size if ready else _size(order, opened)
    check_frame(sensor, size)
    if moving and exposure_s is not None:
        whole_s = longest_span_s([sensor], size[0], [exposure_s])
        check_moving(sensor, flicker.values(), whole_s, len(moving))
    through = ""
    if order.focus_m is not None:
        lens = order.focus_m, order.focal_length_mm
        scene, through = in_focus(opened.scene, sensor, size, *lens)
        opened = replace(opened, scene=scene)
        moving = tuple(in_focus(each, sensor, size, *lens)[0] for each in moving)
    centres = ready.transport.wavelength_nm if ready else _bands(opened, spectra)[0]
    spp = 0 if ready else order.spp or _SPP
    times = max(len(moving), 1)
    rendered = (samples * size[0], samples * size[1])
    after_s, band_s = _after_s(sensor)
    cost = PictureCost(
        rendered,
        centres.size,
        len(opened.scene.groups),
        spp,
        after_s,
        through=through,
        times=times,
        light=_light_memory(
            order, sensor, _arrays_while_imaged(prod(rendered), centres.size, len(opened.scene.groups))
        ),
        band_s=band_s,
    )
    return Checked(order, sensor, opened, exposure_s, ready, samples, cost, flicker, moving, shares)


def _lies_in_files(light_bytes: float) -> bool:
    """Return whether a render's light is so large that it is read from files while it is imaged."""
    return light_bytes > _MOST_HELD_BYTES


def _arrays_while_imaged(pixels: int, bands: int, groups: int) -> int:
    """Return how many arrays of a render's light, with all bands, are in memory while it is imaged."""
    return 0 if _lies_in_files(4.0 * pixels * bands * groups) else _HALVES


def _light_memory(order: Order, sensor: SensorConfig, arrays: int) -> LightMemory:
    """Return the memory of a light of which `arrays` arrays of all bands per group exist if it is imaged by band.

    Bands are imaged together behind a lens that doesn't spread light, and under lamps that flicker.
    """
    return imaged_by_band(arrays) if spreads(sensor.lens) and not order.flicker else VIEWED


def _after_s(sensor: SensorConfig) -> tuple[float, float]:
    """Return the processor seconds that the steps after the light take: per pixel and band, and per band."""
    by_data = bool(sensor.lens.table)
    return _AFTER_S + TABLE_S * by_data, TABLE_BAND_S * by_data


def _opened(
    order: Order, exposure_s: float | None, sensor: SensorConfig
) -> tuple[SceneFile, tuple[Scene, ...], Floats | None]:
    """Open the scene; if it moves, open it at the middle of the exposure and at each of its times.

    If the rows of a moving scene's exposure roll, the times reach from the first row's start to the last row's end, and
    the third result holds each row's shares of them; otherwise it is None.
    """

    def at(time_s: float | None) -> SceneFile:
        source = str(order.source)
        return open_scene(
            source, order.trust_scene, order.extend, chart=order.chart, define=order.define, time_s=time_s
        )

    if order.moments is None:
        return at(None), (), None
    if exposure_s is None:
        raise InputError(
            f"exposure: {order.exposure!r} beside moments = {order.moments}; allowed: a time, such as 100ms, because a "
            "rule needs the light that the exposure itself blurs; give --exposure"
        )
    if order.frames > 1:
        raise InputError(f"frames: {order.frames} beside moments = {order.moments}; allowed: 1; leave one of them out")
    times_s = moments_s(exposure_s, order.moments)
    shares = None
    still = at(exposure_s / 2)
    if sensor.row_time_us and exposure_s:
        rows = _size(order, still)[0]
        check_frame(sensor, _size(order, still))
        times_s, shares = rolling_moments(sensor, rows, exposure_s, order.moments)
        still = at(float(times_s.mean()))
    return still, tuple(at(float(time_s)).scene for time_s in times_s), shares


def _size(order: Order, opened: SceneFile) -> tuple[int, int]:
    return asked_size(film_size(opened.size, order.size), order.height, order.width)
