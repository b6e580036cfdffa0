"""Sides of guards at the start of a run, after steps and after resets: each rule with one guard."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import sides
from hybrid.kernels.events.beside import FEW_MOMENTS, LONGER, LONGEST, MOST_MOMENTS
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING
from hybrid.kernels.events.sides import FLOWED, LANDED, STARTED
from hybrid.kernels.types.codes import NO_TRANSITION, RESTING
from tests.hybrid.kernels.plain import plain

# What the tests call the order of a guard that a step has passed by more than rounding.
PASSED = 55


class Taken:
    """Sides taken at the guard of transition 2, the only one of mode 1, and the questions that were asked.

    By default the mode is entered from itself, nothing is special about the guard, and it may fire.
    """

    def __init__(
        self,
        came,
        now,
        order,
        *,
        before=-1,
        was=0,
        due=0,
        direction=1,
        fired=NO_TRANSITION,
        left=1,
        marker=0,
        paired=0,
        jumps=False,
        by_signs=False,
        signs=(0, 0, 0.0),
        transversality=9.0,
        rounding=1.0,
        held=False,
        held_beside=False,
        turns=False,
        left_behind=False,
        inherited=True,
        may_fire=True,
    ):
        self.asked = asked = {}

        def answer(name, value, *kept):
            def stub(*given):
                asked.setdefault(name, []).append(tuple(given[i] for i in kept))
                return value

            return stub

        model = SimpleNamespace(
            first_outgoing=np.array([0, 2, 3, 4]),
            outgoing=np.array([0, 1, 2, 3]),
            direction=np.array([5, 5, direction, 5]),
            marker=np.array([0, 0, marker, 0]),
            paired=np.array([0, 0, paired, 0]),
            parameters=None,
            field=answer("field", None, 0, 1, 2),
        )
        tested = plain(
            sides,
            inherit=answer("inherit", inherited, 1, 2),
            side_of=answer("side_of", (now, order), 3, 6, 7),
            guard_speed=lambda *given: 3.0,
            was_left_behind=answer("was_left_behind", left_behind, 5, 6),
            speed_rounding=lambda *given: rounding,
            may_jump=lambda *given: jumps,
            leaves_by_signs=lambda *given: by_signs,
            signs_beside=answer("signs_beside", signs, 5),
            turns_within=answer("turns_within", turns, 5, 6),
            is_held=answer("is_held", held, 6),
            is_held_beside=answer("is_held_beside", held_beside, 6),
            order_passed=lambda *given: PASSED,
            allowed=lambda *given: may_fire,
        )
        arrays = [np.array([7, 7, each, 7]) for each in (before, due, was)]
        run = SimpleNamespace(last_transversality=transversality)
        work = SimpleNamespace(field=None, gradient=None, scalar=None)
        self.chosen = tested.take_sides(model, run, 1, 0.5, "x", came, left, fired, *arrays, work)
        assert asked["field"] == [(1, 0.5, "x")]
        assert all(array[[0, 1, 3]].tolist() == [7, 7, 7] for array in arrays)
        self.side, self.due, self.order = (int(array[2]) for array in arrays)

    @property
    def all(self):
        return self.chosen, self.side, self.due, self.order


@pytest.fixture(params=[1, -1])
def way(request):
    """The direction of the guard."""
    return request.param


class TestStart:
    def test_only_a_guard_that_is_zero_and_leaves_in_its_direction_fires(self, way):
        for order in (BY_SPEED, BY_ACCELERATION, BY_STEP):
            assert Taken(STARTED, way, order, direction=way).all == (2, way, 1, order)
            assert Taken(STARTED, -way, order, direction=way).all == (NO_TRANSITION, -way, 0, order)
            assert Taken(STARTED, way, order, direction=0).all == (NO_TRANSITION, way, 0, order)
        for order in (0, JUMPING):
            assert Taken(STARTED, way, order, direction=way).all == (NO_TRANSITION, way, 0, order)

    def test_nothing_is_known_of_the_guard(self):
        taken = Taken(STARTED, 1, 0, before=-1, was=BY_SPEED, due=1, left_behind=True)
        assert taken.asked["side_of"] == [(2, 0, False)]
        assert taken.all == (NO_TRANSITION, 1, 0, 0)

    def test_a_marker_has_been_crossed_by_nothing(self, way):
        for order, side in ((BY_SPEED, way), (BY_ACCELERATION, way), (BY_STEP, 0)):
            taken = Taken(STARTED, way, order, direction=way, marker=1)
            assert taken.all == (NO_TRANSITION, side, 0, order)

    def test_a_condition_that_does_not_hold(self):
        assert Taken(STARTED, 1, BY_SPEED, may_fire=False).all == (NO_TRANSITION, 1, 1, BY_SPEED)


class TestFlow:
    def test_a_guard_passed_in_its_direction(self, way):
        for direction in (way, 0):
            given = {"before": -way, "direction": direction}
            assert Taken(FLOWED, way, 0, **given).all == (2, way, 1, PASSED)
            assert Taken(FLOWED, way, BY_SPEED, **given).all == (2, way, 1, BY_SPEED)
            assert Taken(FLOWED, way, JUMPING, **given).all == (2, way, 1, JUMPING)
            # Where the next step has to show the side, or the speed is hidden, it has not crossed yet.
            for order in (BY_ACCELERATION, BY_STEP):
                assert Taken(FLOWED, way, order, **given).all == (NO_TRANSITION, way, 0, order)
            for before in (0, way):
                taken = Taken(FLOWED, way, 0, before=before, direction=direction)
                assert taken.all == (NO_TRANSITION, way, 0, 0)
        taken = Taken(FLOWED, way, 0, before=-way, direction=-way)
        assert taken.all == (NO_TRANSITION, way, 0, 0)

    def test_the_previous_point_is_known(self):
        taken = Taken(FLOWED, 1, 0, before=-1, was=BY_STEP)
        assert taken.asked["side_of"] == [(2, -1, True)]
        assert taken.asked["was_left_behind"] == [(3.0, -1)]
        assert Taken(FLOWED, 1, 0, before=1, was=0).asked["side_of"] == [(2, 1, False)]

    def test_a_place_where_it_has_fired_before(self):
        assert Taken(FLOWED, 1, 0, left_behind=True).all == (NO_TRANSITION, -1, 0, 0)
        for now, order, before in ((1, BY_SPEED, -1), (1, 0, 1), (1, 0, 0)):
            taken = Taken(FLOWED, now, order, before=before, left_behind=True)
            assert "was_left_behind" not in taken.asked
            assert taken.side == 1

    def test_signs_beside_a_jump_tell_its_sides(self, way):
        given = {"direction": way, "before": -way}
        for order, jumps in ((JUMPING, False), (BY_STEP, True)):
            taken = Taken(FLOWED, -way, order, jumps=jumps, signs=(-way, way, 0.1), **given)
            assert taken.all == (2, way, 1, JUMPING)
            assert taken.asked["signs_beside"] == [(MOST_MOMENTS,)]
            taken = Taken(FLOWED, way, order, jumps=jumps, signs=(way, -way, 0.1), **given)
            assert taken.all == (NO_TRANSITION, -way, 0, JUMPING)
            # If they tell none, its side at the place counts.
            assert Taken(FLOWED, way, order, jumps=jumps, **given).all == (2, way, 1, JUMPING)
        assert "signs_beside" not in Taken(FLOWED, way, BY_SPEED, jumps=True, **given).asked
        assert "signs_beside" not in Taken(FLOWED, way, BY_STEP, **given).asked

    def test_a_jump_whose_near_side_was_not_known(self, way):
        given = {"direction": way, "before": 0}
        assert Taken(FLOWED, way, JUMPING, signs=(-way, way, 0.1), **given).chosen == 2
        assert Taken(FLOWED, way, JUMPING, **given).chosen == NO_TRANSITION
        # One that was known counts, whatever lies beside.
        taken = Taken(FLOWED, way, JUMPING, signs=(way, 0, 0.1), direction=way, before=-way)
        assert taken.chosen == 2

    def test_a_marker_fires(self):
        assert Taken(FLOWED, 1, BY_SPEED, marker=1).all == (2, 1, 1, BY_SPEED)

    def test_what_was_due_is_due_no_longer(self):
        assert Taken(FLOWED, 1, 0, before=1, due=1).all == (NO_TRANSITION, 1, 0, 0)


class TestLanding:
    def test_what_the_mode_just_left_knew_is_inherited(self):
        assert "inherit" not in Taken(LANDED, 1, 0).asked
        assert "inherit" not in Taken(FLOWED, 1, 0, left=0).asked
        taken = Taken(LANDED, 1, 0, left=0, before=-1)
        assert (taken.asked["inherit"], taken.all) == ([(0, 2)], (2, 1, 1, 0))
        # A guard that is not known there is crossed if the state is beyond it.
        taken = Taken(LANDED, 1, 0, left=0, before=1, was=BY_SPEED, inherited=False)
        assert (taken.asked["side_of"], taken.all) == ([(2, 0, False)], (2, 1, 1, 0))
        # Its own transition is that of the same mode only.
        taken = Taken(LANDED, 1, BY_STEP, left=0, fired=2, before=-1)
        assert taken.side == 1

    def test_due_while_the_state_is_beyond(self, way):
        for was in (0, BY_SPEED):
            given = {"direction": way, "before": way, "due": 1, "was": was}
            assert Taken(LANDED, way, 0, **given).all == (2, way, 1, 0)
            assert Taken(LANDED, -way, 0, **given).all == (NO_TRANSITION, -way, 0, 0)
            assert Taken(LANDED, way, 0, may_fire=False, **given).all == (NO_TRANSITION, way, 1, 0)

    def test_a_second_crossing_of_a_guard_that_fires_both_ways_takes_the_first_one_back(self, way):
        given = {"direction": 0, "before": way}
        assert Taken(LANDED, -way, 0, due=0, **given).all == (2, -way, 1, 0)
        assert Taken(LANDED, -way, 0, due=1, **given).all == (NO_TRANSITION, -way, 0, 0)
        assert Taken(LANDED, way, 0, due=1, **given).all == (2, way, 1, 0)
        # One with a direction crosses but once.
        assert Taken(LANDED, way, 0, due=1, direction=way, before=-way).all == (2, way, 1, 0)

    def test_a_marker_fires_only_if_the_flow_has_reached_it_too(self, way):
        given = {"direction": way, "before": way, "due": 1, "marker": 1}
        for order in (BY_SPEED, BY_ACCELERATION):
            assert Taken(LANDED, way, order, was=BY_SPEED, **given).all == (2, way, 1, order)
            assert Taken(LANDED, way, order, was=0, **given).due == 0
        assert Taken(LANDED, way, 0, was=BY_SPEED, **given).due == 0
        assert Taken(LANDED, way, BY_SPEED, was=BY_SPEED, **(given | {"due": 0})).due == 0
        # Nor if a reset has stopped the state there.
        assert Taken(LANDED, way, BY_STEP, was=BY_SPEED, **given).due == 0
        assert Taken(LANDED, way, BY_STEP, was=BY_STEP, **given).due == 1
        # A reset alone does not fire it.
        taken = Taken(LANDED, way, 0, direction=way, before=-way, marker=1)
        assert taken.all == (NO_TRANSITION, way, 0, 0)
        assert Taken(LANDED, way, BY_STEP, direction=way, before=way, was=BY_STEP, marker=1).side == way


class TestOwnReset:
    """The reset of the guard's own transition has put the state there."""

    def test_that_stops_the_state_on_the_guard(self, way):
        """It counts as not across its own guard if only the next step shows the side."""
        given = {"direction": way, "before": way}
        assert Taken(LANDED, way, BY_STEP, fired=2, **given).side == -way
        assert Taken(LANDED, way, BY_STEP, fired=1, **given).side == way
        assert Taken(LANDED, way, BY_STEP, fired=2, direction=0, before=way).side == way

    def test_without_speed_at_a_root_of_third_order(self, way):
        """Its last crossing had no speed that could be told from zero: the next step shows the side."""
        given = {"direction": way, "before": way, "fired": 2, "was": BY_STEP}
        for speed in (0.9 * way, -0.9 * way, 1.0):
            taken = Taken(LANDED, way, BY_STEP, transversality=speed, **given)
            assert taken.all == (NO_TRANSITION, 0, 0, BY_STEP)
            assert taken.asked["is_held"] == [(way,)]
            rests = Taken(LANDED, way, BY_STEP, transversality=speed, held=True, **given)
            assert rests.all == (RESTING, 0, 0, BY_STEP)
            refused = Taken(LANDED, way, BY_STEP, transversality=speed, held=True, may_fire=False, **given)
            assert refused.chosen == NO_TRANSITION
        for other in ({"transversality": -1.1}, {"transversality": 0.9, "was": 0}):
            taken = Taken(LANDED, way, BY_STEP, held=True, **(given | other))
            assert taken.all == (NO_TRANSITION, -way, 0, BY_STEP)
        both = Taken(LANDED, way, BY_STEP, transversality=0.9, held=True, **(given | {"direction": 0}))
        assert both.all == (NO_TRANSITION, 0, 0, BY_STEP)
        assert "is_held" not in both.asked

    @pytest.mark.parametrize(
        ("order", "found"), [(0, FEW_MOMENTS), (BY_SPEED, MOST_MOMENTS), (BY_STEP, MOST_MOMENTS)]
    )
    def test_signs_beside_tell_where_the_flow_leaves(self, way, order, found):
        given = {"direction": way, "before": way, "fired": 2, "by_signs": True, "transversality": -0.9}
        taken = Taken(LANDED, -way, order, signs=(-way, way, 0.25), **given)
        assert taken.asked["signs_beside"] == [(found,)]
        assert taken.asked["turns_within"] == [(0.25 * LONGER, way)]
        # The flow crosses the guard once more.
        assert taken.all == (2, way, 1, JUMPING)
        turns = Taken(LANDED, -way, order, signs=(way, -way, 0.25), turns=True, **given)
        # Off the guard, on the side that is known, the order stays.
        assert turns.all == (RESTING, -way, 0, JUMPING if order > 0 else 0)
        turns = Taken(LANDED, -way, order, signs=(way, -way, 0.25), turns=True, may_fire=False, **given)
        assert turns.chosen == NO_TRANSITION

    def test_signs_beside_are_not_asked_without_need(self):
        given = {"before": 1, "by_signs": True, "signs": (-1, 1, 0.25), "transversality": 0.9}
        assert "signs_beside" in Taken(LANDED, -1, BY_SPEED, fired=2, **given).asked
        for order, other in (
            (BY_ACCELERATION, {}),
            (BY_SPEED, {"by_signs": False}),
            # Its speed tells where it goes.
            (BY_SPEED, {"transversality": 1.1}),
            (BY_SPEED, {"transversality": -1.1}),
        ):
            asked = Taken(LANDED, -1, order, fired=2, **(given | other)).asked
            assert "signs_beside" not in asked
        assert "signs_beside" not in Taken(LANDED, -1, BY_SPEED, fired=1, **given).asked
        # The speed of the last crossing counts only where a speed decides.
        assert (
            "signs_beside" in Taken(LANDED, -1, BY_STEP, fired=2, **(given | {"transversality": 9.0})).asked
        )

    def test_a_jump_without_signs_that_may_be_asked(self, way):
        """The flow goes on as the signs say, but it is not asked whether its rates turn back."""
        for order, jumps in ((JUMPING, False), (BY_STEP, True)):
            taken = Taken(
                LANDED, -way, order, direction=way, fired=2, jumps=jumps, signs=(-way, way, 0.25), turns=True
            )
            assert taken.all == (2, way, 1, JUMPING)
            assert "turns_within" not in taken.asked

    def test_pushed_at_a_guard_without_speed(self, way):
        """No moment beside the guard shows a change of sign."""
        given = {"before": way, "fired": 2, "by_signs": True, "transversality": 0.9, "held_beside": True}
        taken = Taken(LANDED, -way, BY_SPEED, direction=way, **given)
        assert (taken.asked["is_held_beside"], taken.chosen) == ([(way,)], RESTING)
        assert Taken(LANDED, -way, BY_SPEED, direction=way, may_fire=False, **given).chosen == NO_TRANSITION
        assert Taken(LANDED, -way, BY_SPEED, direction=0, **given).chosen == NO_TRANSITION
        assert Taken(LANDED, -way, 0, direction=way, **given).chosen == NO_TRANSITION
        without = given | {"by_signs": False}
        assert Taken(LANDED, -way, JUMPING, direction=way, **without).chosen == NO_TRANSITION


