"""Derivatives in parameters that move a jump of the field in time."""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    After,
    Every,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Table,
    Taylor,
    Transition,
    simulate,
    split,
)

END, START, DELAY, RATE = 6.0, (0.3, 0.2), 0.83, 0.5
PULSE = Table([0.0, 1.0, 2.0, 3.5], [0.0, 3.0, -1.0, 0.5], kind="step")
RAMP = Table([0.0, 1.0, 2.0, 3.5], [0.0, 3.0, -1.0, 0.5])
solvers = pytest.mark.parametrize("solver", [Taylor(), DOP853()])


def driven(force, transitions=(), **options):
    """``y' = force - y / 2`` and ``z' = y``, with a force that jumps in time."""
    return HybridSystem(
        state=("y", "z"),
        parameters={"d": DELAY},
        modes=[Mode("run", lambda t, x, p: (force(t, x, p) - RATE * x.y, x.y))],
        transitions=transitions,
        **options,
    )


def exact(jumps):
    """The derivative of the end, from the jumps of the force: how far up at which time, and its derivative.

    A force that jumps by ``a`` at ``T`` adds ``-a dT/dp`` to the derivative of ``y`` at ``T``.
    """
    y = sum(-a * slope * np.exp(-RATE * (END - at)) for a, at, slope in jumps)
    z = sum(-a * slope * (1.0 - np.exp(-RATE * (END - at))) / RATE for a, at, slope in jumps)
    return np.array([y, z])


def of_table(scale=1.0, shift=DELAY, slope=1.0):
    """The jumps of ``PULSE`` that are passed before the end."""
    places = [(3.0, 1.0), (-4.0, 2.0), (1.5, 3.5)]
    return [(a, shift + scale * knot, slope) for a, knot in places]


FORCES = {
    "a step": (lambda t, x, p: np.where(t > p.d, 2.0, 0.0), [(2.0, DELAY, 1.0)]),
    "a step down": (lambda t, x, p: np.where(t <= p.d, 2.0, 0.0), [(-2.0, DELAY, 1.0)]),
    "a sign": (lambda t, x, p: np.sign(t - 2 * p.d), [(2.0, 2 * DELAY, 2.0)]),
    "a window": (
        lambda t, x, p: np.where((t > p.d) & (t < 3 * p.d), 2.0, 0.0),
        [(2.0, DELAY, 1.0), (-2.0, 3 * DELAY, 3.0)],
    ),
    "a heaviside": (lambda t, x, p: np.heaviside(p.d - t, 0.5), [(-1.0, DELAY, 1.0)]),
    "a staircase": (
        lambda t, x, p: np.floor(t / p.d),
        [(1.0, k * DELAY, float(k)) for k in range(1, 8)],
    ),
    "a falling staircase": (
        lambda t, x, p: np.ceil(-t / p.d - 0.5),
        [(-1.0, (k + 0.5) * DELAY, k + 0.5) for k in range(7)],
    ),
    "a rounding": (
        lambda t, x, p: np.round(t - p.d),
        [(1.0, DELAY + k + 0.5, 1.0) for k in range(-1, 5)],
    ),
    "a table": (lambda t, x, p: PULSE(t - p.d), of_table()),
    "a table backwards": (
        lambda t, x, p: PULSE(5.0 * p.d - t),
        [(-a, 5.0 * DELAY - knot, 5.0) for a, knot in [(3.0, 1.0), (-4.0, 2.0), (1.5, 3.5)]],
    ),
    "points with values outside": (
        lambda t, x, p: np.interp(t - p.d, [0.0, 2.0], [1.0, 1.0], left=-1.0, right=0.5),
        [(2.0, DELAY, 1.0), (-0.5, DELAY + 2.0, 1.0)],
    ),
    "pulses of a width": (
        lambda t, x, p: np.where(t % 1.0 < p.d, 2.0, -1.0),
        [(-3.0, k + DELAY, 1.0) for k in range(6)],
    ),
}


