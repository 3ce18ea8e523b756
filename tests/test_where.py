"""docs/where.md: every term has a row, and every name in it exists."""

import re
from collections import Counter
from pathlib import Path
from pkgutil import resolve_name

PAGE = Path(__file__).resolve().parent.parent / "docs" / "where.md"
NAME = re.compile(r"`([\w.]+)`")
LEAST_TERMS = 70  # of the paper, its Table 1, EMVA 1288, radiometry and photometry


def rows(text: str) -> list[tuple[str, str, tuple[str, ...]]]:
    """Term, meaning and names of each row of the page's tables."""
    cells = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return [(row[0], row[1], tuple(NAME.findall(row[2]))) for row in cells if row[0] != "term" and set(row[0]) != {"-"}]


ROWS = rows(PAGE.read_text("utf-8"))


def resolve(name: str) -> object:
    """What a dotted name stands for: a module's function, class or constant, or a class's method or field.

    Raises
    ------
    AttributeError
        Where there is no such module or name.
    """
    try:
        return resolve_name(name)
    except AttributeError:
        holder, _, field = name.rpartition(".")
        fields = getattr(resolve_name(holder), "__dataclass_fields__", {})
        if field not in fields:
            raise
        return fields[field]


def test_a_terms_names_exist():
    for term, _, names in ROWS:
        assert names, f"{term}: name the function that holds it, in backticks"
        for name in names:
            assert name.rpartition(".")[2].isidentifier(), name
            assert not any(part.startswith("_") for part in name.split(".")), f"{name} is private: name the public one"
            assert resolve(name) is not None, name


def test_a_term_has_one_row_with_a_meaning():
    counts = Counter(term for term, meaning, _ in ROWS if meaning)
    assert len(ROWS) == counts.total() >= LEAST_TERMS, "a row has no meaning, or one is gone"
    assert {term: count for term, count in counts.items() if count != 1} == {}, "give each one row"
