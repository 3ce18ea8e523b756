"""Draw pictures for training: signals of every channel of a camera at every pixel, under many lights.

Generated ones (dead leaves, after A. B. Lee, D. Mumford, J. Huang, "Occlusion models for natural images", IJCV 41,
2001, and gratings), and photographs from scikit-image's wheel, which become spectra by
`render.radiance_files.surface_spectra.srgb_basis`.
None of the project's scenes is among them: what is judged is never trained on.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray
from skimage import data
from skimage.draw import ellipse, polygon

from render.illuminants import illuminant
from render.radiance_files.surface_spectra import srgb_basis
from render.spectrum import band_widths, photons_per_joule
from rodcone.colour_spaces import decode_srgb
from rodcone.types import Floats
from scenes.reflectances import band, edge, grey
from sensor.config import SensorConfig

Planes = NDArray[np.float32]
Places = tuple[NDArray[np.intp], NDArray[np.intp]]

CHANNELS = ("R", "G", "B", "W")
# Photographs in scikit-image's wheel, which need no download. Public domain: astronaut (NASA), coins (Brooklyn Museum),
# rocket (SpaceX). CC0: camera (L. Varshney), chelsea (S. van der Walt), coffee (R. Michetti), brick and gravel
# (CC0Textures), grass (D. A. Nash's, linearlabs).
PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "coins", "rocket", "brick", "grass", "gravel")
# The ends and middles of the ranges from which `draw_light` draws, with D65 first.
LIGHTS = (
    "D65",
    "D4000K",
    "D9000K",
    "2400K",
    "3600K",
    *(f"LED-B{n}" for n in range(1, 6)),
    "F2",
    "F11",
    "sodium_high",
    "sodium_low",
)
KINDS = ("leaves",) * 20 + ("gratings",) * 10 + PHOTOGRAPHS
UNKNOWN = 6  # one picture in this many has a light that the camera doesn't know
SIDE = 256  # pixels of a generated picture
NM = np.arange(385.0, 780.0, 10.0)
_FINE = 3  # samples per pixel along each side, which are averaged
_DARKEST = 2e-3  # share of white


@dataclass(frozen=True)
class KnownLight:
    """Response of the channels to each band, over their response to white, shape (channel, band)."""

    weights: Floats

    def signals(self, reflectance: Floats) -> Floats:
        """Return the signals (..., channel) of reflectances (..., band).

        A surface that the camera believes to be white has the value 1 in every channel.
        """
        return np.asarray(reflectance @ self.weights.T)


def neutral_ratios(sensor: SensorConfig, lights: Sequence[str]) -> Floats:
    """Return the electrons of R, G, B and W from white under each light, relative to G, shape (light, 4)."""
    collected = np.array([_collected(sensor, light).sum(axis=1) for light in lights])
    return np.asarray(collected / collected[:, 1:2])


def draw_light(rng: np.random.Generator, sensor: SensorConfig) -> KnownLight:
    """Draw a light. In one case of `UNKNOWN` the camera is balanced to D65, else to the light itself."""
    collected = _collected(sensor, name := draw_illuminant(rng))
    white = _collected(sensor, "D65" if rng.random() < 1 / UNKNOWN else name).sum(axis=1, keepdims=True)
    return KnownLight(collected / white * white[3] / collected[3].sum())


def draw_illuminant(rng: np.random.Generator) -> str:
    """Draw a light's name: daylight more than half of the time, then bulbs, LEDs, fluorescent lamps and sodium."""
    kinds = {
        "D65": 0.4,
        f"D{rng.uniform(4000, 9000):.0f}K": 0.2,
        f"{rng.uniform(2400, 3600):.0f}K": 0.14,
        f"LED-B{rng.integers(1, 6)}": 0.14,
        "F2": 0.04,
        "F11": 0.04,
        "sodium_high": 0.02,
        "sodium_low": 0.02,
    }
    return str(rng.choice(list(kinds), p=list(kinds.values())))


def _collected(sensor: SensorConfig, light: str) -> Floats:
    """Return the electrons from a white surface in each band, in any scale, shape (4, band)."""
    width = band_widths(NM)
    photons = illuminant(light).band_average(NM, width) * photons_per_joule(NM) * width
    return np.asarray(sensor.responses.band_average(CHANNELS, NM, width) * photons)


def draw_surface(rng: np.random.Generator) -> Floats:
    """Draw a smooth reflectance, shape (band,): grey, an edge, a bump, or a curve through seven random points."""
    kind = rng.random()
    width = band_widths(NM)
    low, high = np.sort(rng.uniform(0.03, 0.85, 2))
    if kind < 0.35:
        curve = grey(rng.uniform(0.03, 0.9))
    elif kind < 0.65:
        curve = edge(rng.uniform(470, 640), rng.uniform(8, 30), low, high)
    elif kind < 0.9:
        curve = band(rng.uniform(420, 640), rng.uniform(20, 60), low, high)
    else:
        return np.asarray(np.interp(NM, np.linspace(380, 780, 7), rng.uniform(0.03, 0.85, 7)))
    return np.asarray(curve.band_average(NM, width))


