"""The members of a task as local names."""

from numba import njit

from hybrid.kernels.types.options import INLINE


@njit(**INLINE)
def task_of(task):
    """``attempts, model, method, run, record, work`` of a task."""
    return task.attempts, task.model, task.method, task.run, task.record, task.work
