"""Voltage-mode buck converter: a linear filter, switched when the control voltage crosses a ramp."""

from __future__ import annotations

from hybrid import Every, Guard, HybridSystem, Laws, Mode, Reset, Transition


def buck_converter() -> HybridSystem:
    r"""Buck converter in continuous conduction, with proportional control of the voltage.

    .. math::

        C \dot v = i - v / R, \quad L \dot\imath = s E - v, \quad T \dot\tau = 1, \qquad
        s = 1 \text{ while } a (v - V_{ref}) < V_L + (V_U - V_L)\, \tau, \text{ else } 0

    A ramp begins at each tick of a clock with the period ``T``, which sets the phase ``tau`` to 0. So every
    field and guard is smooth. A run that starts at ``t`` within a ramp starts with ``tau = (t mod T) / T``.

    Returns
    -------
    HybridSystem
        State ``v`` (output voltage, V), ``i`` (inductor current, A), ``tau`` (phase of the ramp, 0 to 1);
        modes ``off`` and ``on`` of the switch; transitions ``close`` and ``open``, where the control voltage
        crosses the ramp, and, at each tick, ``reopen``, ``saturate`` (the switch stays closed: the
        control voltage is below the new ramp) and ``skip`` (the switch stays open). Parameters: input voltage
        ``E = 25`` V; inductor ``L = 20e-3`` H, capacitor ``C = 47e-6`` F, load ``R = 22`` Ohm; ramp from
        ``V_L = 3.8`` V to ``V_U = 8.2`` V in the period ``T = 400e-6`` s; reference ``V_ref = 11.3`` V and
        gain ``a = 8.4`` of the control voltage ``a (v - V_ref)``.
        Outputs: ``energy`` in coil and capacitor (J), the ``control`` voltage and the ``ramp`` (V).

    Notes
    -----
    - With the guard's speed ``g = a dv/dt - (V_U - V_L) / T``, the saltation matrix where the switch closes
      is the identity plus ``a E / (L g)`` in row ``i``, column ``v``, and a term in column ``tau``.
    - Switching preserves areas in the plane of ``v`` and ``i``, so on any orbit two exponents sum to
      ``-1 / (R C)``. The third is minus infinity: a tick sets ``tau``, whatever it was.
    - The orbit of period ``T`` loses its stability in a period doubling at ``E = 24.5166`` V. A cascade to
      chaos follows, and near 32.34 V the attractor suddenly becomes larger.

    References
    ----------
    E. Fossas, G. Olivar, "Study of chaos in the buck converter", IEEE Transactions on Circuits and Systems I
    43(1), 13-25, 1996. doi:10.1109/81.481457

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit, simulate
    >>> low = {"E": 20.0}
    >>> arc = simulate(models.buck_converter(), (12.0, 0.5, 0.0), (0.0, 0.08), mode="off", parameters=low)
    >>> orbit = periodic_orbit(models.buck_converter(), arc.x[-1], mode=str(arc.mode[-1]), parameters=low)
    >>> orbit.status.ok, orbit.signature
    (True, ('off', 'on', 'off'))
    """
    restart = Reset(_restart)
    return HybridSystem(
        name="buck converter",
        state=("v", "i", "tau"),
        parameters={
            "E": 25.0, "L": 20e-3, "C": 47e-6, "R": 22.0, "T": 400e-6,
            "V_L": 3.8, "V_U": 8.2, "V_ref": 11.3, "a": 8.4,
        },
        units={
            "v": "V", "i": "A", "t": "s", "E": "V", "L": "H", "C": "F", "R": "Ohm", "T": "s",
            "V_L": "V", "V_U": "V", "V_ref": "V", "tau": "1", "energy": "J", "control": "V", "ramp": "V",
        },
        modes=[Mode("off", _off), Mode("on", _on)],
        transitions=[
            Transition("off", "on", Guard(_excess, direction=-1), name="close"),
            Transition("on", "off", Guard(_excess, direction=+1), name="open"),
            Transition("on", "off", Every("T", when=_above_start), restart, name="reopen"),
            Transition("on", "on", Every("T", when=_below_start), restart, name="saturate"),
            Transition("off", "off", Every("T"), restart, name="skip"),
        ],
        period=_period,
        outputs={"energy": _energy, "control": _control_voltage, "ramp": _ramp},
        laws=Laws(
            invariant={
                "phase of the ramp": _phase,
                "rest of the period": _rest,
                "off": {"control voltage above the ramp": _excess},
                "on": {"control voltage below the ramp": _shortage},
            },
            balance={"off": {"energy": ("energy", _power_off)}, "on": {"energy": ("energy", _power_on)}},
            across={each: {"charge and current": _stored} for each in ("reopen", "saturate", "skip")},
        ),
    )  # fmt: skip


def _period(p):
    return p.T


def _off(t, x, p):
    return _field(x, p, 0.0)


def _on(t, x, p):
    return _field(x, p, 1.0)


def _field(x, p, s):
    return (x.i - x.v / p.R) / p.C, (s * p.E - x.v) / p.L, 1 / p.T


def _control(x, p):
    return p.a * (x.v - p.V_ref)


def _control_voltage(t, x, p):
    return _control(x, p)


def _ramp(t, x, p):
    return p.V_L + (p.V_U - p.V_L) * x.tau


def _excess(t, x, p):
    return _control(x, p) - p.V_L - (p.V_U - p.V_L) * x.tau


def _above_start(t, x, p):
    return _control(x, p) - p.V_L


def _below_start(t, x, p):
    return p.V_L - _control(x, p)


def _restart(t, x, p):
    return x.v, x.i, 0.0


def _phase(t, x, p):
    return x.tau


def _rest(t, x, p):
    return 1 - x.tau


def _shortage(t, x, p):
    return -_excess(t, x, p)


def _energy(t, x, p):
    return (p.L * x.i**2 + p.C * x.v**2) / 2


def _power_off(t, x, p):
    return -(x.v**2) / p.R


def _power_on(t, x, p):
    return p.E * x.i - x.v**2 / p.R


def _stored(t, minus, plus, p):
    return plus.v - minus.v, plus.i - minus.i
