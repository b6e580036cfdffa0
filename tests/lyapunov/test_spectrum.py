"""Spectra compared with exact answers: error bars, memory and messages."""

import math

import attrs
import numpy as np
import pytest
from scipy.linalg import expm

import hybrid
import lyapunov
import models
from hybrid.simulation.ending import status_of
from tests.cases import systems

ORBIT_740 = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
EXPONENTS_740 = (-0.05489357, -0.05489357, -0.39487603, -0.39487603)
SOLVER = hybrid.DOP853(rtol=1e-9, atol=1e-11)


@pytest.fixture(scope="module")
def founding():
    """The founding system on its periodic orbit."""
    return lyapunov.lyapunov_spectrum(models.vibroimpact(), ORBIT_740, intervals=2000, solver=SOLVER)


def test_founding_system(founding):
    np.testing.assert_allclose(founding.exponents, EXPONENTS_740, atol=1e-6)
    assert founding.jumps_per_interval == 2.0
    assert founding.status.ok


def test_plain_means_are_slower(founding):
    """Benettin's running mean still has an error of 1/M when the tapered mean has converged."""
    assert founding.benettin_history.shape == (2000, 4)
    assert 1e-5 < abs(founding.benettin_history[-1, 0] - EXPONENTS_740[0]) < 2e-3


@pytest.mark.parametrize("omega", [7.40, 7.46, 7.92])
def test_sum_rule(omega):
    p = models.vibroimpact().parameters
    chi = p["m2"] / p["m1"]
    exact = -2 * (p["xi1"] * p["omega1"] + p["xi2"] * p["omega2"] * (1 + chi))
    result = lyapunov.lyapunov_spectrum(
        models.vibroimpact(), ORBIT_740, parameters={"omega": omega}, intervals=300, solver=SOLVER
    )
    assert result.sum_rule == pytest.approx(exact, rel=1e-9)
    assert abs(result.sum_defect) < 1e-8


def test_the_sum_rule_holds_for_the_default_solver():
    """Its series of the Hertzian contact runs on a clock of its own."""
    result = lyapunov.lyapunov_spectrum(models.vibroimpact(), ORBIT_740, intervals=50)
    assert abs(result.sum_defect) < 1e-6 * abs(result.sum_rule)
    by_taylor = lyapunov.lyapunov_spectrum(
        models.vibroimpact(), ORBIT_740, intervals=50, solver=hybrid.Taylor(rtol=1e-8, atol=1e-10)
    )
    assert abs(by_taylor.sum_defect) < 1e-6 * abs(by_taylor.sum_rule)


def test_torus_has_a_zero_exponent():
    result = lyapunov.lyapunov_spectrum(
        models.vibroimpact(),
        (0.0, 0.05, 0.0, 0.0),
        parameters={"omega": 7.46},
        k=1,
        transient=1000,
        intervals=2000,
    )
    assert abs(result.exponents[0]) < 1e-4


def test_the_other_attractor_of_7_46():
    result = lyapunov.lyapunov_spectrum(
        models.vibroimpact(),
        (0.0, 0.05, 0.3, 0.3),
        parameters={"omega": 7.46},
        k=1,
        transient=500,
        intervals=1000,
    )
    assert result.jumps_per_interval / 2 == pytest.approx(0.62, abs=0.01)
    assert result.exponents[0] == pytest.approx(-0.01107, abs=2e-3)


def test_impact_oscillator_agrees_with_its_multipliers():
    result = lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=2000)
    exact = np.log(abs(-0.58429531 + 0.00560035j)) / (2 * np.pi)
    np.testing.assert_allclose(result.exponents, exact, atol=1e-6)


def test_last_row_of_the_history_is_the_result(founding):
    assert founding.history.shape == founding.growths.shape == (2000, 4)
    np.testing.assert_allclose(founding.history[-1], founding.exponents, rtol=1e-9)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_fewer_vectors_give_the_first_exponents(k):
    result = lyapunov.lyapunov_spectrum(models.vibroimpact(), ORBIT_740, k=k, intervals=500, solver=SOLVER)
    assert result.exponents.shape == result.standard_error.shape == (k,)
    np.testing.assert_allclose(result.exponents, EXPONENTS_740[:k], atol=2e-5)


