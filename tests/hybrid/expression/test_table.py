"""Tables in model functions, against closed forms."""

import pickle
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly, make_interp_spline

from hybrid import (
    DOP853,
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    RadauIIA,
    Table,
    Transition,
    Tsit5,
    compile_system,
    from_equations,
    simulate,
    simulate_many,
    split,
)

RNG = np.random.default_rng(0)
TIMES = np.sort(RNG.uniform(0.0, 10.0, 40))
VALUES = RNG.standard_normal(40)
SOLVERS = [None, DOP853(), Tsit5(), RadauIIA()]
STAIRS = Table([0.0, 1.0, 2.0, 3.5], [0.0, 3.0, -1.0, 0.5], kind="step")


def tank(rate, **parameters):
    return HybridSystem(state=("q",), parameters=parameters, modes=[Mode("fill", rate)])


def filled(rate, end=10.0, solver=None, **parameters):
    return simulate(tank(rate, **parameters), (0.0,), (0.0, end), solver=solver)["q"][-1]


def integral(table, end):
    """The integral of a table of steps or lines from 0 on: the rule of the middle is exact on each piece."""
    times = np.concatenate([[0.0], table.x[(table.x > 0.0) & (table.x < end)], [end]])
    return np.sum(np.diff(times) * table(0.5 * (times[1:] + times[:-1])))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["linear", "step"])
def test_the_integral_of_a_table_in_time(kind, solver):
    table = Table(TIMES, VALUES, kind=kind)
    found = filled(lambda t, x, p: (table(t),), solver=solver)
    assert found == pytest.approx(integral(table, 10.0), abs=1e-13)


def test_the_integral_of_a_spline():
    spline = CubicSpline(TIMES, VALUES)
    table = Table(TIMES, VALUES, kind="cubic")
    assert filled(lambda t, x, p: (table(t),)) == pytest.approx(float(spline.integrate(0.0, 10.0)), abs=1e-9)


@pytest.mark.parametrize(("a", "b"), [(3.0, 0.1), (-0.7, 6.5), (1 / 3, 0.0), (0.0, 4.5)])
def test_the_knots_of_an_affine_time_follow_the_parameters(a, b):
    table = Table(TIMES, VALUES, kind="step")
    times = [0.0, 10.0, *((k - b) / a for k in TIMES if a and 0.0 < (k - b) / a < 10.0)]
    times = np.sort(times)
    wanted = np.sum(np.diff(times) * table(a * 0.5 * (times[1:] + times[:-1]) + b))
    system = tank(lambda t, x, p: (table(p.a * t + p.b),), a=1.0, b=0.0)
    given = {"a": a, "b": b}
    found = simulate(system, (0.0,), (0.0, 10.0), parameters=given)["q"][-1]
    assert found == pytest.approx(wanted, abs=1e-12)
    many = simulate_many(system, [(0.0,), (1.0,)], (0.0, 10.0), parameters=given)
    np.testing.assert_allclose(many.x_end.values.ravel(), [wanted, 1.0 + wanted], atol=1e-12)


# Four ways to stretch time, with the factor and the offset of time that each one makes of ``d``.
STRETCHED = {
    "quotient": (lambda t, p: t / p.d, lambda d: (1.0 / d, 0.0)),
    "shifted quotient": (lambda t, p: t / p.d + 0.25, lambda d: (1.0 / d, 0.25)),
    "reciprocal": (lambda t, p: 2.0 * t * (1.0 / p.d), lambda d: (2.0 / d, 0.0)),
    "falling": (lambda t, p: (3.5 - t) / p.d, lambda d: (-1.0 / d, 3.5 / d)),
}


@pytest.mark.parametrize("name", STRETCHED)
@given(d=st.floats(0.5, 1.5))
@settings(max_examples=25)
def test_every_piece_of_a_stretched_table_acts_for_its_whole_time(name, d):
    """However the functions of the model round the argument, each step has the piece that holds inside it."""
    argument, affine = STRETCHED[name]
    a, b = affine(d)
    knots = np.sort([(k - b) / a for k in STAIRS.x if 0.0 < (k - b) / a < 6.0])
    times, right = [0.0, *knots, 6.0], 0.3
    for start, end in pairwise(times):
        limit = 2.0 * float(STAIRS(a * 0.5 * (start + end) + b))
        right = limit + (right - limit) * np.exp(-0.5 * (end - start))
    decay = tank(lambda t, x, p: (STAIRS(argument(t, p)) - 0.5 * x.q,), d=1.0)
    for system in (decay, split(decay)):
        for solver in SOLVERS:
            arc = simulate(system, (0.3,), (0.0, 6.0), parameters={"d": d}, solver=solver)
            assert arc["q"][-1] == pytest.approx(right, abs=1e-7)


