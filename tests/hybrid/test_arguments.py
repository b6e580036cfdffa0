"""Invalid values for every argument of every public function: the error names the argument.

The table is checked against the signatures, so that a new argument without an entry fails.
"""

import inspect
import math
from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np
import pytest

import hybrid
import hybrid.plot
import hybrid.testing
import lyapunov
import lyapunov.plot
import lyapunov.study.regimes
import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.errors import HybridError
from models import contact
from models.dry_friction_oscillator import den_hartog_amplitude
from models.one_impact import one_impact_orbits
from models.vibroimpact import hertz_stiffness

BALL, OSCILLATOR = models.bouncing_ball(), models.impact_oscillator()
PERIOD = OSCILLATOR.forcing_period()


class Odd:
    """An object that no function accepts."""

    def __repr__(self):
        return "<odd>"


TEXTS = ["a", "1", b"1"]
NO_NUMBERS = [*TEXTS, True, np.bool_(True), 1j, np.array([1.0, 2.0]), np.array([None, "a"]), [1.0], Odd(), {}]
INFINITE = [math.nan, math.inf, -math.inf, 10**400]
NUMBER = [None, *NO_NUMBERS, *INFINITE]
OPTIONAL_NUMBER = NUMBER[1:]
POSITIVE = [*NUMBER, 0.0, -1.0, -1e300]
OPTIONAL_POSITIVE = POSITIVE[1:]
# Infinity is allowed.
LIMIT = [None, *NO_NUMBERS, math.nan, -math.inf, -1.0, 0.0]
NOT_NEGATIVE = [*NUMBER, -1.0]
COUNT = [*NUMBER, 2.7, 3.0, 1e300, -1, 10**30, Fraction(5, 2)]
FLAG = [None, "yes", 1, 0, 1.0, math.nan, [True], np.array([True]), Odd()]
NUMBERS = [
    None,
    "a",
    "10",
    True,
    [True, 0.5],
    ["0.5", "0"],
    [1j, 0.0],
    [[1.0], [2.0, 3.0]],
    {},
    Odd(),
    [None, 1.0],
]
NUMBERS += [bytearray(b"ab"), np.ma.array([1.0, 2.0], mask=[False, True]), np.ma.masked]
NUMBERS += [np.array(["a", "b"]), np.array([None, Odd()]), np.array([True, False]), np.array([1j, 2j])]
STATE = [
    *NUMBERS,
    (0.5,),
    (0.5, 0.0, 0.0),
    0.5,
    [[0.5, 0.0]],
    (math.nan, 0.0),
    (0.5, math.inf),
    (10**400, 0.0),
]
SPAN = [
    None,
    "01",
    "a",
    1.0,
    (0.0,),
    (0.0, 1.0, 2.0),
    (1.0, 0.0),
    ("0", "1"),
    (0.0, math.nan),
    (0.0, math.inf),
]
SPAN += [b"ab", bytearray(b"ab"), {0.0, 1.0}, np.ma.array([0.0, 1.0], mask=[False, True])]
SPAN += [(False, True), (0.0, 1j), np.array([None, 1.0]), (0.0, None), Odd()]
SAMPLES = [*NUMBERS[1:], 0.5, [[0.1, 0.2]], [0.5, 0.1], [-1.0], [0.1, math.nan], [2.0], [math.inf]]
TANGENT = [
    *NUMBERS[1:3],
    *NUMBERS[4:],
    1.0,
    np.eye(3),
    np.zeros((2, 0)),
    [math.nan, 0.0],
    np.zeros((2, 2, 2)),
]
NAME = ["nope", 3, 1.5, True, math.nan, [1], np.array(["a", "b"]), Odd()]
UNITS = [[1], "a", 3, {"nope": "m"}, {3: "m"}, {"q": 3}, {"q": None}, Odd()]
TEXT = [None, 3, True, [1], Odd()]
SYSTEM = [None, "a", 3, models.bouncing_ball, HybridSystem, [BALL], Odd()]
EMPTY = ["", [], (), np.array([]), np.array(["1", "2"]), np.ma.masked]
PARAMETERS = [
    *EMPTY,
    [1],
    "a",
    3,
    True,
    ["c"],
    {"nope": 1.0},
    {3: 1.0},
    Odd(),
    *({"c": value} for value in NUMBER),
]
OF_BALL = [
    *EMPTY,
    [1],
    "a",
    3,
    True,
    ["e"],
    {"nope": 1.0},
    {3: 1.0},
    Odd(),
    *({"e": value} for value in NUMBER),
]
SOLVER = ["DOP853", hybrid.DOP853, 3, 0, False, "", [hybrid.DOP853()], Odd()]
FUNCTION = ["a", 3, True, [1], np.array([1.0])]
GUARD = [None, "a", 3, lambda t, x, p: x.q, Guard, Odd()]
LIST = [None, "a", 3, True, math.nan, Odd()]
AXES = ["a", 3, math.nan, True, Odd()]
RANGES = [
    [1],
    "a",
    3,
    {"nope": 1.0},
    *({"q": bad} for bad in ("a", None, math.nan, True, (2.0, 1.0), (0.0,), 1j)),
]
EXECUTOR = [0, -1, 1.5, True, "a", math.nan, Odd(), {}]
COMPONENT = ["nope", 2, -3, 1.5, True, math.nan, [0], Odd()]
LABELS = ["a", 3, ("a",), math.nan]

