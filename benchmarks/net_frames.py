r"""Frames to train the network of `isp.processors.corrected` on: pictures that judge nothing, developed by `ple`.

    python benchmarks/net_frames.py out/net --groups 40          (a group: ten pictures by one camera and lamp)
    python benchmarks/net_frames.py out/net --photographs out/photographs         (of net_photographs.py)

A frame holds what the network sees, and its target: exact R, G and B of the picture by the camera's own matrix, as
encoded sRGB over the picture's white. So the network isn't taught colours, which a matrix has to choose.

Pictures are drawn of drawn reflectances (leaves, gratings, charts of grey lines, and fronts: small patches, and lines
in the light of another lamp), or are photographs: those that `ple`'s prior was trained on, and those of a folder. A
photograph's colours are changed at random and become surfaces' spectra; those without colour, and one in four of the
others, get two drawn surfaces at their ends. Read noise is 0.7 to 6 e-, pitch 0.8 to 3 um, light 0.02 to 1000 cd/m^2,
the lens sharp to soft; lamps are those of `draw_illuminant`. `HELD` is a photograph left out to validate on, beside
those of a folder that `is_held` names.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from net_photographs import is_held, mean_of_squares
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter
from skimage import data

from isp.colour.white_balance import WhiteBalance
from isp.ple.prior import own_prior
from isp.processors.catalogue import PROCESSORS
from isp.processors.corrected import correction_inputs
from isp.processors.piecewise import develop_planes
from render.illuminants import illuminant
from render.radiance_files.surface_spectra import surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, photons_per_joule
from rodcone.colour_spaces import decode_srgb, encode_srgb, white_of
from rodcone.types import Floats
from scenes.reflectances import band, edge
from sensor.capture import expose_channels
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.exposure import AUTO_INFORMATION, exposed_by_rule
from sensor.presets import low_noise, vary
from studies.metrics.truth import named_light, neutral_electrons
from studies.photograph.camera import colour_fit
from studies.training.pictures import NM, PHOTOGRAPHS, KnownLight, draw_illuminant, draw_surface, gratings, leaf_picture

HELD = "coffee"
CROP = 128  # pixels of a frame
READ_NOISE_E, PITCH_UM, LUMINANCE_CD_M2 = (0.7, 6.0), (0.8, 3.0), (0.02, 1000.0)
LONGEST_S = 0.066
LAMPS = ("D65", "D65", "A", "LED-B3")  # half of the groups, the others' are drawn
# Of a group's pictures in turn; those of a kind that is drawn are parts of one picture.
KINDS = ("photograph",) * 6 + ("gratings", "leaves", "fronts", "charts")
DRAWN_SURFACES = 0.25  # share of photographs that lend their brightness alone: other spectra than photographs have
COARSEST = 8  # side of a pixel of a frame in those of a folder's photograph, at most; its least is 2
HELD_CD_M2 = (0.05, 0.5, 5.0, 100.0)  # of the groups to validate on, in turn
NEAR = 2.0  # by which a group's light differs at most, so that it shares `ple`'s tables
MOSAICS = {"rgbw": "ple_rgbw", "bayer": "ple_bayer", "RG/WB": "ple_rgbw"}  # with the processor that chooses the matrix
FINE, FRONTS = 3, 220  # points of a pixel's side, and rectangles of a picture
FRONTS_SIDE = (3.0, 50.0)  # pixels
LINES_PERIOD = (1.6, 8.0)  # pixels
NEARLY_GREY = 0.01  # standard deviation of the logarithm of a grey's signals
LIGHTER = (1.0, 1.0, 1.5)  # factors on the exposure, so that W is full too
TRUTH_LETTERS = "RGBW"


@dataclass(frozen=True)
class Frame:
    """What the network sees (h, w, 8), what it should give (h, w, 3), and what it was made of; half precision."""

    seen: NDArray[np.float16]
    target: NDArray[np.float16]
    kind: str
    lamp: str
    level_cd_m2: float


def draw_camera(rng: np.random.Generator) -> SensorConfig:
    """Draw a camera about `low_noise`: its pixel's size, well and noise."""
    sensor = low_noise()
    pitch, read_noise = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (PITCH_UM, READ_NOISE_E))
    pixel = replace(
        sensor.pixel,
        pitch_um=pitch,
        read_noise_e=read_noise,
        dsnu_e=read_noise * rng.uniform(0.0, 0.7),
        prnu=rng.uniform(0.003, 0.012),
        full_well_e=3000.0 * pitch**1.5,
    )
    return replace(sensor, pixel=pixel)


