"""A lag under a sampled PI controller whose output saturates: a held value and a clock."""

from __future__ import annotations

import numpy as np

from hybrid import Every, HybridSystem, Laws, Mode, Reset, Transition


def sampled_loop() -> HybridSystem:
    r"""First-order lag with a digital PI controller in incremental form, which cannot wind up.

    .. math::

        \tau\, \dot y = K u - y, \qquad
        u \mapsto \operatorname{sat}\bigl(u + K_p (\varepsilon - e) + K_i T \varepsilon\bigr), \quad
        e \mapsto \varepsilon = r - y \quad \text{every } T, \qquad |u| \le u_{max}

    Returns
    -------
    HybridSystem
        State ``y``; held ``u`` (the output of the controller) and ``e`` (the last error), which samples
        change; mode ``run``; transition ``sample``. Parameters: gain ``K = 1`` and time constant
        ``tau = 1`` s of the lag; sampling period ``T = 0.1`` s; gains ``Kp = 4`` and ``Ki = 6`` 1/s of the
        controller, its limit ``u_max = 1.5``; set point ``r = 1``. Only ``tau``, ``T`` and ``Ki`` have units.
        Output: ``error`` between reference and ``y`` at any time.

    Notes
    -----
    With ``phi = exp(-T / tau)`` and ``u`` within its limits, one sample and one period map deviations of
    ``(y, u, e)`` by the matrix with the rows

    - ``(phi - K (1 - phi) k, K (1 - phi), -K (1 - phi) Kp)``,
    - ``(-k, 1, -Kp)``,
    - ``(-1, 0, 0)``,

    where ``k = Kp + Ki T``. The orbit at the set point, ``y = r``, ``u = r / K``, has its eigenvalues as
    multipliers; one is 0. Where ``u`` saturates, a deviation of ``u`` ends.

    References
    ----------
    K. J. Astrom, B. Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall, 1997, sections 2.3
    (sampling of a system) and 8.5 (PID in incremental form, and its windup).

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.sampled_loop(), {"y": 0.0}, (0.0, 12.0))
    >>> round(float(arc["y"][-1]), 6), round(float(arc["u"].max()), 6)
    (1.0, 1.5)
    """
    return HybridSystem(
        name="sampled loop",
        state=("y",),
        held=("u", "e"),
        parameters={"K": 1.0, "tau": 1.0, "T": 0.1, "Kp": 4.0, "Ki": 6.0, "u_max": 1.5, "r": 1.0},
        units={"y": "1", "u": "1", "e": "1", "t": "s", "tau": "s", "T": "s", "Ki": "1/s", "error": "1"},
        modes=[Mode("run", _lag)],
        transitions=[Transition("run", "run", Every("T"), Reset(_sample), name="sample")],
        period=_period,
        outputs={"error": _error},
        laws=Laws(invariant={"rest of the range above": _above, "rest of the range below": _below}),
    )


def _period(p):
    return p.T


def _lag(t, x, p):
    return ((p.K * x.u - x.y) / p.tau,)


def _sample(t, x, p):
    error = p.r - x.y
    wanted = x.u + p.Kp * (error - x.e) + p.Ki * p.T * error
    return {"u": np.clip(wanted, -p.u_max, p.u_max), "e": error}


def _error(t, x, p):
    return p.r - x.y


def _above(t, x, p):
    return p.u_max - x.u


def _below(t, x, p):
    return x.u + p.u_max
