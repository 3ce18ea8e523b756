"""Figures of a shot against closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from builders import EVERY_TERM
from explore_sample import lamps_apart, small_transport
from matplotlib import colormaps
from refusal import refusal
from skimage.color import deltaE_ciede2000, rgb2lab

from render.spectrum import photons_per_joule
from rodcone.colour_spaces import encode_srgb
from sensor.readings.resolve import resolve
from sensor.readout import noise_variance, spread_charge, unclipped_variance
from studies.explore.chain import expose_scene, photograph
from studies.explore.controls import TIME, Controls
from studies.explore.memo import Memo
from studies.explore.views import (
    MOST_SIGMAS,
    MOST_SNR_DB,
    VIEWS,
    facts,
    histogram,
    noise_picture,
    noise_scale_e,
    noise_sources_e,
    pixel,
)
from studies.metrics.flip import flip


def test_the_sources_of_noise_add_up_to_the_noise_model():
    for terms in [{}, EVERY_TERM, {"crosstalk": 0.1}, {"column_gain_spread": 0.02}]:
        exposed = photograph(small_transport(), Controls(pixel=terms)).exposed
        variance = noise_variance(exposed.expected_e, exposed.sensor, exposed.exposure_s)
        for row, column in ((0, 0), (13, 21), (39, 47)):
            sources = noise_sources_e(exposed, row, column)
            total = sources.pop("total")
            assert total**2 == pytest.approx(variance[row, column], rel=1e-12), terms
            assert sum(sigma**2 for sigma in sources.values()) == pytest.approx(total**2, rel=1e-9), terms


def test_without_shot_noise_the_budget_is_that_of_the_other_terms():
    """By hand: PRNU, hot pixels as a chip has them, column gains, fixed offsets, read noise, steps of the converter."""
    for terms in [{}, EVERY_TERM, {"column_gain_spread": 0.02, "hot_pixel_share": 0.0}]:
        exposed = photograph(small_transport(), Controls(pixel=terms, shot_noise=False)).exposed
        pixel_, time_s, sources = exposed.sensor.pixel, exposed.exposure_s, noise_sources_e(exposed, 13, 21)
        signal_e = spread_charge(exposed.expected_e, pixel_.crosstalk)[13, 21]
        share, hot_e = pixel_.hot_pixel_share, pixel_.hot_pixel_dark_current_e_per_s * time_s
        collected_e2 = (pixel_.prnu * signal_e) ** 2 + share * (1 - share) * hot_e**2
        mean_e = signal_e + pixel_.dark_current_e_per_s * time_s + share * hot_e
        gains_e2 = pixel_.column_gain_spread**2 * (collected_e2 + mean_e**2)
        dark_e2 = pixel_.read_noise_e**2 + pixel_.fixed_dark_e**2 + exposed.sensor.gain_e_per_dn**2 / 12
        assert (sources["shot noise"], sources["dark current"]) == (0.0, 0.0), terms
        assert sources["total"] == pytest.approx((collected_e2 + gains_e2 + dark_e2) ** 0.5, rel=1e-9), terms
        noisy = replace(exposed, shot_noise=True)
        drawn_e = (exposed.expected_e + pixel_.dark_current_e_per_s * time_s + share * hot_e).mean()
        less = noise_scale_e(noisy) ** 2 - noise_scale_e(exposed) ** 2
        assert less == pytest.approx((1 + pixel_.column_gain_spread**2) * drawn_e, rel=1e-9), terms


def test_the_light_budget_of_a_pixel():
    """Photons from the radiance by the camera equation; the own filter's electrons are the expected ones."""
    controls = Controls(exposure=TIME, exposure_s=0.01, lens={"f_number": 4.0, "diffraction": 0.0})
    exposed = photograph(small_transport(), controls).exposed
    row, column = 20, 11
    told = pixel(exposed, row, column)
    transport = small_transport()
    radiance = sum(lamp.values[row, column].astype(float) for lamp in lamps_apart(transport, 25.0))
    nm, width = transport.wavelength_nm, transport.width_nm
    pitch_m = exposed.sensor.pixel.pitch_um * 1e-6
    irradiance = radiance * np.pi / (1 + 4 * 4.0**2)
    photons = (irradiance * photons_per_joule(nm) * width).sum() * pitch_m**2 * 0.01
    assert told["photons"] == pytest.approx(photons, rel=1e-5)
    assert told["electrons"][told["channel"]] == pytest.approx(exposed.expected_e[row, column], rel=1e-6)
    assert np.sum(told["photons_nm"] * width) == pytest.approx(told["photons"], rel=1e-12)
    for channel, by_band in told["electrons_nm"].items():
        assert np.sum(by_band * width) == pytest.approx(told["electrons"][channel], rel=1e-12)
    refusal(pixel, exposed, 40, 0, match="row")


