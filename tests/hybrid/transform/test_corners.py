"""Orbits that slide to an intersection of two surfaces, or along it: which way they go on."""

from itertools import product

import numpy as np
import pytest

from hybrid import StatusCode, from_equations, simulate
from hybrid.transform.corners import are_apart, arrivals, attraction, exits, may_slide, slides, speeds
from tests.hybrid.transform.test_cells import numbers, pieces_of

QUADRANTS = [(-1, -1), (-1, 1), (1, -1), (1, 1)]


def plane(rates, slopes=None):
    """A field with one velocity in each quadrant of the plane; it changes linearly with the third state."""
    slopes = np.zeros((4, 2)) if slopes is None else slopes

    def field(t, x, p):
        def of(quadrant, i):
            return rates[quadrant][i] + slopes[quadrant][i] * x.z

        def at(i):
            below, above = (np.where(x.y > 0, of(k + 1, i), of(k, i)) for k in (0, 2))
            return np.where(x.x > 0, above, below)

        return at(0), at(1), 1.0

    return from_equations(field, state=("x", "y", "z"))


def test_ways_to_go_on_are_listed_in_order():
    """Sliding along all surfaces first; the side that the orbit comes from is not among them."""
    assert arrivals([4], 7, -1) == [
        *({4: 0, 7: 0}, {4: 0, 7: 1}),
        *({4: 1, 7: 0}, {4: 1, 7: 1}, {4: -1, 7: 0}, {4: -1, 7: 1}),
    ]
    assert arrivals([4], 7, 1)[1] == {4: 0, 7: -1}
    ways = exits([4, 7], 4, -1)
    assert ways[0] == {7: 0, 4: -1}
    every = [dict(zip((4, 7), sides, strict=True)) for sides in product((0, 1, -1), repeat=2)]
    assert {tuple(sorted(way.items())) for way in ways} == {
        tuple(sorted(way.items())) for way in every if any(way.values())
    }
    assert len(ways) == 8
    assert exits([3], 3, 1) == [{3: 1}, {3: -1}]


def visited(arc):
    """The modes of an arc, in order."""
    targets = {each.name: each.target for each in arc.system.transitions}
    return [str(arc.mode[0]), *(targets[str(name)] for name in arc.jumps.transition)]


class TestArrival:
    """An orbit that slides along one surface reaches another one."""

    def test_leaves_the_surface_along_which_it_slid(self):
        """Both fields beyond push to x < 0, so that there is no sliding beyond ``y = 0`` to go by."""
        system = plane([(0.63, 1.06), (-1.26, -1.41), (-0.41, -0.26), (-2.81, -3.06)])
        arc = simulate(system, (0.0, -0.1, 0.0), (0.0, 2.0))
        assert arc.status.ok
        assert visited(arc) == ["x=0, y<0", "x<0, y=0"]
        share = 0.63 / (0.63 + 0.41)
        assert arc.jumps.t == pytest.approx([0.1 / (1.06 - share * (1.06 + 0.26))])

    def test_goes_back_to_the_other_surface(self):
        """The run went round in a circle from one surface to the next at one instant."""
        system = plane([(-0.096, 0.51), (2.02, -1.816), (-2.197, 1.927), (-1.255, 1.136)])
        arc = simulate(system, (-0.1, 0.0, 0.0), (0.0, 2.0))
        assert arc.status.ok
        assert visited(arc) == ["x<0, y=0", "x=0, y>0"]

    def test_slow_departure(self):
        """The state is projected onto the surface that it leaves: by rounding it had slid below it."""
        system = plane([(0.68, 2.23), (1.37, -0.79), (-1.0, 2.38), (-0.62, 0.49)], [(0.0, -1e-4)] * 4)
        for start in np.linspace(-0.3, -0.2, 11):
            arc = simulate(system, (start, 3e-17, 0.0), (0.0, 1.0), mode="x<0, y=0")
            assert arc.status.ok
            assert visited(arc) == ["x<0, y=0", "x=0, y>0"]

    def test_crosses_both(self):
        """From the line ``x = 0`` into a quadrant from which nothing leads back."""
        system = plane([(1.0, 1.0), (1.0, 1.0), (-1.0, 1.0), (2.0, 1.0)])
        arc = simulate(system, (0.0, -1.0, 0.0), (0.0, 2.0))
        assert arc.status.ok
        assert visited(arc) == ["x=0, y<0", "x>0, y>0"]
        np.testing.assert_allclose(arc.x[-1], [2.0, 1.0, 2.0], atol=1e-12)

    def test_ends_where_no_future_is_the_only_one(self):
        """Beyond ``y = 0`` the line ``x = 0`` repels to both sides."""
        system = plane([(1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0), (1.0, 1.0)])
        arc = simulate(system, (0.0, -1.0, 0.0), (0.0, 2.0))
        assert arc.status.code in (StatusCode.AMBIGUOUS_ORDER, StatusCode.TERMINAL)


