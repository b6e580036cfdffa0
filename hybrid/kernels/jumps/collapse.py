"""Jumps at one instant that come to a limit there: the fixed point of a round of resets.

A light ball that a heavy one presses to the floor is hit infinitely often. The distances shrink by a factor
per round. The speeds shrink by so little that the distances are lost in rounding long before: all later jumps
happen at one instant. What they do to the state is the same map in each round, as long as all transitions
fire in turn. If the map is affine, ``x -> x + d`` at first and with the Jacobian ``D``, its limit is

    x + (I + D + D^2 + ...) d.

The sum over ``2 m`` rounds is that over ``m`` rounds and ``D^m`` times the same. Thirty such doublings are a
thousand million rounds.
"""

import math

from numba import njit

from hybrid.kernels.events.derivatives import speed_rounding
from hybrid.kernels.events.guards import ROUNDING_OF_STATE, guard_speed
from hybrid.kernels.jumps.rounds import LASTING, fired_before
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# Largest number of transitions in a round, and the number of last jumps that must have been such rounds.
MOST_IN_ROUND = 16
SEEN = 48
# Jumps from one look at a limit to the next: a prime, so that each jump of a round is the last once.
UNTIL_NEXT_LOOK = 47
# Rounds without a limit after so many doublings have none.
MOST_DOUBLINGS = 40
# What moves a state by this many times rounding moves it.
MOVED = 64.0


@njit(**KERNEL)
def round_at_once(model, run):
    """The number of transitions of the mode that have fired in turn at this instant; 0 if there are none."""
    if min(run.jumps_here, run.recent.shape[0]) < SEEN:
        return 0
    for back in range(SEEN):
        transition = fired_before(run, back)
        if model.target[transition] != run.mode or model.direction[transition] == 0:
            return 0
    for turn in range(1, MOST_IN_ROUND + 1):
        same = True
        for back in range(SEEN - turn):
            same = same and fired_before(run, back) == fired_before(run, back + turn)
            if not same:
                break
        if same:
            return turn
    return 0


@njit(**KERNEL)
def fires_in_turn(model, run, turn, start, rounds, work):
    """Whether each transition of a round that begins at ``start (n,)`` finds its guard moving beyond zero.

    What the rounding of ``rounds`` rounds hides counts as moving. The state after the round is left in
    ``work.new``.
    """
    n, mode, t, place = model.dimension, run.mode, run.phase, work.new
    for i in range(n):
        place[i] = start[i]
    for back in range(turn - 1, -1, -1):
        transition = fired_before(run, back)
        model.field(mode, t, place, model.parameters, work.field)
        speed = guard_speed(model, transition, t, place, work.field, work.gradient)
        hidden = rounds * speed_rounding(model, run, transition, mode, t, place, work)
        if not speed * model.direction[transition] >= -hidden:
            return False
        model.reset(transition, t, place, model.parameters, work.state)
        for i in range(n):
            place[i] = work.state[i]
    return True


@njit(**KERNEL)
def multiply_matrices(one, other, out, n):
    """The product of two matrices ``(n, n)`` into ``out (n, n)``."""
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += one[i, k] * other[k, j]
            out[i, j] = total


@njit(**KERNEL)
def round_jacobian(model, run, turn, start, out, work):
    """The Jacobian of a round of resets from ``start (n,)``, into ``out (n, n)``."""
    n, t, place, product = model.dimension, run.phase, work.new, work.sizes
    for i in range(n):
        place[i] = start[i]
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    for back in range(turn - 1, -1, -1):
        transition = fired_before(run, back)
        model.reset_jacobian(transition, t, place, model.parameters, work.reset_jacobian)
        multiply_matrices(work.reset_jacobian, out, product, n)
        model.reset(transition, t, place, model.parameters, work.state)
        for i in range(n):
            place[i] = work.state[i]
            for j in range(n):
                out[i, j] = product[i, j]


@njit(**KERNEL)
def mark_tallies(matrix, n, tally):
    """Mark the components that nothing depends on and that a round only adds to, in ``tally (n,)``."""
    for i in range(n):
        tally[i] = 1.0 if matrix[i, i] == 1.0 else 0.0
        for j in range(n):
            if j != i and matrix[j, i] != 0.0:
                tally[i] = 0.0


@njit(**KERNEL)
def follow_doubling(model, run, turn, start, before, work):
    """Follow rounds from ``start (n,)`` until nothing moves, to ``work.settled (n,)``; returns their number.

    It is zero if there is no limit. The order of the jumps is checked after 1, 2, 4, 8, ... rounds: if the
    speeds turned, the order would change. The start has the rounding of ``before`` rounds. A counter, which
    all rounds move by the same amount, stays where it is.
    """
    tally = work.field_after
    n, sum_of_moves, power, product = model.dimension, work.trial, work.saltation, work.sizes
    rounds = 1.0
    if not fires_in_turn(model, run, turn, start, before, work):
        return 0.0
    for i in range(n):
        sum_of_moves[i] = work.new[i] - start[i]
    round_jacobian(model, run, turn, start, power, work)
    mark_tallies(power, n, tally)
    for _ in range(MOST_DOUBLINGS):
        moves, rounds = False, 2.0 * rounds
        for i in range(n):
            work.error[i] = 0.0
            for j in range(n):
                work.error[i] += power[i, j] * sum_of_moves[j]
        for i in range(n):
            endless = tally[i] != 0.0 and abs(work.error[i]) >= LASTING * abs(sum_of_moves[i])
            sum_of_moves[i] += work.error[i]
            work.settled[i] = start[i] + (0.0 if endless else sum_of_moves[i])
            hidden = rounds * ROUNDING_OF_STATE * EPSILON * abs(work.settled[i])
            # A component that grows beyond all numbers has an infinite band, and no limit.
            moves = moves or not (endless or abs(work.error[i]) <= hidden < math.inf)
        if not fires_in_turn(model, run, turn, work.settled, max(rounds, before), work):
            return 0.0
        if not moves:
            return rounds
        multiply_matrices(power, power, product, n)
        for i in range(n):
            for j in range(n):
                power[i, j] = product[i, j]
    return 0.0


@njit(**KERNEL)
def is_affine(model, run, turn, work):
    """Whether a round has the same Jacobian here and at ``work.settled``, as far as the way there tells."""
    n, there = model.dimension, work.jacobian
    round_jacobian(model, run, turn, work.settled, there, work)
    round_jacobian(model, run, turn, run.y, work.saltation, work)
    for j in range(n):
        if abs(work.settled[j] - run.y[j]) <= MOVED * EPSILON * run.scale[j]:
            continue
        for i in range(n):
            size = max(abs(there[i, j]), abs(work.saltation[i, j]))
            if not abs(there[i, j] - work.saltation[i, j]) <= MOVED * EPSILON * size:
                return False
    return True


@njit(**KERNEL)
def limit_at_once(model, run, work):
    """Limit of the rounds at this instant, to ``work.settled (n,)``: transitions in a round, and rounds.

    Both are zero if there is no limit. The move of one round has a rounding error, which all rounds
    together multiply: the limit is followed once more from where it was found, with moves that are smaller.
    """
    turn, start = round_at_once(model, run), work.second_error
    for i in range(model.dimension):
        start[i] = run.y[i]
    most = 1.0
    for _ in range(2 if turn > 0 else 0):
        rounds = follow_doubling(model, run, turn, start, most, work)
        if rounds == 0.0:
            return 0, 0.0
        most = max(most, rounds)
        for i in range(model.dimension):
            start[i] = work.settled[i]
    if turn == 0 or not is_affine(model, run, turn, work):
        return 0, 0.0
    return turn, most
