"""What the page has to say: each sentence once, in the place of what it is about."""

from __future__ import annotations

from collections.abc import Mapping

import attrs

# Places of sentences: under the buttons, under a figure, and under the buttons of the jumps.
PLACES = ("top", "portrait", "section", "exponents", "diagram", "multipliers", "jumps")
TOP, PORTRAIT, SECTION, EXPONENTS, DIAGRAM, MULTIPLIERS, JUMPS = PLACES

COMING = "being computed."


@attrs.frozen
class About:
    """What a sentence is about: its place on the page, and its name (empty if the sentence names it)."""

    place: str
    name: str = ""


# In the order in which a sentence about several of them names them.
ABOUT = {
    "file": About(TOP),
    "address": About(TOP),
    "saved": About(TOP),
    "jumps": About(JUMPS),
    "portrait": About(PORTRAIT, "portrait"),
    "section": About(SECTION, "section"),
    "exponents": About(EXPONENTS, "exponents"),
    "orbit": About(MULTIPLIERS, "orbit"),
    "branch": About(DIAGRAM, "branch"),
    "diagram": About(DIAGRAM, "diagram"),
    "range": About(DIAGRAM, "diagram"),
    "basins": About(SECTION, "basins"),
}


def placed(words: Mapping[str, str]) -> dict[str, list[str]]:
    """Where each sentence stands: in its own place, or on top if it is about things in several places.

    Parameters
    ----------
    words
        What is said, by a name of ``ABOUT``; empty texts say nothing.

    Returns
    -------
    dict
        The sentences of each of ``PLACES``, with the names of what they are about.
    """
    about: dict[str, list[About]] = {}
    for name, each in ABOUT.items():
        if text := words.get(name):
            about.setdefault(text, []).append(each)
    found: dict[str, list[str]] = {place: [] for place in PLACES}
    for text, things in about.items():
        places = {each.place for each in things}
        names = enumerated([each.name for each in things if each.name])
        head = f"{names[0].upper()}{names[1:]}: " if names else ""
        found[places.pop() if len(places) == 1 else TOP].append(head + text)
    return found


def enumerated(names: list[str]) -> str:
    """Names as an enumeration: ``a``, ``a and b``, ``a, b and c``; empty without names."""
    *before, last = names or [""]
    return f"{', '.join(before)} and {last}" if before else last
