"""Where RGBW's lead over Bayer by day comes from: `benchmarks/daylight_lead.py PICTURE ...`, six seconds a row.

Photographs as scenes, 128 pixels, D65, 100 cd/m2, `low_noise`, `ple` on both mosaics, balance given, PSNR of encoded,
clipped sRGB. Each row changes one thing of the two cameras:

    as exposed      both by `auto:information`, 66 ms at most
    auto:W          RGBW by `auto:W`; Bayer as above
    1.5 auto:W      RGBW half as long again
    endless well    no sample is full, and RGBW takes Bayer's time: what W's well costs is left out
    no noise        a thousandfold time, a well for it, no fixed pattern: sampling and processing are left

The last columns hold the share of W's sites that are full, and the times. Both mosaics have one matrix of colours, of
R, G and B alone. Give pictures that judge nothing.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from isp.processors.catalogue import NAMED
from render.illuminants import illuminant
from rodcone.colour_spaces import decode_srgb, encode_srgb
from sensor.cfa import channel_map
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.exposure import exposed_by_rule
from sensor.optics import form_image
from sensor.presets import preset
from sensor.response import channel_electrons
from studies.explore.source import load_transport
from studies.metrics.truth import light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import capture, colour_fit, develop_to_scale

LEVEL_CD_M2, LONGEST_S, SIDE = 100.0, 0.066, 128
PLE = NAMED["ple"]


def endless(sensor: SensorConfig) -> SensorConfig:
    """Return the camera with a well and a converter that nothing fills."""
    return replace(sensor, bits=16, pixel=replace(sensor.pixel, full_well_e=20 * sensor.pixel.full_well_e))


def noiseless(sensor: SensorConfig) -> SensorConfig:
    """Return the camera without a fixed pattern, of a well for a thousand times the light."""
    return replace(sensor, bits=16, pixel=replace(sensor.pixel, prnu=0.0, dsnu_e=0.0, full_well_e=3e8))


def _square(path: str, to: str) -> str:
    """Write the central square of a picture, its light averaged to `SIDE` pixels, and return its path."""
    picture = decode_srgb(np.asarray(Image.open(path).convert("RGB")) / 255)
    count = min(picture.shape[:2]) // SIDE
    top, left = ((length - count * SIDE) // 2 for length in picture.shape[:2])
    part = picture[top : top + count * SIDE, left : left + count * SIDE].reshape(SIDE, count, SIDE, count, 3)
    Image.fromarray(np.rint(255 * encode_srgb(part.mean(axis=(1, 3)))).astype(np.uint8)).save(to)
    return to


def rows(path: str) -> Iterator[tuple[str, float, float, float, float, float]]:
    """Yield each row of a picture: PSNR by RGBW and by Bayer [dB], full share of W, both times [s]."""
    with TemporaryDirectory() as folder:
        transport = load_transport(_square(path, f"{folder}/square.png"))
    radiance = transport.relight(luminance_cd_m2=LEVEL_CD_M2)
    light = light_in_bands(illuminant("D65"), radiance.wavelength_nm, radiance.widths_nm)
    white_cd_m2 = shown_white_cd_m2(transport, LEVEL_CD_M2)
    truth = encode_srgb(np.clip(true_srgb(radiance, light, white_cd_m2), 0, 1))

    def time_of(rule: str, sensor: SensorConfig) -> float:
        return exposed_by_rule(rule, channel_electrons(form_image(radiance, sensor), sensor, 1.0), sensor, LONGEST_S)[0]

    def psnr_db(linear: np.ndarray) -> float:
        return -10 * float(np.log10(np.mean((encode_srgb(np.clip(linear, 0, 1)) - truth) ** 2)))

    def taken(sensor: SensorConfig, time_s: float) -> tuple[float, float]:
        rng = np.random.default_rng(1)
        device = draw_device(sensor, radiance.values.shape[:2], rng)
        raw = capture(radiance, sensor, time_s, device, rng)
        neutral = neutral_electrons(sensor, light, time_s)
        fit = colour_fit(sensor, PLE, light)
        linear, _ = develop_to_scale(raw, PLE, fit, sensor, neutral, white_cd_m2, balance=neutral)
        white = channel_map(raw.cfa, raw.shape) == "W"
        return psnr_db(linear), float(raw.saturated[white].mean()) if white.any() else 0.0

    rgbw, bayer = preset("low_noise", "rgbw"), preset("low_noise", "bayer")
    bayer_s = time_of("auto:information", bayer)
    bayer_db = taken(bayer, bayer_s)[0]
    white_s = time_of("auto:W", rgbw)
    times_s = {"as exposed": time_of("auto:information", rgbw), "auto:W": white_s, "1.5 auto:W": 1.5 * white_s}
    for name, time_s in times_s.items():
        found, full = taken(rgbw, min(time_s, LONGEST_S))
        yield name, found, bayer_db, full, time_s, bayer_s
    for name, change, time_s in (("endless well", endless, bayer_s), ("no noise", noiseless, 1000 * bayer_s)):
        (found, full), (beside, _) = (taken(change(x), time_s) for x in (rgbw, bayer))
        yield name, found, beside, full, time_s, time_s


def main(paths: list[str]) -> None:
    found: dict[str, list[float]] = {}
    print(f"{'':14s}{'':16s}{'RGBW':>8s}{'Bayer':>8s}{'lead':>8s}{'W full':>8s}{'RGBW':>10s}{'Bayer':>10s}")
    for path in paths:
        for name, rgbw, bayer, full, time_s, bayer_s in rows(path):
            print(f"{path.split('/')[-1][:13]:14s}{name:16s}{rgbw:8.2f}{bayer:8.2f}{rgbw - bayer:+8.2f}{full:8.1%}"
                  f"{1e3 * time_s:8.1f}ms{1e3 * bayer_s:8.1f}ms", flush=True)  # fmt: skip
            found.setdefault(name, []).append(rgbw - bayer)
    print("mean lead: " + ", ".join(f"{name} {np.mean(values):+.2f}" for name, values in found.items()))


if __name__ == "__main__":
    main(sys.argv[1:])
