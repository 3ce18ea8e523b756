"""A lens by data: closed forms of its point images, light that is kept, edges by field, and tables that are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

import sensor as sensor_package
from render.radiance import SpectralRadiance
from sensor.config import LensConfig
from sensor.config_file import read_sensor
from sensor.lens.illumination import darkens, falloff
from sensor.lens.patches import mover, patches, spreader
from sensor.lens.table import lens_table, read_lens, shipped, with_lens
from sensor.lens.wavefront import orders, reach_of, sampled_kernel, transfer, zernike
from sensor.optics import form_image, image_sums, spreads
from sensor.presets import low_noise
from studies.metrics.mtf import edge_response

NM = np.array([450.0, 550.0, 650.0])
FIELD = (0.0, 0.25, 0.5, 0.75, 1.0)
STRONG = {"Z4": 40.0, "Z6": 120.0, "Z8": 100.0, "Z11": 60.0}  # nm in the corners, at 550 nm


@pytest.fixture
def write(tmp_path):
    """Write a lens's file from changes to a good one, and the CSV beside it."""

    def written(name="lens", csv=None, **changed):
        keys = {"f_number": 4.0, "field": list(FIELD), "wavelength_nm": NM.tolist()} | changed
        if csv is not None:
            (tmp_path / f"{name}.csv").write_text(csv)
            keys["point_spread"] = f"{name}.csv"
        path = tmp_path / f"{name}.toml"
        path.write_text("".join(f"{key} = {value!r}\n" for key, value in keys.items()).replace("'", '"'))
        return str(path)

    return written


def wavefronts(terms=STRONG, power=1.0, pupil=1.0) -> str:
    """CSV whose terms rise with a power of the field, and with the wavelength a little."""
    rows = [f"field,wavelength_nm,pupil_radial,pupil_across,{','.join(terms)}"]
    for field in FIELD:
        for nm in NM:
            values = [f"{value * field**power * (0.5 + nm / 1100):.9g}" for value in terms.values()]
            rows.append(",".join([f"{field},{nm},{1 + (pupil - 1) * field:.6g},1", *values]))
    return "\n".join(rows)


def kernels(sigma_um=2.0, step_um=0.5, reach=16) -> str:
    """CSV of Gaussian point images, wider along the radius towards the corners."""
    at = np.arange(-reach, reach + 1) * step_um
    rows = ["field,wavelength_nm,radial_um,across_um,energy"]
    for field in FIELD:
        radial, across = (np.exp(-0.5 * (at / s) ** 2) for s in (sigma_um * (1 + field), sigma_um))
        energy = np.outer(radial, across) / radial.sum() / across.sum()
        for nm in NM:
            rows += [
                f"{field},{nm},{y:g},{x:g},{e:.12g}"
                for y, of in zip(at, energy, strict=True)
                for x, e in zip(at, of, strict=True)
            ]
    return "\n".join(rows)


def camera(table="", pitch_um=3.0, diffraction=1.0):
    sensor = low_noise()
    lens = LensConfig(4.0, diffraction=diffraction, table=table)
    return replace(sensor, lens=lens, pixel=replace(sensor.pixel, pitch_um=pitch_um))


def light(values) -> SpectralRadiance:
    return SpectralRadiance(np.repeat(np.asarray(values, np.float64)[..., None], NM.size, axis=2), NM)


def one_band(values) -> SpectralRadiance:
    return SpectralRadiance(np.asarray(values, np.float64)[..., None], NM[1:2], width_nm=np.array([10.0]))


def lamps(shape=(20, 24)) -> SpectralRadiance:
    rng = np.random.default_rng(5)
    values = rng.random(shape)
    values[[3, 10, 19], [22, 12, 0]] = 300.0
    return light(values)


def test_polynomials_are_orthonormal_over_the_disc_and_counted_as_noll_s():
    grid = (np.arange(600) + 0.5) / 300 - 1
    x, y = np.meshgrid(grid, grid, indexing="ij")
    inside = np.hypot(x, y) < 1
    terms = np.array([zernike(j, x, y)[inside] for j in range(1, 16)])
    np.testing.assert_allclose(terms @ terms.T / inside.sum(), np.eye(15), atol=0.02)
    assert [orders(j) for j in range(1, 9)] == [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1)]
    np.testing.assert_allclose(zernike(4, x, y), 3**0.5 * (2 * (x**2 + y**2) - 1))
    np.testing.assert_allclose(zernike(2, x, y), 2 * x, atol=1e-12)
    np.testing.assert_allclose(zernike(8, x, y), 8**0.5 * (3 * (x**2 + y**2) - 2) * x, atol=1e-12)


