"""Signs of a guard a moment before and after a jump or a flat root, where its derivatives tell nothing."""

from numba import njit

from hybrid.kernels.events.derivatives import moment_of_rounding
from hybrid.kernels.events.guards import guard_value
from hybrid.kernels.types.options import INLINE, KERNEL

# Each moment is so many times as long as the last, from the rounding of time on.
LONGER = 16.0
MOST_MOMENTS = 8
LONGEST = LONGER**MOST_MOMENTS
# So many of them if the guard is not zero: a landing may miss a jump by a few times rounding.
FEW_MOMENTS = 3


@njit(**INLINE)
def leaves_by_signs(model, transition):
    """Whether signs beside a guard may tell to which side the flow leaves it after a jump of its own."""
    bent = model.affine_guard[transition] == 0 and model.guard_in_series[transition] == 0
    return bent and model.marker[transition] == 0


@njit(**KERNEL)
def sign_at(model, transition, t, x, moment, work):
    """Sign of a guard a moment after ``t``, or before; ``work.field`` is current."""
    for i in range(model.dimension):
        work.state[i] = x[i] + moment * work.field[i]
    value = guard_value(model, transition, t + moment, work.state, work.scalar)
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@njit(**KERNEL)
def signs_beside(model, run, transition, t, x, moments, work):
    """Signs of a guard a moment before and after ``t``, and that moment, if the signs differ; else zeros.

    At most so many ``moments`` are tried. The sign at ``x`` itself may be either, by rounding.
    ``work.field`` is current.
    """
    moment = moment_of_rounding(model, run, t, work)
    for _ in range(moments):
        moment *= LONGER
        before = sign_at(model, transition, t, x, -moment, work)
        after = sign_at(model, transition, t, x, moment, work)
        if before * after < 0:
            return before, after, moment
    return 0, 0, 0.0


@njit(**KERNEL)
def turns_within(model, transition, mode, t, x, moment, after, work):
    """Whether the flow is back across a guard after a moment, although its rates lead to ``after``.

    ``work.field`` is current. Overwrites ``work.settled`` and ``work.field_after``.
    """
    n, later = model.dimension, work.settled
    for i in range(n):
        later[i] = x[i] + moment * work.field[i]
    model.field(mode, t + moment, later, model.parameters, work.field_after)
    for i in range(n):
        later[i] = x[i] + 0.5 * moment * (work.field[i] + work.field_after[i])
    return guard_value(model, transition, t + moment, later, work.scalar) * after < 0.0
