"""Forces and energies of contacts between two bodies, and what is known of the models that have them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hybrid import Laws


class Bodies(NamedTuple):
    """The functions of the two bodies that a law of contact needs.

    Attributes
    ----------
    field
        ``(t, x, p, force)``: the time derivative of the state under a force that pushes the bodies apart.
    penetration, rate
        ``(t, x, p)``: the overlap of the bodies, and its rate of growth.
    collided
        ``(t, x, p, e)``: the state after a collision by Newton's law.
    energy, power
        ``(t, x, p)``: the energy of the bodies, and its rate of growth while they are apart.
    """

    field: Callable[..., Any]
    penetration: Callable[..., Any]
    rate: Callable[..., Any]
    collided: Callable[..., Any]
    energy: Callable[..., Any]
    power: Callable[..., Any]


def laws_apart(bodies: Bodies) -> Laws:
    """Laws of the bodies while they are apart."""
    return Laws(
        invariant={"free": {"gap": partial(negative, bodies.penetration)}},
        balance={"free": {"energy": (bodies.energy, bodies.power)}},
    )


def soft_laws(bodies: Bodies, power: Callable[..., Any]) -> Laws:
    """Laws of a contact whose force begins and ends with the penetration, with the power of all but it."""
    contact = Laws(
        invariant={"contact": {"penetration": bodies.penetration}},
        balance={"contact": {"energy": (partial(hertz_energy, bodies), power)}},
        continuous=("impact", "release"),
    )
    return laws_apart(bodies).joined(contact)


def hertz_force(penetration: Any, rate: Any, p: Any) -> Any:
    """The force of Hertz's contact."""
    # A step may evaluate a point slightly outside the contact, where the power is undefined.
    return p.K * np.maximum(penetration, 0.0) ** 1.5


def hunt_crossley_force(penetration: Any, rate: Any, p: Any) -> Any:
    """Hertz's force with damping in proportion to it."""
    return hertz_force(penetration, rate, p) * (1 + 1.5 * p.alpha * rate)


def kelvin_voigt_force(penetration: Any, rate: Any, p: Any) -> Any:
    """The force of a spring and a damper."""
    return p.k * penetration + p.c * rate


def negative(function, t, x, p):
    """The negative of a function."""
    return -function(t, x, p)


def hertz_energy(bodies, t, x, p):
    """Energy of the bodies and of Hertz's contact."""
    return bodies.energy(t, x, p) + 0.4 * p.K * np.maximum(bodies.penetration(t, x, p), 0.0) ** 2.5


def spring_energy(bodies, t, x, p):
    """Energy of the bodies and of the spring between them."""
    return bodies.energy(t, x, p) + 0.5 * p.k * bodies.penetration(t, x, p) ** 2


def hunt_crossley_power(bodies, t, x, p):
    """Power of all forces but Hertz's."""
    damping = 1.5 * p.alpha * hertz_force(bodies.penetration(t, x, p), 0.0, p)
    return bodies.power(t, x, p) - damping * bodies.rate(t, x, p) ** 2


def kelvin_voigt_power(bodies, t, x, p):
    """Power of all forces but that of the spring."""
    return bodies.power(t, x, p) - p.c * bodies.rate(t, x, p) ** 2


def restitution_error(bodies, t, minus, plus, p):
    """How far a jump is from Newton's law of restitution."""
    return bodies.rate(t, plus, p) + p.e * bodies.rate(t, minus, p)
