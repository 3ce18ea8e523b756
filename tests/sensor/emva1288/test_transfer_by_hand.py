"""Photon transfer of stacks whose means and variances are given: gain, errors, change and choice of stacks by hand."""

from dataclasses import replace
from math import hypot, sqrt

import numpy as np
import pytest
from refusal import refusal

from sensor.emva1288.from_frames import (
    LightStack,
    Site,
    figures_of_frames,
    figures_of_stacks,
    stack_of,
    without_surface,
)

TILE = ("RG",)  # two positions, seen under light of which G gets half as much again
WHITE_DN, BLACK_DN, K, DARK_DN2 = 1100.0, 100.0, 0.5, 4.0
SIDE = 16
ERRORS = {50.0: 0.5, 150.0: 2.0, 300.0: 3.0, 400.0: 5.0}  # of a stack's variances, by R's signal
DARK_ERROR = 0.25


def stack(signal, *, bend=0.0, off=0.0, frames=4, exposure_s=np.nan, error=None, clipped=0.0):
    """Stack of R's signal: its variance is K s (1 + bend s / 700) + off, of even frames."""

    def site(dn, sign):
        mean = np.full((SIDE, SIDE), BLACK_DN + dn)
        variance = DARK_DN2 + K * dn * (1 + bend * dn / 700.0) + sign * off
        return Site(mean, variance, DARK_ERROR if error is None else error, frames)

    return LightStack(exposure_s, np.nan, clipped, 0.0, (site(signal, 1), site(1.5 * signal, -1)))


def lights(*signals, **options):
    return [stack(x, error=ERRORS[x], **options) for x in signals]


def measured(flats, darks=None):
    return figures_of_stacks(flats, darks or [stack(0.0)], TILE, WHITE_DN)


def used(signals):
    """Signals and errors of both positions up to 70 % of the range, and the position of each."""
    points = [(factor * x, ERRORS[x], place) for x in signals for place, factor in enumerate((1.0, 1.5))]
    return [np.array(column) for column in zip(*(p for p in points if p[0] <= 0.7 * 1000.0), strict=True)]


def test_the_gain_of_a_straight_line_and_the_errors_of_its_frames():
    """K = sum s v / sum s^2; each light's error counts by its signal, a dark stack's once for all of its position."""
    signals = (50.0, 150.0, 300.0, 400.0)
    found = measured(lights(*signals))
    s, error, place = used(signals)
    power = np.sum(s**2)
    of_darks = sum((DARK_ERROR * s[place == at].sum()) ** 2 for at in (0, 1))
    scatter = sqrt(np.sum((s * error) ** 2) + of_darks) / power / K
    # The second term of a line through 0, by Cramer's rule, over 70 % of the range.
    weight = 1 / (error**2 + DARK_ERROR**2)
    s2, s3, s4 = (np.sum(weight * s**p) for p in (2, 3, 4))
    change_error = sqrt(s2 / (s2 * s4 - s3**2)) * 700.0 / K
    assert found.gain_dn_per_e.value == pytest.approx(K)
    assert found.gain_error == pytest.approx((scatter, change_error / sqrt(12)))
    assert (found.gain_change, found.gain_change_error) == (pytest.approx(0.0, abs=1e-9), pytest.approx(change_error))
    whole = 1.959964 * K * hypot(*found.gain_error)
    assert (found.gain_dn_per_e.low, found.gain_dn_per_e.high) == pytest.approx((K - whole, K + whole))
    assert found.levels_dn == pytest.approx(np.outer(signals, (1.0, 1.5)))
    assert (found.black_dn, found.white_dn, found.frames) == (BLACK_DN, WHITE_DN, (4, 4, 4, 4, 4))
    assert any("this is not told from 0" in note for note in found.notes)
    for point, signal in zip(found.points, signals, strict=True):
        assert point.signal_dn == pytest.approx([signal, 1.5 * signal])
        assert point.gain == pytest.approx([K, K])
        assert (point.mean_dn - point.dark_dn).tolist() == point.signal_dn.tolist()


