import re

import attrs
import numpy as np
import pytest

from hybrid.errors import ModelError
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.tracing import model_symbols, trace
from hybrid.system.derivatives import (
    DIFFERENCE_STEP,
    _central_difference,
    complex_step_error,
    reference_derivative,
    sample_points,
)
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import field_function
from hybrid.system.graph import HybridSystem


def oscillator(jacobian=None, *, field=lambda t, x, p: (x.v, -p.k * x.q**3 + np.cos(p.w * t))):
    return HybridSystem(
        state=("q", "v"), parameters={"k": 2.0, "w": 3.0}, modes=[Mode("a", field, jacobian=jacobian)]
    )


def test_points_are_near_1_and_have_all_signs():
    """At the first two, all components are positive, at the last one all are negative."""
    points = [*sample_points(40)]
    assert all(0.5 <= t <= 1.5 for t, _ in points)
    sizes = np.abs([x for _, x in points])
    assert 0.5 <= sizes.min() < 0.7
    assert 1.3 < sizes.max() <= 1.5
    signs = [{*np.sign(x)} for _, x in points]
    assert signs == [{1.0}, {1.0}, {-1.0, 1.0}, {-1.0}]
    assert len({x[0] for _, x in points}) == len(points)


def test_columns_are_the_states_then_time():
    symbols = model_symbols(2, 1)
    (q, v), (k,), t = symbols.x, symbols.p, symbols.t
    expressions = trace(lambda t, x, p: (x.v, -p.k * x.q**3 + t * x.v), ("q", "v"), ("k",))
    assert jacobian_of(expressions, symbols.variables) == [[0, 1, 0], [-3 * k * q**2, t, v]]


def test_right_derivatives_pass():
    oscillator(lambda t, x, p: ((0, 1, 0), (-3 * p.k * x.q**2, 0, -p.w * np.sin(p.w * t))))


def test_a_wrong_entry_is_named_with_point_given_and_expected():
    text = (
        r"Mode 'a': jacobian: entry D_q of v is .* at t = .*, x = \(.*\); the complex step of the field gives"
    )
    with pytest.raises(ModelError, match=text):
        oscillator(lambda t, x, p: ((0, 1, 0), (-2 * p.k * x.q**2, 0, -p.w * np.sin(p.w * t))))
    with pytest.raises(ModelError, match="entry D_t of v is"):
        oscillator(lambda t, x, p: ((0, 1, 0), (-3 * p.k * x.q**2, 0, 0)))


@pytest.mark.parametrize("entry", [np.inf, -np.inf, np.nan])
def test_an_entry_that_is_not_finite_where_the_function_is_smooth(entry):
    """A guard with such a gradient was passed without a crossing."""
    with pytest.raises(ModelError, match=f"entry D_q of v is {entry}"):
        oscillator(lambda t, x, p: ((0, 1, 0), (entry, 0, -p.w * np.sin(p.w * t))))


def test_the_complex_step_catches_the_eighth_digit():
    with pytest.raises(ModelError, match=r"entry D_v of q is 1\.00000001"):
        oscillator(lambda t, x, p: ((0, 1 + 1e-8, 0), (-3 * p.k * x.q**2, 0, -p.w * np.sin(p.w * t))))


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_a_wrong_derivative_is_found_in_any_units_of_the_rates(unit):
    """The kink is smaller than 1 in some units and larger in others."""

    def smooth(t, x, p):
        return unit * x.v, -unit * np.sin(x.q + t)

    def bent(t, x, p):
        return unit * x.v, -unit * np.abs(x.q - 1.0)

    def slopes(t, x, p, factor=1.0):
        force = -factor * unit * np.cos(x.q + t)
        return (0.0, unit, 0.0), (force, 0.0, force)

    oscillator(slopes, field=smooth)
    with pytest.raises(ModelError, match="entry D_q of v"):
        oscillator(lambda t, x, p: slopes(t, x, p, 1.0 + 1e-7), field=smooth)
    oscillator(lambda t, x, p: ((0, unit), (-unit * np.sign(x.q - 1.0), 0)), field=bent)
    with pytest.raises(ModelError, match="entry D_q of v"):
        oscillator(lambda t, x, p: ((0, unit), (unit * np.sign(x.q - 1.0), 0)), field=bent)
    for field, smooth_there in ((smooth, True), (bent, False)):
        system = oscillator(field=field)
        error = complex_step_error(system.variables, field_function(system.modes[0], system.variables))
        assert (error is None) is smooth_there


