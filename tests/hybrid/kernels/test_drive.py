"""Where runs end: beside a guard, after a long way to it."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate
from hybrid.kernels import drive
from hybrid.kernels.types import codes
from hybrid.kernels.types.codes import (
    ENTERING,
    GO_ON,
    NO_TRANSITION,
    READY,
    RESTING,
    RUNGE_KUTTA,
    STALE,
    TAYLOR,
)
from tests.hybrid.kernels.plain import plain

kernels = plain(drive)


class TestStep:
    def stepped(self, code=GO_ON, *, tangents=2, abrupt=1, pending=NO_TRANSITION):
        """What is called around a step of a quarter in the second mode."""
        calls = []

        def noted(name, answer=None):
            def call(*given):
                calls.append((name, *(each for each in given if isinstance(each, int | float))))
                return answer

            return call

        tested = plain(
            drive,
            remember_scale=noted("remember", True),
            leave=noted("leave"),
            step_by_propagator=noted("step", (code, 0.25)),
            keep_scale=noted("keep"),
        ).step
        model = SimpleNamespace(abrupt=np.array([1 - abrupt, abrupt]))
        run = SimpleNamespace(mode=1, phase=3.0, pending=pending)
        task = SimpleNamespace(model=model, run=run, work=None, method=None, tangents=tangents)
        parts = SimpleNamespace(look_back=noted("look back"))
        assert tested(parts, task, 9.0) == (code, 0.25)
        return calls

    def test_jumps_in_disguise_are_looked_for_with_tangent_vectors_in_abrupt_modes(self):
        assert self.stepped() == [("remember",), ("leave",), ("step", 9.0), ("look back", 0.25)]
        assert self.stepped(tangents=1) == [("remember",), ("leave",), ("step", 9.0), ("look back", 0.25)]
        assert self.stepped(tangents=0) == [("remember",), ("step", 9.0)]
        assert self.stepped(abrupt=0) == [("remember",), ("step", 9.0)]
        assert self.stepped(codes.NON_FINITE) == [("remember",), ("leave",), ("step", 9.0)]

    def test_sizes_are_kept_at_a_landing(self):
        assert self.stepped(pending=0, abrupt=0) == [("remember",), ("step", 9.0), ("keep", True, 3.25)]
        assert self.stepped(codes.NON_FINITE, pending=0, abrupt=0) == [("remember",), ("step", 9.0)]

    @pytest.mark.parametrize(
        ("propagator", "code", "fragile", "calls", "stage"),
        [
            (RUNGE_KUTTA, GO_ON, 1, ["steps"], READY),
            (TAYLOR, GO_ON, 1, ["series"], READY),
            (TAYLOR, codes.NON_FINITE, 0, ["series"], READY),
            (TAYLOR, codes.STEP_TOO_SMALL, 1, ["series"], READY),
            (TAYLOR, codes.NON_FINITE, 1, ["series", ("steps", STALE)], STALE),
        ],
    )
    def test_a_series_that_fails_is_followed_by_a_step_of_another_method(
        self, propagator, code, fragile, calls, stage
    ):
        made = []
        run = SimpleNamespace(mode=1, stage=READY)

        def runge_kutta_step(task, remaining):
            made.append("steps" if run.stage == READY else ("steps", run.stage))
            run.stage = READY
            return GO_ON, 0.5

        def series_step(task, remaining):
            made.append("series")
            return code, 0.25

        model = SimpleNamespace(
            propagator=np.array([99, propagator]), fragile=np.array([1 - fragile, fragile])
        )
        tested = plain(drive, series_step=series_step).step_by_propagator
        parts = SimpleNamespace(runge_kutta_step=runge_kutta_step)
        found = tested(parts, SimpleNamespace(model=model, run=run), 9.0)
        assert found == ((code, 0.25) if calls == ["series"] else (GO_ON, 0.5))
        assert (made, run.stage) == (calls, stage)


def task_of(**values):
    """A task without a record, in the second of two modes."""
    run = {"mode": 1, "y": np.zeros(8), "pending": NO_TRANSITION, "stage": READY, "steps": 0, "jumps": 0}
    run |= {"jumps_here": 0, "last_fired": 0, "previous_mode": 1, "first_step": np.array([7.0, 8.0])}
    run |= {
        "cycle": 2,
        "phase": 0.0,
        "phase_low": 0.0,
        "horizon": 0.0,
        "since_entry": 0.5,
        "longest_step": 0.25,
        "next_step": 1.0,
        "last_step": 1.0,
    }
    record = {"jump_phase": np.zeros(0), "jumps": 0, "step_phase": np.zeros(0), "steps": 0}
    record |= {"grazing_phase": np.zeros(0), "grazings": 0}
    run, record = run | values, record | values.pop("record", {})
    run.pop("record", None)
    model = SimpleNamespace(
        dimension=2,
        period=4.0,
        target=np.array([1, codes.NO_MODE]),
        accumulates_to=np.array([codes.NO_MODE, 1]),
        timed=np.array([0, 1]),
        timed_jump=np.array([1, 0]),
    )
    return SimpleNamespace(
        model=model,
        run=SimpleNamespace(**run),
        record=SimpleNamespace(**record),
        method=None,
        work=SimpleNamespace(jacobian=None),
        tangents=2,
        orthonormal=0,
    )


class TestFire:
    def fired(self, *, ended=False, max_jumps=10, complete=1, accumulates=True, late=False, **values):
        calls = []

        def finish_chatter(task, fired, left):
            calls.append(("finish", fired, left))
            return ended

        parts = SimpleNamespace(
            jump=lambda task, fired: calls.append(("jump", fired)),
            finish_chatter=finish_chatter,
            complete=complete,
            late_jump=lambda model, method, run, fired, work: calls.append(("late", fired)),
        )
        task = task_of(**values)
        tested = plain(
            drive,
            may_accumulate=lambda model, run, fired: accumulates,
            is_late=lambda method, run: late,
        ).fire
        code = tested(parts, task, 3, 1.0, max_jumps)
        return code, calls, task.run.pending

    def test_a_jump_and_the_end_of_its_chatter(self):
        """The stop is 1 + 4 ahead."""
        calls = [("jump", 0), ("finish", 0, 5.0)]
        assert self.fired(pending=0) == (GO_ON, calls, NO_TRANSITION)
        assert self.fired(pending=0, ended=True) == (codes.ACCUMULATION, calls, NO_TRANSITION)
        assert self.fired(pending=0, ended=True, last_fired=1)[0] == GO_ON
        assert self.fired(pending=1) == (codes.TERMINAL, [("jump", 1)], NO_TRANSITION)

    def test_the_limit_of_a_chatter_is_asked_for_where_there_may_be_one(self):
        assert self.fired(pending=0, accumulates=False) == (GO_ON, [("jump", 0)], NO_TRANSITION)
        assert self.fired(pending=0, accumulates=False, complete=0)[0] == GO_ON
        assert self.fired(pending=0, complete=0) == (codes.INCOMPLETE, [("jump", 0)], NO_TRANSITION)
        assert self.fired(pending=1, complete=0)[0] == codes.TERMINAL

    def test_a_late_jump_that_depends_on_time_is_looked_at_before_it_is_made(self):
        """The jump of an instant that another has begun has no time of its own."""
        assert self.fired(pending=0, late=True)[1][:2] == [("late", 0), ("jump", 0)]
        assert self.fired(pending=0, late=True, since_entry=0.0)[1][0] == ("jump", 0)
        assert self.fired(pending=1, late=True)[1] == [("jump", 1)]

    def test_limits_of_jumps(self):
        assert self.fired(pending=0, jumps=9)[0] == GO_ON
        assert self.fired(pending=0, jumps=10) == (codes.MAX_JUMPS, [], 0)
        assert self.fired(pending=0, jumps_here=1000)[0] == GO_ON
        assert self.fired(pending=0, jumps_here=1001) == (codes.STUCK, [], 0)

    def test_there_must_be_room_for_two_jumps(self):
        for jumps, code in ((1, GO_ON), (2, codes.RECORD_FULL), (3, codes.RECORD_FULL)):
            record = {"jump_phase": np.zeros(3), "jumps": jumps}
            assert self.fired(pending=0, record=record)[0] == code
        record = {"jump_phase": np.zeros(1), "jumps": 0}
        assert self.fired(pending=0, record=record)[0] == codes.RECORD_FULL


class TestEnter:
    def entered(self, fires=NO_TRANSITION, *, rests=False, **values):
        rested = []
        parts = SimpleNamespace(
            enter=lambda *given: fires,
            rests_on_guard=lambda task: rests,
            rest=lambda task: rested.append(True),
        )
        task = task_of(stage=ENTERING, calm_mode=1, at_rest=0, **values)
        code = kernels.enter(parts, task)
        run = task.run
        assert run.calm_mode == 0
        return code, run.stage, run.pending, run.next_step, run.first_step[1], run.last_step, rested

    def test_another_mode_begins_with_its_own_first_step(self):
        assert self.entered(previous_mode=0) == (GO_ON, STALE, NO_TRANSITION, 8.0, 0.0, 0.0, [])
        assert self.entered() == (GO_ON, STALE, NO_TRANSITION, 1.0, 8.0, 0.0, [])

    def test_a_transition_that_is_due_fires(self):
        assert self.entered(0) == (GO_ON, ENTERING, 0, 1.0, 8.0, 1.0, [])

    def test_a_state_at_rest_goes_to_the_limit_or_ends(self):
        for fires, rests in ((RESTING, False), (NO_TRANSITION, True)):
            assert self.entered(fires, rests=rests)[0] == codes.ACCUMULATION
            assert self.entered(fires, rests=rests, last_fired=1)[::6] == (GO_ON, [True])
        assert self.entered(0, rests=True)[2] == 0

    def test_what_is_not_finite_ends_the_run(self):
        """The state and two tangent vectors are six numbers."""
        for place, code in ((0, codes.NON_FINITE), (5, codes.NON_FINITE), (6, GO_ON)):
            y = np.zeros(8)
            y[place] = np.nan
            assert self.entered(y=y)[0] == code


def test_when_a_record_is_full():
    for steps, room, grazings, touches, full in (
        (5, 0, 5, 0, False),
        (1, 3, 0, 0, False),
        (2, 3, 0, 0, True),
        (0, 0, 2, 3, False),
        (0, 0, 3, 3, True),
        (0, 1, 0, 0, True),
        (0, 0, 1, 1, True),
        (0, 0, 0, 1, False),
    ):
        record = SimpleNamespace(
            step_phase=np.zeros(room), steps=steps, grazing_phase=np.zeros(touches), grazings=grazings
        )
        assert bool(kernels.is_full(record)) == full


class TestAdvance:
    """Steps of 1.5 from the phase 0 of the cycle 2 to the phase 1 of the cycle 3, periods of 4: 5 in all."""

    def advanced(
        self, *, step=lambda left: (GO_ON, min(1.5, left)), at_stop=NO_TRANSITION, pending=(), **values
    ):
        calls, pending, full = [], list(pending), values.pop("full", False)
        most, orthonormal = values.pop("max_steps", 99), values.pop("orthonormal", 0)
        seen, late = values.pop("seen", []), values.pop("late", 0.0)

        def stepped(parts, task, left):
            calls.append(left)
            seen.append(task.run.horizon)
            task.run.steps += 1
            if pending:
                task.run.pending = pending.pop(0)
            return step(left)

        def fire(parts, task, stop_cycle, stop_phase, max_jumps):
            calls.append(("fire", task.run.pending, stop_cycle, stop_phase, max_jumps))
            fired, task.run.pending = task.run.pending, NO_TRANSITION
            return codes.TERMINAL if fired == 1 else GO_ON

        def enter(parts, task):
            calls.append("enter")
            # The first mode is one of rest, which another is entered from at once.
            task.run.stage = ENTERING if task.run.mode == 0 else STALE
            task.run.mode = 1
            return GO_ON

        def arrived(task):
            nonlocal at_stop
            found, at_stop = at_stop, NO_TRANSITION
            return found

        tested = plain(
            drive,
            step=stepped,
            fire=fire,
            enter=enter,
            is_full=lambda record: full,
            is_late=lambda method, run: run.longest_step < late,
            begin_stretch=lambda model, run, left: None,
            gets_on=lambda model, method, run, left: True,
        ).advance
        task = task_of(**values)
        task.orthonormal = orthonormal
        parts = SimpleNamespace(
            arrived=arrived,
            keep_apart=lambda *given: calls.append("apart"),
            late_step=lambda model, method, run, span, work: calls.append(("late", run.phase)),
            first_in_order=lambda task, fired, *stop: fired if fired < 2 else NO_TRANSITION,
        )
        code = tested(parts, task, 3, 1.0, most, 50)
        return code, calls, (task.run.cycle, task.run.phase)

    def test_to_the_stop(self):
        assert self.advanced() == (codes.DONE, [5.0, 3.5, 2.0, 0.5], (3, 1.0))
        # A step that is longer by rounding, or on purpose, ends there too.
        found = self.advanced(step=lambda left: (GO_ON, left + 1e-9))
        assert found == (codes.DONE, [5.0], (3, 1.0))

    def test_the_first_call_tells_how_long_the_run_takes(self):
        for known, steps, told in ((0.0, 0, 5.0), (7.0, 0, 7.0), (0.0, 3, 0.0)):
            horizons = []
            self.advanced(horizon=known, steps=steps, seen=horizons)
            assert horizons == [told] * 4

    def test_a_mode_is_entered_first(self):
        assert self.advanced(stage=ENTERING)[1][:2] == ["enter", 5.0]
        assert self.advanced(stage=ENTERING, mode=0)[1][:3] == ["enter", "enter", 5.0]

    def test_jumps_are_fired_where_they_are_pending(self):
        code, calls, _ = self.advanced(pending=(0,))
        assert (code, calls) == (codes.DONE, [5.0, ("fire", 0, 3, 1.0, 50), 3.5, 2.0, 0.5])
        code, calls, clock = self.advanced(pending=(1,))
        assert (code, calls, clock) == (codes.TERMINAL, [5.0, ("fire", 1, 3, 1.0, 50)], (2, 1.5))
        # What is first in order may be none.
        assert self.advanced(pending=(2,))[1] == [5.0, 3.5, 2.0, 0.5]
        assert self.advanced(at_stop=0)[1] == [5.0, 3.5, 2.0, 0.5, ("fire", 0, 3, 1.0, 50)]

    def test_an_event_at_the_stop_keeps_its_own_time(self):
        """The clock is set to the stop only where nothing fires there."""
        code, calls, clock = self.advanced(step=lambda left: (GO_ON, left), pending=(1,))
        assert (code, calls[0], clock) == (codes.TERMINAL, 5.0, (3, 1.0))

    def test_what_ends_it_early(self):
        assert self.advanced(full=True) == (codes.RECORD_FULL, [], (2, 0.0))
        assert self.advanced(max_steps=2) == (codes.MAX_STEPS, [5.0, 3.5], (2, 3.0))
        found = self.advanced(step=lambda left: (codes.STEP_TOO_SMALL, 0.0))
        assert found == (codes.STEP_TOO_SMALL, [5.0], (2, 0.0))

    def test_a_late_step_is_looked_at_at_its_end(self):
        """In a mode that depends on time."""
        assert self.advanced(late=1.5)[1] == [5.0, 3.5, 2.0, 0.5]
        found = [5.0, ("late", 1.5), 3.5, ("late", 3.0), 2.0, ("late", 0.5), 0.5, ("late", 1.0)]
        assert self.advanced(late=1.6)[1] == found
        assert self.advanced(late=9.0, mode=0)[1] == [5.0, 3.5, 2.0, 0.5]
        # The longest step so far is the measure, not the last.
        assert self.advanced(late=1.6, longest_step=1.7)[1] == [5.0, 3.5, 2.0, 0.5]

    def test_vectors_are_kept_apart_inside_of_the_run(self):
        """Not after the last step: there the caller does it."""
        _, calls, _ = self.advanced(orthonormal=1)
        assert calls == [5.0, "apart", 3.5, "apart", 2.0, "apart", 0.5]
        # However short a step is, but not where no time has passed.
        spans = [0.0, 1e-9, 9.0]
        _, calls, _ = self.advanced(orthonormal=1, step=lambda left: (GO_ON, min(spans.pop(0), left)))
        assert calls == [5.0, 5.0, "apart", 5.0 - 1e-9]


@cache
def ramp(direction):
    return HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (float(direction),))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: x.q, direction))],
    )


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("far", [2.0**10, 2.0**20, 3.0**20])
def test_the_size_of_the_state_at_the_end_tells_whether_it_is_on_a_guard(far, direction):
    """A run that starts there does not know how far the state has come. The flight is exact."""
    for ulps in range(-20, 21):
        end = far + ulps * np.spacing(far)
        first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=Taylor())
        second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=Taylor())
        assert len(first.jumps) + len(second.jumps) == 1, ulps


@pytest.mark.parametrize("solver", [DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("direction", [-1, 1])
def test_no_crossing_is_lost_or_doubled_between_two_runs(direction, solver):
    """Rounding of the last step may take the state beyond the guard without a root on the step."""
    for far in np.linspace(1.0, 40.0, 14):
        for ulps in range(-24, 25, 2):
            end = far + ulps * np.spacing(far)
            first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=solver)
            second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=solver)
            assert len(first.jumps) + len(second.jumps) == 1, (far, ulps)


PARTED = {
    "time": (lambda t, x, p: (x.v, -x.q), lambda t, x, p: t - p.c, (1.0, 0.0), 0.0),
    "wave": (lambda t, x, p: (x.v, -x.q), lambda t, x, p: np.sin(2 * t) - p.c, (1.0, 0.0), -1.0),
    "ramp": (lambda t, x, p: (61.0, 1.0), lambda t, x, p: x.q - p.c, (-7.1, 0.0), 0.0),
    "fall": (lambda t, x, p: (x.v, -9.81), lambda t, x, p: x.q - p.c, (10.0, 0.0), 0.0),
    "decay": (lambda t, x, p: (-30 * x.q, -x.v + x.q), lambda t, x, p: x.q + 2 * x.v - p.c, (9.0, 2.0), 0.0),
    "moving": (lambda t, x, p: (-30 * x.q, -x.v), lambda t, x, p: x.q - p.c * t, (3.3, -0.7), 0.0),
    "pendulum": (lambda t, x, p: (x.v, -np.sin(x.q)), lambda t, x, p: x.q - p.c, (0.0, 1.5), 100.0),
    "bent": (lambda t, x, p: (x.v, -np.sin(x.q)), lambda t, x, p: x.q * x.q - p.c, (0.0, 1.5), 100.0),
}
ULPS = [*range(-24, 25), *(sign * far for far in (32, 50, 100, 300, 1000, 3000) for sign in (-1, 1))]


@pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__
)
@pytest.mark.parametrize("name", PARTED)
def test_a_run_that_is_split_beside_a_marker_marks_the_crossing_once(name, solver):
    """The first part ends, and the second begins, within some units in the last place of the crossing."""
    field, guard, start, t0 = PARTED[name]
    system = HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.3},
        modes=[Mode("m", field)],
        transitions=[Transition("m", "m", Guard(guard), name="marker")],
    )
    for c in (0.176, 0.3, 0.77):
        options = {"solver": solver, "mode": "m", "parameters": {"c": c}}
        event = simulate(system, start, (t0, t0 + 6.0), **options).jumps.t[0]
        end = event + 1e-6
        for ulps in ULPS:
            cut = event + ulps * np.spacing(event)
            first = simulate(system, start, (t0, cut), **options)
            second = simulate(system, first.x[-1], (cut, end), **options)
            times = np.concatenate([first.jumps.t, second.jumps.t])
            assert len(times) == 1, (c, ulps)
            assert abs(times[0] - event) < 1e-11
