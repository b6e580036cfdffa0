import functools
import math
import os
import subprocess
import sys

import attrs
import numpy as np
import pytest

import models
from hybrid import Table, from_equations
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.emit import emit, text_of
from hybrid.compiler.llvm.functions import compiled_part, own_functions
from hybrid.compiler.parts import EVENTS, FIELDS, LATER, PARTS, SLOPES
from hybrid.errors import ModelError
from hybrid.kernels.types.codes import EXACT, RUNGE_KUTTA
from hybrid.system.derivatives import sample_points
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import field_function, guard_function, reset_function
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import PARAMETERS, STATE, named_values
from tests.hybrid.code import called, functions_in
from tests.hybrid.systems import ball


def load(emitted, *, compiled):
    """The six compiled functions."""
    if compiled:
        own = own_functions(emitted)
        functions = (
            compiled_part(emitted.texts[FIELDS], FIELDS, own)
            | compiled_part(emitted.texts[EVENTS], EVENTS, own)
            | compiled_part(emitted.texts[SLOPES], SLOPES, own)
        )
        return {name: called(function) for name, function in functions.items()}
    calls = {}
    for name, own in emitted.opaque.items():
        calls |= {name: in_python(own), f"{name}_slopes": slopes_in_python(own)}
    return functions_in("".join(emitted.texts[part] for part in (FIELDS, EVENTS, SLOPES)), calls)


def in_python(own):
    """The functions that the code calls, in plain Python: all numbers of a function in one row."""

    def values(t, x, p):
        parameters = named_values(PARAMETERS, own.parameters, p)
        state = (
            x[: own.state]
            if isinstance(own.state, int)
            else named_values(STATE, own.state, x[: len(own.state)])
        )
        return np.ravel(np.array(own.function(t, state, parameters)))

    return values


def slopes_in_python(own):
    def slopes(t, x, p, column):
        n = own.state if isinstance(own.state, int) else len(own.state)
        z = np.append(x[:n], t) + 1e-30j * (np.arange(n + 1) == column)
        return in_python(own)(z[n], z[:n], p).imag / 1e-30

    return slopes


def run(function, shape, index, t, x, p):
    # The Jacobian of a field leaves out what is zero.
    out = np.zeros(shape) if len(shape) == 2 else np.full(shape, 777.0)
    padded = np.append(x, [1e300, math.nan])
    function(index, float(t), padded, p, out)
    return out


def plain(system, function, t, x):
    p = system.variables.parameter_view(system.parameter_values())
    with np.errstate(all="ignore"):
        return np.ravel(np.asarray(function(t, system.variables.state_view(x), p), dtype=float))


def central_difference(system, function, t, x, h=1e-5):
    columns = []
    for shift in h * np.eye(len(x) + 1):
        ahead = plain(system, function, t + shift[-1], x + shift[:-1])
        columns.append((ahead - plain(system, function, t - shift[-1], x - shift[:-1])) / (2 * h))
    return np.column_stack(columns)


def mode_system(field, *, state=("q", "v"), parameters=None, jacobian=None):
    parameters = {} if parameters is None else parameters
    return HybridSystem(state=state, parameters=parameters, modes=[Mode("a", field, jacobian=jacobian)])


def hertz_field(t, x, p):
    return (x.v, p.k * np.maximum(x.q, 0) ** 1.5 - p.c * np.maximum(x.q, 0) ** 0.25 * x.v)


def hertz():
    return mode_system(hertz_field, parameters={"k": 3.0, "c": 0.2})


def chain():
    def field(t, x, p):
        q, v = x[:6], x[6:]
        squeeze = np.maximum(-np.diff(np.concatenate([[0.0], q, [0.0]])), 0)
        force = p.k * squeeze**1.5
        return np.concatenate([v, force[:-1] - force[1:] - p.c * v + np.cos(p.w * t)])

    return mode_system(field, state=12, parameters={"k": 3.0, "c": 0.1, "w": 2.0})


