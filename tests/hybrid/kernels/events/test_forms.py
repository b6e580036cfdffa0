"""The same moving guard in many forms fires at the same times: affine, traced, jumping and not traced."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    simulate,
)

END = 8.0
SOLVERS = {
    "Taylor": Taylor(),
    "DOP853": DOP853(rtol=1e-11, atol=1e-13),
    "Tsit5": Tsit5(rtol=1e-9, atol=1e-11),
    "RadauIIA": RadauIIA(rtol=1e-9, atol=1e-11),
}


def height(t, x, p):
    """Zero where ``q = c + s t``; the factor ``k`` changes no crossing."""
    return p.k * (x.q - p.c - p.s * t)


def hidden(t, x, p):
    """The same, not to be traced."""
    if x.q > 100.0:
        return 1.0
    return p.k * (x.q - p.c - p.s * t)


def slope(t, x, p):
    return p.k, 0.0 * t, 0.0 * t, -p.k * p.s


FORMS = {
    "affine": height,
    "product": lambda t, x, p: height(t, x, p) * (2.0 + x.v * x.v),
    "sine": lambda t, x, p: p.k * np.sin((x.q - p.c - p.s * t) / 4.0),
    "larger": lambda t, x, p: np.maximum(height(t, x, p), 3.0 * height(t, x, p)),
    "cubic": lambda t, x, p: height(t, x, p) * (1.0 + height(t, x, p) ** 2),
    "jump": lambda t, x, p: np.sign(height(t, x, p)) * (1.0 + x.q * x.q),
    "hidden": hidden,
}


@cache
def oscillator(form, direction, kind):
    """``q = a cos t + b sin t``; with ``kind`` "bent" the mode is not affine: ``w`` follows ``q``."""
    bend = (lambda x: -0.1 * x.w * x.q) if kind == "bent" else (lambda x: 0.0 * x.q)
    gradient = slope if form == "hidden" else None
    return HybridSystem(
        state=("q", "v", "w"),
        parameters={"k": 1.0, "c": 0.0, "s": 0.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q, bend(x)))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(FORMS[form], direction, gradient=gradient),
                Reset(lambda t, x, p: (x.q, x.v, x.w)),
            )
        ],
    )


def crossings(a, b, c, s, direction):
    """Times after the start at which ``a cos t + b sin t - c - s t`` changes its sign."""

    def g(t):
        return a * np.cos(t) + b * np.sin(t) - c - s * t

    # A guard that is zero at the start is on the side that it leaves to.
    times = np.linspace(1e-3, END, 4001)
    changes = np.flatnonzero(g(times)[1:] * g(times)[:-1] < 0.0)
    return [
        brentq(g, times[i], times[i + 1], xtol=1e-15)
        for i in changes
        if direction in (0, np.sign(g(times[i + 1])))
    ]


# Start (q, v), place and speed of the guard: off the guard, on it with and without speed, with none at all.
CASES = {
    "off": (0.7, -0.4, 0.2, 0.05),
    "fast": (0.1, 1.5, -1.2, 0.31),
    "on": (0.5, 0.9, 0.5, -0.1),
    "on, falling": (0.5, -0.9, 0.5, 0.1),
    "at rest on it": (0.5, 0.125, 0.5, 0.125),
    "at rest below": (-0.5, 0.125, -0.5, 0.125),
    "third order": (0.0, 0.25, 0.0, 0.25),
    "third order, falling": (0.0, -0.25, 0.0, -0.25),
}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["affine", "bent"])
def test_all_forms_of_a_guard_fire_at_its_zeros(form, kind, solver):
    for direction in (-1, 0, 1):
        for name, (q, v, c, s) in CASES.items():
            for k in (1.0, 2.0**-40 if form == "cubic" else 2.0**40):
                arc = simulate(
                    oscillator(form, direction, kind),
                    (q, v, 1.0),
                    (0.0, END),
                    mode="swing",
                    parameters={"k": k, "c": c, "s": s},
                    solver=SOLVERS[solver],
                    max_jumps=20,
                )
                expected = crossings(q, v, c, s, direction)
                times = arc.jumps.t
                # A start on the guard that moves in its direction fires at once.
                if name.startswith(("on", "at rest", "third")) and len(times) and times[0] < 1e-9:
                    side = np.sign(q * np.cos(1e-2) + v * np.sin(1e-2) - c - s * 1e-2)
                    assert direction == side, (direction, name, k)
                    times = times[1:]
                tolerance = 1e-11 if solver == "Taylor" and kind == "affine" else 1e-6
                np.testing.assert_allclose(
                    times, expected, rtol=0, atol=tolerance, err_msg=f"{direction} {name} {k}"
                )
                assert arc.status.code == StatusCode.SUCCESS
                if not name.startswith("third"):
                    assert ("proved" in arc.status.message) == (form == "hidden")


DIPS = {
    "affine": lambda t, x, p: x.q,
    "moving": lambda t, x, p: x.q + p.s * t,
    "product": lambda t, x, p: x.q * (2.0 + x.v * x.v),
    "angle": lambda t, x, p: np.arctan(x.q),
    "larger": lambda t, x, p: np.maximum(x.q, 3.0 * x.q),
}


@cache
def dip(form, direction):
    """``q = d + a (t - 1)^2``, seen in a moving frame where the guard moves."""
    speed = (lambda p: p.s) if form == "moving" else (lambda p: 0.0)
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": 1.0, "s": 0.5},
        modes=[Mode("m", lambda t, x, p: (x.v - speed(p), 2.0 * p.a + 0.0 * x.q))],
        transitions=[Transition("m", "m", Guard(DIPS[form], direction))],
    )


@pytest.mark.parametrize("solver", ["Taylor", "DOP853"])
@pytest.mark.parametrize("form", DIPS)
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_a_dip_is_two_crossings_or_none(form, direction, solver):
    for a in (1.0, 2.0**10):
        for exponent in (*range(-48, -2, 3), -60):
            for sign in (-1.0, 1.0):
                depth = a * sign * 2.0**exponent
                arc = simulate(
                    dip(form, direction),
                    (a + depth, -2.0 * a),
                    (0.0, 3.0),
                    parameters={"a": a},
                    solver=SOLVERS[solver],
                )
                assert arc.status.code == StatusCode.SUCCESS
                half = 2.0 ** (exponent / 2)
                expected = [1.0 - half, 1.0 + half] if sign < 0.0 else []
                if direction:
                    expected = expected[:1] if direction < 0 else expected[1:]
                if exponent > -40:
                    assert len(arc.jumps) == len(expected), (a, depth)
                    np.testing.assert_allclose(arc.jumps.t, expected, rtol=0, atol=1e-14 / half + 1e-10)
                elif a == 1.0:
                    # Rounding may hide the dip.
                    assert len(arc.jumps) <= (2 if direction == 0 else 1)
                assert arc.x[-1, 0] + (1.5 if form == "moving" else 0.0) == pytest.approx(depth + 4.0 * a)


CLOCKS = {
    "affine": lambda t, x, p: t - p.at,
    "angle": lambda t, x, p: np.arctan(3.0 * (t - p.at)),
    "product": lambda t, x, p: (t - p.at) * (2.0 + x.v * x.v),
    "jump": lambda t, x, p: np.sign(t - p.at),
}


def alarm(t, x, p):
    """Not to be traced."""
    if x.z > 100.0:
        return 1.0
    return t - p.at


@cache
def contact(form):
    """A point that is pushed against a Hertz contact, whose steps have a clock of their own."""
    opaque = {"gradient": lambda t, x, p: (0.0 * t, 0.0 * t, 0.0 * t, 1.0)} if form == "hidden" else {}
    return HybridSystem(
        state=("z", "v", "n"),
        parameters={"at": 1.0},
        modes=[
            Mode("free", lambda t, x, p: (x.v, 1.0, 0.0)),
            Mode("contact", lambda t, x, p: (x.v, 1.0 - np.maximum(x.z, 0.0) ** 1.5, 0.0)),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.z, +1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.z, -1)),
            Transition(
                "contact", "contact", Guard(alarm if form == "hidden" else CLOCKS[form], +1, **opaque),
                Reset(lambda t, x, p: (x.z, x.v, x.n + 1.0)), name="alarm",
            ),
        ],
    )  # fmt: skip


@pytest.mark.parametrize("form", [*CLOCKS, "hidden"])
def test_guards_in_time_on_steps_with_a_clock_of_their_own(form):
    plain = simulate(contact("affine"), (0.0, 0.5, 0.0), (0.0, 12.0), mode="contact", parameters={"at": 50.0})
    # Back in the contact, the guard would be beyond.
    leaves = plain.jumps.t[0]
    end = leaves + 0.2
    for at in np.linspace(0.01, 0.99, 9) * leaves:
        arc = simulate(contact(form), (0.0, 0.5, 0.0), (0.0, end), mode="contact", parameters={"at": at})
        assert arc.propagators["contact"] == "Taylor series, desingularised"
        assert [each.t for each in arc.jumps["alarm"]] == [pytest.approx(at, rel=1e-12)]
        np.testing.assert_allclose(arc.x[-1, :2], plain(end)[:2], rtol=0, atol=1e-8)
        assert arc.x[-1, 2] == 1.0