def test_a_tilt_of_the_wave_moves_the_point_and_a_little_aberration_takes_its_marechal_share(write):
    # W = a 2 x: light lands at -2 N 2 a along the radius.
    table = read_lens(write(csv=wavefronts({"Z2": 100.0})))
    frequency = np.array([0.05, 0.1, 0.2])
    found = transfer(table, 1.0, 550.0, frequency, 0.0)
    np.testing.assert_allclose(np.angle(found), -2 * np.pi * frequency * -2 * 4.0 * 0.2, rtol=1e-3)
    ideal = transfer(read_lens(write("ideal", csv=wavefronts({"Z2": 0.0}))), 1.0, 550.0, frequency, 0.0)
    s = frequency * 0.55 * 4
    np.testing.assert_allclose(ideal.real, 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)), atol=2e-3)
    # A small wave of root mean square a lowers the peak of the point image, over an ideal one's, to exp(-(2 pi a)^2).
    small = read_lens(write("small", csv=wavefronts({"Z8": 30.0, "Z6": 20.0})))
    reach = reach_of(small, NM, 0.5)
    peaks = [sampled_kernel(small, 1.0, 0.0, 550.0, 0.5, reach, True)[0, 0]]
    cells = 0.25 * np.pi / 4 / (0.55 * 4) ** 2  # peak of an ideal one: energy of a square of 0.5 um
    assert 1 + peaks[0] / cells == pytest.approx(np.exp(-((2 * np.pi * np.hypot(30, 20) / 550) ** 2)), abs=0.01)


@pytest.mark.parametrize("samples", [1, 2])
def test_a_lens_of_no_aberration_is_today_s(write, samples):
    scene = lamps()
    today = form_image(scene, camera(), samples).values
    for name, csv in (("zeros", wavefronts(dict.fromkeys(STRONG, 0.0))), ("empty", None)):
        found = form_image(scene, camera(write(name, csv=csv)), samples).values
        np.testing.assert_allclose(found, today, atol=1e-6 * today.mean(), rtol=1e-6)
    point = "field,wavelength_nm,radial_um,across_um,energy\n" + "\n".join(
        f"{field},{nm},{y},{x},{float(x == y == 0)}"
        for field in FIELD
        for nm in NM
        for y in (-1, 0, 1)
        for x in (-1, 0, 1)
    )
    sharp = form_image(scene, camera(diffraction=0.0), samples).values
    if samples == 1:  # finer samples show how wide a kernel's points are
        found = form_image(scene, camera(write("point", csv=point, wavelength_nm=NM.tolist())), 1).values
        np.testing.assert_allclose(found, sharp, atol=1e-6 * sharp.mean(), rtol=1e-6)


@pytest.mark.parametrize("csv", [wavefronts(), kernels()], ids=["wavefronts", "kernels"])
@pytest.mark.parametrize("samples", [1, 2])
def test_light_is_kept_and_an_even_wall_stays_even(write, csv, samples):
    dark, wall = np.zeros((60, 66)), np.ones((60, 66))
    dark[28:32, 30:34] = np.random.default_rng(3).random((4, 4))
    lens = camera(write(csv=csv), pitch_um=12.0)
    found = form_image(one_band(dark), lens, samples).values
    kept = form_image(one_band(dark), camera(diffraction=0.0, pitch_um=12.0), samples).values
    assert found.min() >= 0
    assert np.abs(found - kept).max() > 0.005 * kept.max()
    assert found.sum() == pytest.approx(kept.sum(), rel=1e-4)
    even = form_image(one_band(wall), lens, samples).values
    np.testing.assert_allclose(even, even.mean(), rtol=0.05)


