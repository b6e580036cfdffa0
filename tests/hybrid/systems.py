"""Systems that several test files use."""

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from models import bouncing_ball, impact_oscillator


def pendulum(guard=lambda t, x, p: x.q - p.c, *, both=False, names=("left", "right"), order=1):
    """A pendulum with an identity transition at ``q = c``."""

    def field(t, x, p):
        return x.v, -np.sin(x.q)

    left, right = names
    transitions = [
        Transition(left, right, Guard(guard, 0 if both else +1), name="forth"),
        Transition(right, left, Guard(guard, 0 if both else -1), name="back"),
    ]
    return HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.3},
        modes=[Mode(left, field), Mode(right, field)],
        transitions=transitions[::order],
    )


def shaken_table():
    """A ball on a table that moves as ``a sin(w t)``: guard and reset depend on time."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81, "e": 0.7, "a": 0.1, "w": 5.0},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q - p.a * np.sin(p.w * t), -1),
                Reset(lambda t, x, p: (x.q, -p.e * x.v + (1 + p.e) * p.a * p.w * np.cos(p.w * t))),
                name="hit",
            )
        ],
    )


def fall(t, x, p):
    return x.v, -p.g


def height(t, x, p):
    return x.q


def rebound(t, x, p):
    return 0.0, -p.e * x.v


FLIGHT = Mode("flight", fall)
BOUNCE = Transition("flight", "flight", Guard(height, -1), Reset(rebound), name="bounce")


def ball(**changes):
    """The bouncing ball, made of functions that can be pickled, with other parts."""
    parts = {
        "state": ("q", "v"),
        "parameters": {"g": 9.81, "e": 0.8},
        "modes": [FLIGHT],
        "transitions": [BOUNCE],
        "name": "ball",
    }
    return HybridSystem(**{**parts, **changes})


PENDULUM = pendulum()
BALL_SYSTEM = bouncing_ball()
OSCILLATOR_SYSTEM = impact_oscillator()
