"""What holds at each contact, and the names of the modes that follow."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.errors import ModelError
from hybrid.transform.contacts.contact import Contact

OPEN, HELD, STICKS, SLIPS_UP, SLIPS_DOWN = "open", "", "sticks", "slips +", "slips -"
# The gap is closed because others are, and what force it has is not determined: a third foot on a plane.
IDLE = "idle"
FREE = "free"
# Sign of the slip.
SIGNS = {SLIPS_UP: 1, SLIPS_DOWN: -1}

Statuses = tuple[str, ...]


def closed_statuses(contact: Contact) -> Statuses:
    """What may hold at a contact whose gap is closed, sticking first."""
    return (STICKS, SLIPS_UP, SLIPS_DOWN) if contact.has_friction else (HELD,)


def label(contact: Contact, status: str) -> str:
    """A closed contact in the name of a mode."""
    return f"{contact.name} {status}".strip()


def mode_name(contacts: Sequence[Contact], statuses: Statuses) -> str:
    """Name of a mode: ``free``, ``left``, ``left+right``, ``left sticks, right slips +``."""
    closed = [(each, status) for each, status in zip(contacts, statuses, strict=True) if status != OPEN]
    labels = [label(*each) for each in closed]
    plain = all(status == HELD for _, status in closed)
    return ("+" if plain else ", ").join(labels) or FREE


def statuses_of(contacts: Sequence[Contact], name: str, what: str = "Mode") -> Statuses:
    """What holds in the mode of a name; ``what`` begins the text of an error.

    Raises
    ------
    ModelError
        If it is the name of no mode.
    """
    found = [OPEN] * len(contacts)
    known = {
        label(each, status): (i, status)
        for i, each in enumerate(contacts)
        for status in (*closed_statuses(each), IDLE)
    }
    if name != FREE:
        for part in name.split(", ") if name in known or ", " in name else name.split("+"):
            if part not in known:
                raise ModelError(
                    f"{what} {name!r} does not exist. Modes are named by what holds: {FREE!r}, or some "
                    f"of {', '.join(map(repr, known))}; joined by '+', by ', ' if there is friction."
                )
            i, found[i] = known[part]
    if mode_name(contacts, tuple(found)) != name:
        raise ModelError(f"{what} {name!r} does not exist; {mode_name(contacts, tuple(found))!r} does.")
    return tuple(found)
