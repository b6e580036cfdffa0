"""What is told of a system beside its code: facts of functions, traced or not."""

from itertools import pairwise

import numpy as np
import pytest
import sympy

from hybrid.compiler import emit as module
from hybrid.compiler.emit import emit
from hybrid.compiler.propagators.equations import Boundary
from hybrid.compiler.readers import is_free
from hybrid.compiler.written import Written
from hybrid.kernels.types.codes import EXACT, RUNGE_KUTTA, TAYLOR
from hybrid.symbolic.expressions import Absolute, CubeRoot, Floor, Maximum, Sign
from hybrid.symbolic.tracing import model_symbols
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import field_function, guard_function
from hybrid.system.graph import HybridSystem

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t


def branching(t, x, p):
    return (x.v, -x.q) if p.k > 0 else (x.q, x.v)


def branching_guard(t, x, p):
    return x.q if p.k > 0 else x.v


def timed_guard(t, x, p):
    return x.q + t**2 if p.k > 0 else x.v


def system_of(*transitions, fields=None, **options):
    fields = fields or {"a": lambda t, x, p: (x.v, -x.q), "b": lambda t, x, p: (x.v, 0.0)}
    return HybridSystem(
        state=("q", "v"),
        parameters={"k": 3.0},
        modes=[Mode(name, field) for name, field in fields.items()],
        transitions=[
            Transition(source, target, guard, reset, name=f"{i}")
            for i, (source, target, guard, reset) in enumerate(transitions)
        ],
        **options,
    )


def guards_of(system):
    """The guards as the compiler writes them."""
    writer = module._Writer(system)
    return [writer.write(guard_function(each)) for each in system.transitions]


LINE = Guard(lambda t, x, p: x.q - p.k, +1)


def test_facts_of_modes():
    """The first is linear, the second forced, the third not traced, the fourth not linear."""
    names = ("linear", "forced", "branching", "pendulum", "switch")
    emitted = emit(
        system_of(
            *((one, other, LINE, None) for one, other in pairwise(names)),
            fields={
                "linear": lambda t, x, p: (x.v, -p.k * x.q),
                "forced": lambda t, x, p: (x.v, np.cos(t) - x.q),
                "branching": branching,
                "pendulum": lambda t, x, p: (x.v, -np.sin(x.q)),
                "switch": lambda t, x, p: (x.v, -np.tanh(1e9 * x.q)),
            },
        )
    )
    assert emitted.traced_field == (True, True, False, True, True)
    assert emitted.autonomous == (True, False, False, True, True)
    assert emitted.abrupt == (False, False, True, False, True)
    kinds = [each.kind for each in emitted.propagators]
    assert kinds == [EXACT, EXACT, RUNGE_KUTTA, TAYLOR, TAYLOR]
    assert emitted.propagators[2].reason == "its field is not traced"
    assert emitted.steep == emitted.steep_inside == ("",) * 5
    assert [*emitted.opaque] == ["model_0"]
    assert emitted.opaque["model_0"].title == "Mode 'branching': field"
    assert emitted.opaque["model_0"].shape == (2,)
    assert emitted.opaque["model_0"].slopes
    assert emitted.proved_period


def test_facts_of_transitions():
    emitted = emit(
        system_of(
            ("a", "b", LINE, None),
            ("a", "b", Guard(lambda t, x, p: x.q - t, +1), Reset(lambda t, x, p: (x.q + t, x.v))),
            ("b", "a", Guard(branching_guard, -1), Reset(branching)),
            ("b", "a", Guard(lambda t, x, p: x.q * x.v, -1), Reset(lambda t, x, p: (x.v, x.q))),
            ("b", "a", Guard(lambda t, x, p: -2.0 * (x.q - p.k), -1), None),
        )
    )
    assert emitted.affine_guard == (True, True, False, False, True)
    assert emitted.timed_guard == (False, True, True, False, False)
    assert emitted.timed_reset == (False, True, True, False, False)
    assert [emitted.is_sampled(i) for i in range(5)] == [False, False, True, False, False]
    # The last guard vanishes where the first one does, with the opposite sign.
    assert emitted.surface[0] == emitted.surface[4]
    assert len({*emitted.surface}) == 4
    assert emitted.orientation[0] == -emitted.orientation[4]
    assert emitted.guard_in_series == (True, True, False, True, True)
    assert [each.title for each in emitted.opaque.values()] == [
        "Transition '2': guard",
        "Transition '2': reset",
    ]
    assert [each.shape for each in emitted.opaque.values()] == [(), (2,)]


