"""The length of a Runge-Kutta step and what it leaves behind, with answers in place of its parts."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps import runge_kutta
from hybrid.kernels.steps.runge_kutta import SAFETY, SHRINK
from hybrid.kernels.steps.runge_kutta_guards import NOT_THERE
from hybrid.kernels.types.codes import GO_ON, NO_TRANSITION, NON_FINITE, READY, STALE, STEP_TOO_SMALL
from tests.hybrid.kernels.plain import plain
from tests.hybrid.kernels.steps.test_runge_kutta import graph


class TestStep:
    """A step of a method of second order from the time 7 in the second of three modes.

    The rounding of time is that of 2.
    """

    def step(
        self, *, remaining=100.0, ratio=0.25, outgoing=(), event=None, orthonormal=0, implicit=0, **given
    ):
        calls, clock = [], given.pop("clock", 2.0)

        def told(name, answer=None):
            def tell(*given):
                calls.append((name, *[each for each in given if type(each) in (int, float)]))
                return answer

            return tell

        names = {"rates": None, "starting_step": given.pop("start", 1.0), "attempt": ratio}
        names |= {"alignment_ratio": given.pop("alignment", 0.0), "find_event": event}
        names |= {"reach_any": given.pop("reaches", (NOT_THERE, NO_TRANSITION)), "accept": None}
        names |= {
            "remember_touch_on_step": None,
            "interpolation_stages": None,
            "remember_step": None,
            "carry_rates": None,
            "sides_at": None,
        }
        tested = plain(
            runge_kutta,
            measured_time=lambda *given: clock,
            is_forced=lambda *given: self.forced,
            has_terms_in_state=lambda *given: self.swings,
            **{name: told(name, answer) for name, answer in names.items()},
        )
        self.swings = "explained" in given
        self.forced = self.swings or "shortened" in given
        attempts = SimpleNamespace(
            explained_step=told("explained step", given.pop("shortened", 2.0)),
            explained_attempt=told("explained attempt", given.pop("explained", math.inf)),
        )
        run = SimpleNamespace(
            mode=1,
            phase=7.0,
            y=None,
            stage=READY,
            next_step=2.0,
            last_step=0.0,
            last_ratio=0.0,
            steps=10,
            rejected=5,
            pending=77,
            grazing_place=NO_ROOT,
            first_step=np.zeros(3),
        )
        method = SimpleNamespace(
            exponent=0.5, max_step=math.inf, implicit=implicit, b=np.zeros(2), a=np.zeros((3, 3))
        )
        record = SimpleNamespace(step_phase=np.zeros(given.pop("room", 0)))
        method.max_step = given.pop("max_step", math.inf)
        for name, value in given.items():
            assert hasattr(run, name)
            setattr(run, name, value)
        task = SimpleNamespace(
            attempts=attempts,
            model=SimpleNamespace(dimension=2, **graph((), outgoing, ())),
            method=method,
            run=run,
            record=record,
            work=SimpleNamespace(stages=[None], new=np.zeros(2)),
            tangents=3,
            orthonormal=orthonormal,
        )
        self.run = run
        code, length = tested.runge_kutta_step(task, remaining)
        return (code, length), calls

    def test_an_accepted_step(self):
        found, calls = self.step()
        assert found == (GO_ON, 2.0)
        assert calls == [("attempt", 1, 7.0, 2.0, 3), ("accept", 3, 2.0, 0.0), ("carry_rates", 8)]
        run = self.run
        # Its error is a quarter of the tolerance: the next step is 0.9 times twice as long.
        assert run.next_step == pytest.approx(2.0 * SAFETY * 2.0, rel=1e-14)
        assert (run.last_step, run.last_ratio, run.steps, run.rejected) == (2.0, 0.25, 11, 5)
        assert (run.pending, run.stage, run.first_step[1]) == (NO_TRANSITION, READY, 2.0)
        assert self.step(first_step=np.array([0.0, 0.5, 0.0]))[0] == (GO_ON, 2.0)
        assert self.run.first_step[1] == 0.5

    def test_rates_that_are_stale_are_evaluated_first(self):
        found, calls = self.step(stage=STALE)
        assert found == (GO_ON, 2.0)
        assert calls[:2] == [("rates", 1, 7.0, 3), ("attempt", 1, 7.0, 2.0, 3)]
        assert self.run.stage == READY
        assert self.step(stage=STALE, next_step=0.25)[0] == (GO_ON, 0.25)
        for length in (0.0, -1.0):
            found, calls = self.step(stage=STALE, next_step=length, start=0.5)
            assert found == (GO_ON, 0.5)
            assert calls[1] == ("starting_step", 1, 7.0, 3, 100.0)
        for length in (0.0, math.nan):
            assert self.step(stage=STALE, next_step=0.0, start=length)[0] == (NON_FINITE, 0.0)

    def test_the_last_step_ends_at_the_end(self):
        """Its length says nothing of the next one, unless that may be longer."""
        for remaining, ratio, following in ((0.5, 0.25, 2.0), (2.0, 0.25, 3.6), (0.5, 1e-30, 3.0)):
            found, _ = self.step(remaining=remaining, ratio=ratio)
            assert found == (GO_ON, remaining)
            assert self.run.next_step == pytest.approx(following, rel=1e-14)
        assert self.run.last_ratio == 1e-16

    def test_the_longest_step(self):
        assert self.step(max_step=0.75)[0] == (GO_ON, 0.75)
        assert self.step(max_step=0.75, remaining=0.5)[0] == (GO_ON, 0.5)

    @pytest.mark.parametrize(
        ("ratio", "shrink"),
        [(4.0, 0.45), (1.000001, 0.9), (1e6, SHRINK), (math.inf, SHRINK), (math.nan, 0.1)],
    )
    def test_a_rejected_step_is_shortened(self, ratio, shrink):
        found, calls = self.step(ratio=ratio, last_step=3.0, last_ratio=0.5)
        assert found == (GO_ON, 0.0)
        assert len(calls) == 1
        run = self.run
        assert run.next_step == pytest.approx(2.0 * shrink, rel=1e-6)
        assert (run.steps, run.rejected, run.last_step, run.last_ratio) == (11, 6, 3.0, 0.5)
        assert self.step(ratio=1.0)[0] == (GO_ON, 2.0)

    def test_the_shortest_step_at_the_time_zero(self):
        assert self.step(ratio=4.0, clock=0.0, next_step=1.5e-200 / 0.45)[0] == (GO_ON, 0.0)
        assert self.step(ratio=4.0, clock=0.0, next_step=0.9e-200 / 0.45)[0] == (STEP_TOO_SMALL, 0.0)
        assert self.step(ratio=1.5, clock=0.0, next_step=1e-202)[0] == (STEP_TOO_SMALL, 0.0)

    def test_angles_of_tangent_vectors_count_in_implicit_steps_alone(self):
        for orthonormal, implicit, ratio, accepted in (
            (1, 1, 0.25, False),
            (0, 1, 0.25, True),
            (1, 0, 0.25, True),
        ):
            found, calls = self.step(orthonormal=orthonormal, implicit=implicit, ratio=ratio, alignment=4.0)
            assert found == (GO_ON, 2.0 if accepted else 0.0)
            assert (("alignment_ratio", 2, 3) in calls) != accepted
        assert self.step(orthonormal=1, implicit=1, ratio=0.25, alignment=0.0)[0] == (GO_ON, 2.0)
        assert self.run.last_ratio == 0.25
        assert self.step(orthonormal=1, implicit=1, ratio=9.0, alignment=0.0)[0] == (GO_ON, 0.0)
        assert ("alignment_ratio", 2, 3) not in self.step(orthonormal=1, implicit=1, ratio=1.5)[1]

    def test_pulses_of_the_field_shorten_a_step(self):
        found, calls = self.step(remaining=1.5, shortened=0.5)
        assert found == (GO_ON, 0.5)
        assert calls[:3] == [("explained step", 1.5), ("attempt", 1, 7.0, 0.5, 3), ("accept", 3, 0.5, 0.0)]
        # It is not the last step then.
        assert self.run.next_step == pytest.approx(0.5 * SAFETY * 2.0, rel=1e-14)
        found, calls = self.step(remaining=1.5, shortened=1.5)
        assert found == (GO_ON, 1.5)
        assert self.run.next_step == pytest.approx(1.5 * SAFETY * 2.0, rel=1e-14)
        found, calls = self.step(shortened=2.0, explained=0.25)
        assert found == (GO_ON, 0.0)
        assert (self.run.rejected, self.run.next_step, self.run.last_step) == (6, 0.25, 0.0)
        found, calls = self.step(shortened=2.0, explained=2.0)
        assert found == (GO_ON, 2.0)
        assert calls[2:4] == [("interpolation_stages", 1, 7.0, 2.0), ("explained attempt", 2.0)]

    def test_an_event_ends_a_step(self):
        found, calls = self.step(outgoing=(3,), event=(0.5, 0.125, 3), room=1)
        assert found == (GO_ON, 0.625)
        assert calls == [
            ("attempt", 1, 7.0, 2.0, 3),
            ("find_event", 2.0),
            ("remember_step", 7.0, 0.5),
            ("accept", 3, 0.5, 0.125),
        ]
        assert (self.run.pending, self.run.last_step, self.run.first_step[1]) == (3, 2.0, 0.0)
        assert self.run.next_step == pytest.approx(3.6, rel=1e-14)
        self.step(outgoing=(3,), event=(0.015625, 0.0, 3))
        assert self.run.next_step == 1.5625
        # A step of no length is not recorded.
        found, calls = self.step(outgoing=(3,), event=(0.0, 0.125, 3), room=1)
        assert found == (GO_ON, 0.125)
        assert calls[2:] == [("accept", 3, 0.0, 0.125)]

    def test_a_step_may_be_cut_or_tried_again_without_an_event(self):
        found, calls = self.step(outgoing=(3,), event=(0.5, 0.0, NO_TRANSITION))
        assert found == (GO_ON, 0.5)
        assert calls[2:] == [("accept", 3, 0.5, 0.0), ("sides_at", 7.5), ("carry_rates", 8)]
        assert (self.run.pending, self.run.first_step[1]) == (NO_TRANSITION, 0.5)
        assert self.run.next_step == pytest.approx(3.6, rel=1e-14)
        found, calls = self.step(outgoing=(3,), event=(0.0, 0.0, NO_TRANSITION))
        assert found == (GO_ON, 0.0)
        assert (self.run.rejected, self.run.next_step) == (6, 1.0)
        assert calls[2:] == []
        assert self.step(outgoing=(3,), event=(math.nan, 0.0, NO_TRANSITION))[0] == (STEP_TOO_SMALL, 0.0)

    def test_a_touch_on_the_part_that_is_taken_is_recorded(self):
        for place, touches in ((0.25, True), (0.24, True), (0.26, False)):
            _, calls = self.step(outgoing=(3,), event=(0.5, 0.0, NO_TRANSITION), grazing_place=place)
            assert (("remember_touch_on_step", 7.0, 0.5, 2.0) in calls) == touches
