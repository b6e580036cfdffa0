"""Right models with what their authors know of them, and errors that people make in them: the other five."""

from __future__ import annotations

import attrs
import numpy as np

from benchmarks.contract_models import Error, Subject, edge, guard, mode, reset
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def without(system: HybridSystem, name: str) -> HybridSystem:
    """The system without one transition."""
    return attrs.evolve(system, transitions=[each for each in system.transitions if each.name != name])


def ball_on_slope() -> Subject:
    """A ball bounces down a smooth slope, comes to slide on it, and falls off its edge at s = l."""

    def along(p):
        return p.g * np.sin(np.radians(p.alpha))

    def across(p):
        return p.g * np.cos(np.radians(p.alpha))

    def falling(t, x, p):
        return x.u, x.w, along(p), -across(p)

    system = HybridSystem(
        name="ball on a slope",
        state=("s", "n", "u", "w"),
        parameters={"g": 9.81, "alpha": 12.0, "e": 0.5, "l": 6.0},
        units={"s": "m", "n": "m", "u": "m/s", "w": "m/s", "t": "s", "g": "m/s^2", "alpha": "deg", "l": "m"},
        start="flight",
        modes=[
            Mode("flight", falling),
            Mode("slide", lambda t, x, p: (x.u, 0.0, along(p), 0.0)),
            Mode("fall", falling),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.n, direction=-1),
                Reset(lambda t, x, p: {"n": 0.0, "w": -p.e * x.w}),
                name="bounce",
                accumulates_to="slide",
            ),
            Transition("flight", "fall", Guard(lambda t, x, p: x.s - p.l, direction=+1), name="fly off"),
            Transition("slide", "fall", Guard(lambda t, x, p: x.s - p.l, direction=+1), name="slide off"),
        ],
    )

    def energy(t, x, p):
        slope = np.radians(p.alpha)
        return 0.5 * (x.u**2 + x.w**2) + p.g * (x.n * np.cos(slope) - x.s * np.sin(slope))

    known = {
        "states": {"s": (0.0, 2.0), "n": (0.0, 1.0), "u": (-1.0, 1.0), "w": (-1.0, 1.0)},
        "t_span": (0.0, 4.0),
        "laws": Laws(
            invariant={"flight": {"above the slope": lambda t, x, p: x.n}},
            equal={
                "slide": {
                    "on the slope": lambda t, x, p: x.n,
                    "stays on the slope": lambda t, x, p: x.w,
                }
            },
            dissipated={"energy": energy},
            across={
                "bounce": {"keeps its speed along the slope": lambda t, minus, plus, p: plus.u - minus.u}
            },
        ),
    }
    errors = (
        Error(
            "wrong limit mode of a chatter",
            "the bounces accumulate to 'fall'",
            ("bounce", "'fall'"),
            lambda s: edge(s, "bounce", accumulates_to="fall"),
        ),
        Error(
            "degrees for radians",
            "sin(alpha) of the degrees in the sliding mode",
            ("'slide'",),
            lambda s: mode(s, "slide", field=lambda t, x, p: (x.u, 0.0, p.g * np.sin(p.alpha), 0.0)),
        ),
        Error(
            "wrong sign in a reset",
            "w becomes +e w",
            ("bounce",),
            lambda s: reset(s, "bounce", lambda t, x, p: {"n": 0.0, "w": p.e * x.w}),
        ),
        Error(
            "forgotten component in a reset",
            "the reset returns 0 for the speed along the slope",
            ("bounce",),
            lambda s: reset(s, "bounce", lambda t, x, p: (x.s, 0.0, 0.0, -p.e * x.w)),
        ),
        Error(
            "wrong target mode",
            "a ball that slides off the edge is in 'flight'",
            ("slide off",),
            lambda s: edge(s, "slide off", target="flight"),
        ),
    )
    return Subject(system, known, errors)


L = 2e-4  # the number that one of the errors reads