class TestPushed:
    """A state that stays on a guard, with an acceleration that leads beyond it."""

    def test_held_by_its_own_reset(self, way):
        given = {"direction": way, "before": way, "was": BY_ACCELERATION, "fired": 2}
        taken = Taken(LANDED, way, BY_ACCELERATION, held=True, **given)
        assert (taken.asked["is_held"], taken.all) == ([(way,)], (RESTING, -way, 0, BY_ACCELERATION))
        taken = Taken(LANDED, way, BY_ACCELERATION, held=True, may_fire=False, **given)
        assert taken.all == (NO_TRANSITION, -way, 0, BY_ACCELERATION)
        taken = Taken(LANDED, way, BY_ACCELERATION, held=False, **given)
        assert taken.all == (NO_TRANSITION, way, 0, BY_ACCELERATION)

    def test_held_by_its_own_reset_on_either_side(self, way):
        given = {"direction": 0, "before": way, "was": BY_ACCELERATION, "fired": 2}
        taken = Taken(LANDED, way, BY_ACCELERATION, held=True, **given)
        assert taken.all == (RESTING, way, 0, BY_ACCELERATION)
        assert taken.asked["is_held"] == [(way,)]

    def test_left_there_by_the_reset_of_another(self, way):
        """The guard's own reset must hold it again."""
        given = {"direction": way, "before": way, "was": BY_ACCELERATION, "fired": 1}
        assert Taken(LANDED, way, BY_ACCELERATION, held=True, **given).all == (2, way, 1, BY_ACCELERATION)
        assert Taken(LANDED, way, BY_ACCELERATION, held=False, **given).due == 0

    def test_not_asked_without_a_push(self, way):
        given = {"direction": way, "before": way, "was": BY_ACCELERATION, "fired": 1, "held": True}
        assert "is_held" in Taken(LANDED, way, BY_ACCELERATION, **given).asked
        for now, order, other in (
            (way, BY_SPEED, {}),
            (way, 0, {}),
            (-way, BY_ACCELERATION, {}),
            (way, BY_ACCELERATION, {"was": 0}),
            (way, BY_ACCELERATION, {"left": 0}),
            (way, BY_ACCELERATION, {"due": 1}),
            (way, BY_ACCELERATION, {"marker": 1}),
            # It has just crossed the guard.
            (way, BY_ACCELERATION, {"before": -way}),
        ):
            taken = Taken(LANDED, now, order, **(given | other))
            assert "is_held" not in taken.asked
        assert "is_held" not in Taken(FLOWED, way, BY_ACCELERATION, **given).asked


