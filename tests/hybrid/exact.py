"""Derivatives of exact solutions that are known as formulas."""

import mpmath as mp
import numpy as np


def derivative_of(solution, x0, p, t1):
    """The derivative ``(n, n)`` of ``solution(x, p, t1)`` at ``x0``: differences with 50 digits."""
    with mp.workdps(50):
        h, columns = mp.mpf(10) ** -20, []
        for j in range(len(x0)):
            ends = []
            for moved in (h, -h):
                x = [mp.mpf(value) for value in x0]
                x[j] += moved
                ends.append(solution(x, p, mp.mpf(t1)))
            columns.append([float((up - down) / (2 * h)) for up, down in zip(*ends, strict=True)])
    return np.array(columns).T
