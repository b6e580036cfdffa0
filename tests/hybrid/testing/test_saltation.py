"""Differences of the flow across a jump, and divergences, against exact answers in several units."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import (
    PropertyError,
    check_continuity,
    check_extension,
    check_flow_direction,
    check_saltation,
    check_sum_rule,
)
from hybrid.testing.case import Case
from hybrid.testing.engine import Engine
from hybrid.testing.saltation import _divergence
from hybrid.testing.window import STEP, Window
from tests.hybrid.testing.test_planted_faults import Saltation, reset_only

G, E, C = 9.81, 0.8, 0.3
# Units of length and time.
UNITS = [(1.0, 1.0), (1e-6, 1.0), (1e6, 1.0), (1.0, 30.0), (1e3, 0.1)]


def ball(length=1.0, time=1.0, solver=None, engine=None, until=1.0):
    """A ball that is dropped from a height of 1 and bounces once."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"g": G * length / time**2, "e": E},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (x.q, -p.e * x.v)),
                name="bounce",
            )
        ],
    )
    return Case(
        system,
        dict(system.parameters),
        "flight",
        (length, 0.0),
        0.0,
        until * time,
        solver=solver or DOP853(rtol=1e-12, atol=1e-14 * min(length, length / time)),
        engine=engine or Engine(),
    )


def exact(width, length, time):
    """The derivative of the flow over the window, from free flight and the saltation matrix."""
    g, speed = G * length / time**2, -np.sqrt(2 * G) * length / time
    flight = np.array([[1.0, width], [0.0, 1.0]])
    return flight @ np.array([[-E, 0.0], [-(1 + E) * g / speed, -E]]) @ flight


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_window_around_a_bounce(length, time):
    case = ball(length, time)
    window = Window(case, case.the_jump())
    # The height changes by 0.2 of its size while the speed is at its largest, at the bounce.
    width = 0.2 / np.sqrt(2 * G) * time
    assert window.width == pytest.approx(width, rel=1e-9)
    assert (window.begin, window.end) == (window.jump.t - window.width, window.jump.t + window.width)
    wanted = exact(window.width, length, time)
    differences, tolerance = window.differences()
    for found in (differences, window.fundamental(), window.through(window.product())):
        np.testing.assert_allclose(window.scaled(found), window.scaled(wanted), rtol=0, atol=2e-7)
    size = 1.0 + np.abs(window.scaled(wanted)).max()
    least = (20.0 * (1e-12 + 1e-13) / STEP + 1e-7) * size
    assert np.all(tolerance >= 0.999 * least)
    assert np.all(tolerance <= 1.5 * least)
    check_saltation(case)


