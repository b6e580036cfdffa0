"""Recurrences of Taylor coefficients, run by an interpreter, against derivatives to forty digits."""

import mpmath as mp
import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Transition, simulate
from hybrid.compiler.emit import emit
from hybrid.compiler.parts import PARTS, SERIES, TANGENT_SERIES
from hybrid.compiler.statements.code import get
from hybrid.compiler.statements.values import Constants
from hybrid.compiler.taylor import pairs
from hybrid.compiler.taylor.series import Recurrences
from hybrid.compiler.taylor.sums import Term, added
from hybrid.expression.nodes import Symbol
from hybrid.kernels.types.codes import DESINGULARISED, EXACT, NARROW, RUNGE_KUTTA, TAYLOR
from tests.hybrid.code import functions_in

ORDER = 9
A = 1.375

FUNCTIONS = {
    "sin": (lambda u: np.sin(u), mp.sin),
    "tan": (lambda u: np.tan(u), mp.tan),
    "exp": (lambda u: np.exp(u), mp.exp),
    "log": (lambda u: np.log(u), mp.log),
    "sqrt": (lambda u: np.sqrt(u), mp.sqrt),
    "tanh": (lambda u: np.tanh(u), mp.tanh),
    "arccos": (lambda u: np.arccos(u / 3), lambda u: mp.acos(u / 3)),
    "log2": (lambda u: np.log2(u), lambda u: mp.log(u, 2)),
    "hypot": (lambda u: np.hypot(u, 2.0), lambda u: mp.hypot(u, 2)),
    "square": (lambda u: u**2, lambda u: u**2),
    "seventh": (lambda u: u**7, lambda u: u**7),
    "reciprocal": (lambda u: 1 / u, lambda u: 1 / u),
    "quotient": (lambda u: (1 + u**2) / (2 + u), lambda u: (1 + u**2) / (2 + u)),
    "quotient of two": (lambda u: u / ((2 + u) * (3 + u)), lambda u: u / ((2 + u) * (3 + u))),
    "power": (lambda u: u**2.3, lambda u: u ** mp.mpf(2.3)),
    "variable power": (lambda u: u**u, lambda u: u**u),
    "power of a number": (lambda u: 2.3**u, lambda u: mp.mpf(2.3) ** u),
    "nested": (lambda u: np.exp(np.sin(u) * u), lambda u: mp.exp(mp.sin(u) * u)),
    "shared": (
        lambda u: np.sin(u) * np.cos(u) + np.sin(u) ** 2,
        lambda u: mp.sin(u) * mp.cos(u) + mp.sin(u) ** 2,
    ),
}  # fmt: skip


