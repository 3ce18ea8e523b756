"""Tables of curves read alike in every spelling; what could be read in two ways is refused."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from rodcone.curve_file import read_columns

NM, R, G = [400.0, 500.5, 610.0], [0.125, 0.3, 0.0], [0.5, 1.0, 0.75]
ROWS = list(zip(NM, R, G, strict=True))


def write(folder: Path, text: str | bytes, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def table(separator: str, head: str = "", comma: bool = False, rows: list[tuple[float, ...]] = ROWS) -> str:
    lines = [separator.join(f"{x:g}".replace(".", "," if comma else ".") for x in row) for row in rows]
    return "\n".join([*([head] if head else []), *lines]) + "\n"


SPELLINGS = {
    "commas": table(",", "wavelength_nm,R,G"),
    "commas and spaces": table(", ", "wavelength_nm, R, G"),
    "quoted": table(",", '"Wavelength (nm)","R","G"'),
    "semicolons": table(";", "nm;R;G"),
    "semicolons, decimal commas": table(";", "nm;R;G", comma=True),
    "tabs": table("\t", "lambda [nm]\tR\tG"),
    "tabs, decimal commas": table("\t", "λ (nm)\tR\tG", comma=True),
    "white space": table("   ", "wavelength R G"),
    "white space, decimal commas": table("  ", "wavelength R G", comma=True),
    "header by commas": table(" ", "wavelength_nm,R,G"),
    "spaces in the header": table("\t", "Wavelength in nm\tR\tG"),
    "comments": "# a lamp\n# 3 values\n" + table(",", "nm,R,G").replace("500.5", "\n# half\n500.5"),
    "header in a comment": table(" ", "# wavelength_nm R G"),
    "title": "Lamp 7, measured by X\n\n" + table(",", "nm,R,G"),
    "trailing commas": table(",", "nm,R,G").replace("\n", ",,\n"),
    "falling": table(",", "nm,R,G", rows=ROWS[::-1]),
    "micrometres": table(",", "wavelength (um),R,G", rows=[(nm / 1000, r, g) for nm, r, g in ROWS]),
    "angstroms": table(",", "Wavelength [Å],R,G", rows=[(nm * 10, r, g) for nm, r, g in ROWS]),
    "carriage returns": table(",", "nm,R,G").replace("\n", "\r\n"),
}


@pytest.mark.parametrize("text", SPELLINGS.values(), ids=SPELLINGS)
def test_every_spelling_gives_the_same_columns(text: str, tmp_path: Path) -> None:
    columns = read_columns(write(tmp_path, text), "responses")
    assert list(columns) == ["wavelength_nm", "R", "G"]
    for column, values in zip(columns.values(), (NM, R, G), strict=True):
        np.testing.assert_allclose(column, values, rtol=1e-12)


@loop("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_every_encoding_of_instruments_is_read(encoding: str, tmp_path: Path) -> None:
    text = table(",", "wavelength (µm),R,G", rows=[(nm / 1000, r, g) for nm, r, g in ROWS])
    assert read_columns(write(tmp_path, text.encode(encoding)), "chart")["wavelength_nm"] == pytest.approx(NM)


def test_without_a_header_columns_have_numbers(tmp_path: Path) -> None:
    columns = read_columns(write(tmp_path, table(" "), "a.spd"), "responses")
    assert list(columns) == ["wavelength_nm", "1", "2"]
    assert columns["2"].tolist() == G


@loop("name", ["R (%)", "% R", "R [%]", "R_percent", "R per cent"])
def test_per_cent_in_a_header_is_divided_out_and_told(name: str, tmp_path: Path) -> None:
    text = table(",", f"nm,{name},G", rows=[(nm, 100 * r, g) for nm, r, g in ROWS])
    with pytest.warns(UserWarning, match="per cent by the header, divided by 100"):
        columns = read_columns(write(tmp_path, text), "chart")
    assert columns["R"] == pytest.approx(R)
    assert columns["G"].tolist() == G


@loop(
    ("text", "words"),
    [
        ("nm,R\n400,1\n410,x\n420,3\n430,4\n", ("line 3", "'410,x'", "no row of numbers")),
        ("nm,R\n400,1\n410,2\n420\n", ("line 4", "'420'")),
        ("nm,R\n400,1\n410,2\nlamp 2\n400,3\n410,4\n", ("lines 2 and 5", "allowed: one")),
        ("nm,R\n400,1\n410,2,3\n420,3\n", ("lines 2 and 3",)),
        ("nm;R\n400;1.5\n410;2,5\n", ("lines 3 and 2 have decimal commas and points",)),
        ("401\nnm,R\n400,1\n410,2\n", ("line 1 ('401')", "put # before it")),
        ("frequency_thz,R\n400,1\n410,2\n", ("has header ['frequency_thz', 'R']", "allowed: wavelength_nm")),
        ("wavenumber_cm-1,R\n15000,1\n16000,2\n", ("has header ['wavenumber_cm-1', 'R']",)),
        ("R,nm\n1,400\n2,410\n", ("has header ['R', 'nm']",)),
        ("nm,R,R\n400,1,2\n410,2,3\n", ("each name once",)),
        ("nm,R\n400,1\n400,2\n", ("400 then 400",)),
        ("nm,R\n400,nan\n410,2\n", ("line 2 ('400,nan')",)),
        ("only words\n", ("no table",)),
        ("PK\x03\x04", ("Excel's .xlsx",)),
        ("0.4 1\n0.5 2\n", ("wavelengths up to 0.5; allowed: nm",)),
    ],
)
def test_what_is_no_table_or_could_be_read_in_two_ways_is_refused(
    text: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    refusal(read_columns, write(tmp_path, text), "responses", words=("responses: ", "a.csv", *words))


def of_colour_science(name: str) -> Path:
    colour = pytest.importorskip("colour.io")
    path = Path(colour.__file__).parent / "tests" / "resources" / name
    if not path.is_file():
        pytest.skip(f"this colour-science has no {name}")
    return path


@loop(
    ("name", "reader"),
    [
        ("ESPD2021_0104_231446.xls", "SpectralDistribution_UPRTek"),
        ("RANDOM_001_02._3262K.csv", "SpectralDistribution_Sekonic"),
        ("Fluorescent.spdx", "SpectralDistribution_IESTM2714"),
    ],
)
def test_files_of_light_meters_read_as_colour_science_reads_them(name: str, reader: str) -> None:
    path = of_colour_science(name)
    import colour

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = getattr(colour, reader)(str(path)).read()
    nm, values = read_columns(path, "illuminant").values()
    np.testing.assert_array_equal(nm, theirs.wavelengths)
    np.testing.assert_array_equal(values, theirs.values)


TM27 = """<?xml version="1.0" encoding="utf-8"?>
<IESTM2714 xmlns="iestm2714" version="1.0"><Header><Description>a</Description></Header><SpectralDistribution>
<SpectralQuantity>reflectance</SpectralQuantity><BandwidthFWHM>5</BandwidthFWHM>
<SpectralData wavelength="400">0.25</SpectralData><SpectralData wavelength="500.5">0.5</SpectralData>
</SpectralDistribution></IESTM2714>"""


def test_tm27_states_what_it_holds(tmp_path: Path) -> None:
    path = write(tmp_path, TM27, "a.spdx")
    assert [column.tolist() for column in read_columns(path, "chart").values()] == [[400.0, 500.5], [0.25, 0.5]]
    refusal(read_columns, path, "illuminant", words=("SpectralQuantity 'reflectance'", "irradiance"))


@loop(
    ("old", "new", "words"),
    [
        ("reflectance", "absorptance", "SpectralQuantity 'absorptance' is not allowed"),
        ("<BandwidthFWHM>5</BandwidthFWHM>", "<Scale>2</Scale>", "element 'Scale' is unknown"),
        ('wavelength="400"', "", "needs a wavelength in nm"),
        (">0.25<", ">high<", "needs a wavelength in nm and a number"),
        ("</Header>", "", "no XML"),
        ("<IES", "<!DOCTYPE a><IES", "document type"),
    ],
)
def test_tm27_that_says_anything_else_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    refusal(read_columns, write(tmp_path, TM27.replace(old, new), "a.spdx"), "chart", match=words)
