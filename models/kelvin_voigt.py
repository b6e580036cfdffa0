"""A spring and a damper between two bodies, and the constants that give a restitution and a duration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from math import cos, cosh, exp, pi, sin, sinh, tan, tanh
from typing import Any, ClassVar

from hybrid import Guard, Laws, Mode, Transition, arguments
from models.contact_energy import (
    Bodies,
    kelvin_voigt_force,
    kelvin_voigt_power,
    laws_apart,
    negative,
    spring_energy,
)
from models.contact_motion import (
    force_between,
    free,
    pushed,
    restitution_of,
    root,
)

# Restitution of a Kelvin-Voigt contact with critical damping; a smaller one needs damping above critical.
CRITICAL_RESTITUTION = exp(-2)

# Between these angles the restitution takes every value of floating point.
LEAST_ANGLE, LARGEST_ANGLE = 1e-8, 350.0


@dataclass(frozen=True)
class KelvinVoigt:
    r"""Spring and damper in parallel: :math:`F = k\, \delta + c\, \dot\delta`.

    At the impact the force jumps to :math:`c v`. The contact ends where the force vanishes; if it ended at
    :math:`\delta = 0`, the force would pull at the end. The surfaces are still deformed when the contact
    ends, and the bodies move freely in the mode ``recovery`` until :math:`\delta = 0`. If they approach again
    before that, contact resumes as soon as the force would push.

    Modes ``free``, ``contact``, ``recovery``; transitions ``impact``, ``release`` (into ``recovery``),
    ``parting`` (into ``free``) and ``return`` (into ``contact``).

    Parameters
    ----------
    k, c
        Stiffness, N/m, and damping, N s/m.
    """

    units: ClassVar[Mapping[str, str]] = {"k": "N/m", "c": "N s/m"}
    k: float
    c: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "k", arguments.positive("k", self.k))
        object.__setattr__(self, "c", arguments.not_negative("c", self.c))

    @classmethod
    def from_restitution(cls, e: float, mass: float, duration: float) -> KelvinVoigt:
        r"""The law with restitution ``e``, ``0 < e <= 1``, at any speed, and a given duration of contact.

        With the damping ratio :math:`\zeta = \cos\theta` the force vanishes after
        :math:`T = 2 \theta / (\omega \sin\theta)`, :math:`\omega^2 = k / m`, and
        :math:`e = \exp(-2 \theta \cot\theta)`. Above critical damping, for ``e < exp(-2)``, :math:`\theta` is
        imaginary.

        Parameters
        ----------
        e
            Coefficient of restitution.
        mass, duration
            Reduced mass, kg, and duration of contact, s, for example from :meth:`Hertz.duration`.

        Raises
        ------
        ArgumentError
            If ``e`` is out of its range.
        """
        e = restitution_of(e)
        mass, duration = arguments.positive("mass", mass), arguments.positive("duration", duration)
        if e == 1:
            omega = pi / duration
            return cls(arguments.result("k", mass * omega * omega), 0.0)
        if e > CRITICAL_RESTITUTION:
            theta = root(lambda theta: exp(-2 * theta / tan(theta)) - e, LEAST_ANGLE, pi / 2)
            zeta, omega = cos(theta), 2 * theta / (duration * sin(theta))
        else:
            theta = root(lambda theta: e - exp(-2 * theta / tanh(theta)), LEAST_ANGLE, LARGEST_ANGLE)
            zeta, omega = cosh(theta), 2 * theta / (duration * sinh(theta))
        k = arguments.result("k", mass * omega * omega)
        return cls(k, arguments.result("c", 2 * zeta * omega * mass))

    @property
    def parameters(self) -> dict[str, float]:
        """``k`` and ``c``."""
        return asdict(self)

    def modes(self, bodies: Bodies) -> list[Mode]:
        """``free``, ``contact`` and ``recovery``."""
        parted = free(bodies)
        contact = pushed(bodies, kelvin_voigt_force)
        return [parted, contact, Mode("recovery", parted.field)]

    def transitions(self, bodies: Bodies) -> list[Transition]:
        """``impact``, ``release``, ``parting`` and ``return``."""
        force = partial(force_between, bodies, kelvin_voigt_force)
        return [
            Transition("free", "contact", Guard(bodies.penetration, +1), name="impact"),
            Transition("contact", "recovery", Guard(force, -1), name="release"),
            Transition("recovery", "free", Guard(bodies.penetration, -1), name="parting"),
            Transition("recovery", "contact", Guard(force, +1), name="return"),
        ]

    def outputs(self, bodies: Bodies) -> dict[str, Any]:
        """Force and energy; while the surfaces recover there is no force, and their energy is lost."""
        energy = {"free": bodies.energy, "contact": partial(spring_energy, bodies), "recovery": bodies.energy}
        return {"force": {"contact": partial(force_between, bodies, kelvin_voigt_force)}, "energy": energy}

    def laws(self, bodies: Bodies) -> Laws:
        """Energy with that of the spring, and its loss; no force but at the impact."""
        force = partial(force_between, bodies, kelvin_voigt_force)
        contact = Laws(
            invariant={
                "contact": {"penetration": bodies.penetration, "force": force},
                "recovery": {
                    "penetration": bodies.penetration,
                    "pull that is left out": partial(negative, force),
                },
            },
            balance={
                "contact": {"energy": (partial(spring_energy, bodies), partial(kelvin_voigt_power, bodies))},
                "recovery": {"energy": (bodies.energy, bodies.power)},
            },
            continuous=("release", "parting", "return"),
        )
        return laws_apart(bodies).joined(contact)
