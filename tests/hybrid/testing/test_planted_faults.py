"""Each property detects the faults it is meant for, planted in the library or in a model."""

from collections.abc import Callable
from functools import cache

import attrs
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

import hybrid
import models
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition
from hybrid.system.functions import guard_function, reset_function
from hybrid.testing import (
    Engine,
    PropertyError,
    cases,
    check_compiled,
    check_continuity,
    check_crossings,
    check_cut,
    check_derivatives,
    check_elastic,
    check_extension,
    check_flow_direction,
    check_jumps,
    check_names,
    check_order,
    check_period,
    check_saltation,
    check_samples,
    check_scale,
    check_sides,
    check_split,
    check_sum_rule,
    check_system,
    check_units,
)
from hybrid.testing.elastic import ELASTIC
from tests.cases import systems
from tests.hybrid.systems import shaken_table

EXAMPLES = 200
NUDGE = 1e-6


def found(check, system, engine=None, **options):
    """The message of the property for a faulty engine or model, from at most 200 examples."""
    engine = engine or Engine()

    @settings(
        max_examples=EXAMPLES,
        database=None,
        derandomize=True,
        deadline=None,
        phases=(Phase.generate,),
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(cases(system, engine=engine, **options))
    def search(case):
        check(case)

    with pytest.raises(PropertyError) as caught:
        search()
    return str(caught.value)


def box(*, floor=-1, reset=lambda t, x, p: (x.q, -p.e * x.v), jacobian=None):
    """A damped body between two walls; the arguments set what a user may get wrong at the wall at 0."""
    return HybridSystem(
        name="box",
        state=("q", "v"),
        parameters={"c": 0.1, "e": 0.9},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.c * x.v - x.q), jacobian=jacobian)],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q, floor), Reset(reset), name="floor"),
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q - 1, +1),
                Reset(lambda t, x, p: (x.q, -p.e * x.v)),
                name="ceiling",
            ),
        ],
    )


BALL, TABLE, JERK, BOX = models.bouncing_ball(), shaken_table(), systems.jerk(), box()
CONSTANT = systems.constant_fields()
# A flight that no method advances exactly: there an absolute tolerance shows.
SWING = attrs.evolve(BOX, modes=[Mode("flight", lambda t, x, p: (x.v, -np.sin(3 * x.q)))])
FLOOR = BOX.transitions[0]
GATED = attrs.evolve(
    BOX,
    transitions=[
        attrs.evolve(FLOOR, guard=attrs.evolve(FLOOR.guard, when=lambda t, x, p: 3 - x.v)),
        BOX.transitions[1],
    ],
)
IN_THE_BOX = {"states": {"q": (0.1, 0.9), "v": (-2.0, 2.0)}}


class Saltation(Engine):
    """Saltation matrices from a formula of ``(D_x R, D_t R, D_x g, D_t g, f_minus, f_plus)``."""

    def __init__(self, formula: Callable[..., np.ndarray]) -> None:
        self.formula = formula

    def saltation_matrix(self, system, transition, t, x, parameters):
        index = system.transition_index(transition)
        edge, values = system.transitions[index], system.parameter_values(parameters)
        guard = self.derivative(system, guard_function(edge), index, t, x, values)[0]
        reset = np.eye(len(x), len(x) + 1)
        x_plus = x
        p = system.variables.parameter_view(values)
        before = system.variables.state_view(x)
        if edge.reset is not None:
            reset = self.derivative(system, reset_function(edge, system.variables), index, t, x, values)
            x_plus = edge.reset.function(t, before, p)
        f_minus = np.array(system.modes[system.mode_index(edge.source)].field(t, before, p), dtype=float)
        after = system.variables.state_view(x_plus)
        f_plus = np.array(system.modes[system.mode_index(edge.target)].field(t, after, p), dtype=float)
        return self.formula(reset[:, :-1], reset[:, -1], guard[:-1], guard[-1], f_minus, f_plus)


