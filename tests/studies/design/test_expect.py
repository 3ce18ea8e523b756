"""Expected errors of cameras: electrons and gains counted another way, symmetry, light, refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from isp.design.expected_error import Noise, expected_error, sampled, single_gaussian
from isp.design.spectral_prior import PRIORS, load_spectral_prior
from isp.ple.prior import mixture, own_prior
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum, tristimulus
from rodcone.colour_spaces import adapt_to_d65, encode_srgb
from rodcone.errors import InputError
from sensor.cfa import Tile, quad
from sensor.config import SensorConfig, with_channel_readings
from sensor.config_file import read_sensor
from sensor.exposure import exposure_of_electrons_s
from sensor.noise_law import NoiseLaw
from sensor.optics import form_image
from sensor.pixel import ChannelReading
from sensor.presets import low_noise, preset, vary
from sensor.readings.resolve import chip_readings, resolve
from sensor.response import behind_filters
from studies.design.expect import (
    MIDDLE,
    _lab_root,
    drawn_pixels,
    expect,
    exposed,
    lens_of,
    metric_rows,
    noise_of,
    responses_e,
    sampling_of,
    view_of,
)
from studies.metrics.truth import neutral_electrons
from studies.photograph.camera import calibrate
from studies.study.study_file import read_study

ROOT = Path(__file__).resolve().parents[3]
LEVELS = (0.036, 2.0, 25.0)
BAYER, RGBW = low_noise("bayer"), low_noise("rgbw")


def gain_db(tile: Tile, prior: str) -> np.ndarray:
    return psnr_db(preset("low_noise", tile), prior) - psnr_db(BAYER, prior)


def psnr_db(sensor: SensorConfig, prior: str = "drawn") -> np.ndarray:
    return np.array([row.psnr_db for row in expect(sensor, LEVELS, prior=prior)])


def test_a_white_surface_gives_the_electrons_of_a_neutral() -> None:
    for light in ["D65", "A"]:
        prior, seen = load_spectral_prior("drawn"), view_of("drawn", light)
        white = np.linalg.lstsq(prior.spectra, np.ones(len(prior.spectra)), rcond=None)[0]
        # White lies in the span of the basis to a thousandth.
        assert_allclose(responses_e(RGBW, seen) @ white, neutral_electrons(RGBW, seen.light, 1.0), rtol=2e-3)
        assert_allclose(seen.xyz @ white, [0.9505, 1.0, 1.089], rtol=2e-3)


@pytest.mark.thorough
def test_gain_agrees_with_that_under_the_prior_that_ple_ships() -> None:
    """Counted another way: roots of signal of R, G, B and W, dense matrices; both after the colour matrix of R, G, B.

    They agree within 0.15 dB; the brightness of a patch is unknown in both.
    """
    green_e = np.array([2.0, 5.0, 20.0, 100.0, 500.0])  # from white
    held, seen = load_spectral_prior("drawn"), view_of("drawn", "D65")
    matrix = np.asarray(calibrate(RGBW, illuminant("D65")).to_srgb)[:, :3]
    responses, noise = responses_e(RGBW, seen), Noise(NoiseLaw(shot=1.0, dark_e=1.8), full_e=np.inf)
    white = np.linalg.lstsq(held.spectra, np.ones(len(held.spectra)), rcond=None)[0]
    to_srgb = matrix @ (responses / (responses @ white)[:, None])[:3]
    per_cd_m2 = neutral_electrons(BAYER, seen.light, 1.0)[1]

    nodes, shares = np.polynomial.hermite_e.hermegauss(40)

    def slopes(mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
        deviation = np.sqrt(variance)
        values = encode_srgb(mean[..., None] + deviation[..., None] * nodes)
        return np.asarray(values @ (shares * nodes) / shares.sum() / deviation)

    def ours(tile: Tile, white_e: float) -> float:
        sensor, total = preset("low_noise", tile), 0.0
        sharp = lens_of(sensor, False)
        samples = sampled(held.patches, sampling_of(sensor, responses_e(sensor, seen), sharp), MIDDLE, sharp)
        for m in held.reflectances:
            spread = (m * to_srgb @ held.patches.factors[:, MIDDLE]) ** 2
            mean = held.patches.means[:, MIDDLE] @ (m * to_srgb).T
            rows = slopes(mean, spread.sum(axis=-1))[..., None] * m * to_srgb
            forms = (rows.swapaxes(-1, -2) @ rows)[None]
            total += float(expected_error(samples, m * white_e / per_cd_m2, noise, forms)[0])
        return total

    def theirs(tile: Tile, white_e: float) -> float:
        prior, mix = own_prior(), mixture(own_prior())
        channel = np.array([["RGBW".index(tile[y % 2][x % 2]) for x in range(8)] for y in range(8)]).ravel()
        at, total = 4 * np.arange(64) + channel, 0.0
        for m in held.reflectances:
            electrons = m * white_e * prior.neutral_e[channel]
            for weight, mean, covariance in zip(np.exp(mix.log_weights), mix.means, mix.covariances, strict=True):
                alike = covariance * (2 * mean[:, None]) * (2 * mean)  # of roots, about the mean
                signals = alike + np.outer(mean**2, mean**2) * held.patches.brightness**2
                read = electrons * np.maximum(mean[at], 0.05) ** 2 + noise.law.dark_e**2
                cross = signals[:, at] * electrons
                left = signals - cross @ np.linalg.solve(electrons[:, None] * cross[at] + np.diag(read), cross.T)
                for pixel in 4 * MIDDLE:
                    spread = np.diagonal(matrix @ alike[pixel : pixel + 3, pixel : pixel + 3] @ matrix.T)
                    rows = slopes(m * matrix @ mean[pixel : pixel + 3] ** 2, m**2 * spread)[:, None] * m * matrix
                    total += weight * np.trace(rows @ left[pixel : pixel + 3, pixel : pixel + 3] @ rows.T)
        return total

    for white_e in green_e:
        gains = [10 * np.log10(error(BAYER.cfa, white_e) / error(RGBW.cfa, white_e)) for error in (ours, theirs)]
        assert abs(gains[0] - gains[1]) < 0.15


def test_the_root_of_lab_is_cie_15_s_by_the_other_notation() -> None:
    """t / (3 d^2) + 4 / 29 up to d^3, d = 6 / 29; no light reads as black, nor does less than none."""
    relative, d = np.array([-0.1, 0.0, 1e-4, 0.004, 0.0088, 0.0089, 0.2, 1.0]), 6 / 29
    light = np.maximum(relative, 0.0)
    by_hand = np.where(light > d**3, np.cbrt(light), light / (3 * d**2) + 4 / 29)
    assert_allclose(_lab_root(relative), by_hand, rtol=1e-9)


def test_slopes_of_srgb_and_lab_are_those_of_the_nearest_line_over_a_component() -> None:
    """Covariance over variance of 200 000 draws; of the commonest component, and of the one whose blue is the least."""
    import colour

    prior, seen, reflectance = load_spectral_prior("drawn"), view_of("drawn", "D65"), 0.3
    patches, rng, white = prior.patches, np.random.default_rng(1), np.array([0.9505, 1.0, 1.089])
    rows, direction = metric_rows(prior, seen, reflectance), rng.standard_normal(seen.xyz.shape[1])
    blue = np.einsum("c,kc->k", colour.XYZ_to_sRGB(seen.xyz.T, apply_cctf_encoding=False)[:, 2], patches.means[:, 18])
    for k in (int(np.argmax(patches.weights)), int(np.argmin(blue))):
        covariance = patches.factors[k, 18] @ patches.factors[k, 18].T + patches.rest[k] * np.eye(len(direction))
        # row 2, column 2: the first that counts
        draws = rng.multivariate_normal(patches.means[k, 18], covariance, 200_000)
        xyz = reflectance * draws @ seen.xyz.T
        linear = colour.XYZ_to_sRGB(xyz, apply_cctf_encoding=False)
        y, a, b = (colour.XYZ_to_Lab(np.maximum(xyz, 0.0), colour.XYZ_to_xy(white)) / (116, 500, 200)).T
        ends = (
            reflectance * seen.xyz @ direction,
            colour.XYZ_to_sRGB(reflectance * seen.xyz @ direction, apply_cctf_encoding=False),
        )

        def change(curve: np.ndarray, of: np.ndarray, along: float) -> float:
            return float(np.cov(curve, of)[0, 1] / of.var() * along)

        srgb = [change(colour.cctf_encoding(np.clip(linear[:, c], 0, 1)), linear[:, c], ends[1][c]) for c in range(3)]
        roots = [change(root, xyz[:, c], ends[0][c]) for c, root in enumerate((y + a, y, y - b))]
        lab = np.array([116 * roots[1], 500 * (roots[0] - roots[1]), 200 * (roots[1] - roots[2])])
        ours = [row[k, 0] @ direction for row in rows]
        assert_allclose(ours[0] * np.sqrt(3), srgb, rtol=0.03, atol=0.01)
        assert_allclose(np.concatenate(ours[2:]), lab, rtol=0.03, atol=0.02 * np.abs(lab).max())


def test_a_pixel_of_several_readings_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"readings: 3 of a pixel; allowed: none; give \[pixel\] the well and noise of"
    ):
        expect(preset("split_pixel"), LEVELS)


@pytest.mark.thorough
def test_a_turned_or_mirrored_tile_has_the_same_error() -> None:
    tiles = (("RG", "BW"), ("GW", "RB"), ("WB", "GR"), ("GR", "WB"))
    db = [psnr_db(preset("low_noise", tile)) for tile in tiles]
    assert np.ptp(db, axis=0).max() < 0.05  # patches were turned at random: the prior is symmetric up to chance


def test_a_tile_and_a_prior_turned_or_mirrored_together_have_the_same_error() -> None:
    seen, sharp, patches = view_of("drawn", "D65"), lens_of(RGBW, False), load_spectral_prior("drawn").patches
    pixels, forms = np.arange(64).reshape(8, 8), np.broadcast_to(np.eye(8), (1, 48, 16, 8, 8))

    def error(moved: np.ndarray, tile: Tile) -> float:
        prior = replace(patches, means=patches.means[:, moved.ravel()], factors=patches.factors[:, moved.ravel()])
        sensor = preset("low_noise", tile)
        samples = sampled(prior, sampling_of(sensor, responses_e(sensor, seen), sharp), MIDDLE, sharp)
        return float(expected_error(samples, 5.0, Noise(NoiseLaw(shot=1.0, dark_e=2.0), full_e=np.inf), forms)[0])

    still = error(pixels, ("RG", "BW"))
    assert error(np.rot90(pixels), ("GW", "RB")) == pytest.approx(still, rel=1e-9)
    assert error(pixels[:, ::-1], ("GR", "WB")) == pytest.approx(still, rel=1e-9)


@pytest.mark.thorough
def test_error_falls_with_light_and_rises_with_noise_a_smaller_well_and_crosstalk() -> None:
    def db(sensor: SensorConfig, level: float = 2.0) -> float:
        return expect(sensor, [level], exposure=0.02)[0].psnr_db

    def changed(**terms: float) -> SensorConfig:
        return replace(RGBW, pixel=replace(RGBW.pixel, **terms))

    assert db(RGBW, 4.0) > db(RGBW)
    assert db(changed(read_noise_e=5.0)) < db(RGBW)
    assert db(changed(crosstalk=0.1)) < db(RGBW)
    assert db(changed(prnu=0.1)) < db(RGBW)
    assert db(changed(dark_current_e_per_s=1e4)) < db(RGBW)
    assert db(changed(full_well_e=1000.0), 100.0) < db(RGBW, 100.0)


def test_a_lens_that_spreads_light_raises_the_error_under_noise_and_one_that_does_not_leaves_it() -> None:
    def db(**terms: float) -> float:
        return expect(replace(RGBW, lens=replace(RGBW.lens, **terms)), [25.0], exposure=0.01, blur=True)[0].psnr_db

    still = expect(RGBW, [25.0], exposure=0.01)[0].psnr_db
    assert db(diffraction=0.0) == pytest.approx(still, abs=1e-9)
    sharp = db(diffraction=1.0)
    for by_width in ([still, sharp, db(diffraction=2.0)], [sharp, db(defocus_um=4.0), db(defocus_um=8.0)]):
        assert all(np.diff(by_width) < -0.1), by_width


def test_blur_is_that_of_a_point_in_an_image() -> None:
    matrix, radiance = lens_of(RGBW, True), np.zeros((8, 8, 1))
    radiance[3, 4] = 1.0
    image = form_image(SpectralRadiance(radiance, np.array([550.0]), width_nm=np.ones(1)), RGBW).values[..., 0]
    assert_allclose(matrix[:, 28].reshape(8, 8), image / image.sum(), atol=1e-9)


def test_component_known_is_ahead_of_a_linear_estimate() -> None:
    assert all(row.psnr_db > row.linear_psnr_db for row in expect(RGBW, LEVELS))


def test_no_mosaic_is_given_a_patchs_brightness() -> None:
    """Where it was known, RCCB learnt green from it: 1.0 dB behind Bayer in colour by day, 4.6 +- 1.0 simulated."""
    clear, bayer = (expect(vary(preset("low_noise"), name), [25.0], blur=True)[0] for name in ("rccb", "bayer"))
    assert 20 * np.log10(clear.colour / bayer.colour) > 3.0
    dark = expect(BAYER, [1e-6])[0]  # without light what is unknown is the brightness, and more
    assert dark.lightness > load_spectral_prior("drawn").patches.brightness * 116 / 3 * 0.2 ** (1 / 3)


def test_cones_pay_by_day_and_interleaved_ones_more_than_clumped() -> None:
    cameras = [read_sensor(Path(file)) for file in read_study(ROOT / "studies/configs/eye.toml").sensors]
    cameras = [vary(cameras[0], "V/V"), *cameras]
    rods, interleaved, clumped, cones = (
        [row.psnr_db for row in expect(x, [0.01, 10.0], exposure=0.1)] for x in cameras
    )
    for paying in (interleaved, cones):
        assert np.sign(np.subtract(paying, rods)).tolist() == [-1.0, 1.0]
    assert interleaved[0] > clumped[0]
    assert interleaved[1] > clumped[1] + 0.1


@pytest.mark.thorough
@pytest.mark.parametrize("prior", PRIORS)
def test_quads_lose_and_white_wins_in_the_dark(prior: str) -> None:
    assert (gain_db(quad(("RG", "GB")), prior) < 0).all()
    assert gain_db(("RG", "BW"), prior)[0] > 0.3


def test_exposure_meters_no_surface_that_reflects_more_than_all_light() -> None:
    for prior in PRIORS:
        reflectances = drawn_pixels(prior) @ load_spectral_prior(prior).spectra.T
        assert reflectances.max() == pytest.approx(1.0)  # some would, and are taken down to that


@pytest.mark.thorough
@pytest.mark.parametrize("cfa", ["rgbw", "bayer"])
def test_more_light_never_costs_and_the_ladders_time_is_the_forecasts_own_best(cfa: str) -> None:
    """Over 13 to 1000 cd/m2 at thirds of a stop of the time; the rule's own error knows nothing of the prior."""
    sensor = preset("low_noise", cfa)
    rows = expect(sensor, [13.0, 30.0, 63.0, 106.0, 1000.0])
    gained = np.diff([row.psnr_db for row in rows])
    assert gained.min() > -0.05
    chosen = rows[-1]
    others = [expect(sensor, [1000.0], exposure=chosen.exposure_s * 2.0 ** (k / 3))[0].psnr_db for k in (-3, -1, 1, 3)]
    assert max(others) - chosen.psnr_db < 0.05


