"""Draw the figures of the pages of docs/understand and of docs/budget.md: `python docs/make/understand.py [NAME ...]`.

Each figure is computed by rodcone from what its page says. Curves are written as SVG, pictures as WebP.
"""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

import rodcone
from isp.colour.encoding import encode
from isp.interleaved.panchromatic import read_as_white
from render.illuminants import illuminant
from render.spectrum import photons_per_joule
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.exposure import LONGEST_S, exposure_by_rule_s, picture_error
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.readout import noise_sources
from sensor.response import expected_electrons
from studies.metrics.truth import light_in_bands, neutral_electrons
from studies.pages.plots import svg_text
from studies.study.render_noise import render_share

OUT = Path(__file__).resolve().parents[1] / "images" / "understand"
COLOURS = {"R": "#c0392b", "G": "#2e8b57", "B": "#2c6fbb", "W": "#666666"}
LIGHTS = ("D65", "A", "LED-B3", "sodium_high")
LEVELS = (0.05, 5.0, 1000.0)  # cd/m2
CROP = slice(216, 280), slice(204, 268)  # star and chart of still_life at 512 px
ZOOM = 4


def figure(height: float = 3.0) -> tuple[Figure, list[Axes]]:
    """Return a figure of two axes with light grids."""
    drawing = Figure(figsize=(8, height), layout="constrained")
    axes = list(drawing.subplots(1, 2))
    for each in axes:
        each.grid(alpha=0.3)
    return drawing, axes


def light() -> None:
    """Draw photons over wavelength, of one lux by four lamps, and photons on a pixel by light level."""
    drawing, (left, right) = figure()
    nm = np.arange(382.0, 779.0, 2.0)
    for name in LIGHTS:
        spectrum = illuminant(name).band_average(nm, np.full(nm.shape, 2.0))  # of 1 cd/m2
        left.plot(
            nm, spectrum * photons_per_joule(nm) * np.pi * 1e-12, label=name
        )  # 1 lux on a white wall is 1/pi cd/m2
    left.set(xlabel="wavelength [nm]", ylabel="photons / (s µm² nm)", title="From a surface of 1 cd/m²", ylim=(0, None))
    left.legend()
    sensor = rodcone.low_noise()
    levels = np.logspace(-2, 4, 50)
    bands, widths = np.arange(385.0, 780.0, 10.0), np.full(40, 10.0)
    for channel in sensor.channels:
        right.loglog(
            levels, levels * electrons(sensor, channel, bands, widths, 0.02), color=COLOURS[channel], label=channel
        )
    right.set(
        xlabel="luminance of a white surface [cd/m²]", ylabel="electrons in 20 ms", title="Behind each filter, D65"
    )
    right.axhline(sensor.pixel.full_well_e, color="black", linestyle=":")
    right.annotate("full well", (levels[0], sensor.pixel.full_well_e), xytext=(0, 3), textcoords="offset points")
    right.legend()
    write("light", drawing)


def electrons(sensor: SensorConfig, channel: str, nm: np.ndarray, width_nm: np.ndarray, time_s: float) -> float:
    """Return electrons of a channel from a surface of 1 cd/m2 under D65."""
    light = light_in_bands(illuminant("D65"), nm, width_nm)
    return float(neutral_electrons(sensor, light, time_s)[sensor.channels.index(channel)])


def sensor() -> None:
    """Draw the responses of the project's curves, and the transfer from electrons to digital numbers."""
    drawing, (left, right) = figure()
    camera = rodcone.low_noise()
    nm = np.arange(382.0, 779.0, 2.0)
    for channel in camera.channels:
        curve = camera.responses.curves[channel]
        left.plot(nm, curve.band_average(nm, np.full(nm.shape, 2.0)), color=COLOURS[channel], label=channel)
    left.set(
        xlabel="wavelength [nm]", ylabel="electrons / photon", title="Filter and silicon of low_noise", ylim=(0, 1)
    )
    left.legend()
    expected = np.linspace(0.0, 1.3 * camera.pixel.full_well_e, 400)
    dn = np.clip(
        np.rint(np.minimum(expected, camera.pixel.full_well_e) / camera.gain_e_per_dn + camera.black_dn),
        0,
        2**camera.bits - 1,
    )
    right.plot(expected, dn, color="black")
    right.set(xlabel="expected electrons", ylabel="digital number [DN]", title="Linear up to the full well")
    write("sensor", drawing)


