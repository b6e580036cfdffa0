"""What happens at contacts: the events at which a mode ends."""

from __future__ import annotations

import attrs

IMPACT, OPENS, BREAKS, STOPS = "impact", "opens", "breaks", "stops"
SETTLES, JAMS = "settles", "jams"
# Events that change velocities at once.
SUDDEN = (IMPACT, SETTLES)


@attrs.frozen
class ContactEvent:
    """An event at a contact.

    Attributes
    ----------
    kind
        ``impact``: a gap closes. ``opens``: a normal force becomes zero. ``breaks``: a friction force reaches
        its bound. ``stops``: a slip ends. ``settles``: infinitely many impacts are over.
        ``jams``: forces grow beyond all bounds.
    contact
        Index of the contact; -1 if there is no one contact.
    """

    kind: str
    contact: int = -1
