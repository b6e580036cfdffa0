"""Every function of expressions, with all its rules: values, slopes, signs, ranges, code and series."""

import math

import numpy as np
import pytest
from numba import njit

from hybrid import HybridSystem, Mode
from hybrid.compiler.bounds.program import programs
from hybrid.compiler.emit import emit
from hybrid.compiler.llvm.wanted import VECTOR_SIGNATURE
from hybrid.compiler.parts import PARTS, SERIES
from hybrid.compiler.statements.code import at
from hybrid.compiler.statements.values import assignments, unprintable
from hybrid.expression import operations as ops
from hybrid.expression.derivatives import derivative
from hybrid.expression.evaluation import Program, expressed
from hybrid.expression.nodes import HALF, ONE, Function, number
from hybrid.expression.ranges import range_of
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.events import bounds
from hybrid.kernels.types import layout
from hybrid.kernels.types.codes import HIGH, LEAST_SLOPE, LOW, MOST_SLOPE, REGISTERS
from tests.hybrid.code import both, functions_in

ANY, POSITIVE, UNIT = (-2.7, 2.9), (0.2, 3.0), (-0.999, 0.998)
# Analytic functions, and where their arguments are.
ANALYTIC = {
    **dict.fromkeys((ops.Exp, ops.Expm1, ops.Exp2, ops.Sin, ops.Cos, ops.Sinh, ops.Cosh, ops.Tanh), (ANY,)),
    **dict.fromkeys((ops.Arctan, ops.Arcsinh, ops.Erf, ops.Erfc), (ANY,)),
    **dict.fromkeys((ops.Log, ops.Log2, ops.Log10), (POSITIVE,)),
    **dict.fromkeys((ops.Arcsin, ops.Arccos, ops.Arctanh, ops.Log1p, ops.Tan), (UNIT,)),
    ops.Arccosh: ((1.1, 3.0),),
    ops.Hypot: (POSITIVE, ANY),
}
# Functions with kinks or jumps, which have no series.
ROUNDING = (ops.Floor, ops.Level, ops.Ceiling, ops.Truncate, ops.Round)
OF_ONE = (*ROUNDING, ops.Sign, ops.Step, ops.Absolute, ops.Not)
OTHERS = {
    **dict.fromkeys((*OF_ONE, ops.CubeRoot), (ANY,)),
    **dict.fromkeys((ops.Less, ops.LessEqual, ops.Equal, ops.And, ops.Or, ops.Atan2), (ANY, ANY)),
    **dict.fromkeys((ops.Maximum, ops.Minimum, ops.LargerNumber, ops.SmallerNumber), (ANY, ANY)),
    **dict.fromkeys((ops.WholeQuotient, ops.Remainder, ops.TruncatedRemainder), (ANY, POSITIVE)),
    ops.Select: (ANY, ANY, ANY),
    ops.Gate: (ANY, ANY),
}
DOMAINS = {**ANALYTIC, **OTHERS}
KINDS = [*DOMAINS]
# Classes that stand for several functions, or for none.
BASES = {ops.RealFunction, ops.OfNumber, ops.PiecewiseConstant, ops.Truth, ops.Extreme, ops.Several}
_bound = bounds.bound_guard
SYMBOLS = model_symbols(3, 0)
PLACES, STEP, ORDER = 40, 1e-6, 6

every = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
analytic = pytest.mark.parametrize("kind", ANALYTIC, ids=lambda kind: kind.__name__)


@njit
def row_of(program, path, radius, registers):
    return _bound(program, 0, path, 0.5, radius, registers)


def of(kind):
    """The function of as many symbols as it has arguments."""
    return kind(*SYMBOLS.x[: len(DOMAINS[kind])])


def places(kind, count=PLACES):
    """Random arguments of a function, one row each."""
    rng = np.random.default_rng(20261127)
    return np.column_stack([rng.uniform(*domain, count) for domain in DOMAINS[kind]])


def value(expressions, x):
    return Program(expressions).run(dict(zip(SYMBOLS.x, x, strict=False)))


def test_every_function_has_a_place_in_this_test():
    found = [each for each in vars(ops).values() if isinstance(each, type) and issubclass(each, Function)]
    assert set(found) - BASES - {Function} == set(KINDS)


