"""Whether there is anything to tell of a run that has reached its end.

Nothing here needs the compiler: the function is a kernel for runs from many starts, and runs as Python for a
single run.
"""

from hybrid.kernels.types.codes import AFTER, HELD, RUNGE_KUTTA

# The rounding of the time may be worth so many tolerances in one step: it is measured between neighbouring
# numbers, which are a few times as far apart as the time is from the nearest.
MOST_LATENESS = 10.0


def is_plain(model, run, beyond):
    """Whether a run without tangent vectors that has reached its end has a status without notes.

    All that the status of such a run may tell is listed here, and only here: a note that is missing is told
    neither of a single run nor of many. ``beyond`` counts the guards that the start lies beyond. In doubt
    the answer is no.
    """
    steps = run.unresolved + run.coarse
    for transition in range(run.unproved.shape[0]):
        steps += run.unproved[transition]
    held = 0
    for i in range(model.dimension):
        if run.trail[HELD, i] != 0.0:
            held += 1
    for i in range(model.controlled, model.dimension):
        if run.y[i] % 1.0 != 0.0:
            return False
    for mode in range(model.bounded.shape[0]):
        waiting, begun = 0, 0
        for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
            each = model.clocks[slot]
            waiting += model.clock[each] == AFTER and run.fires[each] == 0
            own = model.target[each] == mode and model.enters[each] == 1
            begun += run.fires[each] if own else 0
        for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
            each = model.outgoing[slot]
            own = model.target[each] == mode and model.enters[each] == 1
            begun += run.fires[each] if own else 0
        # A clock that jumps from its mode to itself have begun anew has not fired.
        if waiting > 0 and begun > 0:
            return False
        if model.bounded[mode] == 0 and (mode == run.mode or run.stay[mode] > 0.0):
            return False
    may_run_dry = model.steep[run.mode] == 1 and model.propagator[run.mode] == RUNGE_KUTTA
    uncertain = run.unknown_time != 0.0 or run.lateness > MOST_LATENESS or may_run_dry
    return steps + run.order_mattered + run.turned + held + beyond == 0 and not uncertain


def carries_plainly(run):
    """Whether there is nothing to tell of the tangent vectors of a run that has reached its end.

    It may be that they have no meaning in the model.
    """
    met = run.singular_jumps + run.ill_conditioned + run.steep_jumps + run.field_jumps + run.indistinct
    return met == 0