@pytest.mark.parametrize("name", list(PRIORS))
def test_a_coefficients_reflectance_stands_in_the_band_that_its_edges_name(name: str) -> None:
    """Colours of surfaces with an edge, by the prior's basis, beside those by the reflectance itself in 1 nm."""
    prior, seen = load_spectral_prior(name), view_of(name, "D65")
    middles_nm = (prior.edges_nm[:-1] + prior.edges_nm[1:]) / 2
    for row, nm in zip(prior.spectra, middles_nm, strict=True):
        index = int(np.argmin(abs(seen.light.wavelength_nm - nm)))
        assert_allclose(seen.basis[index], row, rtol=1e-12)
    for edge_nm in (500.0, 590.0):
        smooth = 1 / (1 + np.exp(-(middles_nm - edge_nm) / 20.0))
        coefficients = np.linalg.lstsq(prior.spectra, smooth, rcond=None)[0]
        fitted = prior.spectra @ coefficients
        nm = seen.light.wavelength_nm
        exact = fitted[np.clip(np.searchsorted(prior.edges_nm, nm, side="left") - 1, 0, len(fitted) - 1)]
        white = tristimulus(seen.light.spectrum, nm, seen.light.width_nm)
        xyz = adapt_to_d65(tristimulus(seen.light.spectrum * exact, nm, seen.light.width_nm), white)
        assert_allclose(seen.xyz @ coefficients, xyz, rtol=1e-9)
        # The edge stands where it was put: half of the basis's own rise lies at its wavelength.
        rise = np.interp(edge_nm, middles_nm, fitted)
        assert rise == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("name", list(PRIORS))
