"""Outputs of the orbits of a branch, functions whose zeros are located, and where a branch is to stop."""

import math
import pickle

import numpy as np
import pytest

import hybrid
import models
from hybrid import (
    ArgumentError,
    HybridSystem,
    Mode,
    StatusCode,
    continue_bifurcation,
    continue_orbit,
    periodic_orbit,
)
from hybrid.measures import amplitude, maximum, mean, minimum, rms
from hybrid.orbits.continuation import watch


def response(w, A=0.3):
    """Amplitude of the impact oscillator that does not touch its stop."""
    return A / np.hypot(1.0 - w**2, 0.1 * w)


@pytest.fixture(scope="module")
def free():
    """A free oscillation above the resonance: below w = 1.129 the stop at 1 is touched."""
    return periodic_orbit(models.impact_oscillator(), (-0.1, 0.0), parameters={"A": 0.3, "w": 1.5})


@pytest.fixture(scope="module")
def impacts():
    """One impact per period, with a fold at 1.750 and a grazing at the square root of 1.99."""
    return periodic_orbit(models.impact_oscillator(), (0.9, 1.0))


def circle():
    """Circles with the radius ``sqrt(mu)``, on which all motion has the period ``2 pi``."""

    def field(t, x, p):
        rate = p.mu - x.x**2 - x.y**2
        return rate * x.x - x.y, rate * x.y + x.x

    units = {"x": "m", "y": "m"}
    return HybridSystem(state=("x", "y"), parameters={"mu": 2.0}, modes=[Mode("turn", field)], units=units)


