"""What a jump does to tangent vectors: any number of them, at a start, in a chain, and where a mass rests."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate
from lyapunov import lyapunov_spectrum

SOLVERS = pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(rtol=1e-12, atol=1e-14)], ids=["Taylor", "DOP853"]
)
# Flows of two modes in (y, z), and what the resets multiply them by.
BEFORE, AFTER = np.array([[0.2, 1.0], [-1.0, 0.1]]), np.array([[-0.3, 0.5], [0.4, -0.2]])
KICK, SHIFT = np.array([[0.5, -1.0], [2.0, 0.3]]), np.array([[-0.4, 0.7], [0.1, 1.5]])


def linear(matrix, x):
    return matrix[0, 0] * x.y + matrix[0, 1] * x.z, matrix[1, 0] * x.y + matrix[1, 1] * x.z


@cache
def clocked(triggers):
    """A reset at ``t = 1``; with ``triggers`` it lands beyond the guard of a second one."""
    return HybridSystem(
        state=("y", "z", "w"),
        modes=[
            Mode("before", lambda t, x, p: (*linear(BEFORE, x), 0.0)),
            Mode("between", lambda t, x, p: (*linear(-AFTER, x), 0.0)),
            Mode("after", lambda t, x, p: (*linear(AFTER, x), 0.0)),
        ],
        transitions=[
            Transition(
                "before", "between", Guard(lambda t, x, p: t - 1.0, +1),
                Reset(lambda t, x, p: (*linear(KICK, x), 1.0 if triggers else x.w)), name="kick",
            ),
            Transition(
                "between", "after", Guard(lambda t, x, p: x.w - 0.5, +1),
                Reset(lambda t, x, p: (*linear(SHIFT, x), 0.0)), name="shift",
            ),
        ],
    )  # fmt: skip


def exact_map(triggers, start, end):
    total = expm(BEFORE * (1.0 - start))
    total = KICK @ total
    return expm((AFTER if triggers else -AFTER) * (end - 1.0)) @ (SHIFT @ total if triggers else total)


@SOLVERS
@pytest.mark.parametrize("triggers", [False, True])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_any_number_of_vectors_goes_through_jumps(solver, triggers, count):
    vectors = np.array([[1.0, 0.5, -2.0], [0.3, -1.0, 0.7], [0.0, 0.0, 0.0]])[:, :count]
    arc = simulate(
        clocked(triggers), (1.0, 0.2, 0.0), (0.0, 2.5), mode="before", solver=solver, tangent=vectors
    )
    assert len(arc.jumps) == 1 + triggers
    expected = exact_map(triggers, 0.0, 2.5) @ vectors[:2]
    np.testing.assert_allclose(arc.fundamental[:2], expected, rtol=0, atol=1e-10)
    np.testing.assert_allclose(arc.x[-1, :2], exact_map(triggers, 0.0, 2.5) @ (1.0, 0.2), rtol=0, atol=1e-10)


@SOLVERS
@pytest.mark.parametrize("at_start", [False, True])
def test_a_start_beyond_a_guard_is_an_instant_of_its_own(solver, at_start):
    """The jump happens at the start of all neighbouring runs too: its matrix is that of the reset alone."""
    system = HybridSystem(
        state=("y", "z"),
        modes=[
            Mode("before", lambda t, x, p: linear(BEFORE, x)),
            Mode("after", lambda t, x, p: linear(AFTER, x)),
        ],
        transitions=[
            Transition(
                "before", "before", Guard(lambda t, x, p: x.y - 3.0, +1, at_start=at_start),
                Reset(lambda t, x, p: linear(KICK, x)),
            ),
            Transition(
                "before", "after", Guard(lambda t, x, p: x.z - 5.0, +1),
                Reset(lambda t, x, p: linear(SHIFT, x)),
            ),
        ],
    )  # fmt: skip
    start = (4.0, 1.0) if at_start else (3.0, 1.0)
    arc = simulate(system, start, (0.0, 0.7), mode="before", solver=solver, tangent=True)
    assert [jump.t for jump in arc.jumps] == [0.0, 0.0]
    if at_start:
        expected = expm(0.7 * AFTER) @ SHIFT @ KICK
        np.testing.assert_allclose(arc.fundamental, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(arc.jumps.saltation, [KICK, SHIFT], rtol=0, atol=1e-14)
    without = simulate(system, start, (0.0, 0.7), mode="before", solver=solver)
    np.testing.assert_allclose(without.jumps.saltation, arc.jumps.saltation, rtol=0, atol=1e-14)


@SOLVERS
def test_growth_through_jumps_that_trigger_others_is_exact(solver):
    """Triangular resets, once per unit of time: exponents ``ln 6``, 0 and ``ln 0.1``."""
    system = HybridSystem(
        state=("a", "b", "y", "w"),
        modes=[Mode("m", lambda t, x, p: (0.0, 0.0, 1.0, 0.0))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.y - 1.0, +1),
                Reset(lambda t, x, p: (2.0 * x.a + x.b, 0.5 * x.b, 0.0, 1.0)), name="tick",
            ),
            Transition(
                "m", "m", Guard(lambda t, x, p: x.w - 0.5, +1),
                Reset(lambda t, x, p: (3.0 * x.a - x.b, 0.2 * x.b, x.y, 0.0)), name="tock",
            ),
        ],
    )  # fmt: skip
    spectrum = lyapunov_spectrum(
        system, (0.0, 0.0, 0.25, 0.0), k=3, interval=3.0, intervals=8, transient=10, solver=solver
    )
    np.testing.assert_allclose(spectrum.exponents, [np.log(6.0), 0.0, np.log(0.1)], rtol=0, atol=1e-9)


@cache
def stopped():
    """A mass falls onto the floor, is pushed along, and rests; ``w`` counts time in the mode of rest."""
    return HybridSystem(
        state=("q", "v", "u", "w"),
        parameters={"level": 100.0},
        modes=[
            Mode("fall", lambda t, x, p: (x.v, -2.0, -0.5 * x.u, 0.0)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, -x.u, 1.0)),
            Mode("alarm", lambda t, x, p: (0.0, 0.0, 0.0, 3.0)),
        ],
        transitions=[
            Transition(
                "fall", "fall", Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, 0.0, 2.0 * x.u, x.w)), accumulates_to="rest", name="land",
            ),
            Transition("rest", "alarm", Guard(lambda t, x, p: x.u - p.level, +1), name="alarm"),
        ],
    )  # fmt: skip


@SOLVERS
@pytest.mark.parametrize("count", [1, 4])
def test_a_mass_that_rests_at_once_keeps_what_does_not_rest(solver, count):
    """From ``q = 1`` with speed ``v``: rest from ``t* = (v + s) / 2`` on, with ``s^2 = v^2 + 4 q``."""
    vectors = np.eye(4)[:, 4 - count :] if count == 4 else np.array([[1.0], [0.5], [0.2], [0.1]])
    arc = simulate(stopped(), (1.0, 0.0, 1.0, 0.0), (0.0, 3.0), mode="fall", solver=solver, tangent=vectors)
    assert arc.mode[-1] == "rest"
    # u = 2 exp(-t* / 2) u0 exp(-(3 - t*)), w = w0 + 3 - t*, and t* = 1 here with the slopes 1/2 each.
    u = 2.0 * np.exp(-0.5 - 2.0)
    slope = np.array([0.5, 0.5])
    expected = np.zeros((4, 4))
    expected[2] = [*(0.5 * u * slope), u, 0.0]
    expected[3] = [*(-slope), 0.0, 1.0]
    np.testing.assert_allclose(arc.x[-1], [0.0, 0.0, u, 2.0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(arc.fundamental, expected @ vectors, rtol=0, atol=1e-9)


@SOLVERS
def test_the_mode_of_rest_may_be_left_at_once(solver):
    """Its guard is beyond as the mass comes to rest; all happens at the time of the landing."""
    options = {"mode": "fall", "parameters": {"level": 1.5}, "solver": solver}
    arc = simulate(stopped(), (1.0, 0.0, 2.0, 0.0), (0.0, 3.0), tangent=True, **options)
    assert [str(name) for name in arc.jumps.transition] == ["land", "alarm"]
    np.testing.assert_allclose(arc.jumps.t, 1.0, rtol=1e-12)
    u = 4.0 * np.exp(-0.5)
    np.testing.assert_allclose(arc.x[-1, 2:], [u, 6.0], rtol=0, atol=1e-10)
    expected = [[-0.25 * u, -0.25 * u, 0.5 * u, 0.0], [-1.5, -1.5, 0.0, 1.0]]
    np.testing.assert_allclose(arc.fundamental[2:], expected, rtol=0, atol=1e-9)
    without = simulate(stopped(), (1.0, 0.0, 2.0, 0.0), (0.0, 3.0), **options)
    np.testing.assert_allclose(without.x[-1], arc.x[-1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(without.jumps.saltation, arc.jumps.saltation, rtol=0, atol=1e-9)


@SOLVERS
@pytest.mark.parametrize("source", ["jump", "flow"])
def test_a_crossing_that_was_refused_does_not_fire_later(solver, source):
    """At 0.3 a reset or the flow takes ``w`` beyond its guard, whose condition holds only from 0.6 on."""
    moved = 2.0 if source == "jump" else 0.0
    system = HybridSystem(
        state=("y", "w", "f", "n"),
        modes=[Mode("m", lambda t, x, p: (1.0, 0.0 if source == "jump" else 1.0, 0.0, 0.0))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.y - 0.3, +1),
                Reset(lambda t, x, p: (x.y, x.w + moved, x.f, x.n)), name="move",
            ),
            Transition(
                "m", "m", Guard(lambda t, x, p: x.y - 0.6, +1),
                Reset(lambda t, x, p: (x.y, x.w, 1.0, x.n)), name="open",
            ),
            Transition(
                "m", "m", Guard(lambda t, x, p: x.w - 1.0, +1, when=lambda t, x, p: x.f - 0.5),
                Reset(lambda t, x, p: (x.y, x.w, x.f, x.n + 1.0)), name="fire",
            ),
        ],
    )  # fmt: skip
    start = 0.0 if source == "jump" else 0.6
    arc = simulate(system, (0.0, start, 0.0, 0.0), (0.0, 1.0), solver=solver)
    assert [str(name) for name in arc.jumps.transition] == ["move", "open"]
    # With the condition from the start on, it fires at its crossing.
    arc = simulate(system, (0.0, start, 1.0, 0.0), (0.0, 1.0), solver=solver)
    assert [str(name) for name in arc.jumps.transition][-2:] == ["fire", "open"]
    assert arc.x[-1, 3] == 1.0


@cache
def bouncing_beside():
    """A bouncing ball, and beside it ``s' = -s^2``, whose Jacobian varies; ``s = s0 / (1 + s0 t)``."""
    return HybridSystem(
        state=("q", "v", "s"),
        parameters={"e": 0.5},
        modes=[
            Mode("fall", lambda t, x, p: (x.v, -2.0, -x.s * x.s)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, -x.s * x.s)),
        ],
        transitions=[
            Transition(
                "fall", "fall", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, -p.e * x.v, x.s)),
                accumulates_to="rest",
            )
        ],
    )  # fmt: skip


