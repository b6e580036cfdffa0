"""What a system says of kinks and jumps inside of its modes."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Transition
from hybrid.status import StatusCode


def system(field, transitions=(), state=("q", "v")):
    return HybridSystem(
        state=state, parameters={"mu": 0.3}, modes=[Mode("m", field)], transitions=transitions
    )


@pytest.mark.parametrize(
    ("field", "names"),
    [
        (lambda t, x, p: (x.v, -x.q - p.mu * np.sign(x.v)), ["sign"]),
        (lambda t, x, p: (x.v, -np.maximum(x.q - 1, 0.0)), ["maximum"]),
        (lambda t, x, p: (x.v, np.where(x.q > 1, 1.0, 0.0) + np.abs(x.v)), [">", "abs"]),
        (lambda t, x, p: (x.v, np.clip(x.q, -1, 1)), ["clip"]),
        (lambda t, x, p: (x.v, np.floor(x.q)), ["floor"]),
        (lambda t, x, p: (x.v, 1.0 if x.q > 1 else 0.0), [">"]),
        (lambda t, x, p: (x.v, np.sign(np.sin(t)) * np.abs(p.mu)), []),
        (lambda t, x, p: (x.v, -np.sin(x.q)), []),
    ],
)
def test_the_functions_are_found(field, names):
    found = system(field).switching
    assert found == ({"m": names} if names else {})


def test_arrays_are_looked_into():
    def field(t, x, p):
        return np.abs(x)[::-1]

    assert system(field, state=2).switching == {"m": ["abs"]}


def test_a_switch_at_the_edge_of_its_mode_is_none():
    def field(t, x, p):
        return x.v, -(np.maximum(2.0 - 2.0 * x.q, 0.0) ** 1.5)

    stop = Transition("m", None, Guard(lambda t, x, p: x.q - 1.0, +1))
    assert system(field, [stop]).switching == {}
    other = Transition("m", None, Guard(lambda t, x, p: x.q - 1.5, +1))
    assert system(field, [other]).switching == {"m": ["maximum"]}


def test_a_clip_has_two_edges():
    def field(t, x, p):
        return x.v, -np.clip(x.q, -1.0, 2.0)

    low = Transition("m", None, Guard(lambda t, x, p: x.q + 1.0, -1), name="low")
    high = Transition("m", None, Guard(lambda t, x, p: 4.0 - 2.0 * x.q, -1), name="high")
    assert system(field, [low, high]).switching == {}
    assert system(field, [low]).switching == {"m": ["clip"]}
    assert system(field, [high]).switching == {"m": ["clip"]}


def test_both_sides_of_a_branch_in_python_are_looked_into():
    def field(t, x, p):
        return x.v, np.abs(x.v) if x.q > 0.5 else 0.0

    assert system(field).switching == {"m": [">", "abs"]}


@pytest.mark.parametrize("name", ["vibroimpact", "stick_slip", "buck_converter", "chua_circuit"])
def test_models_with_modes_have_none(name):
    assert getattr(models, name)().switching == {}


def test_repr_names_the_remedy():
    text = repr(system(lambda t, x, p: (x.v, -np.abs(x.q))))
    assert "kinks or jumps inside of modes: abs in mode m (hybrid.split makes modes of them)" in text
    assert "kinks" not in repr(hybrid.split(system(lambda t, x, p: (x.v, -np.abs(x.q)))))


def test_tangent_vectors_over_a_kink_are_told():
    kinked = system(lambda t, x, p: (x.v, -x.q - np.maximum(x.q - 0.5, 0.0)))
    told = hybrid.simulate(kinked, (1.0, 0.0), (0.0, 3.0), tangent=True).status
    assert told.ok
    assert "mode 'm' has kinks (maximum)" in told.message
    assert "hybrid.split" in told.message
    assert "kinks" not in hybrid.simulate(kinked, (1.0, 0.0), (0.0, 3.0)).status.message
    split = hybrid.simulate(hybrid.split(kinked), (1.0, 0.0), (0.0, 3.0), tangent=True).status
    assert "kinks" not in split.message


def test_tangent_vectors_over_a_jump_are_refused_with_the_remedy():
    jumping = system(lambda t, x, p: (x.v, -x.q - p.mu * np.sign(x.q)))
    status = hybrid.simulate(jumping, (1.0, 0.0), (0.0, 1.0), tangent=True).status
    assert status.code is StatusCode.DISCONTINUOUS_FIELD
    assert "hybrid.split(system)" in status.remedy