def test_linear_systems_have_their_eigenvalues():
    system = hybrid.HybridSystem(
        state=("a", "b", "c"),
        modes=[hybrid.Mode("only", lambda t, x, p: (0.3 * x.a + x.b, -0.1 * x.b, -2 * x.c))],
    )
    result = lyapunov.lyapunov_spectrum(system, (0.0, 0.0, 0.0), interval=0.5, intervals=400)
    np.testing.assert_allclose(result.exponents, [0.3, -0.1, -2.0], atol=1e-8)


def test_a_collapsed_direction_is_minus_infinity():
    """The belt annihilates a direction: after any slip speed the block sticks at the belt's speed."""
    system = systems.stick_slip()
    result = lyapunov.lyapunov_spectrum(system, (0.0, 0.2), mode="stick", interval=12.001031295, intervals=50)
    assert result.exponents[0] == pytest.approx(0.0, abs=1e-4)
    assert result.exponents[1] == -np.inf
    assert result.standard_error[1] == 0.0
    assert result.sum_rule == -np.inf
    assert result.sum_defect == 0.0


def test_without_history_memory_does_not_grow():
    """Arrays in the result of a long run are as small as those of a short run."""

    def size(intervals, history=False):
        result = lyapunov.lyapunov_spectrum(
            models.impact_oscillator(), (0.0, 0.0), intervals=intervals, transient=0, history=history
        )
        return sum(getattr(result, name).nbytes for name in ("exponents", "standard_error", "growths", "x"))

    assert size(3000) == size(30)
    assert size(3000, history=True) == size(3000) + 3000 * 2 * 8


def test_without_history_the_result_is_the_same():
    kept, dropped = (
        lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=300, history=history)
        for history in (True, False)
    )
    np.testing.assert_array_equal(kept.exponents, dropped.exponents)
    np.testing.assert_array_equal(kept.standard_error, dropped.standard_error)


def covered(exact, runs):
    """Number of runs in which two standard errors contain the exact exponent."""
    return sum(bool(abs(run.exponents[0] - exact) <= 2 * run.standard_error[0]) for run in runs)


def test_error_bars_hold_the_exact_exponent_of_the_solvable_oscillator():
    """Over integer times the growth rate is exactly b; over other intervals it fluctuates."""
    system = models.solvable_oscillator()
    runs = [
        lyapunov.lyapunov_spectrum(
            system, (u, 0.0), mode="plus", k=1, interval=0.37, intervals=400, transient=50, solver=SOLVER
        )
        for u in np.random.default_rng(3).uniform(0.05, 0.95, 40)
    ]
    assert 34 <= covered(0.5, runs) <= 40


def test_error_bars_hold_the_exact_exponent_of_the_skew_tent_map():
    """The slopes 1/a and 1/(1 - a) are random, so the exponent is -a ln a - (1 - a) ln(1 - a)."""
    system = hybrid.HybridSystem(
        state=("x", "clock"),
        parameters={"a": 0.3},
        modes=[hybrid.Mode("wait", lambda t, x, p: (0.0, 1.0))],
        transitions=[
            hybrid.Transition(
                "wait",
                "wait",
                hybrid.Guard(lambda t, x, p: x.clock - 1, direction=+1),
                hybrid.Reset(lambda t, x, p: (np.minimum(x.x / p.a, (1 - x.x) / (1 - p.a)), 0.0)),
            )
        ],
    )
    runs = [
        lyapunov.lyapunov_spectrum(system, (u, 0.5), k=1, interval=1.0, intervals=500, transient=10)
        for u in np.random.default_rng(4).uniform(0.05, 0.95, 40)
    ]
    assert 34 <= covered(-0.3 * np.log(0.3) - 0.7 * np.log(0.7), runs) <= 40
    assert np.mean([run.standard_error[0] for run in runs]) < 0.05


def test_a_run_that_breaks_off_keeps_what_it_has():
    """The field is nan beyond x = 1, which the orbit reaches at t = 1."""

    def field(t, x, p):
        return 1.0 + 1e-9 * np.sqrt(1.0 - x.x), -100.0 * x.y

    system = hybrid.HybridSystem(state=("x", "y"), modes=[hybrid.Mode("only", field)])
    result = lyapunov.lyapunov_spectrum(system, (0.0, 1.0), interval=0.05, intervals=50, transient=8)
    assert result.status.code == hybrid.StatusCode.NON_FINITE
    assert "became infinite or nan" in str(result.status)
    assert 5 <= result.intervals <= 12
    np.testing.assert_allclose(result.exponents, [0.0, -100.0], atol=1e-6)


