"""Chatter of several transitions in turn: the limit of their jumps, from the series of their times.

Transitions that fire in the same order again and again, each round shorter than the last by the same ratio
``r``, accumulate. The states and times right after the jumps of one transition are then smooth functions of
the time that is left, and both are extrapolated to where none is left.
"""

from numba import njit

from hybrid.kernels.events.guards import guard_value, may_jump, rounding_band
from hybrid.kernels.types.codes import ENDLESS, NO_MODE, NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Largest number of transitions in a round, and number of rounds that must have occurred.
MOST_IN_TURN = 8
FEWEST_ROUNDS = 5
# No limit is taken before this many jumps.
FEWEST_JUMPS = 16
# Largest change of the ratio from round to round, as a share of the distance of the ratio from 1.
STEADY = 0.1
# A time is shorter only if at most this share is left. Ratios closer to 1 cannot be told from 1.
SHORTER = 0.999
# A round this many times as long as the rounding of time has no length that could be compared.
ROUNDING_OF_TIME = 64.0
# Share of the time since the chatter began that is too short to change the limit.
NOTHING_LEFT = 1e-7
# A component is moved for ever if the next round moves it by at least this share of what this one does.
LASTING = 1.0 - 1e-6
# Share of the change over the last round that moves a component at the limit, too.
MOVES_ON = 0.1
# Largest distance of guards from zero, and of resets from the identity, at a limit, in sizes of the state.
ROUGH = 1e-6


@njit(**INLINE)
def slot_of(run, jumps):
    """The slot for the visit after that many jumps, and for the transition of the next jump."""
    return jumps & (run.visits.shape[0] - 1)


@njit(**KERNEL)
def remember_visit(model, run):
    """Store the time and the state right after a jump."""
    row, n = run.visits[slot_of(run, run.jumps)], model.dimension
    for i in range(n):
        row[i] = run.y[i]
    row[n], row[n + 1] = run.phase, run.cycle


@njit(**KERNEL)
def time_before(model, run, back, further):
    """Time from the jump ``further`` before the last one to the one ``back`` before it."""
    n, jumps = model.dimension, run.jumps
    later, earlier = run.visits[slot_of(run, jumps - back)], run.visits[slot_of(run, jumps - further)]
    return later[n] - earlier[n] + model.period * (later[n + 1] - earlier[n + 1])


@njit(**KERNEL)
def fired_before(run, back):
    """Transition of the jump ``back`` before the last one."""
    return run.recent[slot_of(run, run.jumps - 1 - back)]


@njit(**KERNEL)
def time_left_of_rounds(model, run, turn, back):
    """Time that infinitely many more rounds take after the jump ``back`` before the last one, and the ratio.

    The rounds are a geometric series up to a term of second order, which the series that began a round
    before tells. Zero if the rounds do not shorten by a steady ratio. Rounds shorter than the rounding of
    time are passed over: those before them tell the ratio.
    """
    most, drowned = run.visits.shape[0] - 1, 0
    shortest = ROUNDING_OF_TIME * EPSILON * abs(run.phase)
    while back + 4 * turn <= min(most, run.jumps) and time_before(model, run, back, back + turn) <= shortest:
        back, drowned = back + turn, drowned + 1
    d0 = time_before(model, run, back, back + turn)
    d1 = time_before(model, run, back + turn, back + 2 * turn)
    d2 = time_before(model, run, back + 2 * turn, back + 3 * turn)
    if not (0.0 < d0 < d1 < d2):
        return 0.0, 1.0
    ratio, before = d0 / d1, d1 / d2
    if abs(ratio - before) > STEADY * (1.0 - ratio):
        return 0.0, 1.0
    left = d0 * ratio / (1.0 - ratio)
    expected = d1 * before / (1.0 - before) - d0
    left += (left - expected) * ratio * ratio / (1.0 - ratio * ratio)
    return left * ratio**drowned, ratio