def test_a_gain_that_changes_with_light_is_told_and_its_interval_holds_both_ends():
    """v = K s (1 + b s / 700): the change over 700 DN is b K over the slope of the straight line."""
    signals, bend = (50.0, 150.0, 300.0, 400.0), -0.2
    found = measured(lights(*signals, bend=bend))
    s, _, _ = used(signals)
    slope = K * np.sum(s**2 * (1 + bend * s / 700.0)) / np.sum(s**2)
    assert found.gain_dn_per_e.value == pytest.approx(slope)
    assert found.gain_change == pytest.approx(bend * K / slope)
    assert found.gain_error[1] == pytest.approx(hypot(found.gain_change, found.gain_change_error) / sqrt(12))
    told = [note for note in found.notes if note.startswith("K changes")]
    assert told == [
        f"K changes by {found.gain_change:+.1%} +- {found.gain_change_error:.1%} from the dark to 70% of saturation: "
        "the camera is not linear; the interval of K holds both"
    ]


def test_lights_that_scatter_beyond_their_frames_widen_all_errors():
    """Birge: root of the weighted squares over the freedom, of a parabola through 0."""
    signals, off = (50.0, 150.0, 300.0, 400.0), 12.0
    plain, found = measured(lights(*signals)), measured(lights(*signals, off=off))
    s, error, place = used(signals)
    sigma = np.hypot(error, DARK_ERROR)
    excess = K * s + np.where(place == 0, off, -off)
    fit = np.polynomial.polynomial.Polynomial.fit(s, excess / s, 1, w=s / sigma, domain=[-1, 1], window=[-1, 1])
    birge = sqrt(np.sum(((excess - s * fit(s)) / sigma) ** 2) / (s.size - 2))
    assert birge > 2
    assert found.gain_change_error * found.gain_dn_per_e.value == pytest.approx(birge * plain.gain_change_error * K)
    assert found.gain_error[0] * found.gain_dn_per_e.value == pytest.approx(birge * plain.gain_error[0] * K)


@pytest.mark.parametrize("signals", [(150.0, 300.0), (300.0, 400.0), (50.0, 150.0)])
def test_too_few_lights_or_a_part_of_the_range_allow_for_a_change_of_a_twentieth(signals):
    """Two lights; three that leave the dim or the bright part out: from 40 % of 700 DN down and from 60 % up."""
    found = measured(lights(*signals))
    assert np.isnan([found.gain_change, found.gain_change_error]).all()
    assert found.gain_error[1] == pytest.approx(0.05 / sqrt(12))
    assert any("5% over the range is allowed for" in note for note in found.notes)


@pytest.mark.parametrize(
    ("signals", "told"),
    [
        ((279.0, 300.0, 430.0), True),
        ((281.0, 300.0, 430.0), False),
        ((50.0, 150.0, 281.0), True),
        ((50.0, 150.0, 279.0), False),
    ],
)
def test_a_change_is_told_from_lights_on_both_sides_of_the_middle(signals, told):
    """Of 700 DN the dimmest is at most 40 %, 280 DN; the brightest at least 60 %, 1.5 x 280 DN."""
    found = measured([stack(x) for x in signals])
    assert np.isfinite(found.gain_change) == told


def test_read_noise_and_dsnu_are_the_darks_over_the_gain():
    """Temporal variance less rounding's; variance over pixels less the temporal one that is left in the mean."""
    uneven = 3.0 * np.where(np.arange(SIDE) % 2, 1.0, -1.0)
    dark = stack(0.0, frames=5)
    sites = [replace(site, mean_dn=site.mean_dn + uneven[:, None]) for site in dark.sites]
    found = measured(lights(50.0, 150.0, 300.0, 400.0), [replace(dark, sites=tuple(sites))])
    assert found.read_noise_e.value == pytest.approx(sqrt(DARK_DN2 - 1 / 12) / K)
    spread = 9.0 * SIDE**2 / (SIDE**2 - 1) - DARK_DN2 / 5
    assert found.dsnu_e.value == pytest.approx(sqrt(spread) / K)
    gain_error = K * hypot(*found.gain_error)
    variance = (DARK_DN2 - 1 / 12) / K**2
    error = hypot(sqrt(2) * DARK_ERROR / 2 / K**2, 2 * variance * gain_error / K)
    assert found.read_noise_e.high == pytest.approx(sqrt(variance + 1.959964 * error))


