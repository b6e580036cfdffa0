"""Systems, their parts, and systems made from others: valid calls, and what each argument must refuse."""

import math

import numpy as np

import hybrid
from hybrid import After, At, Delay, Every, Guard, HybridSystem, Mode, Reset, Transition
from tests.hybrid.arguments.values import (
    ANGLES,
    BALL,
    COUNT,
    FLAG,
    FUNCTION,
    GUARD,
    LIMIT,
    LIST,
    NAME,
    NUMBERS,
    OUTPUTS,
    QUANTITY,
    SYSTEM,
    TEXT,
    UNITS,
    Odd,
    call,
)

BAD_STATES = [
    None, "qv", 0, -1, 1.5, True, (), ("1q",), (1, 2), math.nan, 2**70,
    [["q", "v"], ["w"]], np.array(["q"])[:, None],
]  # fmt: skip
# Plain numbers have neither.
DATED = {"unit": [3, True, "h", Odd()], "origin": [3, True, "2024-01-31", Odd()]}
COLUMNS = [3, "a", [1.0], {"a": [1.0]}, {"a": 1.0}, Odd()]
REPEATS = [None, "a", 3, [3], ["a"], [None], {"cell": 3}, Odd()]
CYCLIC = [None, "q", 3, True, (3,), ("nope",), [["q"]], Odd()]
MEMORY = [None, "u", 1, True, ("1u",), ("u", "u"), (1,), {"u"}, [["u"]], Odd()]


PARAMETERS = [[1], "a", 3, {"e": "1"}, {"e": math.nan}, {"e": True}, {"1": 1.0}, {3: 1.0}]
# Coefficients of contacts.
COEFFICIENT = [None, -0.1, 2.0, True, math.nan, math.inf, "", [0.5], Odd()]

# Names that an author gives to modes; the first system that takes them has one switch, that of abs(q).
CALLED = [
    *LIST[2:4], True, Odd(), {"a": 3}, {"a": None}, {3: "q<0"}, {"": "q<0"}, {"a": lambda t, x, p: x.q},
    {"a": lambda t, x, p: x.q < 0.5}, {"a": lambda t, x, p: x.nope < 0}, {"a": "q<1"}, {"a": ""},
]  # fmt: skip


