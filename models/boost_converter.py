"""Boost converter in peak-current mode: a clock closes the switch, a current opens it."""

from __future__ import annotations

from hybrid import Every, Guard, HybridSystem, Laws, Mode, Reset, Transition


def boost_converter() -> HybridSystem:
    r"""Boost converter in continuous conduction whose switch opens at a peak of the current.

    .. math::

        L \dot\imath = E - s v, \quad C \dot v = s i - v / R, \quad \dot r = m_c, \qquad
        s = 0 \text{ from a tick until } i + r = I_{ref}, \text{ then } 1

    The clock closes the switch every ``T``, whether or not it is closed already, and restarts the ramp ``r``.
    The ramp is added to the current that is compared with ``I_ref``: the slope compensation.

    Returns
    -------
    HybridSystem
        State ``i`` (inductor current, A), ``v`` (output voltage, V), ``r`` (compensating ramp, A); modes
        ``on`` (the switch is closed, the inductor charges) and ``off``; transitions ``peak``, where the
        switch opens, ``tick``, where it closes, and ``stay`` for a tick that finds it closed. Parameters:
        input voltage ``E = 10`` V; inductor ``L = 1e-3`` H, capacitor ``C = 12e-6`` F, load ``R = 20`` Ohm;
        period ``T = 100e-6`` s; peak ``I_ref = 1.4`` A; slope of the ramp ``m_c = 0`` A/s.
        Outputs: ``energy`` in coil and capacitor (J), and ``power`` of the load (W).

    Notes
    -----
    A large capacitor holds ``v``. Then the current has the slopes ``m_1 = E / L`` and ``-m_2 = (E - v) / L``,
    and the duty of the orbit of period ``T`` is ``D = m_2 / (m_1 + m_2) = 1 - E / v``:

    - from tick to tick a deviation of the current is multiplied by ``-(m_2 - m_c) / (m_1 + m_c)``, which is
      ``-D / (1 - D)`` without a ramp;
    - so the period doubles at ``D = 1/2``. A ramp moves this to ``D = (1/2 + m_c / m_1) / (1 + m_c / m_1)``,
      and one with ``m_c = m_2 / 2`` or more prevents it;
    - with ``m_c = m_2`` the deviation is gone after one period.

    The ripple of a small capacitor shifts these values. A multiplier is 0: a tick forgets the ramp.

    References
    ----------
    J. H. B. Deane, "Chaos in a current-mode controlled boost dc-dc converter", IEEE Transactions on Circuits
    and Systems I 39(8), 680-683, 1992, doi:10.1109/81.168922. The slope compensation: C. W. Deisch, "Simple
    switching control method changes power converter into a current source", IEEE Power Electronics
    Specialists Conference, 300-306, 1978.

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit, simulate
    >>> boost = models.boost_converter()
    >>> settled = simulate(boost, (0.5, 15.0, 0.0), (0.0, 0.02), parameters={"I_ref": 0.8})
    >>> orbit = periodic_orbit(boost, settled.x[-1], mode=str(settled.mode[-1]), parameters={"I_ref": 0.8})
    >>> orbit.signature, bool(abs(orbit.multipliers).max() < 1)
    (('on', 'off', 'on'), True)
    """
    restart = Reset(_restart)
    return HybridSystem(
        name="boost converter",
        state=("i", "v", "r"),
        parameters={
            "E": 10.0, "L": 1e-3, "C": 12e-6, "R": 20.0, "T": 100e-6, "I_ref": 1.4, "m_c": 0.0,
        },
        units={
            "i": "A", "v": "V", "r": "A", "t": "s", "E": "V", "L": "H", "C": "F", "R": "Ohm", "T": "s",
            "I_ref": "A", "m_c": "A/s", "energy": "J", "power": "W",
        },
        modes=[Mode("on", _on), Mode("off", _off)],
        transitions=[
            Transition("on", "off", Guard(_excess, direction=+1), name="peak"),
            Transition("off", "on", Every("T"), restart, name="tick"),
            Transition("on", "on", Every("T"), restart, name="stay"),
        ],
        start="on",
        period=_period,
        outputs={"energy": _energy, "power": _delivered},
        laws=Laws(
            invariant={"on": {"current in reserve": _reserve}},
            balance={"energy": ("energy", _power)},
            across={each: {"charge and current": _stored} for each in ("tick", "stay")},
        ),
    )  # fmt: skip


def _period(p):
    return p.T


def _on(t, x, p):
    return p.E / p.L, -x.v / (p.R * p.C), p.m_c


def _off(t, x, p):
    return (p.E - x.v) / p.L, (x.i - x.v / p.R) / p.C, p.m_c


def _excess(t, x, p):
    return x.i + x.r - p.I_ref


def _restart(t, x, p):
    return {"r": 0.0}


def _reserve(t, x, p):
    return -_excess(t, x, p)


def _energy(t, x, p):
    return (p.L * x.i**2 + p.C * x.v**2) / 2


def _delivered(t, x, p):
    return x.v**2 / p.R


def _power(t, x, p):
    return p.E * x.i - _delivered(t, x, p)


def _stored(t, minus, plus, p):
    return plus.v - minus.v, plus.i - minus.i
