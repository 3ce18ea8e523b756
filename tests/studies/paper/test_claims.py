"""Verdicts follow from numbers alone, and every claim's verdict turns with them."""

from collections.abc import Callable
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from studies.paper.best_exposure import Best, claims_held
from studies.paper.claims import Claim, ClaimCheck, about, at_least, at_most, within, within_margin
from studies.paper.early import GINDELE, claims_early
from studies.paper.figure2 import Gain, signal_claims, signal_ratios, snr_claims
from studies.paper.light_levels import LevelCurves, claims_levels
from studies.paper.numbers import photon_claims, range_claim, table_claim
from studies.paper.patches import claims_4, filter_claims
from studies.paper.pixel_size import claims_1a, claims_1b
from studies.paper.white_beside_bayer import Outcome, Swap, claims_6
from studies.paper.white_in_low_light import Stages, claims_3
from studies.paper.white_partly_full import Bright, claims_5

YES, PARTLY, NO = "reproduced", "reproduced under a condition", "not reproduced"
PIXEL, OUTPUT = "table1_pixel", "table1_output"


def test_an_interval_that_leaves_the_range_does_not_hold() -> None:
    values = {"": np.array([1.0, 1.2, 1.1, 1.1])}  # 1.1 +- 0.13
    assert at_least(values, 0.9)[0].holds
    assert not at_least(values, 1.0)[0].holds


def claim(*values: float) -> Claim:
    return Claim("", "", tuple(ClaimCheck(str(place), value, 1.0, 2.0) for place, value in enumerate(values)))


def test_verdict_is_all_some_or_none_of_the_checks() -> None:
    assert claim(1.0, 2.0).verdict == YES
    assert claim(1.0, 2.1).verdict == PARTLY
    assert claim(0.9, 2.1).verdict == NO


def test_what_is_not_finite_never_holds() -> None:
    assert not any(ClaimCheck("", value, -inf, inf).holds for value in (nan, inf, -inf))


def test_kinds_of_checks_hold_at_their_ends_and_not_beyond() -> None:
    by_kind = (
        (about({"8": 8.0, "12": 12.0, "12.01": 12.01, "7.99": 7.99}, 10.0), {"8", "12"}),
        (within_margin({"9.5": 9.5, "9.51": 9.51}, 9.0, 0.5), {"9.5"}),
        (at_least({"1": 1.0, "0.99": 0.99}, 1.0), {"1"}),
        (at_most({"1": 1.0, "1.01": 1.01}, 1.0), {"1"}),
    )
    for checks, wanted in by_kind:
        assert {check.condition for check in checks if check.holds} == wanted


def both(value: object, other: object | None = None) -> dict[str, object]:
    """One value by reading; the second reading's own where given."""
    return {PIXEL: value, OUTPUT: value if other is None else other}


def seeds(mean: float, scatter: float = 0.01) -> NDArray[np.float64]:
    """Figures of four exposures."""
    return mean + scatter * np.array([-1.0, 1.0, -1.0, 1.0])


ROOTS = {channel: value**0.5 for channel, value in signal_ratios("D65").items()}
TIMES = {"R": 10.0, "G": 6.0, "B": 10.0}
EVEN = dict.fromkeys("RGB", 1.0)


def gains(ratios: dict[str, float]) -> dict[str, Gain]:
    return {channel: Gain(ratio, 0.5, 0.5) for channel, ratio in ratios.items()}


SAME, SIX, ROOT = both(gains(EVEN)), both(gains(TIMES)), both(gains(ROOTS))
PLACES = [f"{reading}, {time}" for reading in (PIXEL, OUTPUT) for time in ("5ms", "10ms", "20ms")]
BAYER = dict.fromkeys(PLACES, Outcome(1.0, seeds(20.0), None))


def interleaved(noise: float, psnr_db: float, *decisions: float) -> dict[str, Outcome]:
    return {
        place: Outcome(noise, seeds(psnr_db), share)
        for place, share in zip(PLACES, decisions or (1, 0, 0, 1, 0, 0), strict=True)
    }


def six(one: dict[str, Outcome], swap: Swap | None = None) -> tuple[Claim, ...]:
    swap = swap or Swap(3.0, 1.0)
    return claims_6(BAYER, one, both(swap))  # type: ignore[arg-type]


def stages(white_noise: float, gain_db: float = 10.0) -> Stages:
    return Stages(1.0, white_noise, seeds(gain_db))


def bright(white: float = 0.5, result: float = 0.99, full: float = 0.99) -> Bright:
    return Bright(white, 0.1, result, 0.0, full)