def test_outputs_of_a_resonance_curve(free):
    asked = {
        "peak": maximum("x"),
        "amplitude": amplitude("x"),
        "rms": rms("x"),
        "phase": lambda arc: arc.t[0],
    }
    branch = continue_orbit(free, "w", (1.2, 2.0), outputs=asked)
    assert branch.status.ok
    exact = response(branch.parameter)
    for name, values in (("peak", exact), ("amplitude", exact), ("rms", exact / math.sqrt(2))):
        assert branch[name].shape == (len(branch),)
        np.testing.assert_allclose(branch[name], values, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(branch["phase"], 0.0)
    np.testing.assert_array_equal(branch["x"], branch.x0[:, 0])


def test_outputs_of_an_autonomous_branch():
    orbit = periodic_orbit(circle(), (1.4, 0.0), period=6.0)
    branch = continue_orbit(
        orbit,
        "mu",
        (0.5, 3.0),
        outputs={"radius": maximum("x"), "rms": rms("y"), "mean": mean("x")},
        events={"unit": lambda arc: amplitude("x")(arc) - 1.0},
    )
    np.testing.assert_allclose(branch["radius"], np.sqrt(branch.parameter), rtol=0, atol=1e-10)
    np.testing.assert_allclose(branch["rms"], np.sqrt(branch.parameter / 2), rtol=0, atol=1e-10)
    np.testing.assert_allclose(branch["mean"], 0.0, atol=1e-10)
    (unit,) = branch.of("unit")
    assert unit.value == pytest.approx(1.0, abs=1e-10)
    assert unit.outputs["radius"] == pytest.approx(1.0, abs=1e-10)
    assert branch.output_units == {"radius": "m", "rms": "m", "mean": "m"}


def test_outputs_past_folds_and_changes_of_the_transitions(impacts):
    """The largest displacement is that of the stop, until the orbit is free; bifurcations have theirs too."""
    branch = continue_orbit(impacts, "w", (0.9, 2.0), outputs={"peak": maximum("x"), "low": minimum("x")})
    hits = np.array([len(branch.orbit(i).transitions) for i in range(len(branch))])
    assert set(hits) == {0, 1}
    np.testing.assert_allclose(branch["peak"][hits == 1], 1.0, atol=1e-10)
    lone = branch.parameter[hits == 0]
    np.testing.assert_allclose(branch["peak"][hits == 0], response(lone, 1.0), rtol=0, atol=1e-10)
    grazing, fold = branch.of("grazing")[0], branch.of("fold")[0]
    assert grazing.outputs["peak"] == pytest.approx(1.0, abs=1e-9)
    assert grazing.outputs["low"] == pytest.approx(-1.0, abs=1e-6)
    i = fold.position
    assert fold.outputs["low"] == pytest.approx(minimum("x")(fold.orbit.arc()), abs=1e-8)
    assert branch.parameter[i - 1] < fold.value > branch.parameter[i]


def test_zeros_of_functions_are_located(free):
    """The response is 0.25 where ``(1 - w^2)^2 + (0.1 w)^2 = (0.3 / 0.25)^2``."""
    events = {"quarter": lambda arc: maximum("x")(arc) - 0.25, "never": lambda arc: maximum("x")(arc) - 9.0}
    branch = continue_orbit(free, "w", (1.2, 2.0), events=events)
    (found,) = branch.of("quarter")
    square = 1.2**2
    b = 2.0 - 0.01
    exact = math.sqrt((b + math.sqrt(b**2 - 4 * (1.0 - square))) / 2)
    assert found.value == pytest.approx(exact, abs=1e-10)
    assert (found.kind, found.parameter, found.stable) == ("quarter", "w", (True, True))
    assert found.message == "events['quarter'] is zero"
    assert maximum("x")(found.orbit.arc()) == pytest.approx(0.25, abs=1e-9)
    assert branch.of("never") == branch.of("flip") == ()
    assert branch.outputs == found.outputs == {}


def test_several_zeros_in_one_step_are_in_order(free):
    limits = [0.2000, 0.2001, 0.2002, 0.2003]
    events = {f"at {each}": lambda arc, each=each: maximum("x")(arc) - each for each in limits}
    branch = continue_orbit(free, "w", (1.2, 2.0), events=events)
    values = [each.value for each in branch.bifurcations]
    assert len(values) == 4
    assert values == sorted(values)
    assert [each.kind for each in branch.bifurcations] == [f"at {each}" for each in limits[::-1]]


def test_a_function_that_stays_zero_has_no_zeros(impacts):
    """While it impacts the orbit reaches the stop exactly; free motion does not reach it."""
    events = {"reaches": lambda arc: maximum("x")(arc) - 1.0}
    branch = continue_orbit(impacts, "w", (0.9, 2.0), events=events)
    assert branch.of("grazing")
    assert branch.of("reaches") == ()


def test_a_function_that_jumps(impacts):
    """The number of impacts jumps at the grazing."""
    branch = continue_orbit(impacts, "w", (0.9, 2.0), events={"contact": lambda arc: len(arc.jumps) - 0.5})
    (found,) = branch.of("contact")
    assert found.value == pytest.approx(math.sqrt(1.99), abs=1e-5)
    assert branch.bifurcations.index(found) in (1, 2)


def test_a_zero_beside_a_change_of_the_transitions(impacts):
    """The speed of the free motion at the stop, which a little faster motion has just beyond its grazing."""
    w = math.sqrt(1.99) + 2e-6
    limit = float(response(w, 1.0))
    branch = continue_orbit(
        impacts, "w", (0.9, 2.0), events={"limit": lambda arc: amplitude("x")(arc) - limit}
    )
    values = [each.value for each in branch.of("limit") if not each.orbit.transitions]
    assert values == [pytest.approx(w, abs=1e-9)]


class TestStop:
    def test_at_a_kind(self, impacts):
        branch = continue_orbit(impacts, "w", (0.9, 2.0), stop="fold")
        assert [each.kind for each in branch.bifurcations] == ["fold"]
        assert branch.bifurcations[0].position == len(branch)
        assert branch.bifurcations[0].stable[1] is None
        assert branch.status.ok
        told = "The branch ends at the end of the range and at a fold (named in stop=)."
        assert branch.status.message == told

    def test_at_one_of_several_kinds(self, impacts):
        branch = continue_orbit(impacts, "w", (0.9, 2.0), stop=("grazing", "torus"))
        assert [each.kind for each in branch.bifurcations] == ["fold", "grazing"]

    def test_at_a_zero_of_a_function(self, free):
        near = {"near": lambda arc: maximum("x")(arc) - 0.15}
        branch = continue_orbit(free, "w", (1.2, 2.5), events=near, stop="near")
        assert branch.parameter.max() < branch.of("near")[0].value < 2.0
        assert "a zero of events['near'] (named in stop=)" in branch.status.message

    def test_where_a_function_of_an_orbit_is_true(self, free):
        branch = continue_orbit(free, "w", (1.2, 2.5), stop=lambda orbit: orbit.parameters["w"] > 1.8)
        assert np.sum(branch.parameter > 1.8) == 1
        assert branch.parameter.min() == 1.2
        assert "an orbit for which stop= is true" in branch.status.message

    def test_it_fails(self, free):
        branch = continue_orbit(free, "w", (1.2, 2.5), stop=lambda orbit: 1 / 0)
        assert branch.status.code == StatusCode.FAILED
        assert "stop raised ZeroDivisionError (division by zero) at w = " in branch.status.message


class TestFailures:
    def test_a_later_orbit_ends_the_branch(self, free):
        def fails(arc):
            if arc.parameters["w"] > 1.8:
                raise ValueError("too fast")
            return arc.parameters["w"]

        branch = continue_orbit(free, "w", (1.2, 2.5), outputs={"w^2": fails})
        assert branch.status.code == StatusCode.FAILED
        assert not branch.status.ok
        assert branch.parameter.min() == 1.2
        assert 1.7 < branch.parameter.max() <= 1.8
        np.testing.assert_allclose(branch["w^2"], branch.parameter, rtol=1e-14)
        text = "an orbit that a function fails on. outputs['w^2'] raised ValueError (too fast) at w = 1.8"
        assert text in branch.status.message

    def test_a_number_that_is_not_finite(self, free):
        def root(arc):
            with np.errstate(invalid="ignore"):
                return np.sqrt(1.8 - arc.parameters["w"])

        branch = continue_orbit(free, "w", (1.2, 2.5), events={"root": root})
        assert branch.status.code == StatusCode.FAILED
        assert "events['root'] must be finite; got nan at w = 1.8" in branch.status.message

    @pytest.mark.parametrize(
        ("given", "text"),
        [
            (lambda arc: 1 / 0, r"outputs\['y'\] raised ZeroDivisionError \(division by zero\) at w = 1.5"),
            (lambda arc: math.nan, r"outputs\['y'\] must be finite; got nan at w = 1.5"),
            (lambda arc: arc["x"], r"outputs\['y'\] must be a number; got array"),
            (lambda arc: "high", r"outputs\['y'\] must be a number; got 'high' at w = 1.5"),
            (maximum("z"), r"outputs\['y'\]: name: State component or output 'z' does not exist.*at w = 1.5"),
        ],
    )
    def test_the_first_orbit_is_refused(self, free, given, text):
        with pytest.raises(ArgumentError, match=text):
            continue_orbit(free, "w", (1.2, 2.0), outputs={"y": given})

    @pytest.mark.parametrize(
        ("options", "text"),
        [
            (
                {"outputs": [maximum("x")]},
                r"outputs must map names to functions of an arc; got \[maximum",
            ),
            ({"outputs": {"y": 1.0}}, r"outputs\['y'\] must be a function of an arc; got 1\.0"),
            ({"outputs": {1: maximum("x")}}, r"outputs: each name must be a text; got 1"),
            ({"outputs": {"x": maximum("x")}}, r"outputs: 'x' is the name of a component, .* as in 'peak_x'"),
            ({"outputs": {"period": maximum("x")}}, r"outputs: 'period' is a name that every branch has"),
            (
                {"outputs": {"w": maximum("x")}},
                r"outputs: 'w' is the name of a component, an output or",
            ),
            ({"outputs": {"x0_there": maximum("x")}}, r"outputs: 'x0_there' is a name that every branch has"),
            ({"events": {"fold": maximum("x")}}, r"events: 'fold' is a kind that every branch has"),
            ({"events": {"": maximum("x")}}, r"events: each name must be a text; got ''"),
            ({"stop": "flod"}, r"stop: Kind 'flod' does not exist\. Kinds: fold, .*Did you mean 'fold'\?"),
            (
                {"stop": 3},
                r"stop must be a kind of .*, or a function of an orbit; got 3",
            ),
            ({"stop": ()}, r"stop must be a kind of bifurcation, several of them"),
        ],
    )
    def test_arguments(self, free, options, text):
        with pytest.raises(ArgumentError, match=text):
            continue_orbit(free, "w", (1.2, 2.0), **options)

    def test_what_a_branch_is_asked_for(self, free):
        near = {"near": lambda arc: maximum("x")(arc) - 0.2}
        branch = continue_orbit(free, "w", (1.4, 1.7), outputs={"peak": maximum("x")}, events=near)
        with pytest.raises(ArgumentError, match=r"'peek' does not exist\. .*peak\. Did you mean 'peak'\?"):
            branch["peek"]
        with pytest.raises(
            ArgumentError, match=r"Kind 'nera' does not exist\. On this branch: near\. Kinds: fold"
        ):
            branch.of("nera")
        with pytest.raises(ArgumentError, match="kinds must be a kind of bifurcation, or several"):
            branch.of(())
        with pytest.raises(ArgumentError, match="bifurcation is a near, where no other branch of"):
            hybrid.switch_branch(branch.of("near")[0])


def test_nothing_is_run_that_is_not_asked_for(free, monkeypatch):
    monkeypatch.setattr(watch, "arc_of", None)
    monkeypatch.setattr(watch, "orbit_of", None)
    assert continue_orbit(free, "w", (1.4, 1.7)).status.ok


def test_a_branch_with_outputs_is_saved_and_opened_again(impacts):
    branch = continue_orbit(
        impacts,
        "w",
        (0.9, 1.8),
        outputs={"low": minimum("x"), "hits": lambda arc: len(arc.jumps)},
        events={"deep": lambda arc: minimum("x")(arc) + 3.0},
    )
    dataset = branch.to_xarray()
    np.testing.assert_array_equal(dataset["low"], branch["low"])
    assert dataset["low"].dims == ("point",)
    assert dataset["low_there"].dims == ("bifurcation",)
    again = hybrid.open_branch(branch.system, dataset)
    copied = pickle.loads(pickle.dumps(branch))
    for each in (again, copied):
        np.testing.assert_array_equal(each["low"], branch["low"])
        np.testing.assert_array_equal(each["hits"], branch["hits"])
        assert [other.value for other in each.of("deep")] == [other.value for other in branch.of("deep")]
        assert [other.outputs for other in each.bifurcations] == [
            other.outputs for other in branch.bifurcations
        ]
        assert [other.position for other in each.bifurcations] == [
            other.position for other in branch.bifurcations
        ]
        assert each.of("flip") == ()
    assert len(branch.of("deep")) == 2
    with pytest.raises(ArgumentError, match="saved"):
        hybrid.open_branch(branch.system, dataset.assign(low=dataset["low"] + 1.0))


def test_units_are_kept():
    orbit = periodic_orbit(circle(), (1.4, 0.0), period=6.0)
    branch = continue_orbit(
        orbit, "mu", (1.5, 2.5), outputs={"radius": maximum("x"), "other": lambda arc: 1.0}
    )
    dataset = branch.to_xarray()
    assert dataset["radius"].attrs == {"units": "m"}
    assert dataset["other"].attrs == {}
    assert hybrid.open_branch(branch.system, dataset).output_units == {"radius": "m"}


def test_outputs_along_a_curve_of_bifurcations(impacts):
    """Where free motion touches the stop it is as wide as the gap."""
    (grazing,) = continue_orbit(impacts, "w", (0.9, 1.8)).of("grazing")
    ranges = {"w": (1.38, 1.45), "A": (0.95, 1.05)}
    curve = continue_bifurcation(grazing, ranges, outputs={"peak": maximum("x"), "speed": maximum("v")})
    np.testing.assert_allclose(curve["peak"], 1.0, atol=1e-8)
    np.testing.assert_allclose(curve["speed"], curve["w"], atol=1e-6)
    np.testing.assert_array_equal(curve.to_xarray()["speed"], curve["speed"])
    with pytest.raises(ArgumentError, match=r"Parameter or output 'B' .*: w, A, peak, speed"):
        curve["B"]

    def fails(arc):
        return 1.0 if arc.parameters["A"] < 1.02 else math.inf

    cut = continue_bifurcation(grazing, ranges, outputs={"peak": fails})
    assert cut.status.code == StatusCode.FAILED
    assert cut["A"].max() < 1.02
    assert "outputs['peak'] must be finite; got inf at w = " in cut.status.message
    with pytest.raises(ArgumentError, match="outputs: 'A' is the name of a component, an output or"):
        continue_bifurcation(grazing, ranges, outputs={"A": fails})
