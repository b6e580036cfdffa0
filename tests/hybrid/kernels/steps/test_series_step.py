"""A step along series: what its parts are asked, how its length is found, and how it ends."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import series as module
from hybrid.kernels.steps.series import MOST_SHORTER, SHORTER
from hybrid.kernels.steps.series_length import EXACT_TOLERANCE, MOST_BITS
from hybrid.kernels.types.codes import (
    DESINGULARISED,
    EXACT,
    GO_ON,
    HIGHEST_ORDER,
    NO_TRANSITION,
    NON_FINITE,
    READY,
    ROOTED,
    STALE,
    TAYLOR,
)
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

MODE, T = 1, 3.0


class Calls:
    """Parts with known answers, and the numbers that they were called with."""

    def __init__(self):
        self.made = []

    def part(self, name, answer=None):
        def call(*given):
            told = [each for each in given if isinstance(each, int | float | np.integer | np.bool_)]
            self.made.append((name, *told))
            return answer(self) if callable(answer) else answer

        return call

    def names(self):
        return [name for name, *_ in self.made]


class TestStep:
    """A step of at most 0.5 in the second mode, where the series are ``2 + 8 s``, ``3 + s^2`` and so on."""

    ORDER = 6
    N = 2

    def step(self, remaining=9.0, *, kind=TAYLOR, degree=0, guards=2, tangents=0, longest=0.5, **others):
        calls = self.calls = Calls()
        nothing = (2.0, NO_TRANSITION, 1.0, NO_TRANSITION)
        answers = {
            "set_origins": None,
            "longest_step": (longest, -7.0, 3.0),
            "within_floats": (4, longest, -8.0, 5.0),
            "moves_nothing": False,
            "is_regular": True,
            "followed": 0.125,
            "as_far_as_last_time": math.inf,
            "unhurried": 7.0,
            "step_until": 0.375,
            "earliest_on_series": nothing,
            "restore_sides": None,
            "remember_touch": None,
            "remember_series": None,
            "accept_series": None,
            "sides_at": None,
            "project_on_guard": None,
            "reach_guard": 2.0**-20,
            "evaluate_with_sizes": None,
        }
        parts = {name: others.pop(name, answer) for name, answer in answers.items()}
        self.evaluated = []

        def evaluate_with_sizes(series, order, h, first, width):
            self.evaluated.append((order, h, first, width))
            series[order + 1, :width] = np.polynomial.polynomial.polyval(h, series[: order + 1, :width])
            series[order + 2, :width] = np.polynomial.polynomial.polyval(h, abs(series[: order + 1, :width]))

        parts["evaluate_with_sizes"] = evaluate_with_sizes
        made = {name: calls.part(name, answer) for name, answer in parts.items()}
        made["evaluate_with_sizes"] = evaluate_with_sizes
        tested = plain(module, power_of_two=np.exp2, **made)
        n, order = self.N, self.ORDER
        series = np.zeros((HIGHEST_ORDER + 3, 8))
        self.given = []

        def fill(mode, t, y, parameters, order, out):
            self.given.append((mode, t, len(y), order))
            out[: order + 3] = 0.0
            out[:3, :2] = [[2.0, 3.0], [8.0, 0.0], [0.0, 1.0]]
            # Guards, then the clock: ``s / 2 + s^2``.
            out[0, 2 : 2 + guards] = -7.0
            out[1, n + guards] = 0.5
            out[2, n + guards] = others.get("bend", 1.0)
            out[0, 0] *= others.get("factor", 1.0)

        model = SimpleNamespace(
            dimension=n,
            parameters=None,
            series=fill,
            propagator=np.array([9, kind]),
            degree=np.array([9, degree]),
            fragile=np.array([9, others.pop("fragile", 0)]),
            first_outgoing=np.array([0, 1, 1 + guards]),
            first_forcing=np.array([0, 0, others.pop("forced", 0)]),
            tangent_start=8,
            tangent_columns=np.array([99, 16]),
            timed=np.array([0, 1]),
            affine_guard=np.array([9, 1, others.pop("affine", 1)]),
            guard_in_series=np.array([9, 9, others.pop("in_series", 1)]),
        )
        method = SimpleNamespace(order=order, rtol=1e-5, atol=1e-6, max_step=others.pop("max_step", math.inf))
        self.run = SimpleNamespace(
            **{"mode": MODE, "phase": T, "y": np.arange(6.0), "stage": STALE, "steps": 10, "pending": 7}
            | {"grazing_place": 2.0, "since_entry": 5.0}
            | others
        )
        attempts = SimpleNamespace(
            explained_series=calls.part("explained_series", others.get("explained", 0.25))
        )
        self.work = SimpleNamespace(
            series=series, weights=None, state=np.zeros(2), polynomial=None, stack=None
        )
        record = SimpleNamespace(step_phase=np.zeros(others.get("record", 0)))
        task = SimpleNamespace(
            attempts=attempts,
            model=model,
            method=method,
            run=self.run,
            record=record,
            work=self.work,
            tangents=tangents,
        )
        return tested.series_step(task, remaining)

    def called(self, name):
        return [made[1:] for made in self.calls.made if made[0] == name]

    @pytest.mark.parametrize("tangents", [0, 1, 2])
    def test_a_step_without_events(self, tangents):
        assert self.step(tangents=tangents) == (GO_ON, 0.5)
        assert (self.run.steps, self.run.stage, self.run.pending) == (11, READY, 7)
        assert self.given == [(MODE, T, 2 * (1 + tangents), 6)]
        groups = 1 if tangents else 0
        assert self.called("longest_step") == [(2, 8, 16, groups, 6, 1e-5, 1e-6, False)]
        assert self.evaluated == [(6, 0.5, 0, 8)]
        assert self.called("is_regular") == [(2, 6, 1e-5, False, -7.0, 3.0)]
        assert self.called("earliest_on_series") == [(6, T, 0.5, -1)]
        assert self.called("accept_series") == [(tangents, 6, 0.5)]
        for name in ("set_origins", "within_floats", "unhurried", "followed", "step_until", "sides_at"):
            assert name not in self.calls.names()
        assert "moves_nothing" not in self.calls.names()
        self.step(guards=0)
        assert self.evaluated == [(6, 0.5, 0, 4)]
        assert "earliest_on_series" not in self.calls.names()
        assert "sides_at" not in self.calls.names()
        self.step(guards=1)
        assert self.called("earliest_on_series") == [(6, T, 0.5, -1)]

    def test_exact_and_polynomial_modes(self):
        self.step(kind=EXACT)
        assert self.given[0][3] == HIGHEST_ORDER
        assert self.called("longest_step") == [(2, 8, 16, 0, HIGHEST_ORDER, EXACT_TOLERANCE, 0.0, True)]
        assert self.called("is_regular") == [(2, HIGHEST_ORDER, EXACT_TOLERANCE, True, -7.0, 3.0)]
        # A polynomial is followed up to the end of the run, or of the last stay.
        for kind in (EXACT, TAYLOR):
            assert self.step(2.5, kind=kind, degree=2) == (GO_ON, 2.5)
            assert self.given[0][3] == 2
            assert "longest_step" not in self.calls.names()
            assert "is_regular" not in self.calls.names()
            assert self.step(2.5, degree=2, as_far_as_last_time=1.5) == (GO_ON, 1.5)
            assert self.step(2.5, degree=2, max_step=0.75) == (GO_ON, 0.75)
        assert self.step(math.inf, degree=2) == (GO_ON, 7.0)
        assert self.called("unhurried") == [(2,)]
        assert self.step(2.5, degree=1) == (GO_ON, 2.5)
        assert self.given[0][3] == 1
        # The root of the next series is looked for behind a series of the full order.
        self.step(2.0, degree=2)
        assert self.work.series[7, :6].tolist() == [0.0, 0.0, -7.0, -7.0, 0.0, 0.0]

    def test_numbers_too_large_for_powers(self):
        reach = 2.0 ** (MOST_BITS / self.ORDER)
        for longest, fits in (
            (1.01 / reach, True),
            (0.99 / reach, False),
            (0.99 * reach, True),
            (1.01 * reach, False),
        ):
            self.step(longest=longest, remaining=1e300)
            assert ("within_floats" in self.calls.names()) != fits
            if not fits:
                assert self.called("within_floats") == [(2, 8, 16, 0, 6, 1e-5, 1e-6, False)]
                assert self.called("is_regular") == [(2, 4, 1e-5, False, -8.0, 5.0)]
                assert self.evaluated == [(4, longest, 0, 8)]

    def test_no_step(self):
        for longest in (0.0, -1.0, math.nan):
            assert self.step(longest=longest, within_floats=(6, longest, 0.0, 0.0)) == (NON_FINITE, 0.0)
        assert self.step(fragile=1, moves_nothing=True) == (NON_FINITE, 0.0)
        assert self.called("moves_nothing") == [(0.5,)]
        assert self.step(fragile=0, moves_nothing=True) == (GO_ON, 0.5)
        assert self.step(fragile=1) == (GO_ON, 0.5)
        assert self.step(fragile=1, kind=DESINGULARISED, moves_nothing=True) == (GO_ON, 0.5)
        with np.errstate(over="ignore", invalid="ignore"):
            assert self.step(factor=math.inf) == (NON_FINITE, 0.0)

    def test_what_limits_a_step(self):
        assert self.step(0.25) == (GO_ON, 0.25)
        assert self.step(max_step=0.25) == (GO_ON, 0.25)
        assert self.step(as_far_as_last_time=0.25) == (GO_ON, 0.25)
        assert self.step(is_regular=False) == (GO_ON, 0.125)
        assert self.called("followed") == [(6, T, 0.5)]
        assert self.step(is_regular=False, forced=1) == (GO_ON, 0.25)
        assert self.called("explained_series") == [(0, 6, -1, 0.5)]
        assert "followed" not in self.calls.names()
        for explained in (0.0, math.nan):
            assert self.step(forced=1, explained=explained) == (NON_FINITE, 0.0)

    def test_an_event_or_an_end_of_the_proof(self):
        assert self.step(earliest_on_series=(0.5, 2, 1.0, NO_TRANSITION), tangents=2) == (GO_ON, 0.25)
        assert self.run.pending == 2
        assert self.evaluated == [(6, 0.5, 0, 8), (6, 0.25, 0, 8)]
        assert self.called("accept_series") == [(2, 6, 0.25)]
        assert "reach_guard" not in self.calls.names()
        assert "sides_at" not in self.calls.names()
        assert self.step(earliest_on_series=(0.5, 2, 0.5, NO_TRANSITION)) == (GO_ON, 0.25)
        assert self.run.pending == 2
        for theta, fired in ((2.0, NO_TRANSITION), (0.75, 2)):
            assert self.step(earliest_on_series=(theta, fired, 0.5, NO_TRANSITION)) == (GO_ON, 0.25)
            assert self.run.pending == NO_TRANSITION
            assert self.called("sides_at") == [(T + 0.25,)]
            assert self.evaluated[1:] == [(6, 0.25, 0, 8)]

    def test_landings(self):
        hit = {"earliest_on_series": (0.5, 2, 1.0, NO_TRANSITION), "tangents": 2}
        extra = 2.0**-20
        assert self.step(**hit, affine=0) == (GO_ON, 0.25 + extra)
        assert self.called("reach_guard") == [(2, 2, T + 0.25, 1e-8 * 0.25)]
        assert self.step(**hit, kind=ROOTED, affine=0) == (GO_ON, 0.25)
        assert self.called("project_on_guard") == [(2, T + 0.25)]
        assert "reach_guard" not in self.calls.names()
        # On the clock, the place 0.25 is the time 0.1875.
        for in_series, moved in ((1, 0), (0, 2)):
            found = self.step(**hit, kind=DESINGULARISED, in_series=in_series)
            assert found == (GO_ON, 0.1875 + extra)
            assert self.called("reach_guard") == [(moved, 2, T + 0.1875, 5.0 + 0.1875)]

    def test_a_blurred_step_is_shortened_until_it_tells(self):
        answers = iter([(2.0, NO_TRANSITION, 1.0, 2)] * 3 + [(2.0, NO_TRANSITION, 1.0, NO_TRANSITION)])
        h = SHORTER**3 * 0.5
        assert self.step(earliest_on_series=lambda calls: next(answers)) == (GO_ON, h)
        assert len(self.called("restore_sides")) == 3
        assert self.evaluated == [(6, each, 0, 8) for each in (0.5, SHORTER * 0.5, SHORTER**2 * 0.5, h)]
        assert self.called("earliest_on_series")[-1] == (6, T, h, -1)
        # No further than four roundings of time, and not too often.
        blurred = {"earliest_on_series": (2.0, NO_TRANSITION, 1.0, 2)}
        assert self.step(**blurred, phase=SHORTER * 0.501 / (4.0 * EPSILON)) == (GO_ON, 0.5)
        assert self.step(**blurred, phase=SHORTER * 0.499 / (4.0 * EPSILON)) == (GO_ON, SHORTER * 0.5)
        assert self.step(**blurred, phase=0.0)[1] == pytest.approx(0.5 * SHORTER**MOST_SHORTER, rel=1e-12)
        assert len(self.called("restore_sides")) == MOST_SHORTER

    def test_touches(self):
        """The touch at half of the step 0.5; the event cuts it to three quarters."""
        for theta, proved, end in ((0.75, 1.0, 0.75), (2.0, 0.75, 0.75), (2.0, 1.0, 1.0), (0.5, 1.0, 0.5)):
            fired = 2 if theta < 2.0 else NO_TRANSITION
            self.step(earliest_on_series=(theta, fired, proved, NO_TRANSITION), grazing_place=0.5)
            assert self.called("remember_touch") == [(0.5 / end, T + 0.25)]
            assert self.work.state.tolist() == [4.0, 3.0625]
        self.step(earliest_on_series=(0.4, 2, 1.0, NO_TRANSITION), grazing_place=0.5)
        assert self.called("remember_touch") == []
        self.step(kind=DESINGULARISED, grazing_place=0.5)
        assert self.called("remember_touch") == [(0.5, T + 0.1875)]

    def test_the_record(self):
        self.step(record=1)
        assert self.called("remember_series") == [(6, T, 0.5, 0.5, -1)]
        self.step(record=1, kind=DESINGULARISED)
        assert self.called("remember_series") == [(6, T, 0.5, 0.5, 4)]
        self.step(record=1, earliest_on_series=(0.0, 2, 1.0, NO_TRANSITION))
        assert self.called("remember_series") == []

    def test_the_clock_of_a_root(self):
        """At the place 0.5 it shows 0.5, at 0.375 it shows 0.328125."""
        for kind in (DESINGULARISED, ROOTED):
            self.step(kind=kind)
            assert self.called("set_origins") == [(6,)]
        assert self.step(kind=DESINGULARISED, as_far_as_last_time=0.1, max_step=0.1) == (GO_ON, 0.5)
        assert self.called("earliest_on_series") == [(6, T, 0.5, 4)]
        for remaining in (0.5, 0.4):
            assert self.step(remaining, kind=DESINGULARISED)[0] == GO_ON
            assert self.called("step_until") == [(4, 6, 0.5, remaining)]
            assert self.evaluated == [(6, 0.5, 0, 8), (6, 0.375, 0, 8)]
            assert self.called("accept_series") == [(0, 6, 0.375)]
        assert self.step(kind=DESINGULARISED, bend=-0.25) == (GO_ON, 0.1875)
        # No time beyond the end of the run.
        assert self.step(0.3, kind=DESINGULARISED) == (GO_ON, 0.3)
        # What is less than rounding of the clock or of the time is no rest.
        for phase, rest in ((0.0, 4.0 * EPSILON * 0.328125), (2.0**30, 4.0 * EPSILON * 2.0**30)):
            near, far = 0.328125 + 0.75 * rest, 0.328125 + 1.5 * rest
            assert self.step(near, kind=DESINGULARISED, phase=phase) == (GO_ON, near)
            assert self.step(far, kind=DESINGULARISED, phase=phase) == (GO_ON, 0.328125)
            event = (1.0, 2, 1.0, NO_TRANSITION)
            found = self.step(
                near, kind=DESINGULARISED, phase=phase, earliest_on_series=event, reach_guard=0.0
            )
            assert found == (GO_ON, 0.328125)
