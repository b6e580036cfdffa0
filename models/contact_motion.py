"""Two bodies that are apart or pushed into each other: fields, guards and outputs that contact laws share."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from hybrid import Guard, Mode, Transition
from models.contact_energy import (
    Bodies,
    hertz_energy,
)


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