def draw_front(rng: np.random.Generator, light: KnownLight, side: tuple[int, int]) -> Floats:
    """Draw a rectangle (h, w, channel) of a surface, vivid or not, in this lamp's light or another's, often lined."""
    low, high = rng.uniform(0.02, 0.1), rng.uniform(0.3, 0.8)
    vivid = (
        edge(rng.uniform(470, 640), rng.uniform(8, 30), *rng.permutation([low, high])),
        band(rng.uniform(420, 640), rng.uniform(20, 60), *rng.permutation([low, high])),
    )
    width = band_widths(NM)
    surface = vivid[rng.integers(2)].band_average(NM, width) if rng.random() < 0.4 else draw_surface(rng)
    other = np.exp(np.interp(NM, np.linspace(380, 780, 6), rng.normal(0.0, 0.5, 6)))
    lamp = other / other.max() if rng.random() < 0.4 else np.ones(len(NM))
    second = surface * rng.uniform(0.15, 0.9) if rng.random() < 0.75 else draw_surface(rng)
    y, x = np.mgrid[: side[0] * FINE, : side[1] * FINE] / FINE
    angle = rng.choice((0.0, np.pi / 2, rng.uniform(0, np.pi)))
    across = np.cos(angle) * y + np.sin(angle) * x + rng.uniform(0, 8)
    lined = across / rng.uniform(*LINES_PERIOD) % 1 < rng.uniform(0.2, 0.8) * (rng.random() < 0.5)
    return np.where(lined[..., None], light.signals(second * lamp), light.signals(surface * lamp))


def fronts(rng: np.random.Generator, light: KnownLight) -> Floats:
    """Draw rectangles over one another, (2 CROP, 2 CROP, channel): house fronts, charts of small patches, windows."""
    length = 2 * CROP * FINE
    picture = np.tile(light.signals(draw_surface(rng)), (length, length, 1))
    for _ in range(FRONTS):
        side = np.exp(rng.uniform(*np.log(FRONTS_SIDE), 2))
        top, left = (int(rng.integers(length)) for _ in range(2))
        place = picture[top : top + int(side[0] * FINE), left : left + int(side[1] * FINE)]
        painted = draw_front(rng, light, (int(np.ceil(side[0])), int(np.ceil(side[1]))))
        place[:] = painted[: place.shape[0], : place.shape[1]]
    return mean_of_squares(picture, FINE)


def charts(rng: np.random.Generator, light: KnownLight) -> Floats:
    """Draw fields of grey lines, (2 CROP, 2 CROP, channel): stars, zone plates, and bars that grow wider."""
    length, fields = 2 * CROP * FINE, 3
    picture = np.empty((length, length, len(light.weights)))
    at = np.linspace(0, length, fields + 1).astype(int)
    for (top, bottom), (left, right) in product(pairwise(at.tolist()), repeat=2):
        y, x = np.mgrid[top:bottom, left:right] / FINE
        middle = rng.uniform((top, left), (bottom, right)) / FINE
        y, x = y - middle[0], x - middle[1]
        angle = rng.uniform(0, np.pi)
        across = np.cos(angle) * y + np.sin(angle) * x
        phase = (
            rng.integers(12, 90) * np.arctan2(y, x),
            (y**2 + x**2) * rng.uniform(0.01, 0.05),
            2 * np.pi * across / (rng.uniform(*LINES_PERIOD) + 0.02 * np.abs(across)),
        )[rng.integers(3)]
        share = (np.sign(np.cos(phase)) if rng.random() < 0.7 else np.cos(phase))[..., None] / 2 + 0.5
        tint = np.exp(rng.normal(0.0, NEARLY_GREY, len(light.weights)))
        dark, bright = (value * tint for value in np.sort(rng.uniform(0.03, 0.9, 2)))
        picture[top:bottom, left:right] = dark + share * (bright - dark)
    return mean_of_squares(picture, FINE)


DRAWN = {"leaves": leaf_picture, "gratings": gratings, "fronts": fronts, "charts": charts}


