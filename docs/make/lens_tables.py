"""Write the tables of the shipped lenses, sensor/lens/data, from published prescriptions, by optiland's rays.

PYTHONPATH=. python docs/make/lens_tables.py

It needs optiland (0.6.3 wrote the tables), which rodcone itself doesn't. Each lens is scaled so that its image circle
reaches the corners of a picture of 6 mm diagonal, and focused where the rays of all fields and wavelengths lie closest
together. A ray that crosses the pupil at p, in units of its rim, misses the point's place by -2 N dW/dp: of this the
coefficients of the wave's path W are the least squares. The pupil's half axes are those of the rays' directions behind
the lens, and the relative illumination is its area, because an even wall gives each direction the same light. Light
that a mount cuts off isn't known from a prescription and is left in; double_gauss states its vignetting. A lens that is
stopped down passes the middle of its pupil alone, of which the mount cuts less, and is focused anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from optiland.materials import AbbeMaterial
from optiland.optic import Optic
from scipy.optimize import minimize_scalar

from sensor.lens.wavefront import zernike

DATA = Path(__file__).resolve().parents[2] / "sensor" / "lens" / "data"
FIELD = (0.0, 0.2, 0.4, 0.55, 0.7, 0.85, 1.0)
NM = (400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0)
HALF_DIAGONAL_MM = 3.0
# Noll's terms that a round lens can have, up to the sixth order, and the next of spherical aberration. Z2 is the place,
# which goes to distortion and lateral colour.
SYMMETRIC = (2, 4, 6, 8, 10, 11, 12, 14, 16, 18, 20, 22, 24, 26, 28, 37)
ACROSS = 41  # rays across the pupil
MIDDLE = NM.index(550.0)


@dataclass(frozen=True)
class Prescription:
    """A lens: surfaces of radius [mm], distance to the next one [mm] and what lies behind; number of the stop."""

    name: str
    title: str
    source: str
    surfaces: Sequence[tuple[float, float, object]]
    stop: int
    f_number: float
    focal_length_mm: float
    corner_deg: float
    cut: Sequence[float] = (0.0,) * len(FIELD)  # share of the pupil that is cut above and below, by field


INF = float("inf")
CROWN, FLINT = (AbbeMaterial(n, v, model="buchdahl") for n, v in ((1.617, 55.0), (1.649, 33.8)))
TRIPLET, GAUSS = (
    Prescription(
        "cooke_triplet",
        "Triplet f/2.7 of K. Pestrecov, field of 28.6 degrees",
        "US patent 2,453,260 (1948), glasses by index and Abbe number",
        (
            (40.94, 8.74, CROWN),
            (INF, 11.05, None),
            (-55.65, 2.78, FLINT),
            (39.75, 7.63, None),
            (107.56, 9.54, CROWN),
            (-43.33, 79.34, None),
        ),
        4,
        2.7,
        100.0,
        14.3,
    ),
    Prescription(
        "double_gauss",
        "Double Gauss f/2, field of 28 degrees",
        "'Double Gauss F/2 - Available Glasses', example of Code V and ray-optics (ag_dblgauss), its vignetting too",
        (
            (56.20238, 8.75, "N-SSK2"),
            (152.28580, 0.5, None),
            (37.68262, 12.5, "N-SK2"),
            (INF, 3.8, ("F5", "schott")),
            (24.23130, 16.369445, None),
            (INF, 13.747957, None),
            (-28.37731, 3.8, ("F5", "schott")),
            (INF, 11.0, "N-SK16"),
            (-37.92546, 0.5, None),
            (177.41176, 7.0, "N-SK16"),
            (-79.41143, 61.487536, None),
        ),
        6,
        2.0,
        99.5,
        14.0,
        (0.0, 0.0, 0.05, 0.12, 0.2, 0.3, 0.4),
    ),
)


def stopped_down(lens: Prescription, f_number: float) -> Prescription:
    """Return a lens whose stop is closed: of a pupil smaller by a ratio the mount cuts what lies beyond that ratio."""
    ratio = f_number / lens.f_number
    return replace(
        lens,
        name=f"{lens.name}_f{f_number:g}",
        title=lens.title.replace(f"f/{lens.f_number:g}", f"f/{lens.f_number:g}, stopped down to f/{f_number:g}"),
        f_number=f_number,
        cut=[max(1 - (1 - cut) * ratio, 0.0) for cut in lens.cut],
    )


LENSES = (TRIPLET, GAUSS, stopped_down(GAUSS, 4.0))


def optic_of(lens: Prescription) -> Optic:
    """Build a lens for distant objects."""
    optic = Optic()
    optic.add_surface(index=0, radius=np.inf, thickness=np.inf)
    for index, (radius, thickness, glass) in enumerate(lens.surfaces, 1):
        material = {} if glass is None else {"material": glass}
        optic.add_surface(index=index, radius=radius, thickness=thickness, is_stop=index == lens.stop, **material)
    optic.add_surface(index=len(lens.surfaces) + 1)
    optic.set_aperture(aperture_type="EPD", value=lens.focal_length_mm / lens.f_number)
    optic.set_field_type(field_type="angle")
    for angle in (0.0, lens.corner_deg):
        optic.add_field(y=angle)
    for nm in NM:
        optic.add_wavelength(value=nm * 1e-3, is_primary=nm == NM[MIDDLE])
    return optic


def polynomials(along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Noll's terms that a round lens can have, the image lying along the first coordinate."""
    return np.array([zernike(j, along, across) for j in SYMMETRIC])