def test_a_transient_that_breaks_off_leaves_nothing():
    system = hybrid.HybridSystem(
        state=("x",), modes=[hybrid.Mode("only", lambda t, x, p: (1.0 + 1e-9 * np.sqrt(1.0 - x.x),))]
    )
    result = lyapunov.lyapunov_spectrum(system, (0.0,), interval=0.1, intervals=5)
    assert result.intervals == 0
    assert not result.status.ok
    assert math.isnan(result.exponents[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"k": 0}, "k must be a whole number from 1 to 2, the dimension of the state; got 0"),
        ({"k": 3}, "k must be a whole number from 1 to 2, the dimension of the state; got 3"),
        ({"k": 1.5}, r"k must be a whole number from 1 to 2, the dimension of the state; got 1\.5"),
        ({"intervals": 0}, "intervals must be a whole number of at least 1; got 0"),
        ({"intervals": 10.0}, r"intervals must be a whole number of at least 1; got 10\.0"),
        ({"transient": -1}, "transient must be a whole number of at least 0; got -1"),
        ({"interval": 0.0}, r"interval must be a positive time; got 0\.0"),
        ({"interval": np.inf}, "interval must be a positive time; got inf"),
        ({"solver": hybrid.DOP853}, "solver must be a solver object"),
        ({"mode": "fligth"}, "Did you mean 'flight'"),
        ({"parameters": {"damping": 1.0}}, "damping"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(hybrid.ModelError, match=message):
        lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), **arguments)


@pytest.mark.parametrize("exponents", [lyapunov.lyapunov_spectrum, lyapunov.two_orbit_exponents])
def test_an_interval_is_many_roundings_of_the_time(exponents):
    """Times near ``2**52`` are 1 apart. The message counts the intervals of the transient too."""
    late = {"t0": 2.0**52, "intervals": 5, "transient": 2}
    with pytest.raises(
        hybrid.ArgumentError, match=r"with t0 = 4503599627370496\.0 and 7 intervals times are"
    ):
        exponents(models.bouncing_ball(), (1.0, 0.0), interval=1.0, **late)


def test_bad_state():
    with pytest.raises(hybrid.ArgumentError, match="'v' must be finite; got nan"):
        lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, np.nan))


def test_a_clock_among_the_states_hides_nothing():
    """Nothing grows along a clock's axis; the vectors start along no axis, so the largest comes first."""
    ramp_ends = hybrid.Guard(lambda t, x, p: x.tau - 1.0, +1)
    converter = models.buck_converter()
    clocked = attrs.evolve(
        converter,
        transitions=[
            attrs.evolve(each, guard=attrs.evolve(ramp_ends, when=each.guard.when)) if each.clock else each
            for each in converter.transitions
        ],
    )
    result = lyapunov.lyapunov_spectrum(
        clocked, (12.03, 0.61, 0.0), mode="off", parameters={"E": 33.0}, intervals=500
    )
    # The exponent along the orbit is zero; the first is that of the chaotic converter, per second.
    assert result.exponents[0] == pytest.approx(1200.0, abs=200.0)
    assert result.exponents[1] == pytest.approx(0.0, abs=5.0)
    assert result.sum_defect == pytest.approx(0.0, abs=1e-6)


def test_what_only_the_transient_annihilates_is_not_minus_infinity():
    system = hybrid.HybridSystem(
        state=("x", "y"),
        modes=[
            hybrid.Mode("before", lambda t, x, p: (1.0, 0.0)),
            hybrid.Mode("after", lambda t, x, p: (-0.5 * x.x, -2.0 * x.y)),
        ],
        transitions=[
            hybrid.Transition(
                "before",
                "after",
                hybrid.Guard(lambda t, x, p: x.x, +1),
                hybrid.Reset(lambda t, x, p: (1.0, 1.0)),
            )
        ],
    )
    result = lyapunov.lyapunov_spectrum(
        system, (-1.0, 0.0), mode="before", interval=0.5, transient=100, intervals=200
    )
    np.testing.assert_allclose(result.exponents, [-0.5, -2.0], atol=1e-6)


def drained(decay):
    """A system whose exponents are known from its matrix and about ``decay`` apart."""
    return np.sort(np.linalg.eigvals([[-0.1, 0.5], [0.3, -decay]]))[::-1]


@pytest.fixture(scope="module")
def drain():
    return hybrid.HybridSystem(
        state=("a", "b"),
        parameters={"decay": 20.0},
        modes=[
            hybrid.Mode(
                "only",
                lambda t, x, p: (-0.1 * x.a + 0.5 * x.b + np.cos(t), 0.3 * x.a - p.decay * x.b),
            )
        ],
        period=2 * np.pi,
    )


