"""What a run remembers of its last jumps: transitions, times, the states after them, the last impulse."""

from numba import njit

from hybrid.kernels.events.guards import ROUNDING_OF_STATE, guard_speed
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL


@njit(**INLINE)
def slot_of(run, jumps):
    """The slot for the visit after that many jumps, and for the transition of the next jump."""
    return jumps & (run.visits.shape[0] - 1)


@njit(**INLINE)
def visit_before(run, back):
    """The row of ``run.visits`` with the state right after the jump ``back`` before the last one."""
    return slot_of(run, run.jumps - back)


@njit(**INLINE)
def fired_before(run, back):
    """Transition of the jump ``back`` before the last one."""
    return run.recent[slot_of(run, run.jumps - 1 - back)]


@njit(**KERNEL)
def remember_visit(model, run):
    """Store the time and the state right after a jump."""
    row, n = run.visits[visit_before(run, 0)], model.dimension
    for i in range(n):
        row[i] = run.y[i]
    row[n], row[n + 1] = run.phase, run.cycle


@njit(**KERNEL)
def time_between(model, run, back, further):
    """Time from the jump ``further`` before the last one to the one ``back`` before it."""
    n = model.dimension
    later, earlier = run.visits[visit_before(run, back)], run.visits[visit_before(run, further)]
    return later[n] - earlier[n] + model.period * (later[n + 1] - earlier[n + 1])


@njit(**INLINE)
def impulse_of(model, run, transition, transversality, work, direction):
    """The restitution of the jump to ``work.new``; ``direction (n,)`` gets that per unit of guard's speed."""
    after = guard_speed(model, transition, run.phase, work.new, work.field_after, work.gradient)
    for i in range(model.dimension):
        change = work.new[i] - run.y[i]
        # A reset that puts the state back on the guard only removes the rounding error of the landing.
        rounding = abs(change) <= ROUNDING_OF_STATE * EPSILON * run.scale[i]
        direction[i] = 0.0 if rounding else change / (after - transversality)
    return -after / transversality


@njit(**INLINE)
def follows_impact(model, run):
    """Whether the last jump was within a mode and has turned back a part of the guard's speed."""
    fired = run.last_fired
    within = fired >= 0 and run.mode == run.previous_mode and model.marker[fired] == 0
    return within and 0.0 < run.restitution < 1.0
