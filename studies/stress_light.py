"""Light for hard cases: one small render, lit again at every level, and what is made from it."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from render.engine import render
from render.illuminants import illuminant, lines_nm
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, Floats, line_bands
from render.transport import Transport
from scenes.catalog import load
from sensor.config import SensorConfig
from studies.stress_case import Situation
from studies.stress_chain import expected

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


def even(luminance_cd_m2: float, shape: tuple[int, int] = (SIDE, SIDE), light: str = "D65") -> SpectralRadiance:
    """An even field."""
    spectrum = illuminant(light).band_average(BANDS_NM, np.full(BANDS_NM.shape, 20.0)) * luminance_cd_m2
    return planar(np.ones(shape), spectrum)


def even_lines(light: str, luminance_cd_m2: float) -> SpectralRadiance:
    """An even field under a light of lines, each in a band of its own."""
    centres, widths = line_bands(lines_nm(light), VISIBLE_NM, 40.0)
    spectrum = illuminant(light).band_average(centres, widths) * luminance_cd_m2
    values = np.broadcast_to(spectrum.astype(np.float32), (SIDE, SIDE, centres.size)).copy()
    return SpectralRadiance(values, centres, 0.0, widths)


def planar(pattern: NDArray[np.floating], spectrum: Floats, centres_nm: Floats = BANDS_NM) -> SpectralRadiance:
    """Pattern (h, w) times a spectrum (band,) as float32 in band-planar memory, as renders are."""
    values = (np.asarray(spectrum)[:, None, None] * pattern).astype(np.float32)
    width = None if len(centres_nm) > 1 else np.array([10.0])
    return SpectralRadiance(np.moveaxis(values, 0, -1), centres_nm, 0.0, width)


def times(radiance: SpectralRadiance, pattern: NDArray[np.floating]) -> SpectralRadiance:
    """Radiance times a pattern (h, w)."""
    planes = np.moveaxis(radiance.values, -1, 0) * pattern.astype(radiance.values.dtype)
    return SpectralRadiance(np.moveaxis(planes, 0, -1), radiance.wavelength_nm, 0.0, radiance.width_nm)


def with_glint(radiance: SpectralRadiance, row: int, column: int) -> SpectralRadiance:
    """One pixel shows the sun."""
    values = np.moveaxis(radiance.values, -1, 0).copy()
    values[:, row, column] = even(GLINT_CD_M2, (1, 1)).values[0, 0]
    return SpectralRadiance(np.moveaxis(values, 0, -1), radiance.wavelength_nm, 0.0, radiance.width_nm)


def checkerboard(cell: int, shape: tuple[int, int] = (SIDE, SIDE)) -> NDArray[np.float64]:
    """1 and 10^8 in turn, in squares of `cell` pixels."""
    rows, columns = np.indices(shape)
    return np.where((rows // cell + columns // cell) % 2 == 0, 1.0, 1e8)


def cropped(radiance: SpectralRadiance, shape: tuple[int, int]) -> SpectralRadiance:
    """The frame's middle, or the frame repeated where that is larger."""
    planes = np.moveaxis(radiance.values, -1, 0)
    repeats = [-(-size // have) for size, have in zip(shape, planes.shape[1:], strict=True)]
    tiled = np.tile(planes, (1, *repeats))
    first = [(have - size) // 2 for size, have in zip(shape, tiled.shape[1:], strict=True)]
    part = tiled[:, first[0] : first[0] + shape[0], first[1] : first[1] + shape[1]].copy()
    return SpectralRadiance(np.moveaxis(part, 0, -1), radiance.wavelength_nm, 0.0, radiance.width_nm)


def scaled_to(radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float, mean_e: float) -> SpectralRadiance:
    """Radiance at which the camera's pixels expect `mean_e` photo-electrons on average."""
    now = expected(Situation(radiance, sensor, exposure_s)).mean()
    return times(radiance, np.full(radiance.shape, mean_e / now))
