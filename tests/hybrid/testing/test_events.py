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
from models import bouncing_ball

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


class TestSides:
    """A ball below the ground, by a share of what is allowed between two events."""

    def checked(self, depth, **options):
        case = case_of(bouncing_ball(), "flight", (1.0, 0.0), 0.3, **options)
        check_sides(self.below(case, np.array([-depth * 1e-7 * case.run.scale[0], 0.0])))

    @staticmethod
    def below(case, x):
        run = case.run

        class Arc:
            jumps = run.arc.jumps

            def __call__(self, t):
                return x

        object.__setattr__(case, "run", SimpleNamespace(arc=Arc(), t1=run.t1, scale=run.scale))
        return case

    def test_beyond_a_guard_by_more_than_rounding(self):
        self.checked(0.9)
        with pytest.raises(PropertyError, match="goes below zero"):
            self.checked(1.1)

    def test_a_guard_that_may_be_passed(self):
        with pytest.raises(UnsatisfiedAssumption, match="no guard has a direction"):
            self.checked(1e6, passable=("bounce",))

    def test_a_ground_that_moves_fast(self):
        """Rounding of the time counts, as a share of the stretch: the ground falls by 1000 per unit."""
        system = HybridSystem(
            state=("q", "v"),
            modes=[Mode("up", lambda t, x, p: (x.v, 0.0))],
            transitions=[
                Transition(
                    "up",
                    "up",
                    Guard(lambda t, x, p: x.q + 1000.0 * t, -1),
                    Reset(lambda t, x, p: (x.q, -x.v)),
                    name="ground",
                )
            ],
        )
        case = Case(system, {}, "up", (1.0, 1.0), 0.0, 2.0)
        allowed = 1e-7 * (case.run.scale[0] + 1000.0 * 2.0)

        class Arc:
            jumps = case.run.arc.jumps

            def __call__(self, t):
                return np.array([-1000.0 * t - depth, 1.0])

        run = SimpleNamespace(arc=Arc(), t1=2.0, scale=case.run.scale)
        object.__setattr__(case, "run", run)
        depth = 0.9 * allowed
        check_sides(case)
        depth = 1.1 * allowed
        with pytest.raises(PropertyError, match="goes below zero"):
            check_sides(case)


@pytest.mark.parametrize("t0", [-7.0, 0.0, 5.0])
def test_durations_do_not_depend_on_when_a_run_begins(t0):
    case = attrs.evolve(case_of(), t0=t0, t1=t0 + 3.5)
    assert case.duration == 3.5
    check_jumps(case)
