"""Make the galleries, docs/gallery: `python docs/gallery.py [SCENE ...]` writes pages, drawings and pictures.

A picture is made by the very commands that stand beneath it, in a folder that is thrown away. Scenes that are named are
photographed anew; without a name all are. Pages and drawings are always written.
"""

import inspect
import shlex
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path

import numpy as np
from PIL import Image

import rodcone
from isp.colour.encoding import encode
from isp.processors.catalogue import PROCESSORS
from scenes import catalogue
from sensor import cfa, presets
from studies.commands.list import texts

FOLDER = Path(__file__).resolve().parent / "gallery"
QUALITY = 80  # of the pictures, as WebP counts it
# What each scene is photographed with: its light, and the exposure where the rule's would be longer than its 66 ms.
SHOWN = {
    "color_checker": "--level 500lux",
    "contrast_patches": "--level 200cd/m2",
    "cornell_box": "--level 300lux",
    "dead_leaves": "--level 200cd/m2",
    "diorama": "--level 200cd/m2",
    "flat_field": "--level 25cd/m2",
    "furnace": "--level 25cd/m2",
    "generated": "--level 200cd/m2",
    "lit_and_shadowed": "",
    "metamers": "--level 500lux",
    "night_street": "--exposure 50ms",
    "oecf": "--level 200cd/m2",
    "siemens_star": "--level 200cd/m2",
    "slanted_edge": "--level 200cd/m2",
    "still_life": "--level 500lux",
    "still_life_outdoor": "",
    "walker": "--exposure 50ms",
}
CROP_PX = 112
CROP = slice(212, 212 + CROP_PX), slice(190, 190 + CROP_PX)  # star, chart and gold ball of still_life at 512 pixels
UNSHOWN = {
    **dict.fromkeys(
        ("bayer_bm3d", "bayer_park", "bayer_residual_bm3d", "rgbw_park"),
        "none: its library has a licence for non-commercial use alone",
    ),
    **dict.fromkeys(("ple", "any_mosaic"), "as its mosaic's"),
    "cmyw_yamagami": "none: its raw images hold no R, G or B, so that it serves studies alone",
}
MADE = """Made by `python docs/gallery.py`: each picture by the command beneath
it and `rodcone develop NAME.dng --width 320`."""


def commands(scene: str) -> list[str]:
    """Commands that photograph a scene of the catalogue."""
    words = f"{SHOWN[scene]} --size 400 --spp 64".strip()
    return [f"rodcone capture {scene} {words} -o {scene}.dng", f"rodcone develop {scene}.dng --width 320"]


def scenes_page() -> str:
    """Page of the scenes."""
    names = catalogue.scene_names()
    sheet = "\n".join(f"[![{name}]({name}.webp)](#{name})" for name in names)
    return f"""# Scenes

What can be photographed by name, in `rodcone capture NAME`, `render`, `explore` and a study's `scenes`. {MADE}
The camera is `low_noise` with its RGBW mosaic. A scene of your own: [how to](../how_to/own_scene.md).

{sheet}

{"".join(map(scene_section, names))}"""


def scene_section(name: str) -> str:
    """Section of one scene: picture, facts, commands."""
    scene = catalogue.load(name)
    module = import_module(f"scenes.{name}")
    options = inspect.signature(getattr(module, name)).parameters.values()
    facts = {
        "lights": ", ".join(f"`{group}`" for group in scene.groups),
        "levels": "cd/m² and lux" if scene.reference_plane else "cd/m²",
        "options in Python": ", ".join(f"`{option}`" for option in options) or "none",
    }
    sentence = "; ".join(f"{fact}: {value}" for fact, value in facts.items())
    return f"""## {name}

{texts("scenes")[name].partition(" Lights: ")[0]}

![{name}]({name}.webp)

{sentence[0].upper()}{sentence[1:]}.

```sh
{commands(name)[0]}
```

"""


def lights_page() -> str:
    """Page of the lights."""
    rows = "\n".join(f"| `{name}` | {text} |" for name, text in texts("lights").items())
    return f"""# Lights

Illuminants by name: `--light A`, `--light sky=D65` and `--white-balance D65` on the command line, `spectra = ["D65",
"A"]` in a study, `rodcone.illuminant("D65")` in Python. A lamp of your own is a CSV file whose name stands in the same
places: [lamps and reflectances that were measured](../how_to/own_scene.md#lamps-and-reflectances-that-were-measured).

![Spectra of the illuminants](lights.svg)

```sh
rodcone list lights -o lights.svg
```

Relative power over wavelength in bands of 5 nm, the greatest 1. Each is scaled to the level that is asked for, in cd/m²
or lux, when it lights a scene: a render serves all of them.

| name | what |
|---|---|
{rows}
"""


