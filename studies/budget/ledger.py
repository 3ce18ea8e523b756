"""The error budget's ledger: each approximation in electrons, and as a share of the sensor's own noise variance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.spectrum import fine_bands
from rodcone.display import brief
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.readings.resolve import resolve, unsaturated
from sensor.readout import light_variance
from studies.budget.terms import DIFFRACTION, Effects, Pair, kernel_rms_e
from studies.study.model import ImageModel, RenderModel, in_bands
from studies.study.study import OWN, Condition, SceneChoice, Study, conditions, label, most_spp

# Standard errors added to a mean over the pilot's pixels. Of noise a few pixels may hold most, here and in what is
# predicted: whatever its distribution, at most 5 % exceed the mean by root 19 standard deviations (Cantelli).
EFFECT_MARGIN, NOISE_MARGIN = 2.0, 19.0**0.5
MONTE_CARLO, LEVEL = "Monte Carlo", "level"
RESPONSE, LIGHT = "bands", "light within bands"
KERNEL = "kernel"
LEAST_SHOWN = 1e-3  # share of the noise variance, of what a text shows


@dataclass(frozen=True)
class Term:
    """One approximation's error: RMS over pixels below saturation [e-], and its square over the noise variance.

    A `modelled` term states what leaving it out would cost, and adds nothing to the total.
    """

    name: str
    rms_e: float
    share: float
    modelled: bool = False


@dataclass(frozen=True)
class Ledger:
    """Predicted error of the planned model of one condition and mosaic.

    Attributes
    ----------
    condition : Condition
    mosaic : str
    exposure_s, noise_e : float
        Time, and the sensor's own noise: root of its mean variance [e-].
    terms : tuple of Term
    rms_e, share : float
        All together. Noise of the render and of its level is independent of the others and adds in square; these can
        act alike, and the RMS of a sum is at most the sum of the RMS (Minkowski's inequality).
    """

    condition: Condition
    mosaic: str
    exposure_s: float
    noise_e: float
    terms: tuple[Term, ...]
    rms_e: float
    share: float


@dataclass(frozen=True)
class PilotNoise:
    """Noise of a pilot.

    Attributes
    ----------
    spp, half_spp : float
        Samples of the pilot, and of one of its halves.
    level : float
        Variance of the level over its square, of one sample a pixel and for as many pixels as the render has.
    """

    spp: float
    half_spp: float
    level: float


@dataclass(frozen=True)
class Weighed:
    """Errors of every choice that a plan has, for one condition and mosaic [e-].

    Attributes
    ----------
    noise_variance : float
        The sensor's own, mean over pixels below saturation [e-^2].
    blurred, sharp : float
        Monte Carlo variance of one sample a pixel, with diffraction and without.
    jitter : mapping of int to float
        The same of the wavelengths within bands, by number of bands.
    level : float
        Variance from the mean luminance that a level scales the picture by, of one sample a pixel [e-^2].
    bands : mapping of int to (float, float)
        By number of bands: response and light within them.
    lens : mapping of str to float
        Of leaving a term of the lens out.
    kernel : float
        Of the fast readout.
    """

    condition: Condition
    mosaic: str
    exposure_s: float
    noise_variance: float
    blurred: float
    sharp: float
    jitter: Mapping[int, float]
    level: float
    bands: Mapping[int, tuple[float, float]]
    lens: Mapping[str, float]
    kernel: float

    def monte_carlo(self, count: int, spp: int, left_out: frozenset[str]) -> float:
        """Monte Carlo variance of a model [e-^2]."""
        return ((self.sharp if DIFFRACTION in left_out else self.blurred) + self.jitter[count]) / spp


def weigh(
    condition: Condition,
    mosaic: str,
    sensor: SensorConfig,
    sensor_effects: Effects,
    level_cd_m2: float,
    exposure_s: float,
    pilot: PilotNoise,
) -> Weighed:
    """Scale a sensor's effects to a level and a time.

    Parameters
    ----------
    sensor_effects : Effects
        At 1 cd/m^2 and 1 s.
    pilot : PilotNoise
    """
    scale = level_cd_m2 * exposure_s
    # Beside a lamp a lens that is sampled once a pixel undershoots; a picture has no light there (`form_image`).
    expected_e = scale * np.maximum(sensor_effects.full.mean(axis=0), 0.0)
    readings = resolve(sensor, expected_e, exposure_s)
    below = unsaturated(expected_e, readings)
    # Where every pixel is saturated no error reaches the raw image: each is 0, of a variance of 1.
    noise_e2 = _mean(light_variance(expected_e, readings)[below]) or 1.0
    blurred, sharp = sensor_effects.blurred**2 * pilot.spp, sensor_effects.sharp**2 * pilot.spp
    # Wavelengths are stratified within a half; what light a path carries is independent of its wavelength. Both are of
    # light before diffraction, and a pixel without light has neither noise nor jitter.
    signal = (sensor_effects.full + sensor_effects.lens.get(DIFFRACTION, 0.0)).mean(axis=0)
    relative = np.divide(sharp.mean(axis=0), signal**2, out=np.zeros_like(signal), where=signal > 0)
    spread = relative + 1 / pilot.half_spp
    return Weighed(
        condition=condition,
        mosaic=mosaic,
        exposure_s=exposure_s,
        noise_variance=noise_e2,
        blurred=scale**2 * _upper(blurred[:, below], NOISE_MARGIN),
        sharp=scale**2 * _upper(sharp[:, below], NOISE_MARGIN),
        jitter={
            n: scale**2 * _upper((errors.jitter * spread)[below], NOISE_MARGIN)
            for n, errors in sensor_effects.bands.items()
        },
        level=_mean(expected_e[below] ** 2) * pilot.level,
        bands={
            n: (scale * _rms(b.response, below), scale * _rms(b.light, below)) for n, b in sensor_effects.bands.items()
        },
        lens={name: scale * _rms(pair, below) for name, pair in sensor_effects.lens.items()},
        kernel=float(np.sqrt(_mean(kernel_rms_e(expected_e, max(sensor_effects.bands))[below] ** 2))),
    )


def ledger(weighed: Weighed, count: int, spp: int, left_out: frozenset[str]) -> Ledger:
    """Ledger of one model: its number of bands, samples (0 for a picture file), terms of lens and kernel left out."""
    noise_e2 = weighed.noise_variance
    monte_carlo = weighed.monte_carlo(count, spp, left_out) if spp else 0.0
    level = weighed.level / spp if spp else 0.0
    response, light = weighed.bands[count]
    systematic = {RESPONSE: response, LIGHT: light, **weighed.lens, KERNEL: weighed.kernel}
    random = [Term(MONTE_CARLO, monte_carlo**0.5, monte_carlo / noise_e2), Term(LEVEL, level**0.5, level / noise_e2)]
    terms = []
    for name, rms_e in systematic.items():
        optional = name in weighed.lens or name == KERNEL
        terms.append(Term(name, rms_e, rms_e**2 / noise_e2, modelled=optional and name not in left_out))
    square = monte_carlo + level + sum(term.rms_e for term in terms if not term.modelled) ** 2
    return Ledger(
        condition=weighed.condition,
        mosaic=weighed.mosaic,
        exposure_s=weighed.exposure_s,
        noise_e=noise_e2**0.5,
        terms=(*random, *terms),
        rms_e=square**0.5,
        share=square / noise_e2,
    )


def _rms(pair: Pair, below: NDArray[np.bool_]) -> float:
    """Root of the mean product of an effect's two estimates, with a margin for how few pixels there are."""
    return float(np.sqrt(max(_upper((pair[0] * pair[1])[below], EFFECT_MARGIN), 0.0)))


def _upper(values: NDArray[np.float64], margin: float) -> float:
    """Mean over pixels (last axis) and so many standard errors of it; 0 without pixels."""
    return float(values.mean() + margin * values.std() / np.sqrt(values.shape[-1])) if values.size else 0.0


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else 0.0


def ledger_html(ledgers: Sequence[Ledger]) -> str:
    """Table for a notebook: a row a condition and mosaic, a column a term."""
    names = term_names(ledgers)
    head = "".join(f"<th>{escape(name)}</th>" for name in ("condition", "noise, e-", "off, e-", "together", *names))
    cells = ([" ".join(condition_words(row)), *figures(row, names)] for row in ledgers)
    rows = ("".join(f"<td>{escape(text)}</td>" for text in line) for line in cells)
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in (head, *rows))}</table>"


