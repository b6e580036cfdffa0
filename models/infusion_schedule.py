"""A drug that is infused by a table of infusions, which may overlap."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from hybrid import At, HybridSystem, Laws, Mode, Reset, Transition

INFUSIONS = {"t": (0.0, 12.0, 4.0), "duration": (8.0, 8.0, 12.0), "amount": (240.0, 120.0, 240.0)}


def infusion_schedule(frame: Any = INFUSIONS) -> HybridSystem:
    r"""One compartment with elimination at first order, and infusions at constant rates.

    .. math::

        V \dot c = r - k V c, \qquad r \mapsto r + \frac{a_j}{d_j} \text{ at } t_j, \qquad
        r \mapsto r - \frac{a_j}{d_j} \text{ at } t_j + d_j

    Parameters
    ----------
    frame
        A table with the columns ``t`` (h), ``duration`` (h) and ``amount`` (mg), as `hybrid.At.table` takes
        it, in any order.

    Returns
    -------
    HybridSystem
        State ``c`` (concentration in the plasma, mg/L); held: ``r``, the sum of the rates of all infusions
        that are under way (mg/h). Mode ``body``; transitions ``begin`` and ``end``. Parameters: rate of
        elimination ``k = 0.2`` 1/h; volume ``V = 20`` L.

    Notes
    -----
    Infusions superpose. From an empty body,

    .. math::

        c(t) = \sum_j \frac{a_j}{d_j V k} \left(e^{-k (t - t_j - d_j)^+} - e^{-k (t - t_j)^+}\right),
        \qquad u^+ = \max(u, 0)

    References
    ----------
    M. Gibaldi, D. Perrier, Pharmacokinetics, 2nd ed., Marcel Dekker, 1982, chapter 1.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.infusion_schedule(), {"c": 0.0}, (-1.0, 24.0))
    >>> [(jump.transition, jump.t, jump.row) for jump in arc.jumps][:3]
    [('begin', 0.0, 0), ('begin', 4.0, 2), ('end', 8.0, 0)]
    >>> round(float(arc["c"].max()), 4)
    8.7391
    """
    begins = At.table(frame)
    duration = begins.columns["duration"]
    rates = {"rate": begins.columns["amount"] / duration}
    ends = At.table({"t": np.add(begins.times, duration), **rates})
    begins = At.table({"t": begins.times, **rates})
    return HybridSystem(
        name="infusion schedule",
        state=("c",),
        held=("r",),
        parameters={"k": 0.2, "V": 20.0},
        units={"c": "mg/L", "r": "mg/h", "t": "h", "k": "1/h", "V": "L"},
        modes=[Mode("body", _body)],
        transitions=[
            Transition("body", "body", begins, Reset(partial(_changed, begins, 1.0)), name="begin"),
            Transition("body", "body", ends, Reset(partial(_changed, ends, -1.0)), name="end"),
        ],
        laws=Laws(balance={"amount in the body": (_amount, _turnover)}),
    )


def _body(t, x, p):
    return (x.r / p.V - p.k * x.c,)


def _changed(schedule, sign, t, x, p):
    return {"r": x.r + sign * schedule["rate"]}


def _amount(t, x, p):
    return p.V * x.c


def _turnover(t, x, p):
    return x.r - p.k * p.V * x.c
