"""Defaults of the public calls and classes: part of what the library promises, like the names.

A changed default changes the results of every script that relies on it.
"""

import inspect

import pytest

import hybrid
import hybrid.plot
import hybrid.testing
import lyapunov

MODEL = {"mode": None, "parameters": None}
RUN = {**MODEL, "solver": None}
LONG = {**RUN, "t0": 0.0, "progress": False}
TOLERANCES = {"rtol": 1e-10, "atol": 1e-12, "max_step": float("inf"), "max_steps": 10**9}
CHECKING = {"rtol": 1e-12, "atol": 1e-14, "max_step": float("inf"), "max_steps": 20_000}
SYSTEM = {
    **{"period": None, "name": "", "units": None, "angles": None, "cyclic": ()},
    **{"outputs": None, "laws": None},
}
PLAIN = {"parameters": None, **SYSTEM}
SEARCH = {
    **{**LONG, "progress": None, "section": None, "interval": None, "periods": 1000, "recurrences": 10},
    **{"tolerance": 0.01, "features": None, "together": None},
}
SAMPLE = {"seed": 0}
FIGURE = {"ax": None, "figsize": None, "labels": None, "style": None}
DEFAULTS = {
    hybrid.DOP853: TOLERANCES,
    hybrid.RadauIIA: TOLERANCES,
    hybrid.Taylor: TOLERANCES,
    hybrid.Tsit5: TOLERANCES,
    hybrid.Every: {"offset": 0.0, "when": None},
    hybrid.At: {"when": None, "unit": None, "origin": None, "columns": None},
    hybrid.After: {"when": None, "restarts": True},
    hybrid.Delay: {"places": 8, "when": None},
    hybrid.Guard: {"direction": 0, "gradient": None, "when": None, "at_start": False},
    hybrid.Mode: {"jacobian": None, "holds": None, "part_of": None},
    hybrid.Contact: {"restitution": 0.0, "friction": 0.0, "slip": None, "static": None},
    hybrid.Pair: {"says": ""},
    hybrid.complementarity: {
        "modes": None,
        **{name: value for name, value in PLAIN.items() if name != "cyclic"},
    },
    hybrid.mechanics: {
        **{"mass": None, "forces": None, "kinetic": None, "potential": None, "impacts": "newton"},
        **{"together": 1e-9, "start": None, **PLAIN},
    },
    hybrid.Reset: {"jacobian": None},
    hybrid.Table: {"y": None, "kind": "linear", "unit": None, "origin": None},
    hybrid.Transition: {"reset": None, "accumulates_to": None, "part_of": None},
    hybrid.HybridSystem: {
        "state": (),
        "repeats": (),
        "held": (),
        "counters": (),
        "listed_order": False,
        "transitions": (),
        "start": None,
        "period": None,
        "name": "",
        "cyclic": (),
        "notes": (),
        "under_way": (),
        "growth": None,
    },
    hybrid.Answer: {
        **{"times": None, "saltation": None, "fundamental": None, "exponents": None},
        **{"steps": None, "seconds": None},
    },
    hybrid.switch_branch: {"solver": None},
    hybrid.continue_orbit: {
        **{"outputs": None, "events": None, "stop": None},
        **{"solver": None, "max_steps": 2000, "progress": None},
    },
    hybrid.continue_bifurcation: {"outputs": None, "solver": None, "max_steps": 500, "progress": None},
    hybrid.equilibrium: {"mode": None, "parameters": None, "max_iterations": 60},
    hybrid.continue_all: {
        **{"depth": 2, "most": 50, "sweep": None, "outputs": None, "store": None},
        **{"solver": None, "max_steps": 2000, "progress": None},
    },
    hybrid.continue_equilibrium: {"max_steps": 2000, "progress": None},
    hybrid.open_branch: {},
    hybrid.open_diagram: {},
    hybrid.open_end: {},
    hybrid.filippov: {"start": None, **SYSTEM},
    hybrid.from_equations: {**PLAIN, "modes": None, "repeats": ()},
    hybrid.split: {"modes": None},
    hybrid.Laws: {
        **dict.fromkeys(
            ("invariant", "equal", "conserved", "dissipated", "balance", "continuous", "across"), ()
        ),
        "elastic": None,
        "alike": (),
    },
    hybrid.repeat: {
        **{"state": (), "held": (), "counters": (), "parameters": None, "field": None, "transitions": ()},
        **{"units": None, "angles": None, "outputs": None, "laws": None},
    },
    hybrid.global_error: {**RUN, "max_jumps": 100_000},
    hybrid.simulate: {
        **{**RUN, "tangent": None, "samples": None, "keep_jumps": None, "max_jumps": 100_000},
        "sensitivities": (),
    },
    hybrid.simulate_many: {
        **{**RUN, "samples": None, "outputs": (), "max_jumps": 100_000, "executor": None, "progress": None},
    },
    hybrid.periodic_orbit: {
        **RUN,
        **{"t0": 0.0, "periods": 1, "period": None, "tolerance": 1e-10, "max_iterations": 30},
    },
    hybrid.poincare_section: {**LONG, "transient": 0},
    hybrid.stroboscopic_section: {**LONG, "transient": 0},
    hybrid.saltation_matrix: {"parameters": None},
    hybrid.sweep: {"store": None, "executor": None, "progress": None},
    lyapunov.chart: {
        **{**LONG, "progress": None, "k": 1, "intervals": 1000, "interval": None, "transient": 200},
        **{"section": 0, "at": None, "outputs": (), "continue_from": None, "store": None, "executor": None},
    },
    lyapunov.compare_models: {
        **RUN,
        **{"points": ({},), "k": None, "intervals": 300, "interval": None, "transient": 200},
        "progress": False,
    },
    lyapunov.covariant_vectors: {**LONG, "intervals": 1000, "interval": None, "transient": 200},
    lyapunov.finite_time_exponents: {**RUN, "interval": None, "intervals": None, "t0": 0.0},
    lyapunov.zero_one_test: {"frequencies": 100},
    lyapunov.lyapunov_spectrum: {
        **{**LONG, "k": None, "intervals": 1000, "interval": None, "transient": 200, "history": True},
    },
    lyapunov.two_orbit_exponents: {
        **{**LONG, "separation": 1e-8, "direction": None, "intervals": 1000, "interval": None},
        "transient": 0,
    },
    hybrid.attractors: {**SEARCH, **SAMPLE, "starts": 500, "executor": None},
    hybrid.basins: {**SEARCH, "store": None, "executor": None},
    hybrid.edge_state: {
        **{**LONG, "progress": None, "interval": None, "rounds": 100, "periods": 1000, "recurrences": 10},
        "tolerance": 0.01,
    },
    hybrid.basin_entropy: {"size": 5},
    hybrid.uncertainty_exponent: {"sizes": None},
    hybrid.basin_fractions: {
        **{**SEARCH, **SAMPLE, "along": None, "starts": 1000, "store": None, "executor": None},
    },
    hybrid.plot.plot_basins: {"size": None, **FIGURE},
    hybrid.plot.plot_fractions: FIGURE,
    hybrid.plot.plot_arc: {"components": None, **FIGURE},
    hybrid.plot.plot_contacts: FIGURE,
    hybrid.plot.plot_ends: {"x": 0, "y": None, "size": None, **FIGURE},
    hybrid.plot.plot_global_error: FIGURE,
    hybrid.plot.plot_graph: FIGURE,
    hybrid.plot.plot_jumps: FIGURE,
    hybrid.plot.plot_branch: {"y": 0, "over": None, "label": None, **FIGURE},
    hybrid.plot.plot_curve: FIGURE,
    hybrid.plot.plot_diagram: {"y": 0, "over": None, **FIGURE},
    hybrid.plot.plot_orbit: {"x": 0, "y": None, **FIGURE},
    hybrid.plot.plot_phase: FIGURE,
    hybrid.plot.plot_section: {"x": 0, "y": None, "size": None, **FIGURE},
    hybrid.plot.plot_sweep: {"size": None, **FIGURE},
    hybrid.plot.plot_work_precision: {"quantity": "state", **FIGURE},
    hybrid.plot.style: {"name": None, "labels": None},
}


