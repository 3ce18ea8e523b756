"""How good the interleaved camera's pictures are, beside its opponents', and whether anything jumps over the light.

Run ``python benchmarks/bench_quality.py transitions``, ``... ranking``, ``... substitution`` or ``... settings``;
renders are kept in ``out/bench_quality``. Quality is against the noise-free truth at the known exposure scale, as in
the demo.

- transitions: quality over light in half octaves, at a fixed exposure and with auto exposure, and the deepest drop over
  one octave until the colours themselves saturate.
- ranking: every processor on the same scene, exposure, pixel and well, at light that gives Bayer's green a stated
  median SNR, and at Figure 6's conditions; the interleaved camera's lead over each with its 95 % interval (20 seeds for
  it and the paper's reference, 5 for the others, 3 for BM3D, which is slow). Where W's SNR is under 1: not ranked.
- substitution: Figure 6's decision, 20 seeds a scene and exposure.
- settings: sweep of patch, sigma_d and sigma_s that the defaults come from.
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from environment import print_environment
from numpy.typing import NDArray
from scipy.optimize import brentq

from isp.colour.colour_fit import ColourFit
from isp.picture import Picture
from isp.processors.catalogue import NAMED, PROCESSORS
from isp.settings import NEIGHBOURHOOD, Settings
from isp.substitution import SUBSTITUTION_SNR, SUBSTITUTION_SNR_TABLE1_PIXEL, substitution_weight
from render.engine import render
from rodcone.colour_spaces import encode_srgb
from rodcone.errors import InputError
from scenes.catalogue import load
from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.presets import preset, vary
from sensor.raw import RawImage
from sensor.response import expected_electrons
from studies.metrics.appearance import Quality, picture_quality
from studies.metrics.confidence import half_width
from studies.metrics.truth import Light, light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit, develop_to_scale

SIZE = 160
WAVELENGTH_NM = np.arange(390.0, 780.0, 20.0)
FIXED_S, LONGEST_S = 0.020, 0.066
OUT = Path("out/bench_quality")
SNR_DB = (-16.0, -8.0, 0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)  # of Bayer's green; the claim is on 0 to 15
FIGURE_6 = ((25.0, 0.005), (25.0, 0.010), (25.0, 0.020))  # cd/m^2 and s
THRESHOLDS = {"table1_output": SUBSTITUTION_SNR, "table1_pixel": SUBSTITUTION_SNR_TABLE1_PIXEL}
SEEDS = {
    "interleaved": 20,
    "bayer": 20,
    **{name: 3 for name, one in PROCESSORS.items() if one.extra == "bm3d"},
}  # 5: others
STAGES = ("transitions", "ranking", "substitution", "settings")
METRICS = (("PSNR", "psnr_db", 1), ("dE2000", "delta_e_median", -1))  # sign: which way is better


@dataclass(frozen=True)
class RenderedScene:
    """A rendered scene at a mean of 1 cd/m^2: its radiance, light, white and truth."""

    radiance: Any
    light: Light
    white_cd_m2: float
    truth: NDArray[np.float64]


@dataclass(frozen=True)
class ProcessorCamera:
    """A processor's camera with one chip; colours fitted under the stage's light."""

    name: str
    sensor: SensorConfig
    device: Device
    colours: ColourFit


@dataclass(frozen=True)
class MeasuredShot:
    """A photograph, its picture and its quality."""

    raw: RawImage
    picture: Picture
    encoded: NDArray[np.float64]
    quality: Quality


def open_stage(name: str, max_spp: int) -> RenderedScene:
    scene = load(name)
    transport = render(scene, (SIZE, SIZE), wavelength_nm=WAVELENGTH_NM, max_spp=max_spp, cache=OUT / "renders")
    spectrum = next(iter(scene.groups.values())).spectrum
    light = light_in_bands(spectrum, transport.wavelength_nm, transport.width_nm)
    radiance = transport.relight(luminance_cd_m2=1.0)
    white = shown_white_cd_m2(transport, 1.0)
    return RenderedScene(radiance, light, white, encode_srgb(true_srgb(radiance, light, white)))


class SceneAndSensor:
    """One scene and sensor: photographs at any level, exposure and seed; images formed once a camera."""

    def __init__(self, stage: RenderedScene, sensor: str) -> None:
        self.stage, self.sensor, self._images = stage, sensor, {}

    def camera(self, name: str, seed: int) -> ProcessorCamera:
        """ProcessorCamera with the chip of a seed."""
        sensor = vary(preset(self.sensor), NAMED[name].mosaic)
        device = draw_device(sensor, self.stage.truth.shape[:2], np.random.default_rng([seed, 0]))
        return ProcessorCamera(name, sensor, device, colour_fit(sensor, NAMED[name], self.stage.light))

    def exposed(
        self, camera: ProcessorCamera, level: float, exposure: float | str
    ) -> tuple[NDArray[np.float64], float]:
        """Expected electrons, and the exposure [s]; a channel: auto exposure by this channel."""
        if camera.name not in self._images:
            self._images[camera.name] = form_image(self.stage.radiance, camera.sensor)
        image = self._images[camera.name]
        lit = replace(image, values=image.values * level)
        if isinstance(exposure, str):
            exposure = auto_exposure_s(lit, camera.sensor, LONGEST_S, channel=exposure)
        return expected_electrons(lit, camera.sensor, exposure), exposure

    def shot(
        self, camera: ProcessorCamera, level: float, exposure: float | str, seed: int, **options: Any
    ) -> MeasuredShot:
        """One photograph, developed and measured; `options` are the processor's."""
        stage, processor = self.stage, NAMED[camera.name]
        electrons, seconds = self.exposed(camera, level, exposure)
        raw = expose(electrons, camera.sensor, seconds, camera.device, np.random.default_rng([seed, 1]), exact=True)
        white = stage.white_cd_m2 * level
        neutral = neutral_electrons(camera.sensor, stage.light, seconds)
        linear, picture = develop_to_scale(raw, processor, camera.colours, camera.sensor, neutral, white, **options)
        encoded = encode_srgb(linear)
        return MeasuredShot(raw, picture, encoded, picture_quality(encoded, stage.truth))

    def snr_db(self, name: str, channel: str, level: float, seconds: float) -> float:
        """Median SNR of a channel's pixels, in expectation: shot noise and dark noise."""
        camera = self.camera(name, 0)
        electrons, _ = self.exposed(camera, level, seconds)
        signal = electrons[mask(camera.sensor.cfa, channel, electrons.shape)]
        raw = expose(electrons, camera.sensor, seconds, camera.device, np.random.default_rng(0), exact=True)
        return float(20 * np.log10(np.median(signal / np.sqrt(signal + raw.dark_noise_e**2))))

    def level_of_snr(self, snr_db: float, seconds: float) -> float:
        """Light [cd/m^2] at which Bayer's green pixels have a median SNR."""
        exponent = brentq(lambda x: self.snr_db("bayer", "G", 10.0**x, seconds) - snr_db, -4.0, 5.0, xtol=1e-3)
        return float(10.0**exponent)


