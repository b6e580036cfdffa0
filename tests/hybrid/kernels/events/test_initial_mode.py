"""Which modes allow a start, rule by rule."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import initial_mode
from hybrid.kernels.types.codes import BEYOND, LEAVES, NO_OBJECTION, NO_TRANSITION
from tests.hybrid.kernels.plain import plain


def verdicts(*, fires=NO_TRANSITION, value=0.0, side=0, on=0, due=0, marker=0, paired=0, allowed=True):
    """What transition 0, which leaves the second mode in the direction 1, says of that mode."""
    tested = plain(initial_mode, guard_value=lambda *given: value, allowed=lambda *given: allowed).verdicts_on
    model = SimpleNamespace(
        dimension=2,
        first_outgoing=np.array([0, 0, 1, 1]),
        outgoing=np.array([0]),
        direction=np.array([1, 1]),
        marker=np.array([marker, 0]),
        paired=np.array([paired, 0]),
    )
    run = SimpleNamespace(
        phase=0.0,
        y=np.array([-3.0, 0.5]),
        scale=np.array([3.0, 0.5]),
        mode=0,
        side=np.array([side, 0]),
        on_guard=np.array([on, 0]),
        due=np.array([due, 0]),
    )
    found, modes = np.full(2, NO_OBJECTION), []

    def enter(model, run, work):
        modes.append(run.mode)
        # A mode may make components count as larger than they are.
        run.scale[:] = 1e9
        return fires

    answer = tested(SimpleNamespace(enter=enter), model, run, SimpleNamespace(scalar=None), 1, 2, found)
    assert modes == [1]
    assert run.scale.tolist() == [3.0, 0.5]
    assert found[1] == NO_OBJECTION
    return answer, found[0]


@pytest.mark.parametrize(
    ("given", "verdict"),
    [
        ({"side": -1}, NO_OBJECTION),
        ({"side": 1}, BEYOND),
        # On the guard it is not beyond; markers and guards in a pair do not object.
        ({"side": 1, "on": 1}, NO_OBJECTION),
        ({"side": 1, "marker": 1}, NO_OBJECTION),
        ({"side": 1, "paired": 1}, NO_OBJECTION),
        ({"side": 1, "allowed": False}, NO_OBJECTION),
        ({"due": 1}, LEAVES),
        ({"side": 1, "due": 1}, LEAVES),
        ({"due": 1, "marker": 1}, LEAVES),
        ({"due": 1, "allowed": False}, NO_OBJECTION),
        # A transition at the start leaves the mode.
        ({"fires": 0}, LEAVES),
        ({"fires": 0, "due": 1}, LEAVES),
    ],
)
def test_verdicts(given, verdict):
    assert verdicts(**given) == (NO_TRANSITION, verdict)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_guard_without_a_value_is_told(value):
    assert verdicts(value=value)[0] == 0
