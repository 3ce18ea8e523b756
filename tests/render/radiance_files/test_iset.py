"""ISETCam scenes in every form, with known photons; what doesn't fit is refused."""

import resource
import struct
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from loop import loop
from refusal import refusal

from render.illuminants import illuminant, spectral_luminance
from render.radiance_files import mat_file, mat_reader
from render.radiance_files.iset import read_iset_illuminant, read_iset_scene
from render.radiance_files.mat_file import read_numbers
from render.radiance_files.radiance_source import load_picture
from render.spectrum import Spectrum, luminance, photons_per_joule
from rodcone.errors import InputError
from rodcone.file_keys import formats

NM = np.arange(400.0, 701.0, 10.0)
PHOTONS = 1e15 * np.random.default_rng(7).random((5, 6, NM.size))
# A photon of 500 nm has h c / lambda = 6.62607015e-34 * 299792458 / 500e-9 J.
JOULE = 6.62607015e-34 * 299792458.0 / (NM * 1e-9)


def save(tmp_path: Path, **variables: Any) -> Path:
    path = tmp_path / "scene.mat"
    scipy.io.savemat(path, variables, do_compression=True)
    return path


def basis_file(tmp_path: Path, **changes: Any) -> tuple[Path, np.ndarray]:
    """Scene of three basis functions, and its photons by the definition: coefficient times function, summed."""
    rng = np.random.default_rng(8)
    functions, coefficients = rng.random((NM.size, 3)), 1e15 * rng.random((5, 6, 3))
    parts: dict[str, Any] = {"mcCOEF": coefficients, "basis": {"basis": functions, "wave": NM}, "comment": "a"}
    lamp = {"data": np.ones(NM.size), "wavelength": NM}
    return save(tmp_path, **{**parts, "illuminant": lamp, **changes}), np.einsum("hwk,nk->hwn", coefficients, functions)


def test_photons_become_watts_by_planck_constant_and_frequency(tmp_path: Path) -> None:
    read = read_iset_scene(save(tmp_path, photons=PHOTONS, wave=NM, comment="x", fov=10.0, name="scene"))
    assert read.values == pytest.approx(PHOTONS * JOULE, rel=6e-8)  # float32: 2^-24
    assert read.wavelength_nm.tolist() == NM.tolist()
    assert read.widths_nm == pytest.approx(np.full(NM.size, 10.0))
    assert read.relative_mc_error == 0


@pytest.mark.thorough
def test_older_names_of_photons_and_wavelengths_are_known(tmp_path: Path) -> None:
    read = read_iset_scene(save(tmp_path, data=PHOTONS, wavelength=NM[:, None]))
    assert read.values == pytest.approx(PHOTONS * JOULE, rel=6e-8)


def test_saved_scene_struct_is_read(tmp_path: Path) -> None:
    scene = {
        "type": "scene",
        "name": "a",
        "data": {"photons": PHOTONS.astype(np.float32), "luminance": []},
        "spectrum": {"wave": NM[:, None]},
        "illuminant": {"type": "illuminant", "data": {"photons": np.ones(NM.size)}, "spectrum": {"wave": NM}},
        "depthMap": np.full((5, 6), 1.2),
    }
    read = read_iset_scene(save(tmp_path, scene=scene))
    assert read.values == pytest.approx(PHOTONS * JOULE, rel=2e-7)  # rounded twice


