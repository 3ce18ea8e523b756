"""One line whatever a file makes an error quote, and ranges that no number slips through."""

import math
import pickle

import pytest

from rodcone.errors import MOST_TOLD, InputError, one_line, require_range, require_whole


def test_a_message_is_one_line_that_a_terminal_only_shows() -> None:
    for quoted, told in (
        ("two\nlines", r"two\nlines"),
        ("\x1b[2Jwiped", r"\x1b[2Jwiped"),  # a terminal would clear its screen
        ("exe.\u202egnp", r"exe.\u202egnp"),  # and write this one backwards
        ("\udcff", r"\udcff"),  # a file's name that is no UTF-8: print would fail
        ("Grünes Licht, 緑", "Grünes Licht, 緑"),
    ):
        assert str(InputError(f"name: {quoted!s} is not allowed")) == f"name: {told} is not allowed"


def test_of_a_message_too_long_both_ends_are_told() -> None:
    error = InputError("name: " + 1_000_000 * "x" + " is not allowed; correct it")
    assert len(str(error)) == MOST_TOLD
    assert str(error).startswith("name: xxx")
    assert str(error).endswith("xxx is not allowed; correct it")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # from a worker it comes back the same
    assert len(str(InputError(MOST_TOLD * "x"))) == MOST_TOLD
    assert str(InputError(f"again: {error}")).endswith("; correct it")


def test_what_is_no_number_of_the_range_is_refused_and_numbers_within_it_pass() -> None:
    for value in (True, 10**400, -(10**400), math.nan, math.inf, "3", None, 5.000001, -1e-9):
        with pytest.raises(InputError, match="is outside 0 to 5; give less"):
            require_range("side", value, 0.0, 5.0, "give less")
    for number in (0, 5, 2.5):
        require_range("side", number, 0.0, 5.0, "give less")


def test_whole_numbers_are_held_against_their_limits_digit_by_digit() -> None:
    """Beyond 2^53 a float is the nearest of several: a study's last seed passes, and its next doesn't."""
    for last in (2**53, 2**63 - 1, 2**160 - 1):
        require_whole("seed", last, 0, last, "give less")
        for beyond in (last + 1, -1):
            with pytest.raises(InputError, match="is outside"):
                require_whole("seed", beyond, 0, last, "give less")


def test_of_a_traceback_within_an_error_the_last_line_is_told() -> None:
    quoted = "plug-in failed: Traceback (most recent call last):\n  File x, line 3\nValueError: no such lamp\n"
    assert one_line(RuntimeError(quoted)) == "plug-in failed: ValueError: no such lamp"
    assert one_line(RuntimeError("two\n lines")) == "two lines"
