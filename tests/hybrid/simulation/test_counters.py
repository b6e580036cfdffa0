"""Counters have no part in the control of errors, and do not have to come back."""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    ArgumentError,
    Every,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    Taylor,
    Transition,
    Tsit5,
    attractors,
    basin_fractions,
    basins,
    continue_bifurcation,
    continue_orbit,
    open_branch,
    periodic_orbit,
    simulate,
    simulate_many,
    switch_branch,
)
from lyapunov import finite_time_exponents, two_orbit_exponents

# At these tolerances the rounding of a step's terms moves the length of the next step by next to nothing.
SOLVERS = [Taylor(), Tsit5(rtol=1e-6), DOP853(rtol=1e-9), RadauIIA(rtol=1e-7)]


def pair(field, guard, reset, state=("q", "v"), parameters=None, **others):
    """A system with one transition, and the same with counters of its jumps."""

    def system(counters):
        def counting(t, x, p):
            changed = dict(reset(t, x, p))
            return changed | {name: getattr(x, name) + 1 for name in counters}

        return HybridSystem(
            state=state,
            counters=counters,
            parameters=parameters or {},
            modes=[Mode("run", field)],
            transitions=[Transition("run", "run", guard, Reset(counting), name="jump")],
            **others,
        )

    return system(()), system(("n", "m", "k"))


PAIRS = {
    "forced oscillator with impacts": pair(
        lambda t, x, p: (x.v, p.F * np.cos(t) - x.q - 0.05 * x.v),
        Guard(lambda t, x, p: x.q - 1.0, +1),
        lambda t, x, p: {"v": -0.8 * x.v},
        parameters={"F": 1.2},
        period=2 * np.pi,
    ),
    "pendulum with impacts": pair(
        lambda t, x, p: (x.v, -np.sin(x.q) + 0.3 * np.cos(t)),
        Guard(lambda t, x, p: np.sin(x.q) - 0.4, +1),
        lambda t, x, p: {"v": -0.9 * x.v},
    ),
    "sampled": pair(
        lambda t, x, p: (x.v, 5.0 * (1.0 - x.q**2) * x.v - x.q),
        Every(0.7),
        lambda t, x, p: {"v": x.v + 0.1},
    ),
    "at rest at the origin": pair(lambda t, x, p: (x.v, -x.q), Every(1.0), lambda t, x, p: {"v": x.v + 1e-3}),
}


@pytest.mark.parametrize("count", [0.0, 7.0, 1e9])
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("name", PAIRS)
def test_a_run_that_counts_takes_the_same_steps(name, solver, count):
    plain, counted = PAIRS[name]
    start = (0.0, 0.0) if "rest" in name else (0.3, 0.2)
    for tangent in (None, True):
        arc = simulate(plain, start, (0.0, 20.0), solver=solver, tangent=tangent)
        other = simulate(counted, (*start, *[count] * 3), (0.0, 20.0), solver=solver, tangent=tangent)
        assert arc.status.ok
        assert other.status == arc.status
        assert (other.steps, other.rejected, len(other.jumps)) == (arc.steps, arc.rejected, len(arc.jumps))
        # A step of more components adds its terms in another order.
        np.testing.assert_allclose(other.t, arc.t, rtol=1e-9)
        np.testing.assert_allclose(other.x[:, :2], arc.x, atol=1e-8)
        np.testing.assert_array_equal(other.x[-1, 2:], count + len(arc.jumps))
        if tangent:
            np.testing.assert_allclose(other.fundamental, arc.fundamental, rtol=1e-8)


def impacts(counters=(), read=None):
    """A forced oscillator with impacts, which are counted; ``read`` changes the reset with the count."""

    def after(t, x, p):
        changed = {"v": -p.e * x.v * (1.0 if read is None else 1.0 + 0.02 * (x.n % read))}
        return changed | {name: getattr(x, name) + 1 for name in counters}

    return HybridSystem(
        state=("q", "v"),
        counters=counters,
        parameters={"w": 1.0, "e": 0.8},
        modes=[Mode("flight", lambda t, x, p: (x.v, np.cos(p.w * t) - x.q - 0.1 * x.v))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(after), name="hit")
        ],
        period=lambda p: 2.0 * np.pi / p.w,
    )


@pytest.fixture(scope="module")
def orbits():
    return [periodic_orbit(impacts(names), (0.9, 1.0)) for names in ((), ("n",))]


def test_sensitivities_of_an_orbit_that_counts(orbits):
    plain, counted = (orbit.sensitivity(("w", "e")) for orbit in orbits)
    np.testing.assert_allclose(counted.x0, plain.x0, rtol=1e-10)
    np.testing.assert_allclose(counted.period, plain.period, rtol=1e-10)
    np.testing.assert_allclose(counted.multipliers, plain.multipliers, rtol=1e-6)