def test_a_missing_time_column_is_asked_for():
    with pytest.raises(ModelError, match=r"has 2 columns, but the field depends on t: D_t of v.*D_t last"):
        oscillator(lambda t, x, p: ((0, 1), (-3 * p.k * x.q**2, 0)))
    oscillator(lambda t, x, p: ((0, 1), (0, 0)), field=lambda t, x, p: (x.v, p.k))


def test_guards_and_resets_are_checked_too():
    good = HybridSystem(
        state=("q", "v"),
        modes=[Mode("a", lambda t, x, p: (x.v, 0.0))],
        transitions=[
            Transition(
                "a",
                "a",
                Guard(lambda t, x, p: x.q * x.v - t, gradient=lambda t, x, p: (x.v, x.q, -1.0)),
                Reset(
                    lambda t, x, p: (x.q, -(x.v**2)), jacobian=lambda t, x, p: ((1.0, 0.0), (0.0, -2 * x.v))
                ),
                name="hit",
            )
        ],
    )
    (transition,) = good.transitions
    no_time = attrs.evolve(transition.guard, gradient=lambda t, x, p: (x.v, x.q))
    with pytest.raises(
        ModelError, match=re.escape("Transition 'hit': gradient has 2 columns, but the guard")
    ):
        attrs.evolve(good, transitions=[attrs.evolve(transition, guard=no_time)])
    bad = attrs.evolve(transition.reset, jacobian=lambda t, x, p: ((1.0, 0.0), (0.0, 2 * x.v)))
    with pytest.raises(ModelError, match="Transition 'hit': jacobian: entry D_v of v"):
        attrs.evolve(good, transitions=[attrs.evolve(transition, reset=bad)])


def absolute(t, x, p):
    return (x.v, -np.abs(x.q - 1.0) * x.v)


def test_where_the_complex_step_misleads_central_differences_measure():
    right = oscillator(
        lambda t, x, p: ((0, 1), (-np.sign(x.q - 1.0) * x.v, -np.abs(x.q - 1.0))), field=absolute
    )
    assert right.dimension == 2
    with pytest.raises(ModelError, match="the central difference of the field gives"):
        oscillator(lambda t, x, p: ((0, 1), (0.0, -np.abs(x.q - 1.0))), field=absolute)


def test_points_without_a_value_are_passed_over():
    oscillator(lambda t, x, p: ((0, 1), (1 / x.q, 0)), field=lambda t, x, p: (x.v, np.log(x.q)))


@pytest.mark.parametrize(
    ("field", "runs"),
    [
        (lambda t, x, p: (x.v, np.sin(x.q)), True),
        (lambda t, x, p: (x.v, x.q if x.q > 0 else 0.0), False),
        (absolute, False),
    ],
)
def test_whether_the_complex_step_can_be_taken(field, runs):
    system = oscillator(field=field)
    assert (
        complex_step_error(system.variables, field_function(system.modes[0], system.variables)) is None
    ) is runs


def test_storing_a_complex_number_in_a_real_array_is_not_overlooked():
    def field(t, x, p):
        rate = np.zeros(2)
        rate[:] = x[::-1]
        return rate

    system = HybridSystem(state=2, modes=[Mode("a", field)])
    assert complex_step_error(system.variables, field_function(system.modes[0], system.variables)) is not None


def test_a_branch_on_an_array_entry_is_not_overlooked():
    system = HybridSystem(state=1, modes=[Mode("a", lambda t, x, p: x if x[0] > 0 else -x)])
    assert complex_step_error(system.variables, field_function(system.modes[0], system.variables)) is not None