def right(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return DxR + np.outer(f_plus - DxR @ f_minus - DtR, Dxg) / (Dtg + Dxg @ f_minus)


def none(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return np.eye(len(Dxg))


def reset_only(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return DxR


def wrong_sign(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return DxR - np.outer(f_plus - DxR @ f_minus - DtR, Dxg) / (Dtg + Dxg @ f_minus)


def still_guard(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return right(DxR, DtR, Dxg, 0.0, f_minus, f_plus)


def still_reset(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return right(DxR, 0.0 * DtR, Dxg, Dtg, f_minus, f_plus)


def field_before_twice(DxR, DtR, Dxg, Dtg, f_minus, f_plus):
    return right(DxR, DtR, Dxg, Dtg, f_minus, f_plus + 1e-6 * f_minus)


class Distorted(Engine):
    """Solves the system that ``distort`` makes from the given system."""

    def __init__(self, distort: Callable[[HybridSystem], HybridSystem]) -> None:
        self.distorted = cache(distort)

    def simulate(self, system, x0, t_span, **options):
        return hybrid.simulate(self.distorted(system), x0, t_span, **options)


def with_transitions(system, change):
    return attrs.evolve(system, transitions=[change(transition) for transition in system.transitions])


def nudged(transition):
    """The reset moves the first component a little further."""
    reset = transition.reset

    def further(t, x, p):
        first, *others = x if reset is None else reset.function(t, x, p)
        return first + NUDGE, *others

    return attrs.evolve(transition, reset=Reset(further))


def turned(transition):
    """The guard fires in the opposite direction."""
    return attrs.evolve(
        transition, guard=attrs.evolve(transition.guard, direction=-transition.guard.direction)
    )


def late(transition):
    """The guard fires at a fixed distance from zero."""
    function, direction = transition.guard.function, transition.guard.direction
    return attrs.evolve(
        transition, guard=Guard(lambda t, x, p: function(t, x, p) - direction * NUDGE, direction)
    )


def first_by_name_hurried(system):
    first = min(system.mode_names)

    def hurried(mode):
        field = mode.field
        faster = lambda t, x, p: [(1 + NUDGE) * rate for rate in field(t, x, p)]  # noqa: E731
        return attrs.evolve(mode, field=faster) if mode.name == first else mode

    return attrs.evolve(system, modes=[hurried(mode) for mode in system.modes])


def first_in_list_late(system):
    first, *others = system.transitions
    return attrs.evolve(system, transitions=[late(first), *others])


class Displaced(Engine):
    """Every run starts slightly displaced, as if a start on a guard needed a nudge."""

    def simulate(self, system, x0, t_span, **options):
        return hybrid.simulate(system, np.array(x0) + NUDGE, t_span, **options)


class ToleranceWithAUnit(Engine):
    """The absolute tolerance is the same number in all units."""

    def simulate(self, system, x0, t_span, **options):
        solver = attrs.evolve(options.pop("solver"), rtol=1e-14, atol=1e-12)
        return hybrid.simulate(system, x0, t_span, solver=solver, **options)


class SampledBefore(Engine):
    """A sample at an event is the state before it."""

    def simulate(self, system, x0, t_span, **options):
        arc = hybrid.simulate(system, x0, t_span, **options)
        if options.get("samples") is None:
            return arc
        x = arc.x.copy()
        for jump in arc.jumps:
            x[arc.t == jump.t] = jump.x_minus
        return attrs.evolve(arc, x=x)


class TangentsLost(Engine):
    """The last jump leaves tangent vectors unchanged."""

    def simulate(self, system, x0, t_span, **options):
        arc = hybrid.simulate(system, x0, t_span, **options)
        if arc.fundamental is None or not len(arc.jumps):
            return arc
        return attrs.evolve(arc, fundamental=np.linalg.inv(arc.jumps[-1].saltation) @ arc.fundamental)


def deaf(transition):
    """The transition never fires."""
    return attrs.evolve(transition, guard=attrs.evolve(transition.guard, when=lambda t, x, p: x.q < -1e9))


class EventsTwice(Engine):
    """Every event is found a second time right after it has fired."""

    def simulate(self, system, x0, t_span, **options):
        arc = hybrid.simulate(system, x0, t_span, **options)
        jumps = arc.jumps
        columns = [each for each in attrs.fields(type(jumps)) if each.type == "np.ndarray"]
        twice = {
            each.alias: np.repeat(getattr(jumps, each.name), 2, axis=0)
            for each in columns
            if each.name != "_parameters"
        }
        assert len(twice) > 3
        return attrs.evolve(arc, jumps=attrs.evolve(jumps, **twice))


class DerivativeOfNoughtPointNine(Engine):
    """Derivatives are 0.9 times the right value."""

    def derivative(self, *arguments):
        return 0.9 * super().derivative(*arguments)


class ValuesOff(Engine):
    """One compiled function is slightly wrong where the first component is negative."""

    def __init__(self, name):
        self.name = name

    def value(self, compiled, function, index, t, x, parameters):
        found = super().value(compiled, function, index, t, x, parameters)
        return found + 1e-9 * (function.kind == self.name and x[0] < 0)


def test_the_formula_that_the_faults_are_made_from_is_right():
    report = check_system(TABLE, examples=10, engine=Saltation(right))
    assert next(p for p in report.properties if p.name.startswith("The saltation matrix is the der")).checked


@pytest.mark.parametrize(
    ("check", "system", "fault", "text"),
    [
        (check_saltation, BALL, none, "finite differences"),
        (check_saltation, BALL, reset_only, "finite differences"),
        (check_saltation, BALL, wrong_sign, "finite differences"),
        (check_saltation, CONSTANT, none, "finite differences"),
        (check_saltation, TABLE, still_guard, "a time term"),
        (check_saltation, TABLE, still_reset, "a time term"),
        (check_flow_direction, BALL, none, "the field after"),
        (check_flow_direction, BALL, wrong_sign, "the field after"),
        (check_flow_direction, CONSTANT, none, "the field after"),
        (check_extension, BALL, reset_only, "the guard added to the reset"),
        (check_extension, TABLE, reset_only, "the guard added to the reset"),
        (check_extension, TABLE, still_reset, "the guard added to the reset"),
        (check_continuity, JERK, field_before_twice, "where field and state are continuous"),
    ],
)
def test_wrong_saltation_matrices(check, system, fault, text):
    assert text in found(check, system, Saltation(fault))


@pytest.mark.parametrize(
    ("check", "system", "engine", "text"),
    [
        (check_jumps, BALL, Distorted(lambda s: with_transitions(s, nudged)), "nudge off the guard"),
        (check_jumps, BALL, Distorted(lambda s: with_transitions(s, late)), "late or early"),
        (check_jumps, CONSTANT, Distorted(lambda s: with_transitions(s, nudged)), "nudge off the guard"),
        (check_scale, BALL, Distorted(lambda s: with_transitions(s, late)), "absolute tolerance"),
        (check_cut, BALL, Distorted(lambda s: with_transitions(s, nudged)), "identity transition"),
        (check_names, JERK, Distorted(first_by_name_hurried), "by name"),
        (check_order, BOX, Distorted(first_in_list_late), "first guard listed"),
        (check_sides, BALL, Distorted(lambda s: with_transitions(s, turned)), "goes below zero"),
        (check_jumps, BOX, Distorted(lambda s: with_transitions(s, turned)), "in the wrong direction"),
        (check_crossings, BALL, Distorted(lambda s: with_transitions(s, deaf)), "but no transition fires"),
        (check_crossings, BALL, EventsTwice(), "and again at"),
        (check_split, BALL, Displaced(), "was split at"),
        (check_units, BALL, Displaced(), "a threshold that has a unit"),
        (check_units, SWING, ToleranceWithAUnit(), "a threshold that has a unit"),
        (check_samples, BALL, SampledBefore(), "wrong side of an event"),
        (check_sum_rule, BALL, TangentsLost(), "miss a jump"),
        (check_saltation, BALL, TangentsLost(), "simulate(tangent=True)"),
        (check_derivatives, BALL, DerivativeOfNoughtPointNine(), "entry D_v of q is 0.9"),
        (check_compiled, GATED, ValuesOff("field"), "Mode 'flight': field: value 0 is"),
        (check_compiled, GATED, ValuesOff("guard"), "Transition 'floor': guard is"),
        (check_compiled, GATED, ValuesOff("when"), "Transition 'floor': when is"),
        (check_compiled, GATED, ValuesOff("reset"), "Transition 'floor': reset: value 0 is"),
    ],
)
@pytest.mark.as_given
def test_faults_of_the_solver(check, system, engine, text):
    assert text in found(check, system, engine)


def test_the_box_is_right():
    assert not check_system(BOX, examples=20, **IN_THE_BOX).never_seen


def fails(system, **options):
    with pytest.raises(PropertyError) as caught:
        check_system(system, examples=EXAMPLES, **options)
    return str(caught.value)


class TestFaultsOfAModel:
    def test_a_number_where_the_jacobian_needs_a_parameter(self):
        """The Jacobian is right at the declared parameters, so it is accepted when the system is made."""
        told = fails(box(jacobian=lambda t, x, p: ((0.0, 1.0), (-1.0, -0.1))), **IN_THE_BOX)
        assert "Given, traced and numerical derivatives agree: this does not hold for box" in told
        assert "entry D_v of v is -0.1" in told
        # The smallest case: one grid step from the declared value, all else unchanged.
        assert "parameters c = 0.10004, the others as declared" in told
        assert "q = 0.5, v = 0" in told

    def test_a_number_where_the_jacobian_of_a_reset_needs_a_parameter(self):
        def jacobian(t, x, p):
            return (1.0, 0.0), (0.0, -0.9)

        floor, ceiling = BOX.transitions
        floor = attrs.evolve(floor, reset=attrs.evolve(floor.reset, jacobian=jacobian))
        told = fails(attrs.evolve(BOX, transitions=[floor, ceiling]), **IN_THE_BOX)
        assert "Transition 'floor': jacobian: entry D_v of v is -0.9" in told

    def test_a_gradient_that_lacks_the_time_is_refused_when_the_system_is_made(self):
        hit = TABLE.transitions[0]
        guard = attrs.evolve(hit.guard, gradient=lambda t, x, p: (1.0, 0.0))
        with pytest.raises(hybrid.ModelError, match="has 2 columns, but the guard depends on t"):
            attrs.evolve(TABLE, transitions=[attrs.evolve(hit, guard=guard)])

    def test_a_number_where_the_period_needs_a_parameter(self):
        """The period is right at the declared parameters, so it is accepted when the system is made."""
        shaken = attrs.evolve(TABLE, period=2 * np.pi / 5.0)
        assert "one period later" in found(check_period, shaken)
        told = fails(shaken)
        assert "The declared period is a period of every function: this does not hold" in told
        assert "a number in the period where a function has a parameter" in told

    def test_a_field_that_jumps_is_told(self):
        rough = box()
        rough = attrs.evolve(rough, modes=[Mode("flight", lambda t, x, p: (x.v, -p.c * np.sign(x.v) - x.q))])
        report = check_system(rough, examples=3, **IN_THE_BOX)
        assert report.discontinuities == {"flight": "v = 0"}
        assert "The field of mode 'flight' jumps where v = 0" in str(report)

    def test_a_reset_with_the_wrong_sign(self):
        told = fails(box(reset=lambda t, x, p: (x.q, p.e * x.v)), **IN_THE_BOX)
        assert "A mode ends where its guards say" in told
        assert "guard of 'floor', which ends mode 'flight' where it goes below zero" in told

    def test_a_guard_in_the_wrong_direction(self):
        """No start between the walls is allowed; the check must fail, not pass."""
        told = fails(box(floor=+1), **IN_THE_BOX)
        assert "box: none of" in told
        assert "it lies beyond guard 'floor' of mode 'flight'" in told
        assert "a guard with the wrong direction" in told

    def test_a_nudge_after_the_reset(self):
        """Each nudge adds energy to the ball, forwards and backwards in time."""
        elastic = {"parameters": {"e": 1.0}, "laws": Laws(elastic=("v",))}
        assert ELASTIC not in check_system(BALL, examples=5, **elastic).unchecked
        told = fails(attrs.evolve(with_transitions(BALL, nudged), laws=Laws()), **elastic)
        assert f"{ELASTIC}: this does not hold for bouncing ball" in told
        assert "moves the state off the guard (a nudge)" in told

    def test_a_reset_that_is_not_elastic(self):
        told = found(lambda case: check_elastic(case, ("v",)), BALL, parameters={"e": 0.999})
        assert "loses energy" in told

    def test_how_the_reset_goes_on_off_the_guard_is_no_fault(self):
        extended = box(reset=lambda t, x, p: (x.q - 3 * x.q, (-p.e + 5 * x.q) * x.v + np.sin(x.q)))
        report = check_system(extended, examples=20, **IN_THE_BOX)
        assert not report.never_seen
