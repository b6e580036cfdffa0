"""Balls in a line: rational arithmetic, the unfolded wedge, simultaneous collisions, collapse."""

import math
from fractions import Fraction

import numpy as np
import pytest

import hybrid
from models import ball_chain


def exact_collisions(q, v, m, e):
    """Times and names of all collisions, and the last velocities, in rational numbers."""
    q, v, t, found = [Fraction(x) for x in q], [Fraction(x) for x in v], Fraction(0), []
    while True:
        waits = [((q[k + 1] - q[k]) / (v[k] - v[k + 1]), k) for k in (0, 1) if v[k] > v[k + 1]]
        if not waits:
            return found, [float(x) for x in v]
        wait, k = min(waits)
        q = [x + y * wait for x, y in zip(q, v, strict=True)]
        t += wait
        change = (1 + e) * (v[k] - v[k + 1]) / (m[k] + m[k + 1])
        v[k], v[k + 1] = v[k] - m[k + 1] * change, v[k + 1] + m[k] * change
        found.append((float(t), ("left", "right")[k]))


def simulate(q, v, t_end, masses=(1, 1, 1), e=1.0):
    values = {"m1": masses[0], "m2": masses[1], "m3": masses[2], "e": e}
    return hybrid.simulate(
        ball_chain(),
        (*q, *v),
        (0.0, t_end),
        parameters={name: float(value) for name, value in values.items()},
    )


@pytest.mark.parametrize(
    ("masses", "e", "count"),
    [
        ((1, 1, 1), Fraction(1), 2),
        ((1, 1, 1), Fraction(1, 2), 3),
        ((1, 1, 1), Fraction(2, 25), 10),
        ((1, Fraction(1, 8), 1), Fraction(1), None),
        ((3, 1, 2), Fraction(9, 10), None),
    ],
)
def test_collisions(masses, e, count):
    q, v = (0, 1, 2), (1, 0, 0)
    exact, velocities = exact_collisions(q, v, masses, e)
    arc = simulate(q, v, exact[-1][0] + 100.0, masses, e)
    assert count in (None, len(exact))
    assert [jump.transition for jump in arc.jumps] == [name for _, name in exact]
    np.testing.assert_allclose([jump.t for jump in arc.jumps], [t for t, _ in exact], rtol=1e-10)
    np.testing.assert_allclose(arc.x[-1, 3:], velocities, atol=1e-10)


@pytest.mark.parametrize("masses", [(1.0, 1.0, 1.0), (1.0, 0.1, 1.0), (2.0, 0.03, 0.5), (1.0, 5.0, 2.0)])
@pytest.mark.parametrize("v", [(1.0, 0.0, -0.4), (1.0, 0.9, -2.0), (0.3, -1.0, -1.2)])
def test_elastic_collisions_unfold_to_a_straight_line(masses, v):
    """In the plane of ``sqrt(m) q`` without the centre of mass the two contacts are rays from the origin."""
    m1, m2, m3 = masses
    phi = math.acos(math.sqrt(m1 * m3 / ((m1 + m2) * (m2 + m3))))

    def polar(q):
        """Angle from the left contact towards the right one, from the gaps alone."""
        left, right = q[1] - q[0], q[2] - q[1]
        # Gaps divided by their lengths in the metric are distances from the sides of the wedge.
        from_left = left / math.sqrt(1 / m1 + 1 / m2)
        from_right = right / math.sqrt(1 / m2 + 1 / m3)
        return math.atan2(from_left * math.sin(phi), from_right + from_left * math.cos(phi))

    q = (0.0, 1.0, 2.5)
    start, end = polar(q), polar(v)
    # The angle along the straight line changes by less than half a turn.
    turn = (end - start + math.pi) % (2 * math.pi) - math.pi
    folds = math.floor((start + turn) / phi)
    arc = simulate(q, v, 1e3, masses)
    assert len(arc.jumps) == abs(folds)
    assert len(arc.jumps) <= math.ceil(math.pi / phi)
    direction = start + turn - folds * phi
    folded = phi - direction if folds % 2 else direction
    assert polar(arc.x[-1, 3:]) == pytest.approx(folded, abs=1e-8)
    m, before, after = np.array(masses), np.array(v), arc.x[-1, 3:]
    assert m @ after == pytest.approx(m @ before, abs=1e-12)
    assert m @ after**2 == pytest.approx(m @ before**2, rel=1e-12)


def test_cradle_of_balls_that_touch():
    arc = simulate((0, 1, 1), (1, 0, 0), 3.0)
    assert [jump.transition for jump in arc.jumps] == ["left", "right"]
    np.testing.assert_allclose(arc.x[-1], [1, 1, 3, 0, 0, 1], atol=1e-12)
    assert arc.status.ok


@pytest.mark.parametrize(
    ("masses", "e", "ok"),
    [((1, 1, 1), 1.0, True), ((1, 2, 1), 1.0, False), ((1, 1, 1), 0.9, False)],
)
def test_collision_of_all_three(masses, e, ok):
    """The order does not matter if ``pi / phi`` is an integer and the collisions are elastic."""
    arc = simulate((-1, 0, 1.0), (1, 0.0, -1.0), 3.0, masses, e)
    assert arc.status.ok == ok
    if ok:
        np.testing.assert_allclose(arc.x[-1, 3:], [-1, 0, 1], atol=1e-12)
    else:
        assert arc.status.code == hybrid.StatusCode.AMBIGUOUS_ORDER


@pytest.mark.parametrize(("e", "collapses"), [(0.075, False), (0.07, True)])
def test_inelastic_collapse(e, collapses):
    """Below ``e = 7 - 4 sqrt(3) = 0.0718`` equal balls collide infinitely often and end at one speed."""
    arc = simulate((0, 1, 2), (1, 0, 0), 100.0, e=e)
    v = arc.x[-1, 3:]
    assert v.sum() == pytest.approx(1.0, abs=1e-12)
    if collapses:
        np.testing.assert_allclose(v, 1 / 3, atol=1e-9)
        assert len(arc.jumps) > 20
    else:
        exact, velocities = exact_collisions((0, 1, 2), (1, 0, 0), (1, 1, 1), Fraction(e))
        assert len(arc.jumps) == len(exact)
        np.testing.assert_allclose(v, velocities, atol=1e-10)