def series_of(system, x, *, t=0.0, mode=0, tangents=0, vectors=None, parameters=()):
    """The function ``series`` of a system: coefficients of the state and of each tangent vector.

    Matrices ``(ORDER + 1, columns)``, and ``(ORDER + 1, n)`` per vector.
    """
    emitted = emit(system)
    n = system.dimension
    vectors = np.eye(n)[:tangents] if vectors is None else vectors
    tangents = len(vectors)
    part = TANGENT_SERIES if tangents else SERIES
    [name] = PARTS[part]
    run = functions_in(emitted.texts[part])[name]
    y = np.concatenate([x, *vectors])
    out = np.full((ORDER + 3, 400), np.nan)
    run(mode, np.float64(t), y, np.array(parameters), ORDER, out)
    start, stride = emitted.tangent_start, emitted.propagators[mode].series.tangent_columns
    columns = [start + i // NARROW * stride + NARROW * np.arange(n) + i % NARROW for i in range(tangents)]
    return out[: ORDER + 1, :start], [out[: ORDER + 1, each] for each in columns]


def system_of(field, *transitions, state=("x", "y"), **options):
    return HybridSystem(state=state, modes=[Mode("a", field)], transitions=transitions, **options)


def kinds(system):
    return [each.kind for each in emit(system).propagators]


# Powers of expressions that are not a guard and may reach zero.
FRACTIONAL = ("sqrt", "power", "variable power")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_the_state(name):
    """With ``x' = 1, y' = F(x)`` the series of y is the integral of the series of F."""
    function, exact = FUNCTIONS[name]
    system = system_of(lambda t, x, p: (1.0, function(x.x)))
    if name in FRACTIONAL:
        # The series would continue through the zero of the base.
        assert kinds(system) == [RUNGE_KUTTA]
        return
    out, [vector] = series_of(system, [A, 0.0], tangents=1)
    with mp.workdps(40):
        coefficients = mp.taylor(exact, mp.mpf(A), ORDER)
    expected = [0.0, *(float(coefficients[k - 1] / k) for k in range(1, ORDER + 1))]
    np.testing.assert_allclose(out[:, 1], expected, rtol=1e-12, atol=1e-15)
    # The second component of the tangent vector that starts along x integrates F': it is F less a constant.
    slope = [0.0, *(float(c) for c in coefficients[1:])]
    np.testing.assert_allclose(vector[:, 1], slope, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_time(name):
    function, exact = FUNCTIONS[name]
    system = system_of(lambda t, x, p: (function(t), x.x))
    if name in FRACTIONAL:
        assert kinds(system) == [RUNGE_KUTTA]
        return
    out, _ = series_of(system, [0.0, 0.0], t=A)
    with mp.workdps(40):
        expected = [0.0, *(float(c / (k + 1)) for k, c in enumerate(mp.taylor(exact, mp.mpf(A), ORDER - 1)))]
    np.testing.assert_allclose(out[:, 0], expected, rtol=1e-12, atol=1e-15)


def test_all_functions_become_machine_code():
    """A run has machine code of every series, also with tangent vectors: ``y' = F(x)`` and ``x' = 1``."""
    names = [name for name in FUNCTIONS if name not in FRACTIONAL]
    functions = [FUNCTIONS[name][0] for name in names]
    system = system_of(lambda t, x, p: (1.0, *(each(x[0]) for each in functions)), state=1 + len(names))
    assert RUNGE_KUTTA not in kinds(system)
    arc = simulate(system, [A, *[0.0] * len(names)], (0.0, 0.125), tangent=True)
    with mp.workdps(20):
        integrals = [float(mp.quad(FUNCTIONS[name][1], [A, A + 0.125])) for name in names]
        changes = [float(FUNCTIONS[name][1](A + 0.125) - FUNCTIONS[name][1](mp.mpf(A))) for name in names]
    np.testing.assert_allclose(arc.x[-1, 1:], integrals, rtol=1e-10)
    np.testing.assert_allclose(arc.fundamental[1:, 0], changes, rtol=1e-9)


def test_guards_that_are_polynomials_have_series_of_their_own():
    system = HybridSystem(
        state=("x", "y"),
        modes=[Mode("a", lambda t, x, p: (1.0, 2.0)), Mode("b", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.x * x.y - t, +1)),
            Transition("a", "b", Guard(lambda t, x, p: np.sin(x.x), -1), name="second"),
            Transition("b", "a", Guard(lambda t, x, p: x.y - 1, -1)),
        ],
    )
    assert emit(system).guard_in_series == (True, False, True)
    out, _ = series_of(system, [0.5, 3.0], t=0.25)
    np.testing.assert_allclose(out[:3, 2], [1.5 - 0.25, 3.0 + 1.0 - 1.0, 2.0])
    np.testing.assert_array_equal(out[:3, 3], 0.0)


def test_divergence_is_integrated():
    system = system_of(lambda t, x, p: (-p.c * x.x, x.x * x.y), parameters={"c": 0.5})
    out, _ = series_of(system, [2.0, 1.0], tangents=2, parameters=[0.5])
    decay = [(-0.5) ** k / mp.factorial(k) for k in range(ORDER)]
    expected = [0.0] + [float((-0.5 * (k == 0) + 2.0 * decay[k]) / (k + 1)) for k in range(ORDER)]
    np.testing.assert_allclose(out[:, 3], expected, rtol=1e-12)


def test_what_is_exact_and_what_is_not():
    oscillator = system_of(lambda t, x, p: (x.y, -x.x + np.cos(3 * t + 1) * np.exp(-t) + t**2))
    assert kinds(oscillator) == [EXACT]
    assert kinds(system_of(lambda t, x, p: (x.y, -x.x + np.cos(t**2)))) == [TAYLOR]
    assert kinds(system_of(lambda t, x, p: (x.y, -x.x * np.cos(t)))) == [TAYLOR]
    assert kinds(system_of(lambda t, x, p: (x.y, -np.sin(x.x)))) == [TAYLOR]
    assert kinds(system_of(lambda t, x, p: (x.y, -np.sign(x.y)))) == [RUNGE_KUTTA]
    assert kinds(system_of(lambda t, x, p: (x.y, -np.maximum(x.x, 0.0)))) == [RUNGE_KUTTA]


@pytest.mark.parametrize(
    ("field", "degree"),
    [
        (lambda t, x, p: (x.y, -9.81), 2),
        (lambda t, x, p: (x.y, t**3), 5),
        (lambda t, x, p: (1.0, 0.0), 1),
        (lambda t, x, p: (0.0, 0.0), 1),
        (lambda t, x, p: (x.y, -x.x), 0),
        (lambda t, x, p: (x.y, np.exp(-t)), 0),
    ],
)
def test_degree_of_polynomial_solutions(field, degree):
    [propagator] = emit(system_of(field)).propagators
    assert (propagator.kind, propagator.degree) == (EXACT, degree)


@pytest.mark.parametrize(
    ("guard", "degree"),
    [
        (lambda x: x.x + 1, 2),
        (lambda x: x.x * x.y - 1, 4),
        # Expanded, the polynomial would lose its flat roots to rounding.
        (lambda x: x.x * x.y**2 - 1, 2),
        (lambda x: np.exp(x.x), 2),
    ],
)
def test_a_step_over_a_whole_flight_needs_quadratic_guards_too(guard, degree):
    flight = Transition("a", "a", Guard(lambda t, x, p: guard(x), -1))
    [propagator] = emit(system_of(lambda t, x, p: (x.y, -9.81), flight)).propagators
    assert (propagator.kind, propagator.degree) == (EXACT, degree)


def test_a_guard_says_what_holds_in_its_mode():
    """max(x, 0) is x where the mode ends at x = 0, and zero on the other side."""

    def field(t, x, p):
        return x.y, -4.0 * np.maximum(x.x, 0.0) - np.abs(x.x)

    system = HybridSystem(
        state=("x", "y"),
        modes=[Mode("free", field), Mode("contact", field)],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.x, +1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.x, -1)),
        ],
    )
    assert kinds(system) == [EXACT, EXACT]
    np.testing.assert_allclose(series_of(system, [-1.0, 0.0], mode=0)[0][2, 0], -1.0 / 2)
    np.testing.assert_allclose(series_of(system, [1.0, 0.0], mode=1)[0][2, 0], -5.0 / 2)