def defaults(callable_):
    """The defaults of a signature, without those that attrs makes anew for each object."""
    found = inspect.signature(callable_).parameters.values()
    return {
        each.name: each.default
        for each in found
        if each.default is not each.empty and type(each.default).__name__ not in ("_Nothing", "NothingType")
    }


@pytest.mark.parametrize("callable_", DEFAULTS, ids=lambda each: each.__name__)
def test_defaults(callable_):
    found = defaults(callable_)
    if callable_ is lyapunov.compare_models:
        # Its parameters are those of its points.
        assert found == {name: value for name, value in DEFAULTS[callable_].items() if name != "parameters"}
    else:
        assert found == DEFAULTS[callable_]


def test_defaults_of_checks():
    found = defaults(hybrid.testing.check_system)
    assert found["examples"] == 50
    assert found["solver"] == hybrid.DOP853(**CHECKING)
    names = ("states", "parameters", "t_span", "mode", "laws")
    assert [found[name] for name in names] == [None] * len(names)


def test_defaults_of_work_precision():
    found = defaults(hybrid.work_precision)
    assert found["methods"] == {"Taylor": hybrid.Taylor(), "DOP853": hybrid.DOP853(), "Tsit5": hybrid.Tsit5()}
    assert found["tolerances"] == (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
    assert (found["tangent"], found["repeats"], found["longest"]) == (False, 5, 10.0)


def test_every_public_call_is_listed():
    listed = {each.__name__ for each in DEFAULTS} | {"work_precision"}
    # Bases, errors and results are made by the library.
    made = {"Bifurcation", "BifurcationCurve", "Branch", "CodimensionTwo", "HybridArc", "Solver"}
    made |= {"EquilibriumBifurcation"}
    made |= {"Attractor", "Attractors", "Status", "StatusCode", "TwoOrbitExponents"}
    for package in (hybrid, lyapunov):
        for name in package.__all__:
            each = getattr(package, name)
            if (
                inspect.ismodule(each)
                or name in made
                or (isinstance(each, type) and issubclass(each, Exception))
            ):
                continue
            if defaults(each) and not name.endswith("Orbit"):
                assert name in listed | made, name
