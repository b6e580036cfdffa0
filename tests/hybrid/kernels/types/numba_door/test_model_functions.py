"""Powers in functions that are compiled as they are keep the complex step."""

import numba
import numpy as np
import pytest

from hybrid.kernels.types.numba_door.model_functions import (
    MOST_FACTORS,
    compiler_for,
    power_by_products,
    readonly,
)

STEP = 1e-30


def compiled(function):
    return numba.njit(error_model="numpy", pipeline_class=compiler_for())(function)


@pytest.mark.parametrize("base", [3.0, -3.0])
@pytest.mark.parametrize("power", [0, 1, 2, 3, 5, 8, -1, -3])
def test_a_whole_power_by_products(base, power):
    found = power_by_products(complex(base, STEP), power)
    assert found.real == pytest.approx(base**power, rel=1e-15)
    assert found.imag / STEP == pytest.approx(power * base ** (power - 1), rel=1e-14)


@pytest.mark.parametrize("power", [0.5, -1.5, float(MOST_FACTORS + 1)])
def test_other_powers(power):
    assert power_by_products(1.1 + 0.2j, power) == pytest.approx((1.1 + 0.2j) ** power, rel=1e-13)


def square(z):
    return z**2


def cube(z):
    z **= 3
    return z


def by_a_float(z):
    return z**2.0


def inverse(z):
    return z**-1


@pytest.mark.parametrize(
    ("function", "slope"), [(square, -6.0), (cube, 27.0), (by_a_float, -6.0), (inverse, -1.0 / 9.0)]
)
def test_the_complex_step_of_a_power_is_its_derivative_at_negative_numbers_too(function, slope):
    found = compiled(function)(complex(-3.0, STEP))
    assert found.imag / STEP == pytest.approx(slope, rel=1e-14)


def test_other_powers_are_those_of_numba():
    assert compiled(square)(3) == 9
    assert compiled(square)(1.5) == 2.25
    assert compiled(lambda z: z**z)(1.1 + 0.2j) == pytest.approx((1.1 + 0.2j) ** (1.1 + 0.2j), rel=1e-14)


def test_an_array_that_is_read_only():
    @numba.njit
    def read(array):
        return readonly(array)[2]

    @numba.njit
    def write(array):
        readonly(array)[2] = 0.0

    assert read(np.arange(3.0)) == 2.0
    with pytest.raises(numba.TypingError, match="readonly array"):
        write(np.arange(3.0))
