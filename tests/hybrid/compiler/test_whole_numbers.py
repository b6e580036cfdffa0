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