def transitions(bench: SceneAndSensor, seeds: int) -> dict[str, list[dict[str, float]]]:
    """Quality in half octaves of light, until 1 % of the colours' samples are saturated."""
    curves: dict[str, list[dict[str, float]]] = {}
    for name, exposure in ((f"{FIXED_S * 1e3:g} ms", FIXED_S), ("auto exposure", "G")):
        curves[name] = []
        for level in 2.0 ** np.arange(-10, 17, 0.5):
            shots = [bench.shot(bench.camera("interleaved", s), level, exposure, s) for s in range(seeds)]
            sites = [mask(shot.raw.cfa, "W", shot.raw.shape) for shot in shots]
            full = [
                (shot.raw.saturated[at].mean(), shot.raw.saturated[~at].mean())
                for shot, at in zip(shots, sites, strict=True)
            ]
            row = {
                "level": float(level),
                "psnr": float(np.mean([shot.quality.psnr_db for shot in shots])),
                "delta_e": float(np.mean([shot.quality.delta_e_median for shot in shots])),
                "substitution": float(np.mean([shot.picture.substitution for shot in shots])),
                "white_full": float(np.mean([w for w, _ in full])),
                "colours_full": float(np.mean([c for _, c in full])),
            }
            if row["colours_full"] > 0.01:
                break
            curves[name].append(row)
    return curves


