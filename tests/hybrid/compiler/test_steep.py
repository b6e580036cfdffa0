"""Powers with infinite slopes at guards: which are found, and what takes their place exactly on the guard."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.compiler import steep
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.propagators.equations import Boundary
from hybrid.kernels.types.codes import NO_MODE
from hybrid.symbolic.tracing import model_symbols, trace

STATE, NAMES = ("a", "b"), ("k", "n")
SYMBOLS = model_symbols(2, 2)


def traced(function):
    return trace(function, STATE, NAMES)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda t, x, p: x.a**0.5, True),
        (lambda t, x, p: (x.b - t) ** 0.99, True),
        (lambda t, x, p: t**0.01, True),
        (lambda t, x, p: np.cbrt(x.a), True),
        (lambda t, x, p: x.a**p.n, True),
        (lambda t, x, p: x.a ** (p.n + 0.5), True),
        # Finite slopes, no finite value, and no variable.
        (lambda t, x, p: x.a**1.5, False),
        (lambda t, x, p: x.a**2, False),
        (lambda t, x, p: x.a**-0.5, False),
        (lambda t, x, p: p.k**0.5 * x.a, False),
        (lambda t, x, p: np.cbrt(p.k) * x.a, False),
    ],
)
def test_powers_that_may_be_steep(function, expected):
    [expression] = traced(function)
    found = steep.steep_powers([expression], SYMBOLS)
    assert found == ([expression] if expected else [])


def at_guards_and_inside(function, guards=((lambda t, x, p: x.a, 1),)):
    expressions = traced(function)
    boundaries = [Boundary(traced(guard)[0], inside) for guard, inside in guards]
    return (
        steep.steep_at_guards(expressions, boundaries, SYMBOLS),
        steep.steep_inside(expressions, boundaries, SYMBOLS),
    )


@pytest.mark.parametrize(
    ("function", "guards", "inside"),
    [
        (lambda t, x, p: x.a**0.5, 1, 0),
        (lambda t, x, p: (3.0 * x.a) ** 0.5, 1, 0),
        (lambda t, x, p: np.sqrt(np.abs(x.a)), 1, 0),
        (lambda t, x, p: np.cbrt(x.a), 1, 0),
        (lambda t, x, p: x.a**p.n, 1, 0),
        # Beside the guard: powers of what switches, with a number for an exponent, and cube roots.
        (lambda t, x, p: np.sqrt(np.abs(x.b)), 0, 1),
        (lambda t, x, p: np.maximum(x.b, 0.0) ** 0.5, 0, 1),
        (lambda t, x, p: np.cbrt(x.b), 0, 1),
        (lambda t, x, p: np.sqrt(x.b), 0, 0),
        (lambda t, x, p: np.abs(x.b) ** p.n, 0, 0),
        (lambda t, x, p: np.sqrt(np.abs(x.b)) + np.sqrt(x.a) + np.cbrt(x.b) + x.a**0.25, 2, 2),
    ],
)
def test_powers_of_guards_and_of_what_switches_inside(function, guards, inside):
    assert tuple(map(len, at_guards_and_inside(function))) == (guards, inside)


def test_only_guards_at_which_the_mode_ends_count():
    def two(t, x, p):
        return np.sqrt(x.a) + np.sqrt(np.abs(x.b))

    def first(t, x, p):
        return x.a

    def second(t, x, p):
        return x.b

    def lengths(*guards):
        return tuple(map(len, at_guards_and_inside(two, guards)))

    assert lengths((first, 0)) == (0, 1)
    assert lengths((first, 1), (second, 1)) == (2, 0)
    assert lengths((second, -1)) == (1, 0)
    assert lengths() == (0, 1)
    assert steep.steep_at_guards(None, [Boundary(SYMBOLS.x[0], 1)], SYMBOLS) == []
    assert steep.steep_inside(None, [Boundary(SYMBOLS.x[0], 1)], SYMBOLS) == []


def contact(n=0.5, untraced=False):
    """A mass that falls onto a soft floor; it is put back on the surface when it has sunk by 1."""

    def free(t, x, p):
        if untraced and t > 1e9:
            return x.v, 0.0
        return x.v, -1.0

    def again(t, x, p):
        return x.q + 1.0, x.v

    return HybridSystem(
        state=("q", "v"),
        parameters={"K": 1e6, "n": n},
        modes=[
            Mode("free", free, jacobian=lambda t, x, p: [[0.0, 1.0], [0.0, 0.0]]),
            Mode("contact", lambda t, x, p: (x.v, p.K * np.sqrt(-x.q) + (-x.q) ** p.n - 1.0)),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.q, -1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.q, +1)),
            Transition("contact", "contact", Guard(lambda t, x, p: x.q + 1.0, -1), Reset(again)),
            Transition("contact", None, Guard(lambda t, x, p: x.v + 9.0, -1)),
        ],
    )


@pytest.mark.parametrize("untraced", [False, True])
def test_which_field_counts_beside_each_transition(untraced):
    """Modes are 0 and 1; the others are the contact on its surface: when reached, left, after the reset."""
    emitted = compile_system(contact(untraced=untraced)).emitted
    assert emitted.crossing == ((0, 2), (3, 0), (1, 4), (1, NO_MODE))


@pytest.mark.parametrize("untraced", ["guard", "reset"])
def test_beside_what_is_not_traced_the_field_is_that_of_the_mode(untraced):
    def height(t, x, p):
        return 2.0 * x.q if t > 1e9 else x.q

    def impact(t, x, p):
        return (x.q, x.v) if t > 1e9 else (x.q, -x.v)

    guard, reset = Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, -x.v))
    if untraced == "guard":
        guard = Guard(height, -1, gradient=lambda t, x, p: (1.0, 0.0, 0.0))
    else:
        reset = Reset(impact, jacobian=lambda t, x, p: ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("free", lambda t, x, p: (x.v, -1.0)),
            Mode("contact", lambda t, x, p: (x.v, np.sqrt(np.abs(x.q)))),
        ],
        transitions=[
            Transition("free", "contact", guard, reset),
            Transition("contact", "free", Guard(lambda t, x, p: x.q, +1)),
        ],
    )
    # The contact has a field of its own where it is left through a traced guard.
    assert compile_system(system).emitted.crossing == ((0, 1), (2, 0))


@pytest.mark.parametrize("n", [0.25, -0.5])
def test_on_the_guard_steep_powers_are_zero(n):
    """With a negative exponent the power is infinite there: it is taken as it is."""
    model = compile_system(contact(n)).model()
    field_at = load_kernels("hybrid.kernels.steps.step").field_at

    def rate(number, height):
        out = np.zeros(2)
        field_at(model, number, 0.0, np.array([height, 3.0]), out)
        assert out[0] == 3.0
        return out[1]

    power = 0.0 if n > 0 else 1e8
    assert rate(1, -1e-16) == pytest.approx(0.01 - 1.0 + 1e-16**n, rel=1e-12)
    for number in (2, 3):
        assert rate(number, -1e-16) == pytest.approx(power - 1.0, rel=1e-15)
    # After the reset: the states are those behind it.
    assert rate(4, -1e-16) == pytest.approx(power - 1.0, rel=1e-15)
