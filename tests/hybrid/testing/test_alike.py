"""Members that are said to be alike are compared in other orders."""

import attrs
import numpy as np
import pytest

import models
from hybrid import (
    ArgumentError,
    Every,
    Guard,
    HybridSystem,
    Laws,
    Mode,
    ModelError,
    Reset,
    Transition,
    repeat,
)
from hybrid.testing import Case, PropertyError, check_laws, check_system

ALIKE = Laws(alike=["cell"])


def system(field=None, guard=None, reset=None, clock=None):
    """Three cells that pull each other, all alike unless one of these functions tells them apart."""
    transitions = [
        Transition(
            "run",
            "run",
            Guard(guard or (lambda t, x, p, i: x.cell[i].u - p.cell[i].top), +1),
            Reset(reset or (lambda t, x, p, i: {"cell.u": 0.9 * x.cell.u, "u": 0.0})),
            name="fire",
        ),
        Transition("run", "run", clock or Every("period"), name="tick"),
    ]
    cells = repeat(
        "cell",
        3,
        state=("u",),
        parameters={"top": [1.0, 1.1, 1.2], "period": [0.5, 0.6, 0.7]},
        field=field or (lambda t, x, p, i: {"u": 1.0 + np.mean(x.cell.u) - x.cell[i].u}),
        transitions=transitions,
    )
    return HybridSystem(repeats=[cells], modes=[Mode("run", lambda t, x, p: ())], laws=ALIKE)


def judge(system):
    check_laws(Case(system, system.parameters, "run", (0.1, 0.5, 0.8), 0.0, 2.0))


def test_members_that_are_alike_pass():
    judge(system())


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"field": lambda t, x, p, i: {"u": 1.0 + 0.1 * x.cell[i - 1].u}}, "the field of mode 'run'"),
        ({"field": lambda t, x, p, i: {"u": 1.0 + 1e-3 * (i == 2)}}, "the field of mode 'run'"),
        ({"guard": lambda t, x, p, i: x.cell[i].u - p.cell[0].top}, "the guard of transition"),
        ({"reset": lambda t, x, p, i: {f"cell[{i - 1 if i else 2}].u": 0.5, "u": 0.0}}, "the reset of"),
        ({"clock": Every(lambda p, i: 0.5 + 0.01 * i)}, "the clock of transition"),
        ({"clock": Every("period", when=lambda t, x, p, i: i + 1)}, "the condition of transition"),
    ],
)
def test_members_that_are_not_are_found(change, text):
    with pytest.raises(PropertyError, match=f"Members of 'cell' are alike: this does not hold(.|\n)*{text}"):
        judge(system(**change))


def test_the_law_is_one_of_those_of_check_system():
    neurons = attrs.evolve(models.pulse_coupled_neurons(3), laws=Laws())
    ranges = {"states": {"neuron.u": (0.1, 0.9)}, "t_span": (0.0, 0.5), "examples": 3}
    assert "Members of 'neuron' are alike" in str(
        check_system(neurons, laws=Laws(alike=["neuron"]), **ranges)
    )


def test_what_is_wrong_is_said():
    with pytest.raises(ArgumentError, match="alike must be names of repeats; got 3"):
        Laws(alike=3)
    with pytest.raises(ArgumentError, match=r"alike: Repeat 'cel' does not exist\. Repeats: cell\."):
        judge(attrs.evolve(system(), laws=Laws(alike=["cel"])))
    cells = repeat("cell", 2, state=("u",), field=lambda t, x, p, i: (0.0,), laws=ALIKE)
    with pytest.raises(ModelError, match="alike names repeats, which members do not have; got cell"):
        HybridSystem(repeats=[cells], modes=[Mode("run", lambda t, x, p: ())])