def print_transitions(curves: dict[str, list[dict[str, float]]]) -> None:
    for name, rows in curves.items():
        print(f"\n{name}\n   cd/m2   PSNR  dE2000  W's share  W full")
        for row in rows:
            print("{level:8.4g} {psnr:6.2f} {delta_e:7.2f} {substitution:10.2f} {white_full:7.2f}".format(**row))
        drops = [(a["psnr"] - b["psnr"], b["level"]) for a, b in zip(rows, rows[2:], strict=False)]
        print("deepest drop over one octave: {:.2f} dB, up to {:.4g} cd/m2".format(*max(drops)))


def ranking(bench: SceneAndSensor, conditions: Iterable[tuple[float, float]], names: Sequence[str]) -> None:
    """Means over seeds of processors, the first interleaved; conditions are light [cd/m^2] and exposure time [s]."""
    for level, seconds in conditions:
        green, white = bench.snr_db("bayer", "G", level, seconds), bench.snr_db("interleaved", "W", level, seconds)
        print(f"\n{level:.4g} cd/m2, {seconds * 1e3:g} ms; median SNR: Bayer's G {green:.1f} dB, W {white:.1f} dB")
        found: dict[str, list[Quality]] = {}
        for name in names:
            try:
                shots = [
                    bench.shot(bench.camera(name, s), level, seconds, s).quality
                    for s in range(SEEDS.get(name.removesuffix("_published"), 5))
                ]
            except InputError as error:
                print(f"  {name}: {error}")
            else:
                found[name] = shots
                print_processor(name, shots, found["interleaved"])
        print(f"  {verdict(found, white)}", flush=True)


def print_processor(name: str, shots: Sequence[Quality], ours: Sequence[Quality]) -> None:
    """Print means, and the interleaved camera's lead over the same seeds."""
    psnr, delta_e, ssim = (np.mean([getattr(q, x) for q in shots]) for x in ("psnr_db", "delta_e_median", "ssim"))
    print(f"  {name:14s} {len(shots):2d} seeds {psnr:6.2f} dB  dE {delta_e:6.2f}  SSIM {ssim:.3f}", end="")
    if shots is not ours:
        for label, key, sign in METRICS:
            lead, half = lead_over(ours, shots, key, sign)
            print(f"  {label} {lead:+.2f} [{lead - half:+.2f}, {lead + half:+.2f}]", end="")
    print(flush=True)


def lead_over(ours: Sequence[Quality], others: Sequence[Quality], key: str, sign: int) -> tuple[float, float]:
    """How much better the interleaved camera is: mean over the seeds that both have, and half its 95 % interval."""
    leads = np.array([sign * (getattr(a, key) - getattr(b, key)) for a, b in zip(ours, others, strict=False)])
    return float(leads.mean()), float(half_width(leads))


def verdict(found: dict[str, list[Quality]], white_snr_db: float) -> str:
    """Who is ahead: the interleaved camera or the paper's reference, and the best of all."""
    if white_snr_db < 0:
        return "W's SNR is under 1: not ranked"
    said = []
    for label, key, sign in METRICS:
        lead, half = lead_over(found["interleaved"], found["bayer"], key, sign)
        word = "ahead of" if lead > half else "behind" if lead < -half else "level with"
        best = max(found, key=lambda name: sign * float(np.mean([getattr(q, key) for q in found[name]])))
        said.append(f"{label}: {word} the reference, best is {best}")
    return "; ".join(said)


