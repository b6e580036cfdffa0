"""A pressure relief valve: a spring-loaded plate that opens, flutters and hits its seat."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def relief_valve() -> HybridSystem:
    r"""Plate of unit mass on a spring over a reservoir that is filled at a constant rate.

    .. math::

        \ddot y + \kappa\, \dot y + y + \delta = P, \quad \dot P = \beta\, (q - y \sqrt P), \quad y \ge 0

    At the seat, :math:`y = 0`, the velocity changes its sign and is reduced by the restitution. Where impacts
    accumulate the valve is closed until the pressure exceeds the set pressure.

    Returns
    -------
    HybridSystem
        State ``y`` (lift), ``v`` (velocity), ``P`` (pressure); modes ``open`` and ``closed``; transitions
        ``impact`` and ``opens``. Dimensionless parameters: damping ``kappa = 1.25``, stiffness of the
        reservoir ``beta = 20``, set pressure ``delta = 10``, restitution ``r = 0.8``, inflow ``q = 9``.
        Output: ``outflow``.

    Notes
    -----
    - At the equilibrium the lift is the root of :math:`y \sqrt{y + \delta} = q`, and :math:`P = y + \delta`.
    - With :math:`s = \sqrt{y + \delta}` and :math:`b = \beta y / (2 s)` its eigenvalues are the roots of
      :math:`z^3 + (\kappa + b) z^2 + (1 + \kappa b) z + b + \beta s`, so it has a Hopf point where
      :math:`(\kappa + b)(1 + \kappa b) = b + \beta s`. For smaller inflow the valve flutters.

    References
    ----------
    C. J. Hős, A. R. Champneys, "Grazing bifurcations and chatter in a pressure relief valve model", Physica
    D 241(22), 2068-2076, 2012. doi:10.1016/j.physd.2011.05.013

    Examples
    --------
    >>> import models
    >>> from hybrid import continue_equilibrium, equilibrium
    >>> valve = models.relief_valve()
    >>> rest = equilibrium(valve, (2.5, 0.0, 12.5))
    >>> rest.mode, rest.stable
    ('open', True)
    >>> [hopf] = continue_equilibrium(rest, "q", (1.0, 10.0)).bifurcations
    >>> hopf.kind, round(hopf.value, 6)
    ('Hopf', 8.491118)
    """
    return HybridSystem(
        name="relief valve",
        state=("y", "v", "P"),
        parameters={"kappa": 1.25, "beta": 20.0, "delta": 10.0, "r": 0.8, "q": 9.0},
        modes=[Mode("open", _open), Mode("closed", _closed)],
        transitions=[
            Transition(
                "open",
                "open",
                Guard(_lift, direction=-1),
                Reset(_rebound),
                accumulates_to="closed",
                name="impact",
            ),
            Transition("closed", "open", Guard(_excess, direction=+1), name="opens"),
        ],
        outputs={"outflow": _outflow},
        laws=Laws(invariant={"open": {"lift": _lift}, "closed": {"pressure below the set one": _missing}}),
    )


def _open(t, x, p):
    return x.v, x.P - p.kappa * x.v - x.y - p.delta, p.beta * (p.q - x.y * np.sqrt(x.P))


def _closed(t, x, p):
    return 0.0, 0.0, p.beta * p.q


def _lift(t, x, p):
    return x.y


def _rebound(t, x, p):
    return {"y": 0.0, "v": -p.r * x.v}


def _excess(t, x, p):
    return x.P - p.delta


def _missing(t, x, p):
    return p.delta - x.P


def _outflow(t, x, p):
    return x.y * np.sqrt(x.P)