def test_positions_count_by_their_pixels():
    """A frame of an odd width has more of its first position: 9 columns of 20 DN^2 and 8 of 2 DN^2."""
    sites = tuple(
        Site(np.full((SIDE, width), BLACK_DN), variance, error, 4)
        for width, variance, error in ((9, 20.0, 0.3), (8, 2.0, 0.4))
    )
    flats = []
    for flat in lights(50.0, 150.0, 300.0, 400.0):
        cut = (
            replace(
                x, mean_dn=x.mean_dn[:, : y.mean_dn.shape[1]], variance_dn2=x.variance_dn2 - DARK_DN2 + y.variance_dn2
            )
            for x, y in zip(flat.sites, sites, strict=True)
        )
        flats.append(replace(flat, sites=tuple(cut)))
    found = measured(flats, [LightStack(np.nan, np.nan, 0.0, 0.0, sites)])
    mean = (9 * 20.0 + 8 * 2.0) / 17
    assert found.gain_dn_per_e.value == pytest.approx(K)
    assert found.read_noise_e.value == pytest.approx(sqrt(mean - 1 / 12) / K)
    variance, error = (mean - 1 / 12) / K**2, hypot(9 * 0.3, 8 * 0.4) / 17 / K**2
    error = hypot(error, 2 * variance * hypot(*found.gain_error))
    assert found.read_noise_e.high == pytest.approx(sqrt(variance + 1.959964 * error))


def test_prnu_is_of_the_stack_with_the_most_frames_and_of_those_the_brightest_below_70_per_cent():
    """Columns of +-1 %, +-2 %, +-3 % and +-4 % in four stacks, each over a smooth surface's six terms."""
    stripes = np.where(np.arange(SIDE) % 2, 1.0, -1.0)

    def striped(signal, share, frames):
        flat = stack(signal, error=1.0, frames=frames)
        sites = [replace(x, mean_dn=BLACK_DN + (x.mean_dn - BLACK_DN) * (1 + share * stripes)) for x in flat.sites]
        return replace(flat, sites=tuple(sites))

    flats = [striped(50.0, 0.01, 8), striped(300.0, 0.02, 8), striped(400.0, 0.03, 4), striped(600.0, 0.04, 8)]
    for given in (flats, flats[::-1]):
        found = measured(given)
        pattern = np.broadcast_to(0.02 * stripes, (SIDE, SIDE))
        rest = without_surface(pattern) * sqrt(SIDE**2 / (SIDE**2 - 6))
        temporal = [(DARK_DN2 + K * s) / 8 / s**2 + DARK_DN2 / 4 / s**2 for s in (300.0, 450.0)]
        assert found.prnu.value == pytest.approx(sqrt(rest.var() * SIDE**2 / (SIDE**2 - 1) - np.mean(temporal)))
        assert found.frames == (8, 8, 4, 8, 4)


def test_each_light_has_the_darks_of_its_own_time_or_those_with_the_most_frames():
    """Dark current raises black by 10 DN in 2 s; a light of 3 s, of which there are no darks, has the common ones."""

    def raised(flat, dn):
        return replace(flat, sites=tuple(replace(x, mean_dn=x.mean_dn + dn) for x in flat.sites))

    darks = [
        stack(0.0, exposure_s=1.0, frames=9),
        raised(stack(0.0, exposure_s=2.0, frames=4), 10.0),
        raised(stack(0.0, exposure_s=2.0, frames=3), 500.0),
    ]
    flats = [
        stack(50.0, exposure_s=1.0),
        raised(stack(150.0, exposure_s=2.0), 10.0),
        stack(300.0, exposure_s=3.0),
        stack(400.0, exposure_s=1.0),
    ]
    found = measured(flats, darks)
    assert found.levels_dn == pytest.approx(np.outer((50.0, 150.0, 300.0, 400.0), (1.0, 1.5)))
    assert found.black_dn == BLACK_DN
    assert found.frames[-1] == 9


def test_saturation_is_the_light_behind_the_one_of_the_greatest_variance():
    """From 80 DN on the variance falls: the standard's range ends at 70 % of the next light's 150 DN, at 105."""
    flats = [stack(x, error=0.01) for x in (20.0, 40.0, 80.0, 100.0)]
    fallen = replace(flats[3], sites=tuple(replace(x, variance_dn2=5.0) for x in flats[3].sites))
    bent = replace(flats[2], sites=(flats[2].sites[0], replace(flats[2].sites[1], variance_dn2=90.0)))
    found = measured([*flats[:2], bent, fallen])
    # 120 DN, which holds the variance of 90, is over the 105: neither it nor what is beyond bends the line
    s = np.array([20.0, 30.0, 40.0, 60.0, 80.0, 100.0])
    v = np.array([*(K * s[:5]), 1.0])
    assert found.gain_dn_per_e.value == pytest.approx(np.sum(s * v) / np.sum(s**2))