def two_modes():
    def sliding(t, x, p):
        return (x.v, -p.mu * np.sign(x.v) - np.where(x.q > 0.5, p.k * x.q, x.q**2) + np.mod(t + x.v, p.w))

    return HybridSystem(
        state=("q", "v"),
        parameters={"mu": 0.3, "k": 2.0, "w": 1.7},
        modes=[
            Mode("free", lambda t, x, p: (x.v, -p.k * x.q + np.cos(p.w * t))),
            Mode("sliding", sliding),
        ],
        transitions=[
            Transition("free", "sliding", Guard(lambda t, x, p: x.q - np.sin(p.w * t) / (1 + x.v**2))),
            Transition(
                "sliding",
                "free",
                Guard(lambda t, x, p: np.hypot(x.q, x.v) - p.k),
                Reset(lambda t, x, p: (x.v, -x.q * np.exp(-t))),
            ),
        ],
    )


def opaque():
    def field(t, x, p):
        return (x.v, -x.q * np.cos(t)) if p.e > 1 else (x.v, -x.q * x.v * t)

    def guard(t, x, p):
        return x.q * x.v if p.e > 1 else x.q**2 - t

    def reset(t, x, p):
        total = 0.0 * x.v
        k = 0
        while k < p.e + 2:
            total = total + x.q**2
            k += 1
        return (0.0, total)

    return HybridSystem(
        state=("q", "v"),
        parameters={"e": 0.8},
        modes=[Mode("a", field)],
        transitions=[Transition("a", "a", Guard(guard), Reset(reset))],
    )


def opaque_chain(n=3):
    def field(t, x, p):
        return -x * t if p.e > 1 else np.cos(x) * x[::-1] + t**2

    return mode_system(field, state=n, parameters={"e": 0.8})


def long_opaque_chain():
    return opaque_chain(14)


@pytest.mark.parametrize("compiled", [False, True], ids=["plain", "compiled"])
@pytest.mark.parametrize("model", [ball, hertz, chain, two_modes, opaque, opaque_chain, long_opaque_chain])
def test_every_function_agrees_with_the_model(model, compiled):
    system = model()
    n, p = system.dimension, system.parameter_values()
    functions = load(emit(system), compiled=compiled)
    pairs = [
        ("field", "field_jacobian", k, field_function(mode, system.variables))
        for k, mode in enumerate(system.modes)
    ]
    for k, transition in enumerate(system.transitions):
        pairs.append(("guard", "guard_gradient", k, guard_function(transition)))
        if transition.reset is not None:
            pairs.append(("reset", "reset_jacobian", k, reset_function(transition, system.variables)))
    for value, derivative, index, function in pairs:
        for t, x in sample_points(n):
            expected = plain(system, function.value, t, x)
            result = run(functions[value], (function.rows,), index, t, x, p)
            np.testing.assert_allclose(result, expected, rtol=1e-14, atol=1e-15)
            shape = (n + 1,) if function.size is None else (n, n + 1)
            result = run(functions[derivative], shape, index, t, x, p)
            expected = central_difference(system, function.value, t, x).reshape(shape)
            np.testing.assert_allclose(result, expected, rtol=1e-6, atol=1e-7)


def test_no_reset_is_the_identity():
    functions = load(emit(two_modes()), compiled=False)
    x, p = np.array([3.0, 4.0]), np.ones(3)
    np.testing.assert_array_equal(run(functions["reset"], (2,), 0, 0.0, x, p), x)
    np.testing.assert_array_equal(run(functions["reset_jacobian"], (2, 3), 0, 0.0, x, p), np.eye(2, 3))


