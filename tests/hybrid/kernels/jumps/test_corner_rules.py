"""One instant, rule by rule: what fires on entry, at the end of a run, and where several are reached."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.onset import BY_SPEED, BY_STEP
from hybrid.kernels.events.resolution import NOT_KNOWN
from hybrid.kernels.events.sides import FLOWED, LANDED, STARTED
from hybrid.kernels.jumps import corner
from hybrid.kernels.jumps.corner import MOST_JUMPS
from hybrid.kernels.types.codes import NO_MODE, NO_TRANSITION, RESTING, STALE
from tests.hybrid.kernels.plain import plain


def never(*given):
    raise AssertionError(given)


class TestEnter:
    """Mode 2 is entered at the time 7."""

    def entered(self, fires, *, left=NO_MODE, excluded=NO_TRANSITION, steps=0, jumps=0, order=0):
        asked = {}

        def take_sides(model, run, mode, t, x, came, left, fired, side, due, zero, work):
            assert (mode, t, x, side, due, zero) == (2, 7.0, "y", "side", "due", run.on_guard)
            asked["came"] = (came, left, fired)
            return fires

        def count(name, answer=None):
            def stub(*given):
                asked[name] = asked.get(name, 0) + 1
                return answer

            return stub

        model = SimpleNamespace(field=count("field"), parameters=None)
        run = SimpleNamespace(
            mode=2, phase=7.0, y="y", side="side", due="due", on_guard=[0] * 4 + [order], locked=9
        )
        run.previous_mode, run.steps, run.jumps, run.last_fired = left, steps, jumps, 3
        tested = plain(
            corner,
            take_sides=take_sides,
            beyond_at_start=count("beyond", excluded),
            widen_scale=count("widen"),
            end_instant=count("end"),
        )
        found = tested.enter(model, run, SimpleNamespace(field=None))
        return found, run.locked, asked

    def test_the_start_of_a_run(self):
        found, locked, asked = self.entered(NO_TRANSITION)
        assert (found, locked) == (NO_TRANSITION, 0)
        assert asked == {
            "came": (STARTED, NO_MODE, NO_TRANSITION),
            "field": 1,
            "widen": 1,
            "beyond": 1,
            "end": 1,
        }
        # Later the scales are known.
        asked = self.entered(NO_TRANSITION, steps=1)[2]
        assert "field" not in asked
        assert "widen" not in asked

    def test_a_landing(self):
        found, locked, asked = self.entered(NO_TRANSITION, left=0, jumps=1)
        assert (found, locked) == (NO_TRANSITION, 0)
        assert asked == {"came": (LANDED, 0, 3), "field": 1, "widen": 1, "end": 1}
        # A run that goes on from another one has fired nothing yet.
        assert self.entered(NO_TRANSITION, left=0)[2]["came"] == (LANDED, 0, NO_TRANSITION)

    def test_what_fires_is_locked_to_the_instant_if_it_is_not_on_its_guard(self):
        for order, locked in ((0, 1), (BY_SPEED, 0), (BY_STEP, 0)):
            found = self.entered(4, left=0, jumps=1, order=order)
            assert found[:2] == (4, locked)
            assert "end" not in found[2]
        found = self.entered(RESTING, left=0, jumps=1)
        assert found[:2] == (RESTING, 0)
        assert found[2]["end"] == 1

    def test_the_first_transition_is_one_as_well(self):
        found, locked, asked = self.entered(0, left=1, jumps=1)
        assert (found, locked, "end" in asked) == (0, 1, False)

    def test_what_fires_only_at_a_start_comes_first(self):
        for fires in (NO_TRANSITION, 4):
            found, locked, asked = self.entered(fires, excluded=1)
            assert (found, locked, "end" in asked) == (1, 1, False)


class TestArrived:
    """The second of three modes has the guards 1 and 2; the run ends with a state of -3 and 4."""

    def arrived(
        self,
        *found,
        sides=(-1, -1),
        on_guard=(0, 0),
        directions=(1, 1),
        jumps=False,
        left_behind=False,
        underflow=(),
        refused=(),
    ):
        asked = []

        def side_of(model, run, mode, transition, t, x, before, was_on, work):
            # Scales are those of a run that starts here.
            assert run.scale.tolist() == [6.0, 8.0]
            assert (mode, t, was_on, x is run.y) == (1, 7.0, False, True)
            asked.append((transition, before))
            return found[transition - 1]

        def widen_scale(model, run, work):
            assert run.scale.tolist() == [3.0, 4.0]
            run.scale *= 2.0

        model = SimpleNamespace(
            dimension=2,
            parameters=None,
            field=lambda *given: None,
            first_outgoing=np.array([0, 1, 3, 4]),
            outgoing=np.array([0, 1, 2, 3]),
            direction=np.array([9, *directions, 9]),
        )
        run = SimpleNamespace(mode=1, phase=7.0, y=np.array([-3.0, 4.0]), scale=np.array([5.0, 50.0]))
        run.side, run.on_guard = np.array([9, *sides, 9]), np.array([9, *on_guard, 9])
        run.rehearsal = np.full((4, 4), 5)
        work = SimpleNamespace(settled=np.zeros(2), field=None, gradient=None, scalar=None)
        tested = plain(
            corner,
            task_of=lambda task: task,
            side_of=side_of,
            widen_scale=widen_scale,
            underflows=lambda model, transition, *given: transition in underflow,
            may_jump=lambda *given: jumps,
            guard_speed=lambda *given: 3.0,
            was_left_behind=lambda model, run, transition, t, x, speed, before, work: (
                left_behind and (t, speed, before) == (7.0, 3.0, -1)
            ),
            allowed=lambda model, transition, *given: transition not in refused,
        )
        fires = tested.arrived((None, model, None, run, None, work))
        # The larger of both scales stays.
        assert run.scale.tolist() == [6.0, 50.0]
        assert run.rehearsal[3].tolist() == [5, 0, 0, 5]
        assert np.all(run.rehearsal[:3] == 5)
        return fires, asked

    def test_the_first_guard_that_is_passed(self):
        assert self.arrived((1, 0), (1, BY_SPEED)) == (1, [(1, -1)])
        assert self.arrived((-1, 0), (1, BY_SPEED)) == (2, [(1, -1), (2, -1)])
        assert self.arrived((-1, 0), (-1, 0)) == (NO_TRANSITION, [(1, -1), (2, -1)])
        assert self.arrived((1, 0), (1, 0), refused=(1,))[0] == 2
        assert self.arrived((1, 0), (1, 0), refused=(1, 2))[0] == NO_TRANSITION

    def test_only_in_its_direction(self):
        assert self.arrived((1, 0), (1, 0), directions=(-1, 0))[0] == 2
        assert self.arrived((-1, 0), (-1, 0), sides=(1, 1), directions=(1, -1))[0] == 2

    def test_a_guard_without_a_side_or_at_zero_since_the_last_step_is_not_asked(self):
        assert self.arrived((1, 0), (1, 0), sides=(0, -1)) == (2, [(2, -1)])
        assert self.arrived((1, 0), (1, 0), on_guard=(BY_SPEED, 0)) == (2, [(2, -1)])
        assert self.arrived((1, 0), (1, 0), underflow=(1,)) == (2, [(2, -1)])

    def test_a_jump_of_the_guard_lies_beyond_its_near_side(self):
        assert self.arrived((-1, BY_STEP), (-1, 0), jumps=True)[0] == 1
        assert self.arrived((-1, BY_STEP), (-1, 0))[0] == NO_TRANSITION
        assert self.arrived((-1, BY_SPEED), (-1, 0), jumps=True)[0] == NO_TRANSITION

    def test_a_place_where_it_has_fired_before(self):
        assert self.arrived((1, 0), (-1, 0), left_behind=True)[0] == NO_TRANSITION
        assert self.arrived((1, BY_SPEED), (-1, 0), left_behind=True)[0] == 1


class TestSettle:
    """Resets at one instant: transition ``k`` adds ``10^k`` to the first component and negates the second."""

    def settled(self, *chain, targets=(1, 1, 1, 1), first=2):
        asked, waiting = [], list(chain)

        def take_sides(model, run, mode, t, x, came, left, fired, side, due, zero, work):
            assert (t, came, x is self.out) == (7.0, LANDED, True)
            asked.append((mode, left, int(fired), due.tolist(), x.tolist(), run.scale.tolist()))
            side[:], zero[:] = 6, 7
            due[:] = 1
            return waiting.pop(0) if waiting else chain[-1]

        def reset(transition, t, x, parameters, out):
            assert (t, parameters) == (7.0, "p")
            out[:] = x[0] + 10.0**transition, -x[1]

        model = SimpleNamespace(dimension=2, parameters="p", reset=reset, target=np.array(targets))
        run = SimpleNamespace(mode=0, phase=7.0, y=np.array([0.5, 2.0]), scale=np.array([20.0, 1.0]))
        run.side, run.due, run.on_guard = (np.array([k] * 4) for k in (-1, 1, 3))
        run.rehearsal = np.full((4, 4), 9)
        work = SimpleNamespace(trial=np.zeros(2), state=np.zeros(2))
        self.out = np.zeros(2)
        mode = plain(corner, take_sides=take_sides).settle(model, run, first, self.out, work)
        # The run itself stays as it was.
        assert (run.scale.tolist(), run.y.tolist(), run.mode) == ([20.0, 1.0], [0.5, 2.0], 0)
        assert [run.side[0], run.due[0], run.on_guard[0]] == [-1, 1, 3]
        assert run.rehearsal[3].tolist() == [9] * 4
        self.rehearsal = run.rehearsal[:3].tolist()
        return int(mode), self.out.tolist(), asked

    def test_one_jump(self):
        mode, out, asked = self.settled(NO_TRANSITION)
        assert (mode, out) == (1, [100.5, -2.0])
        assert asked == [(1, 0, 2, [1, 1, 0, 1], [100.5, -2.0], [100.5, 2.0])]
        assert self.settled(RESTING)[1] == [100.5, -2.0]

    def test_jumps_that_follow_at_once(self):
        mode, out, asked = self.settled(0, 3, NO_TRANSITION, targets=(3, 1, 2, 0))
        assert (mode, out) == (0, [1101.5, -2.0])
        assert [each[:3] for each in asked] == [(2, 0, 2), (3, 2, 0), (0, 3, 3)]
        assert [each[3] for each in asked] == [[1, 1, 0, 1], [0, 1, 1, 1], [1, 1, 1, 0]]
        assert [each[5] for each in asked] == [[100.5, 2.0], [101.5, 2.0], [1101.5, 2.0]]

    def test_the_end_of_the_run(self):
        assert self.settled(0, targets=(1, 1, NO_MODE, 1)) == (NO_MODE, [100.5, -2.0], [])
        assert self.rehearsal == [[-1] * 4, [1, 1, 0, 1], [3] * 4]

    def test_no_more_than_fifty(self):
        _, out, asked = self.settled(1)
        assert len(asked) == MOST_JUMPS
        assert out == [100.5 + 10.0 * (MOST_JUMPS - 1), 2.0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_order_matters_if_the_states_or_the_modes_differ(way):
    """Components differ by more than 1e-9 of the largest size: 8 and 4 here."""

    def matters(apart, modes=(1, 1), start=(0.0, 4.0)):
        def settle(model, run, first, out, work):
            out[:] = (way * 8.0, start[1]) if first == 5 else (way * 8.0 + apart[0], start[1] + apart[1])
            return modes[0 if first == 5 else 1]

        work = SimpleNamespace(error=np.zeros(2), second_error=np.zeros(2))
        run = SimpleNamespace(scale=np.array([2.0, 4.0]))
        tested = plain(corner, settle=settle).order_matters
        return bool(tested(SimpleNamespace(dimension=2), run, 5, 6, work))

    assert not matters((0.0, 0.0))
    assert matters((0.0, 0.0), modes=(1, 2))
    for i, unit in ((0, 8e-9), (1, 4e-9)):
        for share, expected in ((0.9, False), (1.1, True)):
            apart = [0.0, 0.0]
            apart[i] = way * share * unit
            assert matters(apart) == expected
    # A component that is zero is as large as it has been.
    assert not matters((0.0, 3.9e-9), start=(0.0, 0.0))
    assert matters((0.0, 4.1e-9), start=(0.0, 0.0))


class TestFirstInOrder:
    """The second of three modes has the guards 1, 2 and 3, of which the flow has reached that of 2."""

    def first(
        self,
        due,
        *,
        foreseen=(0, 0, 0),
        sides=(-1, -1, -1),
        refused=(),
        markers=(),
        matters=never,
        touches=False,
    ):
        def take_sides(model, run, mode, t, x, came, left, fired, side, due_of, zero, work):
            assert (mode, t, came, left, fired) == (1, 7.0, FLOWED, 1, NO_TRANSITION)
            self.known = side[1:4].tolist()
            side[1:4] = 1
            due_of[1:4] = due

        model = SimpleNamespace(
            first_outgoing=np.array([0, 1, 4, 5]),
            outgoing=np.array([0, 1, 2, 3, 4]),
            direction=np.array([1] * 5),
            affine_guard=np.array([1] * 5),
            marker=np.array([int(k in markers) for k in range(5)]),
        )
        run = SimpleNamespace(mode=1, phase=7.0, y="y", order_mattered=0, stage=0, last_step=1.0)
        run.side, run.due = np.array([5, *sides, 5]), np.array([5, 0, 0, 0, 5])
        run.on_guard = np.array([BY_SPEED] * 5)
        run.rehearsal = np.zeros((4, 5), dtype=int)
        run.rehearsal[3] = 5, *foreseen, 5
        tested = plain(
            corner,
            task_of=lambda task: task,
            take_sides=take_sides,
            turns_back=lambda *given: touches,
            guard_value=lambda *given: 0.0,
            keep_grazing=lambda *given: None,
            allowed=lambda model, transition, *given: transition not in refused,
            order_matters=matters,
        )
        chosen = tested.first_in_order((None, model, None, run, None, SimpleNamespace(scalar=None)), 2)
        assert [array[[0, 4]].tolist() for array in (run.side, run.due, run.rehearsal[3])] == [[5, 5]] * 3
        assert run.rehearsal[3, 1:4].tolist() == [0, 0, 0]
        self.run = run
        return int(chosen), run.side[1:4].tolist(), run.due[1:4].tolist()

    def test_a_guard_that_crosses_later_on_the_step_may_have_changed_sides_before(self):
        self.first((0, 0, 0), foreseen=(1, 0, NOT_KNOWN), sides=(-1, -1, -1))
        assert self.known == [1, -1, 0]

    def test_the_one_listed_first_of_those_that_may_fire(self):
        assert self.first((1, 0, 0), matters=lambda *given: False)[0] == 1
        assert self.first((1, 0, 0), refused=(1,))[0] == 2
        assert self.first((1, 0, 0), markers=(1,))[0] == 1
        assert self.first((0, 0, 1), refused=(2,)) == (3, [1, 1, 1], [0, 1, 1])
        assert (self.run.stage, self.run.last_step) == (0, 1.0)

    def test_another_one_where_a_guard_has_only_touched(self):
        """The next step shows the side of the one that has touched."""
        assert self.first((1, 0, 0), touches=True) == (1, [1, 0, 1], [1, 0, 0])

    def test_none_if_all_are_refused(self):
        """Their sides are left to the next step."""
        assert self.first((1, 0, 0), refused=(1, 2)) == (NO_TRANSITION, [0, 0, 1], [0, 0, 0])
        assert (self.run.stage, self.run.last_step) == (STALE, 0.0)

    def test_a_marker_does_not_count_for_the_order(self):
        asked = []

        def matters(model, run, first, other, work):
            asked.append((int(first), int(other)))
            return True

        assert self.first((1, 0, 1), markers=(1,), matters=matters)[0] == 1
        assert (asked, self.run.order_mattered) == ([(2, 3)], 1)