RUN = {"system": SYSTEM, "x0": STATE, "mode": NAME, "parameters": PARAMETERS, "solver": SOLVER}
BIG_TIMES = [1e300, -1e300, 1e17]
EXPONENTS = {
    **RUN,
    "intervals": [0, *COUNT],
    "interval": [*OPTIONAL_POSITIVE, 1e-300, 1e308],
    "transient": COUNT,
    "t0": [*NUMBER, *BIG_TIMES],
    "progress": FLAG,
}


@pytest.fixture(scope="module")
def made():
    """The objects that methods and plots are called on."""
    return {
        "arc": hybrid.simulate(BALL, (1.0, 0.0), (0.0, 1.0)),
        "orbit": hybrid.periodic_orbit(OSCILLATOR, (0.9, 1.0)),
        "comparison": lyapunov.compare_models({"a": OSCILLATOR}, (0.0, 0.0), reference="a", intervals=5),
        "chart": lyapunov.chart(OSCILLATOR, {"c": [0.1, 0.2]}, (0.0, 0.0), intervals=5, section=3),
        "work": hybrid.work_precision(
            BALL, (1.0, 0.0), (0.0, 0.3), methods={"T": hybrid.Taylor()}, tolerances=[1e-6], repeats=1
        ),
        "section": hybrid.stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=3),
        "spectrum": lyapunov.lyapunov_spectrum(OSCILLATOR, (0.0, 0.0), intervals=5),
    }


def call(function, *positional, **options):
    """A valid call, of which the test replaces one argument at a time."""
    return function, positional, options


