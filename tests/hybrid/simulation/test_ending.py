"""The status reports the effect of a grazing on tangent vectors."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    from_equations,
    simulate,
)


def parabola(depth):
    """``q = (t - 1)^2 - depth``: a dip of that depth below the guard, with a kick at the guard."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
        transitions=[
            Transition(
                "fall", "fall", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, x.v + 1.0))
            )
        ],
    )
    return system, (1.0 - depth, -2.0)


@pytest.mark.parametrize("depth", [1e-4, 1e-6])
def test_a_transverse_crossing_is_not_remarked_upon(depth):
    system, x0 = parabola(depth)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "transverse"
    assert arc.status.message == "Reached the end."


def test_a_crossing_within_the_tolerances_is():
    system, x0 = parabola(1e-11)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "grazing"
    assert arc.status.ok
    assert "1 of 1 jumps grazed within the tolerances" in arc.status.message


def test_the_saltation_grows_like_the_inverse_root_of_the_depth():
    depths = 10.0 ** np.arange(-8, -1)
    sizes = []
    for depth in depths:
        system, x0 = parabola(depth)
        sizes.append(np.abs(simulate(system, x0, (0.0, 1.5)).jumps[0].saltation).max())
    assert np.polyfit(np.log(depths), np.log(sizes), 1)[0] == pytest.approx(-0.5, abs=0.02)


def parabola_then_corner(depth):
    """The parabola, and a puck in a corner at ``t = 1.5``: one wall doubles ``v``, the other adds one."""

    def kick(name, guard, reset):
        return Transition("fall", "fall", Guard(guard, -1), Reset(reset), name=name)

    system = HybridSystem(
        state=("q", "v", "x", "y", "a", "b"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0, x.a, x.b, 0.0, 0.0))],
        transitions=[
            kick("floor", lambda t, x, p: x.q, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, x.b)),
            kick("left", lambda t, x, p: x.x, lambda t, x, p: (x.q, x.v * 2, x.x, x.y, -x.a, x.b)),
            kick("bottom", lambda t, x, p: x.y, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, -x.b)),
        ],
    )
    return system, (1.0 - depth, -2.0, 1.5, 1.5, -1.0, -1.0)


@pytest.mark.parametrize(("depth", "grazed"), [(1e-4, False), (1e-11, True)])
def test_an_order_that_mattered_outranks_a_grazing_and_counts_it(depth, grazed):
    system, x0 = parabola_then_corner(depth)
    arc = simulate(system, x0, (0.0, 2.0), tangent=True)
    assert [jump.kind for jump in arc.jumps] == ["grazing" if grazed else "transverse", *["transverse"] * 2]
    assert arc.status.code == StatusCode.AMBIGUOUS_ORDER
    assert ("Besides, 1 of 3 jumps grazed within the tolerances." in arc.status.message) == grazed


def ended(recent, jumps):
    """A run that has made so many jumps, of which it remembers the last."""
    return SimpleNamespace(jumps=jumps, run=SimpleNamespace(recent=np.array(recent)))


LAWS = {
    "number": lambda t, x, p: (-(x.h**0.9),),
    "parameter": lambda t, x, p: (-(x.h**p.a),),
    "both sides": lambda t, x, p: (-np.sign(x.h) * np.abs(x.h) ** 0.9,),
}
SOLVERS = [Taylor(), DOP853(), Tsit5(), RadauIIA()]


