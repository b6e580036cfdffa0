r"""Laws of contact between two bodies, from rigid to Hunt and Crossley's, and how to match them.

With the penetration :math:`\delta`, its rate :math:`\dot\delta` and the reduced mass
:math:`m = m_1 m_2 / (m_1 + m_2)`, an isolated impact obeys :math:`m \ddot\delta = -F`. It starts at
:math:`\delta = 0, \dot\delta = v` and ends at :math:`\dot\delta = -e\, v`; :math:`e` is the coefficient of
restitution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from math import expm1, gamma, log1p, pi, sqrt
from typing import Any, ClassVar

from hybrid import Guard, Laws, Mode, Reset, Transition, arguments
from models.contact_energy import (
    Bodies,
    hertz_force,
    hunt_crossley_force,
    hunt_crossley_power,
    laws_apart,
    restitution_error,
    soft_laws,
)
from models.contact_motion import (
    ContactLaw,
    collided,
    free,
    in_and_out,
    pushed,
    restitution_of,
    root,
    soft_outputs,
)
from models.kelvin_voigt import KelvinVoigt

__all__ = [
    "ContactLaw",
    "Hertz",
    "HuntCrossley",
    "KelvinVoigt",
    "Rigid",
    "after_collision",
    "hertz_stiffness",
    "matched_laws",
]


@dataclass(frozen=True)
class Rigid:
    r"""Rigid contact, with Newton's law of restitution: :math:`\dot\delta \mapsto -e\, \dot\delta`.

    There is one mode, ``free``, and one transition, ``impact``. If impacts accumulate, the run ends with the
    status ACCUMULATION, since there is no mode in which the bodies stay together.

    Parameters
    ----------
    e
        Coefficient of restitution.
    """

    units: ClassVar[Mapping[str, str]] = {}
    e: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "e", arguments.not_negative("e", self.e))

    @property
    def parameters(self) -> dict[str, float]:
        """``e``."""
        return asdict(self)

    def modes(self, bodies: Bodies) -> list[Mode]:
        """``free``."""
        return [free(bodies)]

    def transitions(self, bodies: Bodies) -> list[Transition]:
        """``impact``."""
        collision = Reset(partial(collided, bodies))
        return [Transition("free", "free", Guard(bodies.penetration, +1), collision, name="impact")]

    def outputs(self, bodies: Bodies) -> dict[str, Any]:
        """The energy; the force of an impact has no bound."""
        return {"energy": bodies.energy}

    def laws(self, bodies: Bodies) -> Laws:
        """Energy, and the restitution."""
        restitution = partial(restitution_error, bodies)
        return laws_apart(bodies).joined(Laws(across={"impact": {"restitution": restitution}}))


@dataclass(frozen=True)
class Hertz:
    r"""Elastic contact of smooth bodies: :math:`F = K\, \delta^{3/2}`.

    Modes ``free`` and ``contact``, in contact while :math:`\delta \ge 0`; transitions ``impact`` and
    ``release``.

    Parameters
    ----------
    K
        Stiffness, N/m^(3/2).
    """

    units: ClassVar[Mapping[str, str]] = {"K": "N/m^(3/2)"}
    K: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "K", arguments.positive("K", self.K))

    @property
    def parameters(self) -> dict[str, float]:
        """``K``."""
        return asdict(self)

    def modes(self, bodies: Bodies) -> list[Mode]:
        """``free`` and ``contact``."""
        return [free(bodies), pushed(bodies, hertz_force)]

    def transitions(self, bodies: Bodies) -> list[Transition]:
        """``impact`` and ``release``."""
        return in_and_out(bodies)

    def outputs(self, bodies: Bodies) -> dict[str, Any]:
        """Force and energy."""
        return soft_outputs(bodies, hertz_force)

    def laws(self, bodies: Bodies) -> Laws:
        """Energy with that of the contact; no force at the impact."""
        return soft_laws(bodies, bodies.power)

    def duration(self, mass: float, speed: float) -> float:
        r"""Duration of an impact, s.

        .. math::

            T = \frac{4 \sqrt{\pi}\, \Gamma(2/5)}{5\, \Gamma(9/10)} \frac{\delta_{max}}{v} = 2.943
            \frac{\delta_{max}}{v}, \quad \delta_{max} = \Bigl(\frac{5 m v^2}{4 K}\Bigr)^{2/5}

        Parameters
        ----------
        mass, speed
            Reduced mass :math:`m`, kg, and speed of approach :math:`v`, m/s.

        References
        ----------
        K. L. Johnson, Contact Mechanics, Cambridge University Press 1985, section 11.4,
        doi:10.1017/CBO9781139171731.
        """
        mass, speed = arguments.positive("mass", mass), arguments.positive("speed", speed)
        # Powers of each number alone: the square of a speed may be too large or too small for a float.
        deepest_over_speed = 1.25**0.4 * mass**0.4 / self.K**0.4 / speed**0.2
        return arguments.result("duration", 0.8 * sqrt(pi) * gamma(0.4) / gamma(0.9) * deepest_over_speed)


@dataclass(frozen=True)
class HuntCrossley:
    r"""Hertz contact with losses: :math:`F = K\, \delta^{3/2} (1 + \tfrac32 \alpha\, \dot\delta)`.

    Modes and transitions are those of :class:`Hertz`. The force starts and ends at zero and never pulls, so
    no impact rebounds faster than :math:`2 / (3 \alpha)`.

    Parameters
    ----------
    K
        Stiffness, N/m^(3/2).
    alpha
        Loss, s/m; for small :math:`\alpha v` the restitution is :math:`1 - \alpha v`.

    References
    ----------
    K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", Journal
    of Applied Mechanics 42(2), 440-445, 1975, doi:10.1115/1.3423596.
    """

    units: ClassVar[Mapping[str, str]] = {"K": "N/m^(3/2)", "alpha": "s/m"}
    K: float
    alpha: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "K", arguments.positive("K", self.K))
        object.__setattr__(self, "alpha", arguments.not_negative("alpha", self.alpha))

    @classmethod
    def from_restitution(cls, e: float, K: float, speed: float) -> HuntCrossley:
        r"""The law with restitution ``e``, ``0 < e <= 1``, at one speed of impact.

        The restitution depends on neither stiffness nor mass: with :math:`u = \tfrac32 \alpha v`,
        :math:`(1 + e)\, u = \ln\frac{1 + u}{1 - e u}` exactly.

        Parameters
        ----------
        e, K
            Coefficient of restitution and stiffness, N/m^(3/2).
        speed
            Speed of approach :math:`v`, m/s.

        Raises
        ------
        ArgumentError
            If ``e`` is out of its range.
        """
        e = restitution_of(e)
        K, speed = arguments.positive("K", K), arguments.positive("speed", speed)
        if e == 1:
            return cls(K, 0.0)

        # The unknown is w = -ln(1 - e u), which keeps its digits if e u is close to one.
        def u(w: float) -> float:
            return -expm1(-w) / e

        # The root is u = 3/2 (1 - e) to first order, and lies above a sixth of that.
        least = -log1p(-e * (1 - e) / 4)
        w = root(lambda w: log1p(u(w)) + w - (1 + e) * u(w), least, (1 + e) / e)
        return cls(K, arguments.result("alpha", 2 * u(w) / 3 / speed))

    @property
    def parameters(self) -> dict[str, float]:
        """``K`` and ``alpha``."""
        return asdict(self)

    def modes(self, bodies: Bodies) -> list[Mode]:
        """``free`` and ``contact``."""
        return [
            free(bodies),
            pushed(bodies, hunt_crossley_force),
        ]

    def transitions(self, bodies: Bodies) -> list[Transition]:
        """``impact`` and ``release``."""
        return in_and_out(bodies)

    def outputs(self, bodies: Bodies) -> dict[str, Any]:
        """Force and energy."""
        return soft_outputs(bodies, hunt_crossley_force)

    def laws(self, bodies: Bodies) -> Laws:
        """Energy with that of the contact, and its loss; no force at the impact."""
        return soft_laws(bodies, partial(hunt_crossley_power, bodies))


def hertz_stiffness(
    E: float = 2.1e11, nu: float = 0.3, A: float = 0.5, B: float = 0.5, q: float = 0.318
) -> float:
    """Hertz stiffness ``K = (4/3) q / ((d1 + d2) sqrt(A + B))``, ``d = (1 - nu^2) / (E pi)`` for both bodies.

    Parameters
    ----------
    E, nu
        Young's modulus in N/m^2 and Poisson's ratio, the same for both bodies.
    A, B, q
        Curvatures of the contact in 1/m, and the corresponding coefficient.
    """
    E, q = arguments.positive("E", E), arguments.positive("q", q)
    A, B = arguments.positive("A", A), arguments.positive("B", B)
    nu = arguments.number("nu", nu)
    if not abs(nu) < 1:
        raise arguments.refusal("nu", "lie between -1 and 1", nu)
    # E / (1 - nu^2) = 1 / (pi d), and the sum of two curvatures may be too large for a float.
    curvature = 2 * (A / 4 + B / 4) ** 0.5
    stiffness = 2 / 3 * pi * q * (E / ((1 - nu) * (1 + nu))) / curvature
    return arguments.result("hertz_stiffness", stiffness)


def matched_laws(K: float, mass: float, speed: float, e: float = 1.0) -> dict[str, ContactLaw]:
    """Every law that can have restitution ``e``, matched at one speed of impact, the simplest first.

    All laws lose the same energy at that speed. Hertz and Hunt-Crossley have the same stiffness. Kelvin-Voigt
    has the duration of the Hertz contact, since tangent vectors rotate for that time.

    Parameters
    ----------
    K
        Hertz stiffness, N/m^(3/2).
    mass, speed
        Reduced mass, kg, and speed of approach, m/s.
    e
        Coefficient of restitution, ``0 < e <= 1``. The Hertz contact is included only for ``e = 1``, the
        Hunt-Crossley contact only for ``e < 1``, since the two are equal for ``e = 1``.

    Raises
    ------
    ArgumentError
        If ``e`` is out of its range.

    Examples
    --------
    >>> laws = matched_laws(K=1.5e11, mass=90.9, speed=0.4, e=0.8)
    >>> {name: sorted(law.parameters) for name, law in laws.items()}
    {'rigid': ['e'], 'Kelvin-Voigt': ['c', 'k'], 'Hunt-Crossley': ['K', 'alpha']}
    """
    e = restitution_of(e)
    hertz = Hertz(K)
    return {
        "rigid": Rigid(e),
        "Kelvin-Voigt": KelvinVoigt.from_restitution(e, mass, hertz.duration(mass, speed)),
        **({"Hertz": hertz} if e == 1 else {"Hunt-Crossley": HuntCrossley.from_restitution(e, K, speed)}),
    }


def after_collision(m1: float, m2: float, v1: Any, v2: Any, e: Any) -> tuple[Any, Any]:
    """Velocities after a collision, which keeps the momentum and turns ``v1 - v2`` into ``-e (v1 - v2)``."""
    impulse = (1 + e) * m1 * m2 / (m1 + m2) * (v1 - v2)
    return v1 - impulse / m1, v2 + impulse / m2
