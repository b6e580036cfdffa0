"""From a model to machine code and a graph of indices."""

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Transition, compile_system
from hybrid.compiler.parts import (
    ABREAST_SERIES,
    ABREAST_TANGENT_SERIES,
    EVENTS,
    FIELDS,
    PARTS,
    SERIES,
    SLOPES,
    TANGENT_SERIES,
    VARIATIONAL,
)
from hybrid.kernels.types.codes import DESINGULARISED, EXACT
from hybrid.system.functions import field_function, guard_function
from hybrid.transform.markers import with_section
from models import bouncing_ball, impact_oscillator, vibroimpact


def test_once_for_all_calls():
    system = bouncing_ball()
    assert compile_system(system) is compile_system(system)


def test_models_alike_share_their_code():
    one, other = compile_system(bouncing_ball()), compile_system(bouncing_ball())
    assert one is not other
    assert one.functions(FIELDS) is other.functions(FIELDS)
    assert one.functions(EVENTS) is other.functions(EVENTS)


def test_parameters_do_not_compile_anew():
    compiled = compile_system(bouncing_ball())
    moon = attrs.evolve(compiled.system, parameters={"g": 1.62, "e": 0.8})
    assert compile_system(moon).functions(FIELDS) is compiled.functions(FIELDS)
    np.testing.assert_allclose(compiled.model({"g": 1.62}).parameters, [1.62, 0.8], rtol=1e-14)


def test_repr():
    assert repr(compile_system(bouncing_ball())) == (
        "CompiledSystem of bouncing ball: 2 states\n"
        "  mode flight: exact (polynomials of degree 2)\n"
        "  transition bounce: affine guard, its crossings are isolated on each step"
    )
    nameless = HybridSystem(
        state=("x",),
        modes=[Mode("a", lambda t, x, p: (-(x.x**3),))],
        transitions=[Transition("a", "a", Guard(lambda t, x, p: np.sin(x.x)), name="wave")],
    )
    assert repr(compile_system(nameless)) == (
        "CompiledSystem of a system: 1 states\n"
        "  mode a: Taylor series (smooth, nonlinear in the state)\n"
        "  transition wave: guard bounded on each step, its crossings are proved"
    )


def test_what_tracing_proves():
    emitted = compile_system(vibroimpact()).emitted
    assert [each.kind for each in emitted.propagators] == [EXACT, DESINGULARISED]
    assert list(emitted.affine_guard) == [True, True]
    assert not emitted.opaque


@pytest.mark.abreast
def test_a_run_compiles_only_what_it_needs():
    system = impact_oscillator()
    parts = compile_system(system).parts
    needed = {FIELDS, EVENTS, SLOPES}
    assert set(parts) == needed
    start, span = (0.3, -0.5), (0.0, 5.0)
    alone = hybrid.simulate(system, start, span)
    assert set(parts) == {*needed, SERIES}
    carried = hybrid.simulate(system, start, span, tangent=True)
    assert set(parts) == {*needed, SERIES, TANGENT_SERIES}
    hybrid.simulate(system, start, span, solver=hybrid.DOP853())
    assert VARIATIONAL not in parts
    other = hybrid.simulate(system, start, span, solver=hybrid.DOP853(), tangent=True)
    assert set(parts) == {*PARTS} - {ABREAST_SERIES, ABREAST_TANGENT_SERIES}
    hybrid.simulate_many(system, [start], span)
    assert ABREAST_SERIES in parts
    np.testing.assert_allclose(carried.x[-1], alone.x[-1], rtol=1e-12)
    np.testing.assert_allclose(other.fundamental, carried.fundamental, rtol=1e-6)


def test_a_section_shares_the_fields_of_its_system():
    system = impact_oscillator()
    compiled = compile_system(system)
    marked = compile_system(with_section(system, Guard(lambda t, x, p: x.v, -1)))
    assert marked.functions(FIELDS) is compiled.functions(FIELDS)
    assert marked.functions(EVENTS) is not compiled.functions(EVENTS)


def test_no_system():
    with pytest.raises(
        hybrid.ArgumentError, match=r"system must be a HybridSystem; got .* Call the model's fact"
    ):
        compile_system(bouncing_ball)


def test_a_function_that_cannot_be_compiled():
    import math

    sine = HybridSystem(state=("x",), modes=[Mode("a", lambda t, x, p: (math.sin(x.x),))])
    with pytest.raises(
        hybrid.ModelError, match=r"Mode 'a': field cannot be .*use np.sin in place of math.sin"
    ):
        compile_system(sine)


def test_derivatives_have_one_column_per_state_and_one_for_time():
    """The field ``(v, -g)`` and the guard ``q`` of a ball do not change with time."""
    ball, values = compile_system(bouncing_ball()), bouncing_ball().parameter_values()
    x = np.array([1.0, 2.0])
    field = field_function(ball.system.modes[0], ball.system.variables)
    assert ball.derivative(field, 0, 0.0, x, values).tolist() == [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    guard = guard_function(ball.system.transitions[0])
    assert ball.derivative(guard, 0, 0.0, x, values).tolist() == [[1.0, 0.0, 0.0]]
