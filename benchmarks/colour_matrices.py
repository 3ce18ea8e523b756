"""How far the best 3x3 matrix of a camera is from a 3x4 one and from root-polynomial terms.

    python benchmarks/colour_matrices.py

Surfaces are the ColorChecker, on which cameras are calibrated here, and the 99 test colours of CIE 224:2017, chosen to
stand for 105 000 measured objects. What is fitted on the 99 is judged on tenths that the fit hasn't seen. Each line
states mean and 95th percentile of CIEDE2000, and the noise of the developed grey [standard deviation over that of the
first line]: shot noise of balanced channels through the slopes of the map at grey.

Root-polynomial terms are those of degree 2 of Finlayson, Mackiewicz & Hurlbert (2015): the channels and the roots of
their products, which scale with exposure. All maps keep a neutral neutral.
"""

from collections.abc import Callable, Sequence
from itertools import combinations

import colour
import numpy as np
from colour.colorimetry import SpectralShape
from colour.quality.cfi2017 import load_TCS_CIE2017
from scipy.optimize import minimize

from isp.colour.colour_fit import fit_through_neutral, training
from render.illuminants import illuminant
from render.spectrum import photons_per_joule
from rodcone.colour_spaces import xyz_to_srgb
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances
from sensor.presets import low_noise

NM = np.arange(380.0, 781.0, 5.0)
PARTS = 10
TO_XYZ = np.linalg.inv(xyz_to_srgb(np.eye(3)))
Terms = Callable[[Floats], Floats]
Fit = Callable[[Floats, Floats], Floats]


def three(signals: Floats) -> Floats:
    """Return R, G and B."""
    return signals[:, :3]


def four(signals: Floats) -> Floats:
    """Return R, G, B and W."""
    return signals


def roots(signals: Floats) -> Floats:
    """Return R, G, B and the roots of their products."""
    pairs = [np.sqrt(signals[:, a] * signals[:, b]) for a, b in combinations(range(3), 2)]
    return np.column_stack([*pairs, signals[:, :3]])


def least_squares(terms: Floats, target: Floats) -> Floats:
    """Fit in linear sRGB, as cameras are calibrated here."""
    return fit_through_neutral(terms, target)


def least_delta_e(terms: Floats, target: Floats) -> Floats:
    """Fit the least mean of CIEDE2000, from the least squares on."""
    start = fit_through_neutral(terms, target)

    def whole(free: Floats) -> Floats:
        rows = free.reshape(3, -1)
        return np.column_stack([rows, 1.0 - rows.sum(axis=1)])

    def loss(free: Floats) -> float:
        return float(delta_e(terms @ whole(free).T, target).mean())

    found = minimize(loss, start[:, :-1].ravel(), method="Powell", options={"maxiter": 20, "ftol": 1e-4})
    return whole(np.asarray(found.x))


def delta_e(developed: Floats, target: Floats) -> Floats:
    """CIEDE2000 of linear sRGB."""
    lab = [colour.XYZ_to_Lab(np.maximum(values, 0.0) @ TO_XYZ) for values in (developed, target)]
    return np.asarray(colour.delta_E(*lab, method="CIE 2000"))


def held_out(terms: Floats, target: Floats, fit: Fit) -> Floats:
    """Errors of surfaces by fits to the others."""
    errors = np.empty(len(terms))
    for part in range(PARTS):
        out = np.arange(len(terms)) % PARTS == part
        errors[out] = delta_e(terms[out] @ fit(terms[~out], target[~out]).T, target[out])
    return errors


def grey_noise(terms: Terms, matrix: Floats, variances: Floats) -> Floats:
    """Standard deviation of linear sRGB at grey, from variances of balanced channels."""
    step = 1e-6
    slopes = np.column_stack(
        [(terms(np.ones((1, 4)) + step * e) - terms(np.ones((1, 4)))).ravel() / step for e in np.eye(4)]
    )
    return np.asarray(np.sqrt((matrix @ slopes) ** 2 @ variances))


def report(light: str) -> None:
    """Print the table of a light."""
    sensor = low_noise()
    spd = illuminant(light).band_average(NM, np.full(NM.size, 5.0))
    responses = sensor.responses.band_average(("R", "G", "B", "W"), NM, np.full(NM.size, 5.0))
    chart = np.array([spectrum.band_average(NM, np.full(NM.size, 5.0)) for _, spectrum in color_checker_reflectances()])
    objects = load_TCS_CIE2017(SpectralShape(380, 780, 5)).values.T
    (on_chart, chart_target), (on_objects, objects_target) = (
        training(responses, NM, spd, surfaces) for surfaces in (chart, objects)
    )
    collected = responses @ (spd * photons_per_joule(NM))
    variances, first = collected.max() / collected, None
    maps: Sequence[tuple[str, Terms, Fit]] = (
        ("3x3", three, least_squares),
        ("3x3, least CIEDE2000", three, least_delta_e),
        ("3x4", four, least_squares),
        ("root-polynomial", roots, least_squares),
        ("root-polynomial, least CIEDE2000", roots, least_delta_e),
    )
    print(f"| under {light}: map | fitted on | chart | 99 objects | noise of R, G, B |\n|---|---|---|---|---|")
    for name, terms, fit in maps:
        for source, signals, target in (("chart", on_chart, chart_target), ("99 objects", on_objects, objects_target)):
            matrix = fit(terms(signals), target)
            of_chart = delta_e(terms(on_chart) @ matrix.T, chart_target)
            if source == "chart":
                of_objects = delta_e(terms(on_objects) @ matrix.T, objects_target)
            else:
                of_objects = held_out(terms(on_objects), objects_target, fit)
            noise = grey_noise(terms, matrix, variances)
            first = noise if first is None else first
            cells = [f"{errors.mean():.2f}, {np.percentile(errors, 95):.2f}" for errors in (of_chart, of_objects)]
            print(f"| {name} | {source} | {' | '.join(cells)} | {', '.join(f'{x:.2f}' for x in noise / first)} |")


if __name__ == "__main__":
    for light_name in ("D65", "A"):
        report(light_name)
