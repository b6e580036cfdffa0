"""Pulses far narrower than a step belong to one mode, or come once in each period: none is stepped over."""

import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate
from hybrid.kernels.events import guards
from hybrid.kernels.steps import forcing
from hybrid.kernels.types.codes import ARGUMENTS, HIGH, IN_TIME, LOW, TERMS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

METHOD = SimpleNamespace(atol=0.5, rtol=0.25, nodes="nodes", b=np.zeros(2))


def model_with(*kinds, components=(-1, 1, -1)):
    """The second of two modes has forcings of these kinds; there are two transitions."""
    count = len(kinds)
    return SimpleNamespace(
        dimension=2,
        target=np.zeros(2),
        timed=np.array([0, 1]),
        first_forcing=np.array([0, 0, count]),
        forcing_kind=np.array(kinds, dtype=int),
        forcing_component=np.array(components),
        programs=SimpleNamespace(first=np.arange(8), checked=np.ones(8, dtype=int)),
    )


def new_run(**values):
    given = {"mode": 1, "phase": 3.0, "cycle": 2, "y": np.array([7.0, -2.0]), "coarse": 0, "unresolved": 0}
    given |= {"calm_mode": 0, "calm_cycle": 2, "calm_until": 0.0, "calm_wait": 0, "since_entry": 0.0}
    return SimpleNamespace(**(given | values))


def test_tolerances_of_forcings():
    """Of the component that a forcing enters; none if that is unknown. The first component counts as well."""
    model = model_with(IN_TIME, IN_TIME, IN_TIME, components=(-1, 1, 0))
    found = [plain(forcing)._tolerance(model, METHOD, new_run(), i) for i in range(3)]
    assert found == [0.0, 0.5 + 0.25 * 2.0, 0.5 + 0.25 * 7.0]


class TestCalm:
    """Forcings in time that are monotone for 16 steps are not looked at again before."""

    def calm(self, *answers, kinds=(IN_TIME, IN_TIME), h=0.25, **values):
        asked, answers = [], list(answers)

        def is_steady(model, program, path, order, clock, start, span, negligible, work):
            asked.append((program, clock, start, span, negligible))
            return answers.pop(0)

        run = new_run(**values)
        tested = plain(forcing, is_steady=is_steady)._is_calm
        found = tested(model_with(*kinds), METHOD, run, 1, None, 1, h, None)
        return bool(found), [program for program, *_ in asked], run, asked

    def test_what_is_known_is_not_asked(self):
        known = {"calm_mode": 2, "calm_until": 3.25}
        assert self.calm(**known)[:2] == (True, [])
        for other in ({"calm_until": 3.2}, {"calm_mode": 1}, {"calm_cycle": 1}):
            found, asked, run, _ = self.calm((True, 0.0), (True, 0.0), **(known | other))
            assert (found, asked) == (True, [2, 3])
            assert (run.calm_mode, run.calm_cycle, run.calm_until) == (2, 2, 7.0)

    def test_each_forcing_in_time_is_asked_for_sixteen_steps(self):
        found, asked, run, given = self.calm((True, 0.0), (True, 0.0))
        assert (found, asked, run.calm_wait) == (True, [2, 3], -1)
        assert given[0][1:] == (-1, 3.0, 4.0, 0.0)
        assert self.calm((True, 0.0), kinds=(ARGUMENTS, IN_TIME, TERMS))[1] == [3]

    def test_after_a_turn_some_steps_go_by(self):
        found, asked, run, _ = self.calm((False, 0.0))
        assert (found, asked, run.calm_wait, run.calm_mode) == (False, [2], 8, 0)
        found, asked, run, _ = self.calm(calm_wait=2)
        assert (found, asked, run.calm_wait) == (False, [], 1)
        assert self.calm((True, 0.0), (True, 0.0), calm_wait=1)[0]

    def test_noise_counts_against_a_tenth_of_the_tolerance(self):
        """Of 1 for the second forcing, over the time 4; the first one has none."""
        assert self.calm((True, 0.0), (True, 0.024))[0]
        assert not self.calm((True, 0.0), (True, 0.026))[0]
        assert not self.calm((True, 1e-9))[0]


@pytest.mark.parametrize(
    ("kinds", "has"),
    [((), False), ((IN_TIME,), False), ((ARGUMENTS, TERMS), True), ((IN_TIME, ARGUMENTS), False)],
)
def test_modes_with_terms_in_the_state(kinds, has):
    assert bool(plain(guards).has_terms_in_state(model_with(*kinds), 1)) == has


