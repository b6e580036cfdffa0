"""Right models with what their authors know of them, and errors that people make in them: the first five."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


@attrs.frozen
class Error:
    """One error in a right model.

    Attributes
    ----------
    kind
        What sort of error it is.
    told
        What was changed, in words.
    words
        A good message contains one of these.
    change
        Makes the wrong system from the right one.
    """

    kind: str
    told: str
    words: tuple[str, ...]
    change: Callable[[HybridSystem], HybridSystem]


@attrs.frozen
class Subject:
    """A right model, what its author tells ``check_system``, and errors in the model."""

    system: HybridSystem
    known: Mapping[str, Any]
    errors: tuple[Error, ...]


def mode(system: HybridSystem, name: str, **changes: Any) -> HybridSystem:
    """The system with one mode changed."""
    modes = [attrs.evolve(each, **changes) if each.name == name else each for each in system.modes]
    return attrs.evolve(system, modes=modes)


def edge(system: HybridSystem, name: str, **changes: Any) -> HybridSystem:
    """The system with one transition changed."""
    edges = [attrs.evolve(each, **changes) if each.name == name else each for each in system.transitions]
    return attrs.evolve(system, transitions=edges)


def guard(system: HybridSystem, name: str, **changes: Any) -> HybridSystem:
    """The system with the guard of one transition changed."""
    [found] = [each.guard for each in system.transitions if each.name == name]
    return edge(system, name, guard=attrs.evolve(found, **changes))


def reset(system: HybridSystem, name: str, function: Callable[..., Any]) -> HybridSystem:
    """The system with another reset at one transition."""
    return edge(system, name, reset=Reset(function))


def pendulum_with_peg() -> Subject:
    """Galileo's pendulum: at the angle beta its string meets a peg, a distance d below the pivot."""
    system = HybridSystem(
        name="pendulum with a peg",
        state=("th", "om"),
        parameters={"g": 9.81, "L": 1.0, "d": 0.6, "beta": np.radians(15.0)},
        units={"th": "rad", "om": "rad/s", "t": "s", "g": "m/s^2", "L": "m", "d": "m", "beta": "rad"},
        modes=[
            Mode("free", lambda t, x, p: (x.om, -p.g / p.L * np.sin(x.th))),
            Mode("wrapped", lambda t, x, p: (x.om, -p.g / (p.L - p.d) * np.sin(x.th))),
        ],
        transitions=[
            Transition(
                "free",
                "wrapped",
                Guard(lambda t, x, p: x.th - p.beta, when=lambda t, x, p: x.om > 0),
                Reset(lambda t, x, p: {"om": x.om * p.L / (p.L - p.d)}),
                name="catch",
            ),
            Transition(
                "wrapped",
                "free",
                Guard(lambda t, x, p: x.th - p.beta, direction=-1),
                Reset(lambda t, x, p: {"om": x.om * (p.L - p.d) / p.L}),
                name="release",
            ),
        ],
    )

    def whole(p):
        return p.L

    def short(p):
        return p.L - p.d

    def energy(length):
        return lambda t, x, p: 0.5 * (length(p) * x.om) ** 2 - p.g * length(p) * np.cos(x.th)

    known = {
        "states": {"th": (-0.8, 0.8), "om": (-1.0, 1.0)},
        "t_span": (0.0, 4.0),
        "laws": Laws(
            invariant={
                "free": {"the string is left of the peg": lambda t, x, p: p.beta - x.th},
                "wrapped": {"the string touches the peg": lambda t, x, p: x.th - p.beta},
            },
            conserved={"free": {"energy": energy(whole)}, "wrapped": {"energy": energy(short)}},
            across={
                "catch": {
                    "speed of the bob": lambda t, minus, plus, p: p.L * minus.om - (p.L - p.d) * plus.om
                },
                "release": {
                    "speed of the bob": lambda t, minus, plus, p: (p.L - p.d) * minus.om - p.L * plus.om
                },
            },
            elastic=("om",),
        ),
    }
    errors = (
        Error(
            "forgotten component in a reset",
            "the string meets the peg, and om keeps its value",
            ("catch",),
            lambda s: edge(s, "catch", reset=None),
        ),
        Error(
            "wrong coefficient",
            "the ratio of lengths at the release is inverted",
            ("release",),
            lambda s: reset(s, "release", lambda t, x, p: {"om": x.om * p.L / (p.L - p.d)}),
        ),
        Error(
            "degrees for radians",
            "beta = 15, with the unit rad",
            ("beta", "catch", "wrapped"),
            lambda s: attrs.evolve(s, parameters={**s.parameters, "beta": 15.0}),
        ),
        Error(
            "wrong sign in a field",
            "gravity points up while the string is wrapped",
            ("'wrapped'",),
            lambda s: mode(s, "wrapped", field=lambda t, x, p: (x.om, p.g / (p.L - p.d) * np.sin(x.th))),
        ),
        Error(
            "condition with the wrong sign",
            "the peg catches a string that swings back",
            ("catch",),
            lambda s: guard(s, "catch", when=lambda t, x, p: x.om < 0),
        ),
    )
    return Subject(system, known, errors)


