"""Runs find the crossings that the sign word of a guard on the path has, and no others.

The motion is a polynomial in time, so the path is known; ``tests.reference.sign_word`` reads the word. A
transition that counts shows each crossing that a run has found.
"""

import functools
from fractions import Fraction

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate
from tests.reference.sign_word import Path, events, sign_word

DEGREE, PATHS = 7, 40
# Sums of magnitudes of a component are below 3, and so are those of its rounding in units of it.
ROUNDING, TOLERANCE = 2e-14, 1e-8

# By name: a guard as the model has it, and as a function of jets.
GUARDS = {
    "affine": (lambda q, v: q - 0.1, lambda q, v: q - 0.1),
    "circle": (lambda q, v: q * q + v * v - 0.3, lambda q, v: q * q + v * v - 0.3),
    "sine": (lambda q, v: np.sin(20 * q) - 0.9 * v, lambda q, v: (20 * q).sin() - 0.9 * v),
    "exponential": (lambda q, v: np.exp(2 * v) - 1.1 + q * v, lambda q, v: (2 * v).exp() - 1.1 + q * v),
    "kink": (lambda q, v: abs(q) - 0.2, lambda q, v: abs(q) - 0.2),
    "pulse": (lambda q, v: np.exp(-1600 * q * q) - 0.5, lambda q, v: (-1600 * q * q).exp() - 0.5),
    "product": (lambda q, v: q * (2 + v), lambda q, v: q * (2 + v)),
}
SOLVERS = {
    "series": (Taylor(rtol=1e-13, atol=1e-13), ROUNDING),
    "explicit": (DOP853(rtol=1e-10, atol=1e-10), TOLERANCE),
    "implicit": (RadauIIA(rtol=1e-9, atol=1e-9), TOLERANCE),
}


@functools.cache
def counting(kind):
    """Two polynomials in time, and a counter of the crossings of a guard."""
    guard, _ = GUARDS[kind]

    def field(t, x, p):
        rates = []
        for name in "ab":
            rate = 0.0
            for k in range(DEGREE, 0, -1):
                rate = rate * t + k * getattr(p, f"{name}{k}")
            rates.append(rate)
        return tuple(rates)

    return HybridSystem(
        state=("q", "v"),
        counters=("n",),
        parameters={f"{name}{k}": 0.0 for name in "ab" for k in range(1, DEGREE + 1)},
        modes=[Mode("run", field)],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: guard(x.q, x.v), direction=0),
                Reset(lambda t, x, p: {"n": x.n + 1}),
                name="cross",
            )
        ],
    )


def crossings(kind, powers, solver):
    """The times at which a run finds the guard crossed."""
    parameters = {
        f"{name}{k}": row[k] for name, row in zip("ab", powers, strict=True) for k in range(1, DEGREE + 1)
    }
    start = {"q": powers[0][0], "v": powers[1][0]}
    arc = simulate(counting(kind), start, (0.0, 1.0), parameters=parameters, solver=solver)
    assert arc.status.ok, arc.status
    return [jump.t for jump in arc.jumps]


def told_by(word, times, error):
    """Whether a run that found the crossings at these ``times`` found those of a word, and no others.

    A crossing lies where errors hide the guard. What is hidden between equal signs may be no crossing or two.
    """
    left = list(times)
    for event in events(word):
        within = [t for t in left if event.begin - error <= t <= event.end + error]
        left = [t for t in left if t not in within]
        if len(within) % 2 != (1 if event.crosses else 0):
            return False
    hidden = [(begin, word[i + 1][0]) for i, (begin, s) in enumerate(word[:-1]) if s == 0]
    hidden += [(word[-1][0], 1.0)] if word[-1][1] == 0 else []
    return all(any(a - error <= t <= b + error for a, b in hidden) for t in left)


@pytest.mark.parametrize("kind", GUARDS)
@pytest.mark.parametrize("method", SOLVERS)
def test_run_finds_the_crossings_of_the_word(kind, method):
    random, (solver, error) = np.random.default_rng(7), SOLVERS[method]
    found = 0
    for _ in range(PATHS):
        powers = random.uniform(-1, 1, (2, DEGREE + 1)) / np.arange(1, DEGREE + 2)
        path = Path(powers.tolist(), (error, error), 1.0)
        word = sign_word(GUARDS[kind][1], path)
        times = crossings(kind, powers, solver)
        assert told_by(word, times, 1e-12), (powers.tolist(), word, times)
        found += len(times)
    assert found > 0


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-8, 0.0, -1e-8, -1e-6, -1e-4, -1e-2])
def test_dip_of_any_depth(depth):
    """``(t - 1/3)^2 + depth`` times a factor: two crossings, none, or a touch that errors hide."""
    powers = np.zeros((2, DEGREE + 1))
    powers[0, :3], powers[1, 1] = (1 / 9 + depth, -2 / 3, 1.0), 1.0
    path = Path(powers.tolist(), (ROUNDING, ROUNDING), 1.0)
    word = sign_word(GUARDS["product"][1], path)
    times = crossings("product", powers, Taylor(rtol=1e-13, atol=1e-13))
    assert told_by(word, times, 1e-12)
    assert len(events(word)) == (2 if depth < 0.0 else 1 if depth == 0.0 else 0)
    assert len(times) == (2 if depth < 0.0 else 0)


def test_lost_or_added_crossing_is_told():
    powers = np.zeros((2, DEGREE + 1))
    powers[0, :2] = -0.5, 1.0
    word = sign_word(GUARDS["affine"][1], Path(powers.tolist(), (ROUNDING, ROUNDING), 1.0))
    assert told_by(word, [0.6], 1e-12)
    for times in ([], [0.61], [0.6, 0.6], [0.6, 0.9]):
        assert not told_by(word, times, 1e-12)


def test_no_letter_is_wrong():
    """Letters are signs of the guard at places drawn at random, in whole numbers."""
    random = np.random.default_rng(3)
    for _ in range(20):
        powers = random.uniform(-1, 1, (2, DEGREE + 1)) / np.arange(1, DEGREE + 2)
        path = Path(powers.tolist(), (0.0, 0.0), 1.0)
        word = sign_word(GUARDS["circle"][1], path)
        for place in random.uniform(0, 1, 40):
            q, v = (
                sum(Fraction(float(c)) * Fraction(place) ** k for k, c in enumerate(row)) for row in powers
            )
            told = [letter for begin, letter in word if begin <= place][-1]
            assert told == 0 or told * (q * q + v * v - Fraction(0.3)) > 0
