"""Where each of many runs starts, and whether there is something to tell of it, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import many
from hybrid.kernels.types.codes import (
    BEYOND,
    DESINGULARISED,
    EXACT,
    LEAVES,
    NO_MODE,
    NO_OBJECTION,
    NO_TRANSITION,
    ROOTED,
    RUNGE_KUTTA,
    TAYLOR,
)
from tests.hybrid.kernels.plain import plain


def start(
    given, *, named=NO_MODE, outgoing=((0, 2), (1,)), kinds=(RUNGE_KUTTA, RUNGE_KUTTA), undefined=False
):
    """The mode of a start for the verdicts given by transition; modes are left by these transitions."""
    asked = []

    def verdicts_on(parts, model, run, work, first, stop, verdicts):
        assert not np.any(verdicts)
        asked.append((first, stop))
        for mode in range(first, stop):
            for transition in outgoing[mode]:
                verdicts[transition] = given.get(transition, NO_OBJECTION)
        return 0 if undefined else NO_TRANSITION

    first_outgoing = np.cumsum([0, *map(len, outgoing)])
    model = SimpleNamespace(
        first_outgoing=first_outgoing,
        outgoing=np.array([each for some in outgoing for each in some]),
        propagator=np.array(kinds),
    )
    task = SimpleNamespace(model=model, run=None, work=None)
    # What an earlier run has left is forgotten.
    verdicts = np.full(first_outgoing[-1], BEYOND)
    found = plain(many, verdicts_on=verdicts_on).mode_of_start(None, task, named, verdicts)
    assert asked == [(0, len(outgoing)) if named == NO_MODE else (named, named + 1)]
    return found


@pytest.mark.parametrize(
    ("given", "mode"),
    [
        # Both modes allow it, one does, none does.
        ({}, NO_MODE),
        ({0: BEYOND}, 1),
        ({2: LEAVES}, 1),
        ({1: BEYOND}, 0),
        ({1: LEAVES}, 0),
        ({0: BEYOND, 1: BEYOND}, NO_MODE),
    ],
)
def test_the_only_mode_that_allows_the_state(given, mode):
    assert start(given) == mode
    assert start(given, undefined=True) == NO_MODE


def test_a_single_mode_may_be_left_at_once_but_not_started_beyond_a_guard():
    alone = ((0, 1),)
    assert start({}, outgoing=alone) == 0
    assert start({1: LEAVES}, outgoing=alone) == 0
    assert start({1: BEYOND}, outgoing=alone) == NO_MODE


@pytest.mark.parametrize("kind", [RUNGE_KUTTA, TAYLOR, EXACT, DESINGULARISED, ROOTED])
def test_a_mode_that_is_named(kind):
    """It may start beyond its guards, except where its series hold their roots."""
    for named, beyond in ((0, 0), (0, 2), (1, 1)):
        kinds = [RUNGE_KUTTA, RUNGE_KUTTA]
        kinds[named] = kind
        assert start({}, named=named, kinds=kinds) == named
        assert start({beyond: LEAVES}, named=named, kinds=kinds) == named
        expected = NO_MODE if kind in (DESINGULARISED, ROOTED) else named
        assert start({beyond: BEYOND}, named=named, kinds=kinds) == expected
        assert start({}, named=named, kinds=kinds, undefined=True) == NO_MODE


@pytest.mark.parametrize("note", ["unproved", "unresolved", "coarse", "order_mattered", None])
def test_what_there_is_to_tell(note):
    run = SimpleNamespace(**dict.fromkeys(("unproved", "unresolved", "coarse", "order_mattered"), 0))
    if note:
        setattr(run, note, 1)
    kernels = plain(many)
    assert bool(kernels.is_plain(run, np.array([NO_OBJECTION, LEAVES]))) is (note is None)
    assert not kernels.is_plain(run, np.array([BEYOND, LEAVES]))