def test_light_that_clips_a_thousandth_of_the_pixels_is_left_out():
    flats = lights(50.0, 150.0, 300.0, 400.0)
    odd = replace(
        flats[2], clipped=1.1e-3, drift=0.5, sites=tuple(replace(x, variance_dn2=1e3) for x in flats[2].sites)
    )
    found = measured([*flats[:2], odd, flats[3]])
    assert found.gain_dn_per_e.value == pytest.approx(K)
    assert any("it changed by 0.00% at most" in note for note in found.notes)
    kept = replace(odd, clipped=0.9e-3)
    assert measured([*flats[:2], kept, flats[3]]).gain_dn_per_e.value > 1.1 * K


def test_frames_of_a_stack_are_reduced_to_their_sites():
    """Half the variance of the difference of two frames, each less its own mean; drift, and what reads white."""
    rng = np.random.default_rng(3)
    frames = [rng.integers(90, 110, (8, 12)).astype(np.uint16) + np.uint16(5 * number) for number in range(2)]
    reduced = stack_of(frames, ("RG", "GB"), 112.0, 0.5, 70.0)
    means = [frame.mean() for frame in frames]
    assert reduced.drift == pytest.approx((means[1] - means[0]) / np.mean(means))
    assert reduced.clipped == pytest.approx(np.mean(np.array(frames) >= 112))
    assert (reduced.exposure_s, reduced.photons) == (0.5, 70.0)
    places = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for (row, column), site in zip(places, reduced.sites, strict=True):
        first, second = (frame[row::2, column::2].astype(float) for frame in frames)
        assert np.array_equal(site.mean_dn, (first + second) / 2)
        variance = (first - second).var(ddof=1) / 2
        assert site.variance_dn2 == pytest.approx(variance)
        assert site.error_dn2 == pytest.approx(variance * sqrt(2 / 23))
        assert (site.frames, site.temporal_dn2) == (2, pytest.approx(variance / 2))
    twice = stack_of([frames[0], frames[0]], ("W",), 200.0)
    assert twice.sites[0].variance_dn2 == 0.0
    assert twice.sites[0].error_dn2 == pytest.approx(sqrt(2 / 95) / 12)


def test_a_surface_of_second_order_is_taken_out_and_nothing_else():
    y, x = np.mgrid[-1:1:9j, -1:1:11j]
    surface = 3 + 0.5 * x - 2 * y + x**2 - 0.25 * y**2 + 4 * x * y
    assert np.abs(without_surface(surface)).max() < 1e-12
    rest = without_surface(surface + x**3)
    terms = np.stack([np.ones_like(x), x, y, x**2, y**2, x * y]).reshape(6, -1)
    assert np.abs(terms @ rest.ravel()).max() < 1e-10
    assert rest.std() > 0.1


def test_frames_are_of_one_light_up_to_two_per_cent_of_the_brighter():
    def even(dn):
        return np.full((16, 32), dn, np.uint16)

    darks = [even(10), even(10)]
    apart = refusal(figures_of_frames, [even(1000), even(1021)], darks, TILE, WHITE_DN)
    assert "flat frame 1: its mean, 1000 DN, is within 2% of no other's" in apart
    alike = refusal(figures_of_frames, [even(1019), even(1000)], darks, TILE, 5000.0)
    assert "can't be told from 0" in alike


@pytest.mark.parametrize(("step", "words"), [(0.0145, "even within 2.9%"), (0.0155, "aren't even, 3.1%")])
def test_how_even_the_light_was_is_told_from_blocks_of_a_quarter(step, words):
    """A plane over columns of four blocks: the outer two are 3/4 of its slope off; smooth, so that nothing is left."""
    plane = np.repeat([-1.0, -1 / 3, 1 / 3, 1.0], SIDE // 4)
    flats = []
    for flat in lights(50.0, 150.0, 300.0, 400.0):
        sites = [replace(x, mean_dn=BLACK_DN + (x.mean_dn - BLACK_DN) * (1 + step * plane)) for x in flat.sites]
        flats.append(replace(flat, sites=tuple(sites)))
    notes = measured(flats).notes
    assert words in notes[0]
    corner = 1 + 0.2 * np.outer(plane > 0.9, plane > 0.9)
    cornered = []
    for flat in lights(50.0, 150.0, 300.0, 400.0):
        cornered.append(replace(flat, sites=tuple(replace(x, mean_dn=x.mean_dn * corner) for x in flat.sites)))
    assert "they are not flat" in refusal(measured, cornered)
