"""The command `rodcone reference`: the light that studies photograph, with less noise than the sensor's."""

import sys
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

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
from studies.commands.console import INTERRUPTED, Seconds, announce_cost, say
from studies.study.cost import PictureCost
from studies.study.lit_scene import film_of, level_luminance, lux_per_cd_m2, open_choice
from studies.study.render_noise import MARGIN, render_share
from studies.study.study import SceneChoice, Study
from studies.study.study_file import DEMO_STUDY, read_study
from studies.sweep.provenance import versions

SEED = 34  # a seed that no demo has, so that its render is independent of the reference
STEP_SPP = 512  # samples per pixel after which the noise is measured and the file is written


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
    """Render light with less noise than the sensor's, for `render.reference` of a study and the demo; print its path.

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
    # What to render: the same as the demo.
    require_range("until", until, 1e-4, 1e3, "give a share of the sensor's noise variance: 0.03")
    study = read_study(DEMO_STUDY)
    choice = SceneChoice(scene, define=define)
    study = replace(study, scenes=(choice,), render=replace(study.render, size=size or study.render.size))
    opened = open_choice(choice, study)
    model = plan_from_settings(study).renders[choice]
    film = film_of(opened, model)
    folder = out or next(reference_folders())
    assert opened.scene is not None
    path = reference_path(folder, opened.scene, film)
    found = read_reference(path, opened.scene) if out else find_reference(opened.scene, film)
    transport = found.transport if found else None  # continue an earlier render
    if not transport:
        cost = PictureCost(
            size=film.size,
            bands=film.wavelength_nm.size,
            groups=len(opened.scene.groups),
            spp=STEP_SPP,
            after_s=0.0,
            max_seconds=max_seconds,
        )
        if not announce_cost(cost, dry_run=dry_run, json=False):
            print(f"After these it tells how long a share of {until:g} of the sensor's variance takes.")
            return 0
    elif dry_run:
        print(_so_far(transport, _most(_shares(transport, study)), until))
        return 0
    # Go on until the noise is low enough, and write the file after each step.
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
                progress=lambda share, error: step(render_words(error, share), share),
            )
            if transport.spp == samples:  # no sample was added, because the time is up
                break
    print(path)
    return INTERRUPTED if transport.stopped_by == "interrupt" else 0


def _so_far(transport: Transport, now: float, until: float) -> str:
    """Write a progress line: samples, their noise as a share of the sensor's variance, and the time for the rest."""
    left_s = transport.seconds * (MARGIN * now / until - 1)
    words = f"; about {duration(left_s)} more to {until:g}" if now > until else ""
    return f"{transport.spp:.0f} samples a pixel: {now:.3g} of the sensor's variance in 95 % of pixels{words}"


def _most(shares: Mapping[str, Mapping[str, float]]) -> float:
    """Return the largest of `_shares`, over sensors and levels."""
    return max(share for of_sensor in shares.values() for share in of_sensor.values())


def _shares(transport: Transport, study: Study) -> dict[str, dict[str, float]]:
    """Return by sensor and level the render's noise variance over the sensor's, below which 95 % of the pixels lie."""
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
