"""Models as graphs: the checks when a model is made, and their messages."""

import re

import attrs
import networkx as nx
import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, Transition
from tests.hybrid.systems import BOUNCE, FLIGHT, ball, fall, height, rebound


def bounce(**changes):
    return [attrs.evolve(BOUNCE, **changes)]


CONSTRUCTION = [
    (lambda: Guard("q"), "Guard: function must be a function of (t, x, p); got 'q'."),
    (lambda: Guard(height, 2), "Guard: direction must be -1 (falling), 0 (both) or +1 (rising); got 2."),
    (lambda: Guard(height, gradient=3), "Guard: gradient must be a function of (t, x, p); got 3."),
    (lambda: Reset(None), "Reset: function must be a function of (t, x, p); got None."),
    (lambda: Reset(rebound, jacobian=1), "Reset: jacobian must be a function of (t, x, p); got 1."),
    (lambda: Mode("", fall), "Mode: name must be a non-empty string; got ''."),
    (lambda: Mode("flight", 1.0), "Mode: field must be a function of (t, x, p); got 1.0."),
    (lambda: Mode("flight", fall, jacobian=2), "Mode: jacobian must be a function of (t, x, p); got 2."),
    (
        lambda: Transition("a", "b", height),
        "Transition: guard must be a Guard or a clock; got <function height",
    ),
    (
        lambda: Transition("a", "b", Guard(height), rebound),
        "reset must be a Reset or None (identity); got <function",
    ),
    (lambda: Transition(1, "b", Guard(height)), "Transition: source must be a non-empty string; got 1."),
    (lambda: Transition("a", "", Guard(height)), "Transition: target must be a non-empty string; got ''."),
    (lambda: ball(state="qv"), "state must be a tuple of names or a number of components; got 'qv'. Write"),
    (lambda: ball(state=0), "state needs at least one component; got 0."),
    (lambda: ball(state=()), "state needs at least one component; got an empty sequence."),
    (lambda: ball(state=("q", "1v")), "state name '1v' cannot be written as an attribute."),
    (lambda: ball(state=("q", "lambda")), "state name 'lambda' cannot be written as an attribute."),
    (lambda: ball(state=("q", "_v")), "state name '_v' cannot be written as an attribute."),
    (lambda: ball(state=("q", "q")), "state names must differ; given twice: q."),
    (lambda: ball(parameters={"g g": 1.0}), "parameter name 'g g' cannot be written as an attribute."),
    (lambda: ball(parameters={"g": "big"}), "parameter 'g' must be a number; got 'big'."),
    (lambda: ball(parameters={"g": np.nan}), "parameter 'g' must be finite; got nan."),
    (lambda: ball(modes=[]), "HybridSystem: at least one mode is needed; got none."),
    (lambda: ball(modes=[fall]), "each mode must be a Mode; got <function fall"),
    (lambda: ball(transitions=[FLIGHT]), "each transition must be a Transition; got Mode("),
    (lambda: ball(modes=[FLIGHT, FLIGHT]), "mode names must differ; given twice: flight. Give each mode"),
    (lambda: ball(transitions=[BOUNCE, BOUNCE]), "transition names must differ; given twice: bounce."),
    (
        lambda: ball(transitions=bounce(target="fligth")),
        "Transition 'bounce': target mode 'fligth' does not exist. Modes: flight. Did you mean 'flight'?",
    ),
    (
        lambda: ball(transitions=bounce(source="ground")),
        "Transition 'bounce': source mode 'ground' does not exist. Modes: flight.",
    ),
    (
        lambda: ball(modes=[FLIGHT, Mode("rest", fall)]),
        "no transition joins mode 'flight' to the others. Modes: flight, rest. Add a transition",
    ),
    (lambda: ball(modes=[Mode("flight", lambda x, p: x)]), "Mode 'flight': field must take (t, x, p); got a"),
    (
        lambda: ball(modes=[Mode("flight", lambda t, x, p: (x.v,))]),
        "Mode 'flight': field returned 1 values; the state has 2 (q, v). Return one time derivative per",
    ),
    (
        lambda: ball(modes=[Mode("flight", lambda t, x, p: (x.w, 0.0))]),
        "Mode 'flight': field: State component 'w' does not exist. State components: q, v.",
    ),
    (
        lambda: ball(modes=[Mode("flight", lambda t, x, p: (x.v, -p.G))]),
        "Mode 'flight': field: Parameter 'G' does not exist. Parameters: g, e.",
    ),
    (
        lambda: ball(transitions=bounce(guard=Guard(lambda t, x, p: x.q < 0))),
        "Transition 'bounce': guard must return one number that changes sign; got",
    ),
    (
        lambda: ball(transitions=bounce(reset=Reset(lambda t, x, p: x.q))),
        "Transition 'bounce': reset must return a tuple or an array of one value per state (q, v); got",
    ),
    (lambda: ball(period=lambda t, p: 1.0), "HybridSystem: period must take (p); got a function of (t, p)"),
    (lambda: ball(period=lambda p: "long"), "HybridSystem: period must return a number; got 'long'."),
]


