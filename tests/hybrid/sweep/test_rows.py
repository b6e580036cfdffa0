"""Starts, ends and sections of the rows of a sweep, on flows with closed forms."""

import numpy as np
import pytest

from hybrid import ArgumentError, Guard, HybridSystem, Mode, ModelError, Reset, Transition, simulate
from hybrid.kernels.types import codes
from hybrid.simulation.plan import check_solver
from hybrid.sweep.rows import rows_of

# A saw: ``x`` rises at rate ``r`` from 0 to 1, ``n`` counts the teeth.
SAW = HybridSystem(
    state=("x", "n"),
    parameters={"r": 1.0},
    modes=[Mode("rise", lambda t, x, p: (p.r, 0.0))],
    transitions=[
        Transition(
            "rise",
            "rise",
            Guard(lambda t, x, p: x.x - 1.0, +1),
            Reset(lambda t, x, p: (x.x - 1.0, x.n + 1.0)),
        )
    ],
    period=2.0,
    units={"x": "m"},
)
# Two modes that allow states on one side each.
SIDES = HybridSystem(
    state=("x",),
    parameters={"r": 1.0},
    modes=[Mode("low", lambda t, x, p: (p.r,)), Mode("high", lambda t, x, p: (-p.r,))],
    transitions=[
        Transition("low", "high", Guard(lambda t, x, p: x.x, +1), name="up"),
        Transition("high", None, Guard(lambda t, x, p: x.x, -1), name="end"),
    ],
)


def rows(system=SAW, over=None, x0=(0.0, 0.0), **options):
    defaults = {
        **{"mode": None, "parameters": None, "t0": 0.0, "solver": None, "points": 0, "at": None},
        **{"continue_from": None, "results": ("exponents",)},
    }
    return rows_of(system, over or {"r": [1.0, 2.0]}, x0, **defaults | options)


class TestStart:
    def test_swept_components_replace_those_of_the_start(self):
        found = rows(over={"n": [5.0], "r": [1.0]}, x0={"x": 0.25})
        assert found.starts == ("n",)
        np.testing.assert_array_equal(found.origin({"n": 5.0, "r": 1.0}), [0.25, 5.0])
        np.testing.assert_array_equal(found.x0, [0.25, 0.0])
        assert rows(x0=(0.5, 1.0)).origin({"r": 1.0}) is not None
        trajectory = found.begin({"n": 5.0, "r": 2.0}, None, None, SAW)
        np.testing.assert_array_equal(trajectory.x, [0.25, 5.0])
        np.testing.assert_array_equal(trajectory.field(), [2.0, 0.0])

    def test_fixed_parameters_hold_in_each_row(self):
        found = rows(over={"x": [0.5]}, parameters={"r": 3.0}, t0=1.5)
        trajectory = found.begin({"x": 0.5}, None, None, SAW)
        np.testing.assert_array_equal(trajectory.field(), [3.0, 0.0])
        assert trajectory.t == 1.5

    def test_a_place_that_the_system_does_not_allow_is_not_taken(self):
        """A state on the other side of its guard, from another row."""
        found = rows(SIDES, x0=(-0.5,), mode="low")
        taken = found.begin({"r": 1.0}, (np.array([0.25]), "high"), None, SIDES)
        assert (taken.mode, float(taken.x[0])) == ("high", 0.25)
        for place in ((np.array([0.25]), "nope"), (np.array([np.nan]), "high")):
            begun = found.begin({"r": 1.0}, place, None, SIDES)
            assert (begun.mode, float(begun.x[0])) == ("low", -0.5)

    def test_a_row_goes_on_in_its_mode(self):
        for system, x0, wanted in ((SAW, (0.25, 0.0), "rise"), (SIDES, (-0.5,), "low")):
            found = rows(system, x0=x0)
            trajectory = found.begin({"r": 1.0}, None, None, system)
            state, mode = found.end_of(trajectory, codes.DONE)
            np.testing.assert_array_equal(state, x0)
            assert mode == wanted
            assert found.end_of(trajectory, codes.MAX_STEPS) is None