def collected(sensor: SensorConfig, lamp: str, nm: Floats) -> Floats:
    """Share of each of R, G, B and W that comes from each band of a white surface, shape (4, band)."""
    width = band_widths(nm)
    photons = illuminant(lamp).band_average(nm, width) * photons_per_joule(nm) * width
    electrons = sensor.responses.band_average(tuple(TRUTH_LETTERS), nm, width) * photons
    return np.asarray(electrons / electrons.sum(axis=1, keepdims=True))


def draw_signals(
    rng: np.random.Generator, sensor: SensorConfig, lamp: str, source: str | Path, drawn: dict[str, Floats]
) -> Floats:
    """Draw a picture as signals of R, G, B and W over those of white, shape (CROP, CROP, 4)."""
    if source in DRAWN:
        kind = str(source)
        if kind not in drawn:
            drawn[kind] = DRAWN[kind](rng, KnownLight(collected(sensor, lamp, NM)))
        picture = drawn[kind]
    else:
        picture = photograph_signals(rng, sensor, lamp, read_reduced(rng, source))
    top, left = (int(rng.integers(length - CROP + 1)) for length in picture.shape[:2])
    picture = np.rot90(picture[top : top + CROP, left : left + CROP], rng.integers(4))
    return np.maximum(gaussian_filter(picture, (*[rng.uniform(0.0, 0.6)] * 2, 0)), 1e-4)


def photographs_of(folder: Path | None, held: bool) -> list[str | Path]:
    """Return the photographs to train on, or those to validate on: scikit-image's names, and a folder's paths."""
    paths = sorted(folder.glob("*.png")) if folder else []
    names = (name for name in PHOTOGRAPHS if (name == HELD) == held)
    return [*names, *(path for path in paths if is_held(path.stem) == held)]