@njit(**KERNEL)
def shortens(model, run):
    """Whether the last jumps took less time than as many before them."""
    if run.jumps <= FEWEST_JUMPS:
        return False
    half = FEWEST_JUMPS // 2
    recent, earlier = time_before(model, run, 0, half), time_before(model, run, half, FEWEST_JUMPS)
    return recent < SHORTER * earlier or recent == 0.0


@njit(**KERNEL)
def transitions_in_turn(model, run):
    """The number of transitions that fire in turn, in the same order in each round; 0 if there are none.

    One that brings the state back onto its guard, with a steady ratio, is followed by its own impacts.
    """
    for turn in range(1, MOST_IN_TURN + 1):
        seen = max(FEWEST_JUMPS, FEWEST_ROUNDS * turn)
        if run.jumps <= seen:
            return 0
        left, _ = time_left_of_rounds(model, run, turn, 0)
        same = left > 0.0
        for back in range(seen - turn):
            same = same and fired_before(run, back) == fired_before(run, back + turn)
            if not same:
                break
        if same:
            return 0 if turn == 1 and run.chattering > 0 else turn
    return 0


@njit(**KERNEL)
def extrapolate(model, run, turn, back, left, out):
    """The state at the limit into ``out (n,)``, from three jumps of one transition, ``back`` the last."""
    jumps, visits = run.jumps, run.visits
    a = left
    b = a + time_before(model, run, back, back + turn)
    c = b + time_before(model, run, back + turn, back + 2 * turn)
    first = b * c / ((b - a) * (c - a))
    second = a * c / ((a - b) * (c - b))
    third = a * b / ((a - c) * (b - c))
    for i in range(model.dimension):
        out[i] = (
            first * visits[slot_of(run, jumps - back), i]
            + second * visits[slot_of(run, jumps - back - turn), i]
            + third * visits[slot_of(run, jumps - back - 2 * turn), i]
        )


@njit(**KERNEL)
def extrapolate_by_rounds(model, run, turn, back, out):
    """As ``extrapolate``, each component as a geometric series of its own (Aitken).

    Where distances shrink faster than speeds, the state is no smooth function of the time that is left.
    """
    jumps, visits = run.jumps, run.visits
    for i in range(model.dimension):
        last = visits[slot_of(run, jumps - back), i]
        before = visits[slot_of(run, jumps - back - turn), i]
        change, earlier = last - before, before - visits[slot_of(run, jumps - back - 2 * turn), i]
        out[i] = last
        if abs(change) < abs(earlier):
            out[i] += change * change / (earlier - change)


@njit(**KERNEL)
def follow_resets(model, run, turn, t, x, work):
    """The resets of the last ``turn`` jumps, in order, from ``x (n,)`` into ``x``."""
    for back in range(turn - 1, -1, -1):
        model.reset(fired_before(run, back), t, x, model.parameters, work.state)
        for i in range(model.dimension):
            x[i] = work.state[i]


@njit(**KERNEL)
def mark_endless(model, run, turn, t, x, share, work):
    """Mark the components that rounds of ``turn`` jumps move for ever, though all others rest at ``x (n,)``.

    So does a counter: it has no limit. Only moves beyond ``share (n,)`` count. A component whose moves shrink
    has a limit of its own. Returns whether there are any.
    """
    n, once, twice, found = model.dimension, work.second_error, work.new, False
    for i in range(n):
        once[i] = x[i]
    follow_resets(model, run, turn, t, once, work)
    for i in range(n):
        moves = abs(once[i] - x[i]) > share[i]
        run.trail[ENDLESS, i] = 1.0 if moves else 0.0
        twice[i] = once[i] if moves else x[i]
        found = found or moves
    if not found:
        return False
    follow_resets(model, run, turn, t, twice, work)
    found = False
    for i in range(n):
        lasts = abs(twice[i] - once[i]) >= LASTING * abs(once[i] - x[i])
        if run.trail[ENDLESS, i] != 0.0 and not lasts:
            run.trail[ENDLESS, i] = 0.0
        found = found or run.trail[ENDLESS, i] != 0.0
    return found


