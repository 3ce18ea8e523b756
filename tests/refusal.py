"""What the program says where it refuses something."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from rodcone.errors import InputError


def refusal(
    call: Callable[..., Any], *arguments: Any, match: str = "", words: Iterable[str] = (), **options: Any
) -> str:
    """Message with which a call is refused: one line, which holds all the words and matches a regular expression."""
    with pytest.raises(InputError, match=match or None) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert [text for text in words if text not in message] == [], message
    return message