def tank(law, after=None):
    """A tank that runs dry; then the run ends, or goes on in the mode ``after``."""
    return HybridSystem(
        state=("h",),
        parameters={"a": 0.9},
        modes=[Mode("drain", law), *([Mode(after, lambda t, x, p: (0.0,))] if after else [])],
        transitions=[Transition("drain", after, Guard(lambda t, x, p: x.h, -1), name="dry")],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("law", LAWS)
def test_a_time_at_which_a_level_runs_dry_is_said_to_be_uncertain(law, solver):
    """The level ``(1 - t / 10)**10`` is below ``atol = 1e-12`` for the last 10 * 10**-1.2 = 0.63."""
    ended = simulate(tank(LAWS[law]), (1.0,), (0.0, 20.0), solver=solver, mode="drain")
    assert ended.status.code == StatusCode.TERMINAL
    assert ended.t[-1] == pytest.approx(10.0, abs=0.2)
    assert "The time of transition 'dry' may be off by 0.6" in ended.status.message
    went_on = simulate(tank(LAWS[law], "empty"), (1.0,), (0.0, 20.0), solver=solver, mode="drain")
    assert went_on.status.code == StatusCode.INFINITE_SLOPE
    assert "may be off by 0.6" in went_on.status.message
    early = simulate(tank(LAWS[law]), (1.0,), (0.0, 9.0), solver=solver, mode="drain")
    assert early.status.message == "Reached the end."
    assert early.x[-1, 0] == pytest.approx(1e-10, rel=0.1)


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("power", [0.25, 1 / 3, 0.45, 0.5, 0.6, 0.7, 0.8])
def test_no_level_runs_dry_at_another_time_with_success(power, solver):
    """The level is empty at ``1 / (1 - power)``; two units later it is filled and runs dry once more."""
    system = HybridSystem(
        state=("h", "since"),
        parameters={"a": power},
        modes=[
            Mode("drain", lambda t, x, p: (-(x.h**p.a), 0.0)),
            Mode("empty", lambda t, x, p: (0.0, 1.0)),
        ],
        transitions=[
            Transition("drain", "empty", Guard(lambda t, x, p: x.h, -1), Reset(lambda t, x, p: (0.0, 0.0))),
            Transition(
                "empty", "drain", Guard(lambda t, x, p: x.since - 2.0, +1), Reset(lambda t, x, p: (1.0, 0.0))
            ),
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 20.0), solver=solver, mode="drain")
    needed = 1.0 / (1.0 - power)
    true = np.cumsum([needed, 2.0] * 8)[: len(arc.jumps)]
    error = np.max(np.abs(arc.jumps.t - true))
    assert len(arc.jumps) >= 5
    if arc.status.ok:
        assert error < 1e-7
    else:
        assert arc.status.code == StatusCode.INFINITE_SLOPE
        said = float(re.search(r"may be off by (\S+):", arc.status.message)[1])
        assert error < 10.0 * said


def test_a_level_that_never_runs_dry_in_the_run_is_said_to_be_below_the_tolerance():
    arc = simulate(tank(LAWS["parameter"]), (1.0,), (0.0, 40.0), parameters={"a": 0.95}, mode="drain")
    assert arc.status.ok
    assert len(arc.jumps) == 0
    assert "The guard of 'dry' is below atol where the slope of h**a is infinite" in arc.status.message


def test_a_contact_that_is_left_with_a_speed_has_a_certain_time():
    """The damping has an infinite slope at the surface, which the mass crosses with a speed."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("contact", lambda t, x, p: (x.v, -x.q - 0.1 * np.abs(x.q) ** 0.43 * x.v))],
        transitions=[Transition("contact", None, Guard(lambda t, x, p: x.q, +1))],
    )
    arc = simulate(system, (-1.0, 0.0), (0.0, 20.0), solver=DOP853(), mode="contact")
    assert arc.status.code == StatusCode.TERMINAL
    assert "not known" not in arc.status.message


def test_a_chatter_of_plain_equations_asks_for_no_transition_that_nobody_has_written():
    """A block with friction in a groove whose side drives a third component: its rest is not unique."""
    block = from_equations(
        lambda t, x, p: (x.v, -p.g * np.sign(x.q) - p.F * np.sign(x.v), np.sign(x.q)),
        state=("q", "v", "y"),
        parameters={"g": 2.0, "F": 0.5},
    )
    q, rest, (g, F) = 1.0, 0.0, (2.0, 0.5)
    for _ in range(200):
        v = np.sqrt(2 * q * (g - F))
        rest += np.sqrt(2 * q / (g - F)) + v / (g + F)
        q = v * v / 2 / (g + F)
    arc = simulate(block, (1.0, 0.0, 0.0), (0.0, 10.0))
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(rest)
    assert "accumulates_to" not in str(arc.status)
    assert "switches in the equations" in arc.status.remedy
