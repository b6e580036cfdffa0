"""Jumps of a field inside its mode that error control has hidden from the tangent vectors.

Error control makes a step so short that a jump of the field on it moves the state by less than the
tolerances. No derivative at a point shows the jump, so the tangent vectors pass it as if there were none. The
same happens where a field is continuous, but steeper than the steps resolve. But the field itself differs
between the two ends of such a step, and by far more than its derivatives there explain.
"""

from numba import njit

from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.types.codes import EXACT
from hybrid.kernels.types.kinds import REAL
from hybrid.kernels.types.layout import EPSILON, Method, Model, Run, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# A jump changes a rate by more than this share of it; one of less changes tangent vectors by no more.
LEAST = 1e-6
# It is more than the rounding of a rate whose terms cancel, as that of what a contact holds: more than this
# share of the fastest rate, both in units of the tolerances.
CANCELLED = 1e-9
# A jump times the step is less than so many tolerances: methods see a jump by a thousandth of it, or more.
MOST_TOLERANCES = 1e3
# The step is halved so many times towards the largest change. At a jump most of the change is still there,
# and at some time it is so many times what the derivatives at both ends explain.
HALVINGS = 10
UNEXPLAINED = 30.0


@njit(**KERNEL)
def note_start(model, run, work):
    """Keep the state before a step in ``work.departure (n,)``."""
    for i in range(model.dimension):
        work.departure[i] = run.y[i]


@exported(None, Model, Method, Run, REAL, Work)
def look_back(model, method, run, span, work):
    """After a step of length ``span``, from the clock's time, count it if the field has jumped on it."""
    if model.propagator[run.mode] == EXACT:
        return
    # At one time: a jump at a time that no state moves does nothing to tangent vectors. The place of a jump
    # may move, so that the orbit meets it at the end only.
    jumps = _jumps_between(model, method, run, run.phase, span, work)
    if not jumps and model.timed[run.mode] == 1:
        jumps = _jumps_between(model, method, run, run.phase + span, span, work)
    if jumps:
        run.field_jumps += 1
        run.jumped_in = run.mode


@njit(**KERNEL)
def _jumps_between(model, method, run, t, span, work):
    """Whether the field at the time ``t`` jumps between the state before the step and the one after it."""
    model.field(run.mode, t, work.departure, model.parameters, work.field)
    model.field(run.mode, t, run.y, model.parameters, work.field_after)
    fastest = 0.0
    for i in range(model.dimension):
        rate = max(abs(work.field[i]), abs(work.field_after[i]))
        fastest = max(fastest, rate / _tolerance(method, run, i, work))
    for i in range(model.dimension):
        before, after = work.field[i], work.field_after[i]
        tolerance = _tolerance(method, run, i, work)
        least = max(LEAST * (abs(before) + abs(after)), CANCELLED * fastest * tolerance)
        some = abs(after - before) > least
        hidden = abs(after - before) * span < MOST_TOLERANCES * tolerance
        if some and hidden and _rate_jumps(model, run, t, i, before, after, work):
            return True
    return False


@njit(**INLINE)
def _tolerance(method, run, i, work):
    """The error that component ``i`` may have on the step."""
    return method.atol + method.rtol * max(abs(run.y[i]), abs(work.departure[i]))


@njit(**KERNEL)
def _rate_jumps(model, run, t, i, before, after, work):
    """Whether the rate of component ``i``, given at the two ends of the step, jumps between them."""
    low, high, middle = work.trial, work.new, work.error
    for j in range(model.dimension):
        low[j], high[j] = work.departure[j], run.y[j]
    most = 0.5 * abs(after - before)
    for _ in range(HALVINGS):
        for j in range(model.dimension):
            middle[j] = 0.5 * (low[j] + high[j])
        model.field(run.mode, t, middle, model.parameters, work.second_error)
        between = work.second_error[i]
        upper = abs(after - between) > abs(between - before)
        end = low if upper else high
        for j in range(model.dimension):
            end[j] = middle[j]
        before, after = (between, after) if upper else (before, between)
        if abs(after - before) < most:
            return False
        if abs(after - before) > UNEXPLAINED * _explained_change(model, run.mode, t, i, low, high, work):
            return True
    return False


@njit(**KERNEL)
def _explained_change(model, mode, t, i, low, high, work):
    """How much the rate of component ``i`` changes between two states, by its derivatives there."""
    moves, total = work.state, 0.0
    for j in range(model.dimension):
        moves[j] = abs(high[j] - low[j]) + EPSILON * max(abs(low[j]), abs(high[j]))
    for end in (low, high):
        model.field_jacobian(mode, t, end, model.parameters, work.jacobian)
        total += spread_of_rate(model, mode, i, work.jacobian, moves)
    return total
