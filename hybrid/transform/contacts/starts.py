"""What is asked of a start: gaps that are not negative, coefficients within their ranges."""

from __future__ import annotations

from functools import cached_property

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.expression.evaluation import Program
from hybrid.system.growth import Place
from hybrid.transform.contacts.statuses import OPEN, Statuses
from hybrid.transform.contacts.view import Mechanics

# A start in a mode that holds a contact may have a gap of so many times that which counts as closed: the
# contact is drawn back, and a run by a coarse solver goes on from its end.
MOST_OPEN = 1e5


@attrs.frozen(eq=False)
class Starts:
    """The checks of starts; gaps below ``together`` count as closed."""

    mechanics: Mechanics
    together: float

    def closes(self, place: Place, statuses: Statuses | None) -> bool:
        """Whether a gap counts as closed at a start, in a mode of these statuses if one is named.

        Raises
        ------
        ArgumentError
            If a gap is negative, a contact that the mode holds is open, or a coefficient is out of its range.
        """
        with np.errstate(all="ignore"):
            values = self._program.run(self.mechanics.space.values(*place))
        count = len(self.mechanics.contacts)
        gaps = values[:count]
        for i, (each, gap) in enumerate(zip(self.mechanics.contacts, gaps, strict=True)):
            told = f"x0 = {tuple(map(float, place[1]))}: the gap of contact {each.contact.name!r} is {gap:g}"
            if gap < -self.together:
                raise ArgumentError(
                    f"{told}, and bodies cannot overlap. Start with a gap that is not negative."
                )
            if statuses is not None and statuses[i] != OPEN and gap > MOST_OPEN * self.together:
                raise ArgumentError(
                    f"{told}, and the mode that mode= names holds it closed. Start with a gap of zero, or "
                    "leave the mode to the state."
                )
            self._check(each.contact.title, *values[count + 3 * i : count + 3 * i + 3])
        return any(gap <= self.together for gap in gaps)

    def _check(self, title: str, restitution: float, friction: float, static: float) -> None:
        if not 0.0 <= restitution <= 1.0:
            raise ArgumentError(
                f"parameters: {title}: restitution must be between 0 and 1; it is {restitution:g} here."
            )
        if not 0.0 <= friction <= static < np.inf:
            raise ArgumentError(
                f"parameters: {title}: friction must not be negative, and not larger than static friction; "
                f"they are {friction:g} and {static:g} here."
            )

    @cached_property
    def _program(self) -> Program:
        contacts = self.mechanics.contacts
        coefficients = [each for c in contacts for each in (c.restitution, c.friction, c.static)]
        return Program([*(each.gap for each in contacts), *coefficients])
