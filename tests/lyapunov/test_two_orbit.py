"""Limits of the paper's two-orbit formulas, and convergence of the renormalised companion."""

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from tests.cases import systems

ORBIT_740 = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
PERIOD = 2 * np.pi


@pytest.fixture(scope="module")
def stable():
    """The impact oscillator on its stable orbit; two orbits at rounding distance may coincide."""
    return lyapunov.two_orbit_exponents(
        models.impact_oscillator(), (0.0, 0.0), transient=100, intervals=300, solver=hybrid.DOP853()
    )


@pytest.fixture(scope="module")
def chaotic():
    """The founding system in chaos."""
    return lyapunov.two_orbit_exponents(
        models.vibroimpact(),
        ORBIT_740,
        parameters={"omega": 7.92},
        transient=200,
        intervals=2000,
        solver=TIGHT,
    )


def before_coincidence(result):
    """Number of intervals before the orbits first coincide, which can happen at rounding distance."""
    return int(np.cumprod(result.distances > 0).sum())


@pytest.mark.parametrize("name", ["stable", "chaotic"])
def test_formula_8_telescopes_to_formula_7(name, request):
    result = request.getfixturevalue(name)
    M = before_coincidence(result)
    assert M > 150
    np.testing.assert_allclose(result.telescoped[:M], result.single_piece[:M], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("name", ["stable", "chaotic"])
def test_formulas_7_and_9_as_they_are_printed(name, request):
    result = request.getfixturevalue(name)
    M, T = before_coincidence(result), result.interval
    logs = np.log(result.distances[:M] / result.separation)
    assert result.single_piece[M - 1] == pytest.approx(logs[-1] / (M * T))
    assert result.undivided[M - 1] == pytest.approx(logs.sum() / (M * T))


def test_a_stable_distance_stops_at_rounding(stable):
    """From then on (7) decays like 1/M, although the exponent is -0.0855."""
    distances = stable.distances[100 : before_coincidence(stable)]
    assert 1e-17 < distances.min() <= distances.max() < 1e-12
    assert stable.single_piece[before_coincidence(stable) - 1] > -0.5 * 0.0855


def test_a_chaotic_distance_stops_at_the_size_of_the_attractor(chaotic):
    late = chaotic.distances[-500:]
    assert 0.1 < late.mean() < 1.5
    # Five hundred intervals earlier the same level over a shorter time gives a larger "exponent".
    assert chaotic.single_piece[-500] > 1.2 * chaotic.single_piece[-1] > 0


def test_formula_9_tends_to_the_level_over_the_interval(stable):
    """The limit is not an exponent but the logarithmic distance, near -16, divided by the period."""
    M = before_coincidence(stable)
    level = np.log(stable.distances[100:M] / stable.separation).mean()
    assert stable.undivided[M - 1] == pytest.approx(level / stable.interval, rel=0.15)


def test_renormalised_companion_of_the_impact_oscillator():
    """The multipliers turn the tangent plane once in 650 periods, so convergence takes that long."""
    result = lyapunov.two_orbit_exponents(
        models.impact_oscillator(), (0.0, 0.0), transient=100, intervals=1000
    )
    exact = np.log(abs(-0.58429531 + 0.00560035j)) / PERIOD
    assert result.renormalised_exponent == pytest.approx(exact, abs=1e-4)
    assert result.renormalised[-1] == pytest.approx(exact, abs=1e-3)


def test_renormalised_companion_of_the_founding_system():
    result = lyapunov.two_orbit_exponents(models.vibroimpact(), ORBIT_740, intervals=1000, solver=TIGHT)
    assert result.renormalised_exponent == pytest.approx(-0.05489357, abs=2e-6)


def test_renormalised_companion_of_an_autonomous_chaotic_system():
    """Solvable chaotic oscillator, exponent b = 0.5: the two-orbit estimate agrees with the spectrum."""
    where = {"mode": "plus", "interval": 1.0, "transient": 20}
    system, x0 = models.solvable_oscillator(), (0.3, 0.0)
    result = lyapunov.two_orbit_exponents(system, x0, intervals=500, solver=TIGHT, **where)
    assert result.renormalised_exponent == pytest.approx(0.5, abs=0.02)


def test_coinciding_orbits_give_minus_infinity():
    """(7) is minus infinity where the distance is zero, (8) and (9) from the first zero on."""
    result = lyapunov.TwoOrbitExponents(
        np.array([1e-9, 0.0, 0.0, 1e-17]),
        np.array([-1.0, -np.inf, -1.0, -1.0]),
        1e-8,
        1.0,
        hybrid.status.SUCCESS,
    )
    assert np.isfinite(result.single_piece).tolist() == [True, False, False, True]
    assert np.isneginf(result.telescoped).tolist() == [False, True, True, True]
    assert np.isneginf(result.undivided).tolist() == [False, True, True, True]
    assert result.renormalised_exponent == -np.inf


def test_separation_and_direction_place_the_companion():
    """Constant fields keep the distance; across the guard it is stretched by the saltation matrix."""
    options = {"separation": 1e-3, "direction": (3.0, 4.0), "interval": 0.1, "intervals": 5, "mode": "left"}
    before = lyapunov.two_orbit_exponents(systems.constant_fields(), (-1.0, 0.0), **options)
    np.testing.assert_allclose(before.distances, 1e-3, rtol=1e-9)
    after = lyapunov.two_orbit_exponents(systems.constant_fields(), (-0.25, 0.0), **options)
    stretched = np.linalg.norm(np.array([[1, 0], [2, 1]]) @ (0.6, 0.8))
    np.testing.assert_allclose(after.distances[2:], 1e-3 * stretched, rtol=1e-9)


def test_a_companion_beyond_a_guard_starts_in_the_mode_there():
    """The reference is just before the guard in mode left, the companion beyond it in mode right."""
    options = {"separation": 1e-2, "direction": (1.0, 0.0), "interval": 0.001, "intervals": 1}
    result = lyapunov.two_orbit_exponents(systems.constant_fields(), (-0.005, 0.0), mode="left", **options)
    assert result.distances[0] == pytest.approx(np.hypot(0.01, 0.002), rel=1e-9)


def test_a_run_that_breaks_off_keeps_what_it_has():
    """The field is nan beyond x = 1, which the orbit reaches at t = 1."""
    system = hybrid.HybridSystem(
        state=("x",), modes=[hybrid.Mode("only", lambda t, x, p: (1.0 + 1e-9 * np.sqrt(1.0 - x.x),))]
    )
    result = lyapunov.two_orbit_exponents(system, (0.0,), interval=0.1, intervals=50)
    assert result.status.code == hybrid.StatusCode.NON_FINITE
    assert 5 <= result.intervals < 11
    np.testing.assert_allclose(result.distances, 1e-8, rtol=1e-6)
    late = lyapunov.two_orbit_exponents(system, (0.0,), interval=0.1, intervals=5, transient=50)
    assert late.intervals == 0
    assert not late.status.ok
    assert np.isnan(late.renormalised_exponent)
    assert "NON_FINITE" in repr(late)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"separation": 0.0}, r"separation must be a positive distance; got 0\.0"),
        ({"separation": np.nan}, "separation must be a positive distance; got nan"),
        ({"direction": (1.0, 0.0, 0.0)}, r"direction must be a finite vector of shape \(2,\)"),
        ({"direction": (0.0, 0.0)}, r"direction must be a finite vector of shape \(2,\), not zero"),
        ({"intervals": 0}, "intervals must be a whole number of at least 1; got 0"),
        ({"transient": -1}, "transient must be a whole number of at least 0; got -1"),
        ({"interval": -1.0}, r"interval must be a positive time; got -1\.0"),
        ({"solver": "DOP853"}, "solver must be a solver object; got 'DOP853'"),
        ({"mode": "fligth"}, "Did you mean 'flight'"),
        ({"parameters": {"omega": 1.0}}, "omega"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(hybrid.ModelError, match=message):
        lyapunov.two_orbit_exponents(models.impact_oscillator(), (0.0, 0.0), **arguments)


@pytest.mark.parametrize("transient", [0, 1, 2, 3])
@pytest.mark.parametrize("interval", [0.3, 1.0, 1.7])
def test_the_transient_has_as_many_intervals_as_asked_for(transient, interval):
    """The growth over an interval depends on its phase: ``x' = cos(2 pi t) x``."""
    system = hybrid.HybridSystem(
        state=("x",), modes=[hybrid.Mode("only", lambda t, x, p: (np.cos(2 * np.pi * t) * x.x,))], period=1.0
    )
    t0 = 0.1
    result = lyapunov.two_orbit_exponents(
        system,
        (0.0,),
        t0=t0,
        interval=interval,
        intervals=4,
        transient=transient,
        separation=1.0,
        solver=TIGHT,
    )
    times = t0 + interval * (transient + np.arange(5))
    logs = np.diff(np.sin(2 * np.pi * times)) / (2 * np.pi)
    np.testing.assert_allclose(result.renormalised_growths, logs / interval, atol=1e-9)
    np.testing.assert_allclose(np.log(result.distances), np.cumsum(logs), atol=1e-9)


def test_a_renormalised_companion_is_put_into_the_mode_of_the_orbit():
    """A companion beyond the guard alone is brought back before the guard and crosses it with the orbit.

    In the wrong mode it would miss the kick that the orbit gets in the second interval.
    """
    system = hybrid.HybridSystem(
        state=("x", "y"),
        modes=[
            hybrid.Mode("left", lambda t, x, p: (1.0, 0.0)),
            hybrid.Mode("right", lambda t, x, p: (1.0, 0.0)),
        ],
        transitions=[
            hybrid.Transition(
                "left",
                "right",
                hybrid.Guard(lambda t, x, p: x.x, +1),
                hybrid.Reset(lambda t, x, p: (x.x, x.y + 1.0)),
            )
        ],
    )
    result = lyapunov.two_orbit_exponents(
        system,
        (-0.25, 0.0),
        mode="left",
        separation=0.1,
        direction=(1.0, 0.0),
        interval=0.2,
        intervals=3,
    )
    expected = [np.log(np.hypot(0.1, 1.0) / 0.1) / 0.2, 0.0, 0.0]
    np.testing.assert_allclose(result.renormalised_growths, expected, atol=1e-9)
    np.testing.assert_allclose(result.distances, [np.hypot(0.1, 1.0), 0.1, 0.1], rtol=1e-9)


@pytest.mark.parametrize(
    ("rate", "separation"), [(-400.0, 1e-8), (-1.0, 1e-200), (600.0, 1e-250), (1.0, 1e180)]
)
def test_distances_whose_squares_or_quotients_no_number_holds(rate, separation):
    """At rest at zero nothing rounds a distance off."""
    system = hybrid.HybridSystem(
        state=("x", "y"), modes=[hybrid.Mode("only", lambda t, x, p: (rate * x.x, rate * x.y))], period=1.0
    )
    result = lyapunov.two_orbit_exponents(
        system, (0.0, 0.0), intervals=1, separation=separation, direction=(3e-200, 4e-200)
    )
    np.testing.assert_allclose(result.renormalised_growths, rate, rtol=1e-9)
    np.testing.assert_allclose(result.single_piece, rate, rtol=1e-9)
    np.testing.assert_allclose(result.undivided, rate, rtol=1e-9)
    np.testing.assert_allclose(result.telescoped, rate, rtol=1e-9)


@pytest.mark.parametrize(
    ("rate", "interval", "word"),
    [(-30.0, 2.0, "rounding"), (-30.0, 2 * np.pi, "rounding"), (-5.0, 2.0, "rounding"), (-3.0, 2.0, None)],
)
def test_a_companion_within_rounding_of_the_orbit_is_told(rate, interval, word):
    def field(t, x, p):
        return (p.rate * (x.a - np.cos(t)),)

    system = hybrid.HybridSystem(
        state=("a",), parameters={"rate": -1.0}, modes=[hybrid.Mode("m", field)], period=2 * np.pi
    )
    result = lyapunov.two_orbit_exponents(
        system, (1.0,), parameters={"rate": rate}, intervals=20, interval=interval
    )
    if word is None:
        assert result.status.ok
        assert result.renormalised_exponent == pytest.approx(rate, rel=1e-3)
    else:
        assert result.status.code == hybrid.StatusCode.INDISTINCT_TANGENTS
        assert word in result.status.message


@pytest.mark.parametrize(("interval", "ok"), [(1.0, True), (50.0, False)])
def test_a_companion_that_has_reached_the_size_of_the_attractor_is_told(interval, ok):
    def lorenz(t, x, p):
        return (10 * (x.y - x.x), 28 * x.x - x.y - x.x * x.z, x.x * x.y - 8 / 3 * x.z)

    system = hybrid.HybridSystem(state=("x", "y", "z"), modes=[hybrid.Mode("m", lorenz)])
    result = lyapunov.two_orbit_exponents(
        system, (1.0, 1.0, 20.0), intervals=int(600 / interval), interval=interval, transient=5
    )
    assert result.status.ok == ok
    if ok:
        assert result.renormalised_exponent == pytest.approx(0.906, abs=0.05)
    else:
        assert "as far from the orbit as" in result.status.message
