"""The Kaplan-Yorke dimension in cases that are done by hand."""

import math

import pytest

from hybrid import ArgumentError
from lyapunov import kaplan_yorke_dimension


@pytest.mark.parametrize(
    ("exponents", "dimension"),
    [
        ([math.log(2), -math.log(3)], 1 + math.log(2) / math.log(3)),
        ([-math.log(3), 0.0, math.log(2)], 2 + math.log(2) / math.log(3)),
        ([0.0, -1.0], 1.0),
        ([0.0, 0.0, -1.0], 2.0),
        ([-0.1, -0.2], 0.0),
        ([0.3, -0.1], 2.0),
        ([0.5, -math.inf], 1.0),
        ([0.5, -0.1, -math.inf], 2.0),
        ([0.5, -0.8, -math.inf], 1.625),
        ([-math.inf, -math.inf], 0.0),
        ([1.0], 1.0),
    ],
)
def test_by_hand(exponents, dimension):
    assert kaplan_yorke_dimension(exponents) == pytest.approx(dimension, rel=1e-15)


def test_what_is_no_exponent_is_told():
    with pytest.raises(ArgumentError, match=r"got exponents\[1\] = nan. Look at the status"):
        kaplan_yorke_dimension([0.1, math.nan])