class TestSection:
    """The saw at rate 0.6 from 0.1, over periods of 2, and at the surface ``x = 1/2``."""

    @pytest.mark.parametrize(
        ("at", "times"),
        [
            (None, 2.0 * np.arange(1, 6)),
            ("jumps", (np.arange(1, 6) - 0.1) / 0.6),
            (Guard(lambda t, x, p: x.x - 0.5, +1), (np.arange(5) + 0.4) / 0.6),
        ],
    )
    def test_points(self, at, times):
        found = rows(x0=(0.1, 0.0), points=5, at=at)
        trajectory = found.begin({"r": 0.6}, None, None, found.marked)
        states, code = found.section(trajectory, 5)
        assert code == codes.DONE
        rise = 0.1 + 0.6 * np.asarray(times)
        # A section at jumps has the states before them.
        count = np.floor(rise - 1e-9 if at == "jumps" else rise + 1e-9)
        np.testing.assert_allclose(states, np.column_stack([rise - count, count]), atol=1e-9)

    def test_no_points_and_points_that_never_come(self):
        found = rows(SIDES, x0=(-0.5,), at="jumps", points=3)
        trajectory = found.begin({"r": 1.0}, None, None, SIDES)
        states, code = found.section(trajectory, 0)
        assert (states.shape, code) == ((0, 1), codes.DONE)
        states, code = found.section(trajectory, 3)
        np.testing.assert_allclose(states, [[0.0], [0.0], [np.nan]], atol=1e-12)
        assert code != codes.DONE

    def test_a_place_for_the_section_is_needed_only_for_points(self):
        bare = HybridSystem(state=("x",), parameters={"r": 1.0}, modes=[Mode("a", lambda t, x, p: (p.r,))])
        for at, text in ((None, "declares no period"), ("jumps", "has no transitions")):
            assert rows(bare, x0=(0.0,), at=at).at == at
            with pytest.raises(ArgumentError, match=text):
                rows(bare, x0=(0.0,), at=at, points=1)


def test_what_decides_the_rows():
    found = rows(over={"x": [0.5]}, x0=(0.0, 2.0), parameters={"r": 3.0}, t0=1.5, at="jumps")
    facts = found.facts()
    assert facts == {
        "model": SAW,
        "x0": {"n": 2.0},
        "mode": None,
        "t0": 1.5,
        "parameter_r": 3.0,
        "solver": check_solver(None),
        "at": "jumps",
        "continue_from": None,
    }
    labels = found.labels({"section": ("sample", "state")})
    assert list(labels.coords["state"][1]) == ["x", "n"]
    assert labels.attrs["x"]["units"] == "m"


@pytest.mark.parametrize(
    ("over", "options", "along"),
    [
        ({"r": [1.0]}, {}, None),
        ({"r": [1.0]}, {"continue_from": "r"}, "r"),
        ({"r": [1.0]}, {"continue_from": "previous"}, "r"),
        ({"x": [0.5], "r": [1.0]}, {"continue_from": "previous"}, "r"),
    ],
)
def test_the_axis_along_which_rows_go_on(over, options, along):
    assert rows(over=over, **options).along == along


@pytest.mark.parametrize(
    ("over", "options", "text"),
    [
        ({"x": [0.5]}, {"continue_from": "x"}, "continue_from must be an axis of parameters"),
        ({"nope": [0.5]}, {}, "over: Parameter 'nope' does not exist"),
        ({"r": [0.5]}, {"parameters": {"r": 1.0}}, "'r' is given twice"),
        ({"r": [0.5]}, {"results": ("r",)}, "'r' is also the name of a result"),
        ({"r": [0.5]}, {"mode": "fall"}, "fall"),
    ],
)
def test_rows_that_cannot_be(over, options, text):
    with pytest.raises(ModelError, match=text):
        rows(over=over, **options)


def test_a_stage_of_a_growing_system_is_marked_once():
    """What is compiled for it is kept; an entry of another stage, which is gone, is replaced."""
    found = rows(points=1, at=Guard(lambda t, x, p: x.x - 0.5, +1))
    first = found._with(SIDES)
    assert first.system is SIDES
    assert len(first.marked.transitions) == len(SIDES.transitions) + len(SIDES.modes)
    assert found._with(SIDES).marked is first.marked
    found._stages[id(SAW)] = SIDES, first.marked
    other = found._with(SAW)
    assert other.system is SAW
    assert len(other.marked.transitions) == 2
    assert rows(at="jumps", points=1)._with(SIDES).marked is SIDES


def test_rows_of_a_whole_system_are_worked_on_once():
    found = rows()
    assert found.grown(lambda each: each) is found
    arc = simulate(SAW, (0.1, 0.0), (0.0, 2.0), parameters={"r": 0.6})
    np.testing.assert_allclose(arc.x[-1], [0.3, 1.0], atol=1e-12)