@njit(**KERNEL)
def hold_endless(model, run, turn, t, left, work):
    """Mark the components that rounds move for ever, and let ``work.settled`` keep their last values.

    Between the jumps they move by their rate, which is that of the change from one round to the next.
    """
    n, share = model.dimension, work.rounding[0]
    last, before = run.visits[slot_of(run, run.jumps)], run.visits[slot_of(run, run.jumps - turn)]
    for i in range(n):
        share[i] = max(MOVES_ON * abs(last[i] - before[i]), ROUNDING_OF_TIME * EPSILON * run.scale[i])
    if not mark_endless(model, run, turn, t, work.settled, share, work):
        return
    earlier = run.visits[slot_of(run, run.jumps - 2 * turn)]
    shorter = time_before(model, run, turn, 2 * turn) - time_before(model, run, 0, turn)
    for i in range(n):
        if run.trail[ENDLESS, i] != 0.0:
            rate = (2.0 * before[i] - last[i] - earlier[i]) / shorter if shorter > 0.0 else 0.0
            work.settled[i] = last[i] + rate * left


@njit(**KERNEL)
def agree(model, method, run, one, other, sizes, slack):
    """Whether two estimates of the limit agree up to tolerances and ``slack (n,)``, but for endless moves."""
    for i in range(model.dimension):
        apart = not abs(one[i] - other[i]) <= method.atol + method.rtol * sizes[i] + slack[i]
        if apart and run.trail[ENDLESS, i] == 0.0:
            return False
    return True


@njit(**KERNEL)
def is_limit(model, run, turn, t, work):
    """Whether a round of jumps from ``work.settled`` finds the state on each guard, and leads back to it.

    ``work.trial (n,)`` holds the sizes of the components.
    """
    n, place = model.dimension, work.error
    for i in range(n):
        place[i] = work.settled[i]
    for back in range(turn - 1, -1, -1):
        transition = fired_before(run, back)
        value = guard_value(model, transition, t, place, work.scalar)
        model.guard_gradient(transition, t, place, model.parameters, work.gradient)
        size = abs(work.gradient[n] * t)
        for i in range(n):
            size += abs(work.gradient[i]) * work.trial[i]
        # A guard that jumps across zero is small on neither side of its jump.
        if not (abs(value) <= ROUGH * size or may_jump(model, run, transition, t, place, work)):
            return False
        model.reset(transition, t, place, model.parameters, work.state)
        for i in range(n):
            place[i] = work.state[i]
    for i in range(n):
        moves = not abs(place[i] - work.settled[i]) <= ROUGH * work.trial[i]
        if moves and run.trail[ENDLESS, i] == 0.0:
            return False
    return True


@njit(**KERNEL)
def size_of_visits(model, method, run, seen, out, work):
    """Largest size of each component right after the last jumps, into ``out (n,)``.

    What a component moves within the rounding of time, or within its tolerance, is rough as well.
    """
    field = work.field
    model.field(run.mode, run.phase, run.y, model.parameters, field)
    moment = ROUNDING_OF_TIME * EPSILON * abs(run.phase)
    for i in range(model.dimension):
        out[i] = max(run.scale[i], (moment * abs(field[i]) + method.atol) / ROUGH)
        for back in range(seen):
            out[i] = max(out[i], abs(run.visits[slot_of(run, run.jumps - back), i]))


@njit(**KERNEL)
def rounding_of_flights(model, run, work):
    """How far rounding may move the time of the last jump: that of the time, and that of its guard."""
    fired = run.last_fired
    model.guard_gradient(fired, run.phase, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, fired, run.phase, run.y, work)
    return EPSILON * abs(run.phase) + band / abs(run.last_transversality)