def test_the_mean_patch_reflects_as_much_luminance_as_its_file_states(name: str) -> None:
    """The file's unit is a mean luminous reflectance of 1 under equal energy; a band off, it is 0.94 or 1.06."""
    prior, light = load_spectral_prior(name), view_of(name, "E").light
    spectrum = prior.spectra @ (prior.patches.weights @ prior.patches.means.mean(axis=1))
    reflectance = Spectrum((prior.edges_nm[:-1] + prior.edges_nm[1:]) / 2, spectrum).band_average(
        light.wavelength_nm, np.full(light.wavelength_nm.size, 1.0)
    )
    seen = tristimulus(light.spectrum * reflectance, light.wavelength_nm, light.width_nm)
    white = tristimulus(light.spectrum, light.wavelength_nm, light.width_nm)
    assert seen[1] / white[1] == pytest.approx(1.0, abs=0.01)


def test_a_metered_channel_has_the_noise_of_the_time_that_its_frame_needs() -> None:
    """Forecast as the camera whose W takes that share of the time whatever the light is."""
    metered = with_channel_readings(low_noise(), [ChannelReading("W", metered=True)])
    level, time_s = 300.0, 0.02
    white = level / load_spectral_prior("drawn").reflectances.mean()
    light_e = np.maximum(drawn_pixels("drawn") @ responses_e(metered, view_of("drawn", "D65")).T, 0.0) * white * time_s
    share = resolve(metered, behind_filters(light_e, metered), time_s)[1].time_share
    assert share < 0.8
    fixed = with_channel_readings(low_noise(), [ChannelReading("W", time_share=share)])
    assert expect(metered, [level], exposure=time_s) == expect(fixed, [level], exposure=time_s)
    assert expect(metered, [level], exposure=time_s) != expect(low_noise(), [level], exposure=time_s)


