"""A picture file where a scene would stand: the same radiance out, levels as a scene's, no plane for lux."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from loop import loop
from refusal import refusal

from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.radiance_files.radiance_source import as_transport, is_radiance_file, load_radiance
from render.spectrum import Spectrum

NM = np.array([350.0, 450.0, 589.3, 1200.0])
WIDTHS = np.array([100 / 3, 20.0, 1.0, 0.7])
VALUES = (10 ** np.random.default_rng(4).uniform(-9, 3, (6, 5, 4))).astype(np.float32)


def test_relit_at_a_spectrum_of_one_every_bit_is_the_files() -> None:
    transport = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS))
    relit = transport.relight()
    assert np.array_equal(relit.values, VALUES)
    assert relit.wavelength_nm.tolist() == NM.tolist()
    assert relit.widths_nm.tolist() == WIDTHS.tolist()
    even, odd = transport.relight_halves()
    assert np.array_equal(even.values, VALUES)
    assert np.array_equal(odd.values, VALUES)


def test_level_scales_to_a_mean_luminance() -> None:
    relit = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS)).relight(luminance_cd_m2=25.0)
    assert relit.luminance().mean() == pytest.approx(25.0, rel=1e-6)
    assert relit.values / VALUES == pytest.approx(np.full(VALUES.shape, relit.values[0, 0, 0] / VALUES[0, 0, 0]))


def test_illuminance_has_no_plane_and_the_group_has_a_name() -> None:
    transport = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS), "street")
    assert transport.illuminance_lux(25.0) is None
    assert list(transport.groups) == ["street"]
    refusal(transport.relight, illuminance_lux=100.0, match="reference plane")


def test_spectrum_of_the_group_is_a_factor() -> None:
    light = Spectrum(np.array([300.0, 600.0, 1300.0]), np.array([1.0, 3.0, 0.5]))
    relit = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS)).relight({"scene": light})
    assert relit.values == pytest.approx(VALUES * light.band_average(NM, WIDTHS), rel=1e-6)


@loop("error", [0.0, 0.02])
def test_error_of_an_even_picture_is_what_the_file_states(error: float) -> None:
    picture = SpectralRadiance(np.full((6, 5, 4), 3e-5), NM, error, WIDTHS)
    assert as_transport(picture).relight().relative_mc_error == pytest.approx(error, rel=1e-5)


def test_radiance_whose_square_is_over_float32_has_a_finite_error() -> None:
    picture = SpectralRadiance(np.full((2, 2, 4), 1e30, np.float32), NM, 0.1, WIDTHS)
    assert np.isfinite(as_transport(picture).relight().relative_mc_error)


def test_ending_tells_the_reader(tmp_path: Path) -> None:
    radiance = SpectralRadiance(VALUES, NM, width_nm=WIDTHS)
    write_exr(radiance, tmp_path / "a.EXR")
    assert np.array_equal(load_radiance(tmp_path / "a.EXR").values, VALUES)
    scipy.io.savemat(tmp_path / "a.mat", {"photons": np.ones((2, 3, 2)), "wave": [500.0, 510.0]})
    assert load_radiance(str(tmp_path / "a.mat")).shape == (2, 3)
    assert [is_radiance_file(name) for name in ("a.exr", "b/A.MAT", "still_life", "exr", "a.exr.txt")] == [
        *(True, True),
        *(False, False, False),
    ]
    refusal(load_radiance, "a.ext", match=r"'\.ext' is unknown; allowed: .*; did you mean '\.exr'")
