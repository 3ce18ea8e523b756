"""The command `rodcone demo`: one scene from moonlight to daylight, with RGBW and Bayer."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from studies.budget.starting_points import plan_from_settings
from studies.commands.console import Seconds, Time, announce_cost
from studies.commands.sweep import make_all, require_enough
from studies.photograph.clock import Clock
from studies.study.cost import cores
from studies.study.study import SceneChoice, Study
from studies.study.study_file import DEMO_STUDY, read_study
from studies.sweep.cost import estimated
from studies.sweep.workers import worker_processes


@dataclass(frozen=True, kw_only=True)
class DemoOrder:
    """Settings of a demo; those that are left out are as in the study demo.

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
        Samples per pixel of the render, at most; 288 by default.
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
        """Return the study demo with the options that were given in place of its own values."""
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
    """Photograph one scene from moonlight to daylight with RGBW and Bayer, write a report and print its path.

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
    study = order.of(read_study(DEMO_STUDY))
    sizes = estimated(study, out, cores())
    if not announce_cost(sizes, dry_run=dry_run, json=False):
        return
    require_enough(study, sizes, force=force)
    _, report = make_all(study, out, lambda step: plan_from_settings(study), worker_processes(cores()), clock)
    print(report)