def test_the_histogram_counts_every_sample_once():
    raw = photograph(small_transport(), Controls(level_cd_m2=3000.0)).exposed.raw
    told = histogram(raw)
    assert {name: sum(counts) for name, counts in told["counts"].items()} == dict.fromkeys("RGBW", 40 * 48 // 4)
    edges = np.array(told["edges_e"])
    full = (raw.electrons >= edges[-2]).sum()
    assert sum(counts[-1] for counts in told["counts"].values()) == full
    assert told["well_e"] == pytest.approx(15000.0, rel=1e-9)
    assert told["floor_e"] == raw.dark_noise_e
    # eighty bins of one ratio, and each channel's samples in them counted one by one
    assert np.diff(np.log(edges)) == pytest.approx(np.full(80, np.log(1.05 * 15_000.0 / 0.5) / 80), rel=1e-6)
    for row, column in np.ndindex(2, 2):
        samples = np.clip(raw.electrons[row::2, column::2], edges[0], edges[-1]).ravel()
        places = np.minimum((samples[:, None] >= edges).sum(axis=1), 80) - 1
        assert told["counts"][raw.cfa[row][column]] == np.bincount(places, minlength=80).tolist()


def test_terms_that_belong_to_readings_are_refused_in_one_line():
    for changed in ({"pixel": {"read_noise_e": 2.0}}, {"shot_noise": False}):
        refusal(photograph, small_transport(), Controls(sensor="dual_gain", **changed), match="dual_gain")


def test_crosstalk_is_no_noise():
    """Where light alone is noisy, noise over the square root of what each pixel collects has a variance of 1."""
    for crosstalk in [0.0, 0.1]:
        quiet = {"read_noise_e": 0.0, "dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0, "crosstalk": crosstalk}
        controls = Controls(pixel=quiet, exposure=TIME, exposure_s=0.01, level_cd_m2=3.0)
        shot = photograph(small_transport(), controls)
        exposed = shot.exposed
        sigma_e = noise_scale_e(exposed)
        seen_e = (VIEWS["noise"](shot)[..., 0] / 127.5 - 1) * MOST_SIGMAS * sigma_e
        variance = noise_variance(exposed.expected_e, exposed.sensor, exposed.exposure_s)
        # The mean of 1920 squares spreads by 3.2 %, noise beyond black and white and steps of 8 bits move it by 2 %.
        assert (seen_e**2 / variance).mean() == pytest.approx(1.0, abs=0.2), crosstalk


def test_snr_is_of_what_a_pixel_collects():
    """Of light alone it is the square root of the electrons, which crosstalk makes those of the neighbours too."""
    quiet = {"read_noise_e": 0.0, "dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0, "crosstalk": 0.1}
    controls = Controls(pixel=quiet, exposure=TIME, exposure_s=0.01, level_cd_m2=3.0, bits=16)
    shot = photograph(small_transport(), controls)
    quantised = shot.exposed.sensor.gain_e_per_dn**2 / 12
    light_e = shot.exposed.expected_e
    collected_e = unclipped_variance(light_e, resolve(shot.exposed.sensor, light_e, 0.01)) - quantised
    share = 10 * np.log10(collected_e**2 / (collected_e + quantised)) / MOST_SNR_DB
    wanted = np.rint(255 * colormaps["viridis"](np.clip(share, 0.0, 1.0))[..., :3])
    assert np.abs(VIEWS["snr"](shot) - wanted).max() <= 1


def test_the_truth_has_no_error():
    shot = photograph(small_transport(), Controls())
    perfect = replace(shot, linear=shot.true)
    for view in ("luminance error", "colour error", "flip"):
        assert not np.ptp(VIEWS[view](perfect), axis=(0, 1)).any(), view


def test_noise_of_a_burst_is_shown_on_the_scale_of_one_frame():
    """Four frames have half the noise of one, which the picture doubles: the same spread of greys within 8 %."""
    terms = {"dsnu_e": 0.0, "prnu": 0.0, "dark_current_e_per_s": 0.0}
    still, spread = Controls(pixel=terms, bits=16, exposure=TIME, exposure_s=0.002), []
    for frames in (1, 4):
        exposed = expose_scene(small_transport(), replace(still, frames=frames), Memo())
        shown = noise_picture(SimpleNamespace(exposed=exposed))[..., 0].astype(float)
        spread.append(shown[exposed.expected_e < 0.5 * exposed.sensor.pixel.full_well_e].std())
    assert spread[0] > 10
    assert spread[1] / spread[0] == pytest.approx(1.0, abs=0.08)


def test_each_view_of_a_planted_difference_in_closed_form():
    """A grey that is a tenth of white too bright, a colour that is 5 off, a full, an empty and a half full well."""
    shot = photograph(small_transport(), Controls(pixel={"dsnu_e": 0.0}))
    shape, raw = shot.linear.shape, shot.exposed.raw
    grey = np.full(shape, 0.2)
    brighter, raised = replace(shot, true=grey, linear=grey + 0.1), encode_srgb(grey + 0.1)
    bluer = replace(shot, true=grey, linear=grey + np.array([0.0, 0.0, 0.05]))
    off = deltaE_ciede2000(rgb2lab(encode_srgb(bluer.linear[:1, :1])), rgb2lab(encode_srgb(grey[:1, :1]))).item()
    assert 2 < off < 9
    turned = flip(raised, encode_srgb(grey))
    full_dn = raw.black_dn + raw.full_well_e / raw.gain_e_per_dn
    dn = np.full(raw.shape, raw.black_dn)
    dn[:20], dn[20:30] = full_dn, (full_dn + raw.black_dn) / 2
    wells = replace(shot, exposed=replace(shot.exposed, raw=replace(raw, dn=dn)))
    tint = {"R": (1, 0.1, 0.1), "G": (0.1, 1, 0.1), "B": (0.15, 0.2, 1), "W": (1, 1, 1)}
    lit = np.repeat([1.0, 0.5, 0.0], [20, 10, 10])[:, None, None]
    mosaic = np.array([[tint[name] for name in line] for line in raw.cfa])
    viridis = colormaps["viridis"]
    wanted = {
        "picture": (brighter, raised),
        "truth": (shot, encode_srgb(shot.true)),
        "luminance error": (brighter, np.full(shape, 0.5 + 0.5 * 0.1 / 0.25)),
        "colour error": (bluer, np.broadcast_to(viridis(off / 10)[:3], shape)),
        "flip": (brighter, viridis(turned)[..., :3]),
        "raw": (wells, encode_srgb(np.tile(mosaic, (20, 24, 1)) * lit)),
    }
    assert set(wanted) | {"noise", "snr"} == set(VIEWS)  # these two have tests of their own
    for view, (seen, values) in wanted.items():
        assert np.abs(VIEWS[view](seen) - 255 * values).max() <= 1.01, view


def test_the_facts_of_a_shot_are_those_of_its_frame():
    shot = photograph(small_transport(), Controls(exposure=TIME, exposure_s=0.03, level_cd_m2=60.0))
    full = shot.exposed.raw.electrons > 0.97 * shot.exposed.raw.full_well_e
    told = facts(shot)
    assert (told["exposure_s"], told["gain"]) == (0.03, 1.0)
    assert told["iso"] == pytest.approx(51.57, abs=0.01)  # as docs/how_to/gain.md has it
    assert 0.05 < full.mean() < 0.95
    assert told["saturated"] == pytest.approx(full.mean(), abs=0.03)
    assert told["snr_db"] == shot.developed.snr_db


def test_a_pixel_reads_its_own_sample_and_its_channels_well():
    exposed = photograph(
        small_transport(), Controls(sensor="white_apart", mosaic="own", processor="any_mosaic")
    ).exposed
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1), (17, 30)):
        told, channel = pixel(exposed, row, column), exposed.sensor.cfa[row % 2][column % 2]
        dn = float(exposed.raw.dn[row, column])
        assert (told["row"], told["column"], told["channel"]) == (row, column, channel)
        assert told["read_e"] == pytest.approx((dn - exposed.raw.black_dn) * exposed.raw.gain_e_per_dn, rel=1e-9)
        assert told["well_e"] == pytest.approx(exposed.raw.noise_of(channel).full_well_e)
        assert told["wavelength_nm"] == exposed.transport.wavelength_nm.tolist()


def test_the_histogram_holds_the_deepest_well_of_the_channels():
    controls = Controls(sensor="white_apart", mosaic="own", processor="any_mosaic", level_cd_m2=5000.0)
    raw = expose_scene(small_transport(), replace(controls, exposure=TIME, exposure_s=0.05), Memo()).raw
    deepest = max(raw.noise_of(channel).full_well_e for channel in raw.channels)
    assert deepest > 1.5 * raw.full_well_e
    assert histogram(raw)["edges_e"][-1] == pytest.approx(1.05 * deepest)
    assert histogram(raw)["edges_e"][0] == 0.5


def test_every_letter_has_its_colour_in_the_mosaic():
    """Cyan, magenta, yellow and white are two or three of the primaries; full wells, so that nothing dims them."""
    shot = photograph(small_transport(), Controls())
    raw = shot.exposed.raw
    full = np.full(raw.shape, raw.black_dn + raw.full_well_e / raw.gain_e_per_dn)
    for cfa in (("CM", "YW"), ("YC", "MM")):
        shown = VIEWS["raw"](replace(shot, exposed=replace(shot.exposed, raw=replace(raw, cfa=cfa, dn=full))))
        tints = {"C": (0, 255, 255), "M": (255, 0, 255), "Y": (255, 255, 0), "W": (255, 255, 255)}
        assert shown[:2, :2].tolist() == [[list(tints[name]) for name in line] for line in cfa]


def test_a_pixel_without_light_is_as_dark_as_0_db():
    shot = photograph(small_transport(), Controls())
    dark = replace(shot, exposed=replace(shot.exposed, expected_e=np.zeros_like(shot.exposed.expected_e)))
    assert (VIEWS["snr"](dark) == np.rint(255 * np.array(colormaps["viridis"](0.0)[:3]))).all()