def test_a_window_reaches_half_way_to_the_next_event_if_nothing_bends():
    """Between two walls at constant speed: events at 1, 3 and 5, and an end at 5.6."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("run", lambda t, x, p: (0.0 * t + 1.0 * x.q**0, 0.0))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(lambda t, x, p: (-1.0, x.v)))
        ],
    )
    for fraction, width in ((0.0, 0.5), (0.4, 1.0), (0.9, 0.3)):
        case = Case(system, {}, "run", (0.0, 0.5), 0.0, 5.6, fraction=fraction, solver=DOP853(rtol=1e-12))
        window = Window(case, case.the_jump())
        assert window.width == pytest.approx(width, abs=1e-9)


def test_tolerances_of_runs_count_in_those_of_differences():
    """At 1e-8 the differences of the flow may be off by 2e-3; at 1e-7 they tell nothing."""
    fine, coarse = (ball(solver=DOP853(rtol=rtol)) for rtol in (1e-8, 1e-7))
    _, tolerance = Window(fine, fine.the_jump()).differences()
    assert np.all(tolerance > 2e-3)
    with pytest.raises(UnsatisfiedAssumption, match="do not converge"):
        Window(coarse, coarse.the_jump()).differences()


def test_jumps_at_one_instant_are_multiplied_in_their_order():
    first, second = np.array([[1.0, 2.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [3.0, 1.0]])
    lost = np.array([[1.0, 0.0], [0.0, 1e-7]])

    def window(*matrices):
        jumps = [SimpleNamespace(saltation=each) for each in matrices]
        made = SimpleNamespace(jump=jumps[0], jumps=jumps, scaled=lambda matrix: matrix)
        return Window.product(made), Window.invertible(made)

    np.testing.assert_array_equal(window(first, second)[0], [[1.0, 2.0], [3.0, 7.0]])
    assert window(first, second)[1]
    assert window(first, lost)[1]
    assert not window(lost, first)[1]


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_a_reset_beyond_its_guard_is_noticed_in_any_unit(length):
    check_extension(ball(length))
    with pytest.raises(PropertyError, match="the guard added to the reset"):
        check_extension(ball(length, engine=Saltation(reset_only)))


def test_integrals_of_the_divergence():
    """They go over the stretches between jumps, and in size over both signs."""
    system = HybridSystem(
        state=("q", "w"),
        parameters={"c": C},
        modes=[Mode("run", lambda t, x, p: (1.0 - p.c * x.q, (t - 1.0) * x.w))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(lambda t, x, p: (0.2, x.w)))
        ],
    )
    case = Case(system, {"c": C}, "run", (0.0, 1.0), 0.0, 3.0, solver=DOP853(rtol=1e-12, atol=1e-14))
    assert len(case.run.arc.jumps) == 2
    # The divergence ``t - 1.3`` changes its sign once.
    total, size = _divergence(case)
    assert total == pytest.approx(4.5 - 1.3 * 3.0, rel=1e-12)
    assert size == pytest.approx(0.5 * (1.3**2 + 1.7**2), rel=3e-2)


class Off(Engine):
    """Matrices by the library, times a factor in one place: those of jumps, or tangent maps of runs."""

    def __init__(self, jump=1.0, run=1.0, place=(0, 0)):
        self.jump, self.run, self.place = jump, run, place

    def scaled(self, matrix, factor):
        changed = np.array(matrix)
        changed[self.place] *= factor
        return changed

    def saltation_matrix(self, *given):
        return self.scaled(super().saltation_matrix(*given), self.jump)

    def simulate(self, system, x0, t_span, **options):
        arc = super().simulate(system, x0, t_span, **options)
        if arc.fundamental is None:
            return arc
        return attrs.evolve(arc, fundamental=self.scaled(arc.fundamental, self.run))


def discarded(check, case):
    """Why the case is not judged."""
    with pytest.raises(UnsatisfiedAssumption) as caught:
        check(case)
    return str(caught.value)


def passage(engine=None, *, faster=1.0, reset=None, moving=0.0, until=1.0):
    """``q`` grows at the rate 2, and from 1 on ``faster`` times as fast; ``w`` falls at the rate 4."""
    system = HybridSystem(
        state=("q", "w"),
        parameters={"c": C},
        modes=[
            Mode("before", lambda t, x, p: (2.0 + 0.0 * x.q, -4.0)),
            Mode("behind", lambda t, x, p: (2.0 * faster + 0.0 * x.q, -4.0)),
        ],
        transitions=[
            Transition(
                "before",
                "behind",
                Guard(lambda t, x, p: 5.0 * (x.q - 1.0 - moving * t), +1),
                reset and Reset(reset),
                name="pass",
            )
        ],
    )
    return Case(system, {"c": C}, "before", (0.0, 1.0), 0.0, until, engine=engine or Engine())


class TestContinuity:
    def test_holds(self):
        check_continuity(passage())

    @pytest.mark.parametrize("place", [(0, 0), (1, 1)])
    def test_the_matrix_is_the_identity_up_to_rounding(self, place):
        for factor in (1.0 - 0.9e-9, 1.0 + 0.9e-9):
            check_continuity(passage(Off(factor, place=place)))
        for factor in (1.0 - 1.1e-9, 1.0 + 1.1e-9):
            with pytest.raises(PropertyError, match="where field and state are continuous"):
                check_continuity(passage(Off(factor, place=place)))

    def test_a_change_of_the_field_within_rounding_may_show(self):
        """A field that is faster by 1.95e-9 counts as the same; that may show twice, and shows once."""
        check_continuity(passage(faster=1.0 + 1.95e-9))
        check_continuity(passage(Off(1.0 + 2.9e-9), faster=1.0 + 1.95e-9))
        with pytest.raises(PropertyError):
            check_continuity(passage(Off(1.0 + 3.0e-9), faster=1.0 + 1.95e-9))

    def test_jumps_of_state_or_field_are_left_alone(self):
        told = "the field or the state jumps at every event"
        assert discarded(check_continuity, passage(faster=1.0 + 2.1e-9)) == told
        assert discarded(check_continuity, passage(faster=1.5)) == told
        assert discarded(check_continuity, passage(reset=lambda t, x, p: (x.q, x.w))) == told
        assert discarded(check_continuity, passage(until=0.4)) == told


class TestFlowDirection:
    def test_holds(self):
        for case in (passage(), passage(faster=1.5), passage(reset=lambda t, x, p: (x.q, 3.0 * x.w)), ball()):
            check_flow_direction(case)

    @pytest.mark.parametrize(("place", "size"), [((0, 0), 1.0), ((1, 1), 2.0)])
    def test_the_field_after_is_met_up_to_rounding(self, place, size):
        """Both terms have the sizes 2 and 4, each twice; the larger one counts in both."""
        share = 1e-9 * (8.0 + 4.0 * size) / (2.0 * size)
        for sign in (1.0, -1.0):
            check_flow_direction(passage(Off(1.0 + 0.95 * sign * share, place=place)))
            with pytest.raises(PropertyError, match="the field after"):
                check_flow_direction(passage(Off(1.0 + 1.05 * sign * share, place=place)))

    def test_guards_and_resets_that_depend_on_time_are_left_alone(self):
        told = "no event whose guard and reset are independent of time"
        assert discarded(check_flow_direction, passage(moving=0.5)) == told
        assert discarded(check_flow_direction, passage(reset=lambda t, x, p: (x.q, x.w + t))) == told
        assert discarded(check_flow_direction, passage(until=0.4)) == told


class TestSumRule:
    """Each bounce has the determinant ``E^2``; flights have no divergence."""

    @pytest.mark.parametrize(("length", "time"), UNITS)
    def test_holds_in_any_unit(self, length, time):
        check_sum_rule(ball(length, time))

    def test_holds(self):
        check_sum_rule(passage(faster=1.5))
        check_sum_rule(passage(until=0.4))

    def test_determinants_are_met_up_to_the_tolerance(self):
        """1e-8 of all terms, and 1e-10 of how far the map stretches directions apart."""
        case = ball()
        arc = case.simulate(1.0, tangent=True)
        sizes = np.linalg.svd(arc.fundamental / case.run.scale[:, None] * case.run.scale, compute_uv=False)
        terms = len(arc.jumps) * 2.0 * abs(np.log(E))
        tolerance = 1e-8 * (1.0 + terms) + 1e-10 * sizes[0] / sizes[1]
        # Of the determinant ``a d - b c``, the first entry is in ``a d`` alone.
        share = arc.fundamental[0, 0] * arc.fundamental[1, 1] / np.linalg.det(arc.fundamental)
        for sign in (1.0, -1.0):
            check_sum_rule(ball(engine=Off(run=1.0 + 0.9 * sign * tolerance / share)))
            with pytest.raises(PropertyError, match="logarithm of the determinant"):
                check_sum_rule(ball(engine=Off(run=1.0 + 1.1 * sign * tolerance / share)))

    def test_the_message_names_the_parts(self):
        with pytest.raises(PropertyError) as caught:
            check_sum_rule(ball(engine=Off(run=2.0)))
        jumps = len(ball().run.arc.jumps)
        assert f"{2 * jumps * np.log(E):.10g} from {jumps} jumps" in str(caught.value)

    def test_lost_directions_are_not_judged(self):
        def forgets(t, x, p):
            return x.q, 1e-10 * x.w

        told = "a direction is lost, or nearly so, along the run"
        assert discarded(check_sum_rule, passage(reset=forgets)) == told
        for kept, judged in ((1e-5, True), (1e-7, False)):
            case = passage(reset=lambda t, x, p, kept=kept: (x.q, kept * x.w))
            if judged:
                check_sum_rule(case)
            else:
                assert discarded(check_sum_rule, case) == told

    def test_runs_that_fail_are_not_judged(self):
        """The run with tangent vectors is another one than that of the case."""

        class Fails(Engine):
            def simulate(self, system, x0, t_span, **options):
                short = {"solver": DOP853(max_steps=1)} if "tangent" in options else {}
                return super().simulate(system, x0, t_span, **{**options, **short})

        assert "step" in discarded(check_sum_rule, ball(engine=Fails()))


class TestSaltation:
    """Three matrices are compared with the differences of the flow."""

    def test_the_matrix_that_is_asked_for(self):
        for factor in (0.99, 1.01):
            with pytest.raises(PropertyError, match="between the tangent maps before and after"):
                check_saltation(ball(engine=Off(factor)))

    def test_the_matrix_of_the_jump(self, monkeypatch):
        right = Window.product
        for factor in (0.99, 1.01):
            monkeypatch.setattr(Window, "product", lambda window, f=factor: f * right(window))
            with pytest.raises(PropertyError, match="saltation matrix of the jump: "):
                check_saltation(ball())

    def test_the_tangent_map_of_the_run(self):
        for factor in (0.99, 1.01):
            with pytest.raises(PropertyError, match=r"run across the event: simulate\(tangent=True\)"):
                check_saltation(ball(engine=Off(run=factor)))

    def test_runs_that_start_behind_a_passable_guard_are_not_made(self, monkeypatch):
        monkeypatch.setattr(Window, "through", lambda window, xi: 1 / 0)
        check_saltation(attrs.evolve(ball(), passable=("bounce",)))
        with pytest.raises(ZeroDivisionError):
            check_saltation(attrs.evolve(ball(), passable=("another",)))
