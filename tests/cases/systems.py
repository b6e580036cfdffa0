"""The reference systems as hybrid systems, each modelled in its most natural form."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Reset, Transition


def switched_linear() -> HybridSystem:
    """Hiskens and Pai's pair of linear systems, switched on two lines through the origin."""
    return HybridSystem(
        state=("x1", "x2"),
        modes=[
            Mode("first", lambda t, x, p: (x.x1 - 100 * x.x2, 10 * x.x1 + x.x2)),
            Mode("second", lambda t, x, p: (x.x1 + 10 * x.x2, -100 * x.x1 + x.x2)),
        ],
        transitions=[
            Transition("first", "second", Guard(lambda t, x, p: x.x2 - 2.75 * x.x1)),
            Transition("second", "first", Guard(lambda t, x, p: x.x2 - 0.36 * x.x1)),
        ],
    )


def stick_slip() -> HybridSystem:
    """``models.stick_slip`` with a hand-written stick mode; the block is never faster than the belt.

    The release is a fold: at ``x = Fs`` the slip begins with ``v = belt`` and no acceleration, on the guard
    of the next sticking, which it leaves with ``v'' = -belt``.
    """

    def slip(t, x, p):
        return x.v, p.Fs / (1 + p.delta * (p.belt - x.v)) - x.x

    return HybridSystem(
        state=("x", "v"),
        parameters={"belt": 0.2, "delta": 3.0, "Fs": 1.0},
        modes=[Mode("stick", lambda t, x, p: (p.belt, 0.0)), Mode("slip", slip)],
        transitions=[
            Transition("stick", "slip", Guard(lambda t, x, p: x.x - p.Fs, direction=+1), name="release"),
            Transition(
                "slip",
                "stick",
                Guard(lambda t, x, p: x.v - p.belt, direction=+1),
                Reset(lambda t, x, p: (x.x, p.belt)),
                name="catch",
            ),
        ],
    )


def constant_fields() -> HybridSystem:
    """``(1, -1)`` left of ``x1 = 0`` and ``(1, 1)`` right of it."""
    return HybridSystem(
        state=("x1", "x2"),
        modes=[Mode("left", lambda t, x, p: (1.0, -1.0)), Mode("right", lambda t, x, p: (1.0, 1.0))],
        transitions=[Transition("left", "right", Guard(lambda t, x, p: x.x1, direction=+1))],
    )


def incline() -> HybridSystem:
    """A ball that falls on a frictionless incline ``x sin(a) + y cos(a) = 0`` and then slides."""

    def project(t, x, p):
        along = np.cos(p.a) * x.vx - np.sin(p.a) * x.vy
        return x.x, x.y, np.cos(p.a) * along, -np.sin(p.a) * along

    def slide(t, x, p):
        along = p.g * np.sin(p.a)
        return x.vx, x.vy, np.cos(p.a) * along, -np.sin(p.a) * along

    return HybridSystem(
        state=("x", "y", "vx", "vy"),
        parameters={"g": 9.81, "a": 0.4},
        modes=[Mode("fall", lambda t, x, p: (x.vx, x.vy, 0.0, -p.g)), Mode("slide", slide)],
        transitions=[
            Transition(
                "fall",
                "slide",
                Guard(lambda t, x, p: np.sin(p.a) * x.x + np.cos(p.a) * x.y, direction=-1),
                Reset(project),
                name="landing",
            )
        ],
    )


def jerk() -> HybridSystem:
    """``x''' = -0.6 x'' - x' + abs(x) - 1``, split where the absolute value has its kink."""

    def field(sign):
        return lambda t, x, p: (x.v, x.a, -p.damping * x.a - x.v + sign * x.x - 1)

    return HybridSystem(
        state=("x", "v", "a"),
        parameters={"damping": 0.6},
        modes=[Mode("left", field(-1.0)), Mode("right", field(1.0))],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.x, direction=+1)),
            Transition("right", "left", Guard(lambda t, x, p: x.x, direction=-1)),
        ],
    )
