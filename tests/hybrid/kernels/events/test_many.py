"""Where each of many runs starts, and whether there is something to tell of it, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import many
from hybrid.kernels.types.codes import (
    BEYOND,
    DESINGULARISED,
    DONE,
    EXACT,
    GO_ON,
    LEAVES,
    MAX_STEPS,
    NO_MODE,
    NO_OBJECTION,
    NO_TRANSITION,
    REFUSED,
    ROOTED,
    RUNGE_KUTTA,
    TAYLOR,
)
from tests.hybrid.kernels.plain import plain
from tests.hybrid.kernels.types.ends import end


def start(
    given, *, named=NO_MODE, outgoing=((0, 2), (1,)), kinds=(RUNGE_KUTTA, RUNGE_KUTTA), undefined=False
):
    """The mode of a start for the verdicts given by transition; modes are left by these transitions."""
    asked = []

    def verdicts_on(parts, model, run, work, first, stop, verdicts):
        assert not np.any(verdicts)
        asked.append((first, stop))
        for mode in range(first, stop):
            for transition in outgoing[mode]:
                verdicts[transition] = given.get(transition, NO_OBJECTION)
        return 0 if undefined else NO_TRANSITION

    first_outgoing = np.cumsum([0, *map(len, outgoing)])
    model = SimpleNamespace(
        first_outgoing=first_outgoing,
        outgoing=np.array([each for some in outgoing for each in some]),
        propagator=np.array(kinds),
    )
    task = SimpleNamespace(model=model, run=None, work=None)
    # What an earlier run has left is forgotten.
    verdicts = np.full(first_outgoing[-1], BEYOND)
    found = plain(many, verdicts_on=verdicts_on).mode_of_start(None, task, named, verdicts)
    assert asked == [(0, len(outgoing)) if named == NO_MODE else (named, named + 1)]
    return found


@pytest.mark.parametrize(
    ("given", "mode"),
    [
        # Both modes allow it, one does, none does.
        ({}, NO_MODE),
        ({0: BEYOND}, 1),
        ({2: LEAVES}, 1),
        ({1: BEYOND}, 0),
        ({1: LEAVES}, 0),
        ({0: BEYOND, 1: BEYOND}, NO_MODE),
    ],
)
def test_the_only_mode_that_allows_the_state(given, mode):
    assert start(given) == mode
    assert start(given, undefined=True) == NO_MODE


@pytest.mark.parametrize("kind", [RUNGE_KUTTA, TAYLOR, EXACT, DESINGULARISED, ROOTED])
def test_a_mode_that_is_named(kind):
    """It may start beyond its guards, except where its series hold their roots."""
    for named, beyond in ((0, 0), (0, 2), (1, 1)):
        kinds = [RUNGE_KUTTA, RUNGE_KUTTA]
        kinds[named] = kind
        assert start({}, named=named, kinds=kinds) == named
        assert start({beyond: LEAVES}, named=named, kinds=kinds) == named
        expected = NO_MODE if kind in (DESINGULARISED, ROOTED) else named
        assert start({beyond: BEYOND}, named=named, kinds=kinds) == expected
        assert start({}, named=named, kinds=kinds, undefined=True) == NO_MODE


def test_guards_beyond_the_start_count_only_in_a_mode_that_is_named():
    """Elsewhere they belong to modes that the state is not in."""
    verdicts = np.array([BEYOND, LEAVES, NO_OBJECTION, BEYOND])
    assert plain(many).guards_beyond(1, verdicts) == 2
    assert plain(many).guards_beyond(0, verdicts) == 2
    assert plain(many).guards_beyond(NO_MODE, verdicts) == 0
    assert plain(many).guards_beyond(1, verdicts[1:3]) == 0


class TestManyRuns:
    """Clocks that count up from their origin, one step per unit; their jumps are their whole tens."""

    TIMES = (2, 3, 7)

    def begin(self, *origins, refused=(), told=(), verdict=NO_OBJECTION):
        """Memory for runs from ``origins``; those ``refused`` cannot start, those ``told`` have a note."""
        count = len(origins)
        self.origins = np.array([[each, -each] for each in origins], dtype=float)
        self.refused, self.told, self.verdict = refused, told, verdict
        self.model, told = end()
        told |= {"y": np.zeros(2), "scale": np.zeros(2), "mode": -1, "jumps": 0, "steps": 0}
        self.run = SimpleNamespace(**told)
        self.run_words, self.work_words = np.array([7, 7]), np.array([7, 7, 7])
        self.states = np.full((count, len(self.TIMES), 2), np.nan)
        self.places = np.full((count, 3), 99)
        self.reached, self.steps = np.array([99]), 0
        return self

    def set_words(self, words, fresh):
        words[:] = fresh
        self.run.steps = self.run.unproved = 0

    def advance(self, parts, task, cycle, phase, most, max_jumps):
        run = task.run
        assert (parts, max_jumps, phase) == ("parts", 50, 0.5 * cycle)
        # The memory is fresh where a run starts.
        assert (self.run_words.tolist(), self.work_words.tolist()) == ([1, 2], [3, 4, 5])
        while run.steps < cycle:
            if run.steps == most:
                return MAX_STEPS
            run.steps += 1
            run.y += 1.0
            self.steps += 1
        run.jumps = int(run.y[0]) // 10
        run.unproved = int(int(run.y[0]) - cycle in self.told)
        return DONE

    def call(self, begin=0, resumed=0, max_steps=100, budget=1000):
        def mode_of_start(parts, task, named, verdicts):
            assert task.run.scale.tolist() == [abs(each) for each in task.run.y]
            return NO_MODE if task.run.y[0] in self.refused else named

        tested = plain(many, mode_of_start=mode_of_start, set_words=self.set_words)
        task = SimpleNamespace(run=self.run, model=self.model)
        starts = SimpleNamespace(
            **{"reached": begin, "resumed": resumed, "max_steps": max_steps, "max_jumps": 50},
            **{"run_words": self.run_words, "work_words": self.work_words},
            **{"fresh_run": np.array([1, 2]), "fresh_work": np.array([3, 4, 5])},
            **{"origins": self.origins, "named": 4, "found": self.places},
            verdicts=np.array([self.verdict]),
        )
        cycles = np.array(self.TIMES)
        self.steps = 0
        code = tested.many_runs(
            self.advance, "parts", task, starts, cycles, 0.5 * cycles, budget, self.states
        )
        assert starts.resumed == (code == GO_ON)
        self.reached[0] = starts.reached
        return code

    def assert_complete(self, rows, origins):
        for row, origin in zip(rows, origins, strict=True):
            expected = [[origin + time, time - origin] for time in self.TIMES]
            assert self.states[row].tolist() == expected
            assert self.places[row].tolist() == [4, (origin + 7) // 10, 3]

    def test_every_run_starts_anew(self):
        assert self.begin(10, 15, 33).call() == DONE
        assert self.reached[0] == 3
        self.assert_complete(range(3), (10, 15, 33))

    def test_runs_before_the_first_one_are_left_alone(self):
        assert self.begin(10, 15, 33).call(begin=1) == DONE
        self.assert_complete((1, 2), (15, 33))
        assert np.all(np.isnan(self.states[0]))
        assert self.places[0].tolist() == [99] * 3

    @pytest.mark.parametrize("budget", [1, 2, 3, 5, 8, 20])
    def test_a_call_makes_no_more_steps_than_its_budget_and_the_next_one_resumes(self, budget):
        self.begin(10, 15, 33)
        made, calls = 0, 0
        code = self.call(budget=budget)
        while code == GO_ON:
            assert self.steps == budget
            made, calls = made + self.steps, calls + 1
            assert self.reached[0] == made // 7
            code = self.call(begin=self.reached[0], resumed=1, budget=budget)
        assert (code, self.reached[0]) == (DONE, 3)
        assert made + self.steps == 21
        assert calls == 20 // budget
        self.assert_complete(range(3), (10, 15, 33))

    def test_a_run_that_needs_too_many_steps(self):
        """Its limit is its own, however many steps the budget has left; what it has reached is kept."""
        for budget in (4, 1000):
            assert self.begin(10, 15).call(max_steps=4, budget=budget) == MAX_STEPS
            assert self.reached[0] == 0
            assert self.states[0, :2].tolist() == [[12.0, -8.0], [13.0, -7.0]]
            assert np.all(np.isnan(self.states[0, 2]))
            assert self.places[0, 2] == 2
        assert self.begin(10, 15).call(max_steps=7, budget=14) == DONE

    def test_a_run_that_cannot_start(self):
        assert self.begin(10, 15, 33, refused=(15,)).call() == REFUSED
        assert self.reached[0] == 1
        self.assert_complete((0,), (10,))
        assert self.places[1, 2] == 0

    def test_a_run_of_which_there_is_something_to_tell(self):
        """It is complete, and the call ends with it."""
        assert self.begin(10, 15, 33, told=(15,)).call() == DONE
        assert self.reached[0] == 1
        self.assert_complete((0, 1), (10, 15))
        assert np.all(np.isnan(self.states[2]))

    def test_a_start_beyond_a_guard_of_the_mode_that_is_named_is_told(self):
        assert self.begin(10, 15, verdict=BEYOND).call() == DONE
        assert self.reached[0] == 0
        assert self.begin(10, 15, verdict=LEAVES).call() == DONE
        assert self.reached[0] == 2


def test_memory_is_set_to_what_is_fresh():
    words = np.array([7, 8, 9])
    plain(many).set_words(words, np.array([1, 2, 3]))
    assert words.tolist() == [1, 2, 3]
