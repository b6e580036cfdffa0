"""Guards that the flow reaches almost together: each fires once, at its own zero."""

import itertools
from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

METHODS = {
    f"{kind.__name__} {rtol:g}": kind(rtol=rtol, atol=rtol / 100)
    for kind in (Taylor, DOP853, Tsit5, RadauIIA)
    for rtol in (1e-4, 1e-10)
}
VALUES = {
    "q": lambda t, x: x.q,
    "v": lambda t, x: x.v,
    "falling time": lambda t, x: -t,
    "bent": lambda t, x: np.exp(x.v + 0.3 * x.q),
    "product": lambda t, x: x.q * (3 - x.z) + x.v,
}


def swing(t, x, p):
    return x.v, -2 * np.sin(x.q), 0.3 * np.cos(x.q) - 0.2 * x.z


@cache
def modes_of_subsets(kinds):
    """A mode for each set of guards crossed so far; every guard falls along ``swing``."""
    subsets = [s for size in range(len(kinds) + 1) for s in itertools.combinations(range(len(kinds)), size)]

    def guard(i):
        return Guard(lambda t, x, p: VALUES[kinds[i]](t, x) - getattr(p, f"c{i}"), -1)

    def name(subset):
        return "crossed " + "".join(map(str, sorted(subset)))

    return HybridSystem(
        state=("q", "v", "z"),
        parameters={f"c{i}": 0.0 for i in range(len(kinds))},
        modes=[Mode(name(subset), swing) for subset in subsets],
        transitions=[
            Transition(name(subset), name((*subset, i)), guard(i), name=f"{i} in {name(subset)}")
            for subset in subsets
            for i in range(len(kinds))
            if i not in subset
        ],
    )


PLAIN = HybridSystem(state=("q", "v", "z"), modes=[Mode("swing", swing)])


def levels(kinds, rng):
    """A start, and levels that the guards reach within 1e-16 to 1e-5 of one instant."""
    start = (rng.uniform(0.5, 1.5), 0.0, 0.0)
    arc = simulate(PLAIN, start, (0.0, rng.uniform(0.3, 0.9)), solver=DOP853(rtol=1e-13, atol=1e-15))
    there = type("State", (), dict(zip("qvz", arc.x[-1], strict=True)))
    apart = rng.choice([-1.0, 0.0, 1.0], size=len(kinds)) * 10 ** rng.uniform(-16, -5, size=len(kinds))
    return start, {f"c{i}": VALUES[kind](arc.t[-1], there) + apart[i] for i, kind in enumerate(kinds)}


@cache
def drawn(kinds):
    rng = np.random.default_rng(7)
    return [levels(kinds, rng) for _ in range(25)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "kinds", [("q", "v"), ("falling time", "v"), ("product", "bent"), ("q", "v", "falling time", "bent")]
)
def test_each_guard_fires_once(kinds, method):
    system = modes_of_subsets(kinds)
    for start, parameters in drawn(kinds):
        arc = simulate(
            system, start, (0.0, 1.0), mode="crossed ", parameters=parameters, solver=METHODS[method]
        )
        assert sorted(str(name)[0] for name in arc.jumps.transition) == [str(i) for i in range(len(kinds))]
        assert arc.status.ok
        for jump in arc.jumps:
            i = int(jump.transition[0])
            there = type("State", (), dict(zip("qvz", jump.x_minus, strict=True)))
            # Landings on the guard that is crossed second would leave the first one 1e-5 off zero.
            assert abs(VALUES[kinds[i]](jump.t, there) - parameters[f"c{i}"]) < 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_so_do_counters_in_one_mode(method):
    def counter(kind, level, reset):
        guard = Guard(lambda t, x, p: x[kind] - getattr(p, level), -1)
        return Transition("m", "m", guard, Reset(reset), name=level)

    system = HybridSystem(
        state=4,
        parameters={"c0": 0.0, "c1": 0.0},
        modes=[Mode("m", lambda t, x, p: (x[1], -2 * np.sin(x[0]), 0.0, 0.0))],
        transitions=[
            counter(0, "c0", lambda t, x, p: (x[0], x[1], x[2] + 1, x[3])),
            counter(1, "c1", lambda t, x, p: (x[0], x[1], x[2], x[3] + 1)),
        ],
    )
    rng = np.random.default_rng(8)
    for _ in range(25):
        start, parameters = levels(("q", "v"), rng)
        arc = simulate(system, (*start[:2], 0, 0), (0.0, 1.0), parameters=parameters, solver=METHODS[method])
        assert arc.x[-1, 2:].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("method", METHODS)
def test_tanks_that_run_dry_together_are_all_dry(method):
    """The first feeds the second, which is nearly empty all the time; both are empty at once."""

    def outflow(level):
        return np.sqrt(np.maximum(level, 0.0))

    def below(i):
        return Guard(lambda t, x, p: x[i], -1)

    def only(i):
        return Reset(lambda t, x, p: (x[0], 0.0) if i == 1 else (0.0, x[1]))

    system = HybridSystem(
        state=2,
        parameters={"wide": 2.0},
        modes=[
            Mode("both", lambda t, x, p: (-outflow(x[0]), outflow(x[0]) - p.wide * outflow(x[1]))),
            Mode("second", lambda t, x, p: (0.0, -p.wide * outflow(x[1]))),
            Mode("first", lambda t, x, p: (-outflow(x[0]), 0.0)),
            Mode("dry", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("both", "second", below(0), only(0)),
            Transition("both", "first", below(1), only(1)),
            Transition("second", "dry", below(1), only(1)),
            Transition("first", "dry", below(0), only(0)),
        ],
    )
    for wide in (1.7, 2.0, 3.0):
        arc = simulate(
            system, (1.0, 0.3), (0.0, 5.0), mode="both", parameters={"wide": wide}, solver=METHODS[method]
        )
        assert arc.mode[-1] == "dry"
        # Both are empty at 2, the second perhaps to the tolerances before. Steps in time do not know when to
        # the tolerances; series do.
        solver = METHODS[method]
        if isinstance(solver, Taylor):
            assert arc.status.ok
            last = arc.jumps.t[0] if wide < 2.0 else arc.jumps.t[-1]
            assert last == pytest.approx(2.0, abs=10.0 * solver.rtol)
        else:
            assert arc.jumps.t[0] == pytest.approx(2.0, abs=10.0 * np.sqrt(solver.atol))
