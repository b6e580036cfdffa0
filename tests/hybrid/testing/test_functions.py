"""Compiled functions against Python's, and functions one period later."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode
from hybrid.testing import PropertyError, check_system


def forced(period, force=lambda t, x, p: np.cos(p.w * t)):
    return HybridSystem(
        state=("q", "v"),
        parameters={"w": 2.0},
        modes=[Mode("free", lambda t, x, p: (x.v, force(t, x, p) - x.q))],
        period=period,
    )


@pytest.mark.parametrize(("factor", "part"), [(2, 2), (3, 3), (6, 2)])
def test_a_part_of_the_period_is_a_period(factor, part):
    message = rf"every function has the period .*, too\n  likely: a factor {part} in period="
    with pytest.raises(PropertyError, match=message):
        check_system(forced(lambda p: factor * 2 * np.pi / p.w), examples=3)


def test_a_pulse_needs_its_whole_period():
    pulse = forced(1.0, lambda t, x, p: np.where(np.mod(t, 1.0) < 0.1, p.w, 0.0))
    check_system(pulse, examples=3)


def test_a_period_of_what_does_not_depend_on_time():
    with pytest.raises(PropertyError, match="a period is declared, and no function reads t"):
        check_system(forced(1.0, lambda t, x, p: p.w), examples=3)


def test_forcing_without_amplitude_is_no_fault():
    check_system(forced(lambda p: 4 * np.pi / p.w, lambda t, x, p: 0.0 * np.cos(p.w * t)), examples=3)
