"""The law of clocks finds ticks that are lost, early or doubled."""

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import After, At, Every, HybridSystem, Mode, Reset, Transition
from hybrid.testing import Case, Engine, PropertyError, check_ticks


def system_of(*clocks):
    add = Reset(lambda t, x, p: {"n": x.n + 1.0})
    return HybridSystem(
        state=("n",),
        parameters={"T": 0.3},
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[Transition("m", "m", clock, add, name=f"tick {i}") for i, clock in enumerate(clocks)],
    )


class Other(Engine):
    """Runs another system in the place of the one that is asked for."""

    def __init__(self, *clocks):
        self.other = system_of(*clocks)

    def simulate(self, system, x0, t_span, **options):
        return hybrid.simulate(self.other, x0, t_span, **options)


def judged(engine, *clocks):
    system = system_of(*clocks)
    check_ticks(Case(system, system.parameters, "m", (0.0,), 0.0, 1.0, engine=engine))


@pytest.mark.parametrize(
    "clocks",
    [[Every("T", offset=0.1)], [At([0.5, 0.2, 0.5])], [After("T")], [Every(0.2), At([0.4]), After(0.25)]],
)
def test_clocks_that_are_right_pass(clocks):
    judged(Engine(), *clocks)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        (Every("T"), Every(0.6), "ticks at t = 0.3, and no jump is there"),
        (Every("T"), Every("T", offset=0.01), "the next tick is at t = 0.3|ticks at t = 0.3, and no jump"),
        (At([0.2, 0.5]), At([0.5, 0.5]), "ticks at t = 0.2, and no jump"),
        (At([0.5]), At([0.5, 0.7]), "the next tick is at t = inf"),
        (After("T"), After(0.2), "the next tick is at t = 0.3"),
        (After("T"), After(0.5), "ticks at t = 0.3, and no jump"),
    ],
)
def test_wrong_ticks_are_found(right, wrong, message):
    with pytest.raises(PropertyError, match=message):
        judged(Other(wrong), right)


def test_a_tick_that_fires_twice_is_found():
    """The jumps of two clocks, told as those of one."""

    class Doubled(Engine):
        def simulate(self, system, x0, t_span, **options):
            arc = hybrid.simulate(system_of(Every("T"), Every("T")), x0, t_span, **options)
            told = attrs.evolve(arc.jumps, system=system, transition=np.zeros(len(arc.jumps), dtype=int))
            arc.__dict__["_jumps"] = told
            return arc

    with pytest.raises(PropertyError, match="it has fired at this instant"):
        judged(Doubled(), Every("T"))
