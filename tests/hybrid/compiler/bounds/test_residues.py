"""Terms that cancel to rounding: which terms are found, and how a block is released at that instant."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid
from hybrid.compiler.bounds.residues import residue_of_guard
from hybrid.compiler.compiled import compile_system
from hybrid.expression.tracing import model_symbols, trace
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem


def block():
    """A block on rough ground, on a spring, pushed by a cosine: written by hand, without ``filippov``."""

    def push(t, p):
        return p.A * np.cos(p.w * t + p.phi)

    def slips(sign):
        return lambda t, x, p: (x.v, push(t, p) - x.x - sign * p.f)

    def stops(mode, direction):
        rest = Reset(lambda t, x, p: (x.x, 0.0))
        return Transition(mode, "stick", Guard(lambda t, x, p: x.v, direction), rest)

    return HybridSystem(
        state=("x", "v"),
        parameters={"A": 1.0, "w": 1.0, "phi": 0.0, "f": 0.5},
        modes=[
            Mode("forwards", slips(1)),
            Mode("backwards", slips(-1)),
            Mode("stick", lambda t, x, p: (0.0 * x.x, 0.0 * x.v)),
        ],
        transitions=[
            stops("forwards", -1),
            stops("backwards", +1),
            Transition("stick", "forwards", Guard(lambda t, x, p: push(t, p) - x.x - p.f, +1)),
            Transition("stick", "backwards", Guard(lambda t, x, p: push(t, p) - x.x + p.f, -1)),
        ],
    )


BLOCK = block()


@pytest.mark.parametrize("solver", [None, hybrid.DOP853(), hybrid.RadauIIA()], ids=str)
@settings(max_examples=40)
@given(
    w=st.floats(0.3, 2.0),
    f=st.floats(0.05, 0.95),
    before=st.floats(-17.0, -3.0),
    size=st.one_of(st.none(), st.floats(-18.0, 0.0)),
)
def test_a_block_lets_go_once(solver, w, f, before, size):
    """The block is released once, however close to time zero and to the origin the forces are equal."""
    x0 = (0.0 if size is None else 10.0**size, 0.0)
    # Release: the force exceeds the spring's by f, ``10**before`` of a period after the start.
    phi = -np.arccos(min(f + x0[0], 1.0)) - 10.0**before

    def run(phi):
        parameters = {"w": w, "f": f, "phi": phi}
        return hybrid.simulate(
            BLOCK, x0, (0.0, 8.0), mode="stick", parameters=parameters, solver=solver, max_jumps=100
        )

    arc = run(phi)
    assert arc.status.ok
    assert max(np.unique(arc.jumps.t, return_counts=True)[1], default=0) <= 2
    np.testing.assert_allclose(arc.x[-1], run(phi - 1e-9).x[-1], atol=1e-6)


def marked(*rates, guard=lambda t, x, p: x.v):
    return HybridSystem(
        state=("x", "v"),
        parameters={"a": 1.0, "b": 1.0},
        modes=[Mode("run", lambda t, x, p: tuple(rate(t, x, p) for rate in rates))],
        transitions=[Transition("run", "run", Guard(guard, +1))],
    )


@pytest.mark.parametrize(
    ("rate", "found"),
    [
        (lambda t, x, p: np.cos(p.a * t) - x.x, True),
        (lambda t, x, p: p.a - p.b - x.x, True),
        (lambda t, x, p: p.a * (p.b + t - x.x), True),
        (lambda t, x, p: p.a * p.b - x.x, False),
        (lambda t, x, p: -p.a - x.x, False),
        (lambda t, x, p: np.sin(x.x + t) - 0.1 * x.v, False),
    ],
)
def test_what_may_cancel(rate, found):
    emitted = compile_system(marked(lambda t, x, p: x.v, rate)).emitted
    assert emitted.residue_component == ((1,) if found else ())
    assert emitted.first_residue == (0, int(found))


def test_only_what_a_guard_feels():
    def driven(t, x, p):
        return np.cos(t) - x.x

    assert compile_system(marked(driven, driven)).emitted.residue_component == (1,)
    on_both = marked(driven, driven, guard=lambda t, x, p: x.x * x.v - 1.0)
    assert compile_system(on_both).emitted.residue_component == (0, 1)

    def branching(t, x, p):
        return x.v - 1.0 if x.x > 0 else x.v + 1.0

    untraced = Guard(branching, +1, gradient=lambda t, x, p: (0.0, 1.0))
    system = marked(driven, driven)
    system = HybridSystem(
        state=system.state,
        parameters=system.parameters,
        modes=system.modes,
        transitions=[Transition("run", "run", untraced)],
    )
    assert compile_system(system).emitted.residue_component == (0, 1)


@pytest.mark.parametrize(
    ("guard", "found"),
    [
        (lambda t, x, p: np.cos(t) - x.x - p.a, lambda t, x, p: np.cos(t) - p.a),
        (lambda t, x, p: x.x - (p.a - p.b), lambda t, x, p: -(p.a - p.b)),
        (lambda t, x, p: x.x - p.a, None),
        (lambda t, x, p: np.cos(t) - p.a, None),
        (lambda t, x, p: np.sin(x.x - t), None),
    ],
)
def test_terms_of_guards(guard, found):
    state, names = ("x", "v"), ("a", "b")
    symbols = model_symbols(2, 2)
    [expression] = trace(guard, state, names)
    expected = None if found is None else trace(found, state, names)[0]
    assert residue_of_guard(expression, symbols) == expected