def condition_words(row: Ledger) -> tuple[str, ...]:
    """Scene, spectrum, level, exposure, sensor and mosaic of a row."""
    of = row.condition
    return of.scene.label, label(of.spectrum), of.level, of.exposure, of.sensor, row.mosaic


def term_names(ledgers: Sequence[Ledger]) -> list[str]:
    """Names of all terms: a picture file has no falloff."""
    longest_first = sorted(ledgers, key=lambda row: -len(row.terms))
    return list(dict.fromkeys(term.name for row in longest_first for term in row.terms))


def figures(row: Ledger, names: Sequence[str]) -> list[str]:
    """Noise and error [e-], the error's share, and the share of each term, in brackets where it is modelled."""
    shares = {x.name: f"({percent(x.share)})" if x.modelled else percent(x.share) for x in row.terms}
    return [f"{row.noise_e:.3g}", f"{row.rms_e:.3g}", percent(row.share), *(shares.get(name, "") for name in names)]


def percent(share: float) -> str:
    """Share as per cent, from twice on as a factor."""
    if share >= 2:
        return f"{share:.1f}x" if share < 10 else f"{share:.0f}x"
    if share >= 0.1:
        return f"{100 * share:.0f}%"
    return f"{100 * share:.2g}%" if share >= LEAST_SHOWN else "0%" if share == 0 else f"<{100 * LEAST_SHOWN:g}%"


@dataclass(frozen=True)
class Plan:
    """Models of a study's scenes and conditions, and the share of the noise variance that each is predicted to add.

    `ledgers` holds what that is made of, a row a condition and mosaic.
    """

    renders: Mapping[SceneChoice, RenderModel]
    images: Mapping[Condition, ImageModel]
    shares: Mapping[Condition, float] = field(default_factory=dict)
    ledgers: tuple[Ledger, ...] = ()

    __repr__ = brief

    def _repr_html_(self) -> str:
        if not self.ledgers:
            return f"<p>Plan without a budget: renders {len(self.renders)}, images {len(self.images)}</p>"
        return ledger_html(self.ledgers)


def as_stated(study: Study) -> Plan:
    """Plan without a budget: bands and samples as the study states, lenses as the study and its sensors state."""
    renders = {}
    for scene in study.scenes:
        lights = (illuminant(name) for name in (*study.spectra, scene.light) if name not in (OWN, None))
        bands = fine_bands(lights, study.render.range_nm, study.render.band_nm)
        renders[scene] = in_bands(bands, most_spp(study, scene), study.render.denoise)
    lenses = {name: study.lens.on(preset(name).lens) for name in study.sensors}
    images = {condition: ImageModel(lenses[condition.sensor]) for condition in conditions(study)}
    return Plan(renders=renders, images=images)
