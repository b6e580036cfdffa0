"""The block on the belt: Leine's limit cycle."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from models import stick_slip
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
CYCLE = reference("stick_slip")


class TestStribeck:
    def test_limit_cycle(self):
        orbit = hybrid.periodic_orbit(stick_slip(), (0.5, 0.2), period=12.0)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(CYCLE["period"], abs=1e-10)
        np.testing.assert_allclose(np.sort_complex(orbit.multipliers), [0.0, 1.0], atol=1e-8)
        exponents = lyapunov.floquet_exponents(orbit)
        assert exponents[0] == pytest.approx(0.0, abs=1e-9)
        assert exponents[1] == -math.inf

    def test_largest_displacement(self):
        """The largest displacement is where the velocity falls through zero."""
        turning = hybrid.Guard(lambda t, x, p: x.v, direction=-1)
        section = hybrid.poincare_section(stick_slip(), (0.5, 0.2), turning, points=2, solver=TIGHT)
        np.testing.assert_allclose(section.x[:, 0], CYCLE["x_largest"], atol=1e-10)

    def test_release(self):
        """The belt carries the block from 0.5 to 1 at speed 0.2; the slip begins with zero acceleration."""
        arc = hybrid.simulate(stick_slip(), (0.5, 0.2), (0.0, 3.0), solver=TIGHT)
        [release] = arc.jumps
        assert release.t == pytest.approx(2.5, abs=1e-12)
        np.testing.assert_allclose(release.x_plus, [1.0, 0.2], atol=1e-12)
        # v'' = F'(0) v' - v = -0.2, with F the friction.
        assert arc(2.5 + 1e-3)[1] == pytest.approx(0.2 - 0.1e-6, abs=1e-9)