@pytest.mark.parametrize("decay", [8.0, 20.0, 200.0, 2000.0])
@pytest.mark.parametrize("interval", [0.01, None, 50.0])
def test_exponents_far_apart_whatever_the_interval(drain, decay, interval):
    """Without orthonormalisation all vectors would align with the first direction within an interval."""
    result = lyapunov.lyapunov_spectrum(
        drain,
        (0.0, 0.0),
        parameters={"decay": decay},
        interval=interval,
        intervals=20,
        transient=3000 if interval == 0.01 else 5,
    )
    assert result.status.ok
    np.testing.assert_allclose(result.exponents, drained(decay), rtol=1e-8)


@pytest.mark.parametrize(
    ("solver", "rtol"),
    [(hybrid.DOP853(), 1e-8), (hybrid.Tsit5(rtol=1e-8), 1e-6), (hybrid.RadauIIA(rtol=1e-6), 1e-6)],
)
def test_exponents_far_apart_with_every_solver(drain, solver, rtol):
    result = lyapunov.lyapunov_spectrum(drain, (0.0, 0.0), intervals=20, transient=5, solver=solver)
    np.testing.assert_allclose(result.exponents, drained(20.0), rtol=rtol)


@pytest.mark.parametrize("solver", [None, hybrid.DOP853()])
@pytest.mark.parametrize("rate", [-800.0, 800.0])
def test_growth_beyond_the_range_of_numbers(rate, solver):
    system = hybrid.HybridSystem(
        state=("x",), parameters={"rate": -1.0}, modes=[hybrid.Mode("only", lambda t, x, p: (p.rate * x.x,))]
    )
    result = lyapunov.lyapunov_spectrum(
        system, (0.0,), parameters={"rate": rate}, interval=1.0, intervals=5, transient=1, solver=solver
    )
    assert result.exponents[0] == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("interval", [5.0, 50.0])
def test_lorenz_over_long_intervals(k, interval):
    """Published: 0.9056, 0, -14.5723 (Sprott 2003); they sum to -41 / 3 exactly."""
    system = hybrid.HybridSystem(
        state=("x", "y", "z"),
        modes=[
            hybrid.Mode(
                "only",
                lambda t, x, p: (10 * (x.y - x.x), x.x * (28 - x.z) - x.y, x.x * x.y - 8 / 3 * x.z),
            )
        ],
    )
    result = lyapunov.lyapunov_spectrum(
        system, (1.0, 1.0, 20.0), k=k, interval=interval, intervals=round(2000 / interval), transient=2
    )
    np.testing.assert_allclose(result.exponents, [0.9056, 0.0, -14.5723][:k], atol=0.02)
    if k == 3:
        assert result.exponents.sum() == pytest.approx(-41 / 3, rel=1e-11)


@pytest.mark.parametrize("solver", [None, hybrid.DOP853(rtol=1e-12, atol=1e-14)])
def test_jumps_between_orthonormalisations_do_not_disturb(solver):
    """A reset mixes directions that the flow separates; the exponents are those of the period map."""
    flow, reset = np.array([[-0.5, 3.0], [0.0, -60.0]]), np.array([[0.3, -0.7], [1.1, 0.4]])
    system = hybrid.HybridSystem(
        state=("a", "b"),
        modes=[hybrid.Mode("only", lambda t, x, p: (-0.5 * x.a + 3.0 * x.b, -60.0 * x.b))],
        transitions=[
            hybrid.Transition(
                "only",
                "only",
                hybrid.Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.3)), +1),
                hybrid.Reset(lambda t, x, p: (0.3 * x.a - 0.7 * x.b, 1.1 * x.a + 0.4 * x.b)),
            )
        ],
        period=1.0,
    )
    first = np.log(np.abs(np.linalg.eigvals(reset @ expm(flow)))).max()
    total = np.trace(flow) + np.log(abs(np.linalg.det(reset)))
    for interval in (0.7, 1.0, 13.0):
        result = lyapunov.lyapunov_spectrum(
            system, (0.0, 0.0), interval=interval, intervals=200, transient=10, solver=solver
        )
        # Intervals that are not whole periods may contain one jump more or less.
        atol = 1e-9 if interval != 0.7 else 0.05
        np.testing.assert_allclose(result.exponents, [first, total - first], atol=atol)