@njit(**KERNEL)
def hidden_by_rounding(model, run, turn, ratio, hidden, slack, work):
    """What the limit may be off by, where rounding hides the time ``hidden`` of it, into ``slack (n,)``.

    A component whose changes shrink as the rounds do, by their ``ratio``, has next to nothing left to change.
    ``work.field`` is current. The sizes in ``work.trial`` grow with the slack.
    """
    jumps, visits = run.jumps, run.visits
    last, before = visits[slot_of(run, jumps)], visits[slot_of(run, jumps - turn)]
    earlier = visits[slot_of(run, jumps - 2 * turn)]
    for i in range(model.dimension):
        change = abs(last[i] - before[i])
        shrinks = change <= 0.5 * (1.0 + ratio) * abs(before[i] - earlier[i])
        slack[i] = max(MOVES_ON * change if shrinks else 0.0, hidden * abs(work.field[i]))
        work.trial[i] = max(work.trial[i], slack[i] / ROUGH)


@njit(**KERNEL)
def limit_of_rounds(model, method, run, work):
    """Time to the limit of the jumps that fire in turn, and their number; zero if there is no limit yet.

    To be called after each jump. The limit is known once two estimates, a round apart, agree up to the
    tolerances, or once there is next to nothing left. Nor do later jumps tell more once the flights are so
    short, or so low, that rounding is all that parts the estimates. The limit state goes to ``work.settled``.
    """
    turn = transitions_in_turn(model, run) if shortens(model, run) else 0
    if turn == 0:
        return 0.0, 0
    left, ratio = time_left_of_rounds(model, run, turn, 0)
    earlier, _ = time_left_of_rounds(model, run, turn, turn)
    if not earlier > 0.0:
        return 0.0, 0
    seen = max(FEWEST_JUMPS, FEWEST_ROUNDS * turn)
    lasted = time_before(model, run, 0, seen) + left
    size_of_visits(model, method, run, seen, work.trial, work)
    latest, end, slack = time_before(model, run, 0, turn), run.phase + left, work.rounding[1]
    misfit, nearly = abs(left + latest - earlier), left <= NOTHING_LEFT * lasted
    agreed = misfit <= method.rtol * lasted
    hidden = rounding_of_flights(model, run, work) / (1.0 - ratio) ** 2
    # Rounds too short to have a length say nothing of the time: the states alone tell the limit.
    resolved = latest > ROUNDING_OF_TIME * EPSILON * abs(run.phase)
    drowned = resolved and not agreed and max(misfit, ROUGH * latest) <= hidden
    if not (agreed or nearly or drowned):
        return 0.0, 0
    for i in range(model.dimension):
        slack[i] = 0.0
    if drowned:
        hidden_by_rounding(model, run, turn, ratio, hidden, slack, work)
    if resolved:
        extrapolate(model, run, turn, 0, left, work.settled)
        hold_endless(model, run, turn, end, left, work)
        extrapolate(model, run, turn, turn, earlier, work.error)
        agreed = (agreed or drowned) and agree(
            model, method, run, work.settled, work.error, work.trial, slack
        )
        if (agreed or nearly) and is_limit(model, run, turn, end, work):
            return left, turn
    if nearly:
        extrapolate_by_rounds(model, run, turn, 0, work.settled)
        hold_endless(model, run, turn, end, left, work)
        extrapolate_by_rounds(model, run, turn, turn, work.error)
        agreed = agree(model, method, run, work.settled, work.error, work.trial, slack)
        if agreed and is_limit(model, run, turn, end, work):
            return left, turn
    return 0.0, 0


@njit(**KERNEL)
def next_in_turn(model, run, turn):
    """The transition that would fire next; none if another transition names the mode of the limit."""
    following = fired_before(run, turn - 1)
    if model.accumulates_to[following] != NO_MODE:
        return following
    for back in range(turn):
        if model.accumulates_to[fired_before(run, back)] != NO_MODE:
            return NO_TRANSITION
    return following
