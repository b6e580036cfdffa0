"""Signs of a guard between two events: a change in its direction is a missed event."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.testing import PropertyError
from hybrid.testing.crossings import _check_between, _check_doubled

TIMES = np.array([0.0, 1.0, 2.0, 3.0, 4.0])


def missed(values, direction):
    """The text about the change that no transition fired for; None if there is none."""

    def fail(_, text, hint):
        raise PropertyError(text)

    case = SimpleNamespace(evaluate=lambda function, t, x: x, fail=fail)
    guard = SimpleNamespace(function=None, direction=direction)
    transition = SimpleNamespace(guard=guard, name="mark", source="run")
    try:
        _check_between(case, transition, TIMES, np.array(values)[:, None])
    except PropertyError as error:
        return str(error).partition("sign between ")[2].partition(",")[0]
    return None


@pytest.mark.parametrize(
    ("values", "rising", "falling", "either"),
    [
        ([1.0, 2.0, 1.0, 3.0, 1.0], None, None, None),
        ([-1.0, -1.0, 2.0, 1.0, 1.0], (1, 2), None, (1, 2)),
        ([1.0, -1.0, -1.0, -1.0, 2.0], (3, 4), (0, 1), (0, 1)),
        ([-1.0, 1.0, 1.0, -1.0, -1.0], (0, 1), (2, 3), (0, 1)),
        # Values within rounding of zero are left out.
        ([1.0, 1e-9, -1e-9, 1e-9, 1.0], None, None, None),
        ([1.0, 1e-9, -1.0, -1.0, -1.0], None, (0, 2), (0, 2)),
    ],
)
def test_a_change_of_sign_counts_in_the_direction_of_the_guard(values, rising, falling, either):
    for direction, expected in ((1, rising), (-1, falling), (0, either)):
        told = None if expected is None else f"t = {expected[0]} and t = {expected[1]}"
        assert missed(values, direction) == told


@pytest.mark.parametrize(
    ("jumps", "doubled"),
    [
        ([], False),
        ([("hit", 1.0)], False),
        ([("hit", 1.0), ("hit", 1.0)], True),
        ([("hit", 1.0), ("slide", 1.0), ("hit", 1.0)], False),
        ([("slide", 0.5), ("hit", 1.0), ("hit", 1.0 + 0.9e-9)], True),
        ([("slide", 0.5), ("hit", 1.0), ("hit", 1.0 + 1.1e-9)], False),
    ],
)
def test_a_transition_fires_once_at_an_instant(jumps, doubled):
    """Within 1e-12 of the run, of 1000."""

    def fail(_, text, hint):
        raise PropertyError(text)

    made = [SimpleNamespace(transition=name, t=t) for name, t in jumps]
    run = SimpleNamespace(arc=SimpleNamespace(jumps=made))
    case = SimpleNamespace(run=run, duration=1000.0, fail=fail)
    if doubled:
        with pytest.raises(PropertyError, match="'hit' fired at t = 1 and again at"):
            _check_doubled(case)
    else:
        _check_doubled(case)
