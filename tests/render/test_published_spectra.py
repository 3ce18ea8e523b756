"""Published tables: those of colour-science, whose digits they are. Run as a script, it writes them anew."""

import json
from typing import Any

import numpy as np
import pytest
from loop import loop
from outside_truth import colour_science

from render.illuminants import daylight, unit_luminance
from render.published_spectra import PATH, published_spectra
from render.spectrum import Spectrum

LIGHTS = ("A", "D50", "D55", "D65", "D75", "FL2", "FL11", "HP1")
LEDS = ("B1", "B2", "B3", "B4", "B5", "BH1", "RGB1", "V1", "V2")
SUN_NM = np.arange(300.0, 1101.0)


def of_colour_science() -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """All collections as the library holds them; the sun in 1 nm means."""
    colour = colour_science()
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    sun = colour.plotting.datasets.SD_ASTMG173_DIRECT_CIRCUMSOLAR
    means = Spectrum(sun.wavelengths, sun.values).band_average(SUN_NM, np.ones_like(SUN_NM))
    camera = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]
    names = [*LIGHTS, *(f"LED-{kind}" for kind in LEDS)]
    tables = {
        "illuminants": {name: colour.SDS_ILLUMINANTS[name] for name in names},
        "daylight": colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES,
        "color_checker": colour.SDS_COLOURCHECKERS["cc_ohta"],
    }
    return {
        "observer": {
            name: (observer.wavelengths, column) for name, column in zip("xyz", observer.values.T, strict=True)
        },
        **{key: {name: (x.wavelengths, x.values) for name, x in group.items()} for key, group in tables.items()},
        "sun": {"direct": (SUN_NM, means)},
        "nikon_d5100": {
            name: (camera.wavelengths, column) for name, column in zip("RGB", camera.values.T, strict=True)
        },
    }


def test_the_tables_are_those_of_colour_science() -> None:
    for collection, tables in of_colour_science().items():
        ours = published_spectra(collection)
        assert list(ours) == list(tables)
        for name, (nm, values) in tables.items():
            assert np.array_equal(ours[name][0], nm), name
            # means of the sun are computed here, and the processor rounds them; the rest is read
            np.testing.assert_allclose(ours[name][1], values, rtol=1e-12 if collection == "sun" else 0, err_msg=name)


@loop("cct_k", [4000.0, 6504.0, 7000.0, 7000.1, 8300.0, 25_000.0])
def test_daylight_is_that_of_colour_science(cct_k: float) -> None:
    colour = colour_science()
    theirs = colour.sd_CIE_illuminant_D_series(colour.temperature.CCT_to_xy_CIE_D(cct_k), M1_M2_rounding=False)
    expected = unit_luminance(Spectrum(theirs.wavelengths, theirs.values))
    assert np.array_equal(daylight(cct_k).wavelength_nm, expected.wavelength_nm)
    assert daylight(cct_k).values == pytest.approx(expected.values, rel=1e-12)  # computed twice


def write() -> None:
    """Write the file: one table a line."""

    def line(name: str, nm: np.ndarray, values: np.ndarray) -> str:
        table: dict[str, Any] = {"first_nm": float(nm[0]), "step_nm": float(nm[1] - nm[0]), "values": values.tolist()}
        return f"{json.dumps(name)}: {json.dumps(table)}"

    groups = (
        f"{json.dumps(key)}: {{\n" + ",\n".join(line(name, *table) for name, table in group.items()) + "\n}"
        for key, group in of_colour_science().items()
    )
    PATH.write_text("{\n" + ",\n".join(groups) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    write()