def table(made):
    """By public function: a valid call, and the values that each argument must refuse."""
    start = (OSCILLATOR, (0.0, 0.0))
    ball = (BALL, (1.0, 0.0))
    arc, chart = made["arc"], made["chart"]
    case = hybrid.testing.Case(BALL, dict(BALL.parameters), "flight", (1.0, 0.0), 0.0, 0.3)
    section = Guard(lambda t, x, p: x.v, -1)
    solvers = {"rtol": [*POSITIVE, 1e-16, 1e300], "atol": POSITIVE, "max_steps": [0, *COUNT]}
    solvers["max_step"] = LIMIT
    exponents = {**EXPONENTS, "k": [0, 3, *COUNT[1:]], "history": FLAG}
    entries = [
        (
            call(hybrid.simulate, *start, (0.0, 1.0)),
            {
                **RUN,
                "t_span": [*SPAN, (0.0, 1e300), (-1e300, 0.0)],
                "tangent": TANGENT,
                "samples": SAMPLES,
                "max_jumps": COUNT,
            },
        ),
        (
            call(hybrid.simulate_many, OSCILLATOR, [(0.0, 0.0)], (0.0, 1.0)),
            {
                **RUN,
                "x0": [
                    *NUMBERS[:4],
                    (0.5, 0.0),
                    0.5,
                    [[0.5]],
                    [(math.nan, 0.0)],
                    {"x": 1.0},
                    {3: 1.0},
                    Odd(),
                ],
                "t_span": [*SPAN, (0.0, 1e300), (-1e300, 0.0)],
                "samples": SAMPLES,
                "max_jumps": COUNT,
                "executor": EXECUTOR[:-2],
            },
        ),
        (call(hybrid.global_error, *start, (0.0, 1.0)), {**RUN, "t_span": SPAN, "max_jumps": COUNT}),
        (
            call(hybrid.work_precision, *ball, (0.0, 0.1), tolerances=[1e-4], repeats=1),
            {
                "system": SYSTEM,
                "x0": STATE,
                "t_span": SPAN,
                "mode": NAME,
                "parameters": OF_BALL,
                "methods": [None, [], {}, "a", 3, {"T": 3}, {"T": "Taylor"}, {"T": None}],
                "tolerances": [None, [], "a", ["1"], [0.0], [-1.0], [math.nan], [True], 1e-3, [[1e-3]]],
                "reference": [*NUMBERS[1:], (1.0,), BALL, (math.nan, 0.0), (math.inf, 0.0)],
                "reference_error": [
                    [1],
                    "a",
                    {"nope": 1.0},
                    {"state": "a"},
                    {"state": -1.0},
                    {"state": True},
                ],
                "tangent": FLAG,
                "repeats": [0, *COUNT],
                "longest": LIMIT,
                "clock": [None, *FUNCTION],
            },
        ),
        (
            call(hybrid.periodic_orbit, *start),
            {
                **RUN,
                "t0": [*NUMBER, *BIG_TIMES],
                "periods": [0, *COUNT],
                "period": OPTIONAL_NUMBER,
                "tolerance": [*POSITIVE, 1.0, 10],
                "max_iterations": COUNT,
            },
        ),
        (
            call(hybrid.periodic_orbit, *ball, period=1.0),
            {**RUN, "parameters": OF_BALL, "period": POSITIVE[1:]},
        ),
        (
            call(hybrid.stroboscopic_section, *start, periods=3),
            {
                **RUN,
                "periods": [0, *COUNT],
                "transient": COUNT,
                "t0": [*NUMBER, *BIG_TIMES],
                "progress": FLAG,
            },
        ),
        (
            call(hybrid.poincare_section, *start, section, points=3),
            {
                **RUN,
                "section": GUARD,
                "points": [0, *COUNT],
                "transient": COUNT,
                "t0": [*NUMBER, *BIG_TIMES],
                "progress": FLAG,
            },
        ),
        (
            call(hybrid.saltation_matrix, BALL, "bounce", 0.0, (0.0, -1.0)),
            {
                "system": SYSTEM,
                "transition": [None, *NAME],
                "t": NUMBER,
                "x": STATE,
                "parameters": OF_BALL,
            },
        ),
        (call(hybrid.compile_system, BALL), {"system": SYSTEM}),
        (call(hybrid.split, BALL), {"system": SYSTEM}),
        (
            call(hybrid.from_equations, lambda t, x, p: (x.v, -np.abs(x.q)), state=("q", "v")),
            {
                "field": [None, *FUNCTION],
                "state": [None, "qv", 0, -1, 1.5, True, (), ("1q",), (1, 2), {"q", "v"}, math.nan, Odd()],
                "parameters": [[1], "a", 3, {"e": "1"}, {"e": math.nan}, {"e": True}, {"1": 1.0}, {3: 1.0}],
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
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
                "parameters": [[1], "a", 3, {"e": "1"}, {"e": math.nan}, {"e": True}, {"1": 1.0}, {3: 1.0}],
                "below": [None, *FUNCTION],
                "above": [None, *FUNCTION],
                "switching": [None, *FUNCTION],
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
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
                "parameters": [
                    [1],
                    "a",
                    3,
                    {"e": "1"},
                    {"e": math.nan},
                    {"e": True},
                    {"1": 1.0},
                    {3: 1.0},
                    {"e": 1j},
                ],
                "modes": [*LIST, [], [1], ["a"]],
                "transitions": [*LIST, [1], ["a"]],
                "period": [*LIMIT[1:], math.inf],
                "name": TEXT,
                "units": UNITS,
            },
        ),
        (
            call(Mode, "a", lambda t, x, p: (1.0,)),
            {
                "name": [*TEXT, ""],
                "field": [None, *FUNCTION],
                "jacobian": FUNCTION,
                "part_of": [*TEXT[1:], ""],
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
        (
            call(hybrid.Answer, (1.0,)),
            {
                "state": NUMBERS,
                "times": NUMBERS[1:],
                "saltation": NUMBERS[1:],
                "fundamental": NUMBERS[1:],
                "exponents": NUMBERS[1:],
                "steps": COUNT[1:],
                "seconds": NOT_NEGATIVE[1:],
            },
        ),
        *(
            (call(solver), solvers)
            for solver in (hybrid.Solver, hybrid.DOP853, hybrid.Tsit5, hybrid.Taylor, hybrid.RadauIIA)
        ),
        (call(lyapunov.lyapunov_spectrum, *start), exponents),
        (
            call(lyapunov.two_orbit_exponents, *start),
            {
                **EXPONENTS,
                "separation": POSITIVE,
                "direction": [*STATE[1:], (0.0, 0.0)],
            },
        ),
        (
            call(lyapunov.chart, OSCILLATOR, {"c": [0.1]}, (0.0, 0.0)),
            {
                **EXPONENTS,
                "k": [0, 3, *COUNT[1:]],
                # A value that does not fit a single row is reported in the row's status.
                "interval": OPTIONAL_POSITIVE,
                "t0": NUMBER,
                "over": [
                    None,
                    [1],
                    "a",
                    {},
                    {"nope": [1.0]},
                    {3: [1.0]},
                    *({"c": bad} for bad in ("abc", None, 1.0, [], ["1"], [True], [math.nan], [[1.0]], [1j])),
                ],
                "section": COUNT,
                "continue_from": ["next", 1, True, math.nan, Odd()],
                "at": ["apex", 3, True, math.nan, Odd()],
                "store": [3, "", True, Odd()],
                "executor": EXECUTOR,
                "progress": FLAG[1:],
            },
        ),
        (
            call(hybrid.sweep, lambda p: {"y": p["a"]}, {"a": [1.0]}),
            {
                "task": [None, "a", 3],
                "over": [
                    None,
                    "a",
                    {},
                    [],
                    [1.0],
                    {3: [1.0]},
                    *({"a": bad} for bad in ("abc", None, 1.0, [], ["1"], [True], [math.nan], [[1.0]], [1j])),
                ],
                "store": [3, "", True, Odd()],
                "executor": EXECUTOR,
                "progress": FLAG[1:],
            },
        ),
        (call(hybrid.open, "run.zarr"), {"path": [None, 3, "", "no such store", Odd()]}),
        (
            call(lyapunov.compare_models, {"a": OSCILLATOR}, (0.0, 0.0), reference="a"),
            {
                **{
                    name: EXPONENTS[name]
                    for name in ("x0", "mode", "intervals", "interval", "transient", "solver", "progress")
                },
                "k": [0, 3, *COUNT[1:]],
                "systems": [None, [1], "a", {}, {"a": 3}, {"a": None}],
                "reference": [None, *NAME],
                "points": [None, "a", 3, [], [1], ["a"], [{"nope": 1.0}], [{"c": "1"}]],
            },
        ),
        (call(lyapunov.floquet_exponents, made["orbit"]), {"orbit": [None, "a", 3, OSCILLATOR, Odd()]}),
        (
            call(hybrid.plot.plot_arc, arc),
            {
                "arc": [None, "a", 3, BALL],
                "components": [["nope"], "nope", 3, [2], [1.5], [None], [True]],
                "ax": AXES,
            },
        ),
        (
            call(hybrid.plot.plot_phase, arc, "q", "v"),
            {
                "arc": [None, "a", 3, BALL],
                "x": COMPONENT,
                "y": COMPONENT,
                "ax": AXES,
            },
        ),
        (call(hybrid.plot.plot_graph, BALL), {"system": SYSTEM, "ax": AXES}),
        (call(hybrid.plot.plot, BALL), {"result": [None, "a", 3]}),
        (
            call(hybrid.plot.plot_section, made["section"]),
            {"section": [None, "a", 3, arc], "x": COMPONENT, "y": COMPONENT, "ax": AXES},
        ),
        (
            call(hybrid.plot.plot_orbit, made["orbit"]),
            {"orbit": [None, "a", 3, arc], "x": COMPONENT, "y": COMPONENT, "ax": AXES},
        ),
        (
            call(hybrid.plot.plot_work_precision, made["work"]),
            {
                "result": [None, "a", 3, BALL],
                "ax": AXES,
                "quantity": [None, *NAME],
            },
        ),
        (
            call(lyapunov.plot.plot_convergence, {"a": [1.0, 2.0]}),
            {
                "ax": AXES,
                "estimates": [[1], "a", {"a": "b"}, {"a": 1.0}, {"a": [[1.0]]}, {"a": [True]}],
                "points": [[1], "a", {"a": 1.0}, {"a": ([1.0], [1.0, 2.0])}, {"a": ("a", "b")}],
                "points_label": TEXT,
                "truth": OPTIONAL_NUMBER,
                "truth_label": TEXT,
            },
        ),
        (
            call(lyapunov.plot.plot_phase_portrait, arc, "q", "v"),
            {
                "ax": AXES,
                "arc": [None, "a", 3, BALL],
                "x": COMPONENT,
                "y": COMPONENT,
                "section": ["a", [1.0], [[True, False]], [["a", "b"]], 3.0],
                "labels": LABELS,
            },
        ),
        (
            call(
                lyapunov.study.regimes.plot_regimes,
                [lyapunov.study.regimes.Panel("a", arc, arc.x, np.ones(3), 1.0)],
                "q",
                "v",
            ),
            {
                "panels": [None, "a", 3, [1], [arc]],
                "x": COMPONENT,
                "y": COMPONENT,
                "labels": LABELS,
            },
        ),
        (call(lyapunov.plot.plot_exponents, chart), {"ax": AXES, "chart": [None, "a", 3, arc]}),
        (
            call(lyapunov.plot.plot_bifurcation, chart),
            {
                "ax": AXES,
                "chart": [None, "a", 3, arc],
                "component": COMPONENT,
            },
        ),
        (
            call(lyapunov.plot.plot_kinds, chart),
            {"ax": AXES, "chart": [None, "a", 3, arc, chart]},
        ),
        (
            call(lyapunov.plot.plot_map, chart),
            {
                "ax": AXES,
                "chart": [None, "a", 3, arc],
                "exponent": [1, *COUNT],
            },
        ),
        (call(lyapunov.plot.plot_chart, chart), {"chart": [None, "a", 3, arc], "component": COMPONENT}),
        (call(lyapunov.plot.plot_spectrum, made["spectrum"]), {"spectrum": [None, "a", 3, arc], "ax": AXES}),
        (call(lyapunov.plot.style), {}),
        (call(hybrid.testing.states, BALL), {"system": SYSTEM, "ranges": RANGES}),
        (
            call(hybrid.testing.parameters, BALL),
            {"system": SYSTEM, "ranges": [*RANGES[:4], {"g": "a"}, {"g": (2, 1)}]},
        ),
        *(
            (
                call(function, BALL),
                {
                    "system": SYSTEM,
                    "states": RANGES,
                    "parameters": [*RANGES[:4], {"g": "a"}, {"g": True}],
                    "t_span": [*SPAN[1:], (1.0, 1.0)],
                    "mode": NAME,
                    "solver": SOLVER,
                    "engine": [None, "a", 3, Odd()],
                    "passable": [None, 3, ["nope"], "nope", [3]],
                    **(
                        {}
                        if function is hybrid.testing.cases
                        else {
                            "examples": [0, *COUNT],
                            "elastic": ["nope", 3, ["nope"], [3], [None]],
                        }
                    ),
                },
            )
            for function in (hybrid.testing.cases, hybrid.testing.check_system)
        ),
        (call(hybrid.testing.small_systems), {}),
        (
            call(hybrid.testing.piecewise_affine_fields),
            {name: [None, 3, "ab", (1,), (0, 1), (2, 1), (1.5, 2)] for name in ("dimensions", "switches")},
        ),
        *(
            (call(getattr(hybrid.testing, name), None), {"case": [None, "a", 3, BALL]})
            for name in hybrid.testing.__all__
            if name.startswith("check_") and name not in ("check_system", "check_elastic")
        ),
        (
            call(hybrid.testing.check_elastic, case, ["v"]),
            {
                "case": [None, "a", 3, BALL],
                "flip": [None, "v", 3, ["nope"], [3], [None]],
            },
        ),
        (call(models.vibroimpact), {"contact": ["a", 3, 0, False, contact.Rigid, Odd()]}),
        (
            call(hertz_stiffness),
            {
                "E": POSITIVE,
                "nu": [*NUMBER, 1.0, -1.0],
                "A": POSITIVE,
                "B": POSITIVE,
                "q": POSITIVE,
            },
        ),
        (
            call(one_impact_orbits, 1.0, 0.1, 0.5, 0.8, 1.0, 0.7),
            {
                **dict.fromkeys("kcAd", NUMBER),
                "w": POSITIVE,
                "r": NOT_NEGATIVE,
                "n": [0, *COUNT],
            },
        ),
        (call(den_hartog_amplitude, 0.1, 1.0, 0.5), {"f": NOT_NEGATIVE, "A": NUMBER, "w": POSITIVE}),
        (call(contact.Rigid), {"e": NOT_NEGATIVE}),
        (call(contact.Hertz, 1e8), {"K": POSITIVE}),
        (call(contact.HuntCrossley, 1e8, 0.1), {"K": POSITIVE, "alpha": NOT_NEGATIVE}),
        (call(contact.KelvinVoigt, 1e8, 0.1), {"k": POSITIVE, "c": NOT_NEGATIVE}),
        (
            call(contact.HuntCrossley.from_restitution, 0.8, 1e8, 0.4),
            {
                "e": [*POSITIVE, 1.1],
                "K": POSITIVE,
                "speed": POSITIVE,
            },
        ),
        (
            call(contact.KelvinVoigt.from_restitution, 0.8, 90.0, 0.01),
            {
                "e": [*POSITIVE, 1.1],
                "mass": POSITIVE,
                "duration": POSITIVE,
            },
        ),
        (
            call(contact.matched_laws, 1e8, 90.0, 0.4),
            {
                "e": [*POSITIVE, 1.1],
                "K": POSITIVE,
                "mass": POSITIVE,
                "speed": POSITIVE,
            },
        ),
        # Methods.
        (call(contact.Hertz.duration, contact.Hertz(1e8), 90.0, 0.4), {"mass": POSITIVE, "speed": POSITIVE}),
        (call(hybrid.HybridArc.__call__, arc, 0.5), {"t": [*NUMBERS, math.nan, -1.0, 2.0, [0.5, math.nan]]}),
        (call(hybrid.PeriodicOrbit.arc, made["orbit"]), {"solver": SOLVER}),
        (call(hybrid.Solver.tightened, hybrid.DOP853(), 10.0), {"factor": POSITIVE}),
        (call(HybridSystem.mode_index, BALL, "flight"), {"name": [None, *NAME]}),
        (call(HybridSystem.parts_of, BALL, "flight"), {"name": [None, *NAME]}),
        (call(HybridSystem.copies_of, BALL, "bounce"), {"name": [None, *NAME]}),
        (call(HybridSystem.transition_index, BALL, "bounce"), {"name": [None, *NAME]}),
        (call(HybridSystem.parameter_values, BALL), {"overrides": OF_BALL}),
        (call(HybridSystem.forcing_period, OSCILLATOR), {"overrides": PARAMETERS}),
        (call(hybrid.CompiledSystem.model, hybrid.compile_system(BALL)), {"parameters": OF_BALL}),
        (call(hybrid.CompiledSystem.series_columns, hybrid.compile_system(BALL), 1), {"tangents": COUNT}),
        (call(hybrid.WorkPrecision.rows_of, made["work"], "T"), {"method": [None, *NAME]}),
        (call(hybrid.WorkPrecision.error_of, made["work"], "state"), {"quantity": [None, *NAME]}),
        (
            call(hybrid.WorkPrecision.seconds_at, made["work"], "T", 1e-3),
            {
                "method": [None, *NAME],
                "error": POSITIVE,
                "quantity": [None, *NAME],
            },
        ),
        (call(hybrid.WorkPrecision.plot, made["work"]), {"ax": AXES, "quantity": [None, *NAME]}),
        (call(lyapunov.ModelComparison.cost, made["comparison"], "a"), {"name": [None, *NAME]}),
        (call(lyapunov.ModelComparison.distance, made["comparison"], "a"), {"name": [None, *NAME]}),
        *(
            (call(method, made["comparison"], 0.1), {"tolerance": LIMIT[:-1]})
            for method in (lyapunov.ModelComparison.within, lyapunov.ModelComparison.cheapest)
        ),
    ]
    return entries


# Classes that only the library creates, and errors.
NOT_CALLED = {
    "PiecewiseAffineField",
    "Status",
    "StatusCode",
    "HybridError",
    "ModelError",
    "ArgumentError",
    "PropertyError",
    "CompiledSystem",
    "Grazing",
    "HybridArc",
    "Jump",
    "GlobalError",
    "PeriodicOrbit",
    "Section",
    "WorkPrecision",
    "LyapunovSpectrum",
    "ModelComparison",
    "TwoOrbitExponents",
    "Case",
    "Run",
    "Engine",
    "PropertyReport",
    "SystemReport",
    "discard",
    "Panel",
}
# Classes whose methods only the library and its properties call.
WITHOUT_METHODS = {"Case", "CompiledSystem", "Engine", "PiecewiseAffineField", "Run"}
# Arguments of methods that have another name in the function called.
ALSO_CALLED = {"overrides": "parameters", "name": "mode", "flip": "elastic"}


def public_functions():
    """Every public function, class and method that takes arguments."""
    found = []
    for module in (hybrid, hybrid.testing, lyapunov):
        found += [getattr(module, name) for name in module.__all__]
    plots = [each for name, each in vars(lyapunov.plot).items() if name.startswith("plot_")]
    assert len(plots) == 8
    found += [*plots, lyapunov.plot.style, lyapunov.study.regimes.plot_regimes]
    found += [getattr(hybrid.plot, name) for name in hybrid.plot.__all__ if name.startswith("plot")]
    found += [each for name, each in vars(models).items() if inspect.isfunction(each)]
    laws = (contact.Rigid, contact.Hertz, contact.HuntCrossley, contact.KelvinVoigt)
    found += [*laws, contact.matched_laws, hertz_stiffness, one_impact_orbits, den_hartog_amplitude]
    for each in list(found):
        if inspect.isclass(each) and each.__name__ not in WITHOUT_METHODS and not issubclass(each, Exception):
            for name, method in vars(each).items():
                if inspect.isfunction(method) and (not name.startswith("_") or name == "__call__"):
                    found.append(method)
    return [each for each in found if each.__name__ not in NOT_CALLED]


# What only a system that has been split has.
BY_SPLIT = ("notes", "growth")


def arguments_of(function):
    """Names of the arguments that a caller gives."""
    if not callable(function):
        return []
    return [
        name
        for name in inspect.signature(function).parameters
        if name not in ("self", "cls", "args", "kwargs", "options", *BY_SPLIT)
    ]


def begins_with_its_name(text, argument):
    """Whether an error begins with the argument's name, alone or after the class or function."""
    text = text.lower()
    for name in (argument, ALSO_CALLED.get(argument, argument)):
        one = name.lower().removesuffix("s") if len(name) > 2 else name.lower()
        for words in (text, text.partition(": ")[2]):
            if words.startswith(
                (one, f"each {one}", f"at least one {one}", f"state component names of {one}")
            ):
                return True
    return argument == "name" and text.startswith(("mode", "transition", "model"))


def test_every_argument_has_an_entry(made):
    known = {}
    for (function, _, _), refused in table(made):
        known.setdefault(function, set()).update(refused)
    missing = [
        f"{function.__qualname__}({name})"
        for function in public_functions()
        for name in arguments_of(function)
        if name not in known.get(function, ())
    ]
    # The model passes the bodies to the modes and transitions of a contact law.
    missing = [each for each in missing if not each.endswith("(bodies)")]
    assert not missing, missing


def test_the_calls_work(made):
    """The unchanged calls must work, so that an error comes from the replaced argument."""
    cheap = (
        "simulate",
        "HybridSystem",
        "Mode",
        "Guard",
        "Transition",
        "Answer",
        "filippov",
        "split",
        "from_equations",
        "saltation_matrix",
    )
    for (function, positional, options), _ in table(made):
        if function.__name__ in cheap:
            function(*positional, **options)


def test_nonsense(made):
    failures = []
    for (function, positional, options), refused in table(made):
        names = list(inspect.signature(function).parameters)
        given = dict(zip(names, positional, strict=False)) | options
        for argument, values in refused.items():
            for value in values:
                what = f"{function.__qualname__}({argument}={value!r})"
                try:
                    function(**{**given, argument: value})
                except HybridError as error:
                    if not begins_with_its_name(str(error), argument):
                        failures.append(f"{what}: {error}")
                except Exception as error:
                    failures.append(f"{what}: {type(error).__name__}: {error}")
                else:
                    failures.append(f"{what}: accepted")
        plt.close("all")
    assert not failures, "\n" + "\n".join(failures)