def noise() -> None:
    """Draw each source of a pixel's noise over its signal, and the SNR that they leave."""
    drawing, (left, right) = figure(3.4)
    camera = rodcone.low_noise()
    levels = np.logspace(-1, np.log10(camera.pixel.full_well_e), 60)
    sources = [noise_sources(float(level), camera, 0.066) for level in levels]
    for name in sources[0]:
        values = np.array([each[name] for each in sources])
        if values.max() > 0:
            left.loglog(levels, values, label=name)
    total = np.sqrt([sum(value**2 for value in each.values()) for each in sources])
    left.loglog(levels, total, color="black", linewidth=2, label="all together")
    left.set(xlabel="signal [e⁻]", ylabel="standard deviation [e⁻]", title="low_noise, 66 ms", ylim=(0.05, None))
    left.legend(fontsize=7)
    right.semilogx(levels, 20 * np.log10(levels / total), color="black", label="low_noise")
    right.semilogx(levels, 10 * np.log10(levels), color="grey", linestyle=":", label="shot noise alone")
    right.set(xlabel="signal [e⁻]", ylabel="SNR [dB]", title="Signal over noise")
    right.legend()
    write("noise", drawing)


def exposure() -> None:
    """Draw the expected error of a picture over its exposure time, at three levels, with the time of each rule."""
    drawing, (left, right) = figure()
    camera = rodcone.low_noise()
    transport = rodcone.load_transport("still_life", size=256)
    times = np.logspace(-4, 0, 60)
    for level, colour in zip((0.5, 25.0, 1000.0), ("#2c6fbb", "#2e8b57", "#c0392b"), strict=True):
        irradiance = form_image(transport.relight(luminance_cd_m2=level), camera)
        unit = expected_electrons(irradiance, camera, 1.0)
        errors = [10 * np.log10(picture_error(unit * time, camera, float(time))) for time in times]
        left.semilogx(1e3 * times, errors, color=colour, label=f"{level:g} cd/m²")
        for rule, marker in (("auto", "o"), ("auto:W", "s"), ("auto:information", "D")):
            chosen = exposure_by_rule_s(rule, irradiance, camera, 10.0)
            error = 10 * np.log10(picture_error(unit * chosen, camera, chosen))
            left.plot(
                1e3 * chosen,
                error,
                marker,
                color=colour,
                markerfacecolor="white" if rule != "auto:information" else colour,
            )
        full = [(unit * time > camera.pixel.full_well_e).mean() for time in times]
        right.semilogx(1e3 * times, 100 * np.array(full), color=colour)
    left.axvline(1e3 * LONGEST_S, color="grey", linestyle=":")
    left.annotate("66 ms", (1e3 * LONGEST_S, -20), xytext=(3, 0), textcoords="offset points", fontsize=8)
    left.set(
        xlim=(0.08, 1500),
        xlabel="exposure time [ms]",
        ylabel="expected error [dB]",
        title="○ auto   □ auto:W   ◆ auto:information",
    )
    left.legend()
    right.set(xlabel="exposure time [ms]", ylabel="full pixels [%]", title="Pixels that the well cuts")
    write("exposure", drawing)


def budget() -> None:
    """Draw a render's noise as a share of the sensor's over the samples, at three levels of light."""
    drawing = Figure(figsize=(5.5, 3.2), layout="constrained")
    axes = drawing.subplots()
    axes.grid(alpha=0.3)
    camera = rodcone.low_noise()
    transport = rodcone.render("still_life", (64, 64), spp=256)
    samples = np.logspace(4, 14, 40, base=2)
    for level in LEVELS:
        share = render_share(transport, camera, level, LONGEST_S)
        axes.loglog(samples, 100 * share * transport.spp / samples, label=f"{level:g} cd/m²")
    axes.axhline(3, color="grey", linestyle=":")
    axes.annotate("3 %, the default budget", (samples[0], 3), xytext=(2, 3), textcoords="offset points", fontsize=8)
    axes.set(xlabel="samples per pixel", ylabel="share of the sensor's noise [%]", title="still_life, 64 × 64 pixels")
    axes.legend()
    write("budget", drawing)


