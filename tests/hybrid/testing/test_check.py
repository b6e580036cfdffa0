"""The library's own systems and randomly drawn systems have every property."""

import re
import subprocess
import sys

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.errors import UnsatisfiedAssumption

import hybrid
import models
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition
from hybrid.testing import (
    Case,
    PropertyError,
    cases,
    check_cut,
    check_derivatives,
    check_jumps,
    check_saltation,
    check_scale,
    check_sides,
    check_split,
    check_sum_rule,
    check_system,
    parameters,
    small_systems,
    states,
)
from hybrid.testing.elastic import ELASTIC
from hybrid.testing.events import JUMPS, SIDES
from hybrid.testing.saltation import CONTINUITY, SUM_RULE
from tests.cases import systems

BALL = models.bouncing_ball()

# Properties that are not checked for a system without a continuous event, a second transition or elasticity.
NOT_CONTINUOUS, NOT_ELASTIC = CONTINUITY, ELASTIC


def friction():
    """A block on a belt, with the sliding mode from ``hybrid.filippov``."""
    return hybrid.filippov(
        state=("x", "v"),
        parameters={"belt": 0.2, "friction": 1.0},
        below=lambda t, x, p: (x.v, p.friction - x.x),
        above=lambda t, x, p: (x.v, -p.friction - x.x),
        switching=lambda t, x, p: x.v - p.belt,
    )


def rattler():
    """A mass between a rigid wall and a stiff buffer, forced."""

    def force(t, x, p):
        return p.A * np.cos(p.w * t) - p.c * x.v - x.q

    return HybridSystem(
        state=("q", "v"),
        parameters={"A": 4.0, "w": 1.6, "c": 0.15, "k": 50.0, "e": 0.9},
        modes=[
            Mode("free", lambda t, x, p: (x.v, force(t, x, p))),
            Mode("buffer", lambda t, x, p: (x.v, force(t, x, p) - p.k * (x.q - 1))),
        ],
        transitions=[
            Transition(
                "free",
                "free",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v)),
                name="impact",
            ),
            Transition("free", "buffer", Guard(lambda t, x, p: x.q - 1, direction=+1), name="touch"),
            Transition("buffer", "free", Guard(lambda t, x, p: x.q - 1, direction=-1), name="leave"),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


@pytest.mark.parametrize(
    ("system", "options", "unchecked"),
    [
        (
            models.bouncing_ball(),
            {"parameters": {"e": 1.0}, "laws": Laws(elastic=("v",))},
            {NOT_CONTINUOUS},
        ),
        (rattler(), {}, {NOT_ELASTIC}),
        (systems.jerk(), {}, {NOT_ELASTIC}),
        (systems.constant_fields(), {"mode": "left"}, {NOT_CONTINUOUS, NOT_ELASTIC}),
        (systems.switched_linear(), {}, {SIDES, NOT_CONTINUOUS, NOT_ELASTIC}),
        (
            systems.stick_slip(),
            {"mode": "slip", "states": {"x": (-1.0, 1.0), "v": (-1.0, 0.1)}},
            {SUM_RULE, NOT_ELASTIC},
        ),
        (
            systems.incline(),
            {"mode": "fall", "t_span": (0.0, 40.0)},
            {SUM_RULE, NOT_CONTINUOUS, NOT_ELASTIC},
        ),
    ],
    ids=["elastic ball", "rattler", "jerk", "constant", "switched", "stick-slip", "incline"],
)
def test_ours(system, options, unchecked):
    """Those of ``models`` have every property too: ``tests/models/test_laws.py``."""
    report = check_system(system, **{"examples": 15, **options})
    assert set(report.unchecked) == unchecked
    assert not report.never_seen


CASES = small_systems().flatmap(cases)