@every
def test_numbers_are_computed(kind):
    """Also at ties and at zeros, where NumPy has a number."""
    if kind is ops.Gate:
        return
    ties = [np.full(len(DOMAINS[kind]), each) for each in (0.0, 1.0, -1.0)]
    with np.errstate(all="ignore"):
        for x in [*places(kind), *ties]:
            wanted = float(kind.numpy(*x))
            if math.isfinite(wanted):
                assert kind(*map(number, x)).value == pytest.approx(wanted, rel=1e-15, abs=1e-15)


@every
def test_slopes(kind):
    """By a complex step of analytic functions, and by central differences of the others."""
    for i in range(len(DOMAINS[kind])):
        if kind is ops.Gate and i == 0:
            continue
        slope = derivative(of(kind), SYMBOLS.x[i]) if kind is not ops.Gate else ops.Step(SYMBOLS.x[0])
        for x in places(kind):
            move = STEP * np.eye(len(x))[i]
            if kind in ANALYTIC and kind is not ops.Hypot:
                wanted = kind.numpy(*(x + 1e-100j * (move > 0.0))).imag / 1e-100
            else:
                wanted = float(kind.numpy(*(x + move)) - 1.0 * kind.numpy(*(x - move))) / (2.0 * STEP)
            assert value([slope], x)[0] == pytest.approx(wanted, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("kind", [ops.Maximum, ops.Minimum, ops.Absolute])
def test_slopes_at_a_kink_are_the_mean_of_both_sides(kind):
    slopes = [derivative(of(kind), x) for x in SYMBOLS.x[: len(DOMAINS[kind])]]
    assert value(slopes, (0.0, 0.0)) == ([0.0] if kind is ops.Absolute else [0.5, 0.5])


@every
def test_a_sign_comes_out_of_a_function_that_is_even_or_odd(kind):
    """A function with a parity takes no sign in, and has the value of the function that would."""
    if not getattr(kind, "parity", 0):
        return
    x, y, _ = SYMBOLS.x
    assert kind(-x) is kind.parity * kind(x)
    assert kind(x - y) is kind.parity * kind(y - x)
    for place in places(kind):
        if np.all(np.abs(place) < 0.9):
            assert value([kind(-x)], place)[0] == pytest.approx(kind.numpy(-place[0]), rel=1e-15)


@every
def test_ranges_hold_the_values(kind):
    """Of symbols, and of arguments in different parts of their domain."""
    narrow = kind(
        *(
            number((low + high) / 2 + i / 4) + HALF * ops.Sin(SYMBOLS.x[i])
            for i, (low, high) in enumerate(DOMAINS[kind])
        )
    )
    for expression in (of(kind), narrow):
        found = range_of(expression)
        for place in [*places(kind), *np.transpose(DOMAINS[kind])]:
            [there] = value([expression], place)
            assert found.low.value <= there <= found.high.value
            assert not (found.positive and there <= 0.0)
            assert not (found.negative and there >= 0.0)


@every
def test_interval_programs_hold_values_and_slopes(kind):
    """Along a line through the domain, in pieces that are short beside it."""
    expression, n = of(kind), len(DOMAINS[kind])
    written = programs([expression], [], [], SYMBOLS)
    if kind is ops.Gate:
        assert not written.rows
        return
    arrays = {name: np.array(getattr(written, name)) for name in ("rows", "checked", "numbers", "first")}
    program = layout.Programs(parameters=np.zeros(0), **arrays)
    registers = np.full((len(written.rows), REGISTERS), np.nan)
    for a, b in zip(places(kind)[::2], places(kind)[1::2], strict=True):
        for radius in (0.0, 1e-3, 0.25):
            path = layout.Path(np.array([a, b - a]), 1, -1, 0.0, 1.0, 0.5 + radius, True, 1)
            row = registers[row_of(program, path, radius, registers)]
            along = 0.5 + np.linspace(-radius, radius, 31)
            values = np.array([float(kind.numpy(*x)) for x in a + np.outer(along, b - a)])
            assert row[LOW] - 1e-14 <= values.min() <= values.max() <= row[HIGH] + 1e-14
            if radius:
                slopes = np.diff(values) / np.diff(along)
                assert row[LEAST_SLOPE] - 1e-9 <= slopes.min() <= slopes.max() <= row[MOST_SLOPE] + 1e-9
            elif kind in ANALYTIC:
                slope = sum(
                    value([derivative(expression, SYMBOLS.x[i])], (a + b) / 2)[0] * (b - a)[i]
                    for i in range(n)
                )
                assert row[[LOW, HIGH]] == pytest.approx([values[0]] * 2, rel=1e-13, abs=1e-13)
                assert row[[LEAST_SLOPE, MOST_SLOPE]] == pytest.approx([slope] * 2, rel=1e-12, abs=1e-12)


@pytest.fixture(scope="module")
def compiled():
    """All functions by the interpreter and as machine code, by their place in the list."""
    return both(*(assignments([at("out", 0)], [of(kind)]) for kind in KINDS), kind=VECTOR_SIGNATURE)


@every
def test_code_has_the_values_of_numpy(kind, compiled):
    """By the interpreter and as machine code; at zeros, ties, infinities and nan, too."""
    n = len(DOMAINS[kind])
    edges = np.array(np.meshgrid(*[[0.0, 1.0, -2.0, np.inf, -np.inf, np.nan]] * n)).reshape(n, -1).T
    out = np.empty(1)
    for function in compiled:
        for x in [*places(kind), *edges]:
            with np.errstate(all="ignore"):
                wanted = float(kind.numpy(*x))
            function(KINDS.index(kind), 0.0, np.array(x), np.zeros(0), out)
            assert math.isinf(wanted) or out[0] == pytest.approx(wanted, rel=1e-14, abs=1e-14, nan_ok=True)
    assert unprintable([of(kind)]) is None


@pytest.fixture(scope="module")
def series():
    """Coefficients of all analytic functions along a line, from the code that a run would compile."""
    fields = [ops.Exp(SYMBOLS.t) * 0 + each for each in map(along_the_line, ANALYTIC)]
    system = HybridSystem(
        state=("a", "b", "c", *(kind.__name__ for kind in ANALYTIC)),
        modes=[Mode("run", expressed([ONE, HALF, ONE, *fields]))],
    )
    out = np.full((ORDER + 3, 400), np.nan)
    functions_in(emit(system).texts[SERIES])[PARTS[SERIES][0]](
        0, 0.0, np.zeros(system.dimension), np.zeros(0), ORDER, out
    )
    return dict(zip(ANALYTIC, out[: ORDER + 1, 3 : system.dimension].T, strict=True))


def along_the_line(kind):
    """The function of states that start at 0 and grow at the rates 1 and 1/2."""
    x = SYMBOLS.x[: len(DOMAINS[kind])]
    return kind(*(each + number(sum(d) / 2 + 0.125) for d, each in zip(DOMAINS[kind], x, strict=True)))


@analytic
def test_series(kind, series):
    """The state integrates the function, whose derivatives along the line are those of the expression."""
    rate, wanted = along_the_line(kind), [0.0]
    for order in range(1, ORDER + 1):
        wanted.append(value([rate], (0.0, 0.0))[0] / math.factorial(order))
        rate = derivative(rate, SYMBOLS.x[0]) + HALF * derivative(rate, SYMBOLS.x[1])
    assert series[kind] == pytest.approx(wanted, rel=1e-11, abs=1e-13)


def test_connectives_decide_as_far_as_numbers_do():
    x, y, _ = SYMBOLS.x
    truth = ops.Less(x, y)
    assert ops.And(0, x) is ops.And(x, 0) is ops.Or(0, 0) is number(0)
    assert ops.And(2, truth) is ops.And(truth, 1) is ops.Or(0, truth) is ops.Or(truth, 0) is truth
    assert ops.Or(2, x) is ops.Or(x, 1) is ONE
    # What is not 0 or 1 is made so.
    assert isinstance(ops.And(1, x), ops.And)
    assert isinstance(ops.Or(0, x), ops.Or)
    assert ops.Select(truth, x, x) is ops.Select(2, x, y) is ops.Select(0, y, x) is x