def systems():
    return [
        (call(hybrid.compile_system, BALL), {"system": SYSTEM}),
        (call(hybrid.split, BALL), {"system": SYSTEM, "modes": CALLED}),
        (
            call(hybrid.Table, [0.0, 1.0], [2.0, 3.0]),
            {
                "x": [*NUMBERS, [0.0], [1.0, 0.0], [0.0, 0.0], [0.0, math.inf], [[0.0, 1.0]]],
                "y": [*NUMBERS, [2.0], [2.0, math.nan], [[2.0, 3.0]]],
                "kind": [None, 3, "spline", ["linear"], Odd()],
                **DATED,
            },
        ),
        (call(hybrid.Table.__call__, hybrid.Table([0.0, 1.0], [2.0, 3.0]), 0.5), {"u": NUMBERS}),
        (
            call(hybrid.from_equations, lambda t, x, p: (x.v, -np.abs(x.q)), state=("q", "v")),
            {
                "field": [None, *FUNCTION],
                "state": [*BAD_STATES, {"q", "v"}, Odd()],
                "parameters": PARAMETERS,
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
                "angles": ANGLES,
                "cyclic": CYCLIC,
                "modes": CALLED,
                "repeats": REPEATS,
                "outputs": OUTPUTS,
                "laws": [*FUNCTION, {}, Odd()],
            },
        ),
        (
            call(
                hybrid.filippov,
                ("q", "v"),
                {"e": 1.0},
                lambda t, x, p: (x.v, 1.0),
                lambda t, x, p: (x.v, -1.0),
                lambda t, x, p: x.q,
            ),
            {
                "state": [None, "qv", 0, -1, 1.5, True, (), ("1q",), (1, 2), {"q", "v"}, math.nan, Odd()],
                "parameters": PARAMETERS,
                "below": [None, *FUNCTION],
                "above": [None, *FUNCTION],
                "switching": [None, *FUNCTION],
                "start": NAME,
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
                "angles": ANGLES,
                "cyclic": CYCLIC,
                "outputs": OUTPUTS,
                "laws": [*FUNCTION, {}, Odd()],
            },
        ),
        (
            call(
                HybridSystem, state=("q",), parameters={"e": 1.0}, modes=[Mode("a", lambda t, x, p: (1.0,))]
            ),
            {
                "state": [
                    None,
                    "q",
                    0,
                    -1,
                    1.5,
                    True,
                    (),
                    ("1q",),
                    (1,),
                    {"q"},
                    {"q": 1},
                    math.nan,
                    [["q"]],
                    Odd(),
                ],
                "parameters": [*PARAMETERS, {"e": 1j}],
                "held": MEMORY,
                "counters": MEMORY,
                "modes": [*LIST, [], [1], ["a"]],
                "transitions": [*LIST, [1], ["a"]],
                "listed_order": FLAG,
                "start": NAME,
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
                "angles": ANGLES,
                "cyclic": CYCLIC,
                "outputs": OUTPUTS,
                "laws": [None, *FUNCTION, {}, Odd()],
                "notes": [None, "a", 3, [1], [None], Odd()],
                "under_way": [None, "a", 3, [1], [None], ["a"], Odd()],
                "growth": [*FUNCTION, {}, HybridSystem, BALL, Odd()],
                "derived_from": [None, *FUNCTION, {}, HybridSystem, BALL, Odd()],
                "repeats": REPEATS,
            },
        ),
        (
            call(
                hybrid.repeat,
                "cell",
                2,
                state=("u",),
                field=lambda t, x, p, i: (1.0,),
                transitions=[
                    Transition("run", "run", Guard(lambda t, x, p, i: x.cell[i].u - 1.0), name="fire")
                ],
            ),
            {
                "name": [None, *TEXT, "", "1a", "a b"],
                "count": [0, *COUNT],
                "state": [*BAD_STATES[:6], ("1q",), (1, 2)],
                "held": [None, 1, True, ("1u",), (1,), [["u"]], Odd()],
                "counters": [None, 1, True, ("1u",), (1,), [["u"]], Odd()],
                "parameters": [[1], "a", 3, {"e": "1"}, {"e": math.nan}, {"e": [1.0]}, {"e": True}, {3: 1.0}],
                "field": [None, 3, "a", {"run": 3}, lambda t, x, p: (1.0,), Odd()],
                "transitions": [*LIST, [1], ["a"]],
                "units": [3, "a", {"nope": "m"}, Odd()],
                "angles": [3, "a", {"nope": 1.0}, Odd()],
                "outputs": [3, "a", {"a": 3}, {3: abs}, Odd()],
                "laws": [*FUNCTION, {}, Odd()],
            },
        ),
        (
            call(Mode, "a", lambda t, x, p: (1.0,)),
            {
                "name": [*TEXT, ""],
                "field": [None, *FUNCTION],
                "jacobian": FUNCTION,
                "holds": FUNCTION,
                "part_of": [*TEXT[1:], ""],
            },
        ),
        (
            call(hybrid.Contact, "floor", lambda t, x, p: x.q, slip=lambda t, x, p: x.v),
            {
                "name": [*TEXT, "", "a, b", "a+b"],
                "gap": [None, *FUNCTION],
                "restitution": COEFFICIENT,
                "friction": [each for each in COEFFICIENT if each != 2.0],
                "slip": FUNCTION,
                "static": [each for each in COEFFICIENT[1:] if each != 2.0],
            },
        ),
        (
            call(
                hybrid.mechanics,
                coordinates=("q",),
                velocities=("v",),
                parameters={"e": 0.5},
                mass=lambda t, x, p: (1.0,),
                forces=lambda t, x, p: (-1.0,),
                contacts=[hybrid.Contact("floor", lambda t, x, p: x.q)],
            ),
            {
                "coordinates": [None, 3, (), ("1q",), (1,), ("q", "r"), Odd()],
                "velocities": [None, 3, (), ("1q",), (1,), Odd()],
                "parameters": PARAMETERS,
                "contacts": [*LIST, [], [1], ["a"]],
                "mass": [None, *FUNCTION, lambda t, x, p: (1.0, 2.0), lambda t, x, p: (-1.0,)],
                "forces": [*FUNCTION, lambda t, x, p: (1.0, 2.0)],
                "kinetic": [*FUNCTION, lambda t, x, p: x.v**2],
                "potential": [*FUNCTION, lambda t, x, p: x.q],
                "impacts": [None, 3, "hertz", Odd()],
                "together": [each for each in QUANTITY if not callable(each)],
                "start": NAME,
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
                "angles": ANGLES,
                "cyclic": CYCLIC,
                "outputs": OUTPUTS,
                "laws": [*FUNCTION, {}, Odd()],
            },
        ),
        (
            call(hybrid.Pair, "diode", lambda t, x, z, p: x.q),
            {
                "name": [None, 3, "", "1q", "a b", "free", Odd()],
                "w": [None, *FUNCTION],
                "says": [None, 3, True, "a+b", Odd()],
            },
        ),
        (
            call(
                hybrid.complementarity,
                state=("q",),
                rates=lambda t, x, z, p: (z.diode - p.e,),
                pairs=[hybrid.Pair("diode", lambda t, x, z, p: x.q)],
                parameters={"e": 0.5},
            ),
            {
                "state": [*BAD_STATES, {"q", "v"}, Odd()],
                "rates": [None, *FUNCTION, lambda t, x, z, p: (1.0, 2.0)],
                "pairs": [*LIST, [], [1], ["a"]],
                "parameters": PARAMETERS,
                "modes": CALLED,
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
                "angles": ANGLES,
                "outputs": OUTPUTS,
                "laws": [*FUNCTION, {}, Odd()],
            },
        ),
        (
            call(Guard, lambda t, x, p: x.q),
            {
                "function": [None, *FUNCTION],
                "direction": [None, "up", 2, 0.5, True, False, math.nan, [1], 1j],
                "at_start": FLAG,
                "gradient": FUNCTION,
                "when": FUNCTION,
            },
        ),
        (call(Every, 1.0), {"period": QUANTITY, "offset": [*QUANTITY[:-2], math.inf], "when": FUNCTION}),
        (
            call(At, [1.0, 2.0]),
            {"times": [*QUANTITY[:-2], [], [math.nan]], "when": FUNCTION, "columns": COLUMNS, **DATED},
        ),
        (call(After, 1.0), {"duration": QUANTITY, "when": FUNCTION, "restarts": FLAG}),
        (
            call(Delay, "a", 1.0),
            {
                "trigger": [None, 3, [], [1], [None], "", Odd()],
                "duration": [each for each in QUANTITY if each != 0.0],
                "places": [None, "a", 0, -1, 1.5, 101, math.nan, Odd()],
                "when": FUNCTION,
            },
        ),
        (call(Reset, lambda t, x, p: x), {"function": [None, *FUNCTION], "jacobian": FUNCTION}),
        (
            call(Transition, "a", "a", Guard(lambda t, x, p: x.q)),
            {
                "source": [*TEXT, ""],
                "target": [*TEXT[1:], ""],
                "guard": [*GUARD, 3],
                "reset": ["a", 3, lambda t, x, p: x],
                "accumulates_to": [*TEXT[1:], ""],
                "name": [*TEXT, ""],
                "part_of": [*TEXT[1:], ""],
            },
        ),
    ]