@pytest.mark.parametrize(("make", "text"), CONSTRUCTION, ids=range(len(CONSTRUCTION)))
def test_construction_errors(make, text):
    with pytest.raises(ModelError, match=re.escape(text)):
        make()


def test_functions_need_not_be_hashable():
    """Objects with values that can be compared, such as those of attrs, may be model functions."""

    @attrs.define
    class Sum:
        rows: list
        shift: float = 0.0

        def __call__(self, t, x, p):
            sums = [sum(a * b for a, b in zip(row, x, strict=True)) + self.shift for row in self.rows]
            return sums if len(sums) > 1 else sums[0]

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("a", Sum([[0.0, 1.0], [-1.0, 0.0]]))],
        transitions=[
            Transition("a", "a", Guard(Sum([[1.0, 0.0]]), -1, when=Sum([[0.0, -1.0]])),
                       Reset(Sum([[1.0, 0.0], [0.0, -0.5]])))
        ],
    )  # fmt: skip
    with pytest.raises(TypeError, match="unhashable"):
        hash(system.modes[0].field)
    arc = hybrid.simulate(system, (1.0, 0.0), (0.0, 6.0), tangent=True)
    assert arc.jumps.t == pytest.approx([np.pi / 2, np.pi * 1.5])
    assert hybrid.split(system).mode_names == ("a",)


@pytest.mark.as_given
def test_periods():
    assert ball().forcing_period() is None
    assert ball(period=2.5).forcing_period() == 2.5
    forced = ball(period=lambda p: 1 / p.e)
    assert forced.forcing_period() == 1.25
    assert forced.forcing_period({"e": 0.5}) == 2.0
    with pytest.raises(hybrid.ArgumentError, match="period must be positive; got -2"):
        forced.forcing_period({"e": -0.5})


def test_graph():
    system = ball(
        modes=[FLIGHT, Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            BOUNCE,
            Transition("flight", "rest", Guard(lambda t, x, p: x.v, 1)),
            Transition("rest", "flight", Guard(lambda t, x, p: t - 9, 1)),
        ],
    )
    graph = system.graph
    assert isinstance(graph, nx.MultiDiGraph)
    assert graph is system.graph
    assert graph.name == "ball"
    assert list(graph.nodes) == ["flight", "rest"]
    assert graph.nodes["flight"]["mode"] is FLIGHT
    assert set(graph.edges(keys=True)) == {
        ("flight", "flight", "bounce"),
        ("flight", "rest", "flight->rest"),
        ("rest", "flight", "rest->flight"),
    }
    assert graph.edges["flight", "flight", "bounce"]["transition"] is BOUNCE
    assert nx.is_strongly_connected(graph)


def test_names_and_indices():
    system = ball()
    assert (system.dimension, system.state_names) == (2, ("q", "v"))
    assert (system.mode_names, system.transition_names) == (("flight",), ("bounce",))
    assert system.mode_index("flight") == system.transition_index("bounce") == 0
    assert system.transition_index(BOUNCE) == 0
    with pytest.raises(ModelError, match=r"Mode 'flihgt' does not exist. Modes: flight. Did you mean"):
        system.mode_index("flihgt")
    with pytest.raises(ModelError, match=r"Transition 'hop' does not exist. Transitions: bounce."):
        system.transition_index("hop")


def test_numbered_state():
    system = HybridSystem(state=3, modes=[Mode("a", lambda t, x, p: -x)])
    assert system.state_names == ("x0", "x1", "x2")
    assert HybridSystem(state=np.int64(3), modes=[Mode("a", lambda t, x, p: -x)]).dimension == 3


@pytest.mark.as_given
def test_parameters():
    system = ball()
    np.testing.assert_array_equal(system.parameter_values(), [9.81, 0.8])
    np.testing.assert_array_equal(system.parameter_values({"e": 0.5}), [9.81, 0.5])
    with pytest.raises(hybrid.ArgumentError, match=r"Parameter 'E' does not exist. Parameters: g, e."):
        system.parameter_values({"E": 0.5})