def test_boundaries_of_a_mode():
    """Only a guard that ends its mode without a condition tells a sign inside the mode."""
    system = system_of(
        ("a", "b", LINE, None),
        ("b", "a", LINE, None),
        ("a", None, Guard(lambda t, x, p: x.v**2, -1), None),
        ("a", "a", LINE, None),
        ("a", "b", Guard(lambda t, x, p: x.q, +1, when=lambda t, x, p: x.v), None),
        ("a", "b", Guard(lambda t, x, p: x.v, +1, at_start=True), None),
        ("a", "b", Guard(branching_guard, +1), None),
        ("a", "b", Guard(lambda t, x, p: x.v, 0), None),
    )
    assert module._boundaries(system, "a", guards_of(system), SYMBOLS) == [
        Boundary(Q - K, -1, True),
        Boundary(V**2, 1, False),
        Boundary(Q - K, 0, True),
        Boundary(Q, 0, True),
        Boundary(None, -1, False),
        Boundary(V, 0, True),
    ]
    ends = [module._ends_mode(each) for each in system.transitions]
    assert ends == [True, True, True, False, False, True, True, True]


def test_gradients_of_the_guards_of_a_mode():
    """A gradient that is given, or of a function that is not traced, may be anything."""
    system = system_of(
        ("a", "b", Guard(lambda t, x, p: 2.0 * x.q - p.k * t, +1), None),
        ("b", "a", LINE, None),
        ("a", "b", Guard(lambda t, x, p: x.q, +1, gradient=lambda t, x, p: (1.0, 0.0)), None),
        ("a", "b", Guard(branching_guard, +1), None),
    )
    assert module._gradients(system, "a", guards_of(system)) == [[2, 0, -K], None, None]
    assert module._gradients(system, "b", guards_of(system)) == [[1, 0, 0]]


@pytest.mark.parametrize(
    ("expressions", "jacobian", "affine"),
    [
        ([Q + 2 * V], [[1, 2, 0]], True),
        ([K * Q], [[K, 0, 0]], True),
        ([Q * T], [[T, 0, Q]], False),
        ([Q**2], [[2 * Q, 0, 0]], False),
        ([Sign(Q)], [[0, 0, 0]], False),
        ([Q + Floor(T)], [[1, 0, 0]], False),
        ([Q + Floor(K)], [[1, 0, 0]], True),
        (None, None, False),
        ([Q], None, False),
    ],
)
def test_what_is_affine(expressions, jacobian, affine):
    rows = None if jacobian is None else [[*map(sympy.sympify, row)] for row in jacobian]
    assert module._is_affine(Written([], [], expressions, rows), SYMBOLS.variables) is affine


def test_only_the_derivatives_asked_for_decide_what_is_affine():
    """The columns behind those of the variables do not count."""
    written = Written([], [], [Q * T], [[T, ZERO, Q]])
    assert module._is_affine(written, (K, T)) is False
    assert module._is_affine(Written([], [], [Q + T**2], [[ONE, ZERO, 2 * T]]), (Q, V)) is True


ZERO, ONE = sympy.Integer(0), sympy.Integer(1)


@pytest.mark.parametrize(
    ("expressions", "symbols", "free"),
    [((Q,), (V,), True), ((Q, V), (V,), False), ((), (V,), True), (None, (V,), False)],
)
def test_what_is_free_of_symbols(expressions, symbols, free):
    assert is_free(expressions, symbols) is free


@pytest.mark.parametrize(
    ("period", "field", "proved"),
    [
        (None, lambda t, x, p: (x.v, np.exp(t)), True),
        (2.0, lambda t, x, p: (x.v, -x.q), True),
        (2.0, lambda t, x, p: (x.v, np.cos(np.pi * t)), True),
        (2 * np.pi / 3, lambda t, x, p: (x.v, np.cos(p.k * t)), False),
        (lambda p: 2 * np.pi / p.k, lambda t, x, p: (x.v, np.cos(p.k * t)), True),
        (lambda p: 2 * np.pi / p.k, lambda t, x, p: (x.v, np.cos(3.0 * t)), False),
        (lambda p: 2 * np.pi if p.k > 0 else 1.0, lambda t, x, p: (x.v, np.cos(t)), False),
        (2.0, branching, False),
    ],
)
def test_the_period_that_is_proved(period, field, proved):
    system = system_of(fields={"a": field}, period=period)
    writer = module._Writer(system)
    written = [writer.write(field_function(mode, 2)) for mode in system.modes]
    assert module._has_proved_period(system, written, writer) is proved