def read_reduced(rng: np.random.Generator, source: str | Path) -> Floats:
    """Read a photograph in linear sRGB at a part of its size: scikit-image's whole, a folder's cut to a frame."""
    encoded = getattr(data, source)() if isinstance(source, str) else np.asarray(Image.open(source).convert("RGB"))
    most = min(min(encoded.shape[:2]) // CROP, 3 if isinstance(source, str) else COARSEST)
    step = int(rng.integers(min(2, most), most + 1))
    if not isinstance(source, str):
        top, left = (int(rng.integers(length - CROP * step + 1)) for length in encoded.shape[:2])
        encoded = encoded[top : top + CROP * step, left : left + CROP * step]
    return mean_of_squares(decode_srgb(encoded / 255.0), step)


def recoloured(rng: np.random.Generator, linear: Floats) -> Floats:
    """Change a photograph's colours at random, so that a network can't learn which colours things have."""
    if rng.random() < 0.3:
        linear = linear[..., rng.permutation(3)]
    if rng.random() < 0.4:  # paler or more vivid
        grey = linear.mean(axis=-1, keepdims=True)
        linear = np.maximum(grey + rng.uniform(0.4, 2.0) * (linear - grey), 0.0)
    if rng.random() < 0.15:  # as if all were of one colour
        linear = linear * (rng.uniform(0.05, 0.6, 3) ** (np.arange(3) != rng.integers(3)))
    return np.clip(linear * np.exp(rng.normal(0.0, 0.2, 3)), 0.0, 1.0)


def photograph_signals(rng: np.random.Generator, sensor: SensorConfig, lamp: str, linear: Floats) -> Floats:
    """Return a photograph as signals of R, G, B and W, in other colours, and in part as two drawn surfaces."""
    if linear.shape[-1] == 1 or rng.random() < DRAWN_SURFACES:
        share = linear.mean(axis=-1, keepdims=True)
        share = share / max(share.max(), 1e-3)
        ends = [draw_surface(rng) for _ in range(2)]
        return np.asarray((share * ends[0] + (1 - share) * ends[1]) @ collected(sensor, lamp, NM).T)
    return np.asarray(
        surface_reflectances(recoloured(rng, linear))[0] @ collected(sensor, lamp, DEFAULT_WAVELENGTH_NM).T
    )


def take(
    rng: np.random.Generator,
    camera: SensorConfig,
    lamp: str,
    kind: str,
    signals: Floats,
    level_cd_m2: float,
    mosaics: Sequence[str],
) -> list[Frame]:
    """Photograph a picture by mosaics at one light."""
    frames, light = [], named_light(lamp)
    factor = float(rng.choice(LIGHTER))
    for mosaic in mosaics:
        processor = PROCESSORS[MOSAICS[mosaic]]
        sensor = vary(camera, mosaic)
        neutral = neutral_electrons(sensor, light, 1.0)
        of_channels = signals[..., [TRUTH_LETTERS.index(name) for name in sensor.channels]]
        green = sensor.channels.index("G")
        per_second_e = of_channels * neutral * (level_cd_m2 / of_channels[..., green].mean())
        exposure_s, sensor = exposed_by_rule(AUTO_INFORMATION, per_second_e, sensor, LONGEST_S)
        exposure_s = min(exposure_s * (factor if mosaic != "bayer" else 1.0), LONGEST_S)
        device = draw_device(sensor, (CROP, CROP), rng)
        raw = expose_channels(per_second_e * exposure_s, sensor, exposure_s, device, rng, exact=True)
        colours = colour_fit(sensor, processor, light)
        developed = develop_planes(raw, colours, WhiteBalance.of(raw, neutral, neutral), own_prior())
        white = white_of(developed.picture.rgb)
        exact = (per_second_e * exposure_s * developed.gains)[..., [sensor.channels.index(name) for name in "RGB"]]
        frames.append(
            Frame(
                seen=correction_inputs(raw, developed, white).astype(np.float16),
                target=encode_srgb(exact @ colours.matrix().T / white).astype(np.float16),
                kind=kind,
                lamp=lamp,
                level_cd_m2=level_cd_m2,
            )
        )
    return frames


def path_of(folder: Path, mosaic: str, index: int, held: bool) -> Path:
    """Return the file of a group's frames by one mosaic."""
    return folder / f"{'held' if held else 'train'}_{mosaic.replace('/', '')}_{index:04}.npz"


def draw_group(
    folder: Path,
    index: int,
    held: bool,
    photographs: Sequence[str | Path],
    mosaics: Sequence[str],
    luminance_cd_m2: Sequence[float],
    kinds: Sequence[str],
) -> None:
    """Draw a group's frames by one camera and lamp, and write each mosaic's file."""
    rng = np.random.default_rng([64, index, int(held)])
    camera = low_noise() if held else draw_camera(rng)
    lamp = str(rng.choice(LAMPS)) if rng.random() < 0.5 or held else draw_illuminant(rng)
    middle = rng.uniform(*np.log(luminance_cd_m2))
    levels = np.exp(middle + rng.uniform(-np.log(NEAR), np.log(NEAR), len(kinds)))
    if held:
        levels = np.full(len(kinds), HELD_CD_M2[index % len(HELD_CD_M2)])
    drawn: dict[str, Floats] = {}
    found = []
    for kind, level in zip(kinds, levels, strict=True):
        source = photographs[int(rng.integers(len(photographs)))] if kind == "photograph" else kind
        signals = draw_signals(rng, camera, lamp, source, drawn)
        found.append(take(rng, camera, lamp, Path(source).stem, signals, float(level), mosaics))
    for mosaic, frames in zip(mosaics, zip(*found, strict=True), strict=True):
        arrays = {name: np.array([getattr(frame, name) for frame in frames]) for name in Frame.__dataclass_fields__}
        path = path_of(folder, mosaic, index, held)
        part = path.with_suffix(".part.npz")
        np.savez(part, **arrays)
        part.rename(path)  # a file is whole, or isn't there


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--groups", type=int, default=100, help="of ten pictures")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--held", type=int, default=0, help="groups to validate on")
    parser.add_argument("--mosaics", nargs="+", choices=MOSAICS, default=["rgbw", "bayer"])
    parser.add_argument("--kinds", nargs="+", choices=set(KINDS), default=KINDS, help="of a group's pictures in turn")
    parser.add_argument("--luminance", nargs=2, type=float, default=LUMINANCE_CD_M2, help="least and most [cd/m^2]")
    parser.add_argument("--photographs", type=Path, help="folder of PNG to draw from beside scikit-image's photographs")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    work = [(index, True) for index in range(given.held)]
    work += [(index, False) for index in range(given.first, given.first + given.groups)]
    for index, held in work:
        if not all(path_of(given.folder, mosaic, index, held).exists() for mosaic in given.mosaics):
            photographs = photographs_of(given.photographs, held)
            draw_group(given.folder, index, held, photographs, given.mosaics, given.luminance, given.kinds)
            print(f"group {index}{', held' if held else ''}", flush=True)


if __name__ == "__main__":
    main()
