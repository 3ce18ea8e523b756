r"""Judge the network of `isp.processors.corrected` on pictures that it never saw, beside `ple` and others.

    pip download --no-deps -d out/wheels scikit-learn demosaicnet
    PYTHONPATH=docs/make python benchmarks/judge_net.py out/wheels --control out/net/control.npz -o out/judged
        --headline out/results/headline/packages        (after `make results PART=headline`)

Pictures are the photographs of docs/white_pixel.md, those of its headline, whose exact R, G and B reach 35 dB by the
camera's matrix, leaves of the ColorChecker's measured reflectances, and the pictures of `training_pictures` (leaves,
gratings and patches of drawn reflectances), by `low_noise` behind three mosaics, exposed by `auto:information`, white
balance as shot, without diffraction. It writes judged.csv, one line a picture, light, mosaic and seed: PSNR [dB] of
encoded sRGB against the scene's own colours, and against exact R, G and B by the camera's matrix, where colours count
for nothing; and the amplitude of a 2x2 pattern on even patches [encoded]. summary.csv has gains over `ple` by kind of
picture. And it writes sheets of pictures at three times their size.
"""

import argparse
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from headline import read_split
from net_frames import MOSAICS
from numpy.typing import NDArray
from PIL import Image
from training_pictures import FINER, LIGHTS, leaves, training_pictures
from training_pictures import NM as DRAWN_NM
from white_pixel import PHOTOGRAPHS, SIDE

from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.ple.prior import own_prior
from isp.processors.catalogue import PROCESSORS
from isp.processors.corrected import added, corrected, correction_inputs, own_weights
from isp.processors.network import network_processor
from isp.processors.piecewise import PiecewisePicture, develop_planes
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.radiance_files.surface_spectra import surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM as NM
from render.spectrum import band_widths
from rodcone.colour_spaces import decode_srgb, encode_srgb, white_of
from rodcone.csv_file import csv_text
from rodcone.files import write_files
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances
from sensor.capture import expose_channels
from sensor.device import draw_device
from sensor.exposure import AUTO_INFORMATION, exposed_by_rule
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.response import imaged_electrons
from studies.metrics.truth import Light, light_in_bands, neutral_electrons, true_srgb
from studies.photograph.camera import colour_fit

LEVELS_CD_M2, LONGEST_S = (0.05, 0.5, 5.0, 100.0), 0.066
DRAWN, DRAWN_SEED = 12, 20261129  # two of each kind under D65, A and LED-B3, a seed that nothing is chosen by
EXACT = "exact"
PATCHES = 5  # fields a side of a picture of even patches
ENLARGED = 3


@dataclass(frozen=True)
class Judged:
    """A picture: its radiance at a mean of 1 cd/m^2, its light, what is shown as white, and its encoded truth."""

    kind: str
    name: str
    radiance: SpectralRadiance
    light: Light
    white_cd_m2: float
    truth: NDArray[np.float64]


def photographs(wheels: Path) -> Iterator[Judged]:
    """Yield the photographs of white pixel, `SIDE` pixels on the longer side, of surfaces under D65."""
    for name, folder in PHOTOGRAPHS.items():
        package = find_spec(folder.split("/")[0])
        if package is None or package.origin is None:
            content = ZipFile(next(wheels.glob("scikit_learn-*.whl"))).read(f"{folder}/{name}")
        else:
            content = Path(package.origin).parents[1].joinpath(folder, name).read_bytes()
        picture = Image.open(io.BytesIO(content)).convert("RGB")
        picture.thumbnail((SIDE, SIDE), Image.Resampling.BOX)
        yield _photograph("white pixel", name.partition(".")[0], np.asarray(picture))


def headline_photographs(packages: Path) -> Iterator[Judged]:
    """Yield the photographs of the headline, its sample and those held out."""
    crops, _, parts = read_split(packages)
    for photograph in (*parts.sample, *parts.held):
        yield _photograph("headline", photograph.name, crops[photograph])


def _photograph(kind: str, name: str, pixels: NDArray[np.uint8]) -> Judged:
    light = light_in_bands(illuminant("D65"), NM, band_widths(NM))
    reflectances = surface_reflectances(decode_srgb(pixels / 255.0))[0]
    return _judged(kind, name, reflectances.astype(np.float64) * light.spectrum, light)