@pytest.mark.parametrize(
    ("change", "checked", "found"),
    [
        (7.9, 1, False),
        (8.1, 1, True),
        (-8.1, 1, False),
        (8.1, 0, False),
        (math.nan, 1, True),
        (math.inf, 1, True),
    ],
)
def test_arguments_of_exponentials_that_change(change, checked, found):
    """By more than 8 on the step; only rows that are checked count."""
    asked = []

    def bound(programs, program, path, order, clock, start, pace, middle, radius, registers):
        asked.append((program, clock, start, pace, middle, radius))
        registers[:, LOW], registers[:, HIGH] = 2.0, 2.0
        registers[1, HIGH] = 2.0 + change
        return 1

    model = model_with(IN_TIME, ARGUMENTS, TERMS)
    model.bound = bound
    model.programs = SimpleNamespace(first=np.array([0, 0, 0, 1, 3, 4]), checked=np.array([1, 1, checked, 1]))
    work = SimpleNamespace(registers=np.full((3, 6), 99.0))
    assert bool(plain(forcing)._arguments_change(model, 1, None, 1, -1, 3.0, 0.5, work)) == found
    assert asked == [(3, -1, 3.0, 1.0, 0.25, 0.25)]
    # Arguments come after all that depends on time.
    model.forcing_kind, model.first_forcing = np.array([IN_TIME, IN_TIME, ARGUMENTS, TERMS]), [0, 0, 4]
    model.programs.first = np.array([0, 0, 0, 0, 1, 3, 4])
    assert bool(plain(forcing)._arguments_change(model, 1, None, 1, -1, 3.0, 0.5, work)) == found
    assert asked[1:] == [(4, -1, 3.0, 1.0, 0.25, 0.25)]
    model.programs.first[:] = 0
    assert plain(forcing)._arguments_change(model, 1, None, 1, -1, 3.0, 0.5, work)
    assert not plain(forcing)._arguments_change(model_with(IN_TIME), 1, None, 1, -1, 3.0, 0.5, work)


class TestLongest:
    def longest(
        self,
        answer,
        *,
        kinds=(IN_TIME,),
        timed=True,
        swings=False,
        calm=False,
        clock=-1,
        seen=False,
        **run,
    ):
        """The step up to 1 for what ``first_hidden`` says of each program and length."""
        asked = []

        def first_hidden(model, program, path, order, *given):
            told, start, nodes, h, tolerance, finest, of_state, seen, _ = given
            assert (told, start, nodes) == (clock, 3.0, "nodes")
            # A shorter step has other nodes.
            assert bool(seen) == (self.seen and h == 1.0)
            asked.append((program, h, tolerance, bool(of_state)))
            assert finest == 2.0 * EPSILON * ((3.0 if clock < 0 else 0.0) + self.step)
            found = answer(program, h)
            self.step = self.next(found, h)
            return found

        self.step, self.seen = 1.0, seen
        tested = plain(
            forcing,
            first_hidden=first_hidden,
            _is_calm=lambda *given: calm,
        )._longest_explained
        made = new_run(**run)
        given = (None, 1, clock, "nodes", timed, swings, seen, 1.0, None)
        return tested(model_with(*kinds), METHOD, made, *given), asked, made

    @staticmethod
    def next(found, h):
        place, other, _ = found
        return h if place >= h else place if 2.0 * place >= other else other

    def test_all_is_explained(self):
        step, asked, run = self.longest(lambda program, h: (h, h, 0.0))
        assert (step, asked, run.coarse) == (1.0, [(2, 1.0, 0.0, False)], 0)

    def test_a_step_is_cut_until_it_is_explained(self):
        """To where it is explained, or to the first place that is not, if that is hardly anything."""
        for seen in (False, True):
            step, asked, _ = self.longest(
                lambda program, h: (0.6, 0.7, 0.0) if h > 0.6 else (h, h, 0.0), seen=seen
            )
            assert (step, [h for _, h, *_ in asked]) == (0.6, [1.0, 0.6])
        step, asked, _ = self.longest(lambda program, h: (0.1, 0.3, 0.0) if h > 0.3 else (h, h, 0.0))
        assert (step, [h for _, h, *_ in asked]) == (0.3, [1.0, 0.3])

    def test_who_is_asked(self):
        yes = lambda program, h: (h, h, 0.0)  # noqa: E731
        kinds = (IN_TIME, ARGUMENTS, TERMS)
        both = self.longest(yes, kinds=kinds, timed=True, swings=True)[1]
        assert both == [(2, 1.0, 0.0, False), (4, 1.0, 0.0, True)]
        assert self.longest(yes, kinds=kinds, timed=False, swings=True)[1] == both[1:]
        assert self.longest(yes, kinds=kinds, timed=True, swings=False)[1] == both[:1]
        assert self.longest(yes, kinds=kinds, swings=True, calm=True)[1] == both[1:]
        assert self.longest(yes, kinds=kinds, calm=True)[1] == []
        # Calm is known of time alone, not of a clock.
        for clock in (0, 1):
            assert self.longest(yes, kinds=kinds, calm=True, clock=clock)[1] == both[:1]

    def test_coarse_pieces_are_counted(self):
        """More than ten tolerances, of 1 here, and of forcings in time."""
        second = (ARGUMENTS, IN_TIME)
        for rest, coarse in ((9.9, 0), (10.1, 1)):
            assert self.longest(lambda program, h, r=rest: (h, h, r), kinds=second)[2].coarse == coarse
        found = self.longest(lambda program, h: (h, h, 99.0), kinds=(ARGUMENTS, TERMS), swings=True)
        assert found[2].coarse == 0

    def test_what_is_never_explained_is_passed_in_the_shortest_steps(self):
        """At last in the steps that the method proposes."""
        shortest = 64.0 * EPSILON * 3.0 + EPSILON
        never = lambda program, h: (0.0, 0.5 * h, 0.0)  # noqa: E731
        for before, step in ((0, shortest), (99, shortest), (100, 1.0)):
            found, _, run = self.longest(never, unresolved=before)
            assert (found, run.unresolved) == (step, before + 1)


