"""Named lights: each of luminance 1, and of the shape that its name promises."""

import json
from typing import Any

import numpy as np
import pytest
from loop import loop
from outside_truth import colour_science
from refusal import refusal

from render.illuminants import (
    MOON_SLOPE_PER_NM,
    TABULATED_LINES,
    daylight,
    illuminant,
    illuminant_names,
    lines_nm,
    unit_luminance,
)
from render.spectrum import (
    PUBLISHED,
    Spectrum,
    black_body,
    colour_matching_functions,
    line_bands,
    luminance,
    published_spectra,
)

NM, WIDTH_NM = np.arange(360.5, 830.0), np.ones(470)


@loop("name", [*illuminant_names(), "2700K", "D12000K"])
def test_every_light_has_a_luminance_of_one(name):
    light, v = illuminant(name), colour_matching_functions()[1]
    fine = np.arange(360.0, 830.0, 0.05) + 0.025  # another quadrature: a point every 0.05 nm
    sampled = np.interp(fine, light.wavelength_nm, light.values, left=0.0, right=0.0)
    luminance_cd_m2 = 683.0 * 0.05 * (sampled * np.interp(fine, v.wavelength_nm, v.values)).sum()
    assert luminance_cd_m2 == pytest.approx(1.0, rel=2e-4)


# Kieffer and Stone 2005, table 4, visible bands: nm, a0 to a3, d1 to d3.
ROLO = np.array(
    [
        (405.0, -2.35754, -1.72134, 0.40337, -0.21105, 0.35235, -0.03818, -0.00006),
        (412.3, -2.34185, -1.74337, 0.42156, -0.21512, 0.36591, -0.05902, 0.00080),
        (414.4, -2.43367, -1.72184, 0.43600, -0.22675, 0.35558, -0.03247, -0.00503),
        (441.6, -2.31964, -1.72114, 0.37286, -0.19304, 0.37935, -0.09562, 0.00970),
        (465.8, -2.35085, -1.66538, 0.41802, -0.22541, 0.33450, -0.02546, -0.00484),
        (475.0, -2.28999, -1.63180, 0.36193, -0.20381, 0.33024, -0.03131, 0.00222),
        (486.9, -2.23351, -1.68573, 0.37632, -0.19877, 0.36590, -0.08945, 0.00678),
        (544.0, -2.13864, -1.60613, 0.27886, -0.16426, 0.37190, -0.10629, 0.01428),
        (549.1, -2.10782, -1.66736, 0.41697, -0.22026, 0.36814, -0.09815, -0.00000),
        (553.8, -2.12504, -1.65970, 0.38409, -0.20655, 0.37206, -0.10745, 0.00347),
        (665.1, -1.88914, -1.58096, 0.30477, -0.17908, 0.37141, -0.13514, 0.01248),
        (693.1, -1.89410, -1.58509, 0.28080, -0.16427, 0.39109, -0.17048, 0.01754),
        (703.6, -1.92103, -1.60151, 0.36924, -0.20567, 0.37155, -0.13989, 0.00412),
        (745.3, -1.86896, -1.57522, 0.33712, -0.19415, 0.36888, -0.14828, 0.00958),
        (763.7, -1.85258, -1.47181, 0.14377, -0.11589, 0.39126, -0.16957, 0.03053),
        (774.8, -1.80271, -1.59357, 0.36351, -0.20326, 0.36908, -0.16182, 0.00830),
    ]
)


def test_lights_of_colour_science_are_known_by_its_names_and_by_ours():
    for name, its_name in {"FL3.12": "FL3.12", "F2": "FL2", "F11": "FL11", "sodium_high": "HP1", "A": "A"}.items():
        light, table = illuminant(name), colour_science().SDS_ILLUMINANTS[its_name]
        assert np.array_equal(light.wavelength_nm, table.wavelengths)
        assert light.values == pytest.approx(table.values * (light.values.max() / table.values.max()), rel=1e-12)
        assert luminance(light.band_average(NM, WIDTH_NM), NM, WIDTH_NM) == pytest.approx(1.0, rel=1e-9)


def test_moonlight_is_sunlight_times_the_rolo_model_of_the_full_moon():
    nm, phase_deg = ROLO[:, 0], 7.0
    terms = [np.radians(phase_deg) ** power for power in range(4)]
    terms += [np.exp(-phase_deg / 4.06054), np.exp(-phase_deg / 12.8802), np.cos((phase_deg + 30.5858) / 16.7498)]
    albedo = np.exp(ROLO[:, 1:] @ terms)
    slope, at_550_nm = np.polyfit(nm - 550, albedo, 1)
    assert pytest.approx(slope / at_550_nm, rel=5e-3) == MOON_SLOPE_PER_NM
    ratio = illuminant("moonlight").band_average(nm, 10.0) / illuminant("sunlight").band_average(nm, 10.0)
    share = (ratio / albedo) / (ratio / albedo).mean()
    assert share == pytest.approx(np.ones(nm.size), abs=0.1)  # the model's own bands scatter by 9 % about a line
    assert share.std() < 0.05


@loop("kelvin", [2000.0, 3000.0, 6500.0])
def test_a_temperature_is_a_black_body(kelvin):
    made, planck = illuminant(f"{kelvin:g}K"), black_body(kelvin)
    assert made.values / made.values.max() == pytest.approx(planck.values / planck.values.max(), rel=1e-14)


