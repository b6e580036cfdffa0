"""NumPy's functions on traced numbers: they give what NumPy gives, or are refused."""

import math
import warnings

import numpy as np
import pytest

from hybrid.symbolic.printer import assignments
from hybrid.symbolic.tracing import TraceError, trace
from hybrid.symbolic.values import _content

POINTS = [
    np.array([0.75, -0.5, 1.5, 0.25]),
    np.array([-0.75, 0.5, -1.5, 2.0]),
    np.zeros(4),
    np.array([1.0, 1.0, -1.0, 3.0]),
]
for point in POINTS:
    point.flags.writeable = False
# NumPy's functions give nan where those of ``math`` raise an error.
MATH = {name: getattr(np, name, function) for name, function in vars(math).items() if name[0] != "_"}
# Functions of files, of settings, of indices and of NumPy itself.
NOT_OF_NUMBERS = {
    *("fromfile", "fromregex", "genfromtxt", "getbufsize", "geterr", "geterrcall", "get_include", "info"),
    *("get_printoptions", "load", "loadtxt", "memmap", "save", "savetxt", "savez", "savez_compressed"),
    *("setbufsize", "seterr", "seterrcall", "set_printoptions", "show_config", "show_runtime", "test"),
    *("fromfunction", "frombuffer", "bmat", "asmatrix", "ix_"),
    # Of booleans alone these do what depends on how NumPy stores them.
    *("reciprocal", "trapezoid", "polyval"),
}


def functions():
    """Every function of NumPy and of its linear algebra, by name."""
    for module, prefix in ((np, ""), (np.linalg, "linalg.")):
        for name in dir(module):
            found = getattr(module, name)
            if (
                name[0] != "_"
                and name not in NOT_OF_NUMBERS
                and callable(found)
                and not isinstance(found, type)
            ):
                yield prefix + name, found


def flat(value):
    """Four numbers from any result."""
    parts = value if isinstance(value, tuple | list) else [value]
    numbers = [each for part in parts for each in np.ravel(part)]
    return (*numbers[:4], *[0.0] * (4 - len(numbers)))


CALLS = [
    lambda f, x: f(x),
    lambda f, x: f(x, x[::-1]),
    lambda f, x: f(x.reshape(2, 2)),
    lambda f, x: f(np.array([[2.0, 1.0], [1.0, 3.0]]), x[:2]),
    lambda f, x: f(x, 2),
    lambda f, x: f(x[0]),
    lambda f, x: f(x[0], x[1]),
    lambda f, x: f([x[0], x[1], 1.0]),
    lambda f, x: f((x, 2 * x)),
    lambda f, x: f(x > 0),
    lambda f, x: f([x[0] > 0, x[1] > 0]),
    lambda f, x: f(x > 0, x > 1),
    lambda f, x: f(x[0] > 0, x[1] > 0),
    lambda f, x: f(x > 0, x, 2 * x),
    lambda f, x: f(x, -1.0, 1.0),
]


def evaluate(expressions, x):
    """Values of traced expressions, from the code to be compiled; infinite where Python divides by 0."""
    out = np.zeros(len(expressions))
    lines = assignments([f"out[{i}]" for i in range(len(expressions))], expressions)
    try:
        with np.errstate(all="ignore"):
            exec("\n".join(lines), {"x": x, "out": out, "np": np, **MATH})
    except ZeroDivisionError:
        return np.full_like(out, np.inf)
    return out


def untraced(call, function):
    """The values at all points, or None if NumPy does not have them."""
    try:
        with np.errstate(all="ignore"):
            values = np.array([flat(call(function, x)) for x in POINTS])
    except Exception:
        return None
    return values.astype(float) if values.dtype.kind in "fiub" else None