@pytest.mark.parametrize("power", [1.5, 2.5, 2, 3])
@pytest.mark.parametrize("compiled", [False, True], ids=["plain", "compiled"])
def test_a_contact_that_just_touches_has_slope_zero(power, compiled):
    system = mode_system(lambda t, x, p: (np.maximum(x.q, 0) ** power, 0.0))
    jacobian = load(emit(system), compiled=compiled)["field_jacobian"]
    for q, slope in ((-1.0, 0.0), (-0.0, 0.0), (0.0, 0.0), (4.0, power * 4.0 ** (power - 1))):
        result = run(jacobian, (2, 3), 0, 0.0, np.array([q, 1.0]), np.empty(0))
        np.testing.assert_allclose(result, [[slope, 0.0, 0.0], [0.0, 0.0, 0.0]], rtol=1e-15)


@pytest.mark.parametrize("squeeze", [lambda q: np.maximum(q, 0), lambda q: np.where(q > 0, q, 0)])
def test_an_open_contact_has_slope_zero_whatever_its_power(squeeze):
    system = mode_system(
        lambda t, x, p: (p.k * squeeze(x.q) ** p.n * x.v, 0.0), parameters={"k": 2.0, "n": 0.25}
    )
    jacobian = load(emit(system), compiled=True)["field_jacobian"]
    result = run(jacobian, (2, 3), 0, 0.0, np.array([-1.0, 3.0]), system.parameter_values())
    np.testing.assert_array_equal(result, np.zeros((2, 3)))


def test_slopes_at_kinks():
    system = mode_system(lambda t, x, p: (np.maximum(x.q, x.v), np.abs(x.q - x.v)))
    jacobian = load(emit(system), compiled=False)["field_jacobian"]
    result = run(jacobian, (2, 3), 0, 0.0, np.array([1.0, 1.0]), np.empty(0))
    np.testing.assert_array_equal(result, [[0.5, 0.5, 0.0], [0.0, 0.0, 0.0]])
    result = run(jacobian, (2, 3), 0, 0.0, np.array([math.nan, 1.0]), np.empty(0))
    assert np.all(np.isnan(result[:, :2]))


def test_division_by_zero_follows_ieee():
    functions = load(emit(mode_system(lambda t, x, p: (1 / x.q, np.log(x.v)))), compiled=True)
    np.testing.assert_array_equal(
        run(functions["field"], (2,), 0, 0.0, np.zeros(2), np.empty(0)), [np.inf, -np.inf]
    )


def test_half_powers_are_roots_and_whole_powers_products():
    source = emit(hertz()).texts[FIELDS]
    assert '"sqrt"' in source
    assert "**" in source  # the power 1/4
    assert "1.5]" not in source
    assert "**" not in emit(mode_system(lambda t, x, p: (x.q**5, x.v**-1.5 + x.q**2.0))).texts[FIELDS]


def test_what_is_proved():
    emitted = emit(two_modes())
    assert [each.kind == EXACT for each in emitted.propagators] == [True, False]
    assert emitted.autonomous == (False, False)
    assert emitted.affine_guard == (False, False)
    assert emit(ball()).affine_guard == emit(ball()).autonomous == (True,)
    unknown = emit(opaque())
    assert unknown.autonomous == unknown.affine_guard == (False,)


def test_guards_tell_whether_a_field_may_change_abruptly():
    """A maximum, a sign or a quotient by a size that the sign of a guard decides inside the mode is none."""
    pushes = {
        "force of a contact": lambda u: np.maximum(u, 0.0) ** 1.5,
        "sign": lambda u: u * np.sign(u),
        "quotient by its size": lambda u: u / np.abs(u),
        "saturation": lambda u: np.tanh(1e9 * u),
        "sine": np.sin,
    }
    found = {}
    for name, push in pushes.items():
        field = lambda t, x, p, push=push: (x.v, -push(x.q))  # noqa: E731
        system = HybridSystem(
            state=("q", "v"),
            modes=[Mode("beyond", field), Mode("everywhere", field)],
            transitions=[Transition("beyond", "everywhere", Guard(lambda t, x, p: x.q, -1))],
        )
        found[name] = emit(system).abrupt
    assert found == {
        "force of a contact": (False, True),
        "sign": (False, True),
        "quotient by its size": (False, True),
        "saturation": (True, True),
        "sine": (False, False),
    }


