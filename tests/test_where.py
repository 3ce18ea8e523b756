"""docs/where.md: every term has a row, and every name in it exists."""

import re
from collections import Counter
from pathlib import Path
from pkgutil import resolve_name

PAGE = Path(__file__).resolve().parent.parent / "docs" / "where.md"
NAME = re.compile(r"`([\w.]+)`")
TERMS = (
    # Parmar & Wandell 2009
    *("f_i(x), eq. (1)", "G(β, σ), eq. (2)", "W_y, eq. (3)", "β_d, eq. (4)", "β_s, eq. (5)", "α(y), eq. (6)"),
    *("Ω", "σ_d", "σ_s", "patch", "x, y", "i", "S_i", "g_i", "h_i", "h_W"),
    *("luminance substitution, 3.1.3", "Gray World", "bilinear demosaicking", "Anscombe transform"),
    *("inverse Anscombe transform", "R, G, B, W curves, Figure 2"),
    # its Table 1
    *("pixel width, pixel height", "fill factor", "dark voltage", "read noise", "DSNU", "PRNU", "conversion gain"),
    *("voltage swing", "analog gain", "well capacity", "lens f-number", "mean scene luminance"),
    # EMVA 1288
    *("quantum efficiency, η", "system gain, K", "temporal dark noise, σ_d", "DSNU1288", "PRNU1288", "column offsets"),
    *("column gains", "dark current, μ_I", "saturation capacity, μ_e.sat", "dynamic range", "SNR_max"),
    *("absolute sensitivity threshold, μ_e.min", "linearity error, LE", "photon transfer", "noise model, σ_y²"),
    *("shot noise", "quantisation noise"),
    # radiometry and photometry
    *("radiance, L", "irradiance, E", "photons", "luminance, Y", "luminous efficiency, V(λ)", "CIE XYZ"),
    *("illuminance on the scene", "illuminance on the sensor", "black body", "illuminant", "wavelength band"),
    *("camera equation", "cos⁴ falloff", "diffraction, OTF", "veiling glare", "reflectance", "path tracing"),
    *("light transport, T", "Monte Carlo error"),
)


def rows(text: str) -> list[tuple[str, str, tuple[str, ...]]]:
    """Term, meaning and names of each row of the page's tables."""
    cells = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return [(row[0], row[1], tuple(NAME.findall(row[2]))) for row in cells if row[0] != "term" and set(row[0]) != {"-"}]


ROWS = rows(PAGE.read_text("utf-8"))


def resolve(name: str) -> object:
    """What a dotted name stands for: a module's function, class or constant, or a class's method or field.

    Raises
    ------
    AttributeError
        Where there is no such module or name.
    """
    try:
        return resolve_name(name)
    except AttributeError:
        holder, _, field = name.rpartition(".")
        fields = getattr(resolve_name(holder), "__dataclass_fields__", {})
        if field not in fields:
            raise
        return fields[field]


def test_a_terms_names_exist():
    for term, _, names in ROWS:
        assert names, f"{term}: name the function that holds it, in backticks"
        for name in names:
            assert name.rpartition(".")[2].isidentifier(), name
            assert not any(part.startswith("_") for part in name.split(".")), f"{name} is private: name the public one"
            assert resolve(name) is not None, name


def test_a_term_has_one_row_with_a_meaning():
    counts = Counter(term for term, meaning, _ in ROWS if meaning)
    assert {term: counts[term] for term in TERMS if counts[term] != 1} == {}, "give each one row"
