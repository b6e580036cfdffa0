"""Several directed guards along one polynomial motion, with crossings that coincide up to rounding.

The components of the state are the powers of time, each guard is a polynomial in them with given roots, and
resets only count. So the number of crossings of each guard in its direction is known, whatever events of
other guards end the steps.
"""

from functools import cache

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from hybrid import DOP853, RadauIIA, Taylor, simulate
from tests.hybrid.kernels.events.counting import counting

DEGREE, GUARDS, END = 5, 3, 2.0
PLACES = np.arange(1, 16) / 8
SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}


@cache
def counters(directions, modes):
    """Guards along the powers of time that count their crossings, and change the mode if there are two."""
    width = DEGREE + 1

    def field(t, x, p):
        return (1.0, *(k * x[k - 2] for k in range(2, width)))

    def guard(i):
        return lambda t, x, p: p[width * i] + sum(p[width * i + k] * x[k - 1] for k in range(1, width))

    names = [f"x{k}" for k in range(1, width)]
    parameters = {f"a{i}_{k}": 1.0 for i in range(GUARDS) for k in range(width)}
    return counting(names, field, [guard(i) for i in range(GUARDS)], directions, modes, parameters)


def polynomials(rng):
    """Factor and roots of each guard: up to rounding, several guards share roots; each has a close pair."""
    shared = rng.choice(PLACES, size=rng.integers(2, 6), replace=False)
    for _ in range(GUARDS):
        roots = list(rng.permutation(shared)[: rng.integers(1, DEGREE)])
        roots = [r + rng.choice([-1, 0, 1]) * 10.0 ** rng.uniform(-16.5, -10) for r in roots]
        near = rng.choice(roots) + rng.choice([-1, 1]) * rng.uniform(0.02, 0.1)
        if min(abs(near - r) for r in roots) > 0.02:
            roots.append(near)
        yield rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2, 2), sorted(roots)


def crossings(factor, roots, direction):
    """How often a polynomial changes its sign in a direction: it has the sign of its factor at the end."""
    after = [np.sign(factor) * (-1) ** (len(roots) - 1 - i) for i in range(len(roots))]
    return sum(direction in (0, side) for side in after)


def check_counts(directions, modes, solver, guards):
    """Each guard, given by its factor and roots, fires as often as it crosses in its direction."""
    values = np.zeros((GUARDS, DEGREE + 1))
    for row, (factor, roots) in zip(values, guards, strict=True):
        coefficients = factor * Polynomial.fromroots(roots).coef
        row[: len(coefficients)] = coefficients
    system = counters(directions, modes)
    parameters = dict(zip(system.parameters, values.ravel(), strict=True))
    start = np.zeros(DEGREE + GUARDS)
    arc = simulate(system, start, (0.0, END), mode="mode 0", parameters=parameters, solver=solver)
    expected = [crossings(*guard, direction) for guard, direction in zip(guards, directions, strict=True)]
    assert list(arc.x[-1, DEGREE:]) == expected, (guards, arc.jumps.t)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("modes", [1, 2])
@pytest.mark.parametrize("directions", [(1, -1, 0), (-1, 1, 1)])
def test_each_crossing_in_its_direction_fires_once(directions, modes, name, seed):
    """No event of another guard loses or invents one, wherever on the step the guard changes sides."""
    rng = np.random.default_rng([seed, modes])
    for _ in range(20):
        check_counts(directions, modes, SOLVERS[name], list(polynomials(rng)))


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize(
    ("directions", "guards"),
    [
        (
            (1, -1, 0),
            [
                (49.498732476807355, [0.1249999999999991, 0.5, 0.5717452656337997, 1.125]),
                (-0.5590232390316666, [0.5000000000000001, 1.125, 1.374999999997059, 1.422284663525155]),
                (0.4170181533173318, [0.4999999999999988, 1.3750000000028224, 1.452592799881338]),
            ],
        ),
        (
            (-1, 0, 1),
            [
                (0.019641672213876672, [0.12500000001516956, 0.3749999999993476, 0.4140642716352075]),
                (0.0281664, [0.12499999999999935, 0.3749999999999961, 0.875, 1.5, 1.5398546975898608]),
                (1.0781525512178856, [0.8749999999999986, 0.9353674177717171, 1.4999999999999998]),
            ],
        ),
    ],
)
def test_a_guard_that_has_passed_unheard_on_a_step_crosses_at_its_end(directions, guards, name):
    """The first guard falls on the step, which does not fire, and rises where another ends the step."""
    check_counts(directions, 2, SOLVERS[name], guards)


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("factor", [0.013, 9.53, 10.2, 43.7])
@pytest.mark.parametrize("place", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("apart", [0.028, 0.0494, 0.0623, 0.091])
def test_a_crossing_behind_one_where_the_step_is_halved(place, apart, factor, name):
    """Both guards pass at the place; the one whose direction that is not fires at its later root."""
    near, far = (place, place + apart), (place - apart, place)
    guards = [(factor, near), (-factor, near), (factor, far)]
    check_counts((1, -1, 0), 1, SOLVERS[name], guards)
