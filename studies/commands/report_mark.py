"""Find out whether a sweep's report is still current; if so, a run that makes no cell doesn't write it again.

To draw the page, and to import the libraries for that, takes longer than all else that such a run does. The page ends
in a mark, a hash of the page and of all that it is made from. So a page that was changed or cut short is written again.
"""

import json
from importlib import metadata
from pathlib import Path

from rodcone.digests import digest_bytes, digest_file
from studies.sweep.database import content, read_results
from studies.sweep.provenance import ROOT, versions

REPORT, RESULTS = "report.html", "results.json"
_BEGIN, _END = b"<!-- made of ", b" -->\n"
_DRAWN_BY = ("matplotlib", "jinja2", "pillow")


def marked(folder: Path, page: str, results: bytes | None, stored: str) -> bytes:
    """Return a page with its mark, which is valid as long as the folder's rows, its results and our code are the same.

    `stored` is the hash from `studies.sweep.database.content`.
    """
    text = page.encode("utf-8")
    return text + _BEGIN + _mark(folder, text, results, stored).encode() + _END


def is_current(folder: Path) -> bool:
    """Return whether a folder's page, and its results file if it has one, are the same as would be written now."""
    page, results = folder / REPORT, folder / RESULTS
    if not page.is_file():
        return False
    text, begin, mark = page.read_bytes().rpartition(_BEGIN)
    with read_results(folder) as base:
        stored = content(base)
    wanted = _mark(folder, text, results.read_bytes() if results.is_file() else None, stored)
    return bool(begin) and mark == wanted.encode() + _END


def _mark(folder: Path, page: bytes, results: bytes | None, stored: str) -> str:
    files = sorted(path for path in (ROOT / "studies").rglob("*") if path.is_file() and path.suffix != ".pyc")
    code = [digest_file(path) for path in files]
    packages = {name: metadata.version(name) for name in _DRAWN_BY}
    terms = json.dumps([str(folder), versions(), packages, code, results is None, stored])
    return digest_bytes(terms.encode(), page, results or b"")
