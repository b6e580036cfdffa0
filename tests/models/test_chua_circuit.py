"""Chua's circuit against matrix exponentials, its characteristic polynomial and the published exponents."""

import mpmath as mp
import numpy as np
import pytest

import hybrid
import lyapunov
from models import chua_circuit

ALPHA, BETA, M0, M1 = 9.0, 100 / 7, -8 / 7, -5 / 7
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("mode", "x", "slope"), [("inner", 0.0, M0), ("right", 1.5, M1), ("left", -1.5, M1)])
def test_eigenvalues_of_the_equilibria(mode, x, slope):
    start, t = (x, 0.0, -x), 0.5
    arc = hybrid.simulate(chua_circuit(), start, (0.0, t), mode=mode, tangent=True, solver=TIGHT)
    np.testing.assert_allclose(arc.x[-1], start, atol=1e-12)
    a = ALPHA * (1 + slope)
    exact = np.exp(t * np.roots([1.0, 1 + a, BETA + a - ALPHA, BETA * a]))
    found = np.linalg.eigvals(arc.fundamental)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(exact), rtol=1e-10)


def crossings(start, count):
    """Times at which ``abs(x) = 1``, from the inner region, by matrix exponentials in 30 digits."""
    with mp.workdps(30):
        alpha, beta, m0, m1 = mp.mpf(9), mp.mpf(100) / 7, mp.mpf(-8) / 7, mp.mpf(-5) / 7
        state, side, t, found = mp.matrix(start), 0, mp.mpf(0), []
        while len(found) < count:
            slope = m1 if side else m0
            A = mp.matrix([[-alpha * (1 + slope), alpha, 0], [1, -1, 1], [0, -beta, 0]])
            x = side * (m1 - m0) / (1 + m1)
            rest = mp.matrix([x, 0, -x])

            def flow(s, A=A, rest=rest, state=state):
                return rest + mp.expm(A * s) * (state - rest)

            walls, s, step = ((side,) if side else (1, -1)), mp.mpf(0), mp.mpf("0.02")
            advance = mp.expm(A * step)
            here = state
            while True:
                ahead = rest + advance * (here - rest)
                # A crossing at the very start is the previous crossing.
                wall = next((w for w in walls if s > 0 and (here[0] - w) * (ahead[0] - w) < 0), None)
                if wall is not None:
                    break
                here, s = ahead, s + step
            s = mp.findroot(
                lambda s, flow=flow, wall=wall: flow(s)[0] - wall, (s, s + step), solver="anderson"
            )
            state, t = flow(s), t + s
            side = 0 if side else wall
            found.append(float(t))
        return found


def test_ten_crossings():
    start = (0.7, 0.1, -0.2)
    exact = crossings(start, 10)
    arc = hybrid.simulate(chua_circuit(), start, (0.0, exact[-1] + 1e-6), solver=TIGHT)
    np.testing.assert_allclose([jump.t for jump in arc.jumps], exact, atol=1e-9)
    assert {"left", "inner", "right"} == set(arc.mode)
    for jump in arc.jumps:
        np.testing.assert_allclose(jump.saltation, np.eye(3), atol=1e-9)


def test_exponents_of_the_double_scroll():
    """Published: 0.3271, 0, -2.5197 (Sprott 2003)."""
    result = lyapunov.lyapunov_spectrum(chua_circuit(), (0.7, 0.0, 0.0), interval=1.0, intervals=20_000)
    np.testing.assert_allclose(result.exponents, [0.3271, 0.0, -2.5197], atol=0.03)
    assert result.exponents[1] == pytest.approx(0.0, abs=1e-4)
    dimension = 2 + result.exponents[:2].sum() / -result.exponents[2]
    assert dimension == pytest.approx(2.13, abs=0.01)


def test_exponents_sum_as_the_share_of_time_in_the_inner_region_says():
    start, t_end = (0.7, 0.0, 0.0), 30.0
    arc = hybrid.simulate(chua_circuit(), start, (0.0, t_end), solver=TIGHT)
    bounds = np.array([0.0, *(jump.t for jump in arc.jumps), t_end])
    inner = np.array(["inner"] + [jump.target for jump in arc.jumps]) == "inner"
    share = np.diff(bounds)[inner].sum() / t_end
    assert 0.2 < share < 0.8
    result = lyapunov.lyapunov_spectrum(
        chua_circuit(), start, interval=1.0, intervals=30, transient=0, solver=TIGHT
    )
    expected = -1 - ALPHA * (1 + M1 + share * (M0 - M1))
    assert result.growths.sum() / t_end == pytest.approx(expected, abs=1e-8)