class TestDeparture:
    """An orbit slides along an intersection while the velocities around it change."""

    before = np.array([(-0.2664, 0.2606), (1.8644, -2.0182), (-2.1782, 1.5982), (-1.3824, 0.9880)])
    after = np.array([(-0.1801, 0.3870), (1.9440, -1.9157), (-2.1880, 1.7650), (-1.3179, 1.0631)])

    def test_the_other_solution_for_the_shares_does_not_count(self):
        """The speed of leaving ``x = 0`` vanishes for a share of ``y`` outside of its range."""
        system = plane(self.before, (self.after - self.before) / 0.2755)
        arc = simulate(system, (0.0, 0.0, 0.1), (0.0, 0.3), mode="x=0, y=0")
        assert arc.status.ok
        assert len(arc.jumps) == 0

    def test_leaves_where_a_share_reaches_its_end(self):
        """With the sign of y, the rates are ``x' = -sign(x)`` and ``y' = z - sign(y) (1 + sign(x) / 2)``."""
        rates = [(1.0, 0.5), (1.0, -0.5), (-1.0, 1.5), (-1.0, -1.5)]
        arc = simulate(plane(rates, [(0.0, 1.0)] * 4), (0.0, 0.0, 0.0), (0.0, 2.0), mode="x=0, y=0")
        assert visited(arc) == ["x=0, y=0", "x=0, y>0"]
        assert arc.jumps.t == pytest.approx([1.0])

    def test_ends_where_the_two_solutions_meet(self):
        """``x' = z - 1/2 - a b`` and ``y' = a - b`` vanish for ``a = b = sqrt(z - 1/2)`` and its opposite."""
        rates = [(-0.5 - i * j, float(i - j)) for i, j in QUADRANTS]
        arc = simulate(plane(rates, [(-1.0, 0.0)] * 4), (0.0, 0.0, -1.0), (0.0, 2.0), mode="x=0, y=0")
        assert arc.status.code == StatusCode.TERMINAL
        assert str(arc.jumps.transition[-1]) == "x=0, y=0: two-fold"
        assert arc.t[-1] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(
    ("field", "apart"),
    [
        (lambda t, x, p: (-np.sign(x.x), -np.sign(x.y)), True),
        (lambda t, x, p: (-np.sign(x.x) + x.y, -np.sign(x.y) * (2.0 + x.x)), True),
        (lambda t, x, p: (-np.sign(x.x), -np.sign(x.y) + 0.1 * np.sign(x.x)), False),
        (lambda t, x, p: (-np.sign(x.x) - 0.1 * np.sign(x.y), -np.sign(x.y)), False),
        # Beside the normal (1, 0) of one surface the other one may change the rest as it likes.
        (lambda t, x, p: (-np.sign(x.x) * np.sign(x.y), -np.sign(x.y)), False),
    ],
)
def test_surfaces_are_apart_if_neither_changes_the_speed_through_the_other(field, apart):
    pieces, _ = pieces_of(field)
    on = numbers(pieces)
    assert are_apart(pieces, dict.fromkeys(on, 0), on) == apart
    assert are_apart(pieces, dict.fromkeys(on, 0), on[:1])


