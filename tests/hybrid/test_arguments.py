"""Invalid values for every argument of every public function: the error names the argument.

The table is checked against the signatures, so that a new argument without an entry fails.
"""

import inspect
from decimal import Decimal

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import hybrid
import hybrid.measures
import hybrid.plot
import hybrid.testing
import lyapunov
import lyapunov.plot
import lyapunov.study.regimes
import models
from hybrid.arguments import floats, number, one_of
from hybrid.errors import HybridError
from models import buck_converter, contact
from models.dry_friction_oscillator import den_hartog_amplitude
from models.one_impact import one_impact_orbits
from tests.hybrid.arguments.methods import methods
from tests.hybrid.arguments.models_and_testing import checks, laws
from tests.hybrid.arguments.plots import plots
from tests.hybrid.arguments.runs import runs
from tests.hybrid.arguments.systems import systems
from tests.hybrid.arguments.values import BALL, OSCILLATOR


def flip_of_the_converter():
    converter, given = buck_converter(), {"parameters": {"E": 20.0}}
    arc = hybrid.simulate(converter, (12.0, 0.5, 0.0), (0.0, 0.08), mode="on", **given)
    orbit = hybrid.periodic_orbit(converter, arc.x[-1], mode=str(arc.mode[-1]), **given)
    (flip,) = hybrid.continue_orbit(orbit, "E", (15.0, 30.0)).bifurcations
    return flip


@pytest.fixture(scope="module")
def made():
    """The objects that methods and plots are called on."""
    return {
        "arc": hybrid.simulate(BALL, (1.0, 0.0), (0.0, 1.0)),
        "slopes": hybrid.simulate(
            BALL, (1.0, 0.0), (0.0, 1.0), sensitivities=("e",), tangent=True, samples=[0.5, 1.0]
        ),
        "orbit": (orbit := hybrid.periodic_orbit(OSCILLATOR, (0.9, 1.0))),
        "flip": (flip := flip_of_the_converter()),
        "curve": hybrid.continue_bifurcation(flip, {"E": (24.5, 24.6), "V_ref": (11.2, 11.4)}),
        "branch": hybrid.continue_orbit(orbit, "w", (0.99, 1.01)),
        "rest": (rest := hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))),
        "rests": (rests := hybrid.continue_equilibrium(rest, "q", (8.0, 9.5))),
        "hopfs": hybrid.continue_bifurcation(rests.of("Hopf")[0], {"q": (8.4, 8.6), "kappa": (1.2, 1.3)}),
        "diagram": hybrid.continue_all(rest, "q", (8.9, 9.1)),
        "comparison": lyapunov.compare_models({"a": OSCILLATOR}, (0.0, 0.0), reference="a", intervals=5),
        "chart": lyapunov.chart(OSCILLATOR, {"c": [0.1, 0.2]}, (0.0, 0.0), intervals=5, section=3),
        "work": hybrid.work_precision(
            BALL, (1.0, 0.0), (0.0, 0.3), methods={"T": hybrid.Taylor()}, tolerances=[1e-6], repeats=1
        ),
        "section": hybrid.stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=3),
        "ends": hybrid.simulate_many(BALL, [(1.0, 0.0), (2.0, 0.0)], (0.0, 0.1)),
        "error": hybrid.global_error(BALL, (1.0, 0.0), (0.0, 0.1)),
        "swept": hybrid.sweep(lambda point: {"square": point["a"] ** 2}, {"a": [1.0, 2.0]}),
        "basins": hybrid.basins(OSCILLATOR, {"x": [-1.0, 0.0], "v": [0.0, 1.0]}),
        "fractions": hybrid.basin_fractions(OSCILLATOR, {"x": (-1.0, 0.0), "v": 0.0}, starts=3),
        "two": lyapunov.two_orbit_exponents(OSCILLATOR, (0.0, 0.0), intervals=5),
        "spectrum": lyapunov.lyapunov_spectrum(OSCILLATOR, (0.0, 0.0), intervals=5),
        "impacts": lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.9, 1.0), intervals=5),
    }


def table(made):
    """By public function: a valid call, and the values that each argument must refuse."""
    return [*runs(made), *systems(), *plots(made), *checks(), *laws(), *methods(made)]


