"""A contact: a gap that cannot become negative, with restitution and dry friction."""

from __future__ import annotations

from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ArgumentError, ModelError, shown
from hybrid.system.elements import Function
from hybrid.system.portable import Portable

# A number, the name of a parameter, or a function of (t, x, p).
Coefficient = float | str | Function
# Names of modes.
TAKEN = "free", "settles", "begins"
MEANING = "be a number, the name of a parameter, or a function of (t, x, p)"


@attrs.frozen
class Contact(Portable):
    """A unilateral contact between two bodies, or of a body with its surroundings.

    The contact force enters the equations of motion as ``(d gap / d q) normal + (d slip / d velocities)
    tangential``, with ``normal >= 0``; by Coulomb's law ``tangential`` opposes the slip, and
    ``|tangential| <= friction normal``.

    Parameters
    ----------
    name
        Modes and outputs are named by it: ``left slips +``, ``left.normal``.
    gap
        ``g(t, x, p)``, positive in flight, of coordinates and time.
    restitution
        Coefficient ``e`` from 0 to 1: a number, the name of a parameter, or a function of ``(t, x, p)``,
        which reads the state before the impact.
    friction
        Coefficient ``mu >= 0`` of kinetic friction, in the same three forms. It needs ``slip``.
    slip
        ``s(t, x, p)``, the relative tangential velocity; affine in the velocities.
    static
        Coefficient of static friction, no smaller than ``friction``, which it is if left out.

    Raises
    ------
    ModelError
        If a name is empty or has a comma or a plus sign, a function is not callable, a coefficient is out of
        range, or there is friction without slip.

    Examples
    --------
    >>> from hybrid import Contact
    >>> floor = Contact("floor", gap=lambda t, x, p: x.y, restitution="e")
    >>> floor.name
    'floor'
    """

    name: str
    gap: Function
    restitution: Coefficient = attrs.field(default=0.0, kw_only=True)
    friction: Coefficient = attrs.field(default=0.0, kw_only=True)
    slip: Function | None = attrs.field(default=None, kw_only=True)
    static: Coefficient | None = attrs.field(default=None, kw_only=True)

    def __attrs_post_init__(self) -> None:
        if not _is_name(self.name):
            raise ModelError(
                "Contact: name must be a non-empty text without ',' and '+', which join names in those of "
                f"modes, not one of {', '.join(map(repr, TAKEN))}, and not end in 'sticks', 'slips -' or "
                f"'idle'; got {shown(self.name)}."
            )
        for what in ("gap", "slip"):
            function = getattr(self, what)
            if not callable(function) and (what == "gap" or function is not None):
                raise ModelError(
                    f"{self.title}: {what} must be a function of (t, x, p); got {shown(function)}."
                )
        self._check("restitution", self.restitution, 1.0)
        self._check("friction", self.friction, None)
        if self.slip is None and (self.static is not None or not _is_zero(self.friction)):
            raise ModelError(
                f"{self.title}: friction needs slip=, the tangential velocity: a function of (t, x, p)."
            )
        if self.static is not None:
            self._check("static", self.static, None)
            static, kinetic = _number(self.static), _number(self.friction)
            if static is not None and kinetic is not None and static < kinetic:
                raise ModelError(
                    f"{self.title}: static friction must be no smaller than friction = {self.friction}; got "
                    f"{self.static}."
                )

    def _check(self, what: str, value: Any, most: float | None) -> None:
        if callable(value) or (isinstance(value, str) and value):
            return
        number = _number(value)
        if number is None:
            raise ModelError(f"{self.title}: {what} must {MEANING}; got {shown(value)}.")
        if not 0.0 <= number <= (number if most is None else most) or number == float("inf"):
            allowed = "a finite number that is not negative" if most is None else "between 0 and 1"
            raise ModelError(f"{self.title}: {what} must be {allowed}; got {shown(value)}.")

    @property
    def title(self) -> str:
        """Beginning of error texts."""
        return f"Contact {self.name!r}"

    @property
    def has_friction(self) -> bool:
        """Whether the contact can stick and slip."""
        return self.slip is not None and not (_is_zero(self.friction) and self.static is None)


def _is_name(name: Any) -> bool:
    if not isinstance(name, str) or not name or name in TAKEN:
        return False
    return not any(each in name for each in ",+") and not name.endswith((" sticks", " slips -", " idle"))


def _number(value: Any) -> float | None:
    """A number; None for what is none, or the name of a parameter."""
    if isinstance(value, str):
        return None
    try:
        return arguments.number("", value)
    except ArgumentError:
        return None


def _is_zero(value: Any) -> bool:
    return _number(value) == 0.0