class TestSmallSystems:
    """Systems made up by chance, with the properties that need no other way of writing them."""

    @settings(max_examples=25)
    @given(CASES)
    def test_properties(self, case):
        check_derivatives(case)
        check_jumps(case)
        check_sides(case)
        check_split(case)
        check_saltation(case)

    @settings(max_examples=10)
    @given(CASES)
    def test_sums_of_exponents(self, case):
        check_sum_rule(case)

    @settings(max_examples=10)
    @given(small_systems())
    def test_crossings_are_transverse(self, system):
        """Seen from the equations alone: ``ds/dt`` at ``|y| < 2`` is above the speed of the moving level."""
        field = system.modes[0].field
        p = system.variables.parameter_view(system.parameter_values())
        for corner in np.ndindex(*(2,) * (system.dimension - 1)):
            y = [4.0 * side - 2.0 for side in corner]
            for t in np.linspace(0.0, 6.3, 20):
                speed = field(t, system.variables.state_view((1.0, *y)), p)[0]
                level = p.m * p.w * np.sin(p.w * t) if system.period else 0.0
                assert speed + level > 0.05


class TestStrategies:
    @given(states(models.bouncing_ball(), {"q": (0.5, 1.0)}))
    def test_states(self, x):
        assert 0.5 <= x[0] <= 1.0
        assert -2.0 <= x[1] <= 2.0

    @given(parameters(models.bouncing_ball(), {"e": 1.0}))
    def test_parameters(self, p):
        assert p["e"] == 1.0
        assert 0.8 * 9.81 - 1e-3 <= p["g"] <= 1.2 * 9.81 + 1e-3

    @given(states(BALL, st.just((1, 2))), parameters(BALL, st.just({"e": 0.5})))
    def test_strategies_instead_of_ranges(self, x, p):
        assert x == (1.0, 2.0)
        assert p == {"g": 9.81, "e": 0.5}

    @given(cases(models.impact_oscillator(), t_span=(1.0, 3.0)))
    def test_spans(self, case):
        assert 1.0 <= case.t0 <= 2.0
        assert case.t0 < case.t1 <= 3.0
        assert case.mode == ("flight" if case.x0[0] < case.parameters["d"] else None)

    @pytest.mark.parametrize(
        ("options", "text"),
        [
            ({"states": {"w": 1.0}}, "State component 'w' does not exist. State components: q, v."),
            (
                {"parameters": {"gg": 1.0}},
                "Parameter 'gg' does not exist. Parameters: g, e. Did you mean 'g'?",
            ),
            ({"states": {"q": (2.0, 1.0)}}, "Range of 'q' must be (low, high), a number or a strategy"),
            ({"states": {"q": "high"}}, "Range of 'q' must be a number; got 'high'"),
            ({"t_span": (1.0, 1.0)}, "t_span must be (t0, t1) with t0 < t1; got (1.0, 1.0)"),
            ({"mode": "fligth"}, "Mode 'fligth' does not exist. Modes: flight. Did you mean 'flight'?"),
            ({"passable": ("bonce",)}, "Transition 'bonce' does not exist"),
            ({"examples": 0}, "examples must be a whole number of at least 1"),
            ({"laws": Laws(elastic=("w",))}, "State component 'w' does not exist"),
        ],
    )
    def test_errors(self, options, text):
        with pytest.raises(hybrid.ModelError) as caught:
            check_system(models.bouncing_ball(), **options)
        assert text in str(caught.value)