@loop(
    ("form", "stored"),
    [
        ("energy", {"illuminant": {"data": NM, "wavelength": NM}}),
        ("photons", {"illuminant": {"data": {"photons": NM / JOULE}, "spectrum": {"wave": NM[:, None]}}}),
        ("scene", {"scene": {"illuminant": {"data": {"photons": NM / JOULE}, "spectrum": {"wave": NM}}}}),
        ("of each pixel", {"illuminant": {"data": {"photons": PHOTONS}, "spectrum": {"wave": NM}}}),
        ("dark", {"illuminant": {"data": 0 * NM, "wavelength": NM}}),
        ("negative", {"illuminant": {"data": -NM, "wavelength": NM}}),
    ],
)
def test_illuminant_is_energy_at_1_cd_m2_or_none(form: str, stored: dict[str, Any], tmp_path: Path) -> None:
    path = save(tmp_path, photons=PHOTONS, wave=NM, **stored)
    if form == "negative":
        assert "illuminant: spectrum values" in refusal(read_iset_illuminant, path)
        return
    light = read_iset_illuminant(path)
    if form in ("of each pixel", "dark"):
        assert light is None
        return
    assert light is not None
    inside = slice(1, -1)
    assert light.values[inside] / light.values[1] == pytest.approx(NM / NM[0])  # energy in proportion to wavelength
    assert light.wavelength_nm[[0, -1]].tolist() == [395.0, 705.0]  # end samples hold to the edges of their bands
    assert light.values[[0, -1]].tolist() == light.values[[1, -2]].tolist()
    nm = np.arange(360.5, 830.0)
    assert luminance(light.band_average(nm, 0 * nm + 1), nm, 0 * nm + 1) == pytest.approx(1.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize("names", [("dmin", "dmax"), ("min", "max")])
@pytest.mark.parametrize("dtype", [np.uint16, np.uint32])
def test_photons_of_old_files_are_stretched_from_integers(tmp_path: Path, dtype: Any, names: tuple[str, str]) -> None:
    """The formula of ieCompressData: round(top * (photons - least) / (most - least))."""
    top, least, most = float(np.iinfo(dtype).max), PHOTONS.min(), PHOTONS.max()
    stored = np.round(top * (PHOTONS - least) / (most - least)).astype(dtype)
    data = {"photons": stored, names[0]: least, names[1]: most}
    read = read_iset_scene(save(tmp_path, scene={"data": data, "spectrum": {"wave": NM}}))
    half_step = (most - least) / top / 2
    assert np.all(np.abs(read.values / JOULE - PHOTONS) <= half_step + 1e-7 * PHOTONS)


@pytest.mark.thorough
def test_basis_coefficients_give_photons(tmp_path: Path) -> None:
    path, photons = basis_file(tmp_path)
    assert read_iset_scene(path).values == pytest.approx(photons * JOULE, rel=1e-6)


@pytest.mark.thorough
def test_the_mean_that_was_taken_out_is_added(tmp_path: Path) -> None:
    mean = 1e14 * np.arange(NM.size)
    path, photons = basis_file(tmp_path, imgMean=mean)
    assert read_iset_scene(path).values == pytest.approx((photons + mean) * JOULE, rel=1e-6)


def in_form(form: str, photons: np.ndarray, tmp_path: Path) -> Path:
    """The same photons in one of the three forms that ISETCam writes."""
    if form == "basis":  # one function a wavelength: coefficients are photons
        return save(tmp_path, mcCOEF=photons, basis={"basis": np.eye(NM.size), "wave": NM})
    if form == "struct":
        return save(tmp_path, scene={"data": {"photons": photons}, "spectrum": {"wave": NM}})
    return save(tmp_path, photons=photons, wave=NM)


@pytest.mark.sample(1)
@pytest.mark.parametrize("form", ["basis", "struct", "photons"])
@pytest.mark.parametrize(("count", "share"), [(1, "0.108"), (9, "0.968")])  # of 5 x 6 x 31 = 930 samples
def test_a_few_photons_below_zero_become_zero_and_are_told_in_every_form(
    form: str, count: int, share: str, tmp_path: Path
) -> None:
    photons = PHOTONS.copy()
    photons.flat[100 : 100 + count] = -1e9  # a hair below 0 beside 1e15
    with pytest.warns(UserWarning, match=rf"^{share}% of its photons were negative and became 0") as told:
        read = read_iset_scene(in_form(form, photons, tmp_path))
    assert len(told) == 1
    assert np.count_nonzero(read.values == 0) == count
    assert read.values == pytest.approx(np.maximum(photons, 0) * JOULE, rel=6e-7)


@loop("form", ["struct", "photons"])
def test_stored_photons_of_which_over_a_hundredth_is_below_zero_are_refused(form: str, tmp_path: Path) -> None:
    photons = PHOTONS.copy()
    photons.flat[100:110] = -1e9  # 10 of 930 are 1.08 %
    with pytest.raises(InputError, match="at row 0, column 3, band 7"):  # 100 = 3 x 31 + 7
        read_iset_scene(in_form(form, photons, tmp_path))


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("variables", "told"),
    [
        ({"photons": PHOTONS}, "wavelength"),
        ({"rgb": PHOTONS}, r"sceneToFile saves it, or any cube that a \.toml of the same name"),
        ({"photons": PHOTONS, "wave": NM[:-1]}, r"\(5, 6, 31\) is not \(h, w, 30\)"),
        ({"photons": -PHOTONS, "wave": NM}, "at row 0, column 0, band 0"),
        ({"photons": PHOTONS * 1e60, "wave": NM}, "inf"),
        ({"photons": np.ones(PHOTONS.shape, np.int32), "wave": NM}, "int32"),
        ({"photons": np.ones(PHOTONS.shape, np.uint16), "wave": NM}, "dmin"),
        ({"photons": PHOTONS[:, :, 0], "wave": 550.0}, "width"),
        ({"photons": PHOTONS, "wave": NM[::-1]}, "increasing"),
        ({"scene": {"data": {"photons": PHOTONS}}}, r"no numbers 'scene\.spectrum\.wave'"),
        ({"mcCOEF": PHOTONS, "basis": {"basis": np.ones((30, 31)), "wave": NM}}, "one row"),
        ({"mcCOEF": PHOTONS, "basis": {"basis": np.ones((31, 3)), "wave": NM}}, r"not \(h, w, 3\)"),
        ({"mcCOEF": PHOTONS, "basis": {"basis": np.ones((31, 31)), "wave": NM}, "imgMean": np.ones(3)}, "imgMean"),
        ({"photons": np.ones((1 << 16, 1, 2)), "wave": NM[:2]}, "65536 x 1 pixels"),
    ],
)
def test_what_is_no_scene_is_refused_in_one_line(tmp_path: Path, variables: dict[str, Any], told: str) -> None:
    path = save(tmp_path, **variables)
    message = refusal(read_iset_scene, path, match=told)
    assert message.startswith(f"{path}: ")
    assert message.count(str(path)) == 1


