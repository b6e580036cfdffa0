"""Stroboscopic points in the compiled loop, as plain Python."""

from types import SimpleNamespace

import numpy as np

from hybrid.kernels.events import sections
from hybrid.kernels.types.codes import DONE, MAX_STEPS, UNLIMITED
from tests.hybrid.kernels.plain import plain

kernels = plain(sections)


def strobed(count, fails_in=None):
    """The points of a run in cycle 6 that jumps twice per cycle; it does not reach one of the cycles."""

    def advance(parts, task, cycle, phase, max_steps, max_jumps):
        assert (parts, phase, max_steps, max_jumps) == ("parts", 0.25, 100, UNLIMITED)
        if cycle == fails_in:
            return MAX_STEPS
        run = task.run
        run.cycle, run.mode, run.jumps = cycle, cycle % 3, run.jumps + 2
        run.y[:] = cycle, -cycle
        return DONE

    task = SimpleNamespace(
        model=SimpleNamespace(dimension=2), run=SimpleNamespace(y=np.zeros(2), cycle=6, mode=0, jumps=10)
    )
    states, places, reached = np.full((count, 2), 88.0), np.full((count, 3), 88), np.array([88])
    code = kernels.strobe(advance, "parts", task, 0.25, 100, states, places, reached)
    return code, reached[0], states.tolist(), places.tolist()


def test_one_point_in_each_of_the_next_cycles():
    points = [[7.0, -7.0], [8.0, -8.0], [9.0, -9.0]]
    assert strobed(3) == (DONE, 3, points, [[7, 1, 12], [8, 2, 14], [9, 0, 16]])
    assert strobed(0) == (DONE, 0, [], [])


def test_a_run_that_does_not_get_there_keeps_the_points_before():
    left = [88.0, 88.0]
    assert strobed(3, fails_in=9) == (
        *(MAX_STEPS, 2, [[7.0, -7.0], [8.0, -8.0], left]),
        [[7, 1, 12], [8, 2, 14], [88, 88, 88]],
    )
    assert strobed(2, fails_in=7) == (MAX_STEPS, 0, [left, left], [[88] * 3] * 2)