def boost_converter() -> Subject:
    """A boost converter: a clock closes the switch, the current I_max opens it; a diode blocks."""

    def clock(t, x, p):
        return np.sin(2 * np.pi * t / p.T)

    stop = Reset(lambda t, x, p: {"i": 0.0})
    system = HybridSystem(
        name="boost converter",
        state=("i", "v"),
        parameters={"E": 10.0, "L": 2e-4, "C": 12e-6, "R": 20.0, "I_max": 1.0, "T": 1e-4},
        units={
            "i": "A", "v": "V", "t": "s", "E": "V", "L": "H", "C": "F", "R": "Ohm", "I_max": "A", "T": "s",
        },
        modes=[
            Mode("closed", lambda t, x, p: (p.E / p.L, -x.v / (p.R * p.C))),
            Mode("open", lambda t, x, p: ((p.E - x.v) / p.L, (x.i - x.v / p.R) / p.C)),
            Mode("blocked", lambda t, x, p: (0.0, -x.v / (p.R * p.C))),
        ],
        transitions=[
            Transition("closed", "open", Guard(lambda t, x, p: x.i - p.I_max, +1), name="peak"),
            # A marker: without it a switch that opens in the first half of a period would close at once.
            Transition("closed", "closed", Guard(clock, +1), name="idle tick"),
            Transition("open", "closed", Guard(clock, +1), name="tick"),
            Transition("open", "blocked", Guard(lambda t, x, p: x.i, -1), stop, name="block"),
            Transition("blocked", "closed", Guard(clock, +1), name="next tick"),
            Transition("blocked", "open", Guard(lambda t, x, p: x.v - p.E, -1), name="conduct"),
        ],
        period=lambda p: p.T,
    )  # fmt: skip
    known = {
        "states": {"i": (0.0, 1.0), "v": (8.0, 25.0)},
        "t_span": (0.0, 5e-4),
        "laws": Laws(
            invariant={
                "closed": {"the current is below its limit": lambda t, x, p: p.I_max - x.i},
                "open": {"no reverse current": lambda t, x, p: x.i},
                "blocked": {"reverse voltage": lambda t, x, p: x.v - p.E},
            },
            equal={"blocked": {"no current": lambda t, x, p: x.i}},
            balance={
                "energy": (
                    lambda t, x, p: 0.5 * p.L * x.i**2 + 0.5 * p.C * x.v**2,
                    lambda t, x, p: p.E * x.i - x.v**2 / p.R,
                )
            },
        ),
    }
    errors = (
        Error(
            "slip in a Jacobian",
            "the sign of 1 / L in the open mode",
            ("jacobian", "Jacobian"),
            lambda s: mode(s, "open", jacobian=lambda t, x, p: ((0.0, 1 / p.L), (1 / p.C, -1 / (p.R * p.C)))),
        ),
        Error(
            "global under a parameter's name",
            "L of the module for p.L in the closed mode",
            ("'L'", "p.L", "'closed'"),
            lambda s: mode(s, "closed", field=lambda t, x, p: (p.E / L, -x.v / (p.R * p.C))),
        ),
        Error(
            "wrong direction of a guard",
            "the switch opens where the current falls through I_max",
            ("peak",),
            lambda s: guard(s, "peak", direction=-1),
        ),
        Error(
            "mode that cannot be left",
            "the diode never conducts again: the clock alone ends the blocked mode",
            ("'blocked'",),
            lambda s: without(s, "conduct"),
        ),
        Error(
            "wrong sign in a field",
            "E + v drives the current while the switch is open",
            ("'open'",),
            lambda s: mode(s, "open", field=lambda t, x, p: ((p.E + x.v) / p.L, (x.i - x.v / p.R) / p.C)),
        ),
    )
    return Subject(system, known, errors)