def early(
    fused: float = 0.5,
    gindele: float = 0.97,
    lost: tuple[float, float] = (3.0, 3.0),
    noise: tuple[float, float] = (1.2, 1.2),
    light: tuple[float, float] = (1.0, 1.0),
) -> tuple[Claim, ...]:
    likeness = {"rgbw_sato_published": {PIXEL: fused}, GINDELE: {PIXEL: gindele}}
    of_a, of_b = (dict(zip("ab", values, strict=True)) for values in (lost, noise))
    return claims_early(likeness, of_a, of_b, {"rgbw": {"R": light}})


def light_curves(fall_db: float = 0.0, switch: bool = False, gain_db: tuple[float, float] = (0.0, 3.0)) -> LevelCurves:
    """40 levels on which W fills in the middle and PSNR rises but for one fall there."""
    place = np.linspace(0.0, 1.0, 40)
    part = np.where(place < 0.5, 1.0, 0.0) if switch else 1.0 - place
    psnr_db = 10.0 * place - fall_db * (place > 0.5)
    gain = np.linspace(*gain_db, 40)
    rows = part, 1.0 - place, place, psnr_db, 5.0 - place, 0.5 - 0.1 * place, gain
    return LevelCurves(*(np.add.outer(row, seeds(0.0, 1e-3)) for row in rows))


def hand(times: tuple[float, float] = (2.0, 2.0), gains_db: tuple[float, float] = (1.0, 1.0)) -> tuple[Claim, ...]:
    """Two levels at which the interleaved camera's best time is Bayer's over `times`."""
    bayer = dict.fromkeys((1.0, 4.0), Best(seeds(0.1, 1e-4), seeds(20.0), 1.0))
    ours = {
        level: Best(seeds(0.1, 1e-4) / factor, seeds(20.0 + gain, 0.02), 0.5)
        for level, factor, gain in zip(bayer, times, gains_db, strict=True)
    }
    return claims_held(bayer, ours, 2.3)


def test_best_times_are_told_in_milliseconds_and_blur_in_pixels() -> None:
    """Bayer's tenth of a second at each level, and a half and a quarter of it."""
    claim, *_ = hand(times=(2.0, 4.0))
    assert "1 cd/m² 100 and 50 ms, blur 1.00 and 0.50 pixels; 4 cd/m² 100 and 25 ms, blur 1.00 and 0.50" in claim.note


def test_each_kind_of_check_tells_the_unit_of_its_claim() -> None:
    value = {"gain": 3.0}
    for checks in (
        within(value, 1.0, 5.0, "dB"),
        about(value, 3.0, "dB"),
        within_margin(value, 3.0, 1.0, "dB"),
        at_least(value, 1.0, "dB"),
        at_most(value, 5.0, "dB"),
    ):
        assert [(check.value, check.unit, check.holds) for check in checks] == [(3.0, "dB", True)]


