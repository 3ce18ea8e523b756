"""The commands `rodcone demo` and `rodcone reference`: the demo, and the light that it photographs."""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from render.engine import render
from render.limits import MOST_SPP
from render.reference import (
    find_reference,
    halves_agree,
    read_reference,
    reference_folders,
    reference_path,
    save_reference,
)
from render.transport import Transport
from rodcone.errors import require_range
from rodcone.progress import duration, progress, render_words
from sensor.presets import preset
from studies.budget.starting_points import plan_from_settings
from studies.commands.console import INTERRUPTED, Seconds, Time, say, told
from studies.commands.sweep import make_all, require_enough
from studies.photograph.clock import Clock
from studies.study.cost import PictureCost, cores
from studies.study.lit_scene import film_of, level_luminance, lux_per_cd_m2, open_choice
from studies.study.render_noise import MARGIN, render_share
from studies.study.study import SceneChoice, Study
from studies.study.study_file import read_study
from studies.sweep.cost import estimated
from studies.sweep.provenance import versions
from studies.sweep.workers import worker_processes

STUDY = Path(__file__).parent.parent / "configs" / "demo.toml"


@dataclass(frozen=True, kw_only=True)
class DemoOrder:
    """What a demo photographs, and how; what is left out is as the study demo has it.

    Attributes
    ----------
    scene : str, optional
        Scene by name, such as still_life (the default), still_life_outdoor, night_street or cornell_box. Or a file: a
        Mitsuba scene (.xml), spectral radiance (.exr, or .mat of ISETCam), a cube described by a .toml beside it
        (.npy, ENVI's .hdr, .mat), or a photograph (.jpg, .png).
    size : int, optional
        Longer side of the picture in pixels, 256 by default; a picture file has its own.
    sensor : tuple of str
        Sensor preset; may be given several times (low_noise by default).
    level : tuple of str
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); may be given
        several times (seven levels from moonlight to daylight by default).
    processor : tuple of str
        Processor such as bayer_menon; may be given several times. By default interleaved, the paper's method; bayer,
        bilinear, with Gray World its reference; and ple_rgbw and ple_bayer, one method on both mosaics, with which the
        page leads. Each is balanced as shot, where the scene's light is known, and by Gray World.
    longest_exposure : float, optional
        Longest exposure time, such as 66ms, the default, or 1/15.
    spp : int, optional
        Samples a pixel of the render, at most; 288 by default.
    max_seconds : float, optional
        Time for the render, at most; 65 by default.
    seed : int
        Seed of the render; chips and exposures take it and the next two.
    light : str, optional
        Light of the scene by name, such as A; for a file the light that is shown as neutral (D65 by default).
    define : tuple of str
        NAME=VALUE of a $parameter of the scene file; -D is short for it; may be given several times.
    denoise : bool
        Photograph denoised light; the report's Monte Carlo share is then its measured error. Needs rodcone[denoise].
    render : bool
        Render the scene here in full, even if the project ships its light; --spp, --max-seconds and --denoise do so
        too.
    """

    scene: str | None = None
    size: int | None = None
    sensor: tuple[str, ...] = ()
    level: tuple[str, ...] = ()
    processor: tuple[str, ...] = ()
    longest_exposure: Time | None = None
    spp: int | None = None
    max_seconds: Seconds | None = None
    seed: int = 0
    light: str | None = None
    define: tuple[str, ...] = ()
    denoise: bool = False
    render: bool = False

    def of(self, study: Study) -> Study:
        """Study demo with what is asked for in place of its own."""
        limits: dict[str, Any] = {"size": self.size, "spp": self.spp, "max_seconds": self.max_seconds}
        render = replace(
            study.render,
            seed=self.seed,
            denoise=self.denoise,
            reference=not (self.render or self.spp or self.max_seconds or self.denoise),
            **{name: value for name, value in limits.items() if value is not None},
        )
        longest_s = study.longest_exposure_s if self.longest_exposure is None else self.longest_exposure
        return replace(
            study,
            scenes=(SceneChoice(self.scene or study.scenes[0].source, self.light, define=self.define),),
            sensors=self.sensor or study.sensors,
            levels=self.level or study.levels,
            processors=self.processor or study.processors,
            longest_exposure_s=longest_s,
            seeds=tuple(self.seed + number for number in study.seeds),
            render=render,
        )


DEFAULT = DemoOrder()


def demo(
    order: Annotated[DemoOrder, Parameter(name="*")] = DEFAULT,
    *,
    out: Path = Path("out/demo"),
    force: bool = False,
    dry_run: bool = False,
) -> None:
    """Photograph one scene from moonlight to daylight with RGBW and Bayer and write a report; prints its path.

    It is a sweep of the study demo (`rodcone new study demo`) as it is stated, without a plan.

    Parameters
    ----------
    out
        Folder for report.html and results.json, with the sweep's results database and pictures.
    force
        Run even where more memory is needed than is free.
    dry_run
        Print cells, renders, and an estimate of time and memory; compute nothing.
    """
    clock = Clock()
    study = order.of(read_study(STUDY))
    sizes = estimated(study, out, cores())
    if not told(sizes, dry_run=dry_run, json=False):
        return
    require_enough(study, sizes, force=force)
    _, report = make_all(study, out, lambda step: plan_from_settings(study), worker_processes(cores()), clock)
    print(report)