def test_a_basis_that_would_swell_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    """1 Mpx of one coefficient and 3000 wavelengths: 12.6 GB from a file of some kilobytes."""
    nm = 300.0 + 0.1 * np.arange(3000)
    path = save(tmp_path, mcCOEF=np.zeros((1024, 1024), np.uint8), basis={"basis": np.ones((3000, 1)), "wave": nm})
    assert path.stat().st_size < 100_000
    refusal(read_iset_scene, path, match="12582912000 bytes")


# MATLAB level 5 files against SciPy's writer and the format's own bytes; damaged ones end a child alone.


CUBE = np.random.default_rng(5).random((3, 4, 2))
VARIABLES: dict[str, Any] = {
    "cube": CUBE,
    "single": CUBE.astype(np.float32),
    **{f"n{np.dtype(t).name}": np.array([[0, 1, np.iinfo(t).max]], t) for t in "bBhHiIqQ"},
    "scene": {"name": "a", "data": {"photons": CUBE}, "spectrum": {"wave": np.arange(3.0)}},
    "text": "400 nm",
    "cell": np.array(["a", 1], dtype=object),
    "many": np.zeros(2, [("a", "O")]),
}
NUMBERS = [name for name, value in VARIABLES.items() if isinstance(value, np.ndarray) and value.dtype.kind in "iuf"]


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(kind: int, dimensions: tuple[int, ...], stored: int, content: bytes) -> bytes:
    """Variable x by the format's description: flags, dimensions, name, numbers."""
    parts = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack(f"<{len(dimensions)}i", *dimensions))
    return element(14, parts + element(1, b"x") + element(stored, content))


def file_of(path: Path, *elements: bytes) -> Path:
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + b"".join(elements))
    return path


@loop("compressed", [False, True])
def test_numbers_are_read_as_they_were_written_and_nothing_else(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, VARIABLES, do_compression=compressed)
    inner = ["scene/data/photons", "scene/spectrum/wave", "scene/name", "scene/data/none", "cube/data"]
    read = read_numbers(path, [*VARIABLES, *inner, "absent"])
    assert set(read) == {*NUMBERS, "scene/data/photons", "scene/spectrum/wave"}
    for name in NUMBERS:
        assert read[name].dtype == VARIABLES[name].dtype, name
        assert np.array_equal(read[name], VARIABLES[name]), name
    assert np.array_equal(read["scene/data/photons"], CUBE)
    assert read["scene/spectrum/wave"].ravel().tolist() == [0, 1, 2]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "content",
    [
        matrix(6, (2, 3), 9, bytes(16)),
        matrix(6, (1 << 30, 1 << 30, 1 << 30), 9, bytes(16)),
        element(15, b"nonsense"),
        struct.pack("<II", 14, 1 << 31) + bytes(64),
    ],
    ids=["too few numbers", "far too few", "no deflated bytes", "cut"],
)
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = file_of(tmp_path / "a.mat", content)
    assert refusal(read_numbers, path, ["x"], match=r"SciPy can\'t read the \.mat file: \w").startswith(f"{path}: ")


@loop(
    ("end", "told"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "it ended the reader by signal 11"),
        ("import time; time.sleep(60)", "took over 1 s to read"),
    ],
)
def test_a_reader_that_ends_or_hangs_is_an_error_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, told: str
) -> None:
    script = tmp_path / "reader.py"
    script.write_text(end)
    monkeypatch.setattr(mat_reader, "__file__", str(script))
    monkeypatch.setattr(mat_file, "_SECONDS", 0.6 if "sleep" in end else 60)
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": 1.0})
    refusal(read_numbers, path, ["x"], match=told)


