"""Checks of events find each wrong part of a jump, and accept differences as small as rounding."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

import hybrid.testing.events as events
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError, check_jumps, check_sides
from hybrid.testing.case import Case

# A crossing at a right angle to time, up and down, and a mode that is left through a guard in time.
CLOCK = HybridSystem(
    state=("x", "y"),
    modes=[
        Mode("up", lambda t, x, p: (1.0, 0.0)),
        Mode("down", lambda t, x, p: (-2.0, 0.0)),
    ],
    transitions=[
        Transition("up", "down", Guard(lambda t, x, p: x.x - 1.0, +1), name="high"),
        Transition(
            "down", "up", Guard(lambda t, x, p: x.x, -1), Reset(lambda t, x, p: (x.x, x.y + 1.0)), name="low"
        ),
    ],
)


def case_of(system=CLOCK, mode="up", x0=(0.25, 0.0), t1=3.5, **options):
    return Case(system, dict(system.parameters), mode, np.array(x0), 0.0, t1, **options)


def with_run(case, jumps=None, **changes):
    """The case with jumps, or the places between them, in place of those of its run."""
    run = case.run
    jumps = [*run.arc.jumps] if jumps is None else jumps

    class Jumps(list):
        t = np.array([jump.t for jump in jumps])

    arc = SimpleNamespace(jumps=Jumps(jumps), **changes)
    object.__setattr__(case, "run", SimpleNamespace(arc=arc, t1=run.t1, scale=run.scale))
    return case


def told(check, case):
    with pytest.raises(PropertyError) as caught:
        check(case)
    return str(caught.value)


def test_the_run_is_right():
    case = case_of()
    assert [jump.transition for jump in case.run.arc.jumps] == ["high", "low", "high", "low"]
    np.testing.assert_allclose(case.run.arc.jumps.t, [0.75, 1.25, 2.25, 2.75])
    check_jumps(case)
    check_jumps(with_run(case))
    check_sides(case_of())


@pytest.mark.parametrize("which", [0, 1, 3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
class TestJumps:
    def changed(self, which, **changes):
        case = case_of()
        jumps = [*case.run.arc.jumps]
        jumps[which] = attrs.evolve(jumps[which], **changes)
        return with_run(case, jumps)

    def test_an_event_beside_its_guard(self, which, sign):
        """The band is 1e-9 of the state's size and of the guard's speed over the run."""
        jump = case_of().run.arc.jumps[which]
        scale, speed = case_of().run.scale[0], abs(jump.transversality)
        band = 1e-9 * (scale + 3.5 * speed)
        for share, wrong in ((0.9, False), (1.1, True)):
            moved = np.array([sign * share * band, 0.0])
            case = self.changed(which, x_minus=jump.x_minus + moved, x_plus=jump.x_plus + moved)
            if wrong:
                assert "not zero" in told(check_jumps, case)
            else:
                check_jumps(case)

    def test_a_guard_that_moves_the_other_way(self, which, sign):
        jump = case_of().run.arc.jumps[which]
        if sign > 0:
            assert "wrong direction" in told(
                check_jumps, self.changed(which, transversality=-jump.transversality)
            )
        else:
            check_jumps(self.changed(which, transversality=0.0 * jump.transversality))

    def test_a_state_that_is_moved_after_the_reset(self, which, sign):
        jump, scale = case_of().run.arc.jumps[which], case_of().run.scale
        for component in (0, 1):
            size = abs(jump.x_plus[component]) + scale[component]
            for share, wrong in ((0.9, False), (1.1, True)):
                moved = np.zeros(2)
                moved[component] = sign * share * 1e-12 * size
                case = self.changed(which, x_plus=jump.x_plus + moved)
                if wrong:
                    assert "the value of the reset" in told(check_jumps, case)
                else:
                    check_jumps(case)

    def test_a_jump_from_another_mode(self, which, sign):
        other = {"up": "down", "down": "up"}[case_of().run.arc.jumps[which].source]
        assert "the mode was" in told(check_jumps, self.changed(which, source=other))


def test_a_landing_beyond_a_guard_fires_at_the_same_instant_only():
    case = case_of()
    first, second, *_ = case.run.arc.jumps
    # At the instant of the first jump, far below zero: as after a reset.
    beyond = np.array([-0.5, 0.0])

    def after(x):
        return np.array([x[0], x[1] + 1.0])

    late = attrs.evolve(second, t=first.t, x_minus=beyond, x_plus=after(beyond), transversality=1.0)
    check_jumps(with_run(case_of(), [first, late]))
    before = attrs.evolve(late, x_minus=-beyond, x_plus=after(-beyond), transversality=-2.0)
    assert "not zero" in told(check_jumps, with_run(case_of(), [first, before]))
    later = attrs.evolve(late, t=first.t + 1e-6)
    assert "not zero" in told(check_jumps, with_run(case_of(), [first, later]))


def test_a_guard_that_jumps_itself_fires_where_its_sign_changes():
    """``sign(t - 1)`` is never zero beside 1; ``1`` is no crossing."""
    for below, right in ((-1.0, True), (1.0, False)):
        switch = Guard(lambda t, x, p, below=below: np.where(t < 1.0, below, 1.0), +1)
        system = HybridSystem(
            state=("x",),
            modes=[Mode("on", lambda t, x, p: (1.0,))],
            transitions=[Transition("on", "on", switch, name="switch")],
        )
        case = Case(system, {}, "on", np.array([0.0]), 0.0, 2.0)
        jump = SimpleNamespace(t=1.0, x_minus=np.array([1.0]), source="on", transition="switch")
        object.__setattr__(case, "run", SimpleNamespace(t1=2.0))
        assert events._guard_jumps(case, jump) == right


def membrane(guard=lambda t, x, p: x.q):
    """A mass on a spring that is slowed by a membrane, and goes on beyond it."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("free", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition(
                "free", "free", Guard(guard, -1), Reset(lambda t, x, p: {"v": 0.5 * x.v}), name="membrane"
            )
        ],
    )


def test_a_mode_does_not_go_on_beyond_its_guard():
    case = Case(membrane(), {}, "free", (1.0, 0.0), 0.0, 3.0)
    assert "guard of 'membrane', which ends mode 'free' where it goes below zero" in told(check_sides, case)
    with pytest.raises(UnsatisfiedAssumption, match="no guard has a direction"):
        check_sides(attrs.evolve(case, passable=("membrane",)))


def test_a_guard_of_time_alone_is_no_wall():
    """The clock is negative for half of its period, wherever the state is."""
    clock = membrane(lambda t, x, p: np.sin(2.0 * t) + 1e-9)
    with pytest.raises(UnsatisfiedAssumption, match="no guard has a direction"):
        check_sides(Case(clock, {}, "free", (1.0, 0.0), 0.0, 9.0))


@pytest.mark.parametrize("t0", [-7.0, 0.0, 5.0])
def test_durations_do_not_depend_on_when_a_run_begins(t0):
    case = attrs.evolve(case_of(), t0=t0, t1=t0 + 3.5)
    assert case.duration == 3.5
    check_jumps(case)