class TestAttempt:
    """An attempted step of 1/2 with two stages, one at its end and one of the interpolant."""

    H, Y = 0.5, np.array([1.0, -2.0])
    # The third node is the end of the step.
    METHOD = SimpleNamespace(
        a=np.array([[0.0, 0.0, 0.0, 0.0], [0.25, 0.0, 0.0, 0.0], [0.0] * 4, [0.125, 0.5, 0.0, 0.0]]),
        b=np.zeros(2),
        c=np.array([0.0, 0.25, 1.0, 0.75]),
        nodes=np.array([0.0, 0.25, 1.0]),
        powers=np.zeros((4, 4)),
        implicit=0,
    )

    def attempt(self, share, path, changed=True, **changes):
        """``path`` stands for the powers of the interpolant on [0, 1]; ``share`` of the step is explained."""
        self.asked = []

        def interpolant_path(method, h, y, dimension, work):
            assert (method, h, dimension) == (tested_method, self.H, 2)
            work.path[:] = path

        def longest(model, method, run, path, order, clock, nodes, timed, swings, seen, h, work):
            self.asked.append((path.tolist(), order, clock, nodes.tolist(), timed, swings, bool(seen)))
            return share * h

        tested_method = SimpleNamespace(**(vars(self.METHOD) | changes))
        self.work = SimpleNamespace(
            stages=np.array([[2.0, 0.0], [8.0, -4.0], [9.0, 9.0], [9.0, 9.0]]),
            new=np.array([5.0, 6.0]),
            path=np.full((4, 2), 99.0),
            places=np.full((4, 3), 99.0),
        )

        def changes_on(model, mode, path, order, clock, start, h, work):
            assert (mode, path is work.path, order, clock, start, h) == (1, True, 3, -1, 3.0, self.H)
            return changed

        tested = plain(
            forcing,
            _longest_explained=longest,
            interpolant_path=interpolant_path,
            _arguments_change=changes_on,
        )
        model = model_with(ARGUMENTS, TERMS)
        return tested.explained_attempt(model, tested_method, new_run(y=self.Y), self.H, self.work)

    PATH = ((1.0, -2.0), (1.0, 0.0), (-0.25, 0.5), (0.375, 0.125))

    @pytest.mark.parametrize(("share", "step"), [(1.0, 0.5), (0.75, 0.9 * 0.375)])
    def test_its_interpolant_stands_for_it(self, share, step):
        """Powers of the time since the start."""
        assert self.attempt(share, self.PATH) == step
        powers = [[1.0, -2.0], [2.0, 0.0], [-1.0, 2.0], [3.0, 1.0]]
        assert self.asked == [(powers, 3, -1, [0.0, 0.25, 1.0], False, True, True)]

    def test_an_explicit_method_has_seen_its_stages(self):
        """Those at the nodes, the end of the step, and that of the interpolant with its share of the step."""
        self.attempt(1.0, self.PATH)
        assert self.work.places[:3, :2].tolist() == [[1.0, -2.0], [1.25, -2.0], [5.0, 6.0]]
        assert self.work.places[3].tolist() == [1.0 + 0.0625 * 2.0 + 0.25 * 8.0, -3.0, 0.75]

    def test_an_implicit_method_has_seen_its_interpolant(self):
        self.attempt(1.0, self.PATH, implicit=1)
        assert not self.asked[0][-1]
        assert self.work.places.tolist() == [[99.0] * 3] * 4

    def test_no_pulse_is_looked_for_if_no_argument_changes_enough(self):
        assert self.attempt(0.75, self.PATH, changed=False) == 0.5
        assert self.asked == []

    def test_an_infinite_one_is_taken_as_it_is(self):
        assert self.attempt(0.75, (*self.PATH[:3], (0.375, math.inf))) == 0.5
        assert self.asked == []


