"""Filters of the least expected error for a tile, by the slope of the closed form."""

from dataclasses import replace

import numpy as np
from design_search import BEHIND, Goal, camera_db
from design_slope import error_slopes
from scipy.optimize import minimize

from isp.design.expected_error import Noise
from isp.design.spectral_prior import load_spectral_prior
from render.spectrum import Spectrum
from rodcone.progress import Step
from rodcone.types import Floats
from sensor.cfa import Tile, channels
from sensor.config import SensorConfig, with_tile
from sensor.curves import Responses
from sensor.optics import camera_equation
from sensor.presets import vary
from sensor.response import electrons_per_irradiance
from studies.design.expect import MIDDLE, LitPrior, drawn_pixels, exposed, metric_rows, sites_of, spread_of, view_of

STEP_NM = 20.0  # between the bumps that a filter's transmittance is made of, and their standard deviation


def unit_response_e(sensor: SensorConfig, view: LitPrior) -> Floats:
    """Electrons of a pixel of response 1 in each band, as `responses_e` has them; shape (band, coefficient)."""
    light, ones = view.light, Spectrum(np.array([300.0, 1100.0]), np.ones(2))
    even = replace(sensor, cfa=("W",), responses=Responses({"W": ones})).undivided
    weights = electrons_per_irradiance(even, light.wavelength_nm, light.width_nm, 1.0)[0]
    return np.asarray((weights * light.spectrum)[:, None] * view.basis * camera_equation(sensor.lens))


def best_filters(goal: Goal, given: SensorConfig, tile: Tile, progress: Step) -> SensorConfig:
    """Sensor of a tile whose filters pass what makes the score best; W stays clear.

    A filter's transmittance is the logistic function of a sum of bumps, times the clear pixel's response. Exposures
    follow the goal's rule between rounds of L-BFGS; within one they stand still, so that the slope is the whole slope.

    Parameters
    ----------
    goal : Goal
    given : SensorConfig
        The search begins with its responses; W's is that of a clear pixel.
    tile : tuple of str
    progress : callable
        Called with the score and the share that is done.
    """
    # What all rounds share.
    prior, seen, names = load_spectral_prior(goal.prior), view_of(goal.prior, goal.light), channels(tile)
    reference_db = camera_db(goal, vary(given, goal.never_worse_than))
    places = sites_of(tile)
    spread = spread_of(given.pixel.crosstalk)
    rows = [[every[metric] for metric in (0, 1, 3)] for every in
            (metric_rows(prior, seen, mean) for mean in prior.reflectances)]  # fmt: skip
    whites_cd_m2 = np.array(list(goal.levels.values())) / prior.reflectances.mean()
    # Electrons of a channel from each coefficient: transmittance times `clear_e`, which has the clear pixel's response.
    nm = seen.light.wavelength_nm
    curves = {name: np.interp(nm, curve.wavelength_nm, curve.values) for name, curve in given.responses.curves.items()}
    clear_e = curves["W"][:, None] * unit_response_e(given, seen)
    bumps = np.exp(-(((nm[:, None] - np.arange(nm[0], nm[-1] + STEP_NM, STEP_NM)) / STEP_NM) ** 2) / 2)
    free = np.array([name != "W" for name in names])

    def transmittances(logits: Floats) -> Floats:
        result = np.ones((len(names), len(nm)))
        result[free] = 1 / (1 + np.exp(-logits.reshape(-1, bumps.shape[1]) @ bumps.T))
        return result

    def sensor_of(logits: Floats) -> SensorConfig:
        passed = transmittances(logits) * curves["W"]
        responses = {name: Spectrum(nm, values) for name, values in zip(names, passed, strict=True)}
        return with_tile(given, tile, Responses(responses, given.responses.relative))

    def cost(logits: Floats, at: list[tuple[float, Noise]]) -> tuple[float, Floats]:
        """Score with the other sign, and its slope."""
        shares = transmittances(logits)
        sampling = spread[..., None] * (shares @ clear_e)[places]
        # At full exposure more light changes nothing.
        first = [[light for light, _ in at].index(light) for light, _ in at]
        lights = [(prior.reflectances * at[index][0], at[index][1]) for index in sorted(set(first))]
        errors, slopes = error_slopes(prior.patches, sampling, MIDDLE, lights, rows)
        level = np.searchsorted(sorted(set(first)), first)
        gains_db = -10 * np.log10(errors[level].T) - reference_db
        by_sample = -10 / np.log(10) * (slopes / errors[..., None, None, None])[level].swapaxes(0, 1)
        weights = 2 * BEHIND * goal.beyond(gains_db)
        weights[0] += goal.shares
        by_sample = np.tensordot(weights, by_sample, 2)
        by_pixel = np.einsum("st,stc->tc", spread, by_sample)
        by_response = np.stack([by_pixel[places == index].sum(axis=0) for index in range(len(names))])
        by_logit = (by_response @ clear_e.T * shares * (1 - shares))[free] @ bumps
        return -goal.score(gains_db), -by_logit.ravel()

    # Rounds: exposures by the rule, then filters for these exposures.
    start = np.clip(np.stack([curves[name] for name in names])[free] / curves["W"], 0.003, 0.997)
    logits = np.linalg.lstsq(bumps, np.log(start / (1 - start)).T, rcond=1e-6)[0].T.ravel()
    best = (np.inf, logits)
    for number in range(goal.rounds + 1):
        sensor = sensor_of(logits)
        frame_e = np.maximum(drawn_pixels(goal.prior) @ (transmittances(logits) @ clear_e).T, 0.0)
        exposures = [exposed(sensor, frame_e * white_cd_m2, goal.time_s) for white_cd_m2 in whites_cd_m2]
        at = [(round(white * time_s, 9), noise) for white, (time_s, noise) in zip(whites_cd_m2, exposures, strict=True)]
        best = min(best, (cost(logits, at)[0], logits), key=lambda pair: pair[0])
        progress(f"filters {-best[0]:+.2f} dB", number / (goal.rounds + 1))
        if number < goal.rounds:
            logits = minimize(cost, logits, (at,), "L-BFGS-B", jac=True, options={"maxiter": 8}).x
    return sensor_of(best[1])
