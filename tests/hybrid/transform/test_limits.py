"""Limits of chatter in systems that have been split: they land where an ordinary landing would."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Transition, Tsit5, simulate, split

# The bounces from a height of 5 with half the speed each accumulate at t = 3.
METHODS = [None, DOP853(), Tsit5(), RadauIIA()]


def parcel(belt, drift=0.0):
    """A parcel that falls on a belt with the friction ``belt(t, vx)``; ``drift`` accelerates its flight."""
    return split(
        HybridSystem(
            state=("x", "y", "vx", "vy"),
            modes=[
                Mode("fly", lambda t, x, p: (x.vx, x.vy, drift, -10.0)),
                Mode("belt", lambda t, x, p: (x.vx, 0.0, belt(t, x.vx), 0.0)),
            ],
            transitions=[
                Transition(
                    "fly",
                    "fly",
                    Guard(lambda t, x, p: x.y, -1),
                    Reset(lambda t, x, p: (x.x, 0.0, x.vx, -0.5 * x.vy)),
                    accumulates_to="belt",
                )
            ],
        )
    )


def landed(system, vx=0.0, solver=None):
    arc = simulate(system, (0.0, 5.0, vx, 0.0), (0.0, 10.0), mode="fly", solver=solver)
    assert arc.status.ok, arc.status
    return arc.x[-1]


@pytest.mark.parametrize("solver", METHODS)
def test_below_a_surface(solver):
    # One unit of friction brings it to the speed 2 of the belt from t = 3 to 5.
    end = landed(parcel(lambda t, vx: -np.sign(vx - 2.0)), solver=solver)
    assert end == pytest.approx([12.0, 0.0, 2.0, 0.0], abs=1e-8)


def test_above_a_surface():
    end = landed(parcel(lambda t, vx: -np.sign(vx - 2.0)), vx=3.0)
    assert end == pytest.approx([9.0 + 2.5 + 12.0, 0.0, 2.0, 0.0], abs=1e-8)


def test_on_a_surface():
    end = landed(parcel(lambda t, vx: -np.sign(vx - 2.0)), vx=2.0)
    assert end == pytest.approx([20.0, 0.0, 2.0, 0.0], abs=1e-8)


def test_below_a_moving_surface():
    end = landed(parcel(lambda t, vx: -np.sign(vx - t)))
    assert end == pytest.approx([24.5, 0.0, 7.0, 0.0], abs=1e-8)


def test_a_side_that_changes_during_the_chatter():
    end = landed(parcel(lambda t, vx: -np.sign(vx - 2.0), drift=1.0))
    assert end == pytest.approx([4.5 + 2.5 + 12.0, 0.0, 2.0, 0.0], abs=1e-8)


def test_between_two_surfaces():
    # Friction of two belts, at the speeds 1 and 4: together they hold no parcel between.
    end = landed(parcel(lambda t, vx: -2.0 * np.sign(vx - 1.0) - np.sign(vx - 4.0)), vx=2.0)
    assert end == pytest.approx([6.0 + 1.5 + 6.0, 0.0, 1.0, 0.0], abs=1e-8)


def test_a_surface_that_does_not_attract():
    # The belt only drags more above the speed 2: the parcel passes that speed at t = 3.5, and goes on.
    end = landed(parcel(lambda t, vx: np.where(vx > 2.0, 1.0, 4.0)))
    assert end == pytest.approx([0.5 + 2.0 * 6.5 + 0.5 * 6.5**2, 0.0, 8.5, 0.0], abs=1e-8)
