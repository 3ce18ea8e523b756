"""The command `rodcone capture`."""

import sys
from pathlib import Path

from rodcone.progress import progress
from sensor.exposure import AUTO
from studies.commands.console import Flag, Out, print_result, say
from studies.photograph.shot import Order, take


def capture(
    source: str,
    /,
    *,
    out: Out = Path("shot.dng"),
    sensor: str = "low_noise",
    cfa: str | None = None,
    exposure_s: float | None = None,
    exposure: str = AUTO,
    level: str | None = None,
    white_balance: str | None = None,
    size: int | None = None,
    spp: int = 64,
    seed: int = 0,
    trust_scene: Flag = False,
    extend: str | None = None,
    force: Flag = False,
    json: Flag = False,
) -> None:
    """Photograph a scene and write raw files that raw converters open; prints their paths.

    Parameters
    ----------
    source
        Scene by name such as color_checker, a Mitsuba scene (.xml), or a file of spectral radiance: .exr, or .mat of
        ISETCam.
    out
        Raw file to write: .dng for Bayer and 2x2 RGBW (with a re-mosaiced Bayer one beside it, NAME_bayer.dng), .tif
        with a .json beside it for any mosaic.
    sensor
        Sensor preset by name, or a preset file.
    cfa
        Mosaic, such as rgbw or bayer; the preset's own by default.
    exposure_s
        Exposure time in seconds; chosen by the rule of exposure by default.
    exposure
        Rule: auto for the brightest green, auto:W for the brightest W, auto:information for the one of the two whose
        samples hold more.
    level
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); the scene's own
        by default.
    white_balance
        Illuminant, such as D65, that the camera's as-shot white balance and colour matrix are set to; the scene's
        first light by default, D65 for a file of radiance.
    size
        Longer side of the rendered picture in pixels; 256 by default, a .xml scene's film has its own, a file of
        radiance keeps its own.
    spp
        Samples a pixel of the render.
    seed
        Seed of the render, the chip and the exposure.
    trust_scene
        Let a .xml scene load plug-ins of its own, which are native code, and files from anywhere.
    extend
        hold: surfaces keep their end values outside their tables' wavelengths; by default bands there are refused.
    force
        Run even where more memory is needed than is free.
    json
        Print one JSON object with the paths and facts of the exposure instead of the paths.
    """
    order = Order(
        source=source,
        out=out,
        sensor=sensor,
        cfa=cfa,
        exposure_s=exposure_s,
        exposure=exposure,
        level=level,
        white_balance=white_balance,
        size=size,
        spp=spp,
        seed=seed,
        trust=trust_scene,
        extend=extend,
        force=force,
    )
    with progress(sys.stderr) as step:
        taken = take(order, step)
    say(*taken.notes)
    print_result("\n".join(map(str, taken.paths)), taken.facts, json=json)
