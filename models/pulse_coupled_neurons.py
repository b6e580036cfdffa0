"""Neurons that fire, and raise each other when they do: Peskin's pacemaker, which falls into step."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition, arguments, repeat


def pulse_coupled_neurons(count: int = 10) -> HybridSystem:
    r"""Leaky integrate-and-fire neurons, alike, each of which raises all others by a pulse when it fires.

    .. math::

        \dot u_i = S - \gamma u_i, \qquad
        u_i \mapsto 0, \quad u_j \mapsto u_j + \varepsilon \quad \text{at } u_i = 1

    A neuron that is raised beyond the threshold fires at the same instant. One that has fired at this
    instant is not raised.

    Parameters
    ----------
    count
        Number of neurons, 2 or more.

    Returns
    -------
    HybridSystem
        Members ``neuron`` with the state ``u`` (potential, in units of the threshold); mode ``charge``;
        transition ``fire`` of each. Parameters: drive ``S = 2`` and leak ``gamma = 1`` per second, pulse
        ``eps = 0.02``. Output: ``mean``, the mean potential.

    Notes
    -----
    - A neuron alone has the period ``ln(S / (S - gamma)) / gamma``.
    - Of two, one is at ``u`` just before the other fires. At the next firing the other one is at
      ``h(u) = a - a (a - 1) / (a - u - eps)``, with ``a = S / gamma``. The fixed point of this map repels, so
      two neurons fall into step from almost all starts, and so do many.
    - Those that fire at one instant stay together. Their order within the instant changes nothing.

    References
    ----------
    C. S. Peskin, Mathematical Aspects of Heart Physiology, Courant Institute of Mathematical Sciences, 1975.
    R. E. Mirollo, S. H. Strogatz, "Synchronization of pulse-coupled biological oscillators", SIAM Journal on
    Applied Mathematics 50(6), 1645-1662, 1990. doi:10.1137/0150098

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.pulse_coupled_neurons(), {"neuron.u": np.linspace(0.0, 0.9, 10)}, (0.0, 20.0))
    >>> first, last = arc["neuron.u"][[0, -1]]
    >>> len(set(first)), len(set(last))
    (10, 1)
    """
    neurons = repeat(
        "neuron",
        arguments.count("count", count, 2),
        state=("u",),
        field=_charge,
        transitions=[
            Transition("charge", "charge", Guard(_excess, direction=+1), Reset(_fire), name="fire"),
        ],
        units={"u": "1"},
        laws=Laws(
            invariant={"distance to the threshold": _distance, "potential": _potential},
            across={"fire": {"back to rest": _rest, "one pulse": _pulse}},
        ),
    )
    return HybridSystem(
        name="pulse-coupled neurons",
        parameters={"S": 2.0, "gamma": 1.0, "eps": 0.02},
        repeats=[neurons],
        modes=[Mode("charge", _nothing_besides)],
        outputs={"mean": _mean},
        units={"t": "s", "mean": "1", "S": "1/s", "gamma": "1/s", "eps": "1"},
        laws=Laws(alike=["neuron"]),
    )


def _nothing_besides(t, x, p):
    return ()


def _charge(t, x, p, i):
    return {"u": p.S - p.gamma * x.neuron[i].u}


def _excess(t, x, p, i):
    return x.neuron[i].u - 1.0


def _fire(t, x, p, i):
    u = x.neuron.u
    return {"neuron.u": np.where(u > 0.0, u + p.eps, 0.0), "u": 0.0}


def _distance(t, x, p, i):
    return 1.0 - x.neuron[i].u


def _potential(t, x, p, i):
    return x.neuron[i].u


def _rest(t, minus, plus, p, i):
    return plus.neuron[i].u


def _pulse(t, minus, plus, p, i):
    raised = plus.neuron.u - minus.neuron.u - np.where(minus.neuron.u > 0.0, p.eps, 0.0)
    return [raised[j] for j in range(len(raised)) if j != i]


def _mean(t, x, p):
    return np.sum(x.neuron.u) / len(x.neuron)
