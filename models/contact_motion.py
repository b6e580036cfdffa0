"""What contact laws between two bodies share: their interface, fields, guards, outputs, restitution."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol, runtime_checkable

from hybrid import Guard, Laws, Mode, Transition, arguments
from models.contact_energy import (
    Bodies,
    hertz_energy,
)

RESTITUTION = "satisfy 0 < e <= 1 in a compliant contact (in a rigid one e may be 0)"


def free(bodies: Bodies) -> Mode:
    """The mode ``free``, in which the bodies are apart."""
    return Mode("free", partial(apart, bodies))


def pushed(bodies: Bodies, force: Callable[..., Any]) -> Mode:
    """The mode ``contact`` under a force of ``(penetration, rate, p)``."""
    return Mode("contact", partial(pushed_apart, bodies, force))


def soft_outputs(bodies: Bodies, force: Callable[..., Any]) -> dict[str, Any]:
    """Force and energy of a contact whose force begins and ends with the penetration."""
    return {
        "force": {"contact": partial(force_between, bodies, force)},
        "energy": {"free": bodies.energy, "contact": partial(hertz_energy, bodies)},
    }


def apart(bodies, t, x, p):
    """The field without a force between the bodies."""
    return bodies.field(t, x, p, 0.0)


def pushed_apart(bodies, force, t, x, p):
    """The field with the force between the bodies."""
    return bodies.field(t, x, p, force_between(bodies, force, t, x, p))


def force_between(bodies, force, t, x, p):
    """The force at a state."""
    return force(bodies.penetration(t, x, p), bodies.rate(t, x, p), p)


def collided(bodies, t, x, p):
    """The state after a collision with the restitution ``p.e``."""
    return bodies.collided(t, x, p, p.e)


def in_and_out(bodies: Bodies) -> list[Transition]:
    """Into contact where the penetration begins, and out of it where it ends."""
    return [
        Transition("free", "contact", Guard(bodies.penetration, +1), name="impact"),
        Transition("contact", "free", Guard(bodies.penetration, -1), name="release"),
    ]


@runtime_checkable
class ContactLaw(Protocol):
    """A law of contact: its parameters, and the modes and transitions of two bodies in contact.

    In the mode ``free`` the bodies are apart; contact begins with the transition ``impact``.
    """

    @property
    def parameters(self) -> dict[str, float]:
        """Default values by name."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the parameters by name, for a state in m and m/s."""
        ...

    def modes(self, bodies: Bodies) -> list[Mode]:
        """The mode ``free`` and those in which the bodies touch."""
        ...

    def transitions(self, bodies: Bodies) -> list[Transition]:
        """The transition ``impact`` and those that lead back to ``free``."""
        ...

    def outputs(self, bodies: Bodies) -> dict[str, Any]:
        """The energy, and the force of the contact if there is one."""
        ...

    def laws(self, bodies: Bodies) -> Laws:
        """What is known of gap, energy and impact."""
        ...


def restitution_of(e: float) -> float:
    """A coefficient of restitution that a compliant contact can have."""
    found = arguments.not_negative("e", e, RESTITUTION)
    if not 0 < found <= 1:
        raise arguments.refusal("e", RESTITUTION, e)
    return found


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a function that is negative at ``low`` and positive at ``high``, by bisection to rounding."""
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return high