def test_a_branch_of_orbits_that_count(orbits):
    plain, counted = (continue_orbit(orbit, "w", (0.9, 1.8)) for orbit in orbits)
    assert counted.status == plain.status
    np.testing.assert_allclose(counted.parameter, plain.parameter, rtol=1e-10)
    np.testing.assert_allclose(counted.x0[:, :2], plain.x0, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(counted.multipliers, plain.multipliers, rtol=1e-6)
    assert not np.any(counted.x0[:, 2] % 1.0)
    assert [each.kind for each in counted.bifurcations] == ["fold", "grazing"]
    for one, other in zip(counted.bifurcations, plain.bifurcations, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        np.testing.assert_allclose(one.coefficient, other.coefficient, rtol=1e-5)
    again = open_branch(counted.system, counted.to_xarray())
    assert again.orbit(5).residual < 1e-9
    assert again.orbit(5).multipliers == pytest.approx(counted.orbit(5).multipliers)
    free = switch_branch(counted.bifurcations[-1])
    assert free.status.ok
    assert free.transitions == ()
    curve = continue_bifurcation(counted.bifurcations[0], {"w": (1.6, 1.9), "e": (0.75, 0.85)})
    assert curve.status.ok
    assert curve.x0.shape[1] == 3


def test_an_orbit_that_reads_its_counter():
    """Every second impact is harder: the orbit closes after two, with the counter two further on."""
    orbit = periodic_orbit(impacts(("n",), read=2), (0.9, 1.0), periods=2)
    branch = continue_orbit(orbit, "w", (0.97, 1.03))
    assert branch.status.ok
    assert branch.bifurcations == ()
    arc = branch.orbit(0).arc()
    np.testing.assert_allclose(arc.x[-1] - arc.x[0], [0.0, 0.0, 2.0], atol=1e-10)


def test_attractors_and_basins_take_no_notice_of_counters():
    over = {"q": np.linspace(-1.0, 1.0, 4), "v": np.linspace(-1.0, 1.0, 3)}
    systems = impacts(), impacts(("n",))
    plain, counted = (attractors(each, over, parameters={"w": 2.6}, starts=12) for each in systems)
    assert len(counted) == len(plain) == 2
    for label in (1, 2):
        np.testing.assert_allclose(counted[label].points[:, :2], plain[label].points, atol=1e-7)
        np.testing.assert_allclose(counted[label].exponents, plain[label].exponents, atol=1e-7)
    assert counted.to_xarray().sizes["exponent"] == 2
    made = [basins(each, over, parameters={"w": 2.6}, progress=False) for each in systems]
    np.testing.assert_array_equal(made[1].label, made[0].label)
    shares = [basin_fractions(each, over, starts=12, parameters={"w": 2.6}).fraction for each in systems]
    np.testing.assert_array_equal(*shares)


def test_two_orbits_of_a_system_that_counts():
    plain, counted = (
        two_orbit_exponents(impacts(names), (0.3, 0.2), intervals=80, transient=50, separation=1e-6)
        for names in ((), ("n",))
    )
    assert counted.status == plain.status
    assert counted.renormalised_exponent == pytest.approx(plain.renormalised_exponent, abs=1e-7)


def test_starts_may_leave_out_what_is_held_or_counts():
    system = impacts(("n",))
    runs = simulate_many(system, [(0.3, 0.2), (0.1, 0.0)], (0.0, 9.0))
    assert runs.x0.values[:, 2].tolist() == [0.0, 0.0]
    alone = simulate(system, (0.1, 0.0), (0.0, 9.0))
    np.testing.assert_allclose(runs.x_end.values[1], alone.x[-1], rtol=1e-12)
    growth = finite_time_exponents(system, [(0.3, 0.2), (0.1, 0.0)], interval=9.0)
    np.testing.assert_allclose(growth[1], finite_time_exponents(system, (0.1, 0.0), interval=9.0))
    for call in (simulate_many, finite_time_exponents):
        options = {"t_span": (0.0, 1.0)} if call is simulate_many else {"interval": 1.0}
        with pytest.raises(ArgumentError, match=r"x0: counter 'n' must be a whole number; got 0\.5"):
            call(system, [(0.3, 0.2, 0.0), (0.1, 0.0, 0.5)], **options)


def test_a_counter_that_is_not_whole_at_the_end_is_told():
    system = HybridSystem(
        state=("q",),
        counters=("n",),
        modes=[Mode("run", lambda t, x, p: (-0.1,))],
        transitions=[
            Transition(
                "run",
                "run",
                Every(1.0),
                # Where the system is checked, q is not that large.
                Reset(lambda t, x, p: {"n": x.n + np.where(x.q > 50.0, 0.25, 1.0)}),
            )
        ],
    )
    assert simulate(system, (0.0,), (0.0, 3.5)).status.message == "Reached the end."
    told = "A counter is a whole number, and 'n' is 0.75 at the end."
    for tangent in (None, True):
        status = simulate(system, (100.0,), (0.0, 3.5), tangent=tangent).status
        assert status.ok
        assert told in status.message
    assert told in str(simulate_many(system, [(100.0,)], (0.0, 3.5)).message.values[0])
