"""Rows of a table that one test runs through, where none needs an item of its own."""

import contextlib
import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any


def loop(names: str | Sequence[str], table: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """As `pytest.mark.parametrize`, but all rows in one item, which costs pytest as much as a quick test does.

    The message of a failure ends with its row. Each row has a folder and a `monkeypatch` of its own.
    """
    arguments = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    values = [(row,) if len(arguments) == 1 else tuple(row) for row in table]

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(**fixtures: Any) -> None:
            for index, row in enumerate(values):
                own = {**fixtures, **dict(zip(arguments, row, strict=True))}
                if "tmp_path" in fixtures:
                    own["tmp_path"] = fixtures["tmp_path"] / f"{arguments[0]}{index}"
                    own["tmp_path"].mkdir()
                with contextlib.ExitStack() as undone:
                    if "monkeypatch" in fixtures:
                        own["monkeypatch"] = undone.enter_context(fixtures["monkeypatch"].context())
                    try:
                        test(**own)
                    except BaseException as error:
                        error.add_note(f"row {index} of {', '.join(arguments)}: {row!r:.500}")
                        raise

        signature = inspect.signature(test)
        rest = [parameter for name, parameter in signature.parameters.items() if name not in arguments]
        run.__signature__ = signature.replace(parameters=rest)  # type: ignore[attr-defined]
        return run

    return decorate
