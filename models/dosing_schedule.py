"""A drug that is swallowed at listed times: absorption and elimination at first order."""

from __future__ import annotations

from collections.abc import Iterable

from hybrid import At, HybridSystem, Laws, Mode, Reset, Transition


def dosing_schedule(times: Iterable[float] = (8.0, 20.0, 32.0, 44.0, 56.0, 68.0)) -> HybridSystem:
    r"""One compartment with first-order absorption, and doses at listed times.

    .. math::

        \dot A = -k_a A, \quad V \dot c = k_a A - k_e V c, \qquad
        A \mapsto A + \text{dose} \text{ at each of the times}

    Parameters
    ----------
    times
        Times of the doses in hours. A run that starts at one of them has had this dose.

    Returns
    -------
    HybridSystem
        State ``A`` (amount in the gut, mg), ``c`` (concentration in the plasma, mg/L); mode ``body``;
        transition ``dose``. Parameters: ``dose = 100`` mg; rates of absorption ``k_a = 1`` 1/h and of
        elimination ``k_e = 0.1`` 1/h; volume ``V = 30`` L.
        Output: ``amount`` in the body (mg).

    Notes
    -----
    Doses superpose: each adds the curve of a single dose, a Bateman function. From an empty body,

    .. math::

        c(t) = \frac{\text{dose}}{V} \frac{k_a}{k_a - k_e} \sum_{t_j < t}
            \left(e^{-k_e (t - t_j)} - e^{-k_a (t - t_j)}\right)

    References
    ----------
    M. Gibaldi, D. Perrier, Pharmacokinetics, 2nd ed., Marcel Dekker, 1982, chapters 1 and 3. The curve:
    H. Bateman, "The solution of a system of differential equations occurring in the theory of radioactive
    transformations", Proceedings of the Cambridge Philosophical Society 15, 423-427, 1910.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.dosing_schedule([8.0, 20.0]), (0.0, 0.0), (0.0, 24.0))
    >>> arc.jumps.t.tolist(), round(float(arc["c"][-1]), 4)
    ([8.0, 20.0], 3.1626)
    """
    return HybridSystem(
        name="dosing schedule",
        state=("A", "c"),
        parameters={"dose": 100.0, "k_a": 1.0, "k_e": 0.1, "V": 30.0},
        units={
            "A": "mg", "c": "mg/L", "t": "h", "dose": "mg", "k_a": "1/h", "k_e": "1/h", "V": "L",
            "amount": "mg",
        },
        modes=[Mode("body", _body)],
        transitions=[Transition("body", "body", At(times), Reset(_swallow), name="dose")],
        outputs={"amount": _amount},
        laws=Laws(
            balance={"amount in the body": ("amount", _elimination)},
            across={"dose": {"amount swallowed": _swallowed}},
        ),
    )  # fmt: skip


def _body(t, x, p):
    return -p.k_a * x.A, p.k_a * x.A / p.V - p.k_e * x.c


def _swallow(t, x, p):
    return {"A": x.A + p.dose}


def _amount(t, x, p):
    return x.A + p.V * x.c


def _elimination(t, x, p):
    return -p.k_e * p.V * x.c


def _swallowed(t, minus, plus, p):
    return plus.A - minus.A - p.dose, plus.c - minus.c