@pytest.mark.parametrize("a", [1e-6, -1e-6, 1e6, -1e6])
def test_the_unit_of_time_of_a_stretched_table_does_not_matter(a):
    """The table is read from its first point on, with an offset a thousand times as large as its points."""
    system = tank(lambda t, x, p: (STAIRS(p.a * t + 1000.0),), a=1.0)
    start, end = np.sort([(k - 1000.0) / a for k in (0.0, 5.0)])
    arc = simulate(system, (0.0,), (start, end), parameters={"a": a})
    assert arc["q"][-1] * abs(a) == pytest.approx(integral(STAIRS, 5.0), abs=1e-9)


@pytest.mark.parametrize("d", [0.9, 0.7, 1.1])
def test_a_run_may_end_and_begin_at_a_point_of_a_stretched_table(d):
    system = tank(lambda t, x, p: (STAIRS(t / p.d) - 0.5 * x.q,), d=d)
    whole = simulate(system, (0.3,), (0.0, 6.0))["q"][-1]
    first = simulate(system, (0.3,), (0.0, d))
    second = simulate(system, first.x[-1], (d, 6.0))
    assert first.t[-1] == pytest.approx(d, rel=1e-14)
    assert second["q"][-1] == pytest.approx(whole, rel=1e-10)


def test_tangent_vectors_pass_the_knots():
    table = Table(TIMES, VALUES)
    system = tank(lambda t, x, p: (table(t) - p.k * x.q,), k=0.3)
    arc = simulate(system, (0.0,), (0.0, 10.0), tangent=True, sensitivities=("k",))
    assert arc.fundamental[0, 0] == pytest.approx(np.exp(-3.0), rel=1e-9)
    beside = [simulate(system, (0.0,), (0.0, 10.0), parameters={"k": k})["q"][-1] for k in (0.3001, 0.2999)]
    assert np.ravel(arc.sensitivity)[0] == pytest.approx((beside[0] - beside[1]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize("kind", ["linear", "step"])
def test_no_pulse_among_many_points_is_passed_over(kind):
    times, values = np.linspace(0.0, 1e4, 10_000), np.zeros(10_000)
    values[5000] = 7.0
    table = Table(times, values, kind=kind)
    found = filled(lambda t, x, p: (table(t),), end=1e4)
    assert found == pytest.approx(7.0 * (times[1] - times[0]), rel=1e-11)


def test_what_many_points_hold_is_not_compiled():
    one, other = (Table(x, x**2) for x in (np.linspace(0.0, 1.0, 1000), np.linspace(0.0, 2.0, 1000)))
    texts = [
        compile_system(tank(lambda t, x, p: (one(t),))).emitted.texts,
        compile_system(tank(lambda t, x, p: (other(t),))).emitted.texts,
    ]
    assert texts[0] == texts[1]


def test_interp_is_a_table():
    table = Table(TIMES, VALUES)
    found = filled(lambda t, x, p: (np.interp(t, TIMES, VALUES),))
    assert found == pytest.approx(integral(table, 10.0), abs=1e-13)
    # Beyond the points, other values.
    found = filled(lambda t, x, p: (np.interp(t, [1.0, 2.0], [0.0, 1.0], left=3.0, right=5.0),), end=4.0)
    assert found == pytest.approx(3.0 + 0.5 + 10.0, abs=1e-12)


@pytest.mark.parametrize("solver", SOLVERS[:2])
def test_a_force_as_a_table_keeps_the_energy(solver):
    places = np.linspace(-2.0, 2.0, 41)
    force = Table(places, -places - 0.3 * places**3)
    system = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, force(x.q)))])
    arc = simulate(system, (1.5, 0.0), (0.0, 20.0), solver=solver)

    def energy(q, v):
        knots = np.concatenate([[0.0], places[(places > 0.0) & (places < abs(q))], [abs(q)]])
        return 0.5 * v**2 - np.trapezoid(force(knots), knots)

    assert energy(*arc.x[-1]) == pytest.approx(energy(1.5, 0.0), rel=1e-7)