@pytest.mark.parametrize("call", CALLS)
def test_every_function_of_numpy(call):
    """The traced function equals NumPy's at every point where NumPy has a number, or it is refused."""
    followed, wrong = 0, []
    for name, function in functions():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wanted = untraced(call, function)
            if wanted is None:
                continue
            try:
                expressions = trace(lambda t, x, p, f=function: flat(call(f, x)), 4, ())
            except TraceError:
                continue
            found = np.array([evaluate(expressions, x) for x in POINTS])
        followed += 1
        finite = np.isfinite(wanted) & ~np.isinf(found)
        if not np.allclose(found[finite], wanted[finite], rtol=1e-13, atol=1e-15):
            wrong.append(f"{name}: {found.tolist()} for {wanted.tolist()}")
    assert not wrong, "\n".join(wrong)
    assert followed > 5


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: (a > 0) + (b > 0),
        lambda a, b: (a > 0) + (b > 0) + 1.0,
        lambda a, b: 1 + (a > 0) + (b > 0),
        lambda a, b: sum([a > 0, b > 0]),
        lambda a, b: np.sum([a > 0, b > 0]) + np.mean([a > 0, b > 0]),
        lambda a, b: (a > 0) * (b > 0) - 1,
        lambda a, b: np.where((a > 0) ^ (b > 0), a, 2.0),
        lambda a, b: np.where(a > 0, b > 0, b > 1) + (a > 1),
        lambda a, b: True + (a > 0),
        lambda a, b: np.maximum(a > 0, b > 0) + (a > 0),
        lambda a, b: np.any([a, b][:1]) + (b > 0),
        lambda a, b: abs(a > 0) + (b > 0),
    ],
)
@pytest.mark.parametrize("x", [(2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (0.5, -1.0)])
def test_a_sum_of_booleans_is_a_boolean_and_the_sum_of_a_list_counts_them(function, x):
    try:
        expressions = trace(lambda t, x, p: (function(x[0], x[1]),), 2, ())
    except TraceError:
        return
    assert evaluate(expressions, np.array(x)) == float(function(*map(np.float64, x)))


@pytest.mark.parametrize(
    ("function", "advice"),
    [
        (lambda x: np.exp(x[0] > 0), r"NumPy computes in float16 np.exp of a boolean: write np.where"),
        (lambda x: -(x[0] > 0), r"NumPy does not compute np.negative of a boolean"),
        (lambda x: (x[0] > 0) & 2, r"join conditions: write \(x.q > 0\) & \(x.v > 0\)"),
        (lambda x: x[x > 0], r"write np.where\(x > 0, x, 0\) in place of x\[x > 0\]"),
        (lambda x: _added(np.zeros(4), x), r"use np.zeros_like\(x\) in place of np.zeros"),
        (lambda x: round(x[0]), r"use np.floor\(x \+ 0.5\)"),
        (lambda x: np.round(x), r"np.rint cannot be traced: write np.floor\(x \+ 0.5\)"),
        (lambda x: math.floor(x[0]), r"use np.floor\(x\)"),
        (lambda x: np.logaddexp(0.0, x[0]), r"write np.log\(np.exp\(a\) \+ np.exp\(b\)\)"),
    ],
)
def test_what_to_write_instead(function, advice):
    with pytest.raises(TraceError, match=advice):
        trace(lambda t, x, p: function(x), 4, ())


def _added(rate, x):
    rate += x
    return rate


def test_entries_that_a_condition_picks_may_be_set():
    def clipped(x):
        x = x.copy()
        x[x > 1] = 1.0
        x[x < -1] = x[0]
        return x

    expressions = trace(lambda t, x, p: clipped(x), 4, ())
    for x in POINTS:
        np.testing.assert_array_equal(evaluate(expressions, x), clipped(x))


@pytest.mark.parametrize("divisor", [0.1, 0.3, -0.7, 3.0, 1e-3, math.inf, -math.inf])
def test_whole_quotients_are_those_of_the_exact_numbers(divisor):
    """1.0 // 0.1 is 9: the float 0.1 is a little more than a tenth."""
    multiples = [
        n * unit for n in range(-20, 21) for unit in (1.0, divisor if math.isfinite(divisor) else 0.3)
    ]
    for function in (lambda x: x[0] // divisor, lambda x: x[0] // x[1], lambda x: divmod(x[0], divisor)[0]):
        expressions = trace(lambda t, x, p, f=function: (f(x),), 2, ())
        for a in multiples:
            x = np.array([a, divisor])
            assert evaluate(expressions, x) == function(x), (a, divisor)


@pytest.mark.parametrize("ufunc", [np.fmax, np.fmin])
def test_a_number_is_larger_and_smaller_than_nan(ufunc):
    expressions = trace(lambda t, x, p: (ufunc(x[0], x[1]), ufunc(x[0], 2.0), ufunc(2.0, x[1])), 2, ())
    for x in ((1.0, math.nan), (math.nan, 1.0), (3.0, 1.0), (math.nan, math.nan)):
        wanted = [ufunc(*x), ufunc(x[0], 2.0), ufunc(2.0, x[1])]
        np.testing.assert_array_equal(evaluate(expressions, np.array(x)), wanted)


def test_an_array_without_axes_is_its_number():
    def field(t, x, p):
        boxed = np.empty((), dtype=object)
        boxed[()] = x.q
        assert _content(boxed) == _content(x.q)
        assert _content(np.array(2.0)) == 2
        return (x.q,)

    trace(field, ("q",), ())


@pytest.mark.parametrize("shape", [(1,), (2,), (1, 1)])
def test_an_array_with_axes_is_no_number(shape):
    with pytest.raises(TraceError, match="is not a number"):
        trace(lambda t, x, p: (_content(np.zeros(shape)),), ("q",), ())
