"""Light for hard cases: one small render, lit again at every level, and what is made from it."""

from dataclasses import replace
from functools import cache

import numpy as np
from hard.case import Situation
from hard.chain import expected
from numpy.typing import NDArray

from render.engine import render
from render.illuminants import illuminant, lines_nm
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, line_bands
from render.transport import Transport
from rodcone.types import Floats, Image
from scenes.catalogue import load
from sensor.config import SensorConfig

SCENE = "cornell_box"
SIDE = 64
SPP = 16
BANDS_NM = np.arange(390.0, 780.0, 20.0)
GLINT_CD_M2 = 1e9  # the sun's disc, as a mirror or water shows it
STARLIGHT_CD_M2 = 1e-4


@cache
def transport() -> Transport:
    """The render that most cases share."""
    return render(load(SCENE), (SIDE, SIDE), wavelength_nm=BANDS_NM, spp=SPP, seed=1)


@cache
def at_level(luminance_cd_m2: float, light: str | None = None) -> SpectralRadiance:
    """The scene at a mean luminance, under its own light or another."""
    made = transport()
    spectra = None if light is None else dict.fromkeys(made.groups, light)
    return made.relight(spectra, luminance_cd_m2=luminance_cd_m2)


@cache
def in_bands(
    centres_nm: tuple[float, ...], widths_nm: tuple[float, ...], side: int = SIDE, spp: int = SPP
) -> SpectralRadiance:
    """The scene at 10 cd/m^2 in other bands: a render of its own."""
    centres, widths = np.array(centres_nm), np.array(widths_nm)
    made = render(load(SCENE), (side, side), wavelength_nm=centres, width_nm=widths, spp=spp, seed=2)
    return made.relight(luminance_cd_m2=10.0)


@cache
def of_lines(light: str) -> SpectralRadiance:
    """The scene at 10 cd/m^2 under a light of lines, each in a band of its own."""
    centres, widths = line_bands(lines_nm(light), VISIBLE_NM, 40.0)
    made = render(load(SCENE), (SIDE, SIDE), wavelength_nm=centres, width_nm=widths, spp=SPP, seed=3)
    return made.relight(dict.fromkeys(made.groups, light), luminance_cd_m2=10.0)


def even(luminance_cd_m2: float, shape: tuple[int, int] = (SIDE, SIDE)) -> SpectralRadiance:
    """An even field under D65."""
    spectrum = illuminant("D65").band_average(BANDS_NM, np.full(BANDS_NM.shape, 20.0)) * luminance_cd_m2
    return planar(np.ones(shape), spectrum)


def even_lines(light: str, luminance_cd_m2: float) -> SpectralRadiance:
    """An even field under a light of lines, each in a band of its own."""
    centres, widths = line_bands(lines_nm(light), VISIBLE_NM, 40.0)
    spectrum = illuminant(light).band_average(centres, widths) * luminance_cd_m2
    return planar(np.ones((SIDE, SIDE)), spectrum, centres, widths)


def planar(
    pattern: NDArray[np.floating], spectrum: Floats, centres_nm: Floats = BANDS_NM, width_nm: Floats | None = None
) -> SpectralRadiance:
    """Pattern (h, w) times a spectrum (band,) as float32 in band-planar memory, as renders are."""
    values = (np.asarray(spectrum)[:, None, None] * pattern).astype(np.float32)
    return SpectralRadiance(np.moveaxis(values, 0, -1), centres_nm, width_nm=width_nm)


def planes_of(radiance: SpectralRadiance) -> NDArray[np.floating]:
    """Values as planes (band, h, w)."""
    return np.moveaxis(radiance.values, -1, 0)


def with_planes(radiance: SpectralRadiance, planes: NDArray[np.floating]) -> SpectralRadiance:
    """Radiance of the same bands with other planes (band, h, w)."""
    return replace(radiance, values=np.moveaxis(planes, 0, -1))


def times(radiance: SpectralRadiance, pattern: NDArray[np.floating]) -> SpectralRadiance:
    """Radiance times a pattern (h, w)."""
    return with_planes(radiance, planes_of(radiance) * pattern.astype(radiance.values.dtype))


def with_glint(radiance: SpectralRadiance, row: int, column: int) -> SpectralRadiance:
    """One pixel shows the sun."""
    planes = planes_of(radiance).copy()
    planes[:, row, column] = even(GLINT_CD_M2, (1, 1)).values[0, 0]
    return with_planes(radiance, planes)


def checkerboard(cell: int) -> Image:
    """1 and 10^8 in turn, in squares of `cell` pixels."""
    rows, columns = np.indices((SIDE, SIDE))
    return np.where((rows // cell + columns // cell) % 2 == 0, 1.0, 1e8)


def cropped(radiance: SpectralRadiance, shape: tuple[int, int]) -> SpectralRadiance:
    """The frame's middle, or the frame repeated where that is larger."""
    planes = planes_of(radiance)
    repeats = [-(-size // side) for size, side in zip(shape, planes.shape[1:], strict=True)]
    tiled = np.tile(planes, (1, *repeats))
    row, column = ((side - size) // 2 for size, side in zip(shape, tiled.shape[1:], strict=True))
    return with_planes(radiance, tiled[:, row : row + shape[0], column : column + shape[1]].copy())


def scaled_to(radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float, mean_e: float) -> SpectralRadiance:
    """Radiance at which the camera's pixels expect `mean_e` photo-electrons on average."""
    now = expected(Situation(radiance, sensor, exposure_s)).mean()
    return times(radiance, np.full(radiance.shape, mean_e / now))
