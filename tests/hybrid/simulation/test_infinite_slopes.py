"""Contact laws whose slope is infinite at the surface: tangent vectors are right, or the status says so.

The reference integrates state and tangent vectors on the clock ``dt = w**(q - 1) ds``, ``depth = w**q``.
There the law and its slope are smooth. Its steps are its own.
"""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    periodic_orbit,
    saltation_matrix,
    simulate,
    split,
)
from hybrid.solvers.tableau import Tableau
from lyapunov import lyapunov_spectrum

W, A, K, C, T = 0.7, 0.3, 10.0, 0.5, 12.0
SOLVERS = [Taylor(), DOP853(), Tsit5(), RadauIIA()]

# The law of depth and rate, and q; then, as functions of w and the rate: the force, w**(q - 1) times its
# slope in the depth, and its slope in the rate.
LAWS = {
    "Kuwabara-Kono": (
        lambda d, r, p: p.K * d**1.5 + p.c * np.sqrt(d) * r,
        2,
        lambda w, r: (K * w**3 + C * w * r, 1.5 * K * w**2 + 0.5 * C * r, C * w),
    ),
    "root": (lambda d, r, p: p.K * d**0.5, 2, lambda w, r: (K * w, 0.5 * K, 0.0)),
    "Tsuji": (
        lambda d, r, p: p.K * d**1.5 + p.c * d**0.25 * r,
        4,
        lambda w, r: (K * w**6 + C * w * r, 1.5 * K * w**5 + 0.25 * C * r, C * w),
    ),
    "JKR": (
        lambda d, r, p: p.K * d**1.5 - p.c * d**0.75,
        4,
        lambda w, r: (K * w**6 - C * w**3, 1.5 * K * w**5 - 0.75 * C * w**2, 0.0),
    ),
    "cube root": (lambda d, r, p: p.K * np.cbrt(d), 3, lambda w, r: (K * w, K / 3, 0.0)),
    "two thirds": (lambda d, r, p: p.K * d ** (2 / 3), 3, lambda w, r: (K * w**2, 2 * K / 3 * w, 0.0)),
    "sixth": (lambda d, r, p: p.K * d ** (1 / 6), 6, lambda w, r: (K * w, K / 6, 0.0)),
}
WRITTEN = {
    "raw": lambda d: d,
    "maximum": lambda d: np.maximum(d, 0.0),
    "abs": np.abs,
}


def oscillator(law, written=WRITTEN["raw"], swing=0.0):
    """An oscillator over a wall at -1/2, which swings."""

    def wall(t, p):
        return -0.5 + swing * np.cos(p.w * t)

    def contact(t, x, p):
        depth, rate = wall(t, p) - x.q, -swing * p.w * np.sin(p.w * t) - x.v
        return x.v, p.A * np.cos(p.w * t) - x.q + law(written(depth), rate, p)

    def height(t, x, p):
        return x.q - wall(t, p)

    return HybridSystem(
        state=("q", "v"),
        parameters={"w": W, "A": A, "K": K, "c": C, "n": 0.5},
        period=lambda p: 2 * np.pi / p.w,
        modes=[
            Mode("free", lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - x.q)),
            Mode("contact", contact),
        ],
        transitions=[
            Transition("free", "contact", Guard(height, -1), name="hit"),
            Transition("contact", "free", Guard(height, +1), name="go"),
        ],
    )


def steps_until(rates, y, h, level):
    """Steps of order 8 until ``level(y)`` is zero; Newton's method ends the last one."""
    method: Tableau = DOP853.tableau
    stages = len(method.b)

    def step(y, h):
        k = np.zeros((stages, len(y)))
        for i in range(stages):
            k[i] = rates(y + h * (method.a[i, :i] @ k[:i]))
        return y + h * (method.b @ k)

    while level(step(y, h)) > 0.0:
        y = step(y, h)
    part, high = 0.5 * h, h
    low = 0.0
    for _ in range(60):
        if level(step(y, part)) > 0.0:
            low = part
        else:
            high = part
        part = 0.5 * (low + high)
    return step(y, part)


