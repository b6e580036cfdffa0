"""States that come to rest in finite time where two surfaces meet, as in a groove with dry friction."""

import numpy as np
import pytest

from hybrid import DOP853, RadauIIA, StatusCode, Taylor, Tsit5, from_equations, simulate

SOLVERS = pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda each: type(each).__name__
)


def time_of_rest(q, groove, friction):
    """Time from rest at ``q`` to the rest at the bottom, the sum of a geometric series of swings.

    The block accelerates by ``groove - friction`` on its way down and decelerates by their sum on its way up.
    The ratio of two heights that follow each other is also that of the two times of a swing.
    """
    ratio = (groove - friction) / (groove + friction)
    return np.sqrt(2 * q / (groove - friction)) * (1 + ratio) / (1 - np.sqrt(ratio))


def twisting(place=0.0, push=lambda t: 0.0):
    """A block with friction 0.5 in a groove of strength 2 at a place, pushed by a force."""
    return from_equations(
        lambda t, x, p: (
            x.v,
            -p.g * np.sign(x.q - place) - p.F * np.sign(x.v) + push(t),
            1.0 + 0.0 * x.q,
        ),
        state=("q", "v", "s"),
        parameters={"g": 2.0, "F": 0.5},
    )


@SOLVERS
@pytest.mark.parametrize("place", [0.0, 1.0, -2.5])
def test_a_block_rests_at_the_bottom_of_its_groove_and_the_run_goes_on(solver, place):
    arc = simulate(twisting(place), (place + 1.0, 0.0, 0.0), (0.0, 20.0), solver=solver)
    assert arc.status.ok, arc.status
    [limit] = [jump for jump in arc.jumps if jump.kind == "limit"]
    assert limit.t == pytest.approx(time_of_rest(1.0, 2.0, 0.5), abs=1e-7)
    assert arc.x[-1] == pytest.approx([place, 0.0, 20.0], abs=1e-8)
    assert arc.part_of[-1] == "smooth"


@pytest.mark.parametrize("mass", [0.5, 2.0])
def test_a_speed_that_is_a_multiple_of_the_switching_quantity_leads_its_position(mass):
    """The friction switches with the momentum, and the rate of the position is a share of it."""
    system = from_equations(
        lambda t, x, p: (x.momentum / p.m, -2.0 * np.sign(x.q) - 0.5 * np.sign(x.momentum)),
        state=("q", "momentum"),
        parameters={"m": 1.0},
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 40.0), parameters={"m": mass})
    assert arc.status.ok, arc.status
    limit = arc.jumps[-1]
    assert limit.kind == "limit"
    assert limit.t == pytest.approx(time_of_rest(1.0, 2.0 / mass, 0.5 / mass), abs=1e-8)


def test_a_start_at_the_bottom_is_at_rest():
    arc = simulate(twisting(), (0.0, 0.0, 0.0), (0.0, 1.0))
    assert arc.status.ok
    assert not len(arc.jumps)
    assert arc.x[-1] == pytest.approx([0.0, 0.0, 1.0])


def test_a_start_where_friction_alone_would_hold_the_block_is_at_rest():
    """Three modes keep it there, all alike."""
    system = from_equations(lambda t, x, p: (x.v, -0.5 * np.sign(x.q) - 2.0 * np.sign(x.v)), state=("q", "v"))
    arc = simulate(system, (0.0, 0.0), (0.0, 1.0))
    assert arc.status.ok
    assert arc.x[-1] == pytest.approx([0.0, 0.0])


def test_a_block_leaves_its_groove_when_the_push_exceeds_both_forces():
    """The push is ``t - 10`` after t = 10: it exceeds 2.5 at t = 12.5, and what is above 2.5 accelerates."""
    system = twisting(push=lambda t: np.maximum(t - 10.0, 0.0))
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 15.0))
    assert arc.status.ok, arc.status
    assert arc.jumps.t[-1] == pytest.approx(12.5, abs=1e-9)
    assert arc.x[-1] == pytest.approx([2.5**3 / 6, 2.5**2 / 2, 15.0], abs=1e-8)


@pytest.mark.parametrize("side", [1, -1])
def test_a_block_leaves_its_groove_to_the_side_of_the_push(side):
    system = twisting(push=lambda t: side * t)
    arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 3.5))
    assert arc.status.ok, arc.status
    assert arc.jumps.t == pytest.approx([2.5], abs=1e-12)
    assert arc.x[-1, :2] == pytest.approx([side / 6, side / 2], abs=1e-10)


def test_a_shaken_block_leaves_its_groove_comes_back_to_rest_and_leaves_again():
    """Shaken by ``A sin t``, it leaves when that reaches 2.5, and rests again within each half period."""
    system = from_equations(
        lambda t, x, p: (x.v, -2.0 * np.sign(x.q) - 0.5 * np.sign(x.v) + p.A * np.sin(t)),
        state=("q", "v"),
        parameters={"A": 2.6},
        period=2 * np.pi,
    )
    arc = simulate(system, (0.0, 0.0), (0.0, 19.5))
    assert arc.status.ok, arc.status
    left = [jump.t for jump in arc.jumps if jump.source == "q=0, v=0"]
    rested = [jump.t for jump in arc.jumps if jump.kind == "limit"]
    assert len(left) == len(rested) == 6
    assert left == pytest.approx(np.arcsin(2.5 / 2.6) + np.pi * np.arange(6), abs=1e-8)
    # The shaking has one form in both halves of its period.
    assert np.diff(rested) == pytest.approx(np.pi, abs=1e-6)