@pytest.mark.parametrize("kind", ["step", "linear", "cubic"])
@pytest.mark.parametrize(
    ("field", "reason"),
    [
        (lambda t, x, p, force: (x.v, force(t) + 0.3), "exact (polynomials of degree"),
        (
            lambda t, x, p, force: (x.v, 2.0 * force(0.7 * t + 0.3) - 4.0 * x.q - 0.1 * x.v),
            "exact (affine in",
        ),
        (lambda t, x, p, force: (x.v, force(t % 1.7) - x.q), "exact (affine in"),
        (lambda t, x, p, force: (x.v, force(t) * x.v - np.sin(x.q)), "Taylor series"),
    ],
)
def test_tables_of_time_have_series(kind, field, reason):
    times = np.array([0.2, 0.5, 0.6, 1.1, 1.9, 2.2, 3.0])
    force = Table(times, np.array([0.3, -1.0, 0.4, 0.8, -0.2, 0.5, 1.2]), kind=kind)
    system = HybridSystem(
        state=("q", "v"), modes=[Mode("swing", lambda t, x, p: field(t, x, p, force))], name="swing"
    )
    assert reason in str(compile_system(system))
    arc = simulate(system, (0.4, -0.1), (0.0, 3.5), tangent=True)
    beside = simulate(system, (0.4, -0.1), (0.0, 3.5), tangent=True, solver=Tsit5(rtol=1e-12, atol=1e-13))
    np.testing.assert_allclose(arc.x[-1], beside.x[-1], atol=1e-9)
    np.testing.assert_allclose(arc.fundamental, beside.fundamental, atol=1e-8)


def test_an_oscillator_under_a_staircase_is_exact():
    """Each stair is an arc of a circle in the phase plane."""
    times, stairs = np.arange(0.0, 10.0, 0.5), np.random.default_rng(3).normal(size=20)
    force = Table(times, stairs, kind="step")
    system = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, force(t) - x.q))])
    z = 1.0 + 0.0j
    for stair in stairs:
        z = stair + (z - stair) * np.exp(-0.5j)
    arc = simulate(system, (1.0, 0.0), (0.0, 10.0))
    np.testing.assert_allclose(arc.x[-1], [z.real, z.imag], atol=1e-14)