# A row for each claim of the page: claims as a function of what was measured, which of them, and numbers by verdict.
CASES: list[tuple[str, Callable[..., tuple[Claim, ...]], int, dict[str, object]]] = [
    ("photons", lambda x: photon_claims(x, 30.0), 0, {
        YES: {"a": 10.5}, PARTLY: {"a": 10.0, "b": 13.0}, NO: {"a": 7.0},
    }),
    ("one photon", lambda x: photon_claims({"a": x}, 30.0), 1, {YES: 10.0, NO: 14.0}),
    ("30 dB", lambda x: photon_claims({"a": 10.0}, x), 2, {YES: 30.01, PARTLY: 28.0}),
    ("decades", lambda x: (range_claim(x),), 0, {YES: {"a": 4e7}, PARTLY: {"a": 1e8, "b": 1e5}, NO: {"a": 1e5}}),
    ("table", lambda x: (table_claim(x),), 0, {
        YES: both(1.0), PARTLY: both(1.0, 2.4), NO: both(2.4),
    }),
    ("dark half", lambda x: claims_1a(x, {PIXEL: 40.0}), 0, {
        YES: both(10.0), PARTLY: both(10.0, 35.0), NO: both(35.0),
    }),
    ("lit half", lambda x: claims_1a({PIXEL: 0.0}, x), 1, {YES: both(40.0), PARTLY: both(20.0, 40.0), NO: both(20.0)}),
    ("9.54 dB", lambda x: claims_1b(*x, seeds(2.0)), 0, {
        YES: (9.54, both(9.4)), PARTLY: (9.54, both(12.0)), NO: (8.0, both(12.0)),
    }),
    ("smaller pixels", lambda x: claims_1b(9.54, both(9.54), seeds(*x)), 1, {  # type: ignore[arg-type]
        YES: (3.0,), NO: (3.0, 2.0),
    }),
    ("wideband", lambda x: signal_claims({"E": TIMES}, x), 0, {YES: 1.2, NO: 0.8}),
    ("6 and 10 times", lambda x: signal_claims({"E": x}, 1.0), 1, {YES: TIMES, PARTLY: TIMES | {"B": 14.0}, NO: EVEN}),
    ("SNR 6 and 10 times", lambda x: snr_claims(*x, ROOT), 0, {  # type: ignore[arg-type]
        YES: (SIX, SIX), PARTLY: (SIX, SAME), NO: (SAME, SAME),
    }),
    ("root", lambda x: snr_claims(SIX, SIX, x), 1, {  # type: ignore[arg-type]
        YES: ROOT, PARTLY: both(gains(ROOTS), gains(TIMES)), NO: SIX,
    }),
    ("W is clean", claims_3, 0, {
        YES: both(stages(0.2)), PARTLY: both(stages(0.2), stages(0.8)), NO: both(stages(0.8)),
    }),
    ("result", claims_3, 1, {
        YES: both(stages(0.2, 2.0)), PARTLY: both(stages(0.2, 2.0), stages(0.2, -1.0)), NO: both(stages(0.2, -1.0)),
    }),
    ("patches", claims_4, 0, {YES: both(0.99), PARTLY: both(0.99, 0.6), NO: both(0.6)}),
    ("partly full", claims_5, 0, {
        YES: both(bright(0.5)), PARTLY: both(bright(0.5), bright(1.0)), NO: both(bright(0.0)),
    }),
    ("whole", claims_5, 1, {
        YES: both(bright()), PARTLY: both(bright(full=0.3)), NO: both(bright(result=0.5, full=0.3)),
    }),
    ("early fusion", lambda x: early(fused=x), 0, {YES: 0.6, NO: 0.99}),
    ("Gindele", lambda x: early(gindele=x), 1, {YES: 0.97, NO: 0.9}),
    ("matching", lambda x: early(lost=x), 2, {YES: (3.5, 3.4), PARTLY: (3.5, 0.2), NO: (0.1, 0.2)}),
    ("complementary colours", lambda x: early(noise=x), 3, {YES: (1.2, 1.3), PARTLY: (1.2, 0.9), NO: (0.9, 0.8)}),
    ("Kijima", lambda x: early(light=x), 4, {YES: (1.0, 0.9), PARTLY: (1.0, 1.5), NO: (1.7, 0.5)}),
    ("graceful", lambda x: claims_levels(light_curves(fall_db=x)), 0, {YES: 0.1, PARTLY: 3.0}),
    ("smooth", lambda x: claims_levels(light_curves(switch=x)), 1, {YES: False, PARTLY: True}),
    ("W gains", lambda x: claims_levels(light_curves(gain_db=x)), 2, {
        YES: (0.0, 3.0), PARTLY: (-2.0, 3.0), NO: (-2.0, 0.1),
    }),
    ("shorter", lambda x: hand(times=x), 0, {YES: (2.0, 1.5), PARTLY: (2.0, 1.0), NO: (1.0, 0.5)}),
    ("better by hand", lambda x: hand(gains_db=x), 1, {YES: (2.0, 1.0), PARTLY: (2.0, -1.0), NO: (-1.0, -1.0)}),
    ("less noise", six, 0, {YES: interleaved(0.5, 25), NO: interleaved(1.5, 25)}),
    ("better PSNR", six, 1, {YES: interleaved(0.5, 25), NO: interleaved(0.5, 15)}),
    ("substitution", six, 2, {
        YES: interleaved(0.5, 25), PARTLY: interleaved(0.5, 25, 1, 1, 0, 1, 0.25, 0),
        NO: interleaved(1, 2, 0, 1, 1, 0, 1, 1),
    }),
    ("a lot", lambda x: six(interleaved(1, 1), Swap(x, 1.0)), 3, {YES: 3.0, NO: 1.5}),
    ("slightly", lambda x: six(interleaved(1, 1), Swap(3.0, x)), 4, {YES: 2.0, NO: 8.0}),
    ("bilateral", lambda x: filter_claims({1: x}), 0, {YES: both(10.0), PARTLY: both(10.0, 1e5), NO: both(1e5)}),
    ("non-local means", lambda x: filter_claims({1: {"a": 0.0}, 5: x}), 1, {YES: both(10.0), NO: both(1e5)}),
]  # fmt: skip


def test_a_claims_verdict_turns_with_its_numbers() -> None:
    for name, claims, index, cases in CASES:
        for verdict, numbers in cases.items():
            assert claims(numbers)[index].verdict == verdict, f"{name}: {verdict}"