@solvers
@pytest.mark.parametrize("name", FORCES)
def test_a_jump_in_time_adds_its_height_times_the_derivative_of_its_time(name, solver):
    force, jumps = FORCES[name]
    arc = simulate(driven(force), START, (0.0, END), sensitivities=("d",), solver=solver)
    assert arc.status.ok, arc.status
    assert len(arc.jumps) == 0
    np.testing.assert_allclose(arc.sensitivity[:, 0], exact(jumps), rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("name", ["a step", "a window", "a staircase", "a table", "pulses of a width"])
def test_the_split_system_has_the_same_derivatives(name):
    force, jumps = FORCES[name]
    arc = simulate(split(driven(force)), START, (0.0, END), sensitivities=("d",))
    assert arc.status.ok
    np.testing.assert_allclose(arc.sensitivity[:, 0], exact(jumps), rtol=1e-7, atol=1e-8)


REPEATING = {
    "a ramp": lambda t, x, p: RAMP((p.d * t) % 3.5),
    "a pulse": lambda t, x, p: PULSE((p.d * t) % 3.5),
    "a delayed pulse": lambda t, x, p: PULSE((t - p.d) % 3.5),
    "a falling ramp": lambda t, x, p: RAMP((-p.d * t) % 3.5),
}


@solvers
@pytest.mark.parametrize("name", REPEATING)
@pytest.mark.parametrize("splits", [False, True])
def test_a_repeating_table_has_the_derivative_of_central_differences(name, splits, solver):
    system, h = driven(REPEATING[name]), 1e-5
    system = split(system) if splits else system
    fine = Taylor(rtol=1e-13, atol=1e-13)
    up, down = (
        simulate(system, START, (0.0, END), parameters={"d": DELAY + way * h}, solver=fine).x[-1]
        for way in (1, -1)
    )
    arc = simulate(system, START, (0.0, END), sensitivities=("d",), solver=solver)
    assert arc.status.ok
    np.testing.assert_allclose(arc.sensitivity[:, 0], (up - down) / (2 * h), rtol=1e-5, atol=1e-5)


def test_times_of_jumps_follow_a_jump_of_the_force_before_them():
    """``z = 0.9`` is reached at ``T``; both the jump of the force and that of the state move with ``d``."""
    hit = Transition("run", "run", Guard(lambda t, x, p: x.z - 0.9, 1), Reset(lambda t, x, p: {"z": 0.0}))
    system, h = driven(lambda t, x, p: np.where(t > p.d, 2.0, 0.0), [hit]), 1e-5
    fine = Taylor(rtol=1e-13, atol=1e-13)
    up, down = (
        simulate(system, START, (0.0, END), parameters={"d": DELAY + way * h}, solver=fine) for way in (1, -1)
    )
    arc = simulate(system, START, (0.0, END), sensitivities=("d",))
    assert arc.status.ok
    assert len(arc.jumps) == len(up.jumps) > 1
    times = (up.jumps.t - down.jumps.t) / (2 * h)
    np.testing.assert_allclose(arc.jumps.t_sensitivity[:, 0], times, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(arc.sensitivity[:, 0], (up.x[-1] - down.x[-1]) / (2 * h), rtol=1e-5, atol=1e-5)


def test_a_count_leaves_clocks_held_components_and_other_modes_as_they_are():
    """A clock that counts from an entry does not begin anew where the force jumps."""
    system = HybridSystem(
        state=("y",),
        held=("u",),
        counters=("k",),
        parameters={"d": 0.31, "w": 0.9},
        modes=[
            Mode("on", lambda t, x, p: (np.where(t % 0.5 < p.d, 2.0 + x.u, -1.0) - RATE * x.y,)),
            Mode("off", lambda t, x, p: (np.where(t > 4 * p.d, 1.0, 0.0) - x.y,)),
        ],
        transitions=[
            Transition("on", "off", After("w"), name="stop"),
            Transition("off", "on", After(0.7), Reset(lambda t, x, p: {"u": x.y}), name="go"),
            Transition("on", "on", Every(0.4), Reset(lambda t, x, p: {"k": x.k + 1}), name="count"),
        ],
        start="on",
    )
    h, fine = 1e-5, Taylor(rtol=1e-13, atol=1e-13)
    up, down = (
        simulate(system, (0.3,), (0.0, 4.2), parameters={"d": 0.31 + way * h}, solver=fine) for way in (1, -1)
    )
    arc = simulate(system, (0.3,), (0.0, 4.2), sensitivities=("d",))
    assert arc.status.ok
    assert [jump.transition for jump in arc.jumps] == [jump.transition for jump in up.jumps]
    wanted = (up.x[-1] - down.x[-1])[:2] / (2 * h)
    np.testing.assert_allclose(arc.sensitivity[:, 0], wanted, rtol=1e-5, atol=1e-5)


def test_a_declared_period_is_no_period_of_a_count():
    period = 2.0

    def force(t, x, p):
        return np.where((t - p.d) % period < 0.7, 2.0, 0.0)

    plain, periodic = driven(force), driven(force, period=period)
    found = [
        simulate(each, START, (0.0, 9.3), sensitivities=("d",)).sensitivity for each in (plain, periodic)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9)


def test_a_jump_in_the_state_of_an_unsplit_field_is_told_as_it_is_without_a_count_of_jumps():
    """The status is that of the run with derivatives, which makes as many jumps as the run itself."""

    def force(t, x, p):
        return np.where(x.z > p.d, -1.0, 1.0) + np.where(t > p.d, 0.5, 0.0)

    arc = simulate(driven(force), START, (0.0, END), sensitivities=("d",))
    assert arc.status.code.name == "DISCONTINUOUS_FIELD"
    assert "z = d" in arc.status.message
    assert "split" in arc.status.remedy
    whole = simulate(split(driven(force)), START, (0.0, END), sensitivities=("d",))
    assert whole.status.ok
