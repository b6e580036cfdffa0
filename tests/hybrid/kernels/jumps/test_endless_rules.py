"""Whether a limit may leave counters behind, rule by rule: nothing may depend on them."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import endless
from hybrid.kernels.types.codes import ENDLESS, HELD, NO_MODE
from tests.hybrid.kernels.plain import plain

kernels = plain(endless)
T = 9.0
# Of the three components the last one counts.
LIMIT = np.array([1.0, 2.0, 10.0])


def system(guard=None, condition=None, reset=None, field=None, *, outgoing=(1,), behind=5, **more):
    """Transitions 1 and 2 leave mode 4; the condition of each has the number of its guard and 3 more."""

    def write_guard(transition, t, x, parameters, out):
        assert t == T
        out[0] = (
            (guard(transition, x) if guard else 0.5) if transition < 3 else condition(x) if condition else 1.0
        )

    def write_reset(transition, t, x, parameters, out):
        assert t == T
        out[:] = reset(transition, x) if reset else (x[0], -x[1], x[2] + 1.0)

    def write_field(mode, t, x, parameters, out):
        assert (mode in (4, 5), t) == (True, T)
        out[:] = field(mode, x) if field else (x[1], -x[0], 0.0)

    model = SimpleNamespace(
        dimension=3,
        parameters=None,
        guard=write_guard,
        reset=write_reset,
        field=write_field,
        target=np.zeros(3),
        field_before=np.array([9, 4, 4]),
        field_behind=np.array([9, behind, behind]),
        first_outgoing=np.array([0, 0, 0, 0, 0, len(outgoing)]),
        outgoing=np.array(outgoing),
        direction=np.array([9, -1, -1]),
        **more,
    )
    run = SimpleNamespace(mode=4, phase=T, jumps=40, trail=np.zeros((5, 3)))
    run.trail[ENDLESS, 2] = 1.0
    names = ("trial", "error", "state", "second_error", "new", "field_after")
    work = SimpleNamespace(**{name: np.full(3, 88.0) for name in names}, scalar=np.zeros(1))
    return model, run, work


def test_what_the_next_two_rounds_add():
    """A counter that grows by 2 and then by its third part; moves of components with a limit do not count."""

    def follow_resets(model, run, turn, t, x, work):
        assert (turn, t) == (2, T)
        asked.append(x.tolist())
        x[:] = x[0] + 5.0, x[1], x[2] + 2.0 if x[2] == 10.0 else x[2] + 4.0

    asked = []
    model, run, work = system()
    first, second = np.zeros(3), np.zeros(3)
    tested = plain(endless, follow_resets=follow_resets)
    tested.count_on(model, run, 2, T, LIMIT, first, second, work)
    assert first.tolist() == [0.0, 0.0, 2.0]
    assert second.tolist() == [0.0, 0.0, 4.0]
    assert asked == [[1.0, 2.0, 10.0], [1.0, 2.0, 12.0]]


def test_counters_are_tried_one_by_one_and_then_by_doublings():
    """Rounds of odd and of even number may add differently."""

    def later(trial):
        out = np.zeros(3)
        base, first, second = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1000.0])
        kernels.place_later(SimpleNamespace(dimension=3), base + LIMIT, first, second, trial, out)
        assert out[:2].tolist() == [1.0, 2.0]
        return out[2] - 10.0

    assert [later(trial) for trial in range(5)] == [0.0, 1.0, 1001.0, 1002.0, 2002.0]
    assert [later(trial) for trial in (7, 8, 9, 10, 12)] == [3004.0, 4004.0, 8008.0, 16016.0, 64064.0]


def test_only_components_without_a_count_must_be_the_same():
    model, run, _ = system()
    assert kernels.is_unmoved(model, run, [1.0, 2.0, 3.0], [1.0, 2.0, 9.0])
    assert not kernels.is_unmoved(model, run, [1.0, 2.0, 3.0], [7.0, 2.0, 3.0])
    assert not kernels.is_unmoved(model, run, [1.0, 2.0, 3.0], [1.0, 7.0, 3.0])


class TestIsRead:
    """A counter at 10 that adds one per round; it is tried at 11 to 18, and at 26 up to 10 + 8 * 2**29."""

    LAST = 10.0 + 8.0 * 2.0**29

    def read(self, at_once=False, **given):
        model, run, work = system(**given)
        one = np.array([0.0, 0.0, 1.0])
        return bool(kernels.is_read(model, run, 1, at_once, T, LIMIT, one, one, work))

    def test_by_nothing(self):
        assert not self.read()
        assert not self.read(at_once=True)

    @pytest.mark.parametrize("at_once", [False, True])
    @pytest.mark.parametrize("beyond", [10.5, 17.5, 20.0, LAST - 1.0])
    def test_by_a_guard_or_its_condition(self, beyond, at_once):
        assert self.read(at_once, guard=lambda transition, x: x[0] + (x[2] > beyond))
        assert self.read(at_once, condition=lambda x: x[2] < beyond)
        assert self.read(at_once, condition=lambda x: x[2] > beyond)

    @pytest.mark.parametrize("count", [11.0, 12.0, 18.0, 26.0, LAST])
    def test_by_a_condition_on_a_single_count(self, count):
        assert self.read(condition=lambda x: x[2] != count)

    def test_by_nothing_that_it_does_not_reach(self):
        assert not self.read(guard=lambda transition, x: x[0] + (x[2] > self.LAST))
        assert not self.read(condition=lambda x: x[2] <= self.LAST)

    @pytest.mark.parametrize("beyond", [10.5, 17.5, LAST - 1.0])
    def test_by_a_reset_or_a_field_unless_the_limit_is_reached_at_once(self, beyond):
        reset = {"reset": lambda transition, x: (x[0], x[1] + (x[2] > beyond), 0.0)}
        before = {"field": lambda mode, x: (x[1], x[0] + (x[2] > beyond and mode == 4), 0.0)}
        behind = {"field": lambda mode, x: (x[1], x[0] + (x[2] > beyond and mode == 5), 0.0)}
        for given in (reset, before, behind):
            assert self.read(**given)
            assert not self.read(at_once=True, **given)
        assert not self.read(**behind, behind=NO_MODE)
        assert self.read(**before, behind=NO_MODE)

    def test_not_by_its_own_reset_and_rate(self):
        assert not self.read(reset=lambda transition, x: (x[0], x[1], 2.0 * x[2]))
        assert not self.read(field=lambda mode, x: (x[1], x[0], x[2]))


class TestCountsToGuard:
    """Transition 2 waits for the counter, while transition 1 fires in turn."""

    def crosses(self, guard, direction=0, outgoing=(1, 2)):
        model, run, work = system(guard=lambda transition, x: guard(x[2]), outgoing=outgoing)
        model.direction[2] = direction
        one = np.array([0.0, 0.0, 1.0])
        tested = plain(endless, takes_turns=lambda model, run, transition, turn: transition == turn)
        return bool(tested.counts_to_guard(model, run, 1, T, LIMIT, one, one, work))

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_that_the_counter_crosses_in_its_direction(self, way):
        for level in (10.5, 11.0, 18.0, 8.0 * 2.0**29 + 10.0):
            for direction, fires in ((0, True), (way, True), (-way, False)):
                found = self.crosses(lambda count, level=level: way * (count - level), direction)
                assert found == fires
        assert not self.crosses(lambda count: way * (count - 8.0 * 2.0**29 - 11.0))
        assert not self.crosses(lambda count: way * (count - 9.0))
        # One that is zero already has its side from elsewhere.
        assert not self.crosses(lambda count: way * (count - 10.0))

    @pytest.mark.parametrize("count", [11.0, 12.0, 18.0, 26.0])
    def test_a_guard_that_is_crossed_at_a_single_count(self, count):
        assert self.crosses(lambda found: -1.0 if found == count else 1.0)

    def test_a_guard_that_is_no_number_counts_as_crossed(self):
        assert self.crosses(lambda count: 1.0 if count < 12.0 else np.nan)

    def test_the_transitions_in_turn_do_not_wait(self):
        assert not self.crosses(lambda count: count - 10.5, outgoing=(1,))


class TestMayBeHeld:
    """Jumps 40 and 39 were of transitions 2 and 1, at (3, 5, 10) and (0, 4, 9)."""

    def held(self, *, endless_ones=(0.0, 0.0, 1.0), read=None, crosses=False, left=0.25):
        asked = []

        def count_on(model, run, turn, t, limit, first, second, work):
            first[:], second[:] = 0.5, 0.75
            asked.append(("count", turn, t, limit.tolist()))

        def is_read(model, run, transition, at_once, t, base, first, second, work):
            asked.append((transition, bool(at_once), t, base.tolist(), first[0], second[0]))
            return len(asked) - 2 == read

        def counts_to_guard(model, run, turn, t, limit, first, second, work):
            asked.append(("guard", turn, t, limit.tolist(), first[0], second[0]))
            return crosses

        model, run, work = system()
        run.trail[ENDLESS] = endless_ones
        run.phase = T - left
        run.visits = np.zeros((64, 3))
        run.visits[39], run.visits[38] = (3.0, 5.0, 10.0), (0.0, 4.0, 9.0)
        tested = plain(
            endless,
            count_on=count_on,
            is_read=is_read,
            counts_to_guard=counts_to_guard,
            fired_before=lambda run, back: 2 - back,
        )
        found = bool(tested.may_be_held(model, run, 2, left, LIMIT, work))
        self.asked, self.marked = asked, run.trail[HELD].tolist()
        return found

    def test_states_before_the_jumps_and_their_mirror_images_are_tried(self):
        assert self.held()
        assert self.asked == [
            ("count", 2, T, LIMIT.tolist()),
            (2, False, T, [3.0, 5.0, 10.0], 0.5, 0.75),
            (2, False, T, [-1.0, -1.0, 10.0], 0.5, 0.75),
            (1, False, T, [0.0, 4.0, 9.0], 0.5, 0.75),
            (1, False, T, [2.0, 0.0, 11.0], 0.5, 0.75),
            ("guard", 2, T, LIMIT.tolist(), 0.5, 0.75),
        ]
        assert self.marked == [0.0, 0.0, 1.0]

    def test_a_limit_that_is_reached_at_once(self):
        assert self.held(left=0.0)
        assert [each[1] for each in self.asked[1:5]] == [True] * 4

    def test_nothing_is_held_that_something_depends_on(self):
        for read in range(4):
            assert not self.held(read=read)
            assert self.marked == [0.0] * 3
        assert not self.held(crosses=True)
        assert self.marked == [0.0] * 3

    def test_without_counters_there_is_nothing_to_ask(self):
        assert self.held(endless_ones=(0.0, 0.0, 0.0), crosses=True)
        assert (self.asked, self.marked) == ([], [0.0] * 3)
        assert self.held(endless_ones=(1.0, 0.0, 0.0))
        assert self.marked == [1.0, 0.0, 0.0]
