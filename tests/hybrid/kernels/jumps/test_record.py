"""What is written into a record: jumps with and without a matrix, and a straight line in place of flights."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import record as module
from tests.hybrid.kernels.plain import plain


@pytest.fixture
def run():
    return SimpleNamespace(phase=0.25, cycle=7, mode=2, y=np.array([1.0, -2.0, 99.0]))


@pytest.fixture
def record():
    return SimpleNamespace(
        jumps=0,
        matrices=0,
        steps=0,
        jump_phase=np.zeros(2),
        step_phase=np.zeros(1),
        jump_cycle=np.zeros(2, dtype=int),
        jump_transition=np.zeros(2, dtype=int),
        jump_transversality=np.zeros(2),
        jump_kind=np.zeros(2, dtype=int),
        jump_has_matrix=np.zeros(2, dtype=int),
        jump_states=np.zeros((2, 2, 2)),
        jump_saltation=np.zeros((2, 2, 2)),
        step_coefficients=np.full((1, 4, 3), 5.0),
    )


WORK = SimpleNamespace(saltation=np.array([[1.0, 2.0], [3.0, 4.0]]))


def test_jumps(run, record):
    kernels = plain(module)
    kernels.remember_jump(run, record, 3, -0.5, 1, False, np.array([6.0, 7.0]), WORK)
    assert (record.jumps, record.matrices) == (1, 0)
    kernels.remember_jump(run, record, 4, 0.5, 2, True, np.array([8.0, 9.0]), WORK)
    assert (record.jumps, record.matrices) == (2, 1)
    assert record.jump_phase.tolist() == [0.25, 0.25]
    assert record.jump_cycle.tolist() == [7, 7]
    assert record.jump_transition.tolist() == [3, 4]
    assert record.jump_transversality.tolist() == [-0.5, 0.5]
    assert record.jump_kind.tolist() == [1, 2]
    assert record.jump_has_matrix.tolist() == [0, 1]
    assert record.jump_states.tolist() == [[[1.0, -2.0], [6.0, 7.0]], [[1.0, -2.0], [8.0, 9.0]]]
    # Matrices lie side by side, without gaps for jumps that have none.
    assert record.jump_saltation.tolist() == [[[1.0, 2.0], [3.0, 4.0]], [[0.0, 0.0], [0.0, 0.0]]]
    # A full record keeps no more.
    kernels.remember_jump(run, record, 5, 0.5, 2, True, np.array([8.0, 9.0]), WORK)
    assert (record.jumps, record.matrices) == (2, 1)
    assert record.jump_transition.tolist() == [3, 4]


def test_flights_that_are_skipped(run, record):
    started = []

    def start_record(run, record, phase, span):
        started.append((phase, span))
        record.steps += 1
        return record.steps - 1

    kernels = plain(module, start_record=start_record)
    for _ in range(2):
        kernels.remember_flight(run, record, 2, 0.125, np.array([1.5, 0.0]))
    # A straight line from state to limit, in the time ``span``; a full record keeps no more.
    assert started == [(0.25, 0.125)]
    assert record.step_coefficients[0].tolist() == [
        [1.0, -2.0, 0.0],
        [0.5, 2.0, 0.125],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ]