def test_rates_are_evaluated_anew_after_each_orthonormalisation():
    """With fixed steps no error control can hide outdated rates of replaced vectors."""
    system = hybrid.HybridSystem(
        state=("a", "b"),
        modes=[hybrid.Mode("only", lambda t, x, p: (0.3 * x.a + x.b, -0.1 * x.b))],
    )
    fixed = hybrid.DOP853(rtol=1.0, atol=1.0, max_step=0.05)
    result = lyapunov.lyapunov_spectrum(system, (0.0, 0.0), interval=0.5, intervals=400, solver=fixed)
    np.testing.assert_allclose(result.exponents, [0.3, -0.1], atol=1e-7)


def test_vectors_that_only_rounding_tells_apart_are_reported():
    system = models.impact_oscillator()
    trajectory = hybrid.simulation.trajectory.start(system, (0.0, 0.0), 0.0, tangent=np.eye(2))
    trajectory.run.indistinct = 2
    status = status_of(trajectory, hybrid.kernels.types.codes.DONE)
    assert status.code == hybrid.StatusCode.INDISTINCT_TANGENTS
    assert "2 times the tangent vectors became parallel" in status.message


@pytest.mark.parametrize("small", [1.0, 1e-9])
@pytest.mark.parametrize(
    ("field", "x0", "expected"),
    [
        # sqrt(k / m) of an oscillator, and the time of a fall from rest.
        (lambda x, s: (x.v / s, -4.0 * x.q * s), (1.0, 0.0), 0.5),
        (lambda x, s: (x.v / s, -8.0 * s), (1.0, 0.0), 0.5),
        (lambda x, s: (0.5 * s, 0.0), (0.0, 0.0), 1.0),
    ],
)
def test_the_default_interval_does_not_depend_on_the_units_of_the_states(field, x0, expected, small):
    """The speed is measured in units that are smaller by a factor."""
    system = hybrid.HybridSystem(
        state=("q", "v"), modes=[hybrid.Mode("free", lambda t, x, p: field(x, small))]
    )
    spectrum = lyapunov.lyapunov_spectrum(system, x0, intervals=2, transient=0)
    assert spectrum.interval == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("unit", [2.0**-40, 1.0, 2.0**40])
def test_speeds_in_units_far_from_those_of_places(unit):
    """The first vectors, alike in all components, are parallel to rounding until they have turned."""

    def fields(t, x, p):
        q1, q2, v1, v2 = x[0] / p.unit, x[1] / p.unit, x[2] * p.unit, x[3] * p.unit
        forces = -0.4 * v1 - 0.03 * q1, -0.6 * v2 - 0.08 * q2
        return v1 * p.unit, v2 * p.unit, forces[0] / p.unit, forces[1] / p.unit

    system = hybrid.HybridSystem(
        state=4, parameters={"unit": 1.0}, modes=[hybrid.Mode("on", fields)], period=1.0
    )
    spectrum = lyapunov.lyapunov_spectrum(
        system, np.zeros(4), parameters={"unit": unit}, intervals=3000, transient=300
    )
    assert spectrum.status.ok
    np.testing.assert_allclose(spectrum.exponents, [-0.1, -0.2, -0.3, -0.4], atol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_an_invertible_reset_annihilates_nothing_on_an_orbit_that_grows(seed):
    """The entries of its saltation matrix grow with the orbit, until rounding hides a direction."""
    rng = np.random.default_rng(seed)
    A, B = 0.5 * rng.normal(size=(2, 2)) + 0.4 * np.eye(2), np.eye(2) + 0.3 * rng.normal(size=(2, 2))
    system = hybrid.HybridSystem(
        state=("a", "b", "clock"),
        modes=[hybrid.Mode("m", lambda t, x, p: (*(A[i, 0] * x.a + A[i, 1] * x.b for i in (0, 1)), 1.0))],
        transitions=[
            hybrid.Transition(
                "m",
                "m",
                hybrid.Guard(lambda t, x, p: x.clock - 1, +1),
                hybrid.Reset(lambda t, x, p: (*(B[i, 0] * x.a + B[i, 1] * x.b for i in (0, 1)), 0.0)),
            )
        ],
    )
    spectrum = lyapunov.lyapunov_spectrum(system, (1.0, 0.5, 0.1), interval=1.0, intervals=150, transient=0)
    assert np.isfinite(spectrum.sum_rule)
    assert np.all(np.isfinite(spectrum.exponents)) or not spectrum.status.ok
    if spectrum.status.ok:
        assert abs(spectrum.sum_defect) < 1e-6
