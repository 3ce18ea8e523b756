"""The error budget's ledger: each approximation in electrons, and as a share of the sensor's own noise variance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape

from rodcone.display import brief
from sensor.presets import preset
from studies.budget.effects import KERNEL
from studies.budget.scaled_effects import ScaledEffects
from studies.study.model import ImageModel, RenderModel, samples_a_side
from studies.study.study import Condition, SceneChoice, label

MONTE_CARLO, LEVEL = "Monte Carlo", "level"
RESPONSE, LIGHT = "bands", "light within bands"
LEAST_SHOWN = 1e-3  # a term below this share of the noise variance isn't written out


@dataclass(frozen=True)
class Term:
    """One approximation's error: RMS over pixels below saturation [e-], and its square over the noise variance.

    If the effect is `modelled`, the term states the error that leaving it out would make; it isn't in the total.
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
        Exposure time, and the sensor's own noise: the root of its mean variance [e-].
    terms : tuple of Term
    rms_e, share : float
        Error of all terms together. The noise of the render and of its level is independent of the other errors, so its
        square is added. The other errors may have the same sign, so their RMS values are added: the RMS of a sum is at
        most that (Minkowski's inequality).
    """

    condition: Condition
    mosaic: str
    exposure_s: float
    noise_e: float
    terms: tuple[Term, ...]
    rms_e: float
    share: float


def ledger(effects: ScaledEffects, count: int, spp: int, left_out: frozenset[str]) -> Ledger:
    """List a model's errors: those of its bands, samples per pixel (0 for a picture file) and effects left out."""
    noise_e2 = effects.noise_variance
    monte_carlo = effects.monte_carlo(count, spp, left_out) if spp else 0.0
    level = effects.level / spp if spp else 0.0
    response, light = effects.bands[count]
    systematic = {RESPONSE: response, LIGHT: light, **effects.lens, KERNEL: effects.kernel}
    random = [Term(MONTE_CARLO, monte_carlo**0.5, monte_carlo / noise_e2), Term(LEVEL, level**0.5, level / noise_e2)]
    terms = []
    for name, rms_e in systematic.items():
        optional = name in effects.lens or name == KERNEL
        terms.append(Term(name, rms_e, rms_e**2 / noise_e2, modelled=optional and name not in left_out))
    square = monte_carlo + level + sum(term.rms_e for term in terms if not term.modelled) ** 2
    return Ledger(
        condition=effects.condition,
        mosaic=effects.mosaic,
        exposure_s=effects.exposure_s,
        noise_e=noise_e2**0.5,
        terms=(*random, *terms),
        rms_e=square**0.5,
        share=square / noise_e2,
    )


def ledger_html(ledgers: Sequence[Ledger]) -> str:
    """Return the table that a notebook shows: a row per condition and mosaic, a column per term."""
    names = term_names(ledgers)
    head = "".join(f"<th>{escape(name)}</th>" for name in ("condition", "noise, e-", "off, e-", "together", *names))
    cells = ([" ".join(condition_words(row)), *figures(row, names)] for row in ledgers)
    rows = ("".join(f"<td>{escape(text)}</td>" for text in line) for line in cells)
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in (head, *rows))}</table>"


def condition_words(row: Ledger) -> tuple[str, ...]:
    """Return the scene, spectrum, level, exposure, sensor and mosaic of a row as words."""
    of = row.condition
    return of.scene.label, label(of.spectrum), of.level, of.exposure, of.sensor, row.mosaic


def term_names(ledgers: Sequence[Ledger]) -> list[str]:
    """Return the names of all terms in order; a ledger may lack some that another one has."""
    longest_first = sorted(ledgers, key=lambda row: -len(row.terms))
    return list(dict.fromkeys(term.name for row in longest_first for term in row.terms))


def figures(row: Ledger, names: Sequence[str]) -> list[str]:
    """Return the noise and the error [e-], the error's share, and each term's share, in brackets if it is modelled."""
    shares = {x.name: f"({share_text(x.share)})" if x.modelled else share_text(x.share) for x in row.terms}
    return [f"{row.noise_e:.3g}", f"{row.rms_e:.3g}", share_text(row.share), *(shares.get(name, "") for name in names)]


def share_text(share: float) -> str:
    """Write a share as per cent, or as a factor if it is two or more."""
    if share >= 2:
        return f"{share:.1f}x" if share < 10 else f"{share:.0f}x"
    if share >= 0.1:
        return f"{100 * share:.0f}%"
    return f"{100 * share:.2g}%" if share >= LEAST_SHOWN else "0%" if share == 0 else f"<{100 * LEAST_SHOWN:g}%"


@dataclass(frozen=True)
class Plan:
    """Model of each of a study's scenes and pictures, with the error that it is predicted to add.

    Attributes
    ----------
    renders : mapping of SceneChoice to RenderModel
    images : mapping of Condition to ImageModel
    shares : mapping of Condition to float
        Share of the sensor's own noise variance that the model is predicted to add.
    ledgers : tuple of Ledger
        The parts of each share, for each condition and mosaic.
    summary : tuple of str
        A paragraph for each scene: what is left out, what that costs and what it saves.
    """

    renders: Mapping[SceneChoice, RenderModel]
    images: Mapping[Condition, ImageModel]
    shares: Mapping[Condition, float] = field(default_factory=dict)
    ledgers: tuple[Ledger, ...] = ()
    summary: tuple[str, ...] = ()

    __repr__ = brief

    def samples_a_side(self, scene: SceneChoice) -> int:
        """Return how many samples of a scene's light the lenses of its images need along each side of a pixel."""
        images = ((condition, image) for condition, image in self.images.items() if condition.scene == scene)
        sensors = (replace(preset(condition.sensor), lens=image.lens) for condition, image in images)
        return samples_a_side(str(scene.source), sensors)

    def _repr_html_(self) -> str:
        if not self.ledgers:
            return f"<p>Plan without a budget: renders {len(self.renders)}, images {len(self.images)}</p>"
        return ledger_html(self.ledgers) + "".join(f"<p>{escape(paragraph)}</p>" for paragraph in self.summary)