def drawn() -> Iterator[Judged]:
    """Yield pictures of drawn reflectances under D65, A and LED-B3."""
    for index, one in enumerate(training_pictures(SIDE, DRAWN, DRAWN_SEED)):
        shape = ("leaves", "gratings", "patches")[index % 3]
        kind = f"drawn under {LIGHTS[index % len(LIGHTS)]}"
        yield Judged(kind, f"{shape} {index}", one.radiance, one.light, one.white_cd_m2, one.truth)


def measured() -> Iterator[Judged]:
    """Yield leaves of the ColorChecker's measured reflectances, under random shades, under D65, A and LED-B3."""
    width = band_widths(DRAWN_NM)
    curves = [curve.band_average(DRAWN_NM, width) for _, curve in color_checker_reflectances()]

    def surface(rng: np.random.Generator, _: float) -> Floats:
        return np.asarray(curves[rng.integers(len(curves))] * rng.uniform(0.3, 1.0))

    for index, lamp in enumerate(("D65", "A", "LED-B3")):
        pixels = leaves(np.random.default_rng([DRAWN_SEED, 100 + index]), SIDE * FINER, 0.0, surface)
        pixels = pixels.reshape(SIDE, FINER, SIDE, FINER, -1).mean(axis=(1, 3))
        light = light_in_bands(illuminant(lamp), DRAWN_NM, width)
        yield _judged(f"measured under {lamp}", f"checker leaves {lamp}", pixels * light.spectrum, light)


def _judged(kind: str, name: str, values: Floats, light: Light) -> Judged:
    nm = light.wavelength_nm
    radiance = SpectralRadiance(values, nm)
    radiance = SpectralRadiance(values / radiance.luminance().mean(), nm)
    white = float(np.percentile(radiance.luminance(), 99.0)) / 0.9
    return Judged(kind, name, radiance, light, white, encode_srgb(true_srgb(radiance, light, white)))


def develop(
    one: Judged, level: float, mosaic: str, seed: int, wheel: bytes, control: Path
) -> dict[str, NDArray[np.float64]]:
    """Photograph a picture and develop it by each processor, encoded at the scale of the truth."""
    sensor = low_noise(mosaic)
    sensor = replace(sensor, lens=replace(sensor.lens, diffraction=0.0))
    per_second_e = imaged_electrons(one.radiance, sensor, 1.0) * level
    exposure_s, sensor = exposed_by_rule(AUTO_INFORMATION, per_second_e, sensor, LONGEST_S)
    rng = np.random.default_rng([seed, round(1000 * level)])
    device = draw_device(sensor, one.truth.shape[:2], rng)
    raw = expose_channels(per_second_e * exposure_s, sensor, exposure_s, device, rng, exact=True)
    neutral = neutral_electrons(sensor, one.light, exposure_s)
    colours = colour_fit(sensor, PROCESSORS[MOSAICS[mosaic]], one.light)
    balance = WhiteBalance.of(raw, neutral, neutral)
    made = develop_planes(raw, colours, balance, own_prior())
    pictures = {"ple": made.picture, "net": corrected(raw, made, own_weights())}
    if control.is_file():
        pictures["control"] = by_one_pixel(raw, made, control)
    if mosaic == "bayer" and wheel:
        learned = network_processor("bayer_net", wheel)
        pictures["bayer_net"] = learned.develop(raw, colour_fit(sensor, learned, one.light), balance=balance)
    scale = neutral[sensor.channels.index("G")] * one.white_cd_m2 * level
    order = [sensor.channels.index(name) for name in "RGB"]
    exact = (per_second_e * exposure_s / neutral)[..., order] @ colours.matrix().T / (one.white_cd_m2 * level)
    shown = {name: picture.rgb / scale for name, picture in pictures.items()} | {EXACT: exact}
    return {name: encode_srgb(linear) for name, linear in shown.items()}


def by_one_pixel(raw: RawImage, made: PiecewisePicture, control: Path) -> Picture:
    """Correct a picture by the control of `train_net.py`."""
    white = white_of(made.picture.rgb)
    values = correction_inputs(raw, made, white)[..., [0, 1, 2, 4, 7]]
    with np.load(control) as file:
        for layer in (0, 2, 4, 6):
            values = values @ file[f"layers.{layer}.weight"][..., 0, 0].T.astype(np.float32)
            values = values + file[f"layers.{layer}.bias"].astype(np.float32)
            values = np.maximum(values, 0.0) if layer < 6 else values
    return Picture(added(made.picture.rgb, values.astype(np.float64), white), made.picture.balance)