def test_a_constant_slope_between_jumps_is_not_affine():
    for force in (lambda t, x: -np.sign(x.v), lambda t, x: np.mod(x.q, 1.0)):
        [found] = emit(mode_system(lambda t, x, p, force=force: (x.v, force(t, x)))).propagators
        assert found.kind == RUNGE_KUTTA


SEEDED = """
from test_emit import chain, two_modes, opaque
from hybrid.compiler.emit import emit
print(emit(chain()).texts, emit(two_modes()).texts, emit(opaque()).texts)
"""


def test_the_text_is_the_same_in_every_process():
    here = os.path.dirname(__file__)
    texts = set()
    for seed in ("1", "77"):
        path = os.pathsep.join([os.getcwd(), here])
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": path}
        done = subprocess.run(
            [sys.executable, "-c", SEEDED], env=environment, check=True, capture_output=True, text=True
        )
        texts.add(done.stdout)
    assert len(texts) == 1
    here = " ".join(str(emit(model()).texts) for model in (chain, two_modes, opaque))
    assert texts.pop().strip() == here


def branching(t, x, p):
    return (x.v, -x.q if x.q > 0 else -2.0 * x.q)


def branching_jacobian(t, x, p):
    return ((0.0, 1.0), (-1.0 if x.q > 0 else -2.0, 0.0))


def test_a_given_derivative_serves_where_nothing_else_can():
    system = mode_system(branching, parameters={"k": 1.0}, jacobian=branching_jacobian)
    functions = load(emit(system), compiled=True)
    for q, slope in ((1.0, -1.0), (-1.0, -2.0)):
        x = np.array([q, 0.5])
        np.testing.assert_array_equal(run(functions["field"], (2,), 0, 0.0, x, np.ones(1)), [0.5, slope * q])
        result = run(functions["field_jacobian"], (2, 3), 0, 0.0, x, np.ones(1))
        np.testing.assert_array_equal(result, [[0.0, 1.0, 0.0], [slope, 0.0, 0.0]])


def test_a_given_derivative_that_branches_may_have_a_column_of_time():
    def field(t, x, p):
        return x.v + 1.5 * t**2, (-x.q if x.q > 0 else -2.0 * x.q) + 5.0 * t

    def jacobian(t, x, p):
        return (0.0, 1.0, 3.0 * t), (-1.0 if x.q > 0 else -2.0, 0.0, 5.0)

    functions = load(emit(mode_system(field, parameters={"k": 1.0}, jacobian=jacobian)), compiled=True)
    for q, slope in ((1.0, -1.0), (-1.0, -2.0)):
        result = run(functions["field_jacobian"], (2, 3), 0, 0.25, np.array([q, 0.5]), np.ones(1))
        np.testing.assert_array_equal(result, [[0.0, 1.0, 0.75], [slope, 0.0, 5.0]])


def test_opaque_functions_without_parameters_compile():
    system = mode_system(branching, jacobian=branching_jacobian)
    functions = load(emit(system), compiled=True)
    result = run(functions["field"], (2,), 0, 0.0, np.array([-1.0, 0.5]), np.empty(0))
    np.testing.assert_array_equal(result, [0.5, 2.0])


def test_a_traced_given_derivative_is_used_and_padded():
    system = mode_system(lambda t, x, p: (x.v, -(x.q**2)), jacobian=lambda t, x, p: ((0, 1), (-2 * x.q, 0)))
    emitted = emit(system)
    assert not emitted.opaque
    result = run(
        load(emitted, compiled=False)["field_jacobian"], (2, 3), 0, 0.0, np.array([3.0, 1.0]), np.empty(0)
    )
    np.testing.assert_array_equal(result, [[0, 1, 0], [-6, 0, 0]])


