"""Values that model functions read from elsewhere: a run sees them as they are, not as they were."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import hybrid
from hybrid import HybridSystem, Mode, ModelError, from_equations, simulate
from hybrid.compiler.compiled import compile_system
from hybrid.system.watched import Watched

RATE = 2.0


def decay(field):
    return HybridSystem(state=("q",), modes=[Mode("m", field)])


def rate_of(system):
    """The rate at which a state decays from 1."""
    return -np.log(simulate(system, (1.0,), (0.0, 0.5)).x[-1, 0]) / 0.5


def helped(q):
    return RATE * q


def of_a_global():
    def change(value):
        global RATE
        RATE = value

    return lambda t, x, p: (-helped(x.q),), change


def of_a_closure():
    rate = 2.0

    def change(value):
        nonlocal rate
        rate = value

    return lambda t, x, p: (-rate * x.q,), change


def of_an_array():
    table = np.array([0.0, 2.0])
    return lambda t, x, p: (-table[1] * x.q,), partial(table.__setitem__, 1)


def of_a_dict():
    table = {"rate": 2.0}
    return lambda t, x, p: (-table["rate"] * x.q,), partial(table.__setitem__, "rate")


def of_an_object():
    outer = SimpleNamespace(inner=SimpleNamespace(rate=2.0))
    return lambda t, x, p: (-outer.inner.rate * x.q,), partial(setattr, outer.inner, "rate")


class Body:
    __slots__ = ("rate",)

    def __init__(self):
        self.rate = 2.0

    @property
    def own(self):
        return self.rate

    def field(self, t, x, p):
        return (-self.own * x.q,)


def of_a_method():
    body = Body()
    return body.field, partial(setattr, body, "rate")


class Called:
    def __init__(self):
        self.rate = 2.0

    def __call__(self, t, x, p):
        return (-self.rate * x.q,)


class Heir(Called):
    pass


def of_an_inherited_call():
    heir = Heir()
    return heir, partial(setattr, heir, "rate")


def of_an_argument_given_in_advance():
    table = [2.0]

    def field(table, t, x, p):
        return (-table[0] * x.q,)

    return partial(field, table), partial(table.__setitem__, 0)


@pytest.mark.parametrize(
    "made",
    [
        of_a_global, of_a_closure, of_an_array, of_a_dict, of_an_object, of_a_method,
        of_an_inherited_call, of_an_argument_given_in_advance,
    ],
)  # fmt: skip
def test_a_change_is_seen_by_the_next_run(made):
    field, change = made()
    change(2.0)
    system = decay(field)
    for rate in (2.0, 3.0, 0.5, 2.0):
        change(rate)
        assert rate_of(system) == pytest.approx(rate, rel=1e-9)


def test_without_a_change_nothing_is_compiled_again():
    """Equal values are no change, nor are globals with the names of states and parameters."""
    field, change = of_a_closure()
    system = decay(field)
    first = compile_system(system)
    change(float("2.0"))
    globals()["q"] = object()
    assert compile_system(system) is first
    del globals()["q"]


def test_a_declared_period_is_watched_too():
    table = {"w": 2.0}
    system = HybridSystem(
        state=("q",), modes=[Mode("m", lambda t, x, p: (np.cos(table["w"] * t),))],
        period=lambda p: 2 * np.pi / table["w"],
    )  # fmt: skip
    for w in (2.0, 4.0):
        table["w"] = w
        section = hybrid.stroboscopic_section(system, (0.0,), periods=2)
        assert section.t == pytest.approx([2 * np.pi / w, 4 * np.pi / w])


@pytest.mark.parametrize("function", [len, int, np.sin, str.upper, "a".upper, partial(len)])
def test_functions_written_in_c_read_nothing(function):
    """The call of a built-in function has a call of its own, and so on without end."""
    assert Watched([function]).holds()


def test_a_derived_system_asks_to_be_derived_again():
    field, change = of_a_closure()
    system = from_equations(lambda t, x, p: (field(t, x, p)[0] * np.sign(x.q),), state=("q",))
    assert simulate(system, (1.0,), (0.0, 0.1)).status.ok
    change(3.0)
    with pytest.raises(ModelError, match=r"Derive the system again \(split, from_equations, filippov\)"):
        simulate(system, (1.0,), (0.0, 0.1))
