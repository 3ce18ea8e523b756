"""Make the first page's animation, light that rises from moonlight to day: `python docs/light_rising.py`.

One render, one pixel and one method; on the left RGBW, on the right Bayer. Some minutes on two cores.
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import rodcone

OUT = Path(__file__).resolve().parent / "images" / "light_rising.webp"
CAMERAS = {"ple_rgbw": "RGBW", "ple_bayer": "Bayer"}
# From the demo's moonlight to its overcast day, most of them where the picture still changes.
LEVELS_CD_M2 = (*np.geomspace(0.036, 4.0, 16), *np.geomspace(8.0, 570.0, 6))
NAMES = {
    0.0: "moonlight",
    0.2: "street light",
    2.0: "corridor",
    12.0: "classroom",
    60.0: "office",
    300.0: "overcast day",
}
HEAD, GAP, LETTERS = 30, 6, 17  # pixels
FRAME_MS, HELD_MS = 350, 1500  # the first and the last frame are held


def pictures() -> dict[float, list[Image.Image]]:
    """Pictures of the cameras, by the scene's mean luminance."""
    study = rodcone.Study(
        scenes=(rodcone.SceneChoice("still_life"),),
        levels=tuple(f"{level:.4g}cd/m2" for level in LEVELS_CD_M2),
        sensors=("low_noise",),
        processors=tuple(CAMERAS),
        seeds=(0,),
        render=rodcone.RenderLimits(size=320, spp=512, band_nm=20.0),
    )
    taken: dict[float, dict[str, Image.Image]] = {}
    with tempfile.TemporaryDirectory() as folder:
        rodcone.sweep(study, folder)
        for row in rodcone.read_rows(folder):
            with Image.open(Path(folder) / "pictures" / row.picture) as picture:
                taken.setdefault(row.luminance_cd_m2, {})[row.processor] = picture.convert("RGB")
    return {level: [of_level[camera] for camera in CAMERAS] for level, of_level in sorted(taken.items())}


def frame(level_cd_m2: float, cameras: list[Image.Image]) -> Image.Image:
    """Cameras beside each other, with the light's name above."""
    font = ImageFont.load_default(LETTERS)
    width, height = cameras[0].size
    sheet = Image.new("RGB", (2 * width + GAP, height + HEAD), "white")
    draw = ImageDraw.Draw(sheet)
    name = next(name for least, name in reversed(NAMES.items()) if level_cd_m2 >= least)
    shown = f"{level_cd_m2:.2g}" if level_cd_m2 < 10 else f"{level_cd_m2:.0f}"
    draw.text((sheet.width // 2, HEAD // 2), f"{name}, {shown} cd/m2", "black", font, "mm")
    for x, (label, picture) in enumerate(zip(CAMERAS.values(), cameras, strict=True)):
        sheet.paste(picture, (x * (width + GAP), HEAD))
        draw.text((8 if x == 0 else sheet.width - 8, HEAD // 2), label, "black", font, "lm" if x == 0 else "rm")
    return sheet


if __name__ == "__main__":
    frames = [frame(level, cameras) for level, cameras in pictures().items()]
    times_ms = [HELD_MS, *[FRAME_MS] * (len(frames) - 2), HELD_MS]
    frames[0].save(OUT, save_all=True, append_images=frames[1:], duration=times_ms, loop=0, quality=72, method=6)
