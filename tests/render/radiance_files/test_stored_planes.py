"""Light in files: the same bits as in memory, whole, by band and at some pixels."""

from pathlib import Path

import numpy as np

from render.error_estimates import spread_pixels
from render.radiance import SpectralRadiance
from render.radiance_files.radiance_source import as_transport
from render.radiance_files.stored_planes import with_stored_light
from render.transport import halves_by_band, light_alone, relight_by_band

NM = np.arange(430.0, 780.0, 100.0)


def test_light_in_files_is_relit_to_the_bits_of_light_in_memory(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    made = as_transport(SpectralRadiance(rng.uniform(0, 1, (40, 50, NM.size)).astype(np.float32), NM))
    made.light.__dict__["difference"] = rng.normal(0, 0.1, made.light.mean.shape).astype(np.float32)
    stored = with_stored_light(made, tmp_path / "new")
    assert not isinstance(stored.light.mean, np.ndarray)
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["light_difference.npy", "light_mean.npy"]
    of_memory, of_files = (relight_by_band(x, luminance_cd_m2=2.0) for x in (made, stored))
    assert np.array_equal(of_files.whole().values, of_memory.whole().values)
    assert of_files.relative_mc_error == of_memory.relative_mc_error
    assert np.array_equal(stored.relight("A").values, made.relight("A").values)
    chosen = spread_pixels((40, 50))
    assert np.array_equal(stored.light.mean[chosen], made.light.mean[chosen])
    halves = (halves_by_band(x, luminance_cd_m2=2.0) for x in (made, light_alone(stored)))
    assert all(np.array_equal(one.whole().values, other.whole().values) for one, other in zip(*halves, strict=True))


def test_a_band_that_was_read_belongs_to_its_reader(tmp_path: Path) -> None:
    made = as_transport(SpectralRadiance(np.full((4, 5, NM.size), 0.5), NM))
    stored = with_stored_light(made, tmp_path)
    stored.light.mean[0, 1][:] = 7.0
    assert np.array_equal(stored.light.mean[0, 1], made.light.mean[0, 1])
