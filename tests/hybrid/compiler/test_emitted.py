"""What is told of a system from the programs that bound its guards and forcing."""

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Transition
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.emitted import Programs


def branching(t, x, p):
    return x.a if t < 1e9 else x.b


def mixed():
    """Guards of all kinds beside each other; modes without forcing, with pulses, without bounds."""

    def guard(function, direction=1, **given):
        return Guard(function, direction, **given)

    guards = [
        guard(branching, gradient=lambda t, x, p: (1.0, 0.0)),
        guard(lambda t, x, p: x.a**2 - 1.0),
        guard(branching, -1, gradient=lambda t, x, p: (1.0, 0.0)),
        guard(lambda t, x, p: x.a - 5.0),
        guard(branching, gradient=lambda t, x, p: (1.0, 0.0)),
    ]

    def opaque(t, x, p):
        return (x.b, -x.a) if t < 1e9 else (0.0, 0.0)

    return HybridSystem(
        state=("a", "b"),
        modes=[
            Mode("free", lambda t, x, p: (x.b, -x.a)),
            Mode("pulse", lambda t, x, p: (x.b, np.exp(-((t - 3.0) ** 2)) - x.a)),
            Mode("two", lambda t, x, p: (np.exp(-(t**2)), 1.0 / np.cosh(t) - x.a)),
            Mode("opaque", opaque, jacobian=lambda t, x, p: [[0.0, 1.0], [-1.0, 0.0]]),
        ],
        transitions=[
            Transition(source, "free", each, name=f"{i}")
            for i, (source, each) in enumerate(
                zip(("pulse", "two", "opaque", "pulse", "two"), guards, strict=True)
            )
        ],
    )


def test_guards_and_modes_one_by_one():
    emitted = compile_system(mixed()).emitted
    assert [emitted.is_sampled(i) for i in range(5)] == [True, False, True, False, True]
    assert [emitted.has_forcing(i) for i in range(4)] == [False, True, True, False]
    assert emitted.first_forcing == (0, 0, 1, 3, 3)
    assert emitted.forcing_component == (1, 0, 1)
    assert [emitted.is_fragile(i) for i in range(4)] == [False, True, True, False]
    assert [emitted.pulses_excluded(i) for i in range(4)] == [True, True, True, False]


def test_the_longest_program():
    def longest(*first):
        return Programs((), (), (), first).longest

    assert longest(0, 3, 3, 8, 9) == 5
    assert longest(0) == 0
