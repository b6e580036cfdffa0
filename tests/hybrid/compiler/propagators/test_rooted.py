"""Roots of guards that are smooth in time, and clocks of their own for those that are not."""

from fractions import Fraction

import pytest

from hybrid.compiler.propagators.desingularised import desingularised
from hybrid.compiler.propagators.equations import Boundary, equations_of
from hybrid.compiler.propagators.rooted import rooted
from hybrid.compiler.statements.code import equal, get
from hybrid.compiler.taylor.series import NoSeries
from hybrid.expression.nodes import HALF, number
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.types.codes import DESINGULARISED, FROM_LAST_STEP, ROOTED

SYMBOLS = model_symbols(2, 1)
(H, K), [A] = SYMBOLS.x, SYMBOLS.p
THIRD, QUARTER = (number(Fraction(1, n)) for n in (3, 4))
# A mode that goes on with the root of its last step asks this.
GOES_ON = str(equal(get("origin"), float(FROM_LAST_STEP)))


def mode_of(*field):
    """Both levels are guards at which the mode ends."""
    return equations_of(field, [Boundary(H, 1, is_affine=True), Boundary(K, 1, is_affine=True)], SYMBOLS)


@pytest.mark.parametrize(
    ("field", "order", "powers"),
    [
        ((-(H**HALF), -K), 2, "half-integer"),
        ((-(H**HALF), -A * K**HALF), 2, "half-integer"),
        ((-(H ** (2 * THIRD)), -K), 3, "fractional"),
        ((-(H**HALF), -(K ** (2 * THIRD))), 3, "fractional"),
        ((-(H ** (3 * QUARTER)), -(K**HALF)), 4, "fractional"),
    ],
)
def test_levels_of_tanks(field, order, powers):
    found = rooted(mode_of(*field))
    assert (found.kind, found.degree, found.root, found.guards) == (ROOTED, 0, order, (True, True))
    assert found.reason == f"{powers} powers of a guard, whose root is smooth"
    # Time itself is the clock, and each step takes the root from the state unless it is stored for it.
    assert GOES_ON not in str(found.series.statements)
    assert GOES_ON not in str(found.series.tangent_statements)


@pytest.mark.parametrize(
    ("field", "order", "powers", "clock"),
    [
        ((-1 + H ** (3 * HALF), -K), 2, "half-integer powers", "w"),
        ((-1 - H**QUARTER, -K), 4, "fractional powers", "w^3"),
        ((-1 - H**THIRD, -K), 3, "fractional powers", "w^2"),
    ],
)
def test_forces_of_contacts(field, order, powers, clock):
    mode = mode_of(*field)
    assert rooted(mode) == "no root of a guard in it is smooth in time"
    found = desingularised(mode)
    assert (found.kind, found.degree, found.root, found.guards) == (DESINGULARISED, 0, order, (True, True))
    assert found.reason == f"{powers} of a guard, on the clock dt = {clock} ds"
    assert GOES_ON in str(found.series.statements)
    assert GOES_ON in str(found.series.tangent_statements)


def test_what_has_no_clock():
    assert desingularised(mode_of(-H, -K)) == "it has no fractional power of a guard"
    two = mode_of(-1 - H**HALF, -1 - K**HALF)
    assert desingularised(two) == "it has fractional powers of more than one guard"
    # Where its rate vanishes with the guard, the root would fall exponentially on the clock.
    with pytest.raises(NoSeries, match="whose rate may vanish with the guard"):
        desingularised(mode_of(-(H**QUARTER), -K))
    assert desingularised(mode_of(A * H ** (3 * HALF), -K)).root == 2