@SOLVERS
@pytest.mark.parametrize("e", [0.0, 0.1, 0.5, 0.8, 0.93])
def test_a_chatter_changes_nothing_of_what_goes_on_beside_it(solver, e):
    end = 3.0 + 2.0 * e / (1.0 - e)
    arc = simulate(
        bouncing_beside(),
        (1.0, 0.0, 1.0),
        (0.0, end),
        mode="fall",
        parameters={"e": e},
        solver=solver,
        tangent=True,
    )
    assert arc.mode[-1] == "rest"
    np.testing.assert_allclose(arc.x[-1], [0.0, 0.0, 1.0 / (1.0 + end)], rtol=0, atol=1e-9)
    expected = np.zeros((3, 3))
    expected[2, 2] = (1.0 + end) ** -2
    np.testing.assert_allclose(arc.fundamental, expected, rtol=0, atol=1e-9)


@SOLVERS
@pytest.mark.parametrize("k", [1, 2])
def test_the_sum_rule_counts_the_divergence_with_any_number_of_vectors(solver, k):
    """``x'' = -x - 0.2 x'`` with a velocity that is halved once per unit of time."""
    system = HybridSystem(
        state=("x", "v", "y"),
        modes=[Mode("m", lambda t, x, p: (x.v, -x.x - 0.2 * x.v, 1.0))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.y - 1.0, +1), Reset(lambda t, x, p: (x.x, 0.5 * x.v, 0.0))
            )
        ],
    )
    spectrum = lyapunov_spectrum(
        system, (1.0, 0.0, 0.5), k=k, interval=4.0, intervals=5, transient=4, solver=solver
    )
    assert spectrum.sum_rule == pytest.approx(-0.2 - np.log(2.0), abs=1e-9)
