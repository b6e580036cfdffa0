"""A dozen systems as their users would write them, for `benchmarks.campaign`."""

from __future__ import annotations

import numpy as np

from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, filippov, from_equations, split


def gear_pair() -> HybridSystem:
    """A mesh with backlash, and one bearing."""

    def law(t, s, p):
        d = s.x - s.y
        gap = np.where(d > 1, d - 1, np.where(d < -1, d + 1, 0.0))
        mesh = 2 * p.z * (s.u - s.w) + (1 + p.eps * np.cos(p.Om * t)) * gap
        rates = p.Fm + p.Fa * np.cos(p.Om * t) - mesh, p.m * mesh - 2 * p.zb * s.w - p.kb * s.y
        return s.u, rates[0], s.w, rates[1]

    numbers = {"z": 0.05, "eps": 0.2, "Om": 0.9, "Fm": 0.1, "Fa": 0.05, "m": 0.3, "zb": 0.05, "kb": 1.5}
    return from_equations(
        law, state=("x", "u", "y", "w"), parameters=numbers, period=lambda p: 2 * np.pi / p.Om
    )


def sigma_delta() -> HybridSystem:
    """A leaky modulator of the first order: its quantiser jumps in the reset."""
    return split(
        HybridSystem(
            state=("x",),
            parameters={"a": 0.8, "u": 0.02},
            period=1.0,
            modes=[Mode("hold", lambda t, x, p: (0.0,))],
            transitions=[
                Transition(
                    "hold",
                    "hold",
                    Every(1.0),
                    Reset(lambda t, x, p: (p.a * x.x + p.u + np.where(x.x < 0, 1.0, -1.0),)),
                )
            ],
        )
    )


def driven_neuron() -> HybridSystem:
    """A leaky neuron that integrates and fires, under a current with a period."""
    return HybridSystem(
        state=("v",),
        parameters={"I": 1.4, "k": 0.3, "T": 1.3},
        period=lambda p: p.T,
        modes=[Mode("on", lambda t, x, p: (p.I + p.k * np.cos(2 * np.pi * t / p.T) - x.v,))],
        transitions=[
            Transition(
                "on", "on", Guard(lambda t, x, p: x.v - 1.0, +1), Reset(lambda t, x, p: (0.0,)), name="spike"
            )
        ],
    )


def buck() -> HybridSystem:
    """A converter with a diode: continuous and discontinuous conduction."""
    return HybridSystem(
        state=("i", "v"),
        parameters={"E": 24.0, "L": 1e-4, "C": 1e-4, "R": 10.0, "T": 2e-5, "D": 0.5},
        period=lambda p: p.T,
        modes=[
            Mode("on", lambda t, x, p: ((p.E - x.v) / p.L, (x.i - x.v / p.R) / p.C)),
            Mode("off", lambda t, x, p: (-x.v / p.L, (x.i - x.v / p.R) / p.C)),
            Mode("idle", lambda t, x, p: (0.0, -x.v / p.R / p.C)),
        ],
        transitions=[
            Transition("on", "off", Every("T", offset=lambda p: p.D * p.T), name="open"),
            Transition("off", "on", Every("T"), name="close"),
            Transition("off", "idle", Guard(lambda t, x, p: x.i, -1), name="empty"),
            Transition("idle", "on", Every("T"), name="close idle"),
        ],
        start="on",
    )


def relay() -> HybridSystem:
    """A relay with hysteresis around a plant of the third order: a limit cycle."""

    def plant(u):
        return lambda t, x, p: (x.y, x.z, -p.a * x.x - 2.0 * x.y - p.c * x.z - u * p.k)

    return HybridSystem(
        state=("x", "y", "z"),
        parameters={"a": 1.0, "c": 2.0, "k": 1.0, "h": 0.05},
        modes=[Mode("high", plant(1.0)), Mode("low", plant(-1.0))],
        transitions=[
            Transition("high", "low", Guard(lambda t, x, p: x.x + p.h, -1)),
            Transition("low", "high", Guard(lambda t, x, p: x.x - p.h, +1)),
        ],
        start="high",
    )