def two_carts() -> Subject:
    """Two carts on springs collide: they bounce, or a latch joins them for ever if they meet slowly."""

    def common(x, p):
        return (p.m1 * x.v1 + p.m2 * x.v2) / (p.m1 + p.m2)

    def bounce(t, x, p):
        kick = (1 + p.e) * p.m1 * p.m2 / (p.m1 + p.m2) * (x.v1 - x.v2)
        return {"v1": x.v1 - kick / p.m1, "v2": x.v2 + kick / p.m2}

    def joined(t, x, p):
        a = -(p.k1 * x.x1 + p.k2 * x.x2) / (p.m1 + p.m2)
        return x.v1, a, x.v2, a

    def gap(t, x, p):
        return x.x2 - x.x1

    system = HybridSystem(
        name="two carts",
        state=("x1", "v1", "x2", "v2"),
        parameters={"m1": 1.0, "m2": 2.5, "k1": 4.0, "k2": 7.0, "e": 0.7, "slow": 0.4},
        units={
            "x1": "m", "v1": "m/s", "x2": "m", "v2": "m/s", "t": "s", "m1": "kg", "m2": "kg",
            "k1": "N/m", "k2": "N/m", "slow": "m/s",
        },
        start="apart",
        modes=[
            Mode("apart", lambda t, x, p: (x.v1, -p.k1 * x.x1 / p.m1, x.v2, -p.k2 * x.x2 / p.m2)),
            Mode("latched", joined),
        ],
        transitions=[
            Transition(
                "apart",
                "apart",
                Guard(gap, direction=-1, when=lambda t, x, p: x.v1 - x.v2 > p.slow),
                Reset(bounce),
                name="bounce",
            ),
            Transition(
                "apart",
                "latched",
                Guard(gap, direction=-1, when=lambda t, x, p: x.v1 - x.v2 <= p.slow),
                Reset(lambda t, x, p: {"x2": x.x1, "v1": common(x, p), "v2": common(x, p)}),
                name="latch",
            ),
        ],
    )  # fmt: skip

    def momentum(t, minus, plus, p):
        return p.m1 * (plus.v1 - minus.v1) + p.m2 * (plus.v2 - minus.v2)

    def energy(t, x, p):
        return 0.5 * (p.m1 * x.v1**2 + p.m2 * x.v2**2 + p.k1 * x.x1**2 + p.k2 * x.x2**2)

    known = {
        "states": {"x1": (-1.0, 1.0), "x2": (-1.0, 1.0)},
        "t_span": (0.0, 8.0),
        "laws": Laws(
            invariant={"apart": {"cart 1 is left of cart 2": lambda t, x, p: x.x2 - x.x1}},
            equal={
                "latched": {
                    "the carts touch": lambda t, x, p: x.x1 - x.x2,
                    "the carts move together": lambda t, x, p: x.v1 - x.v2,
                }
            },
            dissipated={"energy": energy},
            across={
                "bounce": {
                    "momentum": momentum,
                    "restitution": lambda t, minus, plus, p: plus.v2 - plus.v1 - p.e * (minus.v1 - minus.v2),
                },
                "latch": {"momentum": momentum},
            },
        ),
    }

    def inverted(t, x, p):
        kick = (1 + p.e) * p.m1 * p.m2 / (p.m1 + p.m2) * (x.v1 - x.v2)
        return {"v1": x.v1 - kick / p.m2, "v2": x.v2 + kick / p.m1}

    def typed(t, x, p):
        kick = (1 + 0.7) * p.m1 * p.m2 / (p.m1 + p.m2) * (x.v1 - x.v2)
        return {"v1": x.v1 - kick / p.m1, "v2": x.v2 + kick / p.m2}

    errors = (
        Error(
            "wrong coefficient",
            "the masses change places in the bounce",
            ("bounce",),
            lambda s: reset(s, "bounce", inverted),
        ),
        Error(
            "condition with the wrong sign",
            "the latch closes if the carts meet fast",
            ("latch",),
            lambda s: guard(s, "latch", when=lambda t, x, p: x.v1 - x.v2 >= p.slow),
        ),
        Error(
            "forgotten component in a reset",
            "the latch changes v1 alone",
            ("latch",),
            lambda s: reset(s, "latch", lambda t, x, p: {"x2": x.x1, "v1": common(x, p)}),
        ),
        Error(
            "parameter never read",
            "0.7 for p.e in the bounce",
            ("'e'", "p.e", "restitution"),
            lambda s: reset(s, "bounce", typed),
        ),
        Error(
            "wrong target mode",
            "the latch leads to 'apart'",
            ("latch",),
            lambda s: edge(s, "latch", target="apart"),
        ),
    )
    return Subject(system, known, errors)