def test_windows_sum_to_one_and_places_reach_the_corners():
    for shape in ((31, 50), (1, 7), (2, 2), (200, 3)):
        total = np.zeros(shape)
        laid = patches(shape, 5)
        for patch in laid:
            total[patch.rows, patch.columns] += patch.window
        np.testing.assert_allclose(total, 1.0, rtol=1e-12)
        assert max(patch.height for patch in laid) == pytest.approx(1.0)


def test_point_images_turn_with_the_azimuth(write):
    table = read_lens(write(csv=wavefronts({"Z8": 150.0})))
    side, step_um = 41, 6.0
    spread = spreader(table, (side, side), step_um, True, 1)
    offsets = []
    for row, column in ((0, 20), (20, 40), (40, 20), (20, 0)):
        lamp = np.zeros((side, side))
        far = 20 + (row - 20) // 2, 20 + (column - 20) // 2
        lamp[far] = 1.0
        change = spread(lamp, 550.0)
        offsets.append([(change.sum(axis=1 - axis) * (np.arange(side) - far[axis])).sum() for axis in (0, 1)])
    outward = [(-1, 0), (0, 1), (1, 0), (0, -1)]
    along = [np.dot(moved, way) for moved, way in zip(offsets, outward, strict=True)]
    across = [np.dot(moved, way[::-1]) for moved, way in zip(offsets, outward, strict=True)]
    np.testing.assert_allclose(along, along[0], rtol=0.03)
    np.testing.assert_allclose(across, 0.0, atol=0.03 * abs(along[0]))
    assert abs(along[0]) > 0.05


def edge_at(table, row, column, side, samples=2):
    """MTF of a vertical edge, 5 degrees off, through a place."""
    y, x = (np.arange(side * samples) + 0.5) / samples, (np.arange(side * samples) + 0.5) / samples
    distance = (x - column) - (y[:, None] - row) * np.tan(np.radians(5.0))
    scene = one_band(1.0 + np.clip(distance * samples + 0.5, 0, 1))
    image = form_image(scene, camera(table), samples).values[..., 0]
    near = slice(max(row - 20, 0), row + 20), slice(max(column - 48, 0), column + 48)
    return edge_response(image[near])


@pytest.mark.thorough
@pytest.mark.parametrize(
    "csv",
    [wavefronts(), wavefronts(pupil=0.8), kernels(), wavefronts({"Z8": 300.0})],
    ids=["round", "cut", "kernels", "coma"],
)
@pytest.mark.parametrize("place", [(256, 256), (256, 420), (80, 256)], ids=["axis", "radial", "across"])
def test_slanted_edges_by_field_have_the_table_s_mtf(write, csv, place):
    """Along the edge's own normal, 5 degrees off: of strong coma the other way would be up to 0.014 apart.

    What is left of strong coma is 0.018 at most, as much with twice the places, and 0.007 for twice the pixels: a
    point's image changes over its own width.
    """
    side, path = 512, write(csv=csv)
    edge = edge_at(path, *place, side)
    away = np.array(place) - side / 2
    height = float(np.hypot(*away)) / np.hypot(side, side) * 2
    frequency = np.linspace(0.05, 0.5, 10)
    radial = abs(away[1]) >= abs(away[0])  # the edge's normal lies along the columns
    along, across = frequency / 3.0 * np.cos(np.radians(5.0)), frequency / 3.0 * np.sin(np.radians(5.0))
    at = (along, across) if radial else (across, along)
    said = np.abs(transfer(read_lens(path), height, 550.0, *at)) * np.sinc(frequency)
    found = np.interp(frequency, edge.frequency_cycles_per_px, edge.mtf)
    np.testing.assert_allclose(found, said, atol=0.02)


def test_relative_illumination_falls_by_the_table_and_is_undone_by_it(write):
    path = write(relative_illumination=[1.0, 0.95, 0.8, 0.6, 0.4])
    lens = LensConfig(4.0, table=path)
    assert darkens(lens)
    shape = (30, 40)
    heights = np.hypot(*np.meshgrid(np.arange(40) - 19.5, np.arange(30) - 14.5)) / 25.0
    np.testing.assert_allclose(falloff(lens, shape), read_lens(path).illumination(heights))
    np.testing.assert_allclose(read_lens(path).illumination(np.array(FIELD)), [1.0, 0.95, 0.8, 0.6, 0.4])
    image = form_image(light(np.ones(shape)), camera(path, pitch_um=60.0)).values[..., 1]
    np.testing.assert_allclose(image / image[15, 20], falloff(lens, shape) / falloff(lens, shape)[15, 20], atol=0.01)