def test_a_guard_with_a_condition_says_nothing():
    def field(t, x, p):
        return x.y, -np.maximum(x.x, 0.0)

    system = HybridSystem(
        state=("x", "y"),
        modes=[Mode("a", field), Mode("b", field)],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.x, +1, when=lambda t, x, p: x.y - 1)),
            Transition("b", "a", Guard(lambda t, x, p: x.x, -1)),
        ],
    )
    assert kinds(system) == [RUNGE_KUTTA, EXACT]


def contact(power, extra=lambda x: 0.0):
    def field(t, x, p):
        return x.y, np.cos(t) - p.K * np.maximum(x.x, 0.0) ** power + extra(x)

    return HybridSystem(
        state=("x", "y"),
        parameters={"K": 100.0},
        modes=[Mode("free", field), Mode("contact", field)],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.x, +1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.x, -1)),
        ],
    )


@pytest.mark.parametrize(
    ("power", "kind"),
    [(0.5, DESINGULARISED), (1.5, DESINGULARISED), (2.5, DESINGULARISED), (2, TAYLOR), (1.25, RUNGE_KUTTA)],
)
def test_powers_of_a_guard(power, kind):
    assert kinds(contact(power)) == [EXACT, kind]


def test_half_integer_powers_of_two_guards_have_no_common_clock():
    def field(t, x, p):
        return x.y, (1.0 - x.x) ** 1.5 - x.x**1.5

    system = HybridSystem(
        state=("x", "y"),
        modes=[Mode("between", field)],
        transitions=[
            Transition("between", None, Guard(lambda t, x, p: x.x, -1), name="left"),
            Transition("between", None, Guard(lambda t, x, p: 1.0 - x.x, -1), name="right"),
        ],
    )
    [found] = emit(system).propagators
    assert (found.kind, found.reason) == (RUNGE_KUTTA, "it has fractional powers of more than one guard")