class TestReport:
    def test_what_could_not_be_judged_is_said(self):
        """From above 0.4 the ball does not reach the floor within the time span of 0.1 s."""
        report = check_system(
            models.bouncing_ball(), examples=5, states={"q": (0.4, 1.0), "v": 0.0}, t_span=(0.0, 0.1)
        )
        assert JUMPS in report.unchecked
        assert report.never_seen == ("bounce",)
        text = str(report)
        assert re.search(f"^NOT CHECKED  0 +5 +{JUMPS} +no event on the run$", text, re.MULTILINE)
        assert "NEVER SEEN: bounce. Give ranges that reach them." in text.splitlines()[1]
        assert "Laws(elastic=...) is not given" in text

    def test_a_property_that_few_examples_reach_is_told_as_hardly_checked(self):
        """Only from the lowest start the ball reaches the floor in time."""
        heights = st.sampled_from([0.01, *[2.0] * 40])
        report = check_system(
            models.bouncing_ball(), examples=40, states={"q": heights, "v": 0.0}, t_span=(0.0, 0.3)
        )
        (found,) = (each for each in report.properties if each.name == JUMPS)
        assert 0 < found.examples < 4
        assert re.search(f"^HARDLY CHECKED  {found.examples} .* {JUMPS}", str(report), re.MULTILINE)

    def test_a_table_has_one_row_per_property_and_begins_with_what_is_not_known(self):
        report = check_system(models.bouncing_ball(), examples=5)
        title, *rows = str(report).splitlines()[-len(report.properties) - 1 :]
        assert title.split() == ["examples", "not", "judged", "property", "why", "not", "judged"]
        column = title.index("property")
        verdicts = [row.split("  ")[0] for row in rows]
        assert verdicts == sorted(verdicts, key=["NOT CHECKED", "HARDLY CHECKED", "holds"].index)
        assert {row[column:].split("  ")[0] for row in rows} == {each.name for each in report.properties}

    def test_bars_are_shown_when_asked_for(self, capsys):
        check_system(models.bouncing_ball(), examples=5, progress=True)
        shown = capsys.readouterr().err
        assert "Runs drawn" in shown
        assert "Runs judged" in shown
        assert "/5 " in shown
        check_system(models.bouncing_ball(), examples=5)
        assert capsys.readouterr().err == ""

    def test_nothing_to_judge_is_no_success(self):
        with pytest.raises(PropertyError, match=r"bouncing ball: none of \d+ runs could be judged"):
            check_system(models.bouncing_ball(), states={"q": (-2.0, -1.0)}, examples=5)

    def test_a_wall_that_may_be_passed(self):
        """A membrane that takes speed in one direction: the state crosses the guard and stays in the mode."""
        membrane = HybridSystem(
            state=("q", "v"),
            modes=[Mode("free", lambda t, x, p: (x.v, -x.q))],
            transitions=[
                Transition(
                    "free",
                    "free",
                    Guard(lambda t, x, p: x.q, -1),
                    Reset(lambda t, x, p: (x.q, 0.5 * x.v)),
                    name="membrane",
                )
            ],
        )
        with pytest.raises(PropertyError, match="name the transition in passable="):
            check_system(membrane, examples=20)
        assert not check_system(membrane, examples=20, passable=("membrane",)).never_seen


def test_chatter_is_cut_short():
    """From 1 m the ball comes to rest after four seconds; the run is cut before t = 3 and has four jumps."""
    ball = models.bouncing_ball()
    case = Case(ball, dict(ball.parameters), "flight", (1.0, 0.0), 0.0, 10.0)
    assert len(case.run.arc.jumps) == 4
    assert case.run.t1 < 3.0


def test_a_function_that_cannot_be_traced():
    def flight(t, x, p):
        total = 0.0
        for _ in range(3):
            total += p.g / 3 if x.q > -100.0 else 0.0
        return x.v, -total

    def jacobian(t, x, p):
        return (0.0, 1.0), (0.0, 0.0)

    ball = attrs.evolve(BALL, modes=[Mode("flight", flight, jacobian=jacobian)])
    case = Case(ball, dict(ball.parameters), "flight", (1.0, 0.0), 0.0, 0.7)
    check_derivatives(case)
    check_cut(case)
    with pytest.raises(UnsatisfiedAssumption, match="cannot be traced"):
        check_scale(case)


def test_importing_the_library_leaves_hypothesis_alone():
    program = "import sys, hybrid; assert 'hypothesis' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True)
