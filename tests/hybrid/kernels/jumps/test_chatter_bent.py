"""Tangent maps of chatters whose guard bends and whose impulse turns: a solution in bent coordinates."""

import mpmath as mp
import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate
from tests.hybrid.exact import derivative_of

SOLVERS = {
    "Taylor": Taylor(),
    "DOP853": DOP853(rtol=1e-10, atol=1e-12),
    "RadauIIA": RadauIIA(rtol=1e-10, atol=1e-12),
}
# A flight of the height ``h`` is rounded by a share of ``1e-16 / h``, and lower flights are not followed.
ACCURACY = 3e-4
START = 0.7  # the time at the start: the coordinates depend on time


# A ball with height ``q``, speed ``v``, pull ``w`` and restitution ``r`` travels along ``z``. The wall bends:
# its height is ``wall``, and the unit of the speed is ``stretch``.
def wall(t, z, p, sin):
    return p.bend * sin(z + p.shake * t)


def stretch(t, z, p, sin):
    return 1.0 + p.turn * sin(2.0 * z + p.shake * t)


def level(t, x, p):
    return x.y - wall(t, x.z, p, np.sin)


def fly(t, x, p):
    v = x.u / stretch(t, x.z, p, np.sin)
    along = p.a * v + p.b
    rise = p.bend * np.cos(x.z + p.shake * t) * (along + p.shake)
    turn = p.turn * np.cos(2.0 * x.z + p.shake * t) * (2.0 * along + p.shake)
    return v + rise, -x.w * stretch(t, x.z, p, np.sin) + v * turn, 0.0, 0.0, along


def rest(t, x, p):
    return p.bend * np.cos(x.z + p.shake * t) * (p.d + p.shake), 0.0, 0.0, 0.0, p.d


def hit(t, x, p):
    v = x.u / stretch(t, x.z, p, np.sin)
    return wall(t, x.z, p, np.sin), -x.r * v * stretch(t, x.z, p, np.sin), x.w, x.r, x.z


BALL = HybridSystem(
    state=("y", "u", "w", "r", "z"),
    parameters=dict.fromkeys(("a", "b", "d", "bend", "turn", "shake"), 0.0),
    modes=[Mode("fly", fly), Mode("rest", rest)],
    transitions=[Transition("fly", "fly", Guard(level, -1), Reset(hit), accumulates_to="rest")],
)


class Values:
    def __init__(self, values):
        self.__dict__.update(values)


def exact(x, p, t1):
    """The state at ``t1``, after infinitely many impacts."""
    p = Values(p)
    y, u, w, r, z = x
    q, v = y - wall(START, z, p, mp.sin), u / stretch(START, z, p, mp.sin)
    speed = mp.sqrt(v * v + 2 * w * q)
    limit = (v + speed) / w + 2 * r * speed / (w * (1 - r))
    z += p.b * limit - p.a * q + p.d * (t1 - START - limit)
    return [wall(t1, z, p, mp.sin), mp.mpf(0), w, r, z]


def balls(count, shake):
    rng = np.random.default_rng(7)
    for _ in range(count):
        p = {name: float(rng.normal()) for name in ("a", "b", "d", "bend")}
        p |= {"turn": rng.uniform(-0.6, 0.6), "shake": shake * rng.normal()}
        # Without a drift along the wall the limit is known long before its tangent map.
        p["b"] *= rng.random() < 0.7
        q, v, w, r, z = rng.uniform(0.1, 1), rng.normal(), rng.uniform(0.5, 2), rng.uniform(0.05, 0.9), 0.3
        speed = np.sqrt(v * v + 2 * w * q)
        t1 = START + ((v + speed) / w + 2 * r * speed / (w * (1 - r))) * rng.uniform(1.1, 1.5)
        at = Values(p)
        y = q + wall(START, z, at, np.sin)
        yield p, np.array([y, v * stretch(START, z, at, np.sin), w, r, z]), float(t1)


@pytest.mark.parametrize("shake", [0.0, 1.0], ids=["still", "shaken"])
@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_tangent_map(solver, shake):
    for p, x0, t1 in balls(20, shake):
        arc = simulate(BALL, x0, (START, t1), mode="fly", parameters=p, tangent=True, solver=solver)
        assert arc.status.code.name == "SUCCESS"
        assert arc.mode[-1] == "rest"
        with mp.workdps(30):
            end = [float(value) for value in exact([mp.mpf(value) for value in x0], p, mp.mpf(t1))]
        np.testing.assert_allclose(arc.x[-1], end, rtol=0, atol=2e-6)
        wanted = derivative_of(exact, x0, p, t1)
        largest = ACCURACY * np.abs(wanted).max()
        np.testing.assert_allclose(arc.fundamental, wanted, rtol=0, atol=largest, err_msg=f"{p}, {x0}")
