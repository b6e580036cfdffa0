"""What an arc holds is made when somebody asks, from copies that no later run changes."""

import copy
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import attrs
import numpy as np
import pytest

import hybrid
import models
from hybrid import DOP853, simulate

# Where functions of the library come from, those included that attrs writes.
OURS = (hybrid.__path__[0], "<attrs generated")
SYSTEM = models.vibroimpact()
PERIOD = SYSTEM.forcing_period()
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
OTHER = (-0.002, 0.003, 0.01, 0.0)

# What a call may ask for: steps, the end alone, samples on the way with jumps, tangent vectors, few jumps.
CALLS = {
    "steps": {},
    "end": {"samples": [PERIOD]},
    "samples": {"samples": [0.2 * PERIOD, 0.7 * PERIOD, PERIOD], "keep_jumps": True},
    "tangents": {"tangent": True},
    "other parameters": {"parameters": {"omega": 7.46}},
    "few jumps": {"max_jumps": 1},
    "few steps": {"solver": DOP853(max_steps=3)},
}


def run(start=START, **options):
    return simulate(SYSTEM, start, (0.0, PERIOD), mode="free", **options)


def held(arc):
    """All that an arc holds, as one number or text after another."""
    rows = [arc.t, arc.j, arc.x, arc._mode_index, arc.fundamental]
    found = [None if row is None else row.tolist() for row in rows]
    found += [list(arc.mode), dict(arc.parameters), arc.status, arc.jump_count, arc.steps, arc.rejected]
    found += [repr(arc), arc._repr_html_(), arc.propagators, arc.grazings, arc.keeps_jumps]
    if arc.keeps_jumps:
        jumps = arc.jumps
        columns = jumps.t, jumps.x_minus, jumps.x_plus, jumps.transversality, jumps.saltation
        found += [column.tolist() for column in columns]
        found += [list(jumps.transition), list(jumps.kind)]
    if arc._pieces is not None:
        found.append(arc(np.linspace(arc.t[0], arc.t[-1], 20)).tolist())
    return found


@pytest.mark.parametrize("options", CALLS.values(), ids=CALLS)
def test_no_later_run_changes_a_result(options):
    wanted = held(run(**options))
    arc = run(**options)
    for each in CALLS.values():
        run(OTHER, **each)
        run(OTHER, **{**each, "parameters": {"omega": 7.0}})
    assert held(arc) == wanted


@pytest.mark.parametrize("options", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda arc: pickle.loads(pickle.dumps(arc))])
def test_a_copy_is_the_same_whether_looked_at_before_or_not(options, again):
    fresh, seen = run(**options), run(**options)
    wanted = held(seen)
    assert held(again(fresh)) == wanted
    assert held(again(seen)) == wanted
    assert held(fresh) == wanted


def test_a_field_can_be_replaced():
    arc = run(samples=[PERIOD])
    moved = attrs.evolve(arc, x=arc.x + 1.0)
    np.testing.assert_array_equal(moved.x, arc.x + 1.0)
    assert moved.status == arc.status
    assert moved.t is arc.t
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        arc.x = moved.x
    with pytest.raises(AttributeError, match="no attribute 'y'"):
        _ = arc.y


def test_a_note_is_told_whenever_it_is_asked_for():
    """The start lies beyond the guard that it moves away from; a run in between starts elsewhere."""
    ball = models.bouncing_ball()
    early, late = (simulate(ball, (-0.1, 1.0), (0.0, 0.05), mode="flight") for _ in range(2))
    told = early.status
    simulate(ball, (1.0, 0.0), (0.0, 1.0))
    assert late.status == told
    assert late.status.code == hybrid.StatusCode.START_BEYOND
    assert late.status is late.status


def test_threads_that_ask_one_arc_get_one_answer():
    for options in CALLS.values():
        arc, wanted = run(**options), held(run(**options))
        with ThreadPoolExecutor(4) as pool:
            assert all(each == wanted for each in pool.map(lambda _, arc=arc: held(arc), range(8)))


def test_threads_that_run_one_system_do_not_share_memory():
    starts = [tuple((1.0 + 0.01 * i) * value for value in START) for i in range(8)]
    wanted = [held(run(start)) for start in starts]
    with ThreadPoolExecutor(4) as pool:
        arcs = list(pool.map(run, starts * 25))
    assert [held(arc) for arc in arcs] == wanted * 25


@pytest.mark.parametrize(("options", "most"), [({"samples": [PERIOD]}, 95), ({}, 100)])
def test_a_short_run_costs_few_calls_of_python(options, most, request):
    """The kernel takes 4 us for this run, as long as 30 calls of Python functions."""
    if request.config.getoption("nudge") or request.config.getoption("nudge_back"):
        pytest.skip("numbers are moved by calls of Python, too")

    def calls() -> int:
        count = 0

        def called(frame, event, argument):
            nonlocal count
            count += event == "call" and frame.f_code.co_filename.startswith(OURS)

        before = sys.getprofile()
        sys.setprofile(called)
        try:
            run(**options)
        finally:
            sys.setprofile(before)
        return count

    # A collection of garbage within a run may call finalizers of what other tests left.
    assert min(calls() for _ in range(4)) <= most
