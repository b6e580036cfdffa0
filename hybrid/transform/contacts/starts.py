"""What is asked of a start: gaps that are not negative, coefficients within their ranges."""

from __future__ import annotations

from functools import cached_property

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import mentions
from hybrid.expression.nodes import Expression
from hybrid.system.growth import Place
from hybrid.transform.contacts.statuses import OPEN, Statuses
from hybrid.transform.contacts.view import Mechanics

# A start in a mode that holds a contact may have a gap, of either sign, of so many times that which counts as
# closed: the contact is drawn back, and a run by a coarse solver goes on from its end.
MOST_OPEN = 1e5
# A coefficient beyond its range by no more than this is rounding: 1.0000000000000002 is a restitution of 1.
ROUNDING = 1e-12


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
        gaps = values[: len(self.mechanics.contacts)]
        for i, (each, gap) in enumerate(zip(self.mechanics.contacts, gaps, strict=True)):
            told = f"x0 = {tuple(map(float, place[1]))}: the gap of contact {each.contact.name!r} is {gap:g}"
            held = statuses is not None and statuses[i] != OPEN
            most = MOST_OPEN * self.together if held else self.together
            if gap < -most:
                raise ArgumentError(
                    f"{told}, and bodies cannot overlap. Start with a gap that is not negative."
                )
            if held and gap > most:
                raise ArgumentError(
                    f"{told}, and the mode that mode= names holds it closed. Start with a gap of zero, or "
                    "leave the mode to the state."
                )
        for (title, what, _), value in zip(self._coefficients, values[len(gaps) :], strict=True):
            if not -ROUNDING <= value <= (1.0 + ROUNDING if what == "restitution" else np.inf):
                allowed = "between 0 and 1" if what == "restitution" else "0 or more"
                raise ArgumentError(f"parameters: {title}: {what} must be {allowed}; it is {value:g}.")
        return any(gap <= self.together for gap in gaps)

    @cached_property
    def _coefficients(self) -> list[tuple[str, str, Expression]]:
        """The coefficients that parameters decide: others have a meaning only where contacts are closed.

        Static friction counts as what it is above the kinetic one.
        """
        space = self.mechanics.space
        found = []
        for each in self.mechanics.contacts:
            named = {
                "restitution": each.restitution,
                "friction": each.friction,
                "static friction, less the kinetic one,": each.static - each.friction,
            }
            found += [
                (each.contact.title, what, coefficient)
                for what, coefficient in named.items()
                if not mentions(coefficient, (space.t, *space.q, *space.u))
            ]
        return found

    @cached_property
    def _program(self) -> Program:
        gaps = [each.gap for each in self.mechanics.contacts]
        return Program([*gaps, *(each[2] for each in self._coefficients)])