@loop("name", ["100K", "D3000K", "D30000K", "2000000K"])
def test_a_temperature_out_of_range_is_refused_with_its_value(name):
    refusal(illuminant, name, match=rf"^illuminant: .* \[K\]: {float(name.strip('DK')):.1f} is outside ")


def test_sodiums_lines_are_the_doublet_and_share_a_band_that_holds_all_their_light():
    assert lines_nm("sodium_low") == (588.995, 589.592)
    nm, width_nm = line_bands(lines_nm("sodium_low"))
    light = illuminant("sodium_low").band_average(nm, width_nm) * width_nm
    assert np.count_nonzero(light) == 1
    assert width_nm[light > 0] < 2.0
    y = colour_matching_functions()[1]
    v = np.interp(lines_nm("sodium_low"), y.wavelength_nm, y.values)
    assert light.sum() == pytest.approx(1 / (683.0 * (2 * v[0] + v[1]) / 3), rel=1e-9)


def test_smooth_lights_have_no_lines_and_an_unknown_one_is_refused():
    of_lines = ("sodium_low", *TABULATED_LINES)
    assert all(lines_nm(name) == () for name in (*illuminant_names(), "3000K") if name not in of_lines)
    for name in TABULATED_LINES:
        with pytest.warns(UserWarning, match=f"lines_nm: {name} is a lamp of lines whose table holds steps of 5 nm"):
            assert lines_nm(name) == ()
    refusal(lines_nm, "sodium_lo", match="did you mean 'sodium_low'")


def test_equal_energy_is_flat():
    assert np.ptp(illuminant("E").values) == 0.0


@loop(("name", "nearest"), [("d65", "D65"), ("D66", "D6|D65"), ("moonligt", "moonlight")])
def test_an_unknown_light_is_refused_and_the_nearest_named(name, nearest):
    text = refusal(illuminant, name)
    assert text.startswith(f"illuminant: {name!r} is unknown; allowed: A, D50")
    assert any(f"did you mean {choice!r}?" in text for choice in nearest.split("|"))


def lamp(folder, text):
    path = folder / "led.csv"
    path.write_text(text, "utf-8")
    return str(path)


def test_a_lamp_of_a_file_has_a_luminance_of_one_in_any_unit_and_is_read_anew(tmp_path):
    a = illuminant("A")
    for scale in (1.0, 1e300):
        rows = "".join(f"{nm},{value}\n" for nm, value in zip(a.wavelength_nm, a.values * scale, strict=True))
        found = illuminant(lamp(tmp_path, "wavelength_nm,watts\n" + rows))
        assert found.values == pytest.approx(a.values, rel=1e-12)
    changed = illuminant(lamp(tmp_path, "wavelength_nm,watts\n400,1\n700,1\n"))
    assert changed.wavelength_nm.tolist() == [400.0, 700.0]


@loop("name", ["lamp.spd", "lamp.txt", "LAMP.SPD", "lamp.tsv"])
def test_a_lamp_by_any_name_of_a_table_is_a_lamp(tmp_path, name):
    (tmp_path / name).write_text("400\t1,5\n700\t1,5\n", "utf-8")
    assert np.ptp(illuminant(str(tmp_path / name)).values) == 0.0


@loop(
    ("text", "words"),
    [
        ("wavelength_nm,a,b\n400,1,1\n700,1,1\n", "has 2 columns beside wavelength_nm; allowed: 1"),
        ("watts,a\n400,1\n700,1\n", "has header"),
        ("wavelength_nm,a\n400,1\n700,-1\n", "finite numbers >= 0"),
        ("wavelength_nm,a\n900,1\n1000,1\n", "it gives no visible light"),
        ("nm,PPFD [µmol/m2/s]\n400,1\n700,1\n", "its column 'PPFD [µmol/m2/s]' is in µmol; allowed: power"),
        ("nm,dBm\n400,1\n700,1\n", "is in dBm"),
    ],
)
def test_a_file_that_is_no_lamp_is_refused_by_name_in_one_line(tmp_path, text, words):
    refusal(illuminant, lamp(tmp_path, text), words=(words, "led.csv"))


# Published tables: those of colour-science, whose digits they are. Run as a script, it writes them anew.

LIGHTS = {name: name for name in ("A", "D50", "D55", "D65", "D75")}  # our name: theirs
LIGHTS |= {"F2": "FL2", "F11": "FL11", "sodium_high": "HP1"}
LIGHTS |= {name: name for name in ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1")}
LIGHTS |= {name: name for name in ("LED-RGB1", "LED-V1", "LED-V2")}
SUN_NM = np.arange(300.0, 1101.0)


def of_colour_science() -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """All collections as the library holds them; the sun in 1 nm means."""
    colour = colour_science()
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    sun = colour.plotting.datasets.SD_ASTMG173_DIRECT_CIRCUMSOLAR
    means = Spectrum(sun.wavelengths, sun.values).band_average(SUN_NM, np.ones_like(SUN_NM))
    camera = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]
    tables = {
        "illuminants": {name: colour.SDS_ILLUMINANTS[theirs] for name, theirs in LIGHTS.items()},
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
    PUBLISHED.write_text("{\n" + ",\n".join(groups) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    write()