def test_guards_read_tables():
    charge = np.linspace(0.0, 1.0, 11)
    voltage = Table(charge, 3.0 + charge**2)
    empty = Guard(lambda t, x, p: voltage(x.s) - 3.25)
    cell = HybridSystem(
        state=("s",),
        modes=[Mode("run", lambda t, x, p: (-0.1,))],
        transitions=[Transition("run", None, empty)],
    )
    assert simulate(cell, (1.0,), (0.0, 20.0)).jumps.t == pytest.approx([5.0], rel=1e-12)
    limit = Table([0.0, 1.0, 2.0, 3.0], [5.0, 5.0, -1.0, 5.0], kind="step")
    above = Guard(lambda t, x, p: x.s - limit(t), direction=1)
    ramp = HybridSystem(
        state=("s",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[Transition("run", None, above)],
    )
    assert simulate(ramp, (0.0,), (0.0, 4.0)).jumps.t == pytest.approx([2.0], rel=1e-12)


def test_a_jump_in_the_state_is_told_and_a_surface_for_split():
    stairs = Table([0.0, 1.0, 2.0, 4.0], [1.0, 2.0, 0.5, 0.25], kind="step")
    system = tank(lambda t, x, p: (stairs(x.q),))
    assert "its field jumps where q is at a point of a table" in str(compile_system(system))
    apart = split(system)
    assert "jumps" not in str(compile_system(apart))
    arc = simulate(apart, (-1.0,), (0.0, 20.0), tangent=True)
    np.testing.assert_allclose(arc.jumps.t, [2.0, 2.5, 6.5], rtol=1e-14)
    assert arc["q"][-1] == pytest.approx(4.0 + 0.25 * 13.5, rel=1e-14)
    # The speed at the end over the speed at the start.
    assert arc.fundamental[0, 0] == pytest.approx(0.25, rel=1e-13)
    smooth = tank(lambda t, x, p: (stairs(t),))
    assert "jumps" not in str(compile_system(smooth))
    assert simulate(split(smooth), (0.0,), (0.0, 2.0))["q"][-1] == pytest.approx(3.0, abs=1e-14)


@pytest.mark.parametrize("pieces", range(2, 9))
def test_each_piece_of_a_table_that_jumps_in_the_state_lies_between_its_own_points(pieces):
    """``q' = a + b (q - knot)`` on each piece crosses the piece in the time ``log(1 + b length / a) / b``."""
    random = np.random.default_rng(pieces)
    knots = np.cumsum(0.5 + random.random(pieces + 1))
    rates, starts = random.uniform(0.1, 1.0, pieces), random.uniform(0.5, 2.0, pieces)
    speed = Table(PPoly(np.array([rates, starts]), knots, extrapolate=True))
    apart = from_equations(lambda t, x, p: (speed(x.q),), state=("q",))
    crossed = np.cumsum(np.log1p(rates * np.diff(knots) / starts) / rates)
    arc = simulate(apart, (knots[0],), (0.0, crossed[-1] - 0.01))
    np.testing.assert_allclose(arc.jumps.t, crossed[:-1], rtol=1e-9)
    np.testing.assert_allclose(arc.jumps.x_plus[:, 0], knots[1:-1], rtol=1e-9)


def test_a_state_slides_on_a_jump_of_a_table():
    gears = Table([0.0, 3.0, 6.0], [4.0, 2.0, 1.0], kind="step")
    apart = from_equations(lambda t, x, p: (gears(x.w) - 3.0, x.w), state=("w", "angle"))
    arc = simulate(apart, (0.5, 0.0), (0.0, 5.0))
    assert arc.jumps[0].t == pytest.approx(2.5, rel=1e-14)
    assert arc.mode[-1] == "w=3"
    assert arc.x[-1] == pytest.approx([3.0, 1.75 * 2.5 + 3.0 * 2.5], rel=1e-14)


@pytest.mark.parametrize(
    "data",
    [
        pd.Series(VALUES, index=TIMES),
        xr.DataArray(VALUES, dims="t", coords={"t": TIMES}),
        PchipInterpolator(TIMES, VALUES),
        CubicSpline(TIMES, VALUES),
    ],
    ids=["pandas", "xarray", "pchip", "spline"],
)
def test_points_from_other_libraries(data):
    table, u = Table(data), np.linspace(-1.0, 11.0, 50)
    wanted = data(u) if callable(data) else np.interp(u, TIMES, VALUES)
    np.testing.assert_allclose(table(u), wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(table))(u), table(u))
    assert repr(table).startswith("Table of 40 points")


def test_values_at_numbers_and_arrays():
    table = Table([0.0, 1.0], [2.0, 4.0])
    assert table(0.5) == 3.0
    np.testing.assert_array_equal(table([[-1.0, 0.0], [1.0, np.inf]]), [[2.0, 2.0], [4.0, 4.0]])
    assert np.isnan(table(np.nan))
    np.testing.assert_array_equal(Table([0.0, 1.0], [2.0, 4.0], kind="step")([-1.0, 0.9, 1.0]), [2, 2, 4])


def test_interp_with_a_period():
    times, values = [0.5, 4.0, 2.0], [1.0, 3.0, -2.0]
    system = tank(lambda t, x, p: (np.interp(t, times, values, period=5.0),))
    arc = simulate(system, (0.0,), (0.0, 12.3))
    knots = np.union1d(np.add.outer([0.5, 2.0, 4.0], [0.0, 5.0, 10.0]), [0.0, 12.3])
    knots = knots[knots <= 12.3]
    middle = np.interp((knots[1:] + knots[:-1]) / 2, times, values, period=5.0)
    assert arc.x[-1, 0] == pytest.approx(np.diff(knots) @ middle, rel=1e-12)


def test_interp_of_what_is_not_finite_is_refused():
    with pytest.raises(ModelError, match=r"np\.interp needs points and values that are finite"):
        compile_system(tank(lambda t, x, p: (np.interp(t, [0.0, 1.0, 2.0], [0.0, np.nan, 1.0]),)))


def test_a_spline_of_scipy_in_another_form_is_refused():
    with pytest.raises(ArgumentError, match="unless x is a Series, a DataArray or a spline"):
        Table(make_interp_spline(TIMES, VALUES))


