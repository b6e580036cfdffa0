"""Whole numbers in functions that are compiled as they are: Python's arithmetic, no wrap-around."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numba.core import ir, types
from numba.core.compiler import run_frontend

from hybrid.compiler import whole_numbers


@pytest.mark.parametrize(
    ("a", "b", "found"), [(3, 4, 48), (-5, 2, -20), (1, 62, 2**62), (0, 62, 0), (3, 0, 3)]
)
def test_a_shift(a, b, found):
    assert whole_numbers.WHOLE["lshift"](a, b) == found


@pytest.mark.parametrize(("a", "b"), [(1, -1), (1, 63), (0, 70), (3, 62), (2**40, 30)])
def test_a_shift_out_of_range(a, b):
    with pytest.raises(OverflowError):
        whole_numbers.WHOLE["lshift"](a, b)


def test_a_complex_number_keeps_its_slope_in_a_power():
    """The complex step of a square is its derivative: 2 x."""
    numba = pytest.importorskip("numba")
    power = whole_numbers._checked("complex_pow", whole_numbers.WHOLE["pow"], lambda a, b: a**b)
    step = 1e-30
    found = numba.njit(lambda z: power(z, 2))(3.0 + step * 1j)
    assert found.imag / step == pytest.approx(6.0, rel=1e-14)
    assert numba.njit(lambda z: power(z, 3))(2) == 8


@pytest.mark.parametrize(
    ("name", "a", "b", "found"),
    [
        ("add", 7, -9, -2),
        ("sub", 7, -9, 16),
        ("mul", 7, -9, -63),
        ("pow", 2, -2, 0.25),
        ("truediv", 7, -2, -3.5),
        ("floordiv", 7, -2, -4),
        ("mod", 7, -2, -1),
        ("truediv", 7, 1, 7.0),
        ("floordiv", 7, 1, 7),
        ("mod", 7, 1, 0),
        ("add", 2**61, 2**61, 2**62),
        ("mul", 2**31, 2**31, 2**62),
    ],
)
def test_arithmetic_is_that_of_python(name, a, b, found):
    assert whole_numbers.WHOLE[name](a, b) == found


@pytest.mark.parametrize(
    ("name", "a", "b"),
    [("add", 2**63, 2**62), ("sub", -(2**63), 2**62), ("mul", 2**40, -(2**40)), ("mul", 2**62, 3)],
)
def test_a_result_that_does_not_fit(name, a, b):
    with pytest.raises(OverflowError):
        whole_numbers.WHOLE[name](a, b)


@pytest.mark.parametrize("name", ["truediv", "floordiv", "mod"])
def test_division_by_zero(name):
    with pytest.raises(ZeroDivisionError):
        whole_numbers.WHOLE[name](1, 0)


@pytest.mark.parametrize("power", [0, 1, 2, 3, 5, 8, -1, -3])
def test_a_whole_power_by_products(power):
    step = 1e-30
    found = whole_numbers._complex_power(complex(3.0, step), power)
    assert found.real == pytest.approx(3.0**power, rel=1e-15)
    assert found.imag / step == pytest.approx(power * 3.0 ** (power - 1), rel=1e-14)


@pytest.mark.parametrize("power", [0.5, -1.5, float(whole_numbers.MOST_FACTORS + 1)])
def test_other_powers(power):
    assert whole_numbers._complex_power(1.1 + 0.2j, power) == pytest.approx((1.1 + 0.2j) ** power, rel=1e-13)


@pytest.fixture
def implementations(monkeypatch):
    """What numba would compile, by the name of the function it is asked for."""
    found = {}

    def overload(stub):
        return lambda implementation: found.update({stub.__name__: implementation})

    monkeypatch.setattr(whole_numbers, "overload", overload)
    return found


def test_which_numbers_are_whole():
    whole, small, unsigned, real = types.int64, types.int32, types.uint64, types.float64
    assert whole_numbers._fits(whole, small)
    for a, b in ((unsigned, whole), (whole, unsigned), (real, whole), (whole, real)):
        assert not whole_numbers._fits(a, b)


def test_types_choose_the_arithmetic(implementations):
    """Whole numbers get the checked one, complex powers products, all others what Python has."""
    whole, other = object(), lambda a, b: (a, b, "other")
    for name in ("whole_pow", "whole_ipow"):
        stub = whole_numbers._checked(name, whole, other)
        assert stub(1, 2) == (1, 2, "other")
        chosen = implementations[name]
        assert chosen(types.int64, types.int64) is whole
        assert chosen(types.complex128, types.float64) is whole_numbers._complex_power
        assert chosen(types.complex128, types.int64) is whole_numbers._complex_power
        for a, b in ((types.complex128, types.complex128), (types.float64, types.int64)):
            assert chosen(a, b)(3, 4) == (3, 4, "other")
    whole_numbers._checked("whole_mul", whole, other)
    assert implementations["whole_mul"](types.complex128, types.float64)(3, 4) == (3, 4, "other")


@pytest.mark.parametrize("function", [int, math.floor, math.ceil, math.trunc])
def test_floats_become_whole_numbers_if_they_fit(implementations, function):
    stub = whole_numbers._rounding(function)
    [chosen] = implementations.values()
    of_float, of_whole = chosen(types.float64), chosen(types.int64)
    for value in (-2.5, 0.0, 2.5, 9e18, -9e18):
        assert stub(value) == of_float(value) == function(value)
    for value in (9.3e18, -9.3e18, math.inf, math.nan):
        with pytest.raises(OverflowError, match=r"a whole number beyond 2\*\*63"):
            of_float(value)
    assert of_whole(2**63) == 2**63


LARGE, SMALL = 7_000_000_000, 3


def arithmetic(t, x, p):
    total = x * LARGE + SMALL
    total -= math.floor(x) * 2
    total += math.sin(x) ** 2 + int(x)
    return -total if x > 8_000_000_000 else total


def changed(function):
    """The statements of a function behind the pass of the compiler, and whether each was replaced."""
    func_ir = run_frontend(function)
    found, made = [], []
    for label in sorted(func_ir.blocks):
        for statement in func_ir.blocks[label].body:
            if isinstance(statement, ir.Assign):
                was = str(statement.value)
                before = []
                if whole_numbers._replace(func_ir, statement, before):
                    found.append((was, statement.value))
                    made += before
                else:
                    assert str(statement.value) == was
                    assert before == []
    return found, made


def test_what_is_replaced_before_compilation():
    """Large numbers are floats, floor and int are checked, and so are sums, products and powers."""
    found, made = changed(arithmetic)
    numbers = [new.value for _, new in found if isinstance(new, ir.Const)]
    assert sorted(numbers) == [7e9, 8e9]
    assert all(type(each) is float for each in numbers)
    rounded = [new.value for _, new in found if isinstance(new, ir.Global)]
    assert rounded == [whole_numbers.ROUNDINGS[math.floor], whole_numbers.ROUNDINGS[int]]
    stubs = [each.value.value.__name__ for each in made]
    assert stubs == [
        *("whole_mul", "whole_add", "whole_mul", "whole_isub"),
        *("whole_pow", "whole_add", "whole_iadd"),
    ]
    calls = [new for _, new in found if isinstance(new, ir.Expr)]
    assert [each.op for each in calls] == ["call"] * len(made)
    assert [each.func for each in calls] == [each.target for each in made]
    # Every function has a name of its own.
    assert len({each.target.name for each in made}) == len(made)


def test_a_module_that_is_not_math_keeps_its_functions():
    def rounded(x):
        return np.floor(x) - np.ceil(x) if x > 2 else abs(x)

    assert [new.value.value.__name__ for new in changed(rounded)[1]] == ["whole_sub"]
    assert not [new for _, new in changed(rounded)[0] if isinstance(new, ir.Global)]


def test_the_pass_tells_whether_it_has_replaced_anything():
    def plain(x):
        return x > 2

    for function, replaced in ((arithmetic, True), (plain, False)):
        func_ir = run_frontend(function)
        sizes = [len(block.body) for block in func_ir.blocks.values()]
        state = SimpleNamespace(func_ir=func_ir)
        assert whole_numbers._CheckWholeNumbers().run_pass(state) is replaced
        added = sum(len(block.body) for block in func_ir.blocks.values()) - sum(sizes)
        assert added == (7 if replaced else 0)
        # The new names are known to the passes that follow.
        names = [name for name in func_ir._definitions if name.startswith("$whole.")]
        assert len(names) == added
