"""Rounds of jumps that shorten, rule by rule, on visits whose limit is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import rounds
from hybrid.kernels.types.codes import ENDLESS, NO_MODE, NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(rounds)
SLOTS = 64
# Two transitions of a round.
TURN = (3, 7)


def run_of(left, *, states=None, fired=TURN, end=100.0, jumps=40, period=0.0, cycles=0, **values):
    """A run after many jumps: ``left[k]`` is the time to the limit at ``end`` after the ``k``-th last one.

    ``states[k]`` is the state then. What was before these jumps is unknown.
    """
    visits = np.full((SLOTS, 4), np.nan)
    recent = np.full(SLOTS, -1)
    for back, time in enumerate(left):
        visits[(jumps - back) % SLOTS, 2:] = end - time, cycles
        if states is not None:
            visits[(jumps - back) % SLOTS, :2] = states[back]
        recent[(jumps - 1 - back) % SLOTS] = fired[-1 - back % len(fired)]
    given = {"phase": end - left[0], "cycle": cycles, "scale": np.ones(2), "chattering": 0, "mode": 1}
    given |= {"y": visits[jumps % SLOTS, :2].copy(), "trail": np.zeros((5, 2))}
    run = SimpleNamespace(visits=visits, recent=recent, jumps=jumps, **(given | values))
    return SimpleNamespace(dimension=2, period=period, parameters="p"), run


def geometric(ratio, count=40, turn=1, first=0.01, uneven=0.25):
    """Times left after the last jumps of rounds of ``turn``, of which each takes ``ratio`` of the last.

    The jumps of a round are ``uneven``.
    """
    return [
        first * ratio ** -(k // turn) * (1.0 + uneven * (1.0 / ratio - 1.0) * (k % turn))
        for k in range(count)
    ]


class TestMemory:
    def test_slots_are_used_again(self):
        run = SimpleNamespace(visits=np.zeros((8, 3)))
        assert [kernels.slot_of(run, jumps) for jumps in (0, 1, 7, 8, 9, 23)] == [0, 1, 7, 0, 1, 7]

    def test_a_visit_is_the_state_and_the_time_right_after_a_jump(self):
        run = SimpleNamespace(
            visits=np.zeros((8, 4)), jumps=11, y=np.array([5.0, 6.0, 9.0]), phase=0.25, cycle=4
        )
        kernels.remember_visit(SimpleNamespace(dimension=2), run)
        assert run.visits[3].tolist() == [5.0, 6.0, 0.25, 4.0]
        assert np.count_nonzero(run.visits) == 4

    def test_times_between_jumps_count_whole_periods(self):
        model, run = run_of([1.0, 3.0, 7.0], period=10.0)
        assert kernels.time_before(model, run, 0, 1) == 2.0
        assert kernels.time_before(model, run, 1, 2) == 4.0
        assert kernels.time_before(model, run, 0, 2) == 6.0
        run.visits[40 % SLOTS, 3], run.visits[39 % SLOTS, 3] = 3.0, 1.0
        assert kernels.time_before(model, run, 0, 1) == 22.0
        assert kernels.time_before(model, run, 1, 2) == 14.0

    def test_the_transitions_that_fired(self):
        _, run = run_of(geometric(0.5, 6), fired=(3, 7, 5))
        assert [kernels.fired_before(run, back) for back in range(6)] == [5, 7, 3, 5, 7, 3]


class TestTimeLeft:
    @pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9])
    @pytest.mark.parametrize("turn", [1, 2, 3])
    def test_of_a_geometric_series(self, ratio, turn):
        left = geometric(ratio, turn=turn, count=8 * turn)
        model, run = run_of(left, end=0.0)
        for back in (0, 1, turn):
            found = kernels.time_left_of_rounds(model, run, turn, back)
            assert found == (pytest.approx(left[back], rel=1e-12), pytest.approx(ratio, rel=1e-12))

    def test_a_term_of_second_order_is_part_of_the_series(self):
        """The time left is ``a r^k + b r^2k`` to first order in ``b``: what is missing has order ``b^2``."""

        def error(b):
            left = [0.5 ** (6 - k) + b * 0.25 ** (6 - k) for k in range(8)]
            model, run = run_of(left, end=0.0)
            return abs(kernels.time_left_of_rounds(model, run, 1, 0)[0] - left[0])

        assert error(0.01) < 1e-5 * 2.0**-6
        assert error(0.01) == pytest.approx(error(0.02) / 4.0, rel=0.05)
        assert error(0.01) > 0.0

    def test_rounds_that_do_not_shorten_leave_none(self):
        for lengths in ((1.0, 2.0, 2.0), (2.0, 2.0, 3.0), (0.0, 1.0, 2.0), (2.0, 1.0, 3.0), (1.0, 3.0, 2.0)):
            model, run = run_of(np.cumsum([1.0, *lengths]), jumps=3)
            assert kernels.time_left_of_rounds(model, run, 1, 0) == (0.0, 1.0)

    @pytest.mark.parametrize(
        ("share", "steady"), [(0.099, True), (0.101, False), (-0.099, True), (-0.101, False)]
    )
    def test_the_ratio_must_be_steady(self, share, steady):
        """It may change by a tenth of its distance from 1 in a round."""
        ratio = 0.75
        before = ratio + share * (1.0 - ratio)
        model, run = run_of(np.cumsum([1.0, 1.0, 1.0 / ratio, 1.0 / ratio / before]), jumps=3)
        found = kernels.time_left_of_rounds(model, run, 1, 0)
        assert (found[1] == pytest.approx(ratio, rel=1e-12)) if steady else (found == (0.0, 1.0))

    @pytest.mark.parametrize("end", [64.0, -64.0])
    def test_rounds_shorter_than_the_rounding_of_time_are_passed_over(self, end):
        """The rounds before them tell the ratio, and how much is left after those that are passed over.

        Rounds below 128 units count as too short, and all but the last one belong to a series of ratio 1/2.
        """
        unit = 0.5 * EPSILON * 64.0

        def found(series, last):
            left = [series * 2.0**k * unit for k in range(10)]
            left[0] = left[1] - last * unit
            model, run = run_of(left, end=end)
            time, ratio = kernels.time_left_of_rounds(model, run, 1, 0)
            return time / unit, ratio

        assert found(160.0, 120.0) == (160.0, 0.5)
        assert found(160.0, 144.0)[1] == 144.0 / 320.0
        # Two rounds that are too short.
        assert found(50.0, 40.0) == (50.0, 0.5)

    def test_there_must_be_as_many_rounds_before_those_passed_over(self):
        """Nothing is read that lies before the first jump."""
        left = [0.0] * 8
        for jumps in (3, 4, 5):
            model, run = run_of(left[: jumps + 1], jumps=jumps)
            assert kernels.time_left_of_rounds(model, run, 1, 0) == (0.0, 1.0)

    @pytest.mark.parametrize("turn", [1, 2, 3])
    @pytest.mark.parametrize("jumps", [16, 63, 90])
    def test_of_many_that_are_passed_over_the_first_ones_known_tell_the_ratio(self, jumps, turn):
        """All rounds are shorter than the rounding of time; the last of them have no length at all."""
        unit = 0.5 * EPSILON * 64.0
        known = min(jumps, SLOTS - 1)
        rounds = known // turn - 3
        left = [8.0 * unit] * (rounds * turn) + [each * unit for each in (8, 9, 11, 15) for _ in range(turn)]
        model, run = run_of(left[: known + 1], jumps=jumps, end=64.0)
        found = kernels.time_left_of_rounds(model, run, turn, 0)
        assert found == (unit * 0.5**rounds, 0.5)


class TestShortens:
    def shortens(self, recent, earlier, jumps=17):
        left = [0.0] + [0.5 * recent] * 7 + [recent] * 8 + [recent + earlier] * 8
        model, run = run_of(left, jumps=jumps)
        return bool(kernels.shortens(model, run))

    def test_the_last_eight_jumps_took_less_time_than_as_many_before(self):
        assert self.shortens(1.0, 1.002)
        assert not self.shortens(1.0, 1.0005)
        assert not self.shortens(1.0, 0.5)
        assert self.shortens(0.0, 0.0)

    def test_not_before_so_many_jumps(self):
        assert not self.shortens(1.0, 2.0, jumps=16)
        assert self.shortens(1.0, 2.0, jumps=17)


class TestTurns:
    @pytest.mark.parametrize("fired", [(3,), (3, 7), (3, 7, 7), tuple(range(1, 9))])
    def test_transitions_that_fire_in_the_same_order(self, fired):
        turn = len(fired)
        needed = max(16, 5 * turn) + 1
        left = geometric(0.5, count=60, turn=turn)
        model, run = run_of(left, fired=fired, jumps=needed, end=0.0)
        assert kernels.transitions_in_turn(model, run) == turn
        run = run_of(left, fired=fired, jumps=needed - 1, end=0.0)[1]
        assert kernels.transitions_in_turn(model, run) == 0

    def test_none_if_the_last_round_did_not_shorten(self):
        for longer, turn in ((0.0, 2), (1.0, 0)):
            left = geometric(0.5, count=40, turn=2)
            # Rounds that begin with the other jump have all shortened.
            left[0] = left[2] - (0.5 + longer) * (left[4] - left[2])
            model, run = run_of(left, end=0.0, jumps=18)
            assert kernels.transitions_in_turn(model, run) == turn

    def test_no_more_than_eight(self):
        model, run = run_of(geometric(0.5, count=63, turn=9), fired=tuple(range(1, 10)), jumps=63, end=0.0)
        assert kernels.transitions_in_turn(model, run) == 0

    def test_another_transition_in_the_rounds_seen(self):
        left = geometric(0.5, count=40, turn=2)
        for back in (0, 1, 7, 15, 16, 17):
            model, run = run_of(left, end=0.0)
            run.recent[(40 - 1 - back) % SLOTS] = 5
            assert kernels.transitions_in_turn(model, run) == (2 if back > 15 else 0)

    def test_one_transition_alone_is_followed_by_its_own_impacts(self):
        for fired, expected in (((3,), 0), ((3, 7), 2)):
            model, run = run_of(geometric(0.5, count=40, turn=len(fired)), fired=fired, end=0.0, chattering=1)
            assert kernels.transitions_in_turn(model, run) == expected


class TestLimits:
    def visits(self, function, ratio=0.5, turn=2):
        left = geometric(ratio, count=24, turn=turn)
        return left, [function(time) for time in left]

    @pytest.mark.parametrize("back", [0, 1, 2])
    def test_a_state_that_is_quadratic_in_the_time_left(self, back):
        left, states = self.visits(lambda a: (5.0 + 2.0 * a - 3.0 * a * a, -1.0 + a * a))
        model, run = run_of(left, states=states, end=0.0)
        out = np.full(3, 88.0)
        kernels.extrapolate(model, run, 2, back, left[back], out)
        assert out == pytest.approx([5.0, -1.0, 88.0], rel=1e-12)

    @pytest.mark.parametrize("back", [0, 1, 2])
    def test_components_that_are_geometric_series_of_their_own(self, back):
        left = geometric(0.5, count=24, turn=2)
        states = [(5.0 + 0.3 ** (20 - k // 2) * 1e9, -1.0 - 0.9 ** (20 - k // 2)) for k in range(24)]
        model, run = run_of(left, states=states, end=0.0)
        out = np.full(3, 88.0)
        kernels.extrapolate_by_rounds(model, run, 2, back, out)
        assert out == pytest.approx([5.0, -1.0, 88.0], rel=1e-6)

    def test_a_component_that_does_not_settle_keeps_its_last_value(self):
        left = geometric(0.5, count=24, turn=2)
        # One moves by more from round to round, one evenly.
        states = [(2.0 ** -(k // 2), 3.0 * (k // 2)) for k in range(24)]
        model, run = run_of(left, states=states, end=0.0)
        out = np.zeros(2)
        kernels.extrapolate_by_rounds(model, run, 2, 0, out)
        assert out.tolist() == [1.0, 0.0]


class TestEndless:
    """Two resets in turn: 3 halves the first component, 7 adds what is said to the second one."""

    def model(self, add):
        def reset(transition, t, x, parameters, out):
            assert (t, parameters) == (9.0, "p")
            self.order.append(transition)
            out[:] = (0.5 * x[0], x[1]) if transition == 3 else (x[0], add(x))

        self.order = []
        model, run = run_of(geometric(0.5, 24, 2), fired=TURN)
        model.reset = reset
        work = SimpleNamespace(state=np.zeros(2), second_error=np.zeros(2), new=np.zeros(2))
        return model, run, work

    def test_the_resets_of_a_round_in_their_order(self):
        model, run, work = self.model(lambda x: x[1] + 100.0 * x[0])
        x = np.array([8.0, 1.0])
        kernels.follow_resets(model, run, 2, 9.0, x, work)
        assert (x.tolist(), self.order) == ([4.0, 401.0], [3, 7])
        kernels.follow_resets(model, run, 1, 9.0, x, work)
        assert (x.tolist(), self.order) == ([4.0, 801.0], [3, 7, 7])

    def marked(self, add, share=(1.0, 0.5), x=(0.0, 10.0)):
        model, run, work = self.model(add)
        run.trail[ENDLESS] = 77.0
        found = kernels.mark_endless(model, run, 2, 9.0, np.array(x), np.array(share), work)
        assert bool(found) == np.any(run.trail[ENDLESS] == 1.0)
        return run.trail[ENDLESS].tolist()

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_counter_is_moved_for_ever(self, way):
        assert self.marked(lambda x: x[1] + way) == [0.0, 1.0]
        assert self.marked(lambda x: x[1] + 0.51 * way) == [0.0, 1.0]
        assert self.marked(lambda x: x[1] + 0.49 * way) == [0.0, 0.0]
        assert self.marked(lambda x: x[1]) == [0.0, 0.0]

    def test_moves_that_shrink_have_a_limit(self):
        for rate, expected in (
            (1.0 - 0.9e-6, 1.0),
            (1.0 - 1.1e-6, 0.0),
            (-1.0, 1.0),
            (-0.99, 0.0),
            (2.0, 1.0),
        ):
            assert self.marked(lambda x, rate=rate: 13.0 + rate * (x[1] - 10.0)) == [0.0, expected]

    def test_only_moved_components_change_for_the_second_round(self):
        """The first component moves by less than its share, but its move would stop the counter."""
        assert self.marked(lambda x: x[1] + x[0], x=(2.0, 10.0), share=(1.5, 0.5)) == [0.0, 1.0]
        # It moves by its half, so that it is moved, but less and less.
        assert self.marked(lambda x: x[1] + x[0], x=(2.0, 10.0), share=(0.5, 0.5)) == [0.0, 0.0]

    def held(self, last, before, earlier, lengths=(1.0, 2.0), left=0.5, scale=(1.0, 1.0)):
        asked = []

        def mark_endless(model, run, turn, t, x, share, work):
            asked.append((turn, t, x.tolist(), share.tolist()))
            run.trail[ENDLESS] = 0.0, 1.0
            return True

        states = [last, (88.0, 88.0), before, (88.0, 88.0), earlier]
        times = np.array([0.0, 0.1, lengths[0], lengths[0] + 0.1, sum(lengths)])
        model, run = run_of(times, states=states, end=0.0, jumps=4, scale=np.array(scale))
        work = SimpleNamespace(rounding=np.zeros((2, 2)), settled=np.array([55.0, 66.0]))
        tested = plain(rounds, mark_endless=mark_endless)
        tested.hold_endless(model, run, 2, 9.0, left, work)
        self.asked = asked
        return work.settled.tolist()

    def test_a_held_component_keeps_its_value_and_moves_by_its_rate(self):
        """Its jumps are equal; between them it moves by 3 in the first round and by 1.5 in the second."""
        found = self.held(last=(0.0, 20.0 + 1.5), before=(0.0, 10.0), earlier=(0.0, 10.0 - 13.0))
        assert found == [55.0, 21.5 + 1.5 * 0.5]
        found = self.held((0.0, 21.5), (0.0, 10.0), (0.0, -3.0), lengths=(1.0, 3.0))
        assert found == [55.0, 21.5 + 0.75 * 0.5]
        # Rounds that do not shorten tell no rate.
        found = self.held((0.0, 21.5), (0.0, 10.0), (0.0, -3.0), lengths=(1.0, 1.0))
        assert found == [55.0, 21.5]

    def test_moves_count_from_a_tenth_of_the_last_one(self):
        self.held((7.0, 20.0), (4.0, 30.0), (0.0, 0.0))
        ((turn, t, x, share),) = self.asked
        assert (turn, t, x) == (2, 9.0, [55.0, 66.0])
        assert share == pytest.approx([0.3, 1.0], rel=1e-15)
        self.held((4.0, 30.0), (4.0, 30.0), (0.0, 0.0), scale=(8.0, 2.0))
        assert self.asked[0][3] == [64.0 * EPSILON * 8.0, 64.0 * EPSILON * 2.0]

    def test_without_any_the_limit_stays(self):
        model, run = run_of(geometric(0.5, 6, 2), states=np.zeros((6, 2)), jumps=6)
        work = SimpleNamespace(rounding=np.zeros((2, 2)), settled=np.array([55.0, 66.0]))
        run.trail[ENDLESS] = 1.0
        plain(rounds, mark_endless=lambda *given: False).hold_endless(model, run, 2, 9.0, 0.5, work)
        assert work.settled.tolist() == [55.0, 66.0]


class TestAgreement:
    def limit(
        self,
        *,
        value=0.0,
        jumps=False,
        moved=(0.0, 0.0),
        endless=(0.0, 0.0),
        gradient=(2.0, -3.0, 0.0),
        t=0.0,
    ):
        """The guard is ``value`` at the limit; the resets of a round move the state by ``moved``."""
        asked = []

        def guard(transition, t, x, parameters, out):
            asked.append((transition, x.tolist()))
            out[0] = value

        def write_gradient(transition, t, x, parameters, out):
            out[:] = gradient

        def reset(transition, t, x, parameters, out):
            out[:] = x + np.array(moved) * (1.0 if transition == 3 else 0.0)

        model, run = run_of(geometric(0.5, 8, 2))
        model.guard, model.guard_gradient, model.reset = guard, write_gradient, reset
        run.trail[ENDLESS] = endless
        work = SimpleNamespace(
            error=np.zeros(2), settled=np.array([1.0, 2.0]), trial=np.array([5.0, 10.0]), state=np.zeros(2)
        )
        work.gradient, work.scalar = np.zeros(3), np.zeros(1)
        tested = plain(rounds, may_jump=lambda *given: jumps)
        self.asked = asked
        return bool(tested.is_limit(model, run, 2, t, work))

    def test_the_state_is_on_each_guard(self):
        """The terms of the guard have the size 2 * 5 + 3 * 10."""
        for way in (1.0, -1.0):
            assert self.limit(value=way * 0.99e-6 * 40.0)
            assert not self.limit(value=way * 1.01e-6 * 40.0)
            # Its time counts, too.
            assert self.limit(value=way * 0.99e-6 * 54.0, gradient=(2.0, -3.0, -7.0), t=2.0)
            assert not self.limit(value=way * 1.01e-6 * 54.0, gradient=(2.0, -3.0, -7.0), t=2.0)
        assert self.asked == [(3, [1.0, 2.0])]
        assert not self.limit(value=np.nan)
        # A guard that jumps across zero is never near it.
        assert self.limit(value=1.0, jumps=True)

    def test_a_round_leads_back_to_the_limit(self):
        for moved in ((0.99e-6 * 5.0, 0.0), (0.0, -0.99e-6 * 10.0)):
            assert self.limit(moved=moved)
            assert self.asked == [(3, [1.0, 2.0]), (7, [1.0 + moved[0], 2.0 + moved[1]])]
        for moved in ((-1.01e-6 * 5.0, 0.0), (0.0, 1.01e-6 * 10.0), (np.nan, 0.0)):
            assert not self.limit(moved=moved)
        assert self.limit(moved=(0.0, 3.0), endless=(0.0, 1.0))
        assert not self.limit(moved=(3.0, 0.0), endless=(0.0, 1.0))


def test_the_transition_that_names_the_mode_of_the_limit_fires_next():
    def following(names, turn=2):
        model, run = run_of(geometric(0.5, 8, 2), fired=TURN)
        model.accumulates_to = np.full(9, NO_MODE)
        model.accumulates_to[list(names)] = 1
        return kernels.next_in_turn(model, run, turn)

    # 3 and 7 have fired in turn, 7 was the last: 3 is due.
    assert following(()) == 3
    assert following((3,)) == 3
    assert following((3, 7)) == 3
    assert following((7,)) == NO_TRANSITION
    assert following((5,)) == 3
    assert following((), turn=1) == 7
    model, run = run_of(geometric(0.5, 8, 3), fired=(3, 7, 5))
    model.accumulates_to = np.full(9, NO_MODE)
    assert kernels.next_in_turn(model, run, 3) == 3
