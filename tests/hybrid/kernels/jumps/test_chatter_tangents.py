"""Tangent maps of complete chatters: duration, restitution and impulse depend on the state, in any units."""

import mpmath as mp
import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate
from tests.hybrid.exact import derivative_of

NAMES = ("q", "v", "w", "r", "k", "z")
UNITS = {f"u{name}": 1.0 for name in NAMES} | {"u": 1.0}
SOLVERS = {
    "Taylor": (Taylor(), 1e-9),
    "DOP853": (DOP853(rtol=1e-10, atol=1e-300), 1e-8),
    "RadauIIA": (RadauIIA(rtol=1e-10, atol=1e-300), 1e-7),
}


def in_units(rates, x, p):
    """Rates of the states measured in units, from rates without units."""
    values = [getattr(x, name) / getattr(p, f"u{name}") for name in NAMES]
    return tuple(
        rate * getattr(p, f"u{name}") / p.u for name, rate in zip(NAMES, rates(*values, p), strict=True)
    )


def fly(q, v, w, r, k, z, p):
    return v, -w, 0.0, 0.0, 0.0, p.a * v + p.b


def rest(q, v, w, r, k, z, p):
    return 0.0, 0.0, p.f * z, 0.0, 0.0, p.d


# A ball under the pull ``w`` with the restitution ``r``; each impact kicks ``z`` by ``k`` times its speed.
BALL = HybridSystem(
    state=NAMES,
    parameters=dict.fromkeys("abdf", 0.0) | UNITS,
    modes=[
        Mode("fly", lambda t, x, p: in_units(fly, x, p)),
        Mode("rest", lambda t, x, p: in_units(rest, x, p)),
    ],
    transitions=[
        Transition(
            "fly",
            "fly",
            Guard(lambda t, x, p: x.q, -1),
            Reset(
                lambda t, x, p: (
                    0.0, -x.r / p.ur * x.v, x.w, x.r, x.k, x.z + p.uz * x.k / p.uk * x.v / p.uv,
                )
            ),
            accumulates_to="rest",
        )
    ],
)  # fmt: skip


def exact(x, p, t1):
    """The state at ``t1``, after infinitely many impacts."""
    q, v, w, r, k, z = x
    speed = mp.sqrt(v * v + 2 * w * q)
    limit = (v + speed) / w + 2 * r * speed / (w * (1 - r))
    z += p["b"] * limit - p["a"] * q - k * speed / (1 - r)
    left = t1 - limit
    return [mp.mpf(0), mp.mpf(0), w + p["f"] * (z * left + p["d"] * left**2 / 2), r, k, z + p["d"] * left]


def balls(count):
    rng = np.random.default_rng(4)
    for _ in range(count):
        p = {name: float(rng.normal() * (rng.random() < 0.7)) for name in "abdf"}
        if rng.random() < 0.3:
            p["d"] = p["b"]
        x0 = (
            rng.uniform(0.1, 1),
            rng.normal(),
            rng.uniform(0.5, 2),
            rng.uniform(0.05, 0.92),
            *rng.normal(size=2),
        )
        q, v, w, r = x0[:4]
        speed = np.sqrt(v * v + 2 * w * q)
        t1 = ((v + speed) / w + 2 * r * speed / (w * (1 - r))) * rng.uniform(1.1, 2.0)
        yield p, np.array(x0), float(t1), 10.0 ** rng.uniform(-8, 8, len(NAMES)), 10.0 ** rng.uniform(-8, 8)


@pytest.mark.parametrize(("solver", "accuracy"), SOLVERS.values(), ids=SOLVERS)
def test_tangent_map(solver, accuracy):
    for p, x0, t1, units, unit in balls(40):
        measured = {f"u{name}": value for name, value in zip(NAMES, units, strict=True)} | {"u": unit}
        arc = simulate(
            BALL,
            units * x0,
            (0.0, t1 * unit),
            mode="fly",
            parameters=p | measured,
            tangent=True,
            solver=solver,
        )
        assert arc.status.code.name == "SUCCESS"
        assert arc.mode[-1] == "rest"
        with mp.workdps(30):
            end = [float(value) for value in exact([mp.mpf(value) for value in x0], p, mp.mpf(t1))]
        size = max(1.0, np.abs(end).max())
        np.testing.assert_allclose(arc.x[-1] / units, end, rtol=0, atol=1e-10 * size)
        wanted = derivative_of(exact, x0, p, t1)
        found = arc.fundamental / units[:, None] * units
        np.testing.assert_allclose(
            found, wanted, rtol=0, atol=accuracy * np.abs(wanted).max(), err_msg=str(x0)
        )