def pattern(picture: NDArray[np.float64]) -> float:
    """Return the RMS by which the four sites of a 2x2 tile differ on even patches, without noise's share of it."""
    edges = np.linspace(0, len(picture), PATCHES + 1).astype(int)
    squares = []
    for row, column in product(range(PATCHES), repeat=2):
        patch = picture[edges[row] + 4 : edges[row + 1] - 4, edges[column] + 4 : edges[column + 1] - 4]
        patch = patch[: len(patch) // 2 * 2, : patch.shape[1] // 2 * 2]
        sites = patch.reshape(len(patch) // 2, 2, patch.shape[1] // 2, 2, 3).mean(axis=(0, 2))
        squares.append(sites.var(axis=(0, 1)).mean())
    return float(np.sqrt(np.mean(squares)))


def psnr(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the PSNR [dB]."""
    return float(-10 * np.log10(np.mean((picture - truth) ** 2)))


def summary(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return gains over `ple` [dB] by kind, mosaic and light: number of pictures, mean, standard error and least."""
    found = []
    for kind, mosaic, level in dict.fromkeys((row[0], row[2], row[3]) for row in rows):
        for name, index in (("net", 1), ("control", 2), ("bayer_net", 3)):
            for truth, first in (("colours", 5), ("exact", 9)):
                gains = [
                    float(row[first + index]) - float(row[first])
                    for row in rows
                    if (row[0], row[2], row[3]) == (kind, mosaic, level) and row[first + index]
                ]
                if gains:
                    error = np.std(gains, ddof=1) / np.sqrt(len(gains)) if len(gains) > 1 else np.nan
                    figures = [f"{value:+.2f}" for value in (np.mean(gains), error, min(gains))]
                    found.append([kind, mosaic, level, name, truth, str(len(gains)), *figures])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path)
    parser.add_argument("--headline", type=Path, help="folder of the packages that hold the headline's photographs")
    parser.add_argument("--control", type=Path, default=Path("none"))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("-o", "--out", type=Path, default=Path("out/judged"))
    given = parser.parse_args()
    wheel = next(given.wheels.glob("demosaicnet-*.whl"), None)
    content = wheel.read_bytes() if wheel else b""
    rows, given_names = [], ("ple", "net", "control", "bayer_net")
    given.out.mkdir(parents=True, exist_ok=True)
    further = headline_photographs(given.headline) if given.headline else ()
    for one in (*photographs(given.wheels), *further, *measured(), *drawn()):
        for mosaic, level, seed in product(MOSAICS, LEVELS_CD_M2, range(given.seeds)):
            found = develop(one, level, mosaic, seed, content, given.control)
            is_even = one.name.startswith("patches")
            cells = [
                f"{psnr(found[name], right):.3f}" if name in found else ""
                for right in (one.truth, found[EXACT])
                for name in given_names
            ]
            cells += [f"{pattern(found[name]):.5f}" if is_even else "" for name in ("ple", "net")]
            rows.append([one.kind, one.name, mosaic, f"{level:g}", str(seed), *cells])
            print(*rows[-1], flush=True)
            if seed == 0:
                sheet = np.concatenate([found["ple"], found["net"], one.truth], axis=1)
                sheet = sheet.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
                shown = Image.fromarray(np.rint(255 * np.clip(sheet, 0, 1)).astype(np.uint8))
                shown.save(given.out / f"{one.name.replace(' ', '_')}_{mosaic.replace('/', '')}_{level:g}.png")
    beside_exact = [f"{name}_beside_exact" for name in given_names]
    head = ["kind", "picture", "mosaic", "cd_m2", "seed", *given_names, *beside_exact, "pattern_ple", "pattern_net"]
    gains = summary(rows)
    columns = ["kind", "mosaic", "cd_m2", "way", "beside", "pictures", "mean_db", "standard_error_db", "least_db"]
    write_files({given.out / "judged.csv": csv_text(head, rows), given.out / "summary.csv": csv_text(columns, gains)})
    for line in gains:
        print(*line)


if __name__ == "__main__":
    main()
