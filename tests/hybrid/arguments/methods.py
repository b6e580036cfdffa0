"""Methods of results and systems: valid calls, and what each argument must refuse."""

import math

import numpy as np

import hybrid
import lyapunov
from hybrid import HybridSystem, measures
from models import contact
from tests.hybrid.arguments.values import (
    BALL,
    COUNT,
    LIMIT,
    NAME,
    NUMBERS,
    OF_BALL,
    OSCILLATOR,
    PARAMETERS,
    POSITIVE,
    SOLVER,
    STATE,
    SYSTEM,
    Hostile,
    Odd,
    call,
)

# Functions of an arc by name that are none, and a name that is no text.
OF_ARC = ["a", 3, [abs], {"y": 3}, {"y": None}, {3: abs}, {"": abs}, Odd()]
NAMED = [each for each in NAME if not isinstance(each, str)]


def equilibria(made):
    """Equilibria, their branches and curves, and whole diagrams."""
    index = {"i": [None, "a", 1.5, 10**9, True]}
    kinds = {"kinds": [None, *NAME, (), ["fold", 3], ["flop"]]}
    span = [None, 3, (12.0, 13.0), (9.5, 8.0), (9.0,), "ab"]
    labels = np.ones((4, 4), dtype=int)
    no_labels = [None, "a", 3, 1.5, np.ones((3, 3)), made["branch"]]
    return [
        (
            call(hybrid.equilibrium, BALL, (1.0, 0.0), mode="rest"),
            {
                "system": SYSTEM,
                "x0": STATE,
                "mode": NAME,
                "parameters": OF_BALL,
                "max_iterations": COUNT,
            },
        ),
        (
            call(hybrid.continue_equilibrium, made["rest"], "q", (8.9, 9.1)),
            {
                "point": [None, "a", 3, BALL, made["orbit"]],
                "parameter": [None, *NAME],
                "span": span,
                "max_steps": [0, *COUNT],
                "progress": [3, "a"],
            },
        ),
        (call(hybrid.EquilibriumBranch.equilibrium, made["rests"], 0), index),
        (call(hybrid.EquilibriumBranch.of, made["rests"], "Hopf"), kinds),
        (call(hybrid.EquilibriumCurve.equilibrium, made["hopfs"], 0), index),
        (
            call(hybrid.continue_all, made["rest"], "q", (8.9, 9.1)),
            {
                "start": [None, "a", 3, BALL, []],
                "parameter": [None, *NAME],
                "span": span,
                "depth": COUNT,
                "most": [0, *COUNT],
                "sweep": [3, "a", made["swept"], made["branch"].to_xarray()],
                "outputs": OF_ARC,
                "store": [3, "", True],
                "solver": SOLVER,
                "max_steps": [0, *COUNT],
                "progress": [3, "a"],
            },
        ),
        (call(hybrid.Diagram.of, made["diagram"], "Hopf"), kinds),
        (call(hybrid.basin_entropy, labels, size=2), {"found": no_labels, "size": [0, *COUNT]}),
        (
            call(hybrid.uncertainty_exponent, 1 + (np.indices((40, 40))[0] > 19), sizes=[1, 2]),
            {"found": no_labels, "sizes": [3, "a", [0], [1.5], ["a"], [100], Odd()]},
        ),
    ]