def test_each_figure_is_that_of_its_own_metric_and_estimate() -> None:
    """Counted again from the closed form's parts; the linear estimate is worse, and no two figures are alike."""
    spectral, seen, level = load_spectral_prior("drawn"), view_of("drawn", "D65"), 2.0
    row = expect(BAYER, [level], exposure=0.02)[0]
    sampling = sampling_of(BAYER, responses_e(BAYER, seen), lens_of(BAYER, False))
    # a scene's level is the mean over its patches' reflectances
    white, noise = level / np.mean(spectral.reflectances), noise_of(chip_readings(BAYER, 0.02))
    found = []
    for patches in (spectral.patches, single_gaussian(spectral.patches)):
        samples, errors = sampled(patches, sampling, MIDDLE, np.eye(len(sampling))), []
        for mean in spectral.reflectances:
            forms = np.array([rows.swapaxes(-1, -2) @ rows for rows in metric_rows(spectral, seen, mean)])
            if len(patches.weights) == 1:
                forms = np.tensordot(spectral.patches.weights, forms, (0, 1))[:, None]
            errors.append(expected_error(samples, mean * white * 0.02, noise, forms))
        found.append(np.mean(errors, axis=0))
    known, linear = found
    told = (row.psnr_db, row.luminance_db, row.linear_psnr_db, row.lightness, row.colour)
    expected = (*-10 * np.log10(known[:2]), -10 * np.log10(linear[0]), *np.sqrt(known[2:]))
    assert told == pytest.approx(expected, rel=1e-9)
    assert min(np.diff(np.sort(expected))) > 0.01
    assert (-10 * np.log10(known) > -10 * np.log10(linear) + 0.3).all()