@pytest.mark.parametrize(
    ("program", "in_series", "expected"),
    [(0, 0, BY_SPEED), (1, 0, JUMPING), (1, 1, BY_SPEED), (0, 1, BY_SPEED)],
)
def test_a_guard_with_bounds_that_is_passed_has_jumped(program, in_series, expected):
    tested = plain(sides, has_program=lambda model, transition: program == 1)
    assert tested.order_passed(SimpleNamespace(guard_in_series=np.array([9, in_series])), 1) == expected


class TestHeldAtRest:
    def times(self, *, a=2.0, place=3.0, scale=(1.0, 50.0)):
        """When the rates, the reset, and the rates after the reset are evaluated."""
        asked = []

        def field(mode, t, x, parameters, out):
            asked.append(("field", (t - 1.0) / 1e-7, *x))
            out[:] = x[1], a

        def reset(transition, t, x, parameters, out):
            asked.append(("reset", (t - 1.0) / 1e-7, *x))
            out[:] = x[0], 0.0

        def guard_gradient(transition, t, x, parameters, out):
            out[:] = 1.0, 0.0, 0.0

        model = SimpleNamespace(
            dimension=2, parameters=None, field=field, reset=reset, guard_gradient=guard_gradient
        )
        work = SimpleNamespace(**{name: np.zeros(2) for name in ("settled", "state", "field_after")})
        work.field, work.gradient = np.array([0.0, a]), np.array([1.0, 0.0, 0.0])
        run = SimpleNamespace(scale=np.array(scale))
        tested = plain(sides)
        assert tested.is_held(model, run, 0, 0, 1.0, np.array([place, 0.0]), np.sign(a), work) == (a != 0)
        return asked

    @pytest.mark.parametrize(
        ("given", "moment"),
        [
            # The size of what the guard depends on, over the largest rate.
            ({}, 1.5),
            ({"place": -3.0}, 1.5),
            ({"scale": (6.0, 1.0)}, 3.0),
            ({"a": -4.0}, 0.75),
            ({"place": 0.5, "scale": (0.25, 50.0)}, 0.25),
            ({"a": 0.5}, 6.0),
            ({"place": 0.0, "scale": (0.0, 1.0)}, 0.5),
            ({"a": 0.0}, 3.0),
        ],
    )
    def test_moments_are_small_for_the_guard(self, given, moment):
        asked = self.times(**given)
        assert [each[0] for each in asked] == ["field", "reset", "field", "field"]
        times = [each[1] for each in asked]
        assert times == pytest.approx([moment, 2 * moment, 2 * moment, 2 * moment], rel=1e-6)
        a, place = given.get("a", 2.0), given.get("place", 3.0)
        speeds = [each[3] for each in asked]
        expected = [1e-7 * moment * a * k for k in (1.0, 2.0, 2.0, 0.0)]
        assert speeds == pytest.approx(expected, rel=1e-6, abs=0.0)
        assert [each[2] for each in asked] == pytest.approx([place] * 4, rel=1e-6, abs=1e-12)


