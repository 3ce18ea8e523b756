"""What one matrix makes of photographs without noise, by surfaces' spectra and by sRGB's basis, and their time.

    python benchmarks/photograph_spectra.py

Each line states PSNR [dB], on sRGB encoded and clipped, of a picture's exact R, G and B of `low_noise` under D65 by the
camera's own matrix, which is fitted on the ColorChecker, and by the picture's own least-squares matrix, which no camera
knows. By three basis curves a picture is a mixture of three numbers, so that one matrix is exact. Pictures of packages
that are installed, 128 pixels on the longer side; the last line is processor time.
"""

import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

from isp.colour.colour_fit import fit_colours, training
from render.illuminants import illuminant
from render.radiance_files.surface_spectra import srgb_basis, surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM as NM
from render.spectrum import band_widths
from rodcone.colour_spaces import decode_srgb, encode_srgb
from rodcone.csv_file import csv_text
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances, held
from sensor.presets import low_noise

PHOTOGRAPHS = {
    "skimage/data": (
        "astronaut.png",
        "chelsea.png",
        "coffee.png",
        "hubble_deep_field.jpg",
        "ihc.png",
        "motorcycle_left.png",
        "retina.jpg",
    ),
    "matplotlib/mpl-data/sample_data": ("grace_hopper.jpg",),
}
SIDE = 128
COLOURS = ("R", "G", "B")


def main() -> None:
    rows = []
    for folder, names in PHOTOGRAPHS.items():
        package = find_spec(folder.split("/")[0])
        assert package
        assert package.origin
        for name in names:
            linear = _linear(Path(package.origin).parents[1] / folder / name)
            surfaces, basis = surface_reflectances(linear)[0], linear @ srgb_basis(NM)
            cells = [*exact_psnr(surfaces), *exact_psnr(basis)]
            rows.append([name, *(f"{cell:.1f}" for cell in cells)])
    head = [
        "picture",
        "surfaces, own matrix",
        "surfaces, picture's matrix",
        "basis, own matrix",
        "basis, picture's matrix",
    ]
    print(csv_text(head, rows))
    many = np.random.default_rng(1).random((1 << 20, 3)) ** 2
    start = time.process_time()
    surface_reflectances(many)
    print(f"spectra of 1 megapixel of colours at random: {time.process_time() - start:.2f} s of processor time")


def exact_psnr(reflectances: Floats) -> tuple[float, float]:
    """PSNR of exact R, G and B of reflectances (pixel, band) by the camera's own matrix and by the picture's [dB]."""
    width = band_widths(NM)
    light = illuminant("D65").band_average(NM, width)
    camera = low_noise().responses.band_average(COLOURS, NM, width)
    patches = np.array([held(curve).band_average(NM, width) for _, curve in color_checker_reflectances()])
    own = fit_colours(COLOURS, camera, NM, light, patches, width).matrix(COLOURS)
    signals, target = training(camera, NM, light, reflectances, width)
    best = np.linalg.lstsq(signals, target, rcond=None)[0]
    return psnr(signals @ own.T, target), psnr(signals @ best, target)


def psnr(found: Floats, right: Floats) -> float:
    """PSNR [dB] of encoded, clipped sRGB."""
    shown = [encode_srgb(np.clip(values, 0.0, 1.0)) for values in (found, right)]
    return float(-10.0 * np.log10(np.mean((shown[0] - shown[1]) ** 2)))


def _linear(path: Path) -> Floats:
    picture = Image.open(path).convert("RGB")
    picture.thumbnail((SIDE, SIDE), Image.Resampling.BOX)
    return decode_srgb(np.asarray(picture) / 255.0).reshape(-1, 3)


if __name__ == "__main__":
    main()
