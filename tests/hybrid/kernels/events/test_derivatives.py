"""Which side of a guard a state on it goes to, where rounding hides or reverses speed and acceleration."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate
from hybrid.kernels.events import derivatives, sides
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP
from hybrid.kernels.types.layout import EPSILON
from hybrid.simulation.trajectory import start
from tests.hybrid.kernels.plain import plain

_side_of, _moment = sides.side_of, derivatives.moment_of_rounding
EPS = np.finfo(float).eps
# Guards of ``q`` on the ramp ``q' = r``, the sign each takes for ``r > 0`` and for ``r < 0``, and the order
# of the derivative that tells, where ``q`` is within rounding of zero.
SHAPES = {
    "cube": (lambda z: z**3, (1, -1), {BY_SPEED}),
    "fifth power": (lambda z: -(z**5), (-1, 1), {BY_SPEED}),
    "signed square": (lambda z: z * abs(z), (1, -1), {BY_SPEED, BY_STEP}),
    "square": (lambda z: z * z, (1, 1), {BY_ACCELERATION}),
    "bowl": (lambda z: -np.cosh(z) + 1.0, (-1, -1), {BY_ACCELERATION}),
    # Speed and acceleration change sign within rounding.
    "cube that turns": (lambda z: z**3 - 1e-29 * z, (1, -1), {BY_STEP}),
    "flat below": (lambda z: np.maximum(z, 0.0) ** 3, (1, -1), {BY_SPEED, BY_STEP}),
    "two slopes": (lambda z: np.where(z > 0.0, 3.0 * z, z), (1, -1), {BY_SPEED}),
}
SIZE = 0.7


@cache
def ramp(shape):
    return HybridSystem(
        state=("q", "w"),
        parameters={"r": 1.0},
        modes=[Mode("run", lambda t, x, p: (p.r, 0.0))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: SHAPES[shape][0](x.q - x.w)))],
    )


@njit
def side(model, run, t, x, work):
    model.field(0, t, x, model.parameters, work.field)
    return _side_of(model, run, (0, t, x), 0, 0, True, work)


@pytest.mark.parametrize("rate", [1.0, -1.0, 1e-6, -3e5])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_flat_guard_goes_where_every_state_within_rounding_goes(shape, rate):
    _, expected, orders = SHAPES[shape]
    for roundings in (-6.0, -1.0, 0.0, 1.0, 6.0):
        x = np.array([SIZE + roundings * EPS * SIZE, SIZE])
        run = start(ramp(shape), x, 0.0, mode="run", parameters={"r": rate}, solver=DOP853())
        found, order = side(run.model, run.run, 0.0, x, run.work)
        assert order in orders or (roundings == 0.0 and order == BY_STEP)
        # The next step shows what the point does not.
        assert order == BY_STEP or found == expected[0 if rate > 0.0 else 1]


@pytest.mark.parametrize(("rate", "found"), [(1.0, (1, BY_SPEED)), (-1.0, (0, BY_STEP))])
def test_a_guard_that_is_flat_on_one_side_has_the_speed_of_a_moment_later(rate, found):
    """Speed and acceleration are zero at the edge; what came before the edge does not count."""
    x = np.array([SIZE, SIZE])
    run = start(ramp("flat below"), x, 0.0, mode="run", parameters={"r": rate}, solver=DOP853())
    assert side(run.model, run.run, 0.0, x, run.work) == found


@cache
def parted(bent):
    """``q`` is at rest; ``u`` and ``w`` accelerate it in opposite directions."""
    return HybridSystem(
        state=("q", "u", "w"),
        parameters={"a": 1.0, "b": 1.0},
        modes=[Mode("run", lambda t, x, p: (x.u - x.w, p.a, p.b))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: np.sin(x.q) if bent else x.q + 0.0 * x.u))
        ],
    )


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize(
    ("a", "b"), [(3.0, 0.5), (0.5, 3.0), (0.2, 0.1), (0.1, 0.2), (-2.0, -9.0), (-9.0, -2.0)]
)
def test_a_guard_at_rest_goes_where_all_forces_together_push_it(a, b, bent):
    x = np.array([0.0, 1.0, 1.0])
    run = start(parted(bent), x, 0.0, mode="run", parameters={"a": a, "b": b}, solver=DOP853())
    assert side(run.model, run.run, 0.0, x, run.work) == (np.sign(a - b), BY_ACCELERATION)


@njit
def moment(model, run, t, x, work):
    model.field(0, t, x, model.parameters, work.field)
    return _moment(model, run, t, work)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_moment_of_rounding_is_that_of_what_moves(unit):

    def found(sizes, q_rate, a, b, t):
        parameters = {"a": a * unit, "b": b * unit}
        run = start(parted(False), np.ones(3), 0.0, mode="run", parameters=parameters, solver=DOP853())
        run.run.scale[:] = np.array(sizes) * unit
        return moment(run.model, run.run, t, np.array([0.0, q_rate * unit, 0.0]), run.work)

    # Largest size and largest rate, without ``w``, which is at rest.
    assert found((3.0, 1.5, 100.0), 0.5, -2.0, 0.0, 0.7) == pytest.approx(1.5 * EPS, rel=1e-12, abs=0.0)
    assert found((1.5, 3.0, 100.0), -4.0, 2.0, 0.0, 0.7) == pytest.approx(0.75 * EPS, rel=1e-12, abs=0.0)
    assert found((1.0, 1.0, 1.0), 1.0 / unit, 1.0 / unit, 1.0 / unit, 0.0) == pytest.approx(
        unit * EPS, rel=1e-12, abs=0.0
    )
    # The rounding of time may be larger; if nothing moves, there is no other.
    assert found((3.0, 1.5, 100.0), 0.5, -2.0, 0.0, -9.0) == pytest.approx(9.0 * EPS, rel=1e-12, abs=0.0)
    assert found((3.0, 1.5, 100.0), 0.0, 0.0, 0.0, 0.7) == pytest.approx(0.7 * EPS, rel=1e-12, abs=0.0)


POWERS = {"cube": lambda z: z**3, "signed square": lambda z: z * np.abs(z), "fifth power": lambda z: z**5}
SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}
END, DRAWS = 10.0, 250


def swinging(t, a, b, s):
    return (b + s * t) * np.cos(t) - a


@cache
def swings(power, counts):
    """Crosses zero at flat roots; the rate is steady, so that one step may cross several times."""
    return HybridSystem(
        state=("q", "n"),
        parameters={"a": 0.3, "s": 0.2},
        modes=[Mode("run", lambda t, x, p: (p.s, 0.0))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: POWERS[power](x.q * np.cos(t) - p.a)),
                Reset(lambda t, x, p: (x.q, x.n + 1)) if counts else None,
            )
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("counts", [False, True])
@pytest.mark.parametrize("power", POWERS)
def test_a_flat_root_fires_once_however_its_rounding_falls(power, counts, solver):
    rng = np.random.default_rng(7)
    a, b, s = rng.uniform(0.0, 0.9, DRAWS), rng.uniform(-2.0, -0.5, DRAWS), rng.uniform(0.1, 0.4, DRAWS)
    t = np.linspace(0.0, END, 2001)
    values = swinging(t[:, None], a, b, s)
    # A turn close to zero may be a touch.
    plain = np.abs(values).min(axis=0) > 1e-6
    turns = (np.diff(values, axis=0)[1:] * np.diff(values, axis=0)[:-1] < 0) & (np.abs(values[1:-1]) < 1e-2)
    plain &= ~turns.any(axis=0)
    assert plain.sum() > 0.8 * DRAWS
    for k in np.flatnonzero(plain):
        places = np.flatnonzero(values[:-1, k] * values[1:, k] < 0)
        low, high = t[places], t[places + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            before = swinging(middle, a[k], b[k], s[k]) * values[places, k] > 0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        arc = simulate(
            swings(power, counts), (b[k], 0.0), (0.0, END), parameters={"a": a[k], "s": s[k]}, solver=solver
        )
        np.testing.assert_allclose(arc.jumps.t, low, rtol=0, atol=1e-9, err_msg=f"{a[k]!r} {b[k]!r} {s[k]!r}")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(
    ("slopes", "curve", "base", "reverses"),
    [
        # Sizes of 1, 4 and of the time, 16; all arguments together move the derivative by the sum of all.
        ((1.0, 0.0, 0.0), 0.0, 0.9, True),
        ((1.0, 0.0, 0.0), 0.0, 1.1, False),
        ((0.0, -1.0, 0.0), 0.0, 3.9, True),
        ((0.0, -1.0, 0.0), 0.0, 4.1, False),
        ((0.0, 0.0, 1.0), 0.0, 15.9, True),
        ((0.0, 0.0, 1.0), 0.0, 16.1, False),
        ((1.0, -1.0, 0.5), 0.0, 12.9, True),
        ((1.0, -1.0, 0.5), 0.0, 13.1, False),
        # A derivative that is least here is moved nowhere.
        ((0.0, 0.0, 0.0), 1.0, 0.5, False),
        ((0.0, 0.0, 0.0), 1.0, -0.5, True),
    ],
)
def test_derivatives_that_rounding_may_reverse(slopes, curve, base, reverses, sign):
    """In units of the rounding of a number of the size one."""
    share = derivatives.SHARE
    x, t = np.zeros(2), 16.0

    def derivative(model, transition, moment, place, second, work):
        a, b, c = (place[0] - x[0]) / share, (place[1] - x[1]) / share, (moment - t) / share
        return sign * (base + slopes[0] * a + slopes[1] * b + slopes[2] * c + curve * a * a), 0.0

    tested = plain(derivatives, _derivative=derivative)._may_reverse
    model, run = SimpleNamespace(dimension=2, period=0.0), SimpleNamespace(scale=np.array([1.0, 4.0]))
    work = SimpleNamespace(rounding=np.zeros((4, 2)))
    assert bool(tested(model, run, 0, t, x, sign, False, work)) == reverses
    assert share > EPSILON


@pytest.mark.parametrize(
    ("value", "rounding", "sign", "is_open"),
    [(2.0, 1.0, 1, False), (1.0, 1.0, 1, True), (-2.0, 1.0, 1, True), (-2.0, 1.0, -1, False),
     (0.0, 0.0, 1, False), (0.0, 0.5, 1, True), (-1.0, 0.0, 1, True)],
)  # fmt: skip
def test_derivatives_that_are_not_certain_of_a_sign(value, rounding, sign, is_open):
    kernels = plain(derivatives)
    assert kernels._is_open(value, rounding, sign) == is_open
    assert kernels._certain(value, rounding) == (0 if abs(value) <= rounding else np.sign(value))
