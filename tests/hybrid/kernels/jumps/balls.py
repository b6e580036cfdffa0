"""Balls above floors that may be bent, as plain Python, for the arithmetic of chatter.

The state is the height ``q``, the speed ``v`` and a third component ``s`` that drifts.
"""

from types import SimpleNamespace

import numpy as np

from hybrid.kernels.jumps.chatter import IMPULSE

PULL = 4.0
METHOD = SimpleNamespace(atol=1e-10, rtol=1e-8)


class Model:
    """``q' = v``, ``v' = -4 + q s / 2``, ``s' = 1/2 + q + 2 v``; the guard is ``q + bend s^2``."""

    dimension = 3
    timed = np.array([1, 1])
    parameters = np.zeros(0)
    programs = SimpleNamespace(first=np.zeros(9, dtype=int))
    target = np.zeros(2)
    steep = np.zeros(2, dtype=int)
    period = 0.0
    first_forcing = np.zeros(3, dtype=int)
    first_residue = np.zeros(3, dtype=int)
    # Rows of the Jacobian that are not zero: all of them, in both modes.
    first_slope = np.array([[0, 3, 6, 9], [0, 3, 6, 9]])
    slope_column = np.array([0, 1, 2] * 3)

    def __init__(self, *, bend=0.0, direction=-1, ratio=0.5, tilt=0.0):
        self.bend, self.ratio, self.tilt = bend, ratio, tilt
        self.direction = np.array([9, direction])
        self.affine_guard = np.array([0, int(bend == 0.0)])

    def field(self, mode, t, x, parameters, out):
        assert mode == 1
        q, v, s = x
        out[:] = v, -PULL + q * s / 2.0, 0.5 + q + 2.0 * v

    def field_jacobian(self, mode, t, x, parameters, out):
        assert mode == 1
        q, _, s = x
        out[:] = (0.0, 1.0, 0.0, 0.0), (s / 2.0, 0.0, q / 2.0, 0.0), (1.0, 2.0, 0.0, 0.0)

    def guard(self, transition, t, x, parameters, out):
        assert transition == 1
        out[0] = x[0] + self.bend * x[2] ** 2

    def guard_gradient(self, transition, t, x, parameters, out):
        assert transition == 1
        out[:] = 1.0, 0.0, 2.0 * self.bend * x[2], 0.0

    def guard_curvature(self, transition, t, x, parameters, out):
        out[0] = 2.0 * self.bend * out[2] ** 2

    def reset(self, transition, t, x, parameters, out):
        """The speed of the guard falls by ``(1 + r) v`` along ``(0, 1, tilt)``."""
        out[:] = x[0], -self.ratio * x[1], x[2] - self.tilt * (1.0 + self.ratio) * x[1]


def memory():
    names = ("trial", "error", "new", "second_error", "settled", "state", "field", "field_after")
    return SimpleNamespace(
        **{name: np.full(3, 1e9) for name in names},
        gradient=np.full(4, 1e9),
        scalar=np.zeros(1),
        jacobian=np.full((3, 4), 1e9),
        reset_jacobian=np.full((3, 4), 1e9),
        saltation=np.full((3, 3), 1e9),
        sizes=np.full((3, 3), 1e9),
        rounding=np.full((4, 3), 1e9),
    )


def new_run(y=(0.0, 1.0, 0.0), **values):
    given = {
        "mode": 1,
        "y": np.array(y),
        "phase": 3.0,
        "scale": np.ones(3),
        "restitution": 0.5,
        "last_transversality": -1.0,
        "chattering": 0,
        "chatter_jumps": 0,
        "jumps": 1,
        "recent": np.full(32, 1),
        "visits": np.zeros(32, dtype=int),
        "since_entry": 0.0,
        "trail": np.zeros((5, 4)),
        "instant": np.full(3, 1e9),
        "last_fired": 1,
    }
    run = SimpleNamespace(**(given | values))
    run.trail[IMPULSE, :3] = 0.0, 1.0, 0.25
    return run


class Ball(Model):
    """Nothing but the pull, towards a floor or a ceiling, and a drift of 1/2."""

    def field(self, mode, t, x, parameters, out):
        out[:] = x[1], self.direction[1] * PULL, 0.5