def test_a_samples_room_in_the_well_is_what_dark_current_leaves() -> None:
    dark = replace(BAYER, pixel=replace(BAYER.pixel, dark_current_e_per_s=50_000.0))
    frame = np.full((4, 4), 100.0)
    assert noise_of(resolve(BAYER, frame, 0.1)).full_e == pytest.approx(BAYER.top_e)
    assert noise_of(resolve(dark, frame, 0.1)).full_e == pytest.approx(BAYER.top_e - 5000.0)


def test_each_samples_noise_is_that_of_its_own_channel_in_every_term() -> None:
    """White, read after a quarter of the time behind a density of 2, has eight times its electrons' shot noise."""
    terms = {"dark_current_e_per_s": 300.0, "column_gain_spread": 0.02, "column_offset_e": 3.0, "prnu": 0.03}
    busy = replace(RGBW, pixel=replace(RGBW.pixel, **terms))
    sensor = with_channel_readings(busy, [ChannelReading("W", time_share=0.25, light_share=0.5)])
    noise = noise_of(chip_readings(sensor, 0.1))
    plain, white = chip_readings(sensor, 0.1)
    names = [sensor.cfa[row % 2][column % 2] for row in range(8) for column in range(8)]
    for field in ("shot", "dark_e", "fixed_e", "prnu"):
        by_hand = [getattr((white if name == "W" else plain).law, field) for name in names]
        assert_allclose(getattr(noise.law, field), by_hand, rtol=1e-12, err_msg=field)
        assert len(set(by_hand)) == (1 if field == "prnu" else 2), field
    assert_allclose(noise.full_e, [(white if name == "W" else plain).headroom_e for name in names], rtol=1e-12)
    assert white.law.shot == pytest.approx(8.0, rel=0.01)


