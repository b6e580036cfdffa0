"""Crossings of several guards that lie within rounding of each other, or a little farther apart.

The motion is a polynomial in time, and so is each guard. Its roots are known, and its transitions only
count. So the number of jumps is known exactly, however the jumps of one guard cut the steps on which another
guard changes sides.
"""

import functools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate

DEGREE, GUARDS = 5, 3
SOLVERS = {
    "series": Taylor(),
    "explicit": DOP853(),
    "rough": DOP853(rtol=1e-6, atol=1e-9),
    "implicit": RadauIIA(),
}


def value(kind, t, x, coefficients):
    """A polynomial in time: affine in the state, bent in the state, or a function of time."""
    if kind == "affine":
        powers = x[:DEGREE]
    else:
        base = x[0] if kind == "bent" else t
        powers = [base**k for k in range(1, DEGREE + 1)]
    return coefficients[0] + sum(c * power for c, power in zip(coefficients[1:], powers, strict=True))


@functools.cache
def counting(directions, kind, modes):
    """The powers of time as components, a counter per guard, and as many modes that take turns."""

    def field(t, x, p):
        return (1.0, *(k * x[k - 2] for k in range(2, DEGREE + 1)), *(0.0,) * GUARDS)

    def count(i):
        return lambda t, x, p: tuple(x[k] + (k == DEGREE + i) for k in range(DEGREE + GUARDS))

    def guard(i):
        first = i * (DEGREE + 1)
        return lambda t, x, p: value(kind, t, x, [p[first + k] for k in range(DEGREE + 1)])

    return HybridSystem(
        state=DEGREE + GUARDS,
        parameters={f"a{i}{k}": 1.0 for i in range(GUARDS) for k in range(DEGREE + 1)},
        modes=[Mode(f"m{m}", field) for m in range(modes)],
        transitions=[
            Transition(
                f"m{m}",
                f"m{(m + 1) % modes}",
                Guard(guard(i), directions[i]),
                Reset(count(i)),
                name=f"g{i} in m{m}",
            )
            for m in range(modes)
            for i in range(GUARDS)
        ],
    )


def counted(directions, kind, modes, solver, factors):
    """The counters at the end, and what they should be; ``factors`` are a leading one and the roots."""
    parameters, expected = {}, []
    for i, (leading, roots) in enumerate(factors):
        coefficients = np.zeros(DEGREE + 1)
        coefficients[: len(roots) + 1] = leading * np.atleast_1d(np.poly(roots))[::-1]
        parameters |= {f"a{i}{k}": float(c) for k, c in enumerate(coefficients)}
        # The sign beyond each root.
        signs = np.sign(leading) * (-1.0) ** np.arange(len(roots) - 1, -1, -1)
        expected.append(int(np.sum((directions[i] == 0) | (signs == directions[i]))))
    system = counting(directions, kind, modes)
    arc = simulate(
        system,
        np.zeros(DEGREE + GUARDS),
        (0.0, 2.0),
        mode="m0",
        parameters=parameters,
        solver=SOLVERS[solver],
    )
    return arc.x[-1, DEGREE:].astype(int).tolist(), expected


@st.composite
def close_roots(draw):
    """Roots on a coarse grid, the same for all guards; most are off by 1e-16 to 1e-10."""
    grid = draw(st.lists(st.integers(1, 15), min_size=2, max_size=5, unique=True))
    factors = []
    for _ in range(GUARDS):
        places = draw(st.lists(st.sampled_from(grid), max_size=DEGREE, unique=True))
        off = [draw(st.sampled_from((-1, 0, 1))) * 10.0 ** draw(st.floats(-16.5, -10)) for _ in places]
        roots = [place / 8 + shift for place, shift in zip(places, off, strict=True)]
        if roots and len(roots) < DEGREE and draw(st.booleans()):
            roots.append(roots[0] + draw(st.sampled_from((-1, 1))) * draw(st.floats(0.02, 0.1)))
        leading = draw(st.sampled_from((-1, 1))) * 10.0 ** draw(st.floats(-2, 2))
        factors.append((leading, sorted(roots)))
    return factors


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("directions", "kind", "modes"),
    [
        ((1, -1, 0), "affine", 1),
        ((-1, 1, 1), "affine", 2),
        ((1, 1, -1), "bent", 1),
        ((-1, -1, 0), "bent", 2),
        ((1, -1, 1), "time", 1),
        ((0, 1, -1), "time", 2),
    ],
)
@settings(max_examples=25, deadline=None)
# A guard that has fired, and changes sides both ways on a step which another event ends at its start.
@example([(1.0, [1.25]), (-1.0, [1.25, 1.276, 1.375]), (-1.0, [])])
# A root at the end of the part of the step that brackets another root.
@example([(1.0, [1.4004858407931906, 1.5, 1.875]), (1.0, []), (1.0, [])])
# The step to one guard passes another by more than rounding.
@example([(1.0, [0.5, 1.0]), (-1.0, [1.0, 1.1]), (-1.0, [1.0, 1.1])])
# The slope is so flat that the rounding of the terms is more than that of the state and the time.
@example([(1.0, []), (-0.3, [0.375, 0.40044302797253795, 0.5]), (-0.3, [0.375, 0.40044302797253795, 0.5])])
# A guard that has just fired is within its rounding still when the next one fires.
@example([(1.0, [0.4999999999, 0.6249999999999684]), (-1.0, [0.62499999999999]), (-1.0, [])])
@given(close_roots())
def test_every_change_of_sign_fires_once(directions, kind, modes, solver, factors):
    got, expected = counted(directions, kind, modes, solver, factors)
    assert got == expected
