"""The end of a run of which there is nothing to tell."""

from types import SimpleNamespace

import numpy as np

from hybrid.kernels.types.codes import EXACT, HELD, RUNGE_KUTTA

COUNTED = ("unproved", "unresolved", "coarse", "order_mattered")


def end():
    """A model of five modes, two of them steep, and the entries of a run that ends in the second one."""
    kinds = np.array([RUNGE_KUTTA, RUNGE_KUTTA, EXACT, RUNGE_KUTTA, RUNGE_KUTTA])
    steep, bounded = np.array([1, 0, 1, 0, 0]), np.ones(5, dtype=int)
    model = SimpleNamespace(dimension=2, steep=steep, propagator=kinds, bounded=bounded)
    trail = np.zeros((HELD + 1, 3))
    # The last number of a row belongs to no component.
    trail[HELD, 2] = 1.0
    run = {
        "mode": 1,
        "lateness": 10.0,
        "unknown_time": 0.0,
        "trail": trail,
        "stay": np.zeros(5),
        **dict.fromkeys(COUNTED, 0),
    }
    return model, run