def test_hunt_crossley_contact_is_desingularised():
    damped = contact(1.5, lambda x: -x.y * np.maximum(x.x, 0.0) ** 1.5)
    assert kinds(damped) == [EXACT, DESINGULARISED]


@pytest.mark.parametrize("power", [0.5, 1.5, 2.5])
def test_series_on_the_clock_of_a_contact(power):
    """``y' = w f``, ``w^2 = z``, and the tangents solve the variational equation."""
    out, vectors = series_of(contact(power), [0.04, 1.0], t=0.3, mode=1, tangents=2, parameters=[100.0])
    s = 1e-3

    def value_and_rate(series):
        slopes = np.arange(1, ORDER + 1)[:, None] * series[1:]
        return np.polynomial.polynomial.polyval(s, series), np.polynomial.polynomial.polyval(s, slopes)

    values, rates = value_and_rate(out[:, :9])
    x, y, clock, w = values[0], values[1], values[3], values[8]
    assert w == pytest.approx(np.sqrt(x), rel=1e-14)
    assert rates[3] == pytest.approx(w, rel=1e-14)
    assert rates[0] == pytest.approx(w * y, rel=1e-13)
    assert rates[1] == pytest.approx(w * (np.cos(0.3 + clock) - 100.0 * x**power), rel=1e-12)
    stiffness = -100.0 * power * x ** (power - 1)
    for vector in vectors:
        values, rates = value_and_rate(vector)
        assert rates[0] == pytest.approx(w * values[1], rel=1e-12, abs=1e-15)
        assert rates[1] == pytest.approx(w * stiffness * values[0], rel=1e-11, abs=1e-15)


@pytest.mark.parametrize("count", [1, 3, 4, 5, 9])
def test_any_number_of_tangent_vectors(count):
    """Vectors are computed in groups of four, padded with zeros; each gives the same result as alone."""
    system = system_of(lambda t, x, p: (x.y * x.x, np.sin(x.y) / x.x + np.cos(t)))
    vectors = np.random.default_rng(count).normal(size=(count, 2))
    _, together = series_of(system, [A, 0.5], vectors=vectors)
    for vector, series in zip(vectors, together, strict=True):
        _, [alone] = series_of(system, [A, 0.5], vectors=vector[None])
        np.testing.assert_array_equal(series, alone)


@pytest.mark.parametrize("tangents", [0, 3])
def test_series_do_not_depend_on_where_the_factors_lie(monkeypatch, tangents):
    def field(t, x, p):
        s = np.diff(np.concatenate([[0.0], x]))
        pull = s + 0.3 * s**3 + 0.2 * s[::-1] * s + 0.1 * np.sin(s[0]) * s**2
        return np.append(pull[1:], 0.0) - pull + np.cos(t) * x

    system = system_of(field, state=6)
    x = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.1])
    states, vectors = series_of(system, x, t=0.4, tangents=tangents)
    monkeypatch.setattr(pairs, "MANY", 2)
    monkeypatch.setattr(pairs, "LEAST", 1)
    others, carried = series_of(system, x, t=0.4, tangents=tangents)
    np.testing.assert_allclose(others[:, :6], states[:, :6], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        np.reshape(carried, (-1, 6)), np.reshape(vectors, (-1, 6)), rtol=1e-12, atol=1e-13
    )


def test_the_reason_is_told():
    reasons = [str(each) for each in emit(contact(1.25)).propagators]
    assert reasons[0] == "exact (affine in the state)"
    assert reasons[1].startswith("Runge-Kutta pair (it has the powers 5/4 of a guard, and series in its root")