def two_tanks() -> Subject:
    """A pump fills the upper tank; a float opens its valve to the lower tank, which leaks (Torricelli)."""

    def jet(area, level, p):
        return area * np.sqrt(2 * p.g * np.maximum(level, 0.0))

    def closed(jet):
        return lambda t, x, p: (p.pump / p.S1, -jet(p.a2, x.h2, p) / p.S2)

    def opened(jet):
        return lambda t, x, p: (
            (p.pump - jet(p.a1, x.h1, p)) / p.S1,
            (jet(p.a1, x.h1, p) - jet(p.a2, x.h2, p)) / p.S2,
        )

    system = HybridSystem(
        name="two tanks",
        state=("h1", "h2"),
        parameters={
            "pump": 4e-3, "S1": 0.5, "S2": 2.0, "a1": 3e-3, "a2": 1.5e-3, "g": 9.81, "low": 0.4, "high": 1.0,
        },
        units={
            "h1": "m", "h2": "m", "t": "s", "pump": "m^3/s", "S1": "m^2", "S2": "m^2", "a1": "m^2",
            "a2": "m^2", "g": "m/s^2", "low": "m", "high": "m",
        },
        modes=[Mode("closed", closed(jet)), Mode("open", opened(jet))],
        transitions=[
            Transition("closed", "open", Guard(lambda t, x, p: x.h1 - p.high, direction=+1), name="open up"),
            Transition("open", "closed", Guard(lambda t, x, p: x.h1 - p.low, direction=-1), name="shut"),
        ],
    )  # fmt: skip
    known = {
        "states": {"h1": (0.3, 1.1), "h2": (0.2, 1.0)},
        "t_span": (0.0, 400.0),
        "laws": Laws(
            invariant={
                "the upper tank does not overflow": lambda t, x, p: p.high - x.h1,
                "the upper tank does not run dry": lambda t, x, p: x.h1 - p.low,
            },
            balance={
                "volume": (
                    lambda t, x, p: p.S1 * x.h1 + p.S2 * x.h2,
                    lambda t, x, p: p.pump - p.a2 * np.sqrt(2 * p.g * x.h2),
                )
            },
        ),
    }

    def dry(area, level, p):
        return area * np.sqrt(2 * p.g * np.minimum(level, 0.0))

    def typed(area, level, p):
        return area * np.sqrt(2 * 9.81 * np.maximum(level, 0.0))

    errors = (
        Error(
            "swapped threshold",
            "the valve opens at the lower mark and shuts at the upper one",
            ("open up", "shut"),
            lambda s: guard(
                guard(s, "open up", function=lambda t, x, p: x.h1 - p.low),
                "shut",
                function=lambda t, x, p: x.h1 - p.high,
            ),
        ),
        Error(
            "min for max",
            "sqrt(min(h2, 0)) in the leak while the valve is closed",
            ("'closed'",),
            lambda s: mode(s, "closed", field=closed(dry)),
        ),
        Error(
            "wrong units",
            "the area a2 of the leak in m",
            ("a2",),
            lambda s: attrs.evolve(s, units={**s.units, "a2": "m"}),
        ),
        Error(
            "parameter never read",
            "9.81 for p.g, in both modes",
            ("'g'", "p.g"),
            lambda s: mode(mode(s, "open", field=opened(typed)), "closed", field=closed(typed)),
        ),
        Error(
            "wrong direction of a guard",
            "the valve shuts when the level rises through the lower mark",
            ("shut",),
            lambda s: guard(s, "shut", direction=+1),
        ),
    )
    return Subject(system, known, errors)


