"""Touches of guards on a step, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events import guards
from hybrid.kernels.guards import touch
from tests.hybrid.kernels.plain import plain

kernels = plain(touch)


class TestNote:
    def noted(self, *places):
        """First and second place of a step, after touches at these places in this order."""
        run = SimpleNamespace()
        kernels.forget_touches(run)
        for transition, place in enumerate(places):
            kernels.note_touch(run, transition, place, 10.0 * place)
        self.run = run
        return run.grazing_place, run.next_grazing

    def test_a_step_without_touches(self):
        assert self.noted() == (NO_ROOT, NO_ROOT)
        assert kernels.share_with_one_touch(self.run) == NO_ROOT > 1.0

    @pytest.mark.parametrize("places", [(0.2, 0.4, 0.8), (0.8, 0.4, 0.2), (0.4, 0.2, 0.8), (0.4, 0.8, 0.2)])
    def test_the_first_two_are_kept_in_any_order(self, places):
        assert self.noted(*places) == (0.2, 0.4)
        assert (self.run.grazing_guard, self.run.grazing_value) == (places.index(0.2), 2.0)
        assert kernels.share_with_one_touch(self.run) == pytest.approx(0.2 + 0.3819 * 0.2, rel=1e-15)

    @pytest.mark.parametrize(("apart", "second"), [(0.9e-6, NO_ROOT), (1.1e-6, 0.5 + 1.1e-6)])
    def test_touches_that_are_close_are_one(self, apart, second):
        assert self.noted(0.5, 0.5 + apart) == (0.5, second)
        assert self.run.grazing_guard == 0
        assert self.noted(0.5 + apart, 0.5) == (0.5, second)
        assert (self.run.grazing_guard, self.run.grazing_value) == (1, 5.0)
        assert self.noted(0.5, 0.5) == (0.5, NO_ROOT)
        assert self.run.grazing_guard == 0


class TestRemember:
    """The 9th step of a run, two of which were rejected, touches the guard of transition 4."""

    def remembered(self, place, *, before=(-1, 0), allows=True):
        kept = []

        def keep_grazing(model, run, record, transition, *rest):
            kept.append((record, transition, *rest[:-1]))

        def allowed(model, transition, t, x, scalar):
            assert (transition, t, x) == (4, 7.5, "state")
            return allows

        run = SimpleNamespace(grazing_guard=4, steps=9, rejected=2, grazing_value=0.25)
        run.touched_step, run.touched_guard = before
        work = SimpleNamespace(state="state", scalar=None)
        tested = plain(touch, keep_grazing=keep_grazing, allowed=allowed)
        tested.remember_touch("model", run, "record", place, 7.5, work)
        self.last = run.touched_step, run.touched_guard
        assert kept in ([], [("record", 4, 7.5, "state", 0.25)])
        return bool(kept)

    def test_is_recorded_where_its_condition_holds(self):
        assert self.remembered(0.5)
        assert not self.remembered(0.5, allows=False)
        assert self.last == (-1, 0)

    @pytest.mark.parametrize("place", [1.0, 1.0 - 0.9e-6])
    def test_a_touch_at_the_end_of_a_step_is_known_to_the_next_one(self, place):
        assert self.remembered(place)
        assert self.last == (7, 5)
        assert self.remembered(1.0 - 1.1e-6)
        assert self.last == (-1, 0)

    @pytest.mark.parametrize("place", [0.0, 0.9e-6])
    def test_a_touch_at_the_start_has_been_recorded_by_the_step_before(self, place):
        assert not self.remembered(place, before=(6, 5))
        assert self.remembered(1.1e-6, before=(6, 5))
        # Not if that step or that guard was another one.
        assert self.remembered(place, before=(5, 5))
        assert self.remembered(place, before=(7, 5))
        assert self.remembered(place, before=(6, 4))


@pytest.mark.parametrize(("used", "room"), [(0, 2), (1, 2), (2, 2), (0, 0)])
def test_a_record_of_touches_that_is_full_only_counts_them(used, room):
    tested = plain(guards, guard_speed=lambda *given: 0.0, guard_acceleration=lambda *given: -4.0)
    names = ("phase", "cycle", "transition", "jumps", "value", "acceleration")
    record = SimpleNamespace(
        grazings=used,
        grazing_state=np.zeros((room, 2)),
        **{f"grazing_{name}": np.zeros(room) for name in names},
    )
    run = SimpleNamespace(grazings=7, mode=1, cycle=3, jumps=5)
    model = SimpleNamespace(dimension=2, parameters=None, field=lambda *given: None)
    work = SimpleNamespace(field=None, gradient=None)
    tested.keep_grazing(model, run, record, 6, 0.5, np.array([1.0, 2.0]), 0.25, work)
    assert run.grazings == 8
    if used < room:
        assert [getattr(record, f"grazing_{name}")[used] for name in names] == [0.5, 3, 6, 5, 0.25, -4.0]
        assert record.grazing_state[used].tolist() == [1.0, 2.0]
    assert record.grazings == used + (used < room)
