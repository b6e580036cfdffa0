"""Outputs of a system: how they are written down, and what is refused."""

import pickle

import attrs
import pytest

import models
from hybrid import (
    After,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Transition,
    filippov,
    from_equations,
    simulate,
    split,
)
from hybrid.transform.aged import aged

FALL = Mode("fall", lambda t, x, p: (x.v, -p.g))


def falling(**options):
    return HybridSystem(state=("q", "v"), parameters={"g": 9.81}, modes=[FALL], **options)


def energy(t, x, p):
    return x.v**2 / 2 + p.g * x.q


def test_a_system_shows_its_outputs_with_their_units():
    system = falling(outputs={"energy": energy}, units={"energy": "J/kg"})
    assert "outputs: energy (J/kg)" in repr(system)
    assert system.quantity_names == ("q", "v", "energy")


def test_an_output_need_not_be_an_identifier():
    system = falling(outputs={"energy per mass": energy})
    assert simulate(system, (1.0, 0.0), (0.0, 0.1))["energy per mass"][0] == pytest.approx(9.81)


@pytest.mark.parametrize(
    ("outputs", "text"),
    [
        ({"q": energy}, "'q' is the name of a state and of an output"),
        ({"g": energy}, "'g' is the name of a parameter and of an output"),
        ({"t": energy}, "'t' is the name of the time and of an output"),
        ({"f": {}}, r"outputs\['f'\] names no mode, so the output has no value anywhere"),
        ({"f": {"fal": energy}}, "Output 'f': mode 'fal' does not exist. Modes: fall. Did you mean 'fall'?"),
        ({"f": 3.0}, r"outputs\['f'\] must be a function of \(t, x, p\), or map modes to such functions"),
        ({"f": {"fall": 3.0}}, r"outputs\['f'\]\['fall'\] must be a function of \(t, x, p\); got 3.0"),
        ({"": energy}, "a name must be a non-empty text"),
        ([energy], "outputs must map names to functions"),
        ({"f": lambda t, x, p: x.w}, "Output 'f': function: State component 'w' does not exist"),
        ({"f": {"fall": lambda t, x, p: x.w}}, "Output 'f' in mode 'fall': function: State component 'w'"),
        ({"f": lambda t, x: 1.0}, r"Output 'f': function must take \(t, x, p\)"),
        ({"f": lambda t, x, p: (x.q, x.v)}, "Output 'f': function must return one number"),
        ({"f": lambda t, x, p: "high"}, "Output 'f': function must return one number"),
    ],
)
def test_errors(outputs, text):
    with pytest.raises(ModelError, match=text):
        falling(outputs=outputs)


def test_a_function_that_remembers_is_refused():
    calls = []

    def counted(t, x, p):
        calls.append(t)
        return float(len(calls))

    with pytest.raises(ModelError, match=r"Output 'f': function returned .* must be pure"):
        falling(outputs={"f": counted})


def test_units_of_what_is_no_output_are_refused():
    with pytest.raises(ModelError, match=r"units: Name 'forse' does not exist. Names: q, v, g, force, t"):
        falling(outputs={"force": energy}, units={"forse": "N"})


def test_held_components_and_counters_clash_too():
    for kind in ("held", "counters"):
        with pytest.raises(ModelError, match=r"'n' is the name of a .* and of an output"):
            falling(outputs={"n": energy}, **{kind: ("n",)})


def test_a_system_with_outputs_can_be_changed_and_pickled():
    system = attrs.evolve(falling(outputs={"energy": energy}), modes=[Mode("fall", _rates)], name="a ball")
    again = pickle.loads(pickle.dumps(system))
    assert [*again.outputs] == ["energy"]
    assert simulate(again, (1.0, 0.0), (0.0, 0.1))["energy"][-1] == pytest.approx(9.81)


def _rates(t, x, p):
    return x.v, -p.g


def test_a_lambda_is_named_where_it_cannot_be_pickled():
    ball = models.bouncing_ball()
    system = attrs.evolve(ball, outputs=ball.outputs | {"f": lambda t, x, p: x.q})
    with pytest.raises(ModelError, match="Formula: function cannot be pickled"):
        pickle.dumps(system)


class TestDerivedSystems:
    """Outputs by mode go by the names that their author wrote."""

    def test_split(self):
        rubbing = HybridSystem(
            state=("q", "v"),
            modes=[Mode("rub", lambda t, x, p: (x.v, -x.q - 0.3 * abs(x.v) * x.v))],
            outputs={"force": {"rub": lambda t, x, p: -x.q}, "speed": lambda t, x, p: abs(x.v)},
        )
        arc = simulate(split(rubbing), (1.0, 0.0), (0.0, 5.0))
        assert len(set(arc.mode)) > 1
        assert arc["force"] == pytest.approx(-arc["q"])
        assert arc["speed"] == pytest.approx(abs(arc["v"]))

    def test_from_equations(self):
        system = from_equations(
            lambda t, x, p: (x.v, -abs(x.q)), state=("q", "v"), outputs={"energy": {"smooth": _kinetic}}
        )
        arc = simulate(system, (1.0, 0.0), (0.0, 1.0))
        assert arc["energy"] == pytest.approx(arc["v"] ** 2 / 2)

    def test_filippov(self):
        outputs = {"friction": {"below": _up, "above": _down, "sliding": lambda t, x, p: x.x}}
        block = filippov(
            ("x", "v"),
            {"belt": 0.2},
            lambda t, x, p: (x.v, 1.0 - x.x),
            lambda t, x, p: (x.v, -1.0 - x.x),
            lambda t, x, p: x.v - p.belt,
            outputs=outputs,
        )
        arc = simulate(block, (0.5, 0.2), (0.0, 3.0))
        sticks = arc.mode == "sliding"
        assert arc["friction"][sticks] == pytest.approx(arc["x"][sticks])
        assert set(arc["friction"][~sticks]) <= {1.0, -1.0}

    def test_a_system_with_the_age_of_its_mode(self):
        neuron = HybridSystem(
            state=("u",),
            counters=("n",),
            modes=[Mode("rise", lambda t, x, p: (2.0 - x.u,)), Mode("rest", lambda t, x, p: (0.0,))],
            transitions=[
                Transition("rise", "rest", Guard(lambda t, x, p: x.u - 1.0, +1)),
                Transition("rest", "rise", After(0.5)),
            ],
            start="rise",
            outputs={"twice": {"rise": lambda t, x, p: 2.0 * x.u + x.n}},
        )
        assert [*aged(neuron).outputs] == ["twice"]
        arc = simulate(neuron, {"u": 0.0}, (0.0, 0.5), tangent=True)
        assert arc.fundamental_of("twice") == pytest.approx(2.0 * arc.fundamental[0])


def _kinetic(t, x, p):
    return x.v**2 / 2


def _up(t, x, p):
    return 1.0


def _down(t, x, p):
    return -1.0
