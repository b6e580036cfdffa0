"""A harmonically forced oscillator with dry friction, and the closed form of its motion without stops."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import ArgumentError, HybridSystem, Laws, arguments, filippov


def dry_friction_oscillator() -> HybridSystem:
    r"""Forced linear oscillator of unit mass and stiffness on a support with Coulomb friction.

    .. math::

        \ddot x + c\, \dot x + x + f \operatorname{sgn}(\dot x) = A \cos(w t)

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity). The modes are those of :func:`hybrid.filippov` with the
        switching function ``v``: ``below`` and ``above`` slide backwards and forwards, ``sliding`` is the
        stop, which lasts while ``abs(A cos(w t) - x) <= f``. Forcing period ``2 pi / w``. Dimensionless
        parameters: viscous damping ``c = 0``, friction ``f = 0.5``, forcing amplitude ``A = 1`` and frequency
        ``w = 0.8``.
        Outputs: the force of ``friction``, and ``energy``.

    Notes
    -----
    - With the defaults the motion has no stops; :func:`den_hartog_amplitude` gives its amplitude. With more
      friction or slower forcing it stops at least twice per period, and one multiplier is exactly zero.
    - A turning point without a stop multiplies areas by ``a_plus / a_minus``, the ratio of the accelerations
      after and before it. Dry friction contracts areas only there; a stop removes one dimension.
    - At ``w = 1/2`` and ``c = 0`` the motion without stops is one of a family, whose other members are
      unsymmetric. One multiplier is 1, because half a forcing period is a period of the free oscillator.

    References
    ----------
    J. P. Den Hartog, "Forced vibrations with combined Coulomb and viscous friction", Transactions of the ASME
    53, 107-115, 1931.
    S. W. Shaw, "On the dynamic response of a system with dry friction", Journal of Sound and Vibration
    108(2), 305-325, 1986. doi:10.1016/S0022-460X(86)80058-X

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> from models.dry_friction_oscillator import den_hartog_amplitude
    >>> system = models.dry_friction_oscillator()
    >>> arc = simulate(system, (1.0, 0.0), (0.0, 200 * system.forcing_period()), mode="above")
    >>> late = arc.t > 190 * system.forcing_period()
    >>> bool(np.isclose(arc["x"][late].max(), den_hartog_amplitude(f=0.5, A=1.0, w=0.8), rtol=1e-6))
    True
    """
    return filippov(
        name="dry-friction oscillator",
        state=("x", "v"),
        parameters={"c": 0.0, "f": 0.5, "A": 1.0, "w": 0.8},
        below=partial(_field, -1),
        above=partial(_field, +1),
        switching=_velocity,
        period=_forcing_period,
        outputs={
            "friction": {
                "below": partial(_friction, -1),
                "above": partial(_friction, +1),
                "sliding": _holding,
            },
            "energy": _energy,
        },
        laws=Laws(
            invariant={
                "below": {"speed backwards": _backwards},
                "above": {"speed forwards": _velocity},
                "sliding": {"friction in reserve": _hold},
            },
            equal={"sliding": {"velocity": _velocity}},
            balance={"energy": ("energy", _power)},
        ),
    )


def den_hartog_amplitude(f: float, A: float, w: float) -> float:
    r"""Amplitude of the symmetric motion of :func:`dry_friction_oscillator` without stops, at ``c = 0``.

    .. math::

        X^2 = \left(\frac{A}{1 - w^2}\right)^2 - \left(\frac{f \tan(\pi / 2 w)}{w}\right)^2

    For half a period from the turning point at ``X`` the velocity is
    ``f sin(s) + D (cos(s) - cos(w s)) - X w sin(w s)``, with ``D = -f tan(pi / 2 w)``. The motion exists if
    this velocity stays negative.

    Parameters
    ----------
    f, A, w
        As in :func:`dry_friction_oscillator`; ``w`` must not be ``1, 1/3, 1/5, ...``.

    Returns
    -------
    float
        The amplitude, or ``nan`` if the motion does not exist.
    """
    f, A, w = arguments.not_negative("f", f), arguments.number("A", A), arguments.positive("w", w)
    if w == 1.0:
        raise ArgumentError("w must not be 1: the motion has no bound at resonance.")
    arguments.result("pi / w", np.pi / w)
    D = -f * np.tan(np.pi / (2 * w))
    forced, friction = abs(A / ((1 - w) * (1 + w))), abs(D / w)
    # The squares of the two may be too large for a float.
    X = np.sqrt(np.maximum(forced - friction, 0.0)) * np.sqrt(forced + friction)
    s = np.linspace(0.0, np.pi / w, 4001)[1:-1]
    v = f * np.sin(s) + D * (np.cos(s) - np.cos(w * s)) - X * w * np.sin(w * s)
    return float(X) if v.max() < 0 else np.nan


def _field(sign, t, x, p):
    return x.v, p.A * np.cos(p.w * t) - x.x - p.c * x.v - sign * p.f


def _friction(sign, t, x, p):
    return -sign * p.f


def _holding(t, x, p):
    # The friction that holds the block carries the rest of the forces.
    return x.x - p.A * np.cos(p.w * t)


def _velocity(t, x, p):
    return x.v


def _forcing_period(p):
    return 2 * np.pi / p.w


def _backwards(t, x, p):
    return -x.v


def _hold(t, x, p):
    return p.f - np.abs(p.A * np.cos(p.w * t) - x.x)


def _energy(t, x, p):
    return (x.v**2 + x.x**2) / 2


def _power(t, x, p):
    return (p.A * np.cos(p.w * t) - p.c * x.v) * x.v - p.f * np.abs(x.v)
