"""Guards that cannot be traced: what lies at a place where they are sampled is found."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Taylor, Transition, simulate
from hybrid.kernels.events.onset import BY_SPEED, BY_STEP
from hybrid.kernels.guards import hidden, sampled
from hybrid.kernels.guards.pieces import NO_COLUMN, NOWHERE
from hybrid.kernels.guards.pieces import Guard as OnPath
from hybrid.kernels.guards.sampled import SAMPLES
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain


def dip(t, x, p):
    if t > 1e9:
        return 0.0
    return abs(x.q - p.c) - p.w


def slope(t, x, p):
    return (np.sign(x.q - p.c), 0.0 * t)


SYSTEM = HybridSystem(
    state=("q",),
    parameters={"c": 0.5, "w": 0.01},
    modes=[Mode("run", lambda t, x, p: (1.0,))],
    transitions=[
        Transition("run", "run", Guard(dip, -1, gradient=slope), name="in"),
        Transition("run", "run", Guard(dip, +1, gradient=slope), name="out"),
    ],
)


@pytest.mark.parametrize("place", [1, 2, 3, SAMPLES // 2, SAMPLES - 1])
def test_a_dip_around_each_sample_fires_in_and_out(place):
    """The flight takes one step."""
    c, w = place / SAMPLES, 0.4 / SAMPLES
    arc = simulate(SYSTEM, (0.0,), (0.0, 1.0), parameters={"c": c, "w": w}, solver=Taylor())
    assert list(arc.jumps.transition) == ["in", "out"]
    np.testing.assert_allclose(arc.jumps.t, [c - w, c + w], rtol=0, atol=1e-15)


class TestAlongAPath:
    """The state runs from -1 to 1, evenly; the guard is a function of it, scaled by its slope along time."""

    def change(self, guard, side, *, direction=0, on_guard=0, fired=False, length=2.0, hidden=0.0):
        def write(transition, t, x, parameters, scalar):
            assert abs(t - 10.0 - 0.5 * (x[0] + 1.0)) < 1e-14
            scalar[0] = guard(x[0])

        model = SimpleNamespace(dimension=1, parameters=None, guard=write, direction=np.array([9, direction]))
        run = SimpleNamespace(unproved=4, last_fired=1 if fired else 0, since_entry=0.0, passed=np.zeros(2))
        work = SimpleNamespace(state=np.zeros(1), scalar=np.zeros(1))
        path = Path(np.array([[-1.0], [1.0]]), 1, -1, 10.0, 0.5, length, True)
        known = OnPath(1, NO_COLUMN, side, on_guard, 0.0, 0.0, 0.0)
        found = plain(sampled).sampled_change(model, run, path, known, hidden, work)
        assert run.unproved == 5
        return found

    @pytest.mark.parametrize("sign", [-1, 1])
    @pytest.mark.parametrize("root", [-0.9999, -0.37, 0.0, 0.125, 0.99])
    def test_a_change_of_sign(self, root, sign):
        def guard(x):
            return sign * (x - root)

        for direction in (0, sign):
            place, side, length = self.change(guard, -sign, direction=direction)
            assert place == pytest.approx(root + 1.0, rel=1e-15)
            assert (side, length) == (sign, 2.0)
        # In the other direction, and before it, nothing fires; the side that is reached is known.
        assert self.change(guard, -sign, direction=-sign) == (NOWHERE, sign, 2.0)
        assert self.change(guard, -sign, length=0.99 * (root + 1.0)) == (NOWHERE, -sign, 0.99 * (root + 1.0))

    def test_a_side_that_is_not_known_is_that_of_the_first_sample(self):
        place, side, _ = self.change(lambda x: 0.25 - x if x > -1.0 else 0.0, 0)
        assert (place, side) == (pytest.approx(1.25, rel=1e-15), -1)
        place, side, _ = self.change(lambda x: x - 0.25 if x > -1.0 else 0.0, 0)
        assert (place, side) == (pytest.approx(1.25, rel=1e-15), 1)
        assert self.change(lambda x: 0.0, 0) == (NOWHERE, 0, 2.0)
        assert self.change(lambda x: 2.0, 0) == (NOWHERE, 1, 2.0)

    def test_the_second_change_counts_if_the_first_has_the_wrong_direction(self):
        place, side, _ = self.change(lambda x: 0.25 - x * x, -1, direction=-1)
        assert (place, side) == (pytest.approx(1.5, rel=1e-15), -1)

    def test_a_guard_that_is_beyond_from_the_start_crosses_there(self):
        """Its side was known from the step before, or the next step had to show it."""
        assert self.change(lambda x: 3.0 + x, -1)[:2] == (0.0, 1)
        assert self.change(lambda x: 3.0 + x if x > -1.0 else -1e-20, -1, on_guard=BY_STEP)[:2] == (0.0, 1)
        # A transition that has just fired does not fire again in the same place.
        assert self.change(lambda x: 3.0 + x, -1, on_guard=BY_STEP, fired=True) == (NOWHERE, 1, 2.0)
        # Known from its speed, a guard on which the run starts crosses where it comes back.
        place, side, _ = self.change(lambda x: x + 0.99 if x > -1.0 else 1e-20, -1, on_guard=BY_SPEED)
        assert (place, side) == (pytest.approx(0.01, rel=1e-13), 1)

    def test_signs_that_are_noise_are_not_looked_at(self):
        """The guard is sampled from that place on."""
        place, side, _ = self.change(lambda x: -1.0 if x < -0.5 else x - 0.25, 0, hidden=0.5)
        assert (place, side) == (pytest.approx(1.25, rel=1e-15), 1)
        assert self.change(lambda x: -1.0 if x < -0.5 else 1.0, 1, hidden=0.5) == (NOWHERE, 1, 2.0)


def test_how_far_a_guard_comes_from_zero_at_eight_places():
    def farthest(guard, place):
        def write(transition, t, x, parameters, scalar):
            scalar[0] = guard(x[0])

        model = SimpleNamespace(dimension=1, parameters=None, guard=write)
        work = SimpleNamespace(state=np.zeros(1), scalar=np.zeros(1))
        kernels = plain(hidden, has_program=lambda *arguments: False)
        path = Path(np.array([[-1.0], [1.0]]), 1, -1, 10.0, 0.5, 2.0, True)
        return kernels.farthest_from_zero(model, path, OnPath(1, NO_COLUMN, 1, 0, 0.0, 0.0, 0.0), place, work)

    for place in np.arange(1, 9) / 4:
        for value in (0.5, -0.5):
            assert (
                farthest(lambda x, place=place, value=value: value if x == place - 1.0 else 0.0, 2.0) == 0.5
            )
    for place in (0.0, 0.3, 2.25):
        assert farthest(lambda x, place=place: 1.0 if x == place - 1.0 else 0.0, 2.0) == 0.0
    assert farthest(lambda x: 3.0 if x == 0.0 else -1.0, 1.0) == 3.0
    assert farthest(lambda x: np.nan if x == 0.0 else -1.0, 2.0) == np.inf