def interleaved() -> None:
    """Show a crop as samples, guide, averaging weights of one pixel, and reconstruction."""
    raw = captured("rgbw", 5.0)
    guide = read_as_white(raw, neutral()).guide[CROP]
    shown = (guide - guide.min()) / np.ptp(guide)
    at = 34, 22
    difference = guide - guide[at]
    rows, columns = np.indices(guide.shape)
    distance2 = (rows - at[0]) ** 2 + (columns - at[1]) ** 2
    weights = np.exp(-distance2 / (2 * 6.0**2) - difference**2 / (2 * 3.0**2))
    weights[np.maximum(abs(rows - at[0]), abs(columns - at[1])) > 10] = 0
    panels(
        "interleaved",
        {
            "samples": samples(raw),
            "guide": np.repeat(shown[..., None], 3, axis=2),
            "weights of one pixel": np.repeat(weights[..., None], 3, axis=2),
            "interleaved": picture(raw, "interleaved"),
            "truth": truth(5.0),
        },
    )


def ple() -> None:
    """Show a crop as samples, by bilinear interpolation, by `ple`, and the truth."""
    raw = captured("bayer", 0.5)
    white = captured("rgbw", 0.5)
    panels(
        "ple",
        {
            "Bayer's samples": samples(raw),
            "bilinear": picture(raw, "bayer_bilinear"),
            "ple, Bayer": picture(raw, "ple_bayer"),
            "ple, RGBW": picture(white, "ple_rgbw"),
            "truth": truth(0.5),
        },
    )


def captured(mosaic: str, level: float) -> RawImage:
    """Return `still_life` at a level by a mosaic."""
    radiance = rodcone.load_transport("still_life").relight(luminance_cd_m2=level)
    return rodcone.capture(radiance, rodcone.low_noise(cfa=mosaic), "66ms", rng=np.random.default_rng(0))


def neutral() -> np.ndarray:
    """Return the response of `low_noise` to a neutral under D65."""
    bands, widths = np.arange(385.0, 780.0, 10.0), np.full(40, 10.0)
    camera = rodcone.low_noise()
    return np.array([electrons(camera, name, bands, widths, 0.02) for name in camera.channels])


def samples(raw: RawImage) -> np.ndarray:
    """Return a crop of a mosaic, each sample in its filter's colour."""
    light = raw.electrons
    shown = np.zeros((*light.shape, 3))
    for channel, colour in {"R": (1, 0, 0), "G": (0, 1, 0), "B": (0, 0, 1), "W": (1, 1, 1)}.items():
        if channel in raw.channels:
            at = mask(raw.cfa, channel, light.shape)
            bright = np.clip(light / np.percentile(light[at], 99), 0, 1) ** (1 / 2.2)
            shown[at] = bright[at, None] * np.array(colour)
    return shown[CROP]


def picture(raw: RawImage, processor: str) -> np.ndarray:
    """Return a crop of a developed picture."""
    return np.clip(rodcone.develop(raw, processor=processor).encode(), 0, 1)[CROP]


def truth(level: float) -> np.ndarray:
    """Return the same crop of the noise-free picture."""
    radiance = rodcone.load_transport("still_life").relight(luminance_cd_m2=level)
    return encode(rodcone.reference_picture(radiance).linear, "srgb")[CROP]


def panels(name: str, crops: Mapping[str, np.ndarray]) -> None:
    """Write crops side by side, enlarged, each under its name."""
    side = ZOOM * next(iter(crops.values())).shape[0]
    gap, head = 8, 22
    page = Image.new("RGB", (len(crops) * (side + gap) - gap, side + head), "white")
    for place, (title, crop) in enumerate(crops.items()):
        tile = Image.fromarray(np.rint(255 * crop).astype(np.uint8)).resize((side, side), Image.Resampling.NEAREST)
        page.paste(tile, (place * (side + gap), head))
        ImageDraw.Draw(page).text((place * (side + gap) + 2, 3), title, fill="black", font_size=14)
    page.save(OUT / f"{name}.webp", quality=85, method=6)


def write(name: str, drawing: Figure) -> None:
    """Write a figure as SVG."""
    (OUT / f"{name}.svg").write_text(svg_text(drawing), "utf-8")


FIGURES: Mapping[str, Callable[[], None]] = {
    each.__name__: each for each in (light, sensor, noise, exposure, budget, interleaved, ple)
}

if __name__ == "__main__":
    OUT.mkdir(parents=True, exist_ok=True)
    for chosen in sys.argv[1:] or FIGURES:
        FIGURES[chosen]()