def leaf_picture(rng: np.random.Generator, light: KnownLight, shapes: int = 900) -> Floats:
    """Draw shapes that cover one another; their sizes follow the power law of natural pictures.

    The result has the shape (SIDE, SIDE, channel).
    """
    side = SIDE * _FINE
    picture = np.empty((side, side, len(light.weights)))
    picture[:] = light.signals(draw_surface(rng))
    least, most = 2.0 * _FINE, 70.0 * _FINE
    for _ in range(shapes):
        radius = (least**-1.2 - rng.random() * (least**-1.2 - most**-1.2)) ** (-1 / 1.2)
        y, x = _shape(rng, rng.uniform(0, side, 2), radius, side)
        if len(y):
            picture[y, x] = _painted(rng, light, (y, x), radius)
    return _finished(rng, picture)


def _shape(rng: np.random.Generator, at: Floats, radius: float, side: int) -> Places:
    """Draw the pixels of an ellipse, a polygon or a thin bar."""
    kind = rng.integers(4)
    if kind == 0:
        y, x = ellipse(*at, radius, radius * rng.uniform(0.3, 1), shape=(side, side), rotation=rng.uniform(0, np.pi))
        return y, x
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 6)))
    if kind == 3:
        angles = rng.uniform(0, 2 * np.pi) + np.array([0, 0.3, np.pi, np.pi + 0.3])
    y, x = polygon(at[0] + radius * np.sin(angles), at[1] + radius * np.cos(angles), shape=(side, side))
    return y, x


def _painted(rng: np.random.Generator, light: KnownLight, at: Places, radius: float) -> Floats:
    """Draw the signals of a shape's pixels, shape (pixel, channel).

    The shape is even, shaded, speckled, or striped in two colours.
    """
    y, x = at
    colour = light.signals(draw_surface(rng))
    kind = rng.random()
    if kind < 0.25:
        slope = rng.normal(0, 0.5, 2)
        shade = np.exp(slope[0] * (y - y.mean()) / radius + slope[1] * (x - x.mean()) / radius)
    elif kind < 0.45:
        grain = rng.normal(0, rng.uniform(0.03, 0.3), (SIDE, SIDE))
        shade = np.exp(grain[y // _FINE, x // _FINE])
    elif kind < 0.55:
        angle = rng.uniform(0, np.pi)
        period = rng.uniform(2.2, 10) * _FINE
        first = np.sin(2 * np.pi * (np.cos(angle) * y + np.sin(angle) * x) / period) > 0
        return np.asarray(np.where(first[:, None], colour, light.signals(draw_surface(rng))))
    else:
        shade = np.ones(y.shape)
    return np.asarray(np.clip(colour * shade[:, None], 0.0, 1.6))


def gratings(rng: np.random.Generator, light: KnownLight) -> Floats:
    """Draw straight bars of three surfaces whose width grows across the picture, shape (SIDE, SIDE, channel)."""
    y, x = np.mgrid[: SIDE * _FINE, : SIDE * _FINE] / _FINE
    angle = rng.uniform(0, np.pi)
    across = np.cos(angle) * x + np.sin(angle) * y
    along = np.sin(angle) * x - np.cos(angle) * y
    period = rng.uniform(1.8, 4) + (np.abs(across) % 97) * rng.uniform(0.02, 0.15)
    surfaces = np.stack([light.signals(draw_surface(rng)) for _ in range(3)])
    bars = surfaces[np.floor(across / period).astype(int) % 3]
    gaps = np.floor(along / rng.uniform(15, 40)).astype(int) % 2 == 1
    return _finished(rng, np.where(gaps[..., None], light.signals(draw_surface(rng)), bars))


def _finished(rng: np.random.Generator, fine: Floats) -> Floats:
    """Average samples to pixels, and light the picture unevenly."""
    picture = fine.reshape(SIDE, _FINE, SIDE, _FINE, -1).mean(axis=(1, 3))
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
    slope = rng.normal(0, 0.6, 2)
    return np.asarray(picture * np.exp(slope[0] * y + slope[1] * x)[..., None])


def photograph_signals(rng: np.random.Generator, light: KnownLight, name: str) -> Floats:
    """Return a photograph of `PHOTOGRAPHS` at half its size as signals under the light, shape (h, w, channel).

    The basis gives each colour one spectrum. Other spectra of the same colour are imitated by a random factor per
    channel.
    """
    spectra = srgb_basis(NM)
    encoded = getattr(data, name)() / 255.0
    encoded = encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=2)
    linear = decode_srgb(encoded)
    height, width = (size // 2 for size in linear.shape[:2])
    linear = linear[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    return np.asarray(linear @ light.signals(spectra) * np.exp(rng.normal(0, 0.04, len(light.weights))))


def draw_pictures(
    light_of: Callable[[np.random.Generator], KnownLight], seed: int, kinds: Sequence[str] = KINDS
) -> Iterator[Planes]:
    """Draw training pictures one by one, each under a light of its own, (h, w, channel) float32.

    Every second one gets grain, like that of a render's noise and of fine texture.
    """
    for kind, rng in zip(kinds, np.random.default_rng(seed).spawn(len(kinds)), strict=True):
        light = light_of(rng)
        if kind == "leaves":
            picture = leaf_picture(rng, light)
        elif kind == "gratings":
            picture = gratings(rng, light)
        else:
            picture = photograph_signals(rng, light, kind)
        if rng.random() < 0.5:
            picture = picture * np.exp(rng.normal(0, rng.uniform(0.005, 0.03), picture.shape[:2]))[..., None]
        yield np.maximum(picture, _DARKEST).astype(np.float32)


def photograph_hashes() -> dict[str, str]:
    """Return the SHA-256 of each photograph's pixels."""
    return {name: sha256(getattr(data, name)().tobytes()).hexdigest() for name in PHOTOGRAPHS}
