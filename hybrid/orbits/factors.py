"""The fundamental matrix of a run as a product of well-conditioned factors."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.types import codes
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import StatusCode

# The tangent vectors are orthonormalised where their condition number is above this, or their size leaves the
# range.
WORST_CONDITION = 1e2
SMALLEST, LARGEST = 1e-50, 1e50
# A step of an implicit method that strains them by more than this is taken again, shorter.
LONGEST_STEP = 1e3
SHORTER = 0.25


def fundamental_factors(trajectory: Trajectory, t: float) -> tuple[list[np.ndarray], int]:
    """Advance to ``t``; returns factors ``(n, n)`` in the order in which they are applied, and a code.

    The trajectory carries the ``n`` columns of the identity. Their product is the fundamental matrix: the
    upper triangular factors of ``A_j Q_{j-1} = Q_j R_j``, and the last ``Q``. The jumps of one instant have a
    factor of their own, so that what they annihilate is told from what a flight makes small.
    """
    run = trajectory.run
    place, record = split_time(t, trajectory.model.period), trajectory.no_record()
    factors: list[np.ndarray] = []
    implicit = bool(trajectory.method.implicit)
    strained = False

    def orthonormalise() -> None:
        nonlocal strained
        basis, triangle = np.linalg.qr(trajectory.tangent_matrix)
        factors.append(triangle)
        trajectory.replace_tangents(basis)
        strained = False

    while True:
        if trajectory.stop.is_set():
            return factors, StatusCode.INTERRUPTED
        before = run.saved() if implicit else None
        steps = int(run.steps)
        code = trajectory.advance_to(*place, record, max_steps=steps + 1, max_jumps=trajectory.jumps)
        if code not in (codes.MAX_STEPS, codes.MAX_JUMPS, codes.DONE):
            return factors, code
        if int(run.steps) > steps or code == codes.DONE:
            sizes = np.linalg.svd(trajectory.tangent_matrix, compute_uv=False)
            if not np.all(np.isfinite(sizes)):
                return factors, codes.NON_FINITE
            if before is not None and sizes[0] > WORST_CONDITION * LONGEST_STEP * sizes[-1]:
                length = run.last_step
                run.restore(before)
                run.next_step = SHORTER * length
                trajectory.replace_tangents(trajectory.tangent_matrix)
                continue
            strained = True
            if sizes[0] > WORST_CONDITION * sizes[-1] or not SMALLEST < sizes[0] < LARGEST:
                orthonormalise()
        if code == codes.MAX_JUMPS:
            if strained:
                orthonormalise()
            code = trajectory.advance_to(*place, record, max_steps=int(run.steps))
            if code not in (codes.MAX_STEPS, codes.DONE):
                return factors, code
            orthonormalise()
        if code == codes.DONE:
            return [*factors, trajectory.tangent_matrix], code
        if run.steps >= trajectory.max_steps:
            return factors, codes.MAX_STEPS