def test_frozen():
    system = ball()
    for target, name in ((system, "state"), (FLIGHT, "name"), (BOUNCE, "guard"), (BOUNCE.guard, "direction")):
        with pytest.raises(attrs.exceptions.FrozenInstanceError):
            setattr(target, name, None)
    with pytest.raises(TypeError):
        system.parameters["g"] = 1.0


def test_parameters_do_not_follow_the_caller_s_dictionary():
    given = {"g": 9.81, "e": 0.8}
    system = ball(parameters=given)
    given["g"] = 0.0
    assert system.parameters["g"] == 9.81


def test_evolve():
    system = ball()
    assert system.graph.name == "ball"
    moon = attrs.evolve(system, parameters={"g": 1.62, "e": 0.8}, name="moon")
    assert moon.graph.name == "moon"
    assert moon.modes == system.modes
    ground = [Mode("air", fall)]
    renamed = attrs.evolve(system, modes=ground, transitions=bounce(source="air", target="air"))
    assert renamed.mode_names == ("air",)
    with pytest.raises(ModelError, match="source mode 'flight' does not exist"):
        attrs.evolve(system, modes=ground)


def test_markers():
    assert Transition("a", "a", Guard(height)).is_marker
    assert not BOUNCE.is_marker
    assert not Transition("a", "b", Guard(height)).is_marker


def test_a_system_is_shown_as_a_table():
    system = models.vibroimpact()
    text = repr(system)
    assert text.splitlines()[0] == "HybridSystem vibro-impact"
    assert "state: x1 (m), x2 (m), v1 (m/s), v2 (m/s)" in text
    assert "time: t (s)" in text
    assert "P = 500 N" in text
    assert "modes: 'free', 'contact'" in text
    assert ", a function of the parameters" in text
    assert [line.split() for line in text.splitlines()[-2:]] == [
        ["impact", "free", "contact", "rises"],
        ["release", "contact", "free", "falls"],
    ]
    assert max(map(len, text.splitlines())) <= 100
    html = system._repr_html_()
    assert html.count("<tr>") == 3
    assert "<td>impact</td><td>free</td><td>contact</td><td>rises</td>" in html


def test_a_table_shows_conditions_ends_and_limits():
    system = HybridSystem(
        state=3,
        modes=[Mode("a<b", lambda t, x, p: -x), Mode("rest", lambda t, x, p: 0 * x)],
        transitions=[
            Transition("a<b", None, Guard(lambda t, x, p: x[0] - 9, when=lambda t, x, p: x[1]), name="out"),
            Transition(
                "a<b",
                "a<b",
                Guard(lambda t, x, p: x[0], -1),
                Reset(lambda t, x, p: -x),
                name="hit",
                accumulates_to="rest",
            ),
        ],
        period=2,
    )
    lines = repr(system).splitlines()
    assert "state: 3 components" in lines
    assert "parameters: none" in lines
    assert "period: 2" in lines
    assert lines[-2].split() == ["out", "a<b", "(end)", "either", "way", "yes"]
    assert lines[-1].split() == ["hit", "a<b", "a<b", "falls", "yes", "rest"]
    assert "a&lt;b" in system._repr_html_()


def test_a_smooth_system_has_no_transitions_to_show():
    assert repr(HybridSystem(state=1, modes=[Mode("a", lambda t, x, p: -x)])).endswith("no transitions")


def test_a_system_that_grows_is_whole_once_nothing_leads_on():
    """A transition without a target ends the run, or leads to a mode that has not been made yet."""

    class Growth:
        def __init__(self, *names):
            self.names, self.original, self.written = names, None, {}

        def leads_on(self, name):
            return name in self.names

        def place(self, t0, state, parameters, mode):
            return False

        def extend(self, name):
            raise AssertionError("Nothing is asked for.")

    whole = HybridSystem(
        state=("q",),
        modes=[Mode("a", lambda t, x, p: (1.0,)), Mode("b", lambda t, x, p: (1.0,))],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.q - 1, +1), name="on"),
            Transition("b", None, Guard(lambda t, x, p: x.q - 2, +1), name="end"),
        ],
    )
    for growth, is_whole in ((None, True), (Growth(), True), (Growth("on"), True), (Growth("end"), False)):
        assert attrs.evolve(whole, growth=growth).is_whole == is_whole