@pytest.mark.parametrize("kind", [CubicSpline, PchipInterpolator])
def test_splines_of_scipy_are_called_as_they_are(kind):
    spline = kind(TIMES, VALUES)
    assert filled(lambda t, x, p: (spline(t),), TIMES[-1]) == pytest.approx(
        spline.integrate(0.0, TIMES[-1]), abs=1e-11
    )
    slope = filled(lambda t, x, p: (spline(t, 1),), TIMES[-1])
    assert slope == pytest.approx(spline(TIMES[-1]) - spline(0.0), abs=1e-11)
    assert spline([1.0, 2.0]).shape == (2,)


@pytest.mark.parametrize(
    ("x", "y", "text"),
    [
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], r"x must increase; got x\[1\] = 1.0 and x\[2\] = 1.0"),
        ([0.0, 1.0], [0.0, np.nan], r"y must be finite; got y\[1\] = nan"),
        ([0.0, 1.0], [0.0, 1.0, 2.0], "y must have one value per point; got 3 for 2 in x"),
        ([0.0], [0.0], "x must be at least two numbers"),
        ([0.0, 1.0], None, "y must be numbers"),
    ],
)
def test_bad_points(x, y, text):
    with pytest.raises(ArgumentError, match=text):
        Table(x, y)


@pytest.mark.parametrize("declared", [None, 5.0])
@pytest.mark.parametrize("kind", ["linear", "step"])
def test_a_cycle_that_repeats(kind, declared):
    cycle = Table([0.0, 1.0, 1.001, 5.0], [0.0, 1000.0, 3.0, 0.0], kind=kind)
    system = HybridSystem(
        state=("q",),
        parameters={"T": 5.0},
        modes=[Mode("fill", lambda t, x, p: (cycle(t % p.T),))],
        period=declared,
    )
    arc = simulate(system, (0.0,), (0.0, 52.0))
    assert arc.status.code.name == "SUCCESS"
    assert arc["q"][-1] == pytest.approx(10.0 * integral(cycle, 5.0) + integral(cycle, 2.0), rel=1e-13)
    assert arc.steps < 200
    if declared is None:
        arc = simulate(system, (0.0,), (0.0, 6.0), parameters={"T": 3.0})
        assert arc["q"][-1] == pytest.approx(2.0 * integral(cycle, 3.0), rel=1e-13)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["linear", "step"])
def test_a_cycle_that_begins_at_its_end_and_is_read_backwards(kind, solver):
    """The piece at the end of the cycle holds right behind the start of the run."""
    cycle = Table([0.0, 1.0, 2.0, 5.0], [0.0, 3.0, -1.0, 0.5], kind=kind)
    got = filled(lambda t, x, p: (cycle((-p.a * t) % 5.0),), 52.0, solver, a=1.0)
    whole, last = integral(cycle, 5.0), integral(cycle, 5.0) - integral(cycle, 3.0)
    assert got == pytest.approx(10.0 * whole + last, rel=1e-9)


@pytest.mark.parametrize(
    "argument",
    [
        lambda t, p: (t - 0.3) % 5.0,
        lambda t, p: (2.0 * t) % 5.0,
        lambda t, p: (1.3 - 2.0 * t) % 5.0,
        lambda t, p: (p.a * t + p.b) % p.T,
    ],
)
def test_a_cycle_that_is_shifted_or_stretched(argument):
    """Twenty, or forty, cycles of a pulse of a thousandth, whichever way they are passed."""
    pulse = Table([0.0, 1.0, 1.001, 5.0], [0.0, 1000.0, 3.0, 0.0], kind="step")
    system = tank(lambda t, x, p: (pulse(argument(t, p)),), a=2.0, b=0.7, T=5.0)
    arc = simulate(system, (0.0,), (0.0, 100.0))
    # The ends of a pulse of height 1000 are as exact as the times.
    assert arc["q"][-1] == pytest.approx(20 * (1.0 + 3.0 * 3.999), abs=1e-9)
    assert len(arc.t) < 200


def test_cycles_of_different_lengths():
    one, other = (Table(TIMES, VALUES + shift, kind="step") for shift in (0.0, 1.0))
    found = filled(lambda t, x, p: (one(t % 3.0) + other(t % 4.0) + one(t),), end=12.0)
    wanted = 4.0 * integral(one, 3.0) + 3.0 * integral(other, 4.0) + integral(one, 12.0)
    assert found == pytest.approx(wanted, rel=1e-13)