def test_two_blocks_rest_in_grooves_of_their_own():
    system = from_equations(
        lambda t, x, p: (
            x.v,
            -2.0 * np.sign(x.q) - 0.5 * np.sign(x.v),
            x.w,
            -3.0 * np.sign(x.y) - 0.5 * np.sign(x.w),
        ),
        state=("q", "v", "y", "w"),
    )
    arc = simulate(system, (1.0, 0.0, 2.0, 0.0), (0.0, 30.0))
    assert arc.status.ok, arc.status
    rested = [jump.t for jump in arc.jumps if jump.kind == "limit"]
    right = [time_of_rest(1.0, 2.0, 0.5), time_of_rest(2.0, 3.0, 0.5)]
    assert rested == pytest.approx(right, abs=1e-7)
    assert arc.x[-1] == pytest.approx(np.zeros(4), abs=1e-9)


def test_a_block_rests_in_one_of_two_grooves():
    """From 0.4 it has not the energy to get out of the groove at 0 into that at 3."""
    system = from_equations(
        lambda t, x, p: (x.v, -2.0 * np.sign(x.q) - 0.5 * np.sign(x.v) - np.sign(x.q - 3) - 1.0),
        state=("q", "v"),
    )
    arc = simulate(system, (0.4, 0.0), (0.0, 30.0))
    assert arc.status.ok, arc.status
    assert arc.mode[-1] == "q=0, v=0"
    assert arc.jumps[-1].t == pytest.approx(time_of_rest(0.4, 2.0, 0.5), abs=1e-7)


def test_two_masses_rest_against_each_other_and_move_on_together():
    """The force between them is the groove; their momentum stays."""

    def field(t, x, p):
        force = -2.0 * np.sign(x.a - x.b) - 0.5 * np.sign(x.v - x.w)
        return x.v, x.w, force, -force

    arc = simulate(from_equations(field, state=("a", "b", "v", "w")), (1.0, 0.0, 0.3, 0.0), (0.0, 30.0))
    assert arc.status.ok, arc.status
    assert arc.x[-1] == pytest.approx([5.0, 5.0, 0.15, 0.15], abs=1e-8)


def test_other_components_go_on_as_they_do_in_all_cells_around():
    """A spring with preload: the angle is driven by the position, and rests with it."""
    system = from_equations(
        lambda t, x, p: (x.v, -x.q - np.sign(x.q) - 0.5 * np.sign(x.v), x.q + 1.0 - x.y),
        state=("q", "v", "y"),
    )
    arc = simulate(system, (3.0, 0.0, 0.0), (0.0, 60.0))
    assert arc.status.ok, arc.status
    assert arc.x[-1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-8)


def test_a_mode_where_the_fields_around_do_not_agree_is_not_invented():
    """The rate of the third component is the side of the groove: at its bottom, anything from -1 to 1."""
    system = from_equations(
        lambda t, x, p: (x.v, -2.0 * np.sign(x.q) - 0.5 * np.sign(x.v), np.sign(x.q)), state=("q", "v", "y")
    )
    assert not any("q=0" in name for name in system.mode_names)
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 30.0))
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(time_of_rest(1.0, 2.0, 0.5), abs=1e-8)
    assert "not unique" in arc.status.remedy
    assert "accumulates_to" not in str(arc.status)


def test_a_kink_makes_no_mode_of_rest():
    """Friction holds the block anywhere near; nothing makes crossings accumulate at the kink."""
    system = from_equations(
        lambda t, x, p: (x.v, -x.q - 0.5 * np.sign(x.v) - 2.0 * np.maximum(x.q, 0)), state=("q", "v")
    )
    assert "q=0, v=0" not in system.mode_names


def spiral(drift=lambda t: 0.0):
    """Four fields that turn about the origin: each quarter takes a third of its distance, leaves a third."""
    return from_equations(
        lambda t, x, p: (
            -np.sign(x.x) + 2.0 * np.sign(x.y) + drift(t),
            -2.0 * np.sign(x.x) - np.sign(x.y),
            1.0 + x.x,
        ),
        state=("x", "y", "s"),
    )


@SOLVERS
def test_a_spiral_into_the_intersection_of_two_surfaces_slides_on_along_both(solver):
    arc = simulate(spiral(), (1.0, 0.0, 0.0), (0.0, 3.0), solver=solver)
    assert arc.status.ok, arc.status
    [limit] = [jump for jump in arc.jumps if jump.kind == "limit"]
    assert limit.t == pytest.approx(0.5, abs=1e-8)
    assert arc.mode[-1] == "x=0, y=0"
    # The area under x(t) is four triangles per turn, and each turn is 81 times smaller in x and in time.
    turn = 1 / 6 - 1 / 162 - 1 / 486 + 1 / 13122
    assert arc.x[-1] == pytest.approx([0.0, 0.0, 3.0 + turn / (1 - 1 / 81**2)], abs=1e-7)


def test_an_intersection_that_a_spiral_has_reached_is_left_when_the_drift_exceeds_what_both_hold():
    """Shares ``a = c / 5`` and ``b = -2 c / 5`` hold a drift ``c``: up to 2.5."""
    arc = simulate(spiral(drift=lambda t: t), (0.0, 0.1, 0.0), (0.0, 2.9))
    assert arc.status.ok, arc.status
    assert arc.jumps.t[-1] == pytest.approx(2.5, abs=1e-9)
    assert arc.mode[-1] == "x=0, y<0"
    # Along x = 0 the rate of y is 5 - 2 t.
    assert arc.x[-1, 1] == pytest.approx(-0.16, abs=1e-8)