def rays(optic: Optic, lens: Prescription, field: float, nm: float) -> dict[str, np.ndarray]:
    """Trace a grid of rays: where they land, and their directions."""
    grid = np.linspace(-1, 1, ACROSS)
    y, x = (values.ravel() for values in np.meshgrid(grid, grid, indexing="ij"))
    inside = np.hypot(x, y) <= 1
    cut = lens.cut[FIELD.index(field)]
    height = np.tan(np.radians(lens.corner_deg)) * field
    share = min(np.degrees(np.arctan(height)) / lens.corner_deg, 1.0)
    zeros = np.zeros(int(inside.sum()))
    traced = optic.trace_generic(zeros, zeros + share, x[inside], y[inside] * (1 - cut), nm * 1e-3)
    found = {name: np.asarray(getattr(traced, name), dtype=float) for name in "xyLMN"}
    whole = np.isfinite(found["y"])
    return {name: values[whole] for name, values in found.items()}


def tables(lens: Prescription) -> tuple[str, str]:
    """Give the TOML and the CSV of a lens."""
    # Rays, and the plane where they lie closest together.
    optic = optic_of(lens)
    traced = {(field, nm): rays(optic, lens, field, nm) for field in FIELD for nm in NM}

    def spot(shift: float) -> float:
        total = 0.0
        for of in traced.values():
            y, x = (of[a] + shift * of[b] / of["N"] for a, b in (("y", "M"), ("x", "L")))
            total += y.var() + x.var()
        return total

    shift = float(minimize_scalar(spot, bounds=(-3, 3), method="bounded").x)
    scale = HALF_DIAGONAL_MM / (lens.focal_length_mm * np.tan(np.radians(lens.corner_deg)))

    # Wavefronts.
    place_mm, area, rows = np.zeros((len(FIELD), len(NM))), np.zeros((len(FIELD), len(NM))), []
    step = 1e-4
    for i, field in enumerate(FIELD):
        for k, nm in enumerate(NM):
            of = traced[field, nm]
            y, x = (scale * (of[a] + shift * of[b] / of["N"]) for a, b in (("y", "M"), ("x", "L")))
            middle = (of["M"].max() + of["M"].min()) / 2
            half = (of["M"].max() - of["M"].min()) / 2, (of["L"].max() - of["L"].min()) / 2
            along, across = (of["M"] - middle) / half[0], of["L"] / half[1]
            slopes = [
                (polynomials(along + step, across) - polynomials(along - step, across)) / (2 * step) / half[0],
                (polynomials(along, across + step) - polynomials(along, across - step)) / (2 * step) / half[1],
            ]
            matrix = np.concatenate([slopes[0].T, slopes[1].T])
            # With p = 2 N M, -2 N dW/dp is -dW/dM.
            path_mm = np.linalg.lstsq(-matrix, np.concatenate([y, x]), rcond=None)[0]
            left = np.concatenate([y, x]) + matrix @ path_mm
            tilt_mm = -2 * path_mm[0] / half[0]
            place_mm[i, k], area[i, k] = tilt_mm, half[0] * half[1]
            print(
                f"{lens.name} field {field:g} {nm:g} nm: misses by {1e3 * np.hypot(y - tilt_mm, x).std():.2f} um, "
                f"{1e3 * left.std():.3f} um unexplained, {1e6 * np.sqrt((path_mm[1:] ** 2).sum()):.0f} nm rms"
            )
            pupil = [2 * lens.f_number * value for value in half]
            values = [f"{round(1e6 * value, 2) + 0.0:g}" for value in path_mm[1:]]
            rows.append(",".join([f"{field:g}", f"{nm:g}", *(f"{value:.4f}" for value in pupil), *values]))
    head = ",".join(["field", "wavelength_nm", "pupil_radial", "pupil_across", *(f"Z{j}" for j in SYMMETRIC[1:])])

    # Curves.
    ideal_mm = HALF_DIAGONAL_MM * np.array(FIELD)
    distortion = np.divide(place_mm[:, MIDDLE], ideal_mm, out=np.ones(len(FIELD)), where=ideal_mm > 0)
    distortion = distortion / distortion[1] - 1  # the scale of the picture is that near the middle
    distortion[:2] = 0.0
    lateral_um = 1e3 * (place_mm - place_mm[:, [MIDDLE]])
    light = area[:, MIDDLE] / area[0, MIDDLE]

    def listed(values: np.ndarray, digits: int) -> str:
        return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + "]"

    lateral = ",\n".join(f"  {listed(of_nm, 3)}" for of_nm in lateral_um.T)
    toml = f"""# Scaled to a picture of {2 * HALF_DIAGONAL_MM:g} mm diagonal. Written by docs/make/lens_tables.py.
title = "{lens.title}"
source = "{lens.source}"
f_number = {lens.f_number}
field = {listed(np.array(FIELD), 2)}
wavelength_nm = {listed(np.array(NM), 0)}
relative_illumination = {listed(light, 4)}
distortion = {listed(distortion, 5)}
lateral_um = [
{lateral},
]
point_spread = "{lens.name}.csv"
"""
    return toml, "\n".join([head, *rows]) + "\n"


if __name__ == "__main__":
    for lens in LENSES:
        toml, csv = tables(lens)
        (DATA / f"{lens.name}.toml").write_text(toml)
        (DATA / f"{lens.name}.csv").write_text(csv)