def reference(name, end=T):
    """State and tangent map at the end, and the number of jumps, for a wall at rest."""
    _, q, force = LAWS[name]

    def free(y):
        x, v, t, tangents = y[0], y[1], y[2], y[3:].reshape(2, 2)
        return np.array([v, A * np.cos(W * t) - x, 1.0, *tangents[1], *-tangents[0]])

    def contact(y):
        w, v, t, tangents = y[0], y[1], y[2], y[3:].reshape(2, 2)
        value, slope, damping = force(w, -v)
        pace = w ** (q - 1)
        acceleration = pace * (A * np.cos(W * t) + 0.5 + w**q + value)
        bend = -(pace + slope) * tangents[0] - pace * damping * tangents[1]
        return np.array([-v / q, acceleration, pace, *pace * tangents[1], *bend])

    y, jumps, inside = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), 0, False
    while True:

        def level(y, inside=inside):
            return min(end - y[2], y[0] if inside else y[0] + 0.5)

        y = steps_until(contact if inside else free, y, 0.02, level)
        if y[2] > end - 1e-9:
            x = -0.5 - y[0] ** q if inside else y[0]
            return np.array([x, y[1]]), y[3:].reshape(2, 2), jumps
        y[0], inside, jumps = (-0.5 if inside else 0.0), not inside, jumps + 1


@pytest.fixture(scope="module")
def references():
    return {name: reference(name) for name in LAWS}


@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("name", LAWS)
def test_tangent_vectors_cross_an_infinite_slope(references, name, written):
    state, tangents, jumps = references[name]
    system = oscillator(LAWS[name][0], WRITTEN[written])
    for solver in SOLVERS:
        arc = simulate(system, (1.0, 0.0), (0.0, T), mode="free", tangent=True, solver=solver)
        assert arc.status.code == StatusCode.SUCCESS, (solver, arc.status)
        assert len(arc.jumps) == jumps
        np.testing.assert_allclose(arc.x[-1], state, atol=2e-9)
        np.testing.assert_allclose(arc.fundamental, tangents, atol=2e-9 * np.abs(tangents).max())
        alone = simulate(system, (1.0, 0.0), (0.0, T), mode="free", solver=solver)
        assert alone.status.code == StatusCode.SUCCESS
        np.testing.assert_allclose(alone.x[-1], state, atol=3e-7)


@pytest.mark.parametrize("name", ["root", "Tsuji", "cube root"])
def test_tangent_vectors_over_a_wall_that_swings(name):
    """Central differences of tight runs; the guard is not affine here."""
    system, start, h = oscillator(LAWS[name][0], swing=0.2), np.array([1.0, 0.0]), 1e-5
    tight = Taylor(rtol=1e-13, atol=1e-15)

    def end(x):
        return simulate(system, x, (0.0, 9.0), mode="free", solver=tight).x[-1]

    differences = np.transpose([(end(start + e) - end(start - e)) / (2 * h) for e in h * np.eye(2)])
    for solver in SOLVERS:
        arc = simulate(system, start, (0.0, 9.0), mode="free", tangent=True, solver=solver)
        assert arc.status.ok, arc.status
        assert len(arc.jumps) >= 2
        np.testing.assert_allclose(arc.fundamental, differences, atol=3e-8 * np.abs(differences).max())