def test_every_function_must_have_the_period():
    """A guard, a condition and a reset may depend on time, too."""
    timed = lambda t, x, p: x.q - np.cos(p.k * t)  # noqa: E731
    for guard, reset, proved in (
        (LINE, None, True),
        (Guard(timed, +1), None, False),
        (Guard(LINE.function, +1, when=timed), None, False),
        (LINE, Reset(lambda t, x, p: (x.q, x.v + np.cos(p.k * t))), False),
    ):
        assert emit(system_of(("a", "b", guard, reset), period=2 * np.pi / 3)).proved_period is proved


def test_expressions_in_the_names_of_the_model():
    system = system_of(("a", "b", LINE, None))
    assert module._told(system, [V - K, sympy.sqrt(Q)]) == "-k + v, sqrt(q)"
    assert module._told(system, [Absolute(Q), CubeRoot(V)]) == "abs(q), cbrt(v)"
    assert module._told(system, [Maximum(Q, Sign(V))]) == "maximum(q, sign(v))"
    assert module._told(system, []) == ""


def test_a_field_that_jumps_in_two_places():
    field = lambda t, x, p: (np.sign(x.v), np.sign(x.q - p.k))  # noqa: E731
    assert emit(system_of(fields={"a": field})).discontinuities == ("v = 0, or -k + q = 0",)


def test_a_function_that_is_used_twice_is_compiled_once():
    """One shape has one compiled function; as a guard and as a field it has two."""
    emitted = emit(
        system_of(
            ("a", "b", Guard(branching_guard, +1), Reset(branching)),
            ("b", "a", Guard(branching_guard, -1), Reset(branching)),
            fields={"a": branching, "b": branching},
        )
    )
    assert [(each.function, each.shape) for each in emitted.opaque.values()] == [
        (branching, (2,)),
        (branching_guard, ()),
    ]
    assert [*emitted.opaque] == ["model_0", "model_1"]
    assert all(each.slopes for each in emitted.opaque.values())
    assert all(each.state == ("q", "v") and each.parameters == ("k",) for each in emitted.opaque.values())
    assert not any(each.reason.endswith(".") for each in emitted.opaque.values())


@pytest.mark.parametrize(
    ("guard", "gradient", "cells"),
    [
        (branching_guard, lambda t, x, p: (1.0, 0.0) if p.k > 0 else (0.0, 1.0), ["r[0]", "r[1]", "0.0"]),
        (timed_guard, lambda t, x, p: (1.0, 0.0, 2 * t) if p.k > 0 else 0, ["r[0]", "r[1]", "r[2]"]),
    ],
)
def test_a_gradient_that_branches_may_lack_the_column_of_time(guard, gradient, cells):
    system = system_of(("a", "b", Guard(guard, +1, gradient=gradient), None))
    writer = module._Writer(system)
    written = writer.write(guard_function(system.transitions[0]))
    assert [each.shape for each in writer.opaque.values()] == [(), (3 - cells.count("0.0"),)]
    assert written.expressions is None
    assert written.derivative == [
        "r = model_1(t, x, p)",
        *(f"out[{i}] = {cell}" for i, cell in enumerate(cells)),
    ]


def test_a_derivative_by_the_complex_step_column_by_column():
    writer = module._Writer(system_of(fields={"a": branching}))
    written = writer.write(field_function(writer.system.modes[0], 2))
    assert written.value == ["r = model_0(t, x, p)", "out[0] = r[0]", "out[1] = r[1]"]
    assert written.derivative == [
        *(f"r{j} = model_0_slopes(t, x, p, {j})" for j in range(3)),
        *(f"out[{i}, {j}] = r{j}[{i}]" for i in range(2) for j in range(3)),
    ]
    assert writer.write(field_function(writer.system.modes[0], 2)) is written