def test_distortion_and_lateral_colour_move_a_spot_as_the_table_says(write):
    # A smooth spot at the ideal image height 0.5 along the columns, on a field of 0.
    rows, columns = np.mgrid[:121, :161].astype(float)
    half = np.hypot(121, 161) / 2
    spot = np.exp(-((rows - 60) ** 2 + (columns - 80 - 0.5 * half) ** 2) / 18.0)
    path = write(
        distortion=[0.0, -0.01, -0.04, -0.05, -0.06], lateral_um=[[0, 2, 4, 6, 8], [0] * 5, [0, -1, -2, -3, -4]]
    )
    moved = mover(read_lens(path), spot.shape, 3.0)
    for nm, lateral_um in ((450.0, 4.0), (550.0, 0.0), (500.0, 2.0), (650.0, -2.0), (700.0, -2.0)):
        found = moved(spot, nm)
        landed = (found.sum(axis=0) * np.arange(161)).sum() / found.sum() - 80
        assert landed == pytest.approx(0.5 * half * 0.96 + lateral_um / 3.0, abs=0.15), nm
    same = write("same", lateral_um=[[0] * 5] * 3)
    assert mover(read_lens(same), spot.shape, 3.0)(spot, 450.0) is spot
    assert spreads(LensConfig(4.0, table=same))


def test_sums_over_bands_are_those_of_the_image(write):
    path = write(csv=wavefronts(), lateral_um=[[0, 2, 4, 6, 8], [0] * 5, [0, -1, -2, -3, -4]])
    scene, weights = lamps(), np.array([[1.0, 0.5, 0.0], [0.0, 0.2, 1.0]])
    image = form_image(scene, camera(path)).values
    np.testing.assert_allclose(
        image_sums(scene, weights, camera(path)), image @ weights.T, atol=1e-2 * image.mean(), rtol=1e-3
    )


def test_bad_tables_are_refused_in_one_line(write, tmp_path):
    good = wavefronts()
    refusal(read_lens, "cook_triplet", match="lens: 'cook_triplet' is unknown")
    refusal(read_lens, str(tmp_path / "none.toml"), match="lens file: .*can't be read")
    refusal(read_lens, write(field=[0.0, 0.5, 0.5, 1.0]), match="field: .*doesn't rise")
    refusal(read_lens, write(field=[0.1, 0.5, 1.0]), match="field: .*give both ends")
    refusal(read_lens, write(wavelength_nm=[650.0, 450.0]), match="wavelength_nm: .*doesn't rise")
    refusal(read_lens, write(wavelength_nm=[0.45, 0.55]), match="give nanometres")
    refusal(read_lens, write(relative_illumination=[1.0, 0.9]), match="2 numbers for 5 fields; .*fill the gaps")
    refusal(read_lens, write(relative_illumination=[0.9, 0.8, 0.7, 0.6, 0.5]), match="divide all by it")
    refusal(read_lens, write(relative_illumination=[1.0, -0.8, 0.7, 0.6, 0.5]), match="-0.8 is outside 0.001 to 10")
    refusal(read_lens, write(distortion=[0.0, -0.1, -0.2, -0.5, -0.8]), match="folds the picture")
    refusal(read_lens, write(lateral_um=[[0.0] * 5]), match="1 rows for 3 wavelengths")
    lines = good.splitlines()
    refusal(read_lens, write(csv="\n".join(lines[:-1])), match="rows: none at field 1, 650 nm; .*fill the gap")
    refusal(read_lens, write(csv="\n".join([*lines, lines[-1]])), match="16 for 5 fields and 3 wavelengths")
    refusal(read_lens, write(csv=good.replace("0.5,450", "0.4,450")), match="field: 0.4 is none of the lens's")
    refusal(read_lens, write(csv=good.replace("Z4", "W4")), match="columns: .*rename them")
    refusal(read_lens, write(csv=good.replace("Z6", "Z4")), match="Z4, Z4, .*each once")
    refusal(read_lens, write(csv=good + "\n1,550,x"), match="row 17: .*mend it")
    few = kernels(reach=2)
    refusal(
        read_lens, write(csv=few.replace(few.splitlines()[1], "0.0,450.0,-1,-1,-0.1")), match="energy: -0.1; allowed"
    )
    refusal(read_lens, write(csv=few.replace(few.splitlines()[1], "0.0,450.0,-1,-1,0.9")), match="energy: sums from")
    refusal(
        lens_table,
        LensConfig(2.8, table=write()),
        match="f_number: 2.8 with the lens .*allowed: 4, where its table holds",
    )
    refusal(lens_table, LensConfig(4.0, table=write(), defocus_um=3.0), match="defocus_um: 3 with the lens")


