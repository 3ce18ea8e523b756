"""Figures of pictures developed by a processor of the catalogue or of one's own, measured on simulated frames.

No formula says what a processor does. The figures of the camera before a processor are in other groups (`iso_15739`,
`iso_12233`, `iso_19567`, `color_checker`).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from math import log10, nan, pi

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, xyz2lab

from isp.processors.catalogue import require_libraries
from isp.processors.own import processor_of, require_consent
from rodcone.colour_spaces import SRGB_TO_XYZ, luminance_of_srgb
from rodcone.types import Floats, Plane
from scenes.dead_leaves import draw_leaves
from scenes.reflectances import color_checker_reflectances, held
from sensor.capture import expose
from sensor.cfa import OWN
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.lens.illumination import EVEN_LIGHT
from sensor.optics import form_image, least_samples
from sensor.presets import vary
from sensor.response import expected_electrons
from studies.metrics.mtf import edge_response
from studies.metrics.truth import GREY, neutral_electrons
from studies.photograph.camera import colour_fit, develop_to_scale
from studies.score.colour import true_lab
from studies.score.contrast import CONTRAST, LUX
from studies.score.contrast_chart import pair_accuracy
from studies.score.developed_range import picture_range
from studies.score.even_field import even_field
from studies.score.figure import Definition, Merit
from studies.score.sharpness import acutance, bands_of, edge_reflectance, grey_radiance
from studies.score.texture import LEAST_SAMPLES, SIDE_PX, figures_of, texture_merits
from studies.score.texture_response import texture_response
from studies.score.visual_noise import STANDARD, WHITE_SHARE, visual_noise

EDGE_PX, PATCH_PX, BORDER_PX = 96, 24, 8  # sides of the edge's picture and of a patch, and a border that isn't measured
RANGE_PX = 48  # side of bright even pictures, of which only the mean is measured [pixels]
BRIGHT_SIDE = slice(BORDER_PX, EDGE_PX // 2 - BORDER_PX)  # columns of the brighter of two patches in one picture
DARK_SIDE = slice(EDGE_PX // 2 + BORDER_PX, EDGE_PX - BORDER_PX)  # columns of the darker patch
ACROSS = 5  # patches in a row
ACCURACY = "IEEE 2020-2024 (there CTA, before CDP), all pairs of pixels of two patches of one picture"
RANGE = "like ISO 15739:2023, 6.4: brightest value within 1 % of proportion over the dark's temporal noise by its slope"


def developed_figures(
    sensor: SensorConfig, light: str, exposure_s: float, processor: str, *, trust_code: bool = False
) -> Iterator[Definition]:
    """Define a processor's figures of noise, sharpness, texture and colour.

    Raises
    ------
    InputError
        For an unknown processor, one whose library isn't installed, or a file of one's own without consent.
    """
    # The camera and its software.
    require_consent("processor", processor, trust_code)
    require_libraries(processor)
    software = processor_of(processor)
    camera = sensor if software.mosaic == OWN else vary(sensor, software.mosaic)
    camera = replace(camera, lens=replace(camera.lens, **EVEN_LIGHT, shake_um=0.0, veiling_glare=0.0))
    bands = bands_of(light, sensor.window_nm)
    colours, neutral = colour_fit(camera, software, bands), neutral_electrons(camera, bands, exposure_s)
    fields = [even_field(camera, bands, exposure_s, name) for name in camera.channels]
    white_cd_m2 = min(WHITE_SHARE * field.headroom_e / field.electrons_per_cd_m2 for field in fields)
    samples = max(least_samples(camera), LEAST_SAMPLES)

    cells = camera.sites * samples
    lit = replace(bands, spectrum=bands.spectrum * white_cd_m2)

    def expected_e(reflectance: Floats) -> Floats:
        return expected_electrons(form_image(grey_radiance(reflectance, lit), camera, samples), camera, exposure_s)

    def photograph(reflectance: Floats, rng: np.random.Generator) -> NDArray[np.float64]:
        """Photograph and develop reflectances, (h, w) of grey or (h, w, band), as linear sRGB; a perfect white is 1."""
        return developed(expected_e(reflectance), rng, rng)

    def developed(light_e: Floats, chip: np.random.Generator, rng: np.random.Generator) -> NDArray[np.float64]:
        raw = expose(light_e, camera, exposure_s, draw_device(camera, light_e.shape, chip), rng)
        linear, _ = develop_to_scale(raw, software, colours, camera, neutral, white_cd_m2, balance=neutral)
        return linear

    unit = fields[camera.channels.index(camera.unit_channel)]
    dark = unit.temporal_dark_e / unit.electrons_per_cd_m2 / white_cd_m2
    even_e = np.tile(unit.frame_e, (camera.sites,) * 2) * white_cd_m2

    def measure_range(rng: np.random.Generator) -> list[float]:
        seed = int(rng.integers(2**63))

        def shoot(level: float, frame: int) -> Plane:
            side = (EDGE_PX if level < 0.1 else RANGE_PX) * camera.sites
            chip, light = (np.random.default_rng((seed, number)) for number in (0, frame + 1))
            return luminance_of_srgb(_inner(developed(level * even_e[:side, :side], chip, light)))

        return [picture_range(shoot, dark)]

    def accuracy_at(lux: float, rng: np.random.Generator) -> float:
        side = EDGE_PX * camera.sites
        light_e = (lux * GREY / pi / white_cd_m2) * even_e[:side, :side]
        sides = np.repeat([1 + CONTRAST, 1 - CONTRAST], side // 2)
        luminance = luminance_of_srgb(developed(light_e * sides, rng, rng))
        bright, dark = (luminance[BORDER_PX:-BORDER_PX, columns] for columns in (BRIGHT_SIDE, DARK_SIDE))
        return pair_accuracy(bright, dark)

    # Noise, sharpness, texture and colour.
    words = (
        f"{processor}, {light}, {exposure_s * 1e3:.4g} ms, balanced as shot, white at {100 * WHITE_SHARE:.0f} % of the "
        "well; no closed form"
    )
    name = partial(_merit, words)
    yield Definition(
        (
            name(
                "snr_18", "developed: signal-to-noise ratio of 18 % grey", "dB", "like ISO 15739:2023, 6.3, luminance"
            ),
            name("visual_noise", "developed: visual noise of 18 % grey", "1", STANDARD),
        ),
        lambda rng: _noise(_inner(photograph(np.full((EDGE_PX * cells,) * 2, GREY), rng))),
    )
    yield Definition((name("dynamic_range", "developed: dynamic range", "dB", RANGE),), measure_range)
    e_sfr = "ISO 12233:2017, annex D (e-SFR)"
    edge = edge_reflectance(EDGE_PX * cells)
    yield Definition(
        (
            name("mtf50", "developed: MTF50", "cycles/px", e_sfr),
            name("mtf_half_nyquist", "developed: MTF at half the Nyquist frequency", "1", e_sfr),
            name("acutance", "developed: acutance", "1", "IEEE 1858 (CPIQ)"),
        ),
        lambda rng: _edge(luminance_of_srgb(_inner(photograph(edge, rng)))),
    )
    yield Definition(
        texture_merits("developed", "developed: texture ", f"{words}, disks of 1 to 24 pixels", [nan] * 3),
        lambda rng: _texture(lambda chart: photograph(chart, rng), draw_leaves(SIDE_PX, cells, rng)),
    )
    yield Definition(
        tuple(
            name(f"cta_{lux:g}_lux", f"developed: contrast transfer accuracy at {lux:g} lux", "1", ACCURACY)
            for lux in LUX
        ),
        lambda rng: [accuracy_at(lux, rng) for lux in LUX],
    )
    surfaces = np.array(
        [held(x).band_average(bands.wavelength_nm, bands.width_nm) for _, x in color_checker_reflectances()]
    )
    lab = true_lab(surfaces, bands)
    chart = _chart(surfaces, PATCH_PX * cells)
    yield Definition(
        (name("delta_e", "developed: mean CIEDE2000 of the 24 patches", "1", "CIE 142, of the patches' mean colours"),),
        lambda rng: [_difference(photograph(chart, rng), lab)],
    )


def _merit(words: str, name: str, title: str, unit: str, standard: str) -> Merit:
    return Merit(f"developed.{name}", title, unit, standard, words, nan)


def _inner(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    return picture[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]


def _noise(picture: NDArray[np.float64]) -> list[float]:
    luminance = luminance_of_srgb(picture)
    return [20 * log10(float(luminance.mean() / max(luminance.std(ddof=1), 1e-12))), visual_noise(picture)]


def _edge(luminance: Plane) -> list[float]:
    found = edge_response(luminance)
    shown = found.frequency_cycles_per_px, found.mtf
    return [found.mtf50_cycles_per_px, float(np.interp(0.25, *shown)), acutance(*shown)]


def _texture(photograph: Callable[[Plane], NDArray[np.float64]], chart: Plane) -> list[float]:
    return figures_of(texture_response(luminance_of_srgb(photograph(chart)), chart))


def _chart(surfaces: Floats, side: int) -> Floats:
    """Return a chart (h, w, band) of 5 x 5 even patches: the 24 surfaces and, last, a perfect white."""
    patches = np.vstack([surfaces, np.ones_like(surfaces[:1])]).reshape(ACROSS, ACROSS, -1)
    return np.asarray(patches.repeat(side, axis=0).repeat(side, axis=1))


def _difference(picture: NDArray[np.float64], lab: Floats) -> float:
    side = picture.shape[0] // ACROSS
    patches = picture.reshape(ACROSS, side, ACROSS, side, 3).swapaxes(1, 2)
    means = patches[:, :, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX].mean(axis=(2, 3)).reshape(-1, 3)[:-1]
    return float(deltaE_ciede2000(lab, xyz2lab(np.clip(means, 0.0, None) @ SRGB_TO_XYZ.T)).mean())
