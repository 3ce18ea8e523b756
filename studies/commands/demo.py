"""The command `rodcone demo`."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from studies.budget.ledger import as_stated
from studies.commands.console import Seconds, Time
from studies.commands.sweep import check_memory, make_all
from studies.photograph.clock import Clock
from studies.study.study import SceneChoice
from studies.study.study_file import read_study
from studies.sweep.workers import cores, run_in_processes

STUDY = Path(__file__).parent.parent / "configs" / "demo.toml"


def demo(
    *,
    out: Path = Path("out/demo"),
    scene: str | None = None,
    size: int | None = None,
    sensor: list[str] | None = None,
    level: list[str] | None = None,
    processor: list[str] | None = None,
    longest_exposure: Time | None = None,
    spp: int | None = None,
    max_seconds: Seconds | None = None,
    seed: int = 0,
    light: str | None = None,
    denoise: bool = False,
    render: bool = False,
    force: bool = False,
) -> None:
    """Photograph one scene from moonlight to daylight with RGBW and Bayer and write a report; prints its path.

    It is a sweep of the study demo (`rodcone new study demo`) as it is stated, without a plan.

    Parameters
    ----------
    out
        Folder for report.html and results.json, with the sweep's results database and pictures.
    scene
        Scene by name, such as still_life (the default), still_life_outdoor, night_street or cornell_box. Or a file: a
        Mitsuba scene (.xml), spectral radiance (.exr, or .mat of ISETCam), a cube described by a .toml beside it
        (.npy, ENVI's .hdr, .mat), or a photograph (.jpg, .png).
    size
        Longer side of the picture in pixels, 256 by default; a picture file has its own.
    sensor
        Sensor preset; may be given several times (low_noise by default).
    level
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); may be given
        several times (seven levels from moonlight to daylight by default).
    processor
        Processor such as bayer_menon; may be given several times. By default interleaved, the paper's method; bayer,
        bilinear, with Gray World its reference; and ple_rgbw and ple_bayer, one method on both mosaics, with which the
        page leads. Each is balanced as shot, where the scene's light is known, and by Gray World.
    longest_exposure
        Longest exposure time, such as 66ms, the default, or 1/15.
    spp
        Samples a pixel of the render, at most; 288 by default.
    max_seconds
        Time for the render, at most; 65 by default.
    seed
        Seed of the render, and the first of three of the chips and the exposures.
    light
        Light of the scene by name, such as A; for a file the light that is shown as neutral (D65 by default).
    denoise
        Photograph denoised light; the report's Monte Carlo share is then its measured error. Needs rodcone[denoise].
    render
        Render here in full what is photographed, also where the project ships the light of the scene, size and bands
        and a short render only tests it; --spp, --max-seconds and --denoise do too.
    force
        Run even where more memory is needed than is free.
    """
    clock, study = Clock(), read_study(STUDY)
    changes: dict[str, Any] = {"sensors": sensor, "levels": level, "processors": processor}
    changes["longest_exposure_s"] = longest_exposure
    limits: dict[str, Any] = {"size": size, "spp": spp, "max_seconds": max_seconds, "seed": seed, "denoise": denoise}
    limits["reference"] = not (render or spp or max_seconds or denoise)
    study = replace(
        study,
        scenes=(SceneChoice(scene or study.scenes[0].source, light),),
        seeds=tuple(seed + number for number in study.seeds),
        render=replace(study.render, **{name: value for name, value in limits.items() if value is not None}),
        **{name: values for name, values in changes.items() if values is not None},
    )
    check_memory(study, out, reference=False, workers=cores(), force=force)
    runner = partial(run_in_processes, workers=cores())
    _, report = make_all(study, out, lambda step: as_stated(study), runner, clock=clock)
    print(report)
