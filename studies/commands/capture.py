"""The command `rodcone capture`."""

import sys
from pathlib import Path

from rodcone.progress import progress
from sensor.exposure import AUTO_INFORMATION
from studies.commands.console import Flag, Out, Several, print_result, say
from studies.photograph.shot import Order, take
from studies.study.study import AS_SHOT


def capture(
    source: str,
    /,
    *,
    out: Out = Path("shot.dng"),
    sensor: str = "low_noise",
    cfa: str | None = None,
    exposure: str = AUTO_INFORMATION,
    level: str | None = None,
    light: Several = None,
    chart: str | None = None,
    white_balance: str = AS_SHOT,
    size: int | None = None,
    height: int | None = None,
    width: int | None = None,
    spp: int = 64,
    frames: int = 1,
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
        Scene by name such as color_checker, a Mitsuba scene (.xml), a file of spectral radiance (.exr, or .mat of
        ISETCam), a cube described by a .toml beside it (.npy, ENVI's .hdr, .mat), or a photograph (.jpg, .png).
    out
        Raw file to write: .dng for Bayer and 2x2 RGBW (with a re-mosaiced Bayer one beside it, NAME_bayer.dng), .tif
        with a .json beside it for any mosaic.
    sensor
        Sensor preset by name, or a preset file.
    cfa
        Mosaic, such as rgbw or bayer; the preset's own by default.
    exposure
        Time such as 20ms or 1/50, 0s for a dark frame, or a rule: auto for the brightest green, auto:W for the
        brightest W, auto:information, the default, for the one of the two whose samples hold more.
    level
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); the scene's own
        by default.
    light
        ILLUMINANT, such as A, in place of all of the scene's lights, or GROUP=ILLUMINANT in place of one group, each at
        the same luminance; may be given several times. An illuminant is a name or a CSV file, such as sky=led.csv. For
        a file of radiance the light that it was lit by.
    chart
        CSV file with the reflectances of color_checker's patches, 1 to 24: wavelength_nm and a column each.
    white_balance
        Illuminant, such as D65, under which the camera shows grey as grey; as-shot for the scene's first light, and
        that of --light, or D65, for a file of radiance.
    size
        Longer side of the rendered picture in pixels; 256 by default, a .xml scene's film has its own, a file of
        radiance keeps its own.
    height
        Pixels; with one of height and width the other keeps the proportions.
    width
        Pixels; as height.
    spp
        Samples a pixel of the render.
    frames
        Exposures of a burst, each in a file of its own, NAME_1, NAME_2 and so on; develop merges them.
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
        exposure=exposure,
        level=level,
        lights=tuple(light or ()),
        chart=chart,
        white_balance=white_balance,
        size=size,
        height=height,
        width=width,
        spp=spp,
        frames=frames,
        seed=seed,
        trust=trust_scene,
        extend=extend,
        force=force,
    )
    with progress(sys.stderr) as step:
        taken = take(order, step)
    say(*taken.notes)
    print_result("\n".join(map(str, taken.paths)), taken.facts, json=json)
