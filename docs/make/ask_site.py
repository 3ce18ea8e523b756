"""Ask the built site's search as a reader would: `python docs/make/ask_site.py out/site ISO "how many photons"`.

The theme's own search answers, in a headless Chromium, from the file and without a server. Each question is printed
with the addresses of its first hits.
"""

import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HITS = ".md-search-result__link"
DONE = """question => {
  const title = document.querySelector(".md-search-result__meta")
  return document.querySelector(".md-search__input").value === question && /\\d|No matching/.test(title.textContent)
}"""


def first_hits(browser: Any, site: Path, questions: Iterable[str], count: int = 5) -> dict[str, list[str]]:
    """Return for each question the addresses of its first hits within the site, such as ``how_to/gain.html``."""
    root = site.resolve().as_uri() + "/"
    answers = {}
    for question in questions:  # a page each: results of the question before would be taken for this one's
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(root + "index.html")
        page.fill(".md-search__input", question)
        page.focus(".md-search__input")
        page.wait_for_function(DONE, arg=question, timeout=60_000)
        links = page.eval_on_selector_all(HITS, "links => links.map(link => link.href)")
        places = [re.sub(r"\?[^#]*", "", link.removeprefix(root)) for link in links]  # less the words that are marked
        answers[question] = places[:count]
        page.close()
    return answers


if __name__ == "__main__":
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--disable-gpu"])
        for asked, found in first_hits(chromium, Path(sys.argv[1]), sys.argv[2:]).items():
            print(f"{asked}: {', '.join(found)}")
        chromium.close()