def methods(made):
    arc = made["arc"]
    return [
        (call(contact.Hertz.duration, contact.Hertz(1e8), 90.0, 0.4), {"mass": POSITIVE, "speed": POSITIVE}),
        (
            call(hybrid.HybridArc.__call__, arc, 0.5),
            {"t": [*NUMBERS, math.nan, -1.0, 2.0, [0.5, math.nan]], "name": NAME},
        ),
        *(
            (call(getattr(hybrid.HybridArc, name), made["slopes"], "energy"), {"name": [None, *NAME]})
            for name in (
                "fundamental_of",
                "sensitivity_of",
                "sampled_fundamental_of",
                "sampled_sensitivity_of",
            )
        ),
        (call(hybrid.PeriodicOrbit.arc, made["orbit"]), {"solver": SOLVER}),
        (
            call(hybrid.PeriodicOrbit.sensitivity, made["orbit"], ["w"]),
            {"names": [None, 3, "w", ["nope"], [3], [None], []], "solver": SOLVER},
        ),
        (call(hybrid.Branch.orbit, made["branch"], 0), {"i": [None, "a", 1.5, 10**9, True]}),
        (call(hybrid.Branch.of, made["branch"], "fold"), {"kinds": [None, *NAME, (), ["fold", 3], ["flop"]]}),
        (call(measures.Measure, "mean", "q"), {"kind": [None, *NAME], "name": NAMED}),
        (call(measures.Measure.__call__, measures.mean("q"), arc), {"arc": [None, "a", 3, made["orbit"]]}),
        (call(measures.Measure.unit, measures.mean("q"), BALL), {"system": SYSTEM}),
        *(
            (call(getattr(measures, name), "q"), {"name": NAMED})
            for name in ("maximum", "minimum", "amplitude", "mean", "rms")
        ),
        (call(hybrid.BifurcationCurve.orbit, made["curve"], 0), {"i": [None, "a", 1.5, 10**9, True]}),
        (
            call(hybrid.switch_branch, made["flip"]),
            {"bifurcation": [None, "a", 3, made["orbit"]], "solver": SOLVER},
        ),
        (
            call(hybrid.continue_orbit, made["orbit"], "w", (0.9, 1.1)),
            {
                "orbit": [None, "a", 3, BALL],
                "parameter": [None, *NAME],
                "span": [None, 3, (2.0, 3.0), (1.1, 0.9), (0.9,), "ab"],
                "outputs": OF_ARC,
                "events": OF_ARC,
                "stop": [3, True, "flop", (), [3], ["fold", None], Odd(), Hostile()],
                "solver": SOLVER,
                "max_steps": [0, *COUNT],
                "progress": [3, "a"],
            },
        ),
        (
            call(hybrid.continue_bifurcation, made["flip"], {"E": (24.0, 25.0), "V_ref": (11.2, 11.4)}),
            {
                "bifurcation": [None, "a", 3, made["orbit"]],
                "over": [None, 3, "ab", {"E": (24, 25)}, {"E": (24, 25), "q": (0, 1)}, {"E": 1, "V_ref": 2}],
                "outputs": OF_ARC,
                "solver": SOLVER,
                "max_steps": [0, *COUNT],
                "progress": [3, "a"],
            },
        ),
        *equilibria(made),
        (
            call(hybrid.open_branch, made["branch"].system, made["branch"].to_xarray()),
            {"system": [None, 3, "a"], "saved": [None, 3, "no such folder", made["flip"]]},
        ),
        (
            call(hybrid.open_diagram, made["rest"].system, made["diagram"].to_xarray()),
            {"system": [None, 3, "a"], "saved": [None, 3, "no such folder", made["branch"].to_xarray()]},
        ),
        (
            call(hybrid.open_end, arc.end.to_xarray()),
            {"saved": [None, 3, "no such file", made["flip"], made["branch"].to_xarray()]},
        ),
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
        (
            call(lyapunov.LyapunovSpectrum.per, made["impacts"], "impact"),
            {"transition": [None, *NAME]},
        ),
        (call(lyapunov.ModelComparison.cost, made["comparison"], "a"), {"name": [None, *NAME]}),
        (call(lyapunov.ModelComparison.distance, made["comparison"], "a"), {"name": [None, *NAME]}),
        *(
            (call(method, made["comparison"], 0.1), {"tolerance": LIMIT[:-1]})
            for method in (lyapunov.ModelComparison.within, lyapunov.ModelComparison.cheapest)
        ),
    ]
