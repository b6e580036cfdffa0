"""Guards of several forms, reached almost together on a known oscillation, and resets that count."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, RadauIIA, Taylor, Tsit5, simulate
from tests.hybrid.kernels.events.counting import counting

FORMS = {
    "q": lambda q, v, t: q,
    "v": lambda q, v, t: v,
    "product": lambda q, v, t: q * v,
    "exponential": lambda q, v, t: np.exp(q),
    "sine": lambda q, v, t: np.sin(2 * q + v),
    "time": lambda q, v, t: np.sin(3 * t),
    "cubic": lambda q, v, t: q**3 + 0.2 * v,
}
SOLVERS = {
    "Taylor": Taylor(),
    "DOP853": DOP853(),
    "Tsit5": Tsit5(rtol=1e-9, atol=1e-11),
    "RadauIIA": RadauIIA(),
}
END = 20.0
TIMES = np.linspace(0.0, END, 200_001)


@cache
def counters(forms, directions, modes):
    """Each crossing of ``a (form - level)`` is counted and, with two modes, leads to the other mode."""

    def guard(i):
        form = FORMS[forms[i]]
        return lambda t, x, p: p[2 * i] * (form(x[0], x[1], t) - p[2 * i + 1])

    guards = [guard(i) for i in range(len(forms))]
    parameters = {f"{kind}{i}": 1.0 for i in range(len(forms)) for kind in ("a", "level")}
    return counting(("q", "v"), lambda t, x, p: (x.v, -x.q), guards, directions, modes, parameters)


def crossings(form, factor, level, direction, motion):
    """How often a guard changes its sign in a direction along the motion."""
    signs = np.sign(factor * (FORMS[form](*motion(TIMES), TIMES) - level))
    up, down = np.sum(np.diff(signs) > 0.0), np.sum(np.diff(signs) < 0.0)
    return int({1: up, -1: down, 0: up + down}[direction])


def check_counts(forms, directions, modes, guards, size, phase, solver):
    """Each guard, given by its factor and level, fires as often as it crosses in its direction."""

    def motion(t):
        return size * np.sin(t + phase), size * np.cos(t + phase)

    system = counters(forms, directions, modes)
    start = [*motion(0.0), *[0.0] * len(forms)]
    parameters = dict(zip(system.parameters, np.ravel(guards), strict=True))
    arc = simulate(
        system, start, (0.0, END), mode="mode 0", parameters=parameters, solver=SOLVERS[solver], samples=[END]
    )
    expected = [
        crossings(*each, motion) for each in zip(forms, *np.transpose(guards), directions, strict=True)
    ]
    assert arc.x[-1, 2:].tolist() == expected
    assert arc.status.ok


# The first was counted twice where a band of rounding became narrower; in the second, a guard that the
# landing on another had passed fired again.
@pytest.mark.parametrize(
    ("forms", "directions", "modes", "guards", "size", "phase", "solver"),
    [
        (
            ("v", "v", "product"),
            (0, 1, -1),
            2,
            [
                (0.011724756692941795, 1.2389163469945736),
                (27.850524054774432, 1.2389163469945363),
                (-10.115406619819343, -0.3363669964178904),
            ],
            1.2683164015310346,
            2.012573640966375,
            "Taylor",
        ),
        (
            ("time", "q", "time"),
            (0, 0, -1),
            1,
            [
                (2.2084207888632332, -0.8722355648451033),
                (-0.78372355877946, -0.38679164932760685),
                (38.41137753222776, -0.8722355648420661),
            ],
            0.9306264654726785,
            4.454106281801034,
            "DOP853",
        ),
    ],
)
def test_guards_that_are_reached_almost_together_fire_once_each(
    forms, directions, modes, guards, size, phase, solver
):
    check_counts(forms, directions, modes, guards, size, phase, solver)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("modes", [1, 2])
def test_two_forms_at_any_distance(modes, solver):
    """The product is reached 1e-15 to 1e-6 before or after the position, whatever comes first."""
    rng = np.random.default_rng(11)
    for _ in range(30):
        size, phase, place = rng.uniform(0.5, 1.5), rng.uniform(0.2, 0.6), rng.uniform(1.7, 2.3)
        levels = []
        for form in ("q", "product"):
            time = place + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-15.0, -6.0)
            q, v = size * np.sin(time + phase), size * np.cos(time + phase)
            levels.append((rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2, 2), FORMS[form](q, v, time)))
        check_counts(("q", "product"), (0, 1), modes, levels, size, phase, solver)
