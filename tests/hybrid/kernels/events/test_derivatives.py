"""Guards with flat roots: each fires once, however rounding falls beside it."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate

POWERS = {"cube": lambda z: z**3, "signed square": lambda z: z * np.abs(z), "fifth power": lambda z: z**5}
SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}
END, DRAWS = 10.0, 100


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
