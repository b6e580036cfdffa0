"""Passive systems that are drawn, against time stepping with a complementarity problem in each step."""

from itertools import combinations

import numpy as np
import pytest

from hybrid import Pair, complementarity, simulate

STEP = 4e-3


def drawn(seed):
    """Matrices ``A``, ``B`` and ``D`` with ``C = B^T``: the energy is half of the squared state."""
    rng = np.random.default_rng(seed)
    n, m = 2, 2
    A, B = rng.normal(size=(n, n)) - 1.5 * np.eye(n), rng.normal(size=(n, m))
    S, column = rng.normal(size=(m, m)), rng.normal(size=(m, 1))
    # No z in w, one part of it, or z against z: each has other currents that may be held.
    D = [np.zeros((m, m)), S - S.T, S - S.T + column @ column.T][seed % 3]
    return A, B, D, rng.normal(size=n), np.abs(rng.normal(size=m))


def system_of(A, B, D, drive, bias):
    def rates(t, x, z, p):
        return [
            sum(A[i, j] * x[j] + B[i, j] * z[j] for j in range(2)) + drive[i] * np.sin(2.0 * t)
            for i in range(2)
        ]

    def w(t, x, z, p, i):
        return sum(B[j, i] * x[j] + D[i, j] * z[j] for j in range(2)) + bias[i]

    pairs = [Pair(f"k{i}", w=lambda t, x, z, p, i=i: w(t, x, z, p, i)) for i in range(2)]
    return complementarity(state=2, rates=rates, pairs=pairs)


def stepped(A, B, D, drive, bias, count):
    """States after implicit Euler steps."""
    x, found = np.zeros(2), []
    inverse = np.linalg.inv(np.eye(2) - STEP * A)
    M = D + STEP * B.T @ inverse @ B
    for k in range(1, count + 1):
        free = inverse @ (x + STEP * drive * np.sin(2.0 * k * STEP))
        q = B.T @ free + bias
        for active in (list(each) for size in range(3) for each in combinations(range(2), size)):
            z = np.zeros(2)
            if active and abs(np.linalg.det(M[active][:, active])) > 1e-12:
                z[active] = np.linalg.solve(M[active][:, active], -q[active])
            if (z > -1e-9).all() and (q + M @ z > -1e-9).all():
                break
        x = free + STEP * inverse @ B @ z
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_time_stepping(seed):
    given = drawn(seed)
    arc = simulate(system_of(*given), (0.0, 0.0), (0.0, 4.0))
    assert arc.status.ok
    times = STEP * np.arange(1, 1000)
    np.testing.assert_allclose(arc(times[::50]), stepped(*given, 999)[::50], atol=2e-2)
    for i in range(2):
        assert np.nanmin(arc[f"k{i}.w"]) > -1e-9
        assert np.nanmin(arc[f"k{i}.z"]) > -1e-9
