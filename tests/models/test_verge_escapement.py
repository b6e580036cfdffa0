"""The escapement against closed forms of pushes and impacts, and a limit cycle computed by hand."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
from hybrid import continue_orbit, periodic_orbit, simulate
from models import verge_escapement

N = 15
IW, IF, TAU, A, C = 1e-4, 1e-3, 0.02, 0.3, 0.25
SLOPE = A * N


def track(theta):
    """Angle to which a tooth brings a pallet, its slope and its curvature."""
    return A * np.sin(N * theta), A * N * np.cos(N * theta), -A * N**2 * np.sin(N * theta)


def settled(parameters=None, time=6.0, **given):
    clock = verge_escapement()
    arc = simulate(clock, (0.0, 0.0, 0.0, 0.0), (0.0, time), parameters=parameters)
    pecks = np.array([jump.t for jump in arc.jumps["lower opens"]])
    # The lower pallet lets go twice per tooth: once at the end of a push, once in a recoil.
    return periodic_orbit(
        clock, arc.x[-1], mode=arc.end.mode, period=pecks[-1] - pecks[-3], parameters=parameters
    )


@pytest.fixture(scope="module")
def orbit():
    return settled()


class ByHand:
    """The plastic escapement without the library: pushes with one degree of freedom, flights, impacts.

    It starts on the upper pallet where the flank is straight. ``passes`` has the times and the speeds of the
    wheel where it comes to such a place again.
    """

    def __init__(self, w):
        self.t, self.theta, self.w, self.side = 0.0, 0.0, w, +1
        self.passes = []

    def rates(self, _, y):
        """Rates of the angle of the wheel and of its speed while it pushes a pallet."""
        _, slope, curve = track(y[0])
        return [y[1], (TAU - IF * slope * curve * y[1] ** 2) / (IW + IF * slope**2)]

    def push(self):
        """Push a pallet until it is let go."""

        def force(t, y):
            _, slope, curve = track(y[0])
            return self.side * (slope * self.rates(t, y)[1] + curve * y[1] ** 2)

        def straight(_, y):
            return np.sin(N * y[0] / 2)

        force.terminal, force.direction = True, -1
        start = [self.theta, self.w]
        if force(0.0, start) <= 0.0:
            return
        run = solve_ivp(self.rates, (0.0, 5.0), start, events=[force, straight], rtol=1e-12, atol=1e-13)
        for t, y in zip(run.t_events[1], run.y_events[1], strict=True):
            if t > 1e-9 and y[1] > 0.0:
                self.passes.append((self.t + t, y[1]))
        self.t, (self.theta, self.w) = self.t + run.t_events[0][0], run.y_events[0][0]

    def fly(self):
        """Fly until a pallet is hit, and hit it."""
        s, slope, _ = track(self.theta)
        start = [self.theta, s - self.side * C, self.w, slope * self.w]

        def gap(side):
            def event(_, y):
                return side * (y[1] - track(y[0])[0]) + C

            event.terminal, event.direction = True, -1
            return event

        run = solve_ivp(
            lambda _, y: [y[2], y[3], TAU / IW, 0.0],
            (0.0, 5.0),
            start,
            events=[gap(+1), gap(-1)],
            max_step=2e-3,
            rtol=1e-12,
            atol=1e-13,
        )
        hit = 0 if len(run.t_events[0]) else 1
        self.side, self.t = (+1, -1)[hit], self.t + run.t_events[hit][0]
        self.theta, _, w, nu = run.y_events[hit][0]
        slope = track(self.theta)[1]
        self.w = (IW * w + slope * IF * nu) / (IW + IF * slope**2)

    def until(self, passes):
        """Time and speed at a pass."""
        while len(self.passes) < passes:
            self.push()
            self.fly()
        return self.passes[passes - 1]


def test_acceleration_on_the_straight_flank():
    arc = simulate(verge_escapement(), (0.0, -C, 0.0, 0.0), (0.0, 0.01), mode="upper")
    expected = TAU / (IW + SLOPE**2 * IF)
    # The force on the foliot makes its acceleration, that of the wheel times the slope.
    assert arc["upper.normal"][0] == pytest.approx(IF * SLOPE * expected, rel=1e-12)
    t = 1e-3
    assert arc(t, "w") == pytest.approx(expected * t, rel=1e-6)
    lone = simulate(verge_escapement(), (0.0, 0.0, 1.0, 0.0), (0.0, 0.005))
    assert lone["theta"][-1] == pytest.approx(0.005 + TAU / IW * 0.005**2 / 2, rel=1e-12)


def test_a_push_conserves_the_energy_with_that_of_the_drive(orbit):
    arc = orbit.arc()
    theta, w = arc["theta"], arc["w"]
    total = (IW + IF * track(theta)[1] ** 2) * w**2 / 2 - TAU * theta
    stretches = [part for part in np.unique(arc.j) if arc.mode[arc.j == part][0] in ("upper", "lower")]
    assert len(stretches) >= 4
    for part in stretches:
        assert np.ptp(total[arc.j == part]) < 1e-9 * TAU


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_impacts_keep_the_momentum_along_the_track(e):
    arc = simulate(verge_escapement(), (0.0, 0.0, 0.0, 0.0), (0.0, 2.0), parameters={"e": e})
    hits = [jump for jump in arc.jumps if jump.transition.startswith("free->free") and jump.kind != "limit"]
    assert len(hits) >= 4
    for hit in hits:
        slope = track(hit.x_plus[0])[1]
        before, after = (
            (x[3] - slope * x[2], IW * x[2] + slope * IF * x[3]) for x in (hit.x_minus, hit.x_plus)
        )
        scale = np.abs(hit.x_minus[2:]).max() * slope
        assert after[0] == pytest.approx(-e * before[0], abs=1e-9 * abs(scale))
        assert after[1] == pytest.approx(before[1], rel=1e-9, abs=1e-12)


def test_the_wheel_recoils_by_the_work_of_the_torque():
    """A foliot that turns against a tooth pushes the wheel back until the torque has taken its energy."""
    theta, w = 0.05, -0.6
    s, slope, _ = track(theta)
    arc = simulate(verge_escapement(), (theta, s - C, w, slope * w), (0.0, 0.5), mode="upper")
    back = theta - arc(np.linspace(0.0, 0.5, 20001), "theta").min()
    assert set(arc.mode[arc.t < 0.1]) == {"upper"}
    assert back == pytest.approx((IW + IF * slope**2) * w**2 / (2 * TAU), rel=1e-7)


def test_the_limit_cycle(orbit):
    assert orbit.status.ok
    assert orbit.turns == {"theta": 1}
    # Two directions are lost in plastic impacts, one is along the time.
    sizes = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(sizes[[0, 1, 3]], [0.0, 0.0, 1.0], atol=1e-8)
    assert 0.0 < sizes[2] < 1.0


def test_the_period_and_the_multiplier_by_hand(orbit):
    clock = ByHand(0.0)
    times, speeds = np.array([clock.until(k) for k in range(6, 9)]).T
    assert np.diff(times) == pytest.approx(orbit.period, abs=1e-9)
    ends = [ByHand(speeds[-1] + shift).until(1)[1] for shift in (1e-3, -1e-3)]
    slope = (ends[0] - ends[1]) / 2e-3
    assert np.sort(np.abs(orbit.multipliers))[2] == pytest.approx(slope, abs=1e-5)


def test_the_pace_is_the_root_of_the_torque_over_the_inertia(orbit):
    faster, slower = settled({"tau": 4 * TAU}, time=3.0), settled({"Iw": 9 * IW, "If": 9 * IF}, time=18.0)
    assert faster.period == pytest.approx(orbit.period / 2, rel=1e-9)
    assert slower.period == pytest.approx(orbit.period * 3, rel=1e-9)
    expected = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(np.sort(np.abs(faster.multipliers)), expected, atol=1e-7)


def test_a_branch_over_the_torque(orbit):
    branch = continue_orbit(orbit, "tau", (0.5 * TAU, 2.0 * TAU))
    assert branch.status.ok
    np.testing.assert_allclose(branch.period, orbit.period * np.sqrt(TAU / branch.parameter), rtol=1e-8)
    assert branch.parameter[[0, -1]] == pytest.approx([0.5 * TAU, 2.0 * TAU])
    assert len(branch.bifurcations) == 0


def test_impacts_take_the_work_of_the_torque(orbit):
    arc = orbit.arc()
    lost = arc.jumps.before("energy") - arc.jumps.after("energy")
    assert lost.sum() == pytest.approx(TAU * 2 * np.pi / N, rel=1e-9)


def test_the_number_of_teeth():
    clock = verge_escapement(11)
    arc = simulate(clock, (0.0, 0.0, 0.0, 0.0), (0.0, 4.0))
    gap = arc["phi"] - A * np.sin(11 * arc["theta"]) + C
    np.testing.assert_allclose(arc["upper.gap"], gap, atol=1e-12)
    assert clock.angles["theta"] == pytest.approx(2 * np.pi / 11)
    with pytest.raises(hybrid.errors.ArgumentError, match="teeth"):
        verge_escapement(0)