def by_hand(law):
    """An oscillator with friction by a power of its speed, with a mode for each direction."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode(name, lambda t, x, p: (x.v, -x.q - 0.3 * law(x.v))) for name in ("up", "down")],
        transitions=[
            Transition("up", "down", Guard(lambda t, x, p: x.v, -1)),
            Transition("down", "up", Guard(lambda t, x, p: x.v, +1)),
        ],
    )


@pytest.mark.parametrize("power", [0.5, 0.25, 1 / 3])
def test_friction_by_a_root_of_the_speed(power):
    """The speed of the guard has the root: rounding of it must not hide the side, nor turn the time back."""
    system, h = by_hand(lambda v: np.abs(v) ** power * np.sign(v)), 1e-5
    tight = Taylor(rtol=1e-13, atol=1e-15)

    def end(x, solver=tight):
        arc = simulate(system, x, (0.0, 5.0), mode="up", solver=solver)
        assert arc.status.ok
        assert arc.jumps.transition.tolist() == ["up->down", "down->up"]
        return arc.x[-1]

    start = np.array([1.0, 0.5])
    differences = np.transpose([(end(start + e) - end(start - e)) / (2 * h) for e in h * np.eye(2)])
    for solver in SOLVERS:
        arc = simulate(system, start, (0.0, 5.0), mode="up", tangent=True, solver=solver)
        assert arc.status.ok
        np.testing.assert_allclose(arc.fundamental, differences, atol=3e-9)
    for shift in range(20):
        close = end(start + np.array([1e-9 * shift, 0.0]), Taylor(rtol=1e-12, atol=1e-14))
        np.testing.assert_allclose(close, end(start), atol=1e-7)


def test_friction_inside_of_a_mode_is_told_and_split():
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("all", lambda t, x, p: (x.v, -x.q - 0.3 * np.abs(x.v) ** 0.5 * np.sign(x.v)))],
    )
    for solver in SOLVERS:
        arc = simulate(system, (1.0, 0.5), (0.0, 5.0), tangent=True, solver=solver)
        assert arc.status.code == StatusCode.INFINITE_SLOPE
        assert "sqrt(abs(v)) in mode 'all'" in arc.status.message
        assert "hybrid.split(system)" in arc.status.remedy
        assert simulate(system, (1.0, 0.5), (0.0, 5.0), solver=solver).status.ok
    pieces = simulate(split(system), (1.0, 0.5), (0.0, 5.0), tangent=True)
    hand = by_hand(lambda v: np.abs(v) ** 0.5 * np.sign(v))
    expected = simulate(hand, (1.0, 0.5), (0.0, 5.0), mode="up", tangent=True)
    assert pieces.status.ok
    np.testing.assert_allclose(pieces.fundamental, expected.fundamental, atol=1e-12)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda d, r, p: p.K * d**p.n, "**n"),
        (lambda d, r, p: p.K * d**0.45, "**0.45"),
    ],
)
def test_a_law_without_a_series_is_told(law, words):
    """Steps in time lose the root of rounding; the state alone is right."""
    system = oscillator(law)
    for solver in SOLVERS:
        arc = simulate(system, (1.0, 0.0), (0.0, T), mode="free", tangent=True, solver=solver)
        assert arc.status.code == StatusCode.INFINITE_SLOPE
        assert words in arc.status.message
        assert "'contact'" in arc.status.message
        assert simulate(system, (1.0, 0.0), (0.0, T), mode="free", solver=solver).status.ok


@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
def test_an_exponent_that_is_a_parameter_is_told_by_its_value(solver):
    system = oscillator(lambda d, r, p: p.K * d**p.n)
    arc = simulate(
        system, (1.0, 0.0), (0.0, T), mode="free", tangent=True, solver=solver, parameters={"n": 1.5}
    )
    assert arc.status.code == StatusCode.SUCCESS


def test_the_saltation_matrix_has_the_field_on_the_guard():
    """Rounding leaves a depth of 1e-16 there, whose fourth root is 1e-4."""
    system = oscillator(lambda d, r, p: p.K * d**0.25)
    for depth in (0.0, 1e-16, -1e-16):
        for name in ("hit", "go"):
            matrix = saltation_matrix(system, name, 0.0, (-0.5 - depth, -0.7 if name == "hit" else 0.7))
            np.testing.assert_allclose(matrix, np.eye(2), atol=1e-14)


def test_exponents_and_multipliers_across_an_infinite_slope():
    """The sum rule of both holds with the damping ``-c sqrt(depth)`` in contact, at different solvers."""
    system = oscillator(LAWS["Kuwabara-Kono"][0])
    spectra = [
        lyapunov_spectrum(system, (1.0, 0.0), mode="free", intervals=40, transient=10, solver=solver)
        for solver in (Taylor(), DOP853())
    ]
    for spectrum in spectra:
        assert spectrum.status.ok
        assert spectrum.exponents.sum() == pytest.approx(spectrum.sum_rule, abs=1e-9)
    np.testing.assert_allclose(spectra[0].exponents, spectra[1].exponents, atol=1e-6)
    # Without forcing there is a family of orbits of a conservative contact: both multipliers are 1.
    orbit = periodic_orbit(
        oscillator(LAWS["root"][0]), (1.0, 0.0), mode="free", parameters={"A": 0.0}, periods=1
    )
    assert np.prod(orbit.multipliers) == pytest.approx(1.0, abs=1e-9)
