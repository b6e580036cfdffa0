"""A driven oscillator between two elastic stops, with gap, stiffness and preload."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Transition


def stop_oscillator() -> HybridSystem:
    r"""Forced oscillator of unit mass between elastic stops at ``x = d`` and ``x = -d``, preloaded by ``F0``.

    .. math::

        \ddot x + c\, \dot x + k\, x + s(x) = A \cos(w t), \qquad
        s = \begin{cases} 0 & |x| < d \\ F_0 \operatorname{sgn} x + k_s (x - d \operatorname{sgn} x)
        & |x| > d \end{cases}

    Without preload the restoring force is trilinear. With preload each stop is a spring pressed against its
    seat, which yields only to a force above ``F0``.

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity); modes ``free``, ``right``, ``left``; transitions named
        ``touch right``, ``leave right``, ``touch left``, ``leave left``; forcing period ``2 pi / w``.
        Dimensionless parameters: stiffness ``k = 1``, damping ``c = 0.1``, gap ``d = 1``, stiffness
        ``ks = 10`` and preload ``F0 = 0`` of a stop, forcing amplitude ``A = 1`` and frequency ``w = 1``.
        Outputs: ``energy``, and ``force`` of the stop that is touched.

    Notes
    -----
    - The saltation matrix of touching and leaving is ``[[1, 0], [-F0 / abs(v), 1]]``, the identity without
      preload. The exponents (phase left out) sum to ``-c`` in both cases.
    - Free undamped motion that crosses ``x = 0`` at the speed :math:`V > d \sqrt{k}` has the period

      .. math::

          T = \frac{4}{\omega} \arcsin \frac{\omega d}{V}
          + \frac{4}{\Omega} \arctan \frac{\Omega\, v}{k d + F_0}, \quad
          v = \sqrt{V^2 - k d^2}, \quad \omega^2 = k, \quad \Omega^2 = k + k_s

    - A mass that reaches a preloaded stop and is pressed against it by less than ``F0`` rests at ``x = d``.
      No mode of this model can stay there.

    References
    ----------
    S. W. Shaw, P. J. Holmes, "A periodically forced piecewise linear oscillator", Journal of Sound and
    Vibration 90(1), 129-155, 1983. doi:10.1016/0022-460X(83)90407-8

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> preloaded = {"F0": 2.0}
    >>> arc = simulate(models.stop_oscillator(), (0.1, 1.0), (0.0, 20.0), parameters=preloaded)
    >>> touch = arc.jumps[0]
    >>> bool(np.isclose(touch.saltation[1, 0], -2.0 / abs(touch.x_minus[1])))
    True
    """
    return HybridSystem(
        name="stop oscillator",
        state=("x", "v"),
        parameters={"k": 1.0, "c": 0.1, "d": 1.0, "ks": 10.0, "F0": 0.0, "A": 1.0, "w": 1.0},
        modes=[
            Mode("free", partial(_field, 0)),
            Mode("right", partial(_field, +1)),
            Mode("left", partial(_field, -1)),
        ],
        transitions=[
            Transition("free", "right", Guard(_at_right, direction=+1), name="touch right"),
            Transition("right", "free", Guard(_at_right, direction=-1), name="leave right"),
            Transition("free", "left", Guard(_at_left, direction=-1), name="touch left"),
            Transition("left", "free", Guard(_at_left, direction=+1), name="leave left"),
        ],
        period=_forcing_period,
        outputs={"energy": _energy, "force": {"right": partial(_stop, +1), "left": partial(_stop, -1)}},
        laws=Laws(
            invariant={
                "free": {"distance to the stops": _gap},
                "right": {"compression of the right stop": _at_right},
                "left": {"compression of the left stop": _pressed_left},
            },
            balance={"energy": ("energy", _power)},
        ),
    )


def _field(side, t, x, p):
    stop = side * p.F0 + p.ks * (x.x - side * p.d) if side else 0.0
    return x.v, p.A * np.cos(p.w * t) - p.c * x.v - p.k * x.x - stop


def _stop(side, t, x, p):
    return -(side * p.F0 + p.ks * (x.x - side * p.d))


def _at_right(t, x, p):
    return x.x - p.d


def _at_left(t, x, p):
    return x.x + p.d


def _forcing_period(p):
    return 2 * np.pi / p.w


def _gap(t, x, p):
    return p.d - np.abs(x.x)


def _pressed_left(t, x, p):
    return -_at_left(t, x, p)


def _energy(t, x, p):
    given = np.maximum(np.abs(x.x) - p.d, 0.0)
    return (x.v**2 + p.k * x.x**2 + p.ks * given**2) / 2 + p.F0 * given


def _power(t, x, p):
    return (p.A * np.cos(p.w * t) - p.c * x.v) * x.v
