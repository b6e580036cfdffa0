"""Whole numbers in functions that are compiled as they are: Python's arithmetic, no wrap-around."""

import pytest

from hybrid.compiler import whole_numbers


@pytest.mark.parametrize(("a", "b", "found"), [(3, 4, 48), (-5, 2, -20), (1, 62, 2**62), (0, 62, 0)])
def test_a_shift(a, b, found):
    assert whole_numbers.WHOLE["lshift"](a, b) == found


@pytest.mark.parametrize(("a", "b"), [(1, -1), (1, 63), (3, 62), (2**40, 30)])
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
