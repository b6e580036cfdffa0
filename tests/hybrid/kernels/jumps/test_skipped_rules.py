"""Whether jumps may be skipped and whether a state has come to rest, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.sampled import NOWHERE
from hybrid.kernels.jumps import skipped
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

T = 2.0
BOTH = pytest.mark.parametrize("way", [1.0, -1.0])


def memory():
    names = ("trial", "state", "field", "settled")
    work = SimpleNamespace(**{name: np.full(2, 88.0) for name in names})
    work.gradient, work.scalar, work.jacobian = np.zeros(3), np.zeros(1), np.zeros((2, 3))
    work.rounding, work.path = np.zeros((4, 2)), np.zeros((2, 2))
    return work


def test_a_transition_takes_turns_if_it_has_the_guard_of_one_that_does():
    run = SimpleNamespace()
    model = SimpleNamespace(surface=np.array([5, 6, 5, 7]))
    kernels = plain(skipped, fired_before=lambda run, back: (0, 1, 3)[back])
    assert [kernels.takes_turns(model, run, transition, 2) for transition in range(4)] == [
        *(True, True, True),
        False,
    ]
    assert not kernels.takes_turns(model, run, 1, 1)


class TestWayIsFree:
    """Transition 1 accumulates; the others wait on the way from (1, 2) to (4, 0), which takes 0.5."""

    def free(self, *values, ends=None, programs=(), changes=False, directions=None, **given):
        """``values`` and ``ends`` are those of the guards of transitions 2, 3 and so on."""
        count = len(values)
        ends = ends or values

        def guard(transition, t, x, parameters, out):
            place = (t, x.tolist())
            assert place in ((T, [1.0, 2.0]), (T + 0.5, [4.0, 0.0]))
            out[0] = (values if t == T else ends)[transition - 2]

        def first_change(model, method, run, transition, path, order, clock, t, span, stop, side, *rest):
            assert (order, clock, t, span, stop, side) == (
                1,
                -1,
                T,
                0.5,
                1.0,
                np.sign(values[transition - 2]),
            )
            assert path.tolist() == [[1.0, 2.0], [3.0, -2.0]]
            assert rest[:-1] == (0, 0.0, True)
            return 0.25 if changes else NOWHERE, 0, 1.0

        model = SimpleNamespace(
            dimension=2,
            parameters=None,
            guard=guard,
            guard_gradient=lambda *given: None,
            first_outgoing=np.array([0, 0, 1 + count]),
            outgoing=np.arange(1, 2 + count),
            direction=np.array([9, 9, *(directions or [0] * count)]),
        )
        run = SimpleNamespace(mode=1, previous_mode=given.get("before", 1), phase=T, y=np.array([1.0, 2.0]))
        run.side = np.array([9, 9, *(given.get("sides") or np.sign(values))])
        run.due = np.array([9, 9, *(given.get("due") or [0] * count)])
        work = memory()
        work.settled[:] = 4.0, 0.0
        tested = plain(
            skipped,
            takes_turns=lambda model, run, transition, turn: transition == turn,
            rounding_band=lambda *given: 1e-3,
            has_program=lambda model, transition: transition in programs,
            first_change=first_change,
        )
        return bool(tested.way_is_free(model, "method", run, 1, 0.5, work))

    def test_if_no_other_guard_changes_sides(self):
        assert self.free()
        assert self.free(1.0, -2.0)

    @BOTH
    @pytest.mark.parametrize("place", [0, 1])
    def test_not_if_another_is_crossed_in_its_direction(self, place, way):
        values, ends = [3.0, 3.0], [3.0, 3.0]
        values[place], ends[place] = way, -way
        assert not self.free(*values, ends=ends)
        ends[place] = 0.0
        assert not self.free(*values, ends=ends)
        for direction, free in ((-way, False), (way, True)):
            directions = [0, 0]
            directions[place] = direction
            assert self.free(*values, ends=ends, directions=directions) == free

    @BOTH
    def test_a_guard_that_is_within_rounding_of_zero_does_not_count(self, way):
        assert self.free(0.99e-3 * way, ends=[-way])
        assert not self.free(1.01e-3 * way, ends=[-way])

    @BOTH
    def test_not_if_the_last_reset_has_crossed_another_guard(self, way):
        assert not self.free(way, due=[1])
        assert not self.free(way, sides=[-way])
        assert not self.free(way, sides=[-way], directions=[way])
        assert self.free(way, sides=[-way], directions=[-way])
        # Its side is that of the mode before if the jump has changed the mode.
        assert self.free(way, sides=[-way], before=0)


class TestRest:
    """A state that moves with the rates (0, 5) at the time 2; its sizes are 1 and 10.

    The guard has the gradient (3, -4), and the rate of its first component depends on the second one by 7.
    """

    MOVED = np.array([1.0, 10.0 + 2.0 * 5.0]) * 4.0 * 16.0 * EPSILON

    def rests(
        self, *, value=0.0, speed=0.0, moved=(0.0, 0.0), rounds=1.0, endless=(0.0, 0.0), band=0.0, slack=0.0
    ):
        def field(mode, t, x, parameters, out):
            assert (mode, t, x.tolist()) == (1, T, [1.0, 2.0])
            out[:] = 0.0, -5.0

        def guard(transition, t, x, parameters, out):
            asked.append(transition)
            out[0] = value

        def guard_speed(model, transition, t, x, field, gradient):
            gradient[:] = 3.0, -4.0, 0.0
            return speed

        def reset(transition, t, x, parameters, out):
            out[:] = x + np.array(moved)

        def mark_endless(model, run, turn, t, x, share, work):
            assert (turn, t) == (2, T)
            assert share == pytest.approx(2.0 * rounds * self.MOVED, rel=1e-14)
            run.trail[ENDLESS] = endless

        asked = []
        model = SimpleNamespace(
            dimension=2, period=0.0, parameters=None, field=field, guard=guard, reset=reset
        )
        model.first_slope, model.slope_column = np.array([[9] * 3, [0, 1, 1]]), np.array([1])
        run = SimpleNamespace(mode=1, phase=T, scale=np.array([1.0, 10.0]), trail=np.zeros((5, 2)))
        run.jumps, run.visits = 1, np.zeros((4, 4))
        work = memory()
        work.jacobian[0] = 88.0, -7.0, 88.0
        tested = plain(
            skipped,
            mark_endless=mark_endless,
            fired_before=lambda run, back: 3 + back,
            guard_speed=guard_speed,
            rounding_band=lambda *given: band,
            speed_rounding=lambda *given: slack,
        )
        found = bool(tested.has_come_to_rest(model, run, 2, np.array([1.0, 2.0]), rounds, work))
        assert asked == [3, 4] if found else asked == [3]
        return found

    @BOTH
    def test_on_its_guards(self, way):
        """Four times as far as rounding of the guard, and as far as state and time move it."""
        height = 3.0 * self.MOVED[0] + 4.0 * self.MOVED[1]
        for share, expected in ((0.99, True), (1.01, False)):
            assert self.rests(value=way * share * height) == expected
            assert self.rests(value=way * share * (height + 4.0), band=1.0) == expected

    @BOTH
    def test_at_rest(self, way):
        """Rounding errors of speeds grow with the rounds of jumps."""
        fastest = 3.0 * 7.0 * self.MOVED[1]
        for share, expected in ((0.99, True), (1.01, False)):
            assert self.rests(speed=way * share * fastest) == expected
            assert self.rests(speed=way * share * 6.0 * fastest, rounds=6.0) == expected
            assert self.rests(speed=way * share * (fastest + 4.0), slack=1.0) == expected

    @BOTH
    @pytest.mark.parametrize("place", [0, 1])
    def test_not_moved_by_resets(self, place, way):
        for rounds in (1.0, 6.0):
            for share, expected in ((0.9, True), (1.1, False)):
                moved, endless = [0.0, 0.0], [0.0, 0.0]
                # The sizes are such that the sum with the state has a rounding, too.
                moved[place] = way * share * 2.0 * rounds * self.MOVED[place]
                assert self.rests(moved=moved, rounds=rounds) == expected
                endless[place] = 1.0
                assert self.rests(moved=moved, rounds=rounds, endless=endless)