def test_math_functions_need_numpy_or_a_derivative():
    with pytest.raises(ModelError, match=r"Mode 'a': field cannot be differentiated.*np.sin.*jacobian="):
        emit(mode_system(lambda t, x, p: (x.v, -math.sin(x.q))))


def test_a_branch_on_the_state_needs_a_derivative():
    with pytest.raises(
        ModelError, match=r"field cannot be differentiated.*branch cannot be traced.*jacobian="
    ) as caught:
        emit(mode_system(branching))
    assert isinstance(caught.value.__cause__, TypeError)


def test_a_guard_asks_for_its_gradient():
    guard = Guard(lambda t, x, p: math.sin(x.q))
    system = HybridSystem(
        state=("q",),
        modes=[Mode("a", lambda t, x, p: (1.0,))],
        transitions=[Transition("a", "a", guard, name="hit")],
    )
    with pytest.raises(ModelError, match=r"Transition 'hit': guard cannot be differentiated.*gradient="):
        emit(system)


class TestPlainFunctions:
    """A function that cannot be traced is compiled directly, which requires a plain function."""

    class Field:
        factor = 2.0

        def method(self, t, x, p):
            return (-self.factor * x.q if x.q > 0 else x.q,)

        def __call__(self, t, x, p):
            return self.method(t, x, p)

    @pytest.mark.parametrize(
        "function", [Field(), Field().method, functools.partial(Field.method, Field())], ids=range(3)
    )
    def test_others_say_what_to_do(self, function):
        system = HybridSystem(state=("q",), modes=[Mode("a", function)])
        text = (
            r"Mode 'a': field cannot be traced, and is compiled as it is only if it is a plain function; got"
        )
        with pytest.raises(ModelError, match=text):
            compile_system(system)

    def test_they_may_be_anything_where_they_can_be_traced(self):
        class Decay:
            rate = 2.0

            def __call__(self, t, x, p):
                return (-self.rate * x.q,)

        system = HybridSystem(state=("q",), modes=[Mode("a", Decay())])
        assert not compile_system(system).emitted.opaque


def test_guards_that_are_not_affine_have_programs():
    """They are bounded by interval arithmetic; where an affine one crosses follows from its polynomial."""
    values = {
        "line": lambda t, x, p: x.q - 2 * x.v + 1,
        "circle": lambda t, x, p: x.q**2 + x.v**2 - 1,
        "plane": lambda t, x, p: 3 * x.v,
        "wave": lambda t, x, p: np.sin(x.q) - 0.3 * t,
    }
    resets = {
        "line": Reset(lambda t, x, p: (x.q, -x.v)),
        "wave": Reset(lambda t, x, p: (x.q, np.cos(t))),
    }
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("run", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition("run", "run", Guard(each, +1), resets.get(name), name=name)
            for name, each in values.items()
        ],
    )
    emitted = emit(system)
    assert emitted.affine_guard == (True, False, True, False)
    assert emitted.timed_guard == (False, False, False, True)
    assert emitted.timed_reset == (False, False, False, True)
    rows = np.diff(emitted.programs.first)[:4]
    assert (rows > 0).tolist() == [False, True, False, True]


def test_what_a_system_that_grows_leaves_out_is_written_when_a_run_asks_for_it(monkeypatch):
    grows = models.rocking_block()
    emitted, later = emit(grows), {part: text_of(grows, part) for part in LATER}
    assert emitted.texts.keys() == PARTS.keys() - later.keys()
    monkeypatch.setattr("hybrid.compiler.emit.LATER", ())
    whole = emit(models.rocking_block())
    assert attrs.evolve(emitted, texts=emitted.texts | later) == whole


def test_tables_leave_nothing_out():
    times = Table([0.0, 1.0, 3.0], [0.0, 1.0, 0.5], kind="linear")
    rubbing = from_equations(lambda t, x, p: (x.v, times(t) - np.sign(x.v)), state=("q", "v"))
    assert emit(rubbing).texts.keys() == PARTS.keys()