def test_a_linear_mode_has_a_table_and_what_only_looks_linear_has_none():
    def tables(field):
        return [each.series.table_columns for each in emit(system_of(field)).propagators]

    assert tables(lambda t, x, p: (x.y, np.cos(3 * t) - x.x)) == [4 * 8]
    assert tables(lambda t, x, p: (x.y, t * np.cos(3 * t) - x.x)) == [0]
    assert tables(lambda t, x, p: (x.y, np.cos(3 * t) ** 2 - x.x)) == [0]
    assert tables(lambda t, x, p: (x.y, -np.sign(x.y) - x.x)) == [0]


def test_a_table_is_right_to_the_last_digit():
    """The coefficients from unit vectors are ``M^o / o!``, while recurrences lose some digits."""
    rates = [[0.1, 3.7, -2.3], [-11.3, 0.7, 1 / 3], [5.1, -0.9, -6.7]]

    def field(t, x, p):
        return tuple(a * x.x + b * x.y + c * x.z for a, b, c in rates)

    wall = Transition("a", "a", Guard(lambda t, x, p: x.x - 0.3 * x.z, +1), name="wall")
    system = system_of(field, wall, state=("x", "y", "z"))
    with mp.workdps(60):
        power, matrix = mp.eye(3), mp.matrix(rates)
        exact = np.zeros((ORDER + 1, 4, 3))
        for o in range(ORDER + 1):
            guard = [power[0, i] - mp.mpf(0.3) * power[2, i] for i in range(3)]
            exact[o] = [*([float(power[i, j]) for j in range(3)] for i in range(3)), list(map(float, guard))]
            power = matrix * power / (o + 1)
    for i in range(3):
        out, _ = series_of(system, np.eye(3)[i])
        np.testing.assert_array_equal(out[:, :4], exact[:, :, i])


def test_a_table_and_recurrences_agree():
    """A guard that is affine in time is not linear in the state, so the mode has no table."""

    def field(t, x, p):
        return x.y, np.cos(3 * t + 1) * 2 - np.exp(-t / 2) - 4 * x.x - x.y / 5 + 1

    wall = Transition("a", "a", Guard(lambda t, x, p: x.x - 2, +1), name="wall")
    ramp = Transition("a", "a", Guard(lambda t, x, p: x.x - t, +1), name="ramp")
    fast, slow = system_of(field, wall), system_of(field, wall, ramp)
    assert [emit(each).propagators[0].series.table_columns > 0 for each in (fast, slow)] == [True, False]
    out, vectors = series_of(fast, [0.5, -1.0], t=0.7, tangents=2)
    expected, others = series_of(slow, [0.5, -1.0], t=0.7, tangents=2)
    np.testing.assert_allclose(out[:, :3], expected[:, :3], rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(vectors, others, rtol=1e-13, atol=1e-15)
    divergence = [0.0, -0.2, *[0.0] * (ORDER - 1)]
    np.testing.assert_array_equal(out[:, 4], divergence)


class TestSums:
    """Sums are ordered by when their terms are known."""

    a, b, c, d = map(get, "abcd")

    def test_what_is_known_last_is_added_last(self):
        a, b, c, d = self.a, self.b, self.c, self.d
        last = Term((9, 0), c * d, True)
        assert added([Term((3, 0), a, False)]) == a
        assert added([Term((3, 0), a, False), Term((1, 0), b, False)]) == b + a
        assert added([last, *(Term((1, i), each, False) for i, each in enumerate((a, b, c)))]) == (
            (c + (a + b)) + c * d
        )
        # A product needs an operation before it can be the first term of a sum.
        assert added([Term((1, 0), a * b, True), Term((1, 1), c, False)]) == a * b + c

    def test_four_at_once_are_added_in_pairs(self):
        names = self.a, self.b, self.c, self.d
        assert added([Term((1, i), name, False) for i, name in enumerate(names)]) == (
            (self.a + self.b) + (self.c + self.d)
        )

    def test_an_inner_sum_comes_apart_but_no_difference_of_states(self):
        """``K (x - y)`` keeps the digits that ``K x - K y`` would lose."""
        x, y, k, m = map(Symbol, "xykm")
        recurrences = Recurrences({x: 0, y: 1}, None, lambda: 9, "s", Constants())
        recurrences.coefficient(k * (x - y) + m * (x * y + k * x))
        assert x - y in recurrences.variables
        assert x * y in recurrences.variables
        assert x * y + k * x not in recurrences.variables
