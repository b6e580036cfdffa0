"""What counts as a difference between a compiled function and Python's, without compilation."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.compiler import agreement
from hybrid.compiler.opaque import OpaqueFunction
from hybrid.errors import ModelError
from hybrid.symbolic.values import TraceError
from hybrid.system.elements import Guard, Mode, Transition
from hybrid.system.functions import condition_function, field_function
from hybrid.system.graph import HybridSystem

X, VALUES = np.array([0.5, 0.25]), np.array([3.0])


def field(t, x, p):
    return x.v, -p.k * x.q


def jacobian(t, x, p):
    return (0.0, 1.0), (-p.k, 0.0)


def untraced(t, x, p):
    return (x.v, -p.k * x.q) if p.k > 0 else (x.q, x.v)


def system_of(field, jacobian=None, when=None):
    return HybridSystem(
        state=("q", "v"),
        parameters={"k": 3.0},
        modes=[Mode("a", field, jacobian=jacobian)],
        transitions=[Transition("a", "a", Guard(lambda t, x, p: x.q - 9.0, when=when), name="gate")],
    )


def stub(system, found=None, slopes=None, opaque=False):
    """A compiled system whose functions have these values."""
    function = system.modes[0].field
    held = OpaqueFunction("title", function, "reason", ("q", "v"), ("k",), (2,))
    return SimpleNamespace(
        system=system,
        emitted=SimpleNamespace(opaque={"model_0": held} if opaque else {}),
        value=lambda *_: np.array(found, dtype=float),
        derivative=lambda *_: np.array(slopes, dtype=float),
    )


def told(compiled, function=None, x=X):
    system = compiled.system
    function = function or field_function(system.modes[0], system.dimension)
    return agreement.disagreement(compiled, function, 0, 2.0, x, VALUES)


class TestValues:
    @pytest.mark.parametrize(
        ("found", "expected"),
        [
            ((0.25, -1.5), None),
            ((0.25, -1.5 * (1 + 1e-15)), None),
            ((0.25, -1.5 * (1 + 1e-12)), "Mode 'a': field: value 1 is -1.5000000000015 compiled and -1.5 in"),
            (
                (0.2500001, -1.5),
                "Mode 'a': field: value 0 is 0.2500001 compiled and 0.25 in Python, at t",
            ),
            ((0.24, -1.4), "Mode 'a': field: value 0 is 0.24 compiled and 0.25 in Python"),
            # A number that is lost in another order of operations is no difference where it can be traced.
            ((math.nan, -1.5), None),
            ((math.inf, -1.5), None),
            ((math.nan, -1.4), "value 1 is -1.4 compiled and -1.5 in Python"),
        ],
    )
    def test_of_a_traced_function(self, found, expected):
        text = told(stub(system_of(field), found))
        assert text is None if expected is None else expected in text

    @pytest.mark.parametrize(
        ("found", "expected"),
        [
            ((0.25, -1.5 * (1 + 1e-9)), None),
            ((0.25, -1.5 * (1 + 1e-7)), "a branch on the type of a number, an error that it catches"),
            ((0.25, math.nan), "value 1 is nan compiled and -1.5 in Python"),
            ((math.nan, -1.5), "a whole number beyond 2**63"),
        ],
    )
    def test_of_a_function_that_is_compiled_as_it_is(self, found, expected):
        slopes = ((0.0, 1.0, 0.0), (-3.0, 0.0, 0.0))
        text = told(stub(system_of(untraced), found, slopes, opaque=True))
        assert text is None if expected is None else expected in text

    def test_of_a_condition(self):
        """It has one value and no derivative."""
        system = system_of(field, when=lambda t, x, p: x.q * 1.0)
        condition = condition_function(system.transitions[0])
        assert told(stub(system, [0.5]), condition) is None
        text = told(stub(system, [0.75]), condition)
        assert text.startswith("Transition 'gate': when is 0.75 compiled and 0.5 in Python, at t = 2, x = (")

    def test_where_python_has_none(self):
        system = system_of(lambda t, x, p: (x.v, math.sqrt(1.0 - x.q) if p.k > 0 else x.q))
        assert told(stub(system, [7.0, 7.0]), x=np.array([2.0, 0.25])) is None


class TestDerivatives:
    @pytest.mark.parametrize(
        ("slopes", "expected"),
        [
            (((0.0, 1.0, 0.0), (-3.0, 0.0, 0.0)), None),
            # The column of time is not given, so it is not compared.
            (((0.0, 1.0, 7.0), (-3.0, 0.0, 7.0)), None),
            (((0.0, 1.0, 0.0), (-3.1, 0.0, 0.0)), "Mode 'a': jacobian: value 2 is -3.1 compiled and -3 in"),
            (((0.0, 1.0, 0.0), (-3.0, 1e-3, 0.0)), "Mode 'a': jacobian: value 3 is 0.001 compiled and 0 in"),
        ],
    )
    def test_that_are_given(self, slopes, expected):
        text = told(stub(system_of(field, jacobian), (0.25, -1.5), slopes))
        assert text is None if expected is None else text.startswith(expected)

    def test_that_are_given_but_have_no_value(self):
        """The point is passed over, as where the function has none."""

        def raising(t, x, p):
            return (0.0, 1.0), (-3.0, 1 / 0)

        system = SimpleNamespace(
            variables=system_of(field).variables, modes=[Mode("a", field, jacobian=raising)]
        )
        system.dimension, system.state, system.parameters = 2, ("q", "v"), {"k": 3.0}
        assert told(stub(system, (0.25, -1.5), np.zeros((2, 3)))) is None

    def test_that_are_derived_by_tracing_are_not_compared(self):
        assert told(stub(system_of(field), (0.25, -1.5), np.full((2, 3), 7.0))) is None

    @pytest.mark.parametrize(
        ("slopes", "expected"),
        [
            (((0.0, 1.0, 0.0), (-3.0, 0.0, 0.0)), None),
            (((0.0, 1.0, 0.0), (-3.0 - 1e-8, 1e-8, 0.0)), None),
            # The second row has the size 3 for its derivatives, and 1.5 / 0.5 for its value.
            (((0.0, 1.0, 0.0), (-3.0, 5.5e-7, 0.0)), None),
            (((0.0, 1.0, 0.0), (-3.0, 6.5e-7, 0.0)), "the derivative is 6.5e-07 compiled and 0 in Python"),
            # The first row has the size 1 for its derivatives, and 0.25 / 0.5 for its value.
            (((1.4e-7, 1.0, 0.0), (-3.0, 0.0, 0.0)), None),
            (((1.6e-7, 1.0, 0.0), (-3.0, 0.0, 0.0)), "the derivative is 1.6e-07 compiled and 0 in Python"),
            (((0.0, 1.0, 0.0), (-3.0, 0.0, 0.01)), "the derivative is 0.01 compiled and 0 in Python"),
            (((0.0, 1.0, 0.0), (math.nan, 0.0, 0.0)), "the derivative is nan compiled and -3 in Python"),
        ],
    )
    def test_by_the_complex_step(self, slopes, expected):
        text = told(stub(system_of(untraced), (0.25, -1.5), slopes, opaque=True))
        assert text is None if expected is None else f"Mode 'a': field: {expected}" in text
        assert text is None or "Likely: a branch on the type of a number." in text

    def test_where_the_complex_step_has_none(self):
        """``abs`` of complex numbers that are ordered fails; a division by zero has no finite slope."""

        def ordered(t, x, p):
            return (x.v, -p.k * x.q) if x.q > 0 else (x.q, x.v)

        assert told(stub(system_of(ordered), (0.25, -1.5), np.zeros((2, 3)), opaque=True)) is None


def test_points_are_near_1_and_of_other_sizes_with_parameters_near_the_declared():
    points = [*agreement.comparison_points(system_of(field))]
    assert [values.tolist() for *_, values in points[:4]] == [[3.0]] * 4
    for size, *pair in zip((1e-3, 30.0, 1e3), points[4::2], points[5::2], strict=True):
        for t, x, _ in pair:
            assert 0.5 * size <= t <= 1.5 * size
            assert np.all((0.5 * size <= abs(x)) & (abs(x) <= 1.5 * size))
        assert pair[0][2] == 3.0
        assert 0.0 < abs(pair[1][2] / 3.0 - 1.0) <= 0.1
    # States of both signs, and parameters on both sides of the declared ones.
    signs = np.array([np.sign(x) for _, x, _ in points[4:]])
    assert {*signs.ravel()} == {-1.0, 1.0}
    assert {*np.sign([values[0] - 3.0 for *_, values in points[5::2]])} == {-1.0, 1.0}


def test_every_function_is_compared_until_one_differs():
    system = system_of(field)
    compiled = stub(system, (0.25, -1.5))
    calls = []

    def value(function, index, t, x, values):
        calls.append((function.kind, index, t, tuple(x)))
        p = system.variables.parameter_view(values)
        return np.ravel(np.array(function.value(t, system.variables.state_view(x), p), dtype=float))

    compiled.value = value
    agreement.check_agreement(compiled)
    points = [(t, tuple(x)) for t, x, _ in agreement.comparison_points(system)]
    assert calls == [(kind, 0, *point) for kind in ("field", "guard") for point in points]
    compiled.value = lambda *given: value(*given) + (given[0].kind == "guard")
    with pytest.raises(ModelError, match=r"^Transition 'gate': guard is "):
        agreement.check_agreement(compiled)


def test_what_an_earlier_stage_has_compared_is_passed_over():
    """A system that grows remembers the functions that agree."""
    system = system_of(field)
    compared, calls = field_function(system.modes[0], 2), []

    def value(function, *_):
        calls.append(function.kind)
        return np.array([7.0, 7.0])

    names = ("dimension", "modes", "parameter_values", "parameters", "state", "transitions", "variables")
    growth = SimpleNamespace(written={("agrees", *compared.identity): compared})
    grown = SimpleNamespace(**{name: getattr(system, name) for name in names}, growth=growth)
    compiled = SimpleNamespace(system=grown, emitted=SimpleNamespace(opaque={}), value=value)
    agreement.check_agreement(compiled)
    assert calls == ["guard"] * len([*agreement.comparison_points(system)])


@pytest.mark.parametrize(
    ("found", "wanted", "text"),
    [
        (1.0, 2.0, "1 compiled and 2 in Python"),
        (1.0, 1.0 + 1e-12, "1 compiled and 1.000000000001 in Python"),
        (1.0, 1.0 + 2**-52, "1 compiled and 1.0000000000000002 in Python"),
    ],
)
def test_as_many_digits_as_tell_two_numbers_apart(found, wanted, text):
    given = agreement._told(system_of(field), "It", found, wanted, 2.0, X, VALUES, "chance")
    assert given == f"It is {text}, at t = 2, x = (0.5, 0.25). Likely: chance."


class TestRounding:
    def test_numbers_are_moved_to_both_sides_by_a_few_last_places(self):
        moved = agreement._shake(np.full(200, 3.0), np.random.default_rng(0)) / 3.0 - 1.0
        assert moved.min() < -agreement.EPSILON
        assert moved.max() > agreement.EPSILON
        assert abs(moved).max() <= 3 * agreement.EPSILON
        assert agreement._shake(2.0, np.random.default_rng(0)) == pytest.approx(2.0, rel=1e-15)

    def test_operations_are_shaken_one_by_one(self):
        """Large terms that cancel leave the rounding of their size."""

        def function(t, x, p):
            return (x.q + 1e6) - 1e6, x.v, 7.0

        rng = np.random.default_rng(1)
        found = agreement._shaken_operations(system_of(field), function, 2.0, X, VALUES, rng)
        assert found.shape == (agreement.SHAKES, 3)
        assert 1e-11 < np.ptp(found[:, 0]) < 1e-8
        assert 0.0 < np.ptp(found[:, 1]) < 1e-15
        assert np.all(found[:, 2] == 7.0)
        np.testing.assert_allclose(found[:, 0], 0.5, rtol=1e-8)

    def test_results_of_operations(self):
        shaken = agreement._Shaken(np.random.default_rng(3))
        one, two = np.full(50, 1.0), np.full(50, 2.0)
        total = shaken.combined("add", (one, two))
        assert 0.0 < abs(total - 3.0).max() < 1e-14
        np.testing.assert_array_equal(shaken.combined("less", (one, two)), np.full(50, True))
        chosen = shaken.combined(agreement.WHERE, (np.full(50, True), one, two))
        np.testing.assert_allclose(chosen, one, rtol=1e-15)
        assert type(shaken.number(3)) is np.float64
        with pytest.raises(TraceError):
            shaken.expression(one)

    def test_the_band_of_what_can_be_traced(self):
        def function(t, x, p):
            return (x.q + 1e6) - 1e6, x.v

        band = agreement.rounding_band(system_of(field), function, 2.0, X, VALUES, np.array([0.5, 0.25]))
        # What a whole run of additions may lose: 1e6 times the rounding unit.
        assert 1e-10 < band[0] < 1e-8
        assert 1e-14 < band[1] < 1e-12

    def test_the_band_of_what_cannot_be_traced(self):
        """Differences of states inside it are allowed for: 1e-12 of the largest state."""
        x = np.array([0.5, -1e6])

        def function(t, x, p):
            return (x.q, 0.0) if t > 0.0 and math.sin(x.v) < 2.0 else (0.0, 0.0)

        band = agreement.rounding_band(system_of(field), function, 2.0, x, VALUES, np.array([0.5, 0.0]))
        assert band[1] == pytest.approx(1e-6, rel=1e-9)
        assert band[0] == pytest.approx(1e-6 + 5e-9, rel=1e-6)

    def test_a_value_at_one_point_only_has_no_bound(self):
        def function(t, x, p):
            return (x.q, 1.0) if t == 2.0 and x.q == 0.5 else (1 / 0, 0.0)

        band = agreement.rounding_band(system_of(field), function, 2.0, X, VALUES, np.array([0.5, 1.0]))
        assert np.all(band == math.inf)
