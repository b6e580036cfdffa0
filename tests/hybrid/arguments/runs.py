"""Runs, solvers, orbits, sections, sweeps and exponents: valid calls, and what each argument must refuse."""

import math

import hybrid
import lyapunov
from hybrid import Guard
from tests.hybrid.arguments.values import (
    BALL,
    BIG_TIMES,
    COUNT,
    EXECUTOR,
    EXPONENTS,
    FLAG,
    FUNCTION,
    GUARD,
    LIMIT,
    NAME,
    NOT_NEGATIVE,
    NUMBER,
    NUMBERS,
    OF_BALL,
    OPTIONAL_NUMBER,
    OPTIONAL_POSITIVE,
    OSCILLATOR,
    OUTPUT_NAMES,
    POSITIVE,
    RUN,
    SAMPLES,
    SPAN,
    STATE,
    SYSTEM,
    TANGENT,
    Odd,
    call,
)


def searches():
    """Calls that look for attractors."""
    over = {"x": (-1.0, 0.0), "v": 0.0}
    common = {
        **{name: RUN[name] for name in ("system", "mode", "parameters", "solver")},
        "over": [
            *(None, "a", 3, [1], {}, {"nope": 1.0}, {"x": 0.0}, {3: 1.0}, Odd()),
            *({"x": bad, "v": 0.0} for bad in (None, "a", True, [], [[1.0]], math.nan, (1.0, 0.0), (1.0,))),
        ],
        "t0": [*NUMBER, *BIG_TIMES],
        "section": GUARD[1:],
        "interval": [*OPTIONAL_POSITIVE, 1.0],
        "periods": [0, *COUNT],
        "recurrences": [0, *COUNT],
        "tolerance": POSITIVE,
        "features": ["a", 3, True, [], {}, {3: len}, {"": len}, {"a": 3}, [len, len], [3], Odd()],
        # A distance takes features.
        "together": [*OPTIONAL_POSITIVE, 1.0, {"a": 1.0}],
        "progress": FLAG[1:],
    }
    drawn = {"starts": [0, *COUNT], "seed": COUNT}
    stored = {"store": [3, True, 1.5, [1], Odd()], "executor": EXECUTOR}
    shared = (
        "system",
        "mode",
        "parameters",
        "solver",
        "t0",
        "interval",
        "periods",
        "recurrences",
        "tolerance",
    )
    tracked = {name: common[name] for name in (*shared, "tolerance", "progress")}
    return [
        (
            call(hybrid.edge_state, OSCILLATOR, (0.0, 0.0), (0.1, 0.0)),
            {**tracked, "one": STATE, "other": STATE, "rounds": [0, *COUNT]},
        ),
        (
            call(hybrid.attractors, OSCILLATOR, over, starts=3),
            {**common, **drawn, "executor": EXECUTOR[:-2]},
        ),
        (call(hybrid.basins, OSCILLATOR, {"x": [0.0], "v": 0.0}), {**common, **stored}),
        (
            call(hybrid.basin_fractions, OSCILLATOR, over, starts=3, along={"c": [0.1]}),
            {
                **common,
                **drawn,
                **stored,
                "along": ["a", 3, [1], {}, {"nope": [1.0]}, {"c": "a"}, {"c": [math.nan]}, {"c": 1.0}, Odd()],
            },
        ),
    ]


def runs(made):
    start = (OSCILLATOR, (0.0, 0.0))
    ball = (BALL, (1.0, 0.0))
    section = Guard(lambda t, x, p: x.v, +1)
    solvers = {"rtol": [*POSITIVE, 1e-16, 1e300], "atol": POSITIVE, "max_steps": [0, *COUNT]}
    solvers["max_step"] = LIMIT
    exponents = {**EXPONENTS, "k": [0, 3, *COUNT[1:]], "history": FLAG}
    return [
        (
            call(hybrid.simulate, *start, (0.0, 1.0)),
            {
                **RUN,
                "t_span": [*SPAN, (0.0, 1e300), (-1e300, 0.0)],
                "tangent": TANGENT,
                "samples": SAMPLES,
                # Without samples an arc needs its jumps.
                "keep_jumps": [*FLAG[1:], False],
                "max_jumps": COUNT,
                "sensitivities": [None, 3, "k", ["nope"], [3], [None], ["k", "k"]],
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
                "outputs": OUTPUT_NAMES,
                "max_jumps": COUNT,
                "executor": EXECUTOR[:-2],
                "progress": FLAG[1:],
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
            {**RUN, "parameters": OF_BALL, "period": [*POSITIVE[1:], 1e308]},
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
            # Another system may never come to the section.
            call(hybrid.poincare_section, *start, section, points=3, solver=hybrid.Taylor(max_steps=1000)),
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
                "outputs": OUTPUT_NAMES,
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
        (call(hybrid.open_store, "run.zarr"), {"path": [None, 3, "", "no such store", Odd()]}),
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
        *searches(),
        (call(lyapunov.covariant_vectors, *start, intervals=5, transient=2), EXPONENTS),
        (
            call(lyapunov.finite_time_exponents, *start),
            {
                **{name: EXPONENTS[name] for name in ("system", "mode", "parameters", "solver", "t0")},
                "x0": [*NUMBERS, (0.5,), 0.5, [[0.5]], (math.nan, 0.0), [(math.nan, 0.0)], {"x": 1.0}, Odd()],
                "interval": EXPONENTS["interval"],
                "intervals": [0, *COUNT[1:]],
            },
        ),
        (
            call(lyapunov.kaplan_yorke_dimension, [0.1, -0.2]),
            {"exponents": [*NUMBERS, 0.5, [], [[0.1, 0.2]], [math.nan], [math.inf, -1.0]]},
        ),
        (
            call(lyapunov.zero_one_test, [0.0, 1.0] * 50),
            {"series": [*NUMBERS, 0.5, [0.1, 0.2], [math.nan] * 200], "frequencies": [0, *COUNT]},
        ),
        (call(lyapunov.floquet_exponents, made["orbit"]), {"orbit": [None, "a", 3, OSCILLATOR, Odd()]}),
    ]
