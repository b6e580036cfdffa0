"""What the page has to say: each sentence once, in the place of what it is about."""

from __future__ import annotations

from collections.abc import Mapping

import attrs

# Places of sentences: under the buttons, under a figure, and under the buttons of the jumps.
PLACES = ("top", "portrait", "section", "exponents", "diagram", "multipliers", "jumps")
TOP, PORTRAIT, SECTION, EXPONENTS, DIAGRAM, MULTIPLIERS, JUMPS = PLACES


@attrs.frozen
class Subject:
    """What a sentence is about: its place on the page, and its name (empty if the sentence names it)."""

    place: str
    name: str = ""


# In the order in which a sentence about several of them names them.
SUBJECTS = {
    "file": Subject(TOP),
    "address": Subject(TOP),
    "saved": Subject(TOP),
    "jumps": Subject(JUMPS),
    "portrait": Subject(PORTRAIT, "portrait"),
    "section": Subject(SECTION, "section"),
    "exponents": Subject(EXPONENTS, "exponents"),
    "orbit": Subject(MULTIPLIERS, "orbit"),
    "branch": Subject(DIAGRAM, "branch"),
    "diagram": Subject(DIAGRAM, "diagram"),
    "basins": Subject(SECTION, "basins"),
}


def placed(words: Mapping[str, str]) -> dict[str, list[str]]:
    """Where each sentence stands: in its own place, or on top if it is about things in several places.

    Parameters
    ----------
    words
        What is said, by a name of ``SUBJECTS``; empty texts say nothing.

    Returns
    -------
    dict
        The sentences of each of ``PLACES``, with the names of what they are about.
    """
    about: dict[str, list[Subject]] = {}
    for name, subject in SUBJECTS.items():
        if text := words.get(name):
            about.setdefault(text, []).append(subject)
    found: dict[str, list[str]] = {place: [] for place in PLACES}
    for text, subjects in about.items():
        places = {each.place for each in subjects}
        names = enumerated([each.name for each in subjects if each.name])
        head = f"{names[0].upper()}{names[1:]}: " if names else ""
        found[places.pop() if len(places) == 1 else TOP].append(head + text)
    return found


def enumerated(names: list[str]) -> str:
    """Names as an enumeration: ``a``, ``a and b``, ``a, b and c``; empty without names."""
    *before, last = names or [""]
    return f"{', '.join(before)} and {last}" if before else last
