"""Jumps that a jump triggers at the same instant: the guard of the first determines the time of all.

A reset that lands beyond a guard of its mode fires that transition too, on neighbouring orbits as on this
one. Their instant changes with a tangent vector ``v`` before the first jump by ``tau = a v``, the saltation
matrix of the first is ``P``, and after a jump with the reset ``R``, from the field ``f`` to ``f_plus``, the
tangent vector is

    (D_x R P + (D_x R f + D_t R - f_plus) a) v,

the next ``P``, whatever the guard of that jump does: its saltation matrix would let it fire at its own time.
"""

from numba import njit

from hybrid.kernels.arithmetic.tangent import multiply, solve
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def keep_tangents(run, n, tangents):
    """Store the tangent vectors, and the sums that go with them, as they are before a jump."""
    for i in range(n * tangents):
        run.before[i] = run.y[n + i]
    for c in range(tangents):
        run.growth_before[c] = run.growth[c]
    run.log_determinant_before = run.log_determinant
    run.ill_conditioned_growth_before = run.ill_conditioned_growth


@njit(**KERNEL)
def restore_tangents(run, n, tangents):
    """Restore the tangent vectors to their values before the first jump of this instant."""
    for i in range(n * tangents):
        run.y[n + i] = run.before[i]
    for c in range(tangents):
        run.growth[c] = run.growth_before[c]
    run.log_determinant = run.log_determinant_before
    run.ill_conditioned_growth = run.ill_conditioned_growth_before


@njit(**KERNEL)
def change_of_instant(run, n, work):
    """Store the derivative of the time at which the guard with gradient ``work.gradient`` is crossed.

    ``work.field`` is the field before the crossing.
    """
    speed = work.gradient[n]
    for j in range(n):
        speed += work.gradient[j] * work.field[j]
    for j in range(n):
        run.instant[j] = -work.gradient[j] / speed if work.gradient[j] != 0.0 else 0.0


@njit(**KERNEL)
def keep_map(run, n, work):
    """Store ``work.saltation`` as the tangent map of this instant so far."""
    for j in range(n):
        for i in range(n):
            run.instant[n + n * j + i] = work.saltation[i, j]
    run.map_is_known = 1


@njit(**KERNEL)
def postpone_map(run, n):
    """Store the state before a jump instead, in case another jump is locked to this jump."""
    for i in range(n):
        run.instant[i] = run.y[i]
    run.map_is_known = 0


@njit(**KERNEL)
def begin_at_start(run, n, tangents):
    """Begin an instant in which a run starts beyond a guard: nothing has changed yet."""
    keep_tangents(run, n, tangents)
    for i in range(n * (1 + n)):
        run.instant[i] = 0.0
    for i in range(n):
        run.instant[n + n * i + i] = 1.0
    run.map_is_known = 1


@njit(**KERNEL)
def follow(run, n, work):
    """Include a triggered jump in the tangent map of its instant.

    ``work.reset_jacobian`` and ``work.settled`` hold its ``D_x R`` and ``f_plus - D_x R f - D_t R``. Its own
    matrix goes to ``work.saltation``: the derivative of the instant refers to the state after the jumps
    before, ``a = c P``, so that the product of the matrices of an instant is its tangent map. Where ``P`` is
    singular there may be no such ``c``.
    """
    instant, system, later = run.instant, work.jacobian, work.error
    for j in range(n):
        for i in range(n):
            system[j, i] = instant[n + n * j + i]
        system[j, n] = instant[j]
    solve(system, n, later)
    multiply(work.reset_jacobian, instant, n, n, work.state, work.rounding)
    for i in range(n):
        kick = work.settled[i]
        for j in range(n):
            work.saltation[i, j] = work.reset_jacobian[i, j]
            if kick != 0.0:
                work.saltation[i, j] -= kick * later[j]
                instant[n + n * j + i] -= kick * instant[j]


@njit(**KERNEL)
def map_of_instant(run, n, out):
    """The tangent map of this instant so far, into ``out (n, n)``."""
    for j in range(n):
        for i in range(n):
            out[i, j] = run.instant[n + n * j + i]
