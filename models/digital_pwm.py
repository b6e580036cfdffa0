"""A coil under a digital current controller: the duty of the switch is sampled once a period."""

from __future__ import annotations

import numpy as np

from hybrid import After, Every, HybridSystem, Laws, Mode, Reset, Transition


def digital_pwm() -> HybridSystem:
    r"""A switched coil whose duty is computed from the current at the start of each period, and held.

    .. math::

        L \dot i = V - R i \text{ (on)}, \quad L \dot i = -R i \text{ (off)}, \qquad
        d_k = \operatorname{clip}(d_0 + k (i_\mathrm{ref} - i(k T)), 0, 1)

    The switch is on for ``d_k T`` from each sample on.

    Returns
    -------
    HybridSystem
        State ``i`` (A); held: the duty ``d``. Modes ``on`` and ``off``; transitions ``sample`` and
        ``switch off``. Parameters: source ``V = 24`` V, resistance ``R = 2`` Ohm, inductance ``L = 1`` mH,
        period ``T = 0.5`` ms; set point ``ref = 5`` A, gain ``k = 0.1`` 1/A, duty ``d_0 = 0.45`` at the set
        point.

    Notes
    -----
    From sample to sample, with ``I = V / R`` and ``a = R T / L``,

    .. math::

        i_{k+1} = \left(I + (i_k - I)\, e^{-a d_k}\right) e^{-a (1 - d_k)}

    The fixed point loses its stability in a flip where the slope
    :math:`e^{-a} - k a I e^{-a (1 - d)}` of the map is -1. A duty of 0 switches off at once.

    References
    ----------
    S. Banerjee, G. C. Verghese (eds.), Nonlinear phenomena in power electronics, IEEE Press, 2001, chapter 3.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.digital_pwm(), {"i": 0.0}, (0.0, 0.01))
    >>> round(float(arc["i"][-1]), 3), round(float(arc["d"][-1]), 4)
    (4.514, 0.4986)
    """
    return HybridSystem(
        name="digital PWM",
        state=("i",),
        held=("d",),
        parameters={"V": 24.0, "R": 2.0, "L": 1e-3, "T": 5e-4, "ref": 5.0, "k": 0.1, "d_0": 0.45},
        units={
            "i": "A", "d": "", "t": "s", "V": "V", "R": "ohm", "L": "H", "T": "s", "ref": "A", "k": "1/A",
            "d_0": "",
        },
        modes=[Mode("on", _on), Mode("off", _off)],
        transitions=[
            Transition("off", "on", Every("T"), Reset(_sampled), name="sample"),
            Transition("on", "off", After(_on_time), name="switch off"),
        ],
        start="off",
        period=_period,
        laws=Laws(invariant={"room of the duty": _room}, across={"switch off": {"continuity": _switched}}),
    )  # fmt: skip


def _on(t, x, p):
    return ((p.V - p.R * x.i) / p.L,)


def _off(t, x, p):
    return (-p.R * x.i / p.L,)


def _sampled(t, x, p):
    return {"d": np.clip(p.d_0 + p.k * (p.ref - x.i), 0.0, 1.0)}


def _on_time(p):
    return p.d * p.T


def _room(t, x, p):
    return x.d * (1.0 - x.d)


def _switched(t, minus, plus, p):
    return plus.i - minus.i, plus.d - minus.d


def _period(p):
    return p.T
