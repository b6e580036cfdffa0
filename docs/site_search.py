"""What the search of the site finds: keywords of pages, and ``python docs/site_search.py SITE`` to ask it.

A page names the words that it answers in a comment below its title, ``<!-- keywords: diode, rectifier -->``.
They become main entries of the index, which the search ranks above titles, names and texts. A word that
several pages answer is best left to one or two of them: more would not be first.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import time
from pathlib import Path
from typing import Any
from urllib.parse import quote

KEYWORDS = re.compile(r"<!-- keywords: (.+) -->\n")
# What readers have looked for, and the page that should be the first or the second result.
QUESTIONS = {
    "stick": "contacts-from-gaps",
    "friction": "contacts-from-gaps",
    "gpu": "limits",
    "gear": "models/gear_pair",
    "delay": "dwell",
    "DAE": "limits",
    "diode": "diodes-and-complementarity",
    "chatter": "chatter",
    "bifurcation": "branches",
    "Simulink": "limits",
    "Siconos": "coming-from/siconos",
}
FIRST = 2
# Seconds for which an answer is waited for.
PATIENCE = 10.0
RESULTS = "return [...document.querySelectorAll('ul.search > li > a')].map(each => each.getAttribute('href'))"


def keywords(text: str) -> list[str]:
    """The keywords that a page names."""
    return [word.strip() for line in KEYWORDS.findall(text) for word in line.split(",")]


def comment(words: str) -> str:
    """The comment by which a page that a script writes names its keywords."""
    return f"<!-- keywords: {words} -->\n" if words else ""


def indexed(text: str) -> str:
    """The text of a page with its keywords as main entries of the index, marked by an exclamation mark."""
    entries = ", ".join(f"! {word}" for word in keywords(text))
    return KEYWORDS.sub(f"```{{index}} {entries}\n```\n", text, count=1) if entries else text


def wrong_answers(site: Path) -> list[str]:
    """Ask the search of a built site in a browser, from the disk; what it answers to questions that fail."""
    browser, wrong = _browser(), []
    try:
        for word, page in QUESTIONS.items():
            browser.get(f"{(site / 'search.html').resolve().as_uri()}?q={quote(word)}")
            end = time.monotonic() + PATIENCE
            while not (found := browser.execute_script(RESULTS)) and time.monotonic() < end:
                time.sleep(0.02)
            first = [link.partition("#")[0] for link in found[:FIRST]]
            if f"{page}.html" not in first:
                wrong.append(f"{word!r} should lead to {page}, and leads to {', '.join(first) or 'nothing'}")
    finally:
        browser.quit()
    return wrong


def _browser() -> Any:
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for option in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(option)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Ask the search of a built site what readers have looked for."
    )
    parser.add_argument("site", type=Path, help="folder of the site, with search.html")
    wrong = wrong_answers(parser.parse_args().site)
    if wrong:
        sys.exit("Search: " + "; ".join(wrong) + ". Name the words as keywords of these pages.")
    print(f"The search leads from {len(QUESTIONS)} words to their pages.")


if __name__ == "__main__":
    main()
