"""A battery that a drive cycle discharges down to its cut-off voltage: a table in time."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Table, Transition

# The drive cycle, made for this model: stand, accelerate, cruise, brake with recuperation, stand. Each row is
# a time in s, and the current at that time as a share of the largest one.
CYCLE = (
    (0.0, 0.0),
    (10.0, 0.0),
    (20.0, 1.0),
    (22.0, 0.3),
    (50.0, 0.3),
    (52.0, -0.5),
    (58.0, 0.0),
    (65.0, 0.0),
)


def battery_cell() -> HybridSystem:
    r"""Cell with one RC pair (Thevenin's circuit) under a current that repeats a drive cycle.

    .. math::

        Q \dot s = -i, \quad C_1 \dot v_1 = i - v_1 / R_1, \qquad i = I\, d(t \bmod T), \quad
        u = E_0 + (E_1 - E_0)\, s - v_1 - R_0\, i

    Where the terminal voltage ``u`` falls to the cut-off, the cell is switched off: ``i`` is 0 from then on.
    The cycle ``d`` is made of straight lines between the points of ``models.battery_cell.CYCLE``: 65 s with
    one start to full current, cruising, and braking, which charges the cell.

    Returns
    -------
    HybridSystem
        State ``s`` (state of charge, 0 to 1), ``v1`` (voltage of the RC pair, V); modes ``drive`` and
        ``off``; transition ``cut off``. Parameters: capacity ``Q = 9000`` As (2.5 Ah); open-circuit voltage
        from ``E_0 = 3`` V when empty to ``E_1 = 4.1`` V when full; ``R_0 = 0.03`` Ohm, ``R_1 = 0.02`` Ohm,
        ``C_1 = 1000`` F; cut-off ``u_min = 3`` V; largest current ``I = 8`` A. The period of the cycle is
        65 s.
        Outputs: ``voltage`` at the terminals (V), and ``current`` (A).

    Notes
    -----
    The charge drawn in one cycle is ``13 s`` times ``I``. Between the points the current is affine in time,
    so ``s`` is a parabola there, and ``v1`` an affine function plus an exponential. The cut-off comes at a
    peak of the current, while charge is still left: ``R_0 I + v1`` stands between the two voltages.

    References
    ----------
    G. L. Plett, Battery Management Systems, volume 1: Battery Modeling, Artech House, 2015, chapter 2
    (equivalent circuits).

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.battery_cell(), (1.0, 0.0), (0.0, 6000.0))
    >>> [jump.transition for jump in arc.jumps], bool(0.1 < arc["s"][-1] < 0.4)
    (['cut off'], True)
    """
    return HybridSystem(
        name="battery cell",
        state=("s", "v1"),
        parameters={
            "Q": 9000.0, "E_0": 3.0, "E_1": 4.1, "R_0": 0.03, "R_1": 0.02, "C_1": 1000.0, "u_min": 3.0,
            "I": 8.0,
        },
        units={
            "s": "1", "v1": "V", "t": "s", "Q": "A*s", "E_0": "V", "E_1": "V", "R_0": "Ohm", "R_1": "Ohm",
            "C_1": "F", "u_min": "V", "I": "A",
            "voltage": "V", "current": "A",
        },
        modes=[Mode("drive", _drive), Mode("off", _rest)],
        transitions=[Transition("drive", "off", Guard(_reserve, direction=-1), name="cut off")],
        start="drive",
        period=CYCLE[-1][0],
        outputs={
            "voltage": {"drive": _voltage, "off": _open_voltage},
            "current": {"drive": _drawn_now, "off": _none},
        },
        laws=Laws(
            invariant={"drive": {"voltage above the cut-off": _reserve}},
            balance={"drive": {"charge": (_charge, _drawn)}},
        ),
    )  # fmt: skip


_SHARE = Table([time for time, _ in CYCLE], [share for _, share in CYCLE])


def _current(t, p):
    return p.I * _SHARE(np.mod(t, CYCLE[-1][0]))


def _drive(t, x, p):
    i = _current(t, p)
    return -i / p.Q, (i - x.v1 / p.R_1) / p.C_1


def _rest(t, x, p):
    return 0.0, -x.v1 / (p.R_1 * p.C_1)


def _open_voltage(t, x, p):
    return p.E_0 + (p.E_1 - p.E_0) * x.s - x.v1


def _voltage(t, x, p):
    return _open_voltage(t, x, p) - p.R_0 * _current(t, p)


def _reserve(t, x, p):
    return _voltage(t, x, p) - p.u_min


def _drawn_now(t, x, p):
    return _current(t, p)


def _none(t, x, p):
    return 0.0


def _charge(t, x, p):
    return p.Q * x.s


def _drawn(t, x, p):
    return -_current(t, p)
