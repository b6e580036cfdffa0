"""An oscillator with negative damping about a switched set point: chaos with an exact solution."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Transition


def solvable_oscillator() -> HybridSystem:
    r"""Solvable chaotic oscillator of Corron, Blakely and Stahl.

    .. math::

        \ddot u - 2 b\, \dot u + (w^2 + b^2)(u - s) = 0, \quad w = 2 \pi, \qquad
        s \mapsto \operatorname{sgn}(u) \text{ at } \dot u = 0

    In mode ``plus`` the sign changes where the velocity rises through zero and ``u`` is negative. A turning
    point where ``s`` already has the sign of ``u``, such as the start, changes nothing.

    Returns
    -------
    HybridSystem
        State ``u``, ``v`` (its velocity); modes ``plus`` (``s = 1``) and ``minus`` (``s = -1``).
        Dimensionless parameter: ``b = 0.5``, the negative damping, ``0 < b < ln(2)``.

    Notes
    -----
    From ``v = 0``, ``abs(u0) < 1``, ``s = sgn(u0)``:

    - turning points are at integer and half-integer times, flips of ``s`` only at integer times. The map from
      one integer time to the next is ``u -> exp(b) u - (exp(b) - 1) s``, an expanding shift; the exponents
      are ``b`` and 0, exactly;
    - between integer times ``u = s + (u_n - s) exp(b t) (cos(w t) - (b / w) sin(w t))``;
    - a flip from ``s`` to ``-s`` has the saltation matrix ``diag(1, (s + u) / (u - s))``.

    References
    ----------
    N. J. Corron, J. N. Blakely, M. T. Stahl, "A matched filter for chaos", Chaos 20, 023123, 2010.
    doi:10.1063/1.3432557

    Examples
    --------
    >>> import models
    >>> from lyapunov import lyapunov_spectrum
    >>> found = lyapunov_spectrum(models.solvable_oscillator(), (0.3, 0.0), mode="plus", interval=1.0)
    >>> bool(abs(found.exponents[0] - 0.5) < 1e-6)
    True
    """
    return HybridSystem(
        name="solvable chaotic oscillator",
        state=("u", "v"),
        parameters={"b": 0.5},
        modes=[Mode("plus", partial(_field, 1.0)), Mode("minus", partial(_field, -1.0))],
        transitions=[
            Transition("plus", "minus", Guard(_velocity, +1, when=_is_negative)),
            Transition("minus", "plus", Guard(_velocity, -1, when=_is_positive)),
        ],
        laws=Laws(
            conserved={
                "plus": {"amplitude without its growth": partial(_amplitude, 1.0)},
                "minus": {"amplitude without its growth": partial(_amplitude, -1.0)},
            }
        ),
    )


def _field(s, t, x, p):
    return x.v, 2 * p.b * x.v - ((2 * np.pi) ** 2 + p.b**2) * (x.u - s)


def _velocity(t, x, p):
    return x.v


def _is_negative(t, x, p):
    return -x.u


def _is_positive(t, x, p):
    return x.u


def _amplitude(s, t, x, p):
    return np.exp(-p.b * t) * np.hypot(x.u - s, (x.v - p.b * (x.u - s)) / (2 * np.pi))