def substitution(bench: SceneAndSensor) -> None:
    """Figure 6: 25 cd/m^2 at 5, 10 and 20 ms, each reading of Table 1 with its own threshold."""
    threshold = THRESHOLDS[bench.sensor]
    for level, seconds in FIGURE_6:
        snr = [bench.shot(bench.camera("interleaved", s), level, seconds, s).picture.snr for s in range(20)]
        on = sum(substitution_weight(each, threshold) > 0.5 for each in snr)
        print(
            f"  {seconds * 1e3:g} ms: on for {on} of 20 seeds; SNR {np.mean(snr):.3f} +- {np.std(snr):.3f},"
            f" threshold {threshold}",
            flush=True,
        )


def settings(bench: SceneAndSensor, levels: Sequence[float]) -> None:
    """Mean loss of PSNR against the best of the sweep at each level, and mean ratio of dE2000 to its best."""
    choices = [(p, d, s) for p in (1, 3, 5) for d in (3.0, 6.0, 10.0) for s in (2.0, 3.0, 4.0, 8.0, 16.0)]
    camera = bench.camera("interleaved", 0)
    found = np.zeros((len(levels), len(choices), 2))
    for level, row in zip(levels, found, strict=True):
        for j, (patch, sigma_d, sigma_s) in enumerate(choices):
            chosen = Settings(NEIGHBOURHOOD, patch, sigma_d, sigma_s)
            quality = bench.shot(camera, level, FIXED_S, 0, settings=chosen).quality
            row[j] = quality.psnr_db, quality.delta_e_median
    loss = (found[..., 0].max(axis=1, keepdims=True) - found[..., 0]).mean(axis=0)
    ratio = (found[..., 1] / found[..., 1].min(axis=1, keepdims=True)).mean(axis=0)
    print("patch sigma_d sigma_s  mean loss  dE2000 over its best")
    for j in np.argsort(loss)[:15]:
        patch, sigma_d, sigma_s = choices[j]
        print(f"{patch:5d} {sigma_d:7g} {sigma_s:7g} {loss[j]:7.2f} dB {ratio[j]:10.2f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=STAGES)
    parser.add_argument("--scene", nargs="*", default=["still_life", "color_checker"])
    parser.add_argument("--sensor", nargs="+", default=["low_noise", "table1_output"])
    parser.add_argument("--level", nargs="+", type=float, default=[0.0625, 0.25, 1.0, 4.0, 16.0, 64.0, 256.0])
    parser.add_argument("--snr", nargs="+", type=float, default=SNR_DB)
    parser.add_argument(
        "--opponent",
        nargs="*",
        choices=list(NAMED),
        default=[name for name in PROCESSORS if name not in ("interleaved", "bayer")],
    )
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print_environment()
    stages = {scene: lambda scene=scene: open_stage(scene, max_spp=768) for scene in options.scene}
    for scene, open_one in stages.items():
        stage = open_one()
        for sensor in options.sensor if options.what != "substitution" else THRESHOLDS:
            print(f"\n== {scene}, {sensor}", flush=True)
            bench = SceneAndSensor(stage, sensor)
            if options.what == "transitions":
                print_transitions(transitions(bench, options.seeds))
            elif options.what == "ranking":
                lit = [(bench.level_of_snr(snr, FIXED_S), FIXED_S) for snr in options.snr]
                ranking(bench, [*lit, *FIGURE_6], ["interleaved", "bayer", *options.opponent])
            elif options.what == "substitution":
                substitution(bench)
            else:
                settings(bench, options.level)


if __name__ == "__main__":
    main()