SEED = 34  # none of a demo's: its render is independent of the reference
STEP_SPP = 512  # samples from one look, and one file, to the next


def reference(
    scene: str = "still_life",
    /,
    *,
    size: int | None = None,
    until: float = 0.03,
    max_seconds: Seconds | None = None,
    define: tuple[str, ...] = (),
    out: Path | None = None,
    dry_run: bool = False,
) -> int:
    """Render light whose noise is below the sensor's, for `render.reference` of a study and the demo; prints its path.

    It may take hours. The file so far is there after every 512 samples. Whatever ends the render, the same command goes
    on from that file, and without --out from the file that comes with rodcone too.

    Parameters
    ----------
    scene
        Scene by name, or a Mitsuba scene (.xml). Light, exposure and bands are those of rodcone demo.
    size
        Longer side of the picture in pixels, 256 by default.
    until
        Stop once the render's noise variance is this share of the sensor's own, in 95 % of the pixels, at every level
        of the demo.
    max_seconds
        Longest time for the render, earlier calls included.
    define
        NAME=VALUE of a $parameter of the scene file; -D is short for it; may be given several times.
    out
        Folder of references; by default the variable RODCONE_REFERENCES names it, or it lies in your home.
    dry_run
        Print what the first 512 samples per pixel cost, and how far the light that is there already has come; render
        nothing.
    """
    # What to render, as the demo would
    require_range("until", until, 1e-4, 1e3, "give a share of the sensor's noise variance: 0.03")
    study = read_study(STUDY)
    choice = SceneChoice(scene, define=define)
    study = replace(study, scenes=(choice,), render=replace(study.render, size=size or study.render.size))
    opened = open_choice(choice, study)
    model = plan_from_settings(study).renders[choice]
    film = film_of(opened, model)
    folder = out or next(reference_folders())
    assert opened.scene is not None
    path = reference_path(folder, opened.scene, film)
    found = read_reference(path, opened.scene) if out else find_reference(opened.scene, film)
    transport = found.transport if found else None  # what is there already is gone on from
    if not transport:
        cost = PictureCost(
            size=film.size,
            bands=film.wavelength_nm.size,
            groups=len(opened.scene.groups),
            spp=STEP_SPP,
            after_s=0.0,
            max_seconds=max_seconds,
        )
        if not told(cost, dry_run=dry_run, json=False):
            print(f"After these it tells how long a share of {until:g} of the sensor's variance takes.")
            return 0
    elif dry_run:
        print(_so_far(transport, _most(_shares(transport, study)), until))
        return 0
    # Go on until the noise is low enough, and keep the file after each step
    with progress(sys.stderr) as step:
        while True:
            most_samples = STEP_SPP
            if transport:
                shares = _shares(transport, study)
                now = _most(shares)
                save_reference(
                    path,
                    transport,
                    _certificate(transport, shares, now, f"rodcone reference {scene} --size {max(film.size)}"),
                )
                say(_so_far(transport, now, until))
                if now <= until or transport.stopped_by != "samples":
                    break
                most_samples = int(min(MOST_SPP, transport.spp + STEP_SPP, transport.spp * MARGIN * now / until + 1))
            samples = transport.spp if transport else 0.0
            transport = render(
                opened.scene,
                opened.size,
                wavelength_nm=film.wavelength_nm,
                width_nm=film.width_nm,
                max_spp=most_samples,
                max_seconds=max_seconds,
                seed=SEED,
                resume=transport,
                progress=lambda share, error: step(render_words(error), share),
            )
            if transport.spp == samples:  # the time is up
                break
    print(path)
    return INTERRUPTED if transport.stopped_by == "interrupt" else 0


def _so_far(transport: Transport, now: float, until: float) -> str:
    """One line: samples, the share of the sensor's variance that they leave, and how long the rest takes."""
    left_s = transport.seconds * (MARGIN * now / until - 1)
    words = f"; about {duration(left_s)} more to {until:g}" if now > until else ""
    return f"{transport.spp:.0f} samples a pixel: {now:.3g} of the sensor's variance in 95 % of pixels{words}"


def _most(shares: Mapping[str, Mapping[str, float]]) -> float:
    """Return the largest share over sensors and levels."""
    return max(share for of_sensor in shares.values() for share in of_sensor.values())


def _shares(transport: Transport, study: Study) -> dict[str, dict[str, float]]:
    """Noise variance over the sensor's own in 95 % of the pixels, by sensor and level."""
    lux = lux_per_cd_m2(transport, study.levels)
    shares: dict[str, dict[str, float]] = {}
    for name in study.sensors:
        sensor = preset(name)
        sensor = replace(sensor, lens=study.lens.on(sensor.lens))
        shares[name] = {
            level: render_share(transport, sensor, level_luminance(level, lux), study.longest_exposure_s)
            for level in study.levels
        }
    return shares


def _certificate(transport: Transport, shares: dict[str, Any], most: float, command: str) -> dict[str, Any]:
    return {
        "samples": transport.spp,
        "share": most,
        "shares": shares,
        "relative_mc_error": transport.relative_mc_error,
        "halves": asdict(halves_agree(transport)),
        "command": command,
        "versions": versions(),
    }