def block_on_belt() -> Subject:
    """A block on a spring and a belt, with dry friction: F_s = mu_s m g at rest, mu_k m g in motion."""

    def slipping(side):
        return lambda t, x, p: (x.v, (-p.k * x.x - side * p.mu_k * p.m * p.g) / p.m)

    def hold(p):
        return p.mu_s * p.m * p.g

    def slip(t, x, p):
        return x.v - p.belt

    carried = Reset(lambda t, x, p: {"v": p.belt})
    system = HybridSystem(
        name="block on a belt",
        state=("x", "v"),
        parameters={"m": 2.0, "k": 40.0, "g": 9.81, "mu_s": 0.4, "mu_k": 0.25, "belt": 0.3},
        units={"x": "m", "v": "m/s", "t": "s", "m": "kg", "k": "N/m", "g": "m/s^2", "belt": "m/s"},
        modes=[
            Mode("stick", lambda t, x, p: (p.belt, 0.0)),
            Mode("behind", slipping(-1)), Mode("ahead", slipping(+1)),
        ],
        transitions=[
            Transition("stick", "behind", Guard(lambda t, x, p: p.k * x.x - hold(p), +1), name="pulled back"),
            Transition("stick", "ahead", Guard(lambda t, x, p: p.k * x.x + hold(p), -1), name="pulled on"),
            Transition("behind", "stick", Guard(slip, +1), carried, name="caught up"),
            Transition("ahead", "stick", Guard(slip, -1), carried, name="slowed down"),
        ],
    )  # fmt: skip

    def energy(t, x, p):
        return 0.5 * p.m * x.v**2 + 0.5 * p.k * x.x**2

    known = {
        "states": {"x": (-1.0, 1.0), "v": (-2.0, 2.0)},
        "t_span": (0.0, 6.0),
        "laws": Laws(
            invariant={
                "stick": {"the belt holds the block": lambda t, x, p: p.mu_s * p.m * p.g - np.abs(p.k * x.x)},
                "behind": {"slower than the belt": lambda t, x, p: p.belt - x.v},
                "ahead": {"faster than the belt": lambda t, x, p: x.v - p.belt},
            },
            equal={"stick": {"carried by the belt": lambda t, x, p: x.v - p.belt}},
            dissipated={
                "behind": {"energy": (energy, lambda t, x, p: p.mu_k * p.m * p.g * p.belt)},
                "ahead": {"energy": (energy, lambda t, x, p: -p.mu_k * p.m * p.g * p.belt)},
            },
        ),
    }
    errors = (
        Error(
            "friction with the wrong sign",
            "friction drives a block ahead of the belt",
            ("'ahead'",),
            lambda s: mode(s, "ahead", field=slipping(-1)),
        ),
        Error(
            "wrong target mode",
            "a block that is pulled on slips behind the belt",
            ("pulled on",),
            lambda s: edge(s, "pulled on", target="behind"),
        ),
        Error(
            "mode that cannot be left",
            "the block breaks loose where the pull of the spring falls",
            ("pulled back", "'stick'"),
            lambda s: guard(s, "pulled back", direction=-1),
        ),
        Error(
            "factor or square missing in a force",
            "the friction of a block behind the belt lacks the mass",
            ("'behind'",),
            lambda s: mode(s, "behind", field=lambda t, x, p: (x.v, (-p.k * x.x + p.mu_k * p.g) / p.m)),
        ),
        Error(
            "swapped threshold",
            "pulled back at -F_s, pulled on at +F_s",
            ("pulled back", "pulled on"),
            lambda s: guard(
                guard(s, "pulled back", function=lambda t, x, p: p.k * x.x + hold(p)),
                "pulled on",
                function=lambda t, x, p: p.k * x.x - hold(p),
            ),
        ),
    )
    return Subject(system, known, errors)


delta = 0.05  # the number that one of the errors reads