class TestHeldBeside:
    """A mass at rest on the guard ``q``, with the acceleration ``a``; the reset scales its speed."""

    def held(self, a, keeps, towards, *, t=4.0):
        moment = LONGEST * 1e-12
        times = []

        def field(mode, t, x, parameters, out):
            times.append(t)
            assert (mode, parameters) == (1, "p")
            out[:] = x[1], a

        def reset(transition, t, x, parameters, out):
            assert (transition, parameters) == (6, "p")
            times.append(t)
            assert x.tolist() == pytest.approx([a * moment**2, 2.0 * a * moment])
            out[:] = x[0], keeps * x[1]

        def guard_value(model, transition, t, x, scalar):
            times.append(t)
            assert transition == 6
            return x[0]

        def signs_beside(model, run, transition, t, x, moments, work):
            times.append(t)
            assert (transition, moments) == (6, MOST_MOMENTS)
            assert x.tolist() == pytest.approx([a * moment**2, keeps * 2.0 * a * moment])
            sign = int(np.sign(work.field[0]))
            return -sign, sign, 0.0

        model = SimpleNamespace(dimension=2, parameters="p", field=field, reset=reset)
        names = ("settled", "field", "field_after")
        work = SimpleNamespace(**{name: np.zeros(2) for name in names}, scalar=None)
        work.field[1] = a
        tested = plain(
            sides,
            moment_of_rounding=lambda *given: 1e-12,
            guard_value=guard_value,
            signs_beside=signs_beside,
        )
        found = bool(tested.is_held_beside(model, None, 6, 1, t, np.array([0.0, 0.0]), towards, work))
        # The rates are those at the guard again.
        assert work.field.tolist() == [0.0, a]
        moments = [(time - t) / moment for time in times]
        pushed = a * towards > 0.0
        assert moments == pytest.approx([1.0, 2.0, 2.0, 2.0, 2.0, 0.0] if pushed else [1.0, 2.0, 0.0])
        return found

    @pytest.mark.parametrize("a", [3.0, -3.0])
    def test_a_reset_that_turns_the_speed_holds(self, a):
        towards = int(np.sign(a))
        assert self.held(a, -0.5, towards)
        assert not self.held(a, 0.5, towards)
        # A push to the near side needs no holding.
        assert not self.held(a, -0.5, -towards)
        assert not self.held(0.0, -0.5, towards)
