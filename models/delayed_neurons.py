"""Two leaky neurons that excite or inhibit each other, where each spike arrives a delay later."""

from __future__ import annotations

from hybrid import Delay, Guard, HybridSystem, Laws, Mode, Reset, Transition


def delayed_neurons() -> HybridSystem:
    r"""Two leaky integrate-and-fire neurons, pulse-coupled with a synaptic delay.

    .. math::

        \dot v_i = I - v_i, \qquad v_i \mapsto 0 \text{ at } v_i = 1, \qquad
        v_j \mapsto v_j + \varepsilon \text{ the time } \tau \text{ after each spike of } i \ne j

    Returns
    -------
    HybridSystem
        State ``v1, v2`` (potentials in units of the threshold); counters ``n1, n2`` (spikes); mode ``run``;
        transitions ``spike 1``, ``spike 2``, and ``arrive 1``, ``arrive 2``, which a spike of the other
        neuron sets off. Time in units of the time constant of the membrane. Parameters: drive ``I = 1.5``;
        weight ``eps = -0.2``, negative if it inhibits; delay ``tau = 0.3``.

    Notes
    -----
    A neuron that is reset at time 0 and gets its pulse at the time ``s`` spikes next at

    .. math::

        T(s) = s + \ln \frac{I e^{-s} - \varepsilon}{I - 1}, \qquad
        T'(s) = \frac{-\varepsilon}{I e^{-s} - \varepsilon}

    In phase, both spike at once with the period ``T(tau)``, if that is longer than ``tau``. A difference
    between them is multiplied by :math:`1 - 2 T'(\tau)` in each period: inhibition brings them together,
    excitation drives them apart. In antiphase the period is that for which ``T(s) = 2 (s - tau)``, and a
    difference from half a period is multiplied by :math:`(1 - T'(s))^2` in each period.

    References
    ----------
    U. Ernst, K. Pawelzik, T. Geisel, "Synchronization induced by temporal delays in pulse-coupled
    oscillators", Phys. Rev. Lett. 74 (1995) 1570-1573, doi:10.1103/PhysRevLett.74.1570.

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> orbit = periodic_orbit(models.delayed_neurons(), (0.8, 0.8), period=1.4)
    >>> bool(np.isclose(orbit.period, 0.3 + np.log((1.5 * np.exp(-0.3) + 0.2) / 0.5)))
    True
    """
    return HybridSystem(
        name="delayed neurons",
        state=("v1", "v2"),
        counters=("n1", "n2"),
        parameters={"I": 1.5, "eps": -0.2, "tau": 0.3},
        units={"v1": "1", "v2": "1", "n1": "1", "n2": "1", "t": "1", "I": "1", "eps": "1", "tau": "1"},
        modes=[Mode("run", _leak)],
        transitions=[
            Transition("run", "run", Guard(_excess_1, direction=+1), Reset(_spike_1), name="spike 1"),
            Transition("run", "run", Guard(_excess_2, direction=+1), Reset(_spike_2), name="spike 2"),
            Transition("run", "run", Delay("spike 2", "tau"), Reset(_arrive_1), name="arrive 1"),
            Transition("run", "run", Delay("spike 1", "tau"), Reset(_arrive_2), name="arrive 2"),
        ],
        laws=Laws(
            invariant={"run": {"1 below the threshold": _distance_1, "2 below the threshold": _distance_2}},
            across={"arrive 1": {"the other stays": _other_stays}},
        ),
    )


def _leak(t, x, p):
    return p.I - x.v1, p.I - x.v2


def _excess_1(t, x, p):
    return x.v1 - 1.0


def _excess_2(t, x, p):
    return x.v2 - 1.0


def _spike_1(t, x, p):
    return {"v1": 0.0, "n1": x.n1 + 1}


def _spike_2(t, x, p):
    return {"v2": 0.0, "n2": x.n2 + 1}


def _arrive_1(t, x, p):
    return {"v1": x.v1 + p.eps}


def _arrive_2(t, x, p):
    return {"v2": x.v2 + p.eps}


def _distance_1(t, x, p):
    return 1.0 - x.v1


def _distance_2(t, x, p):
    return 1.0 - x.v2


def _other_stays(t, minus, plus, p):
    return plus.v2 - minus.v2, plus.v1 - minus.v1 - p.eps