def thermostat() -> HybridSystem:
    """A room between two temperatures, with days and nights."""

    def outside(t, p):
        return p.mean + p.swing * np.cos(2 * np.pi * t / 24)

    return HybridSystem(
        state=("T",),
        parameters={"mean": 5.0, "swing": 6.0, "k": 0.12, "heat": 3.5, "low": 19.0, "high": 25.0},
        period=24.0,
        modes=[
            Mode("heat", lambda t, x, p: (p.heat - p.k * (x.T - outside(t, p)),)),
            Mode("rest", lambda t, x, p: (-p.k * (x.T - outside(t, p)),)),
        ],
        transitions=[
            Transition("heat", "rest", Guard(lambda t, x, p: x.T - p.high, +1)),
            Transition("rest", "heat", Guard(lambda t, x, p: x.T - p.low, -1)),
        ],
        start="heat",
    )


def harvest() -> HybridSystem:
    """Prey and predators that are hunted where they are many: a cycle that may slide."""

    def grow(x, p):
        return x.x * (1 - x.x) - p.psi * x.x * x.y / (p.a + x.x)

    def feed(x, p):
        return x.y * (p.psi * x.x / (p.a + x.x) - p.d)

    return filippov(
        state=("x", "y"),
        parameters={"psi": 1.0, "a": 0.3556, "d": 0.0444, "e": 0.2067, "alpha": 0.5},
        below=lambda t, x, p: (grow(x, p), feed(x, p)),
        above=lambda t, x, p: (grow(x, p), feed(x, p) - p.e * x.y),
        switching=lambda t, x, p: x.y - p.alpha,
    )


def belt() -> HybridSystem:
    """A mass on a belt under a force, with friction that weakens with speed, as plain equations."""

    def law(t, s, p):
        slip = s.v - p.belt
        friction = p.mu * np.sign(slip) / (1 + p.gamma * np.abs(slip))
        return s.v, -s.x - 0.05 * s.v - friction + p.F * np.cos(p.Om * t)

    numbers = {"belt": 0.5, "mu": 0.4, "gamma": 1.0, "F": 0.3, "Om": 0.8}
    return from_equations(law, state=("x", "v"), parameters=numbers, period=lambda p: 2 * np.pi / p.Om)


def preloaded() -> HybridSystem:
    """An isolator with a preload and a softer spring beyond it, as plain equations."""

    def law(t, s, p):
        force = np.where(s.x > p.g, s.x + p.k * (s.x - p.g), s.x)
        return s.v, -2 * p.z * s.v - force + p.F * np.cos(p.w * t)

    numbers = {"g": 0.5, "k": 3.0, "z": 0.05, "F": 0.2, "w": 0.9}
    return from_equations(law, state=("x", "v"), parameters=numbers, period=lambda p: 2 * np.pi / p.w)


def duffing_with_stop() -> HybridSystem:
    """A beam in a double well that hits a stop."""
    return HybridSystem(
        state=("x", "v"),
        parameters={"F": 0.2, "w": 1.0, "c": 0.2, "s": 1.3, "e": 0.7},
        period=lambda p: 2 * np.pi / p.w,
        modes=[Mode("on", lambda t, x, p: (x.v, x.x - x.x**3 - p.c * x.v + p.F * np.cos(p.w * t)))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.x - p.s, +1),
                Reset(lambda t, x, p: {"v": -p.e * x.v}),
                name="hit",
            )
        ],
    )


def vaccination() -> HybridSystem:
    """An epidemic with a pulse of vaccination each year."""
    return HybridSystem(
        state=("S", "I"),
        parameters={"beta": 600.0, "mu": 0.02, "g": 50.0, "share": 0.05},
        period=1.0,
        modes=[
            Mode(
                "year",
                lambda t, x, p: (
                    p.mu * (1 - x.S) - p.beta * x.S * x.I,
                    p.beta * x.S * x.I - (p.g + p.mu) * x.I,
                ),
            )
        ],
        transitions=[
            Transition(
                "year", "year", Every(1.0), Reset(lambda t, x, p: {"S": (1 - p.share) * x.S}), name="pulse"
            )
        ],
    )


def relief_valve() -> HybridSystem:
    """A valve on a vessel: a disc under pressure that hits its seat (Hos and Champneys)."""

    def flow(x):
        return x.x * np.sqrt(x.p)

    return HybridSystem(
        state=("x", "v", "p"),
        parameters={"k": 1.25, "delta": 10.0, "beta": 20.0, "q": 5.0, "r": 0.8},
        modes=[
            Mode(
                "open",
                lambda t, x, p: (x.v, -p.k * x.v - (x.x + p.delta) + x.p, p.beta * (p.q - flow(x))),
            )
        ],
        transitions=[
            Transition(
                "open",
                "open",
                Guard(lambda t, x, p: x.x, -1),
                Reset(lambda t, x, p: {"v": -p.r * x.v}),
                name="seat",
            )
        ],
    )
