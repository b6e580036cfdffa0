"""A traffic light: cars arrive, wait while it is red, and leave while it is green."""

from hybrid import Every, Guard, HybridSystem, Mode, Transition


def traffic_light():
    """Cars arrive at the rate ``lam`` and leave at ``mu``; green takes ``g`` of the period ``T``."""
    return HybridSystem(
        state=("n",),
        parameters={"lam": 0.3, "mu": 1.0, "g": 30.0, "T": 60.0},
        modes=[
            Mode("red", lambda t, x, p: (p.lam,)),
            Mode("green", lambda t, x, p: (p.lam - p.mu,)),
            Mode("free", lambda t, x, p: (0.0,)),
        ],
        transitions=[
            Transition("red", "green", Every("T"), name="go"),
            Transition("green", "free", Guard(lambda t, x, p: x.n, -1), name="empty"),
            Transition("green", "red", Every("T", offset="g"), name="stop"),
            Transition("free", "red", Every("T", offset="g"), name="stop free"),
        ],
        start="green",
        period=lambda p: p.T,
    )