def test_oblique_surfaces_are_apart_by_their_normals():
    """The step across ``x = 0`` is along ``x + y = 0``: on both sides, the speed through that is the same."""

    def field(t, x, p):
        dry, other = np.sign(x.x), np.sign(x.x + x.y)
        return -2.0 * dry, 2.0 * dry - other

    pieces, _ = pieces_of(field)
    on = list(range(len(pieces.surfaces.known)))
    assert len(on) == 2
    assert are_apart(pieces, dict.fromkeys(on, 0), on)
    tilted, _ = pieces_of(lambda t, x, p: (-2.0 * np.sign(x.x), np.sign(x.x) - np.sign(x.x + x.y)))
    assert not are_apart(tilted, dict.fromkeys(on, 0), on)


def test_conditions_for_sliding_where_jumps_add_up():
    """``x' = sign(y)/2 - 2 sign(x)`` and ``y' = 1/4 - sign(y)``; along ``y = 0`` the sign of ``y`` is 1/4."""
    pieces, _ = pieces_of(lambda t, x, p: (0.5 * np.sign(x.y) - 2.0 * np.sign(x.x), 0.25 - np.sign(x.y)))
    x, y = numbers(pieces)

    def rounded(expressions):
        return [float(each) for each in expressions]

    assert slides(pieces, {x: 2, y: -2}) == []
    assert rounded(slides(pieces, {x: 0, y: 2})) == [2.5, 1.5]
    assert rounded(slides(pieces, {x: 2, y: 0})) == [1.25, 0.75]
    both = {x: 0, y: 0}
    assert rounded(speeds(pieces, both, x)) == [2.125, -1.875]
    assert rounded(speeds(pieces, both, y)) == [1.25, -0.75]
    assert float(attraction(pieces, both)) == 8.0
    assert sorted(rounded(slides(pieces, both))) == [1.25 * 0.75, 2.125 * 1.875, 8.0]
    assert may_slide(pieces, both)
    assert may_slide(pieces, {x: 2, y: 2})


@pytest.mark.parametrize(
    ("field", "along_both"),
    [
        (lambda t, x, p: (-np.sign(x.x), -np.sign(x.y)), True),
        (lambda t, x, p: (-np.abs(x.x), -np.sign(x.y)), False),
        # Each surface attracts alone; along one of them, the speed through the other is zero on both sides.
        (lambda t, x, p: (-np.sign(x.x) - np.sign(x.y), -np.sign(x.x) - np.sign(x.y)), False),
        (lambda t, x, p: (-np.sign(x.x) - np.sign(x.y), -np.sign(x.x) - 2.0 * np.sign(x.y)), True),
    ],
)
def test_surfaces_without_a_jump_hold_no_orbit(field, along_both):
    pieces, _ = pieces_of(field)
    x, y = numbers(pieces)
    assert may_slide(pieces, {x: 0, y: 0}) == along_both


def test_a_start_off_three_surfaces_is_in_one_mode():
    """The flow along all three of them is zero up to rounding, which tells nothing of what is near."""

    def field(t, x, p):
        parts = (
            (getattr(p, f"b{i}{j}") * np.sign(x[j] - getattr(p, f"c{j}")) for j in range(3)) for i in range(3)
        )
        return [getattr(p, f"a{i}") - sum(each) for i, each in enumerate(parts)]

    names = [*(f"a{i}" for i in range(3)), *(f"c{i}" for i in range(3))]
    names += [f"b{i}{j}" for i in range(3) for j in range(3)]
    system = from_equations(field, state=3, parameters=dict.fromkeys(names, 1.0))
    rng = np.random.default_rng(0)
    for _ in range(4):
        values = dict(zip(names, rng.normal(size=len(names)), strict=True))
        values |= {f"b{i}{i}": 2.0 + abs(values[f"b{i}{i}"]) for i in range(3)}
        x0 = rng.normal(size=3)
        arc = simulate(system, x0, (0.0, 0.1), parameters=values)
        sides = ["<" if x0[i] < values[f"c{i}"] else ">" for i in range(3)]
        assert arc.mode[0] == ", ".join(f"x{i}{side}c{i}" for i, side in enumerate(sides))