# Classes that only the library creates, and errors.
NOT_CALLED = {
    "PiecewiseAffineField",
    "Bifurcation",
    "BifurcationCurve",
    "Branch",
    "CodimensionTwo",
    "run_settings",
    "Status",
    "StatusCode",
    "HybridError",
    "ModelError",
    "ArgumentError",
    "PropertyError",
    "CompiledSystem",
    "Grazing",
    "HybridArc",
    "ArcEnd",
    "Jump",
    "GlobalError",
    "PeriodicOrbit",
    "Equilibrium",
    "EquilibriumBifurcation",
    "EquilibriumBranch",
    "EquilibriumCurve",
    "SpecialEquilibrium",
    "Diagram",
    "EdgeState",
    "BasinEntropy",
    "UncertaintyExponent",
    "Section",
    "WorkPrecision",
    "LyapunovSpectrum",
    "CovariantVectors",
    "Attractor",
    "Attractors",
    "ZeroOneTest",
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
    for module in (hybrid, hybrid.measures, hybrid.testing, lyapunov):
        found += [getattr(module, name) for name in module.__all__]
    plots = [each for name, each in vars(lyapunov.plot).items() if name.startswith("plot_")]
    assert len(plots) == 10
    found += [*plots, hybrid.plot.style, lyapunov.study.regimes.plot_regimes]
    found += [getattr(hybrid.plot, name) for name in hybrid.plot.__all__ if name.startswith("plot")]
    found += [each for name, each in vars(models).items() if inspect.isfunction(each)]
    laws = (contact.Rigid, contact.Hertz, contact.HuntCrossley, contact.KelvinVoigt)
    found += [*laws, contact.matched_laws, contact.hertz_stiffness, one_impact_orbits, den_hartog_amplitude]
    for each in list(found):
        if inspect.isclass(each) and each.__name__ not in WITHOUT_METHODS and not issubclass(each, Exception):
            for name, method in vars(each).items():
                if inspect.isfunction(method) and (not name.startswith("_") or name == "__call__"):
                    found.append(method)
    return [each for each in found if getattr(each, "__name__", "run_settings") not in NOT_CALLED]


def arguments_of(function):
    """Names of the arguments that a caller gives."""
    if not callable(function):
        return []
    return [
        name
        for name in inspect.signature(function).parameters
        if name not in ("self", "cls", "args", "kwargs", "options")
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


ODD_LIST: list = []
ODD_LIST.append(ODD_LIST)


class Unwilling:
    """A collection that raises an error of its own when it is looked into."""

    def __len__(self):
        raise ValueError("no length")

    def __iter__(self):
        raise ValueError("no items")


class UnwillingFloat(float):
    """A number that raises an error of its own when it is converted."""

    def __float__(self):
        raise RuntimeError("no number")


ODDITIES = {
    # Python refuses to write it in digits.
    "long integer": -(10**5000),
    "unwilling number": UnwillingFloat(0.5),
    "largest": 1.7e308,
    "large": -1e300,
    "small": 1e-160,
    "smallest": 5e-324,
    "large pair": (-1e300, 1e308),
    "half precision": np.float16(0.5),
    "largest unsigned": np.uint64(2**64 - 1),
    "empty points": np.zeros((0, 2)),
    "column of objects": np.array([[0.5], [0.75]], object),
    "zero-dimensional object": np.array(None),
    "masked": np.ma.masked,
    "dataset": xr.Dataset({"a": 1.0}),
    "series": pd.Series({"q": 0.5, "v": 0.25}),
    "missing": pd.NA,
    "integer as a name": {10**5000: 1.0},
    "unwilling": Unwilling(),
    "object": object(),
    "int": int,
    "type": type,
    "len": len,
    "no arguments": lambda: 1.0,
    "nothing": lambda *given: None,
    "raises": lambda *given: 1 / 0,
    "empty list": [],
    "empty mapping": {},
    "empty array": np.array([]),
    "error": ValueError,
    "system": BALL,
    "nul": "a\0b",
    "surrogate": "\ud800",
    "long": "a" * 10_000,
    "memory": memoryview(b"abc"),
    "fields": np.zeros(2, dtype=[("a", float)]),
    "itself": ODD_LIST,
    "decimal": Decimal("1.5"),
    "date": np.datetime64("2020-01-01"),
}
# Each of its calls runs a system many times, so one argument and one example are enough.
SLOW = {"check_system": ("laws", {"examples": 1})}


@pytest.mark.parametrize("oddity", ODDITIES)
def test_no_oddity_raises_an_error_from_inside(made, oddity):
    """Each argument of each function accepts it, or refuses it by an error of the library."""
    failures = []
    for function, positional, options in [each for each, _ in table(made)]:
        only, few = SLOW.get(function.__name__, (None, {}))
        for argument in [only] if only else arguments_of(function):
            given = dict(zip(inspect.signature(function).parameters, positional, strict=False))
            given |= options | few
            try:
                function(**{**given, argument: ODDITIES[oddity]})
            except (HybridError, hybrid.testing.PropertyError):
                pass
            except Exception as error:
                failures.append(f"{function.__qualname__}({argument}): {type(error).__name__}: {error}")
        plt.close("all")
    assert not failures, "\n" + "\n".join(failures)


def test_one_of_a_few_values_is_the_same_object_or_an_equal_text():
    allowed = (None, "inner", 1)
    assert one_of("kind", None, allowed) is None
    assert one_of("kind", "".join(["in", "ner"]), allowed) == "inner"
    assert one_of("kind", 1, allowed) == 1
    for other in (1.0, True, "outer", np.array(["inner"])):
        with pytest.raises(HybridError, match='kind must be None, "inner" or 1; got'):
            one_of("kind", other, allowed)


@pytest.mark.parametrize(("value", "told"), [(10**400, "inf"), (-(10**400), "-inf")], ids=["inf", "-inf"])
def test_a_number_too_large_for_a_float_is_an_infinity_of_its_sign(value, told):
    with pytest.raises(hybrid.ArgumentError, match=f"must be finite; got {told}"):
        number("x", value)
    assert floats([1, value]).tolist() == [1.0, float(told)]