@pytest.mark.thorough
def test_bytes_that_swell_to_more_than_their_file_may_hold_are_refused(tmp_path: Path) -> None:
    """10 kB hold 10 MB of zeros, each of them a double: 80 MB, where 64 MiB are allowed; 40 MB do no harm."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for count, fits in ((10_000_000, False), (5_000_000, True)):
        deflated = zlib.compress(matrix(6, (count, 1), 2, bytes(count)), 9)
        path = file_of(tmp_path / "a.mat", struct.pack("<II", 15, len(deflated)) + deflated)
        if fits:
            assert np.array_equal(read_numbers(path, ["x"])["x"], np.zeros((count, 1)))
        else:
            refusal(read_numbers, path, ["x"], match="SciPy can't read")
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # kilobytes on Linux
            assert grown < 60_000


def test_complex_numbers_are_refused_and_not_cut(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": np.array([1 + 2j])})
    refusal(read_numbers, path, ["x"], match="complex")


def test_other_forms_are_named_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM" + bytes(384) + b"\x89HDF\r\n\x1a\n"
    )
    refusal(
        read_numbers, path, ["x"], match=r"-v7\.3 \(HDF5\).*save -v7; or convert it: pip install mat73 scipy; python -c"
    )
    scipy.io.savemat(path, {"x": 1.0}, format="4")
    refusal(read_numbers, path, ["x"], match="level 5")
    for content in (b"", b"no"):
        path.write_bytes(content)
        refusal(read_numbers, path, ["x"], match="level 5")
    refusal(read_numbers, tmp_path / "missing.mat", ["x"], match="no such file")


@pytest.mark.thorough
def test_the_illuminant_that_a_scene_holds_is_exchanged_and_its_view_is_read(tmp_path: Path) -> None:
    """A grey of 0.4 under A, relit by D65, is a grey of 0.4 under D65 of the same luminance."""
    nm = np.arange(400.0, 701.0, 10.0)
    lamp, other = illuminant("A"), illuminant("D65")
    watts = 250.0 * lamp.band_average(nm, np.full(nm.size, 10.0))
    photons = 0.4 * watts * photons_per_joule(nm)
    held = {"data": watts, "wavelength": nm}
    path = save(tmp_path, photons=np.tile(photons, (3, 4, 1)), wave=nm, illuminant=held, fov=12.5)
    scene = read_iset_scene(path)
    assert scene.horizontal_view_deg == 12.5
    again = scene.relight(scene.light)
    assert again.values == pytest.approx(scene.values, rel=1e-6)
    lit = scene.relight(other)
    of_file = Spectrum(nm, watts)
    scale = spectral_luminance(of_file) * 0.4
    expected = scale * other.band_average(nm, np.full(nm.size, 10.0))
    inner = slice(1, -1)  # half of the outermost bands lies beyond the file's illuminant
    assert lit.values[0, 0, inner] == pytest.approx(expected[inner], rel=4e-3)  # straight lines between 10 nm
    assert lit.luminance() == pytest.approx(scene.luminance(), rel=5e-3)
    assert load_picture(path, other, named=True).relight().values == pytest.approx(lit.values, rel=1e-6)
    refusal(replace(scene, light=None).relight, other, match="it isn't known which lamp is behind these values")


def test_a_misspelt_variable_is_refused_and_others_are_let_through(tmp_path: Path) -> None:
    """As ISETCam has it, values of dmin and dmax bring integers to photons: without them they'd be another picture."""
    levels = {"photons": np.zeros((5, 6, NM.size), np.uint16), "dmn": 0.0, "dmax": 1.0, "luminance": []}
    scene = {"type": "scene", "data": levels, "spectrum": {"wave": NM}}
    refusal(
        read_iset_scene, save(tmp_path, scene=scene), match=r"'scene/data/dmn' is unknown; did you mean 'scene/data/dm"
    )
    refusal(read_iset_scene, save(tmp_path, photons=PHOTONS, wave=NM, imgMeans=NM), match="did you mean 'imgMean'")
    read_iset_scene(save(tmp_path, photons=PHOTONS, wave=NM, comment="a", mine=1.0, dist=1.2, fov=10.0))


def test_a_scene_is_read_with_all_that_scene_to_file_writes_beside_it(tmp_path: Path) -> None:
    """`sceneToFile` without a basis saves the photons twice, in ``photons`` and in the struct ``data``."""
    lamp = {"name": "D65", "type": "illuminant", "spectrum": {"wave": NM}, "data": {"photons": np.ones(NM.size)}}
    data = {"photons": np.zeros(PHOTONS.shape), "luminance": np.empty((0, 0)), "meanL": 5.0, "bitDepth": 32.0}
    beside = {"comment": "c", "dist": 1.2, "name": "n", "type": "scene", "magnification": 1.0, "spectrum": {"wave": NM}}
    read = read_iset_scene(save(tmp_path, photons=PHOTONS, wave=NM, illuminant=lamp, fov=10.0, data=data, **beside))
    assert read.values == pytest.approx(PHOTONS * JOULE, rel=6e-8)
    assert read.horizontal_view_deg == 10.0
    table = formats()["ISETCam variable"]
    assert set(beside) <= set(table["without_effect"])