def pendulum_between_walls() -> Subject:
    """An inverted pendulum on a shaken base, between two walls at the angles -alpha and alpha."""

    def field(t, x, p):
        return x.om, np.sin(x.th) - 2 * p.delta * x.om + p.gamma * np.cos(p.w * t)

    hit = Reset(lambda t, x, p: {"om": -p.r * x.om})
    system = HybridSystem(
        name="inverted pendulum between walls",
        state=("th", "om"),
        parameters={"delta": 0.05, "gamma": 1.5, "w": 3.0, "alpha": 0.4, "r": 0.9},
        modes=[Mode("swing", field)],
        transitions=[
            Transition("swing", "swing", Guard(lambda t, x, p: x.th - p.alpha, +1), hit, name="right wall"),
            Transition("swing", "swing", Guard(lambda t, x, p: x.th + p.alpha, -1), hit, name="left wall"),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )  # fmt: skip
    known = {
        "states": {"th": (-0.4, 0.4), "om": (-1.0, 1.0)},
        "parameters": {"r": (0.7, 1.0)},
        "laws": Laws(
            invariant={"between the walls": lambda t, x, p: p.alpha - np.abs(x.th)},
            dissipated={
                "energy": (
                    lambda t, x, p: 0.5 * x.om**2 + np.cos(x.th),
                    lambda t, x, p: p.gamma * np.cos(p.w * t) * x.om,
                )
            },
        ),
    }
    errors = (
        Error(
            "half the period", "pi / w", ("period",), lambda s: attrs.evolve(s, period=lambda p: np.pi / p.w)
        ),
        Error(
            "wrong sign in a reset",
            "om becomes +r om at the right wall",
            ("right wall",),
            lambda s: reset(s, "right wall", lambda t, x, p: {"om": p.r * x.om}),
        ),
        Error(
            "global under a parameter's name",
            "delta of the module for p.delta",
            ("delta",),
            lambda s: mode(
                s,
                "swing",
                field=lambda t, x, p: (x.om, np.sin(x.th) - 2 * delta * x.om + p.gamma * np.cos(p.w * t)),
            ),
        ),
        Error(
            "slip in a Jacobian",
            "the derivative of sin is taken as sin",
            ("jacobian", "Jacobian"),
            lambda s: mode(s, "swing", jacobian=lambda t, x, p: ((0.0, 1.0), (np.sin(x.th), -2 * p.delta))),
        ),
        Error(
            "reset beyond its own guard",
            "the right wall sets th to alpha + 0.001, to keep it off the wall",
            ("right wall",),
            lambda s: reset(s, "right wall", lambda t, x, p: {"th": p.alpha + 1e-3, "om": -p.r * x.om}),
        ),
    )
    return Subject(system, known, errors)


def thermostat() -> Subject:
    """A room with a radiator that a thermostat switches, while the weather changes with the time of day."""

    def heat_flow(power):
        def field(t, x, p):
            outside = p.mean + p.swing * np.sin(2 * np.pi * t / p.day)
            given = p.U * (x.R - x.T)
            return (power(p) - given) / p.c, (given - p.G * (x.T - outside)) / p.C

        return field

    def net(power):
        return lambda t, x, p: power(p) - p.G * (x.T - p.mean - p.swing * np.sin(2 * np.pi * t / p.day))

    def heat(t, x, p):
        return p.c * x.R + p.C * x.T

    system = HybridSystem(
        name="thermostat",
        state=("R", "T"),
        parameters={
            "P": 6.0, "c": 0.3, "C": 4.0, "U": 0.15, "G": 0.1, "low": 19.0, "high": 21.0, "mean": 5.0,
            "swing": 5.0, "day": 24.0,
        },
        units={
            "R": "degC", "T": "degC", "t": "h", "P": "kW", "c": "kW*h/K", "C": "kW*h/K", "U": "kW/K",
            "G": "kW/K", "low": "degC", "high": "degC", "mean": "degC", "swing": "K", "day": "h",
        },
        modes=[Mode("off", heat_flow(lambda p: 0.0)), Mode("on", heat_flow(lambda p: p.P))],
        transitions=[
            Transition("off", "on", Guard(lambda t, x, p: x.T - p.low, direction=-1), name="switch on"),
            Transition("on", "off", Guard(lambda t, x, p: x.T - p.high, direction=+1), name="switch off"),
        ],
        period=lambda p: p.day,
    )  # fmt: skip
    known = {
        "states": {"R": (20.0, 40.0), "T": (18.0, 22.0)},
        "parameters": {"low": (18.5, 19.5), "high": (20.5, 21.5)},
        "laws": Laws(
            balance={
                "off": {"heat": (heat, net(lambda p: 0.0))},
                "on": {"heat": (heat, net(lambda p: p.P))},
            }
        ),
    }
    errors = (
        Error(
            "relay that throws the state back at once",
            "on below the upper mark, off above the lower mark",
            ("switch on", "switch off"),
            lambda s: guard(
                guard(s, "switch on", function=lambda t, x, p: x.T - p.high),
                "switch off",
                function=lambda t, x, p: x.T - p.low,
            ),
        ),
        Error(
            "twice the period", "2 p.day", ("period",), lambda s: attrs.evolve(s, period=lambda p: 2 * p.day)
        ),
        Error(
            "parameter never read",
            "19.0 for p.low in the guard",
            ("low",),
            lambda s: guard(s, "switch on", function=lambda t, x, p: x.T - 19.0),
        ),
        Error(
            "wrong units",
            "the conductance G in kW",
            ("'G'", "p.G", " G "),
            lambda s: attrs.evolve(s, units={**s.units, "G": "kW"}),
        ),
        Error(
            "mode that cannot be left",
            "the heating is switched off where the temperature falls",
            ("switch off", "'on'"),
            lambda s: guard(s, "switch off", direction=-1),
        ),
    )
    return Subject(system, known, errors)


FIRST = (pendulum_with_peg, two_tanks, block_on_belt, pendulum_between_walls, thermostat)