class TestReference:
    """Derivatives of one field at ``t = 0.8``, ``x = (1.25, -0.5)``, whose second entry is given."""

    t, x = 0.8, np.array([1.25, -0.5])

    def at(self, second, method=reference_derivative, slow=1.0):
        system = HybridSystem(state=("q", "v"), modes=[Mode("a", lambda t, x, p: (x.v * slow, second(t, x)))])
        function = field_function(system.modes[0], system.variables)
        return method(system.variables, function, self.t, self.x, system.parameter_values())

    @pytest.mark.parametrize("method", [reference_derivative, _central_difference])
    @pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
    def test_of_a_smooth_function(self, method, size):
        found = self.at(lambda t, x: size * np.sin(2 * x.q) * x.v * t, method, size)
        s, c = np.sin(2.5), np.cos(2.5)
        exact = size * np.array([[0.0, 1.0, 0.0], [2 * c * -0.5 * 0.8, s * 0.8, s * -0.5]])
        error, near = np.abs(found.values - exact), 1e-9 if method is _central_difference else 1e-14
        assert error.max() < near * size
        assert np.all(error <= found.tolerance)
        assert found.tolerance.max() < 2e-6 * size
        assert (found.t, found.x.tolist()) == (self.t, self.x.tolist())

    def test_which_is_taken(self):
        assert self.at(lambda t, x: x.q * x.v).source == "complex step"
        # Beside its kink, the absolute value has no complex derivative.
        assert self.at(lambda t, x: np.abs(x.q)).source == "central difference"
        assert self.at(lambda t, x: np.abs(x.q)).values[1].tolist() == pytest.approx([1.0, 0.0, 0.0])
        assert self.at(lambda t, x: np.sqrt(x.v)) is None

    @pytest.mark.parametrize(
        ("second", "column"),
        [
            (lambda t, x: np.abs(x.q - 1.25), 0),
            (lambda t, x: np.maximum(x.v, -0.5) * 3, 1),
            (lambda t, x: np.abs(t - 0.8), 2),
            (lambda t, x: np.where(x.q > 1.25, 1.0, 0.0), 0),
        ],
    )
    @pytest.mark.parametrize("method", [reference_derivative, _central_difference])
    def test_kinks_and_jumps_are_not_judged(self, second, column, method):
        """Of the other entries, all are."""
        found = self.at(second, method)
        wanted = np.zeros((2, 3), dtype=bool)
        wanted[1, column] = True
        np.testing.assert_array_equal(np.isinf(found.tolerance), wanted)

    def test_what_bends_fast_is_no_kink(self):
        found = self.at(lambda t, x: np.sin(1e3 * x.q))
        assert np.all(np.isfinite(found.tolerance))
        assert found.values[1, 0] == pytest.approx(1e3 * np.cos(1250.0), rel=1e-12)

    def test_a_small_kink_beside_a_large_term_widens_the_tolerance(self):
        """The complex step leaves out the kink, and central differences have it."""
        found = self.at(lambda t, x: x.q**2 + 1e-8 * np.abs(x.q))
        assert found.source == "complex step"
        assert found.values[1, 0] == 2.5
        assert 1e-8 < found.tolerance[1, 0] < 1e-7
        assert np.all(found.tolerance > 0.0)

    @pytest.mark.parametrize("method", [reference_derivative, _central_difference])
    def test_there_is_none_where_the_function_ends(self, method):
        """On one side of the point, or within a part of the larger step."""
        q, step = self.x[0], DIFFERENCE_STEP
        for ends in (
            lambda q: q > self.x[0],
            lambda q: q < self.x[0],
            lambda u: abs(u - q) > 0.75 * step,
        ):
            assert self.at(lambda t, x, ends=ends: np.nan if ends(x.q) else x.q, method) is None
        assert self.at(lambda t, x: np.nan if abs(x.q - q) > 1.5 * step else x.q, method) is not None

    def test_another_is_confirmed_within_the_tolerance(self):
        found = self.at(lambda t, x: x.q * x.v)
        tolerance = found.tolerance[1, 0]
        for share, confirmed in ((0.9, True), (-0.9, True), (1.1, False), (-1.1, False), (np.nan, True)):
            other = found.values.copy()
            other[1, 0] += share * tolerance
            assert found.confirms(other) == confirmed