def test_rates_at_the_start_stand_for_a_step():
    asked = []
    tested = plain(
        forcing,
        _longest_explained=lambda *given: asked.append((given[3][:2].tolist(), *given[4:11])) or 0.125,
    ).explained_step
    work = SimpleNamespace(stages=np.array([[2.0, 3.0]]), path=np.full((6, 2), 99.0))
    assert tested(model_with(IN_TIME), METHOD, new_run(), 0.5, work) == 0.125
    assert asked == [([[7.0, -2.0], [2.0, 3.0]], 1, -1, "nodes", True, False, False, 0.5)]


SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
# A lag of one unit of time, that long after a pulse of height 1 and width 0.01: the integral of
# ``exp(s - 1 - (s / w)^2)``.
WIDTH = 0.01
ANSWER = np.exp(-1.0) * WIDTH * np.sqrt(np.pi) * np.exp(WIDTH**2 / 4)


def gauss(t, height, place, width):
    return height * np.exp(-(((t - place) / width) ** 2))


def allowed_error(solver):
    """A share of the pulse and some absolute tolerances, as for single pulses."""
    share = 1e-3 if isinstance(solver, Tsit5) else 1e-6
    return share * WIDTH + 100 * solver.atol


@cache
def in_turn(backwards):
    """Three modes for 300 each, with pulses of their own; ``backwards`` the last one is listed first."""

    def lagging(k):
        return lambda t, x, p: (-x.x + gauss(t, p.A, p.a + 300.0 * k, p.w),)

    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 100.0, "w": 0.01},
        modes=[Mode(f"m{k}", lagging(k)) for k in (range(2, -1, -1) if backwards else range(3))],
        transitions=[
            Transition(f"m{k}", f"m{k + 1}", Guard(lambda t, x, p, k=k: t - 300.0 * (k + 1), +1))
            for k in range(2)
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("after", [1.0, 10.0, 30.0, 100.0])
def test_each_mode_answers_its_own_pulse(after, backwards, k, solver):
    """After a long rest, one unit of time after its pulse; that the mode before is calm says nothing."""
    place = after + 300.0 * k
    arc = simulate(
        in_turn(backwards), (0.0,), (0.0, place + 1.0), mode="m0", parameters={"a": after}, solver=solver
    )
    assert len(arc.jumps) == k
    assert arc.status.ok
    assert arc.x[-1, 0] == pytest.approx(ANSWER, rel=0, abs=allowed_error(solver))


PERIOD = 100.0


def periodic(t, p):
    """A pulse in each period."""
    return p.A * np.exp(-((np.sin(np.pi * (t - p.a) / PERIOD) * PERIOD / (np.pi * p.w)) ** 2))


@cache
def forced():
    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 5.0, "w": 0.01},
        period=PERIOD,
        modes=[Mode("lag", lambda t, x, p: (-x.x + periodic(t, p),))],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("phase", [0.5, 5.0, 60.0])
def test_each_period_has_its_pulse(phase, solver):
    """That the end of one period is calm says nothing of the next one."""
    for cycle in (0, 1, 2):
        end = phase + PERIOD * cycle + 1.0
        arc = simulate(forced(), (0.0,), (0.0, end), parameters={"a": phase}, solver=solver)
        assert arc.status.ok
        assert arc.x[-1, 0] == pytest.approx(ANSWER, rel=0, abs=allowed_error(solver))