def sensors_page() -> str:
    """Page of the sensors and mosaics."""
    rows = []
    for name in presets.preset_names():
        camera = presets.preset(name)
        pixel = camera.pixel
        rows.append(
            f"| `{name}` | {pixel.pitch_um:g} | {pixel.full_well_e:,.0f} | {pixel.read_noise_e:.3g} | "
            f"{pixel.dsnu_e:.3g} | {pixel.prnu:.1%} | f/{camera.lens.f_number:g} |".replace(
                ",", "\N{NARROW NO-BREAK SPACE}"
            )
        )
    mosaics = "\n".join(
        f"| `{name}` | {'<br>'.join(f'`{row}`' for row in cfa.tile_of(name))} |" for name in cfa.mosaics()
    )
    table = "\n".join(rows)
    return f"""# Sensors

Presets by name: `--sensor low_noise`, `sensors = ["low_noise"]` in a study, `rodcone.low_noise()` in Python. `rodcone
new preset low_noise -o mine.toml` copies one to change, [how to](../how_to/own_sensor.md). A camera whose
response was measured comes by name, `Nikon D5100`, and 51 more from a collection that you copy once: [a camera that
exists](../how_to/real_camera.md).

| preset | pitch, µm | full well, e⁻ | read noise, e⁻ | DSNU, e⁻ | PRNU | lens |
|---|---|---|---|---|---|---|
{table}

Of a pixel that is [read more than once](../how_to/hdr.md): the deepest well and the least noise, over that reading's
share of the light and of the time. `rodcone list sensors` says what each stands for, and its source.

## Responses

Electrons a photon over wavelength, the same in all presets, and the measured cameras at hand, relative to their
greatest response; a * where each channel was divided by its own maximum.

![Responses of R, G, B and W](sensors.svg)

```sh
rodcone list sensors -o sensors.svg
```

## In how little light

```sh
rodcone snr low_noise table1_output table1_pixel --at 10 --exposure 33ms -o snr.svg
```

![SNR over light of three presets](snr.svg)

## Mosaics

Any preset goes with any mosaic: `--cfa bayer`. The rows of one tile:

| mosaic | tile |
|---|---|
{mosaics}
"""


def processors_page() -> str:
    """Page of the processors, each with its picture of one crop."""
    rows = "\n".join(
        f"| {UNSHOWN.get(name, f'![{name}](processor_{name}.webp)')} | `{name}` | {text} |"
        for name, text in texts("processors").items()
    )
    return f"""# Processors

Ways to develop a raw frame, by name: `rodcone develop shot.dng --isp ple_rgbw` on the command line,
`processors = ["ple_rgbw", "ple_bayer"]` in a study, `rodcone.develop(raw, processor="ple_rgbw")` in Python. Where none
is named, `develop` uses `ple`, whatever the mosaic. How to write one:
[a processor of your own](../how_to/own_processor.md).
Which is best in which light: [all cameras ranked](../opponents.md).

Each picture shows the same {CROP_PX} × {CROP_PX} pixels of `still_life` at 5 cd/m², photographed by `low_noise` behind
the mosaic that the processor takes, with one exposure of 66 ms. Made by `python docs/gallery.py`.

| picture | name | mosaic, method and source |
|---|---|---|
| ![the truth](processor_truth.webp) | | the noise-free picture, which all others are compared with |
{rows}
"""


PAGES = {
    "scenes.md": scenes_page,
    "lights.md": lights_page,
    "sensors.md": sensors_page,
    "processors.md": processors_page,
}
DRAWINGS = (
    "rodcone list lights -o lights.svg",
    "rodcone list sensors -o sensors.svg",
    "rodcone snr low_noise table1_output table1_pixel --at 10 --exposure 33ms -o snr.svg",
)


def run(command: str, folder: Path) -> None:
    """Run a command of the page's in a folder."""
    call = [sys.executable, "-c", "from studies.commands.cli import main; main()", *shlex.split(command)[1:]]
    subprocess.run(call, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def photograph(scene: str, folder: Path) -> None:
    """Write ``SCENE.webp`` into a folder."""
    with tempfile.TemporaryDirectory() as scratch:
        for command in commands(scene):
            run(command, Path(scratch))
        with Image.open(Path(scratch) / f"{scene}.png") as picture:
            picture.convert("RGB").save(folder / f"{scene}.webp", quality=QUALITY, method=6)


def develop_all(folder: Path) -> None:
    """Write ``processor_NAME.webp`` of each processor, and of the truth, into a folder."""
    radiance = rodcone.load_transport("still_life").relight(luminance_cd_m2=5.0)
    pictures = {"truth": encode(rodcone.reference_picture(radiance).linear, "srgb")}
    for name, processor in PROCESSORS.items():
        if name not in UNSHOWN:
            camera = presets.vary(presets.preset("low_noise"), processor.mosaic)
            raw = rodcone.capture(radiance, camera, "66ms", rng=np.random.default_rng(0))
            developed = rodcone.develop(raw, rodcone.calibrate(camera, rodcone.illuminant("D65")), processor=name)
            pictures[name] = developed.encode()
    for name, picture in pictures.items():
        crop = Image.fromarray(np.rint(255 * np.clip(picture[CROP], 0, 1)).astype(np.uint8))
        crop.save(folder / f"processor_{name}.webp", quality=QUALITY, method=6)


if __name__ == "__main__":
    develop_all(FOLDER)
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), "utf-8")
    for command in DRAWINGS:
        run(command, FOLDER)
    for scene in sys.argv[1:] or catalogue.scene_names():
        photograph(scene, FOLDER)
