"""Chua's circuit: a resonator and a piecewise-linear resistor, chaotic in three affine regions."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Transition


def chua_circuit() -> HybridSystem:
    r"""Chua's circuit with its piecewise-linear resistor, in dimensionless form.

    .. math::

        \dot x = \alpha (y - x - f(x)), \quad \dot y = x - y + z, \quad \dot z = -\beta y, \qquad
        f(x) = m_1 x + \tfrac12 (m_0 - m_1) (|x + 1| - |x - 1|)

    Returns
    -------
    HybridSystem
        State ``x``, ``y`` (voltages of the capacitors, divided by the breakpoint voltage of the resistor),
        ``z`` (scaled current of the inductor); modes ``left`` (``x < -1``), ``inner``, ``right`` (``x > 1``).
        Dimensionless parameters: ``alpha = 9``, ``beta = 100/7``, slopes ``m0 = -8/7`` of the resistor in the
        inner region and ``m1 = -5/7`` in the outer ones.
        Outputs: ``energy``, and the current of the ``resistor``.

    Notes
    -----
    - Field and state are continuous at the transitions, so the saltation matrices are the identity.
    - Equilibria are the origin and ``(x, 0, -x)`` with ``x = +-(m1 - m0) / (1 + m1)``, +-1.5. With the slope
      ``m`` there and ``a = alpha (1 + m)``, their eigenvalues are the roots of
      ``s^3 + (1 + a) s^2 + (beta + a - alpha) s + beta a``.
    - The divergence is ``-1 - a``. If the fraction ``nu`` of the time is spent in the inner region, the
      exponents sum to ``-1 - alpha (1 + m1 + nu (m0 - m1))``.
    - The defaults give the double scroll, with the exponents 0.327, 0, -2.520 (Sprott 2003), and so the
      Kaplan-Yorke dimension 2.13.

    References
    ----------
    T. Matsumoto, L. O. Chua, M. Komuro, "The double scroll", IEEE Transactions on Circuits and Systems
    32(8), 797-818, 1985. doi:10.1109/TCS.1985.1085791; J. C. Sprott, Chaos and Time-Series Analysis, Oxford
    University Press 2003, appendix A.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.chua_circuit(), (0.7, 0.0, 0.0), (0.0, 50.0))
    >>> sorted(set(arc.mode.tolist()))
    ['inner', 'left', 'right']
    """
    return HybridSystem(
        name="Chua's circuit",
        state=("x", "y", "z"),
        parameters={"alpha": 9.0, "beta": 100 / 7, "m0": -8 / 7, "m1": -5 / 7},
        modes=[
            Mode("left", partial(_field, -1.0)),
            Mode("inner", partial(_field, 0.0)),
            Mode("right", partial(_field, 1.0)),
        ],
        transitions=[
            Transition("left", "inner", _breakpoint_at(-1.0, +1)),
            Transition("inner", "left", _breakpoint_at(-1.0, -1)),
            Transition("inner", "right", _breakpoint_at(1.0, +1)),
            Transition("right", "inner", _breakpoint_at(1.0, -1)),
        ],
        outputs={"energy": _energy, "resistor": _resistor},
        laws=Laws(
            invariant={
                "left": {"distance to the inner region": partial(_outside, -1.0)},
                "inner": {"distance to the outer regions": _inside},
                "right": {"distance to the inner region": partial(_outside, 1.0)},
            },
            balance={"energy": ("energy", _power)},
            continuous=("left->inner", "inner->left", "inner->right", "right->inner"),
        ),
    )


def _field(side, t, x, p):
    # In each mode the resistor is linear; in the outer modes its line starts at x = side.
    resistor = p.m1 * x.x + (p.m0 - p.m1) * (side if side else x.x)
    return p.alpha * (x.y - x.x - resistor), x.x - x.y + x.z, -p.beta * x.y


def _breakpoint_at(side, direction):
    return Guard(partial(_beyond, side), direction=direction)


def _beyond(side, t, x, p):
    return x.x - side


def _outside(side, t, x, p):
    return side * x.x - 1


def _inside(t, x, p):
    return 1 - np.abs(x.x)


def _energy(t, x, p):
    return (x.x**2 / p.alpha + x.y**2 + x.z**2 / p.beta) / 2


def _resistor(t, x, p):
    return p.m1 * x.x + (p.m0 - p.m1) * (np.abs(x.x + 1) - np.abs(x.x - 1)) / 2


def _power(t, x, p):
    return -((x.x - x.y) ** 2) - _resistor(t, x, p) * x.x
