"""What a step tells of the sides of guards, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events import resolution
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP
from hybrid.kernels.types.codes import NO_MODE, NO_TRANSITION
from tests.hybrid.kernels.plain import plain, run_at_guards

kernels = plain(resolution)
BOTH = pytest.mark.parametrize("way", [1, -1])
# The second of two modes has the guards 1 and 2.
MODEL = SimpleNamespace(first_outgoing=np.array([0, 1, 3]), outgoing=np.arange(3))


class TestKept:
    def test_what_is_known_at_the_start_of_a_step_is_restored(self):
        run = run_at_guards(None, [1, -1], [BY_STEP, 0])
        for transition in (1, 2):
            kernels.keep_side(run, transition)
        assert run.rehearsal.tolist() == [[88, 1, -1], [88, BY_STEP, 0], [88] * 3, [88, 0, 0]]
        assert run.passed.tolist() == [88.0, NO_ROOT, NO_ROOT]
        run.side[:], run.on_guard[:], run.rehearsal[3] = 5, 6, 7
        kernels.restore_sides(MODEL, run)
        # The guard of the other mode is left alone.
        assert (run.side.tolist(), run.on_guard.tolist()) == ([5, 1, -1], [6, BY_STEP, 0])
        assert run.rehearsal[3].tolist() == [7, 0, 0]

    @BOTH
    def test_a_change_of_side_is_kept_with_the_side_before(self, way):
        """With that after it if its place is known: an event on the last half of the rest comes after it."""
        for before, place, kept, passed in (
            (-way, NO_ROOT, -way, NO_ROOT),
            (-way, 0.5, way, 0.75),
            (way, 0.5, 0, NO_ROOT),
            (0, 0.5, 2, NO_ROOT),
        ):
            run = run_at_guards(None, [before])
            kernels.keep_side(run, 1)
            run.passed[1] = place
            kernels.keep_change(run, 1, way)
            assert (run.side[1], run.rehearsal[3, 1], run.passed[1]) == (way, kept, passed)

    @BOTH
    def test_a_crossing_is_kept_with_the_middle_of_the_time_since_the_last_change(self, way):
        run = run_at_guards(None, [way])
        kernels.keep_side(run, 1)
        kernels.keep_crossing(run, 1, 0.75, way)
        assert (run.rehearsal[3, 1], run.passed[1]) == (-way, NO_ROOT)
        run.passed[1] = 0.25
        kernels.keep_crossing(run, 1, 0.5, way)
        assert run.passed[1] == 0.375

    def test_sides_before_an_event_nearer_to_the_first_change_than_to_the_crossing(self):
        def sides(earliest, passed):
            run = run_at_guards(None, [1, 1])
            run.rehearsal[3] = 88, -1, 1
            run.passed[1:] = passed, NO_ROOT
            kernels.set_sides_before(MODEL, run, earliest)
            return run.rehearsal[3].tolist()

        assert sides(0.4, 0.5) == [88, 1, 1]
        assert sides(0.5, 0.5) == [88, -1, 1]
        assert sides(0.6, 0.5) == [88, -1, 1]
        assert sides(NO_ROOT, 0.5) == [88, -1, 1]


def guard_model(guard, gradient=(3.0, 4.0, 0.0), field=None, **more):
    """A model of two states; the guard is a function of time and state."""

    def write(transition, t, x, parameters, out):
        assert transition == 1
        out[0] = guard(t, x)

    def write_gradient(transition, t, x, parameters, out):
        out[:] = gradient

    def write_field(mode, t, x, parameters, out):
        assert mode == 6
        out[:] = field(x)

    given = {"dimension": 2, "parameters": None, "guard": write, "guard_gradient": write_gradient}
    return SimpleNamespace(**given, field=write_field, **more)


def memory():
    names = {"state": 2, "field_after": 2, "gradient": 3, "scalar": 1}
    work = SimpleNamespace(**{name: np.zeros(length) for name, length in names.items()})
    work.gradient[:] = 3.0, 4.0, 0.0
    return work


@BOTH
@pytest.mark.parametrize("turn", [1, -1])
def test_a_guard_keeps_its_sign_for_a_hundred_errors(way, turn):
    """The error moves ``3 x + 4 y`` by 3 * 0.5 + 4 * 2 = 9.5."""
    model, work = guard_model(lambda t, x: 3.0 * x[0] + 4.0 * x[1]), memory()
    for size, kept in ((950.1, True), (949.9, False)):
        work.field_after[:] = turn * 0.5, turn * 2.0
        x = np.array([way * size, way * size]) / 7.0
        assert bool(kernels.keeps_sign(model, 1, 0.0, x, work)) == kept
    assert kernels.keeps_sign(guard_model(lambda t, x: -1.0), 1, 0.0, np.zeros(2), work)


@BOTH
def test_a_guard_underflows_if_it_is_tiny_at_both_places(way):
    def found(first, last):
        def guard(t, x):
            return way * {(1.0, "x"): first, (2.0, "y"): last}[t, x]

        return bool(kernels.underflows(guard_model(guard), 1, 1.0, "x", 2.0, "y", np.zeros(1)))

    tiny, small = 0.99e-250, 1.01e-250
    assert found(tiny, -tiny)
    assert found(tiny, 0.0)
    assert found(0.0, tiny)
    assert not found(0.0, 0.0)
    assert not found(small, tiny)
    assert not found(tiny, small)


class TestBesideGuard:
    """The guard ``3 x + 4 y`` at 10; a state displaced by 25 units of it moves by (3, 4)."""

    X = np.array([2.0, 1.0])

    def guard(self, t, x):
        return 3.0 * x[0] + 4.0 * x[1]

    def test_the_speed_where_the_guard_is_larger(self):
        model, work = guard_model(self.guard, field=lambda x: (x[0], -x[1])), memory()
        found = kernels.speed_displaced(model, 1, 6, 0.0, self.X, 25.0, work)
        assert work.state.tolist() == [5.0, 5.0]
        assert found == 3.0 * 5.0 - 4.0 * 5.0
        assert kernels.speed_displaced(model, 1, 6, 0.0, self.X, -25.0, work) == 3.0 * -1.0 + 4.0 * 3.0

    @BOTH
    def test_the_field_beyond_holds_a_state_that_it_does_not_lead_on(self, way):
        """Towards the guard the speed is negative; beyond it, at -10, it may go on or turn."""

        def holds(beyond, speed):
            def field(x):
                assert self.guard(0.0, x) == pytest.approx(-10.0)
                return beyond, 0.0

            model, work = guard_model(self.guard, field=field), memory()
            return bool(kernels.field_holds(model, 1, 6, 0.0, self.X, speed, work))

        assert holds(way, -way)
        assert holds(0.0, -way)
        assert not holds(way, way)
        assert not holds(0.125 * way, 0.125 * way)

    @BOTH
    def test_a_field_leads_to_the_guard_from_a_side(self, way):
        def leads(speed, side):
            def field(x):
                # As near as rounding, which is 0.5 here.
                assert self.guard(0.0, x) == pytest.approx(0.5 * side, rel=1e-12)
                return speed, 0.0

            model, work = guard_model(self.guard, field=field), memory()
            work.gradient[:] = 88.0
            tested = plain(resolution, rounding_band=lambda *given: 0.5)
            return bool(tested.leads_to_guard(model, None, 1, 6, 0.0, self.X, side, work))

        assert leads(-way, way)
        assert not leads(way, way)
        assert not leads(0.0, way)

    def test_no_speed_is_known_where_the_guard_jumps(self):
        def speed(distance, share):
            def guard(t, x):
                return share * distance

            model, work = guard_model(guard, field=lambda x: (x[0], 0.0)), memory()
            work.gradient[:] = 88.0
            found = kernels.speed_beside(model, 1, 6, 0.0, self.X, 10.0, distance, work)
            assert work.state == pytest.approx(self.X + (distance - 10.0) * np.array([3.0, 4.0]) / 25.0)
            return found

        for distance in (5.0, -5.0):
            there = 3.0 * (2.0 + 3.0 * (distance - 10.0) / 25.0)
            for share in (0.51, 1.0, 1.99):
                assert speed(distance, share) == pytest.approx(there, rel=1e-14)
            for share in (0.49, 2.01, -1.0):
                assert speed(distance, share) == 0.0


class TestDraws:
    """Speeds beside a guard at a given distance and at 16 times of it."""

    def draws(self, below, above, *, value=2.0, band=1.0, direction=-1):
        """Speeds near and far on each side of the guard."""
        distance = max(abs(value), band)
        speeds = {-distance: below[0], -16.0 * distance: below[1], distance: above[0]}
        speeds[16.0 * distance] = above[1]

        def speed_beside(model, transition, mode, t, x, at, distance, work):
            assert (transition, mode, t, x, at) == (1, 6, 0.5, "x", value)
            return speeds[distance]

        tested = plain(resolution, speed_beside=speed_beside, rounding_band=lambda *given: band)
        model = SimpleNamespace(direction=[9, direction])
        return bool(tested.draws_state(model, None, 1, 6, 0.5, "x", value, None))

    @pytest.mark.parametrize("direction", [1, -1, 0])
    @pytest.mark.parametrize("value", [2.0, -2.0, 0.5])
    def test_a_field_that_leads_to_the_guard_from_both_sides(self, direction, value):
        given = {"direction": direction, "value": value}
        assert self.draws((1.0, 4.0), (-1.0, -4.0), **given)
        # The speed of a smooth field grows in proportion to the distance; this one may grow half as much.
        assert self.draws((1.0, 7.99), (-1.0, -7.99), **given)
        assert not self.draws((1.0, 8.01), (-1.0, -4.0), **given)
        assert not self.draws((1.0, 4.0), (-1.0, -8.01), **given)
        # It must lead there on both sides.
        assert not self.draws((-1.0, -4.0), (-1.0, -4.0), **given)
        assert not self.draws((1.0, 4.0), (1.0, 4.0), **given)
        assert not self.draws((1.0, 4.0), (0.0, 0.0), **given)
        # Farther away, too.
        assert not self.draws((1.0, -0.5), (-1.0, -4.0), **given)
        assert not self.draws((1.0, 4.0), (-1.0, 0.5), **given)


class TestStays:
    """A run in mode 1 right after a jump."""

    def stays(
        self, *, left=1, fired=1, draws=(1,), value=0.99, direction=1, side=1, on_guard=BY_SPEED, **given
    ):
        """``draws`` are the guards to which the field leads, whose errors are below 1."""

        def draws_state(model, run, transition, mode, t, x, found, work):
            assert (mode, t, x, found) == (1, 0.5, "y", value)
            return transition in draws

        def guard(transition, t, x, parameters, out):
            out[0] = value

        tested = plain(resolution, draws_state=draws_state, error_band=lambda method, run, gradient, n: 1.0)
        model = SimpleNamespace(
            **vars(MODEL),
            dimension=2,
            parameters=None,
            guard=guard,
            guard_gradient=lambda *given: None,
            target=np.array([9, *given.get("target", (1, 1))]),
            surface=np.array([9, *given.get("surface", (5, 6))]),
            direction=np.array([9, direction, direction]),
        )
        run = SimpleNamespace(mode=1, previous_mode=left, last_fired=fired, phase=0.5, y="y")
        run.side, run.on_guard = np.array([9, side, side]), np.array([9, on_guard, on_guard])
        return bool(tested.stays_on_guard(model, None, run, memory()))

    def test_where_the_field_leads_back_to_the_guard_that_fired(self):
        assert self.stays()
        assert self.stays(value=-0.99)
        assert not self.stays(value=1.01)
        assert not self.stays(value=-1.01)
        assert not self.stays(draws=(2,))
        assert self.stays(fired=2, draws=(2,))

    def test_not_without_a_jump(self):
        # A transition that ends the run leads to no mode, as if it led back.
        assert not self.stays(left=NO_MODE, target=(NO_MODE, 1))
        assert not self.stays(left=0, fired=NO_TRANSITION, draws=(2,), target=(1, 0))

    @BOTH
    def test_not_if_its_speed_leads_away(self, way):
        """A guard that leaves to the side from which it fires will fire again only after it has turned."""
        assert not self.stays(direction=way, side=-way)
        assert self.stays(direction=way, side=way)
        assert self.stays(direction=way, side=-way, on_guard=BY_ACCELERATION)

    def test_another_mode_from_which_the_same_guard_leads_back(self):
        other = {"left": 0, "fired": 1, "draws": (2,)}
        assert self.stays(**other, target=(1, 0), surface=(5, 5))
        assert not self.stays(**other, target=(1, 1), surface=(5, 5))
        assert not self.stays(**other, target=(1, 0), surface=(5, 6))
        # In the same mode another guard does not lead back, though it has the same surface.
        assert not self.stays(fired=1, draws=(2,), target=(1, 1), surface=(5, 5))