def test_shipped_lenses_are_whole_and_a_sensor_file_finds_its_lens_beside_it(write, tmp_path):
    assert shipped() == ("cooke_triplet", "double_gauss", "double_gauss_f4")
    for name in shipped():
        table = lens_table(with_lens(low_noise(), name).lens)
        seen = [float(np.abs(transfer(table, height, 550.0, 0.05, 0.0))) for height in (0.0, 0.5, 1.0)]
        assert 0.1 < min(seen) <= max(seen) < 0.9
        assert (table.relative_illumination[-1] < 0.9) == (name != "double_gauss_f4")
    path = tmp_path / "camera.toml"
    write("mine")
    given = (Path(sensor_package.__file__).parent / "data" / "low_noise.toml").read_text()
    own = given[: given.index("[lens]")] + '[lens]\ntable = "mine.toml"\n'
    path.write_text(own)
    sensor = read_sensor(path)
    assert sensor.lens.f_number == 4.0
    assert sensor.lens.table == str(tmp_path / "mine.toml")
    path.write_text(own + "f_number = 2.8\n")
    refusal(read_sensor, path, match="camera.toml.*: f_number: 2.8 with the lens .*allowed: 4")


def test_a_lens_stopped_down_passes_the_middle_of_the_wave_that_it_passes_wide_open():
    """On the axis both waves differ by one focus for all wavelengths: of a shift z, z (1 - cos) of each ray's angle.

    Wide open the terms leave 0.008 um of the rays' places unexplained: 1 nm over the sine of 1/8 that f/4 passes.
    """
    wide, narrow = (read_lens(name) for name in ("double_gauss", "double_gauss_f4"))
    sines = np.linspace(0.0, 0.99 / 8, 40)
    shifts_um = []
    for nm in wide.wavelength_nm:
        paths_nm = []
        for table in (wide, narrow):
            coefficients, (half, _) = table.wavefront_nm(0.0, nm)
            place = sines * 2 * table.f_number / half
            terms = [zernike(j, place, np.zeros_like(place)) for j in table.point_spread.noll]
            paths_nm.append(coefficients @ np.array(terms))
        basis = np.stack([np.ones_like(sines), 1e3 * (1 - np.sqrt(1 - sines**2))], axis=1)
        apart_nm = paths_nm[0] - paths_nm[1]
        fitted, *_ = np.linalg.lstsq(basis, apart_nm, rcond=None)
        np.testing.assert_allclose(basis @ fitted, apart_nm, rtol=0, atol=1.0)
        shifts_um.append(fitted[1])
    assert abs(np.mean(shifts_um)) > 5
    assert np.ptp(shifts_um) < 2 * 0.008 * 8
    assert narrow.relative_illumination[-1] > 0.9
    assert wide.relative_illumination[-1] < 0.6


def test_files_that_change_under_a_camera_are_refused_and_their_hash_goes_with_the_table(write, tmp_path):
    path = write(csv=wavefronts())
    sensor = with_lens(low_noise(), path)
    assert lens_table(sensor.lens).digest == sensor.lens.table_digest
    write(csv=wavefronts({"Z4": 10.0}))
    refusal(lens_table, sensor.lens, match="lens.toml.*has changed since the camera was made; .*make the camera anew")
    assert lens_table(with_lens(low_noise(), path).lens).point_spread.noll == (4,)
    assert replace(sensor.lens, table="").table_digest == ""