def test_a_patchs_samples_take_each_pixels_light_by_its_filter_and_share_it_by_crosstalk() -> None:
    """A twentieth goes to each neighbour, and at the border stays; the filter is that of where the light fell."""
    crossed = replace(RGBW, pixel=replace(RGBW.pixel, crosstalk=0.05))
    responses, sharp = responses_e(RGBW, view_of("drawn", "D65")), lens_of(RGBW, False)
    plain, spread = (sampling_of(sensor, responses, sharp) for sensor in (RGBW, crossed))
    order = {name: number for number, name in enumerate(RGBW.channels)}
    sites = np.array([order[RGBW.cfa[row % 2][column % 2]] for row in range(8) for column in range(8)])
    for pixel in range(64):
        assert_allclose(plain[pixel, pixel], responses[sites[pixel]], rtol=1e-12)
    assert np.count_nonzero(plain.any(axis=2)) == 64
    assert_allclose(spread.sum(axis=0), plain.sum(axis=0), rtol=1e-12)
    row, column = 3, 4
    from_pixel = spread[:, 8 * row + column, 0].reshape(8, 8) / responses[sites[8 * row + column], 0]
    wanted = np.zeros((8, 8))
    wanted[row, column] = 0.8
    for down, across in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        wanted[row + down, column + across] = 0.05
    assert_allclose(from_pixel, wanted, atol=1e-12)


def test_a_time_that_is_given_is_taken_and_a_rules_is_that_of_the_frame_drawn_from_the_prior() -> None:
    per_second_e = np.random.default_rng(2).uniform(1e5, 1e7, (16, 16, 4))
    assert exposed(RGBW, per_second_e, 0.0125)[0] == 0.0125
    rule_s = exposure_of_electrons_s("auto", per_second_e, RGBW)
    assert exposed(RGBW, per_second_e, "auto")[0] == rule_s
    assert rule_s != exposed(RGBW, per_second_e / 2, "auto")[0]
    for prior in PRIORS:
        frame = drawn_pixels(prior)
        assert frame.shape[:2] == (64, 64)
        assert drawn_pixels(prior) is frame, "every camera meters the same frame"
