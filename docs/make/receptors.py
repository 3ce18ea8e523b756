"""Sensitivities of human rods and cones: `docs/make/receptors.py` writes studies/configs/sensors/receptors.csv.

Cones by Stockman & Sharpe (2000), which became CIE 170-1:2006, 2 degrees; rods (V) by CIE 1951, scotopic. Both are
published by energy at the cornea, relative; here they are isomerisations per photon with peaks of our choice: 0.3 for
rods, L and M, a tenth of it for S, whose light lens and macula keep.
"""

from pathlib import Path

import colour
import numpy as np
from page_parts import csv_text

PEAKS = {"L": 0.3, "M": 0.3, "S": 0.03, "V": 0.3}
NM = np.arange(390.0, 781.0, 5.0)


def main() -> None:
    """Write the table."""
    cones = colour.MSDS_CMFS["Stockman & Sharpe 2 Degree Cone Fundamentals"]
    rods = colour.SDS_LEFS["CIE 1951 Scotopic Standard Observer"]
    by_energy = np.array([[*np.nan_to_num(cones[nm]), rods[nm]] for nm in NM])  # S isn't given over 615 nm
    by_photon = by_energy / NM[:, None]
    curves = by_photon / by_photon.max(axis=0) * list(PEAKS.values())
    rows = [[f"{nm:g}", *(f"{value:.3g}" for value in row)] for nm, row in zip(NM, curves, strict=True)]
    place = Path(__file__).resolve().parents[2] / "studies" / "configs" / "sensors" / "receptors.csv"
    place.write_text(csv_text(["wavelength_nm", *PEAKS], rows))


if __name__ == "__main__":
    main()
