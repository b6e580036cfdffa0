"""A buck converter whose phases take turns, so that the ripples of their currents cancel."""

from __future__ import annotations

import numpy as np

from hybrid import Every, Guard, HybridSystem, Laws, Mode, Reset, Transition, arguments, repeat


def interleaved_converter(phases: int = 4) -> HybridSystem:
    r"""Interleaved buck converter: coils in parallel, each with a switch, a ramp and a comparator of its own.

    .. math::

        L_i \dot i_i = s_i E - r_i i_i - v, \qquad C \dot v = \sum_i i_i - v / R, \qquad \dot w_i = s_i / T

    The switch of phase ``i`` closes, ``s_i = 1``, at the times ``(shift_i + n) T`` for every whole ``n``, and
    its ramp ``w_i`` begins. Where the ramp meets the control ``d - k (v - V)``, the switch opens and the ramp
    returns to 0. Each switch is a held value, so the converter has one mode, not two to the number of phases.

    Parameters
    ----------
    phases
        Their number, 1 or more.

    Returns
    -------
    HybridSystem
        State ``v`` (output voltage); members ``phase`` with the states ``i`` (current of the coil) and ``w``
        (ramp), and the held ``on`` (1 for a closed switch); mode ``run``; transitions ``turn on`` and
        ``turn off`` of each phase. Parameters: input ``E = 12`` V, capacity ``C = 1e-3`` F, load ``R = 0.5``
        ohm, period ``T = 1e-4`` s, duty ``d = 0.25``, gain ``k = 0`` per V about the voltage ``V = 3`` V;
        of each phase the coil ``L = 1e-4`` H, its resistance ``r = 0.02`` ohm, and ``shift``, the number of
        the phase divided by that of all. Output: ``current``, the sum of the currents.

    Notes
    -----
    Without feedback, ``k = 0``, and with equal phases:

    - The sum of the currents obeys the equations of one coil ``L / N`` with resistance ``r / N``, whose
      input is ``E`` times the share of closed switches. At a duty ``m / N`` that share is constant: the
      ripple of the sum, and of the voltage, is zero.
    - With ``r = 0`` and constant ``v`` the ripple of the sum is
      ``E T (N d - m) (m + 1 - N d) / (N L)``, ``m`` the whole part of ``N d``; that of each phase is
      ``E T d (1 - d) / L``.

    On any periodic orbit the mean current of phase ``i`` is the mean of ``s_i E - v``, divided by ``r_i``:
    without feedback, phases share the load as their conductances, ``1 / r_i``.

    References
    ----------
    B. A. Miwa, D. M. Otten, M. F. Schlecht, "High efficiency power factor correction using interleaving
    techniques", Applied Power Electronics Conference, 557-568, 1992. doi:10.1109/APEC.1992.228361

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit, simulate
    >>> system = models.interleaved_converter(4)
    >>> settled = simulate(system, {"v": 3.0, "phase.i": 1.5, "phase.w": 0.0}, (0.0, 0.01)).x[-1]
    >>> orbit = periodic_orbit(system, settled)
    >>> bool(abs(orbit.arc()["v"] - orbit.x0[0]).max() < 1e-9)
    True
    """
    number = arguments.count("phases", phases, 1)
    each = repeat(
        "phase",
        number,
        state=("i", "w"),
        held=("on",),
        parameters={"L": 1e-4, "r": 0.02, "shift": [i / number for i in range(number)]},
        field=_phase,
        transitions=[
            Transition("run", "run", Every("T", offset=_begin), Reset(_turn_on), name="turn on"),
            Transition("run", "run", Guard(_margin, direction=-1), Reset(_turn_off), name="turn off"),
        ],
        units={"i": "A", "w": "1", "on": "1", "L": "H", "r": "ohm", "shift": "1"},
        laws=Laws(
            invariant={"ramp": _ramp, "closed": _closed},
            across={"turn on": {"ramp": _begun}, "turn off": {"open": _opened, "control": _at_control}},
        ),
    )
    return HybridSystem(
        name="interleaved converter",
        state=("v",),
        parameters={"E": 12.0, "C": 1e-3, "R": 0.5, "T": 1e-4, "d": 0.25, "k": 0.0, "V": 3.0},
        units={
            "v": "V", "t": "s", "E": "V", "C": "F", "R": "ohm", "T": "s", "d": "1", "k": "1/V", "V": "V",
            "current": "A",
        },
        repeats=[each],
        modes=[Mode("run", _run)],
        period=_period,
        outputs={"current": _current},
        laws=Laws(balance={"energy": (_energy, _power)}, alike=["phase"]),
    )  # fmt: skip


def _run(t, x, p):
    return ((_current(t, x, p) - x.v / p.R) / p.C,)


def _phase(t, x, p, i):
    own, given = x.phase[i], p.phase[i]
    return {"i": (own.on * p.E - given.r * own.i - x.v) / given.L, "w": own.on / p.T}


def _begin(p, i):
    return p.phase[i].shift * p.T


def _control(x, p):
    return p.d - p.k * (x.v - p.V)


def _turn_on(t, x, p, i):
    # A control below zero leaves the switch open for the whole period.
    return {"w": 0.0, "on": np.where(_control(x, p) > 0.0, 1.0, 0.0)}


def _margin(t, x, p, i):
    return _control(x, p) - x.phase[i].w


def _turn_off(t, x, p, i):
    return {"on": 0.0, "w": 0.0}


def _period(p):
    return p.T


def _current(t, x, p):
    return np.sum(x.phase.i)


def _ramp(t, x, p, i):
    return x.phase[i].w


def _closed(t, x, p, i):
    return x.phase[i].on * (1.0 - x.phase[i].on)


def _begun(t, minus, plus, p, i):
    return plus.phase[i].w


def _opened(t, minus, plus, p, i):
    return [plus.phase[i].on, plus.phase[i].w]


def _at_control(t, minus, plus, p, i):
    return _margin(t, minus, p, i)


def _energy(t, x, p):
    return (p.C * x.v**2 + np.sum(p.phase.L * x.phase.i**2)) / 2


def _power(t, x, p):
    return np.sum(x.phase.i * (p.E * x.phase.on - p.phase.r * x.phase.i)) - x.v**2 / p.R
