"""Verdicts follow from numbers alone, and every claim's verdict turns with them."""

from collections.abc import Callable
from math import inf, nan

from studies.paper.claims import Claim, ClaimCheck, about, at_least, at_most, near
from studies.paper.figure1 import claims_1a, claims_1b
from studies.paper.figure2 import Gain, signal_claims, signal_ratios, snr_claims
from studies.paper.figure6 import Outcome, Swap, claims_6
from studies.paper.figures_3_5 import Bright, Stages, claims_3, claims_5
from studies.paper.numbers import photon_claims, range_claim, table_claim
from studies.paper.patches import claims_4, filter_claims

YES, PARTLY, NO = "reproduced", "reproduced under a condition", "not reproduced"
PIXEL, OUTPUT = "table1_pixel", "table1_output"


def claim(*values: float) -> Claim:
    return Claim("", "", tuple(ClaimCheck(str(place), value, 1.0, 2.0) for place, value in enumerate(values)))


def test_verdict_is_all_some_or_none_of_the_checks() -> None:
    assert claim(1.0, 2.0).verdict == YES
    assert claim(1.0, 2.1).verdict == PARTLY
    assert claim(0.9, 2.1).verdict == NO


def test_what_is_not_finite_never_holds() -> None:
    assert not any(ClaimCheck("", value, -inf, inf).holds for value in (nan, inf, -inf))


def test_kinds_of_checks_hold_at_their_ends_and_not_beyond() -> None:
    assert about("", 12.0, 10.0).holds
    assert about("", 8.0, 10.0).holds
    assert not about("", 12.01, 10.0).holds
    assert not about("", 7.99, 10.0).holds
    assert near("", 9.5, 9.0, 0.5).holds
    assert not near("", 9.51, 9.0, 0.5).holds
    assert at_least("", 1.0, 1.0).holds
    assert not at_least("", 0.99, 1.0).holds
    assert at_most("", 1.0, 1.0).holds
    assert not at_most("", 1.01, 1.0).holds


def both(value: object, other: object | None = None) -> dict[str, object]:
    """One value by reading; the second reading's own where given."""
    return {PIXEL: value, OUTPUT: value if other is None else other}


ROOTS = {channel: value**0.5 for channel, value in signal_ratios("D65").items()}
TIMES = {"R": 10.0, "G": 6.0, "B": 10.0}
EVEN = dict.fromkeys("RGB", 1.0)


def gains(ratios: dict[str, float]) -> dict[str, Gain]:
    return {channel: Gain(ratio, 0.5, 0.5) for channel, ratio in ratios.items()}


SAME, SIX, ROOT = both(gains(EVEN)), both(gains(TIMES)), both(gains(ROOTS))
PLACES = [f"{reading}, {time}" for reading in (PIXEL, OUTPUT) for time in ("5ms", "10ms", "20ms")]
BAYER = dict.fromkeys(PLACES, Outcome(1.0, 20.0, None))


def interleaved(noise: float, psnr_db: float, *decisions: float) -> dict[str, Outcome]:
    return {
        place: Outcome(noise, psnr_db, share)
        for place, share in zip(PLACES, decisions or (1, 0, 0, 1, 0, 0), strict=True)
    }


def six(one: dict[str, Outcome], swap: Swap | None = None) -> tuple[Claim, ...]:
    swap = swap or Swap(3.0, 1.0)
    return claims_6(BAYER, one, both(swap))  # type: ignore[arg-type]


def bright(white: float = 0.5, result: float = 0.99, full: float = 0.99) -> Bright:
    return Bright(white, 0.1, result, 0.0, full)


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
    ("9.54 dB", lambda x: claims_1b(*x, 2.0), 0, {
        YES: (9.54, both(9.4)), PARTLY: (9.54, both(12.0)), NO: (8.0, both(12.0)),
    }),
    ("smaller pixels", lambda x: claims_1b(9.54, both(9.54), x), 1, {YES: 3.0, NO: 0.5}),  # type: ignore[arg-type]
    ("wideband", lambda x: signal_claims({"E": TIMES}, x), 0, {YES: 1.2, NO: 0.8}),
    ("6 and 10 times", lambda x: signal_claims({"E": x}, 1.0), 1, {YES: TIMES, PARTLY: TIMES | {"B": 14.0}, NO: EVEN}),
    ("SNR 6 and 10 times", lambda x: snr_claims(*x, ROOT), 0, {  # type: ignore[arg-type]
        YES: (SIX, SIX), PARTLY: (SIX, SAME), NO: (SAME, SAME),
    }),
    ("root", lambda x: snr_claims(SIX, SIX, x), 1, {  # type: ignore[arg-type]
        YES: ROOT, PARTLY: both(gains(ROOTS), gains(TIMES)), NO: SIX,
    }),
    ("W is clean", claims_3, 0, {
        YES: both(Stages(1.0, 0.2, 10, 20)), PARTLY: both(Stages(1.0, 0.2, 10, 20), Stages(1.0, 0.8, 10, 20)),
        NO: both(Stages(1.0, 0.8, 10, 20)),
    }),
    ("result", claims_3, 1, {
        YES: both(Stages(1, 0.2, 10, 12)), PARTLY: both(Stages(1, 0.2, 10, 12), Stages(1, 0.2, 10, 9)),
        NO: both(Stages(1, 0.2, 10, 9)),
    }),
    ("patches", claims_4, 0, {YES: both(0.99), PARTLY: both(0.99, 0.6), NO: both(0.6)}),
    ("partly full", lambda x: claims_5(x, {"a": 2.0}), 0, {
        YES: both(bright(0.5)), PARTLY: both(bright(0.5), bright(1.0)), NO: both(bright(0.0)),
    }),
    ("whole", lambda x: claims_5(x, {"a": 2.0}), 1, {
        YES: both(bright()), PARTLY: both(bright(full=0.3)), NO: both(bright(result=0.5, full=0.3)),
    }),
    ("early fusion", lambda x: claims_5(both(bright()), x), 2, {  # type: ignore[arg-type]
        YES: {"a": 2.0}, PARTLY: {"a": 2.0, "b": -1.0}, NO: {"a": -1.0},
    }),
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