def gear_pair() -> Subject:
    """A gear pair with backlash: its teeth touch on either flank, by Hertz's law, beyond q = b and q = -b."""

    def drive(t, p):
        return p.F + p.A * np.cos(p.w * t)

    def right(t, x, p):
        return x.v, (drive(t, p) - p.c * x.v - p.k * np.maximum(x.q - p.b, 0.0) ** 1.5) / p.m

    def left(t, x, p):
        return x.v, (drive(t, p) - p.c * x.v + p.k * np.maximum(-p.b - x.q, 0.0) ** 1.5) / p.m

    system = HybridSystem(
        name="gear pair",
        state=("q", "v"),
        parameters={"m": 1.0, "c": 0.1, "k": 30.0, "b": 0.5, "F": 0.2, "A": 1.0, "w": 1.3},
        modes=[
            Mode("left", left),
            Mode("free", lambda t, x, p: (x.v, (drive(t, p) - p.c * x.v) / p.m)),
            Mode("right", right),
        ],
        transitions=[
            Transition("free", "right", Guard(lambda t, x, p: x.q - p.b, +1), name="touch right"),
            Transition("right", "free", Guard(lambda t, x, p: x.q - p.b, -1), name="leave right"),
            Transition("free", "left", Guard(lambda t, x, p: x.q + p.b, -1), name="touch left"),
            Transition("left", "free", Guard(lambda t, x, p: x.q + p.b, +1), name="leave left"),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )

    def energy(t, x, p):
        return 0.5 * p.m * x.v**2 + 0.4 * p.k * np.maximum(np.abs(x.q) - p.b, 0.0) ** 2.5

    known = {
        "states": {"q": (-1.0, 1.0), "v": (-2.0, 2.0)},
        "laws": Laws(
            invariant={
                "free": {"the teeth are apart": lambda t, x, p: p.b - np.abs(x.q)},
                "right": {"the right flanks touch": lambda t, x, p: x.q - p.b},
                "left": {"the left flanks touch": lambda t, x, p: -p.b - x.q},
            },
            dissipated={"energy": (energy, lambda t, x, p: (p.F + p.A * np.cos(p.w * t)) * x.v)},
            continuous=("touch right", "leave right", "touch left", "leave left"),
        ),
    }

    def with_force(s, side, force):
        return mode(s, side, field=lambda t, x, p: (x.v, (drive(t, p) - p.c * x.v + force(x, p)) / p.m))

    def damped_in_contact(t, x, p):
        return x.v, (drive(t, p) - 5 * p.c * x.v - p.k * np.maximum(x.q - p.b, 0.0) ** 1.5) / p.m

    errors = (
        Error(
            "contact force that jumps",
            "k q^1.5 on the right flank, without the backlash",
            ("'right'", "touch right", "leave right"),
            lambda s: with_force(s, "right", lambda x, p: -p.k * np.maximum(x.q, 0.0) ** 1.5),
        ),
        Error(
            "contact force that jumps",
            "the damper is five times as strong on the right flank",
            ("touch right", "leave right"),
            lambda s: mode(s, "right", field=damped_in_contact),
        ),
        Error(
            "min for max",
            "min(-b - q, 0) on the left flank",
            ("'left'", "touch left", "leave left"),
            lambda s: with_force(s, "left", lambda x, p: p.k * np.minimum(-p.b - x.q, 0.0) ** 1.5),
        ),
        Error(
            "factor or square missing in a force",
            "k (q - b) on the right flank, without the power 1.5",
            ("'right'",),
            lambda s: with_force(s, "right", lambda x, p: -p.k * np.maximum(x.q - p.b, 0.0)),
        ),
        Error(
            "friction with the wrong sign",
            "the damper drives on the free way",
            ("'free'",),
            lambda s: mode(s, "free", field=lambda t, x, p: (x.v, (drive(t, p) + p.c * x.v) / p.m)),
        ),
    )
    return Subject(system, known, errors)


def sinai_billiard() -> Subject:
    """A particle in a square box with a round scatterer in its middle (Sinai)."""

    def flipped(name):
        return Reset(lambda t, x, p: {name: -getattr(x, name)})

    def reflected(t, x, p):
        along = (x.x * x.u + x.y * x.v) / p.r**2
        return {"u": x.u - 2 * along * x.x, "v": x.v - 2 * along * x.y}

    def wall(name, function, direction, component):
        return Transition("move", "move", Guard(function, direction), flipped(component), name=name)

    system = HybridSystem(
        name="Sinai's billiard",
        state=("x", "y", "u", "v"),
        parameters={"a": 1.0, "r": 0.4},
        modes=[Mode("move", lambda t, x, p: (x.u, x.v, 0.0, 0.0))],
        transitions=[
            wall("right wall", lambda t, x, p: x.x - p.a, +1, "u"),
            wall("left wall", lambda t, x, p: x.x + p.a, -1, "u"),
            wall("upper wall", lambda t, x, p: x.y - p.a, +1, "v"),
            wall("lower wall", lambda t, x, p: x.y + p.a, -1, "v"),
            Transition(
                "move",
                "move",
                Guard(lambda t, x, p: x.x**2 + x.y**2 - p.r**2, direction=-1),
                Reset(reflected),
                name="disc",
            ),
        ],
    )
    known = {
        "states": {"x": (-1.0, 1.0), "y": (-1.0, 1.0)},
        "t_span": (0.0, 5.0),
        "laws": Laws(
            invariant={
                "in the box": lambda t, x, p: p.a - np.maximum(np.abs(x.x), np.abs(x.y)),
                "outside the disc": lambda t, x, p: np.hypot(x.x, x.y) - p.r,
            },
            conserved={"speed": lambda t, x, p: np.hypot(x.u, x.v)},
            elastic=("u", "v"),
        ),
    }

    def once(t, x, p):
        along = (x.x * x.u + x.y * x.v) / p.r**2
        return {"u": x.u - along * x.x, "v": x.v - along * x.y}

    def no_unit(t, x, p):
        along = (x.x * x.u + x.y * x.v) / p.r
        return {"u": x.u - 2 * along * x.x, "v": x.v - 2 * along * x.y}

    errors = (
        Error(
            "wrong coefficient",
            "the disc takes the normal speed once, not twice",
            ("disc",),
            lambda s: reset(s, "disc", once),
        ),
        Error(
            "factor or square missing in a force",
            "r for r^2 in the reflection at the disc",
            ("disc",),
            lambda s: reset(s, "disc", no_unit),
        ),
        Error(
            "wrong direction of a guard",
            "the disc reflects what comes out of it",
            ("disc",),
            lambda s: guard(s, "disc", direction=+1),
        ),
        Error(
            "wrong sign in a reset",
            "the upper wall leaves v as it is",
            ("upper wall",),
            lambda s: reset(s, "upper wall", lambda t, x, p: {"v": x.v}),
        ),
        Error(
            "swapped threshold",
            "the left wall at +a",
            ("left wall",),
            lambda s: guard(s, "left wall", function=lambda t, x, p: x.x - p.a),
        ),
    )
    return Subject(system, known, errors)


SECOND = (ball_on_slope, boost_converter, two_carts, gear_pair, sinai_billiard)
