"""A leaky integrate-and-fire neuron that rests after each spike: the smallest system with a dwell time."""

from __future__ import annotations

from hybrid import After, Guard, HybridSystem, Laws, Mode, Reset, Transition


def refractory_neuron() -> HybridSystem:
    r"""Leaky integrate-and-fire neuron with an absolute refractory time.

    .. math::

        \tau\, \dot u = u_{rest} - u + R I, \qquad
        u \mapsto u_r \text{ at } u = \theta, \text{ where it is held for the time } t_{ref}

    Returns
    -------
    HybridSystem
        State ``u`` (potential of the membrane, mV); counter ``n`` (spikes); modes ``integrate`` and
        ``refractory``; transitions ``spike``, and ``recover`` after the refractory time. Parameters: time
        constant ``tau = 10`` ms; ``u_rest = -65`` mV; resistance ``R = 10`` Mohm; current ``I = 2`` nA;
        threshold ``theta = -50`` mV; reset ``u_r = -65`` mV; refractory time ``t_ref = 4`` ms.

    Notes
    -----
    With a constant current above the rheobase, ``R I > theta - u_rest``, the spikes are apart by

    .. math::

        t_{ref} + \tau \ln \frac{u_{rest} + R I - u_r}{u_{rest} + R I - \theta}

    and however large the current, there are no more than ``1 / t_ref`` per unit of time. Below the
    rheobase there are none.

    References
    ----------
    W. Gerstner, W. M. Kistler, R. Naud, L. Paninski, Neuronal Dynamics, Cambridge University Press, 2014,
    section 1.3, doi:10.1017/CBO9781107447615.

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.refractory_neuron(), {"u": -65.0}, (0.0, 100.0))
    >>> spikes = arc.jumps["spike"]
    >>> bool(np.allclose(np.diff([jump.t for jump in spikes]), 4.0 + 10.0 * np.log(20.0 / 5.0)))
    True
    >>> int(arc["n"][-1]) == len(spikes)
    True
    """
    return HybridSystem(
        name="refractory neuron",
        state=("u",),
        counters=("n",),
        parameters={
            "tau": 10.0, "u_rest": -65.0, "R": 10.0, "I": 2.0, "theta": -50.0, "u_r": -65.0, "t_ref": 4.0,
        },
        units={
            "u": "mV", "n": "1", "t": "ms", "tau": "ms", "u_rest": "mV", "R": "Mohm", "I": "nA",
            "theta": "mV", "u_r": "mV", "t_ref": "ms",
        },
        modes=[Mode("integrate", _integrate), Mode("refractory", _hold)],
        transitions=[
            Transition("integrate", "refractory", Guard(_excess, direction=+1), Reset(_spike), name="spike"),
            Transition("refractory", "integrate", After("t_ref"), name="recover"),
        ],
        start="integrate",
        laws=Laws(
            invariant={"integrate": {"distance to the threshold": _distance}},
            across={"spike": {"one spike": _one_spike}},
        ),
    )  # fmt: skip


def _integrate(t, x, p):
    return ((p.u_rest - x.u + p.R * p.I) / p.tau,)


def _hold(t, x, p):
    return (0.0,)


def _excess(t, x, p):
    return x.u - p.theta


def _spike(t, x, p):
    return {"u": p.u_r, "n": x.n + 1}


def _distance(t, x, p):
    return -_excess(t, x, p)


def _one_spike(t, minus, plus, p):
    return plus.n - minus.n - 1, plus.u - p.u_r
