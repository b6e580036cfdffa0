"""Cells and the fields on surfaces between them, against NumPy."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode
from hybrid.symbolic.evaluation import scalar
from hybrid.system.derivatives import evaluate
from hybrid.transform.splitter import Splitter


def pieces_of(field, state=("x", "y"), parameters=None):
    """The pieces of one mode, with all of its surfaces found."""
    system = HybridSystem(state=state, parameters=parameters or {}, modes=[Mode("m", field)])
    [pieces] = Splitter(system).pieces
    return pieces, [choice.cell for choice in pieces.cells({})]


def value(pieces, function, x=(0.0, 0.0), parameters=()):
    return evaluate(
        pieces.variables, function, 0.0, np.array(x, dtype=float), np.array(parameters, dtype=float)
    )


def numbers(pieces):
    """Numbers of the surfaces ``x = 0`` and ``y = 0``."""
    heights = [known.height for known in pieces.surfaces.known]
    return [heights.index(symbol) for symbol in pieces.surfaces.symbols.x[:2]]


def test_a_kink_is_no_jump_and_a_jump_along_the_surface_does_not_attract():
    def field(t, x, p):
        return 1.0 - x.y, np.sign(x.x) + np.maximum(x.y, 0.0)

    pieces, cells = pieces_of(field)
    first, second = numbers(pieces)
    sides = dict(cells[0].branches)
    assert pieces.jumps(sides, first)
    assert not pieces.may_attract(sides, first)
    assert not pieces.jumps(sides, second)


def test_cells_join_across_a_surface_that_changes_nothing_there():
    """The step at ``y = 0`` is only in the half where ``x < 0``."""
    pieces, cells = pieces_of(lambda t, x, p: (1.0, np.where(x.x > 0, 5.0, np.where(x.y > 0, 1.0, -1.0))))
    fields = {cell.sides: value(pieces, pieces.flow(dict(cell.branches)))[1] for cell in cells}
    assert sorted((len(sides), field) for sides, field in fields.items()) == [(1, 5.0), (2, -1.0), (2, 1.0)]


@pytest.mark.parametrize(("last", "rate"), [("y", 0.03), ("z", 0.15)])
def test_of_three_surfaces_the_last_one_blends_the_fields_on_the_intersection_of_the_others(last, rate):
    """With shares ``a, b, c`` of the sides of ``x, y, z``, the fourth state has the rate ``a b c``.

    Heights rest where ``a = (1 + c) / 2``, ``b = 1/4`` and ``c = 1/5``. On both sides of ``y`` the rate is
    ``+-0.6 * 0.2``, on those of ``z`` it is ``1 * 0.25`` and ``0``.
    """

    def field(t, x, p):
        a, b, c = np.sign(x.x), np.sign(x.y), np.sign(x.z)
        return 0.5 * (1 + c) - a, 0.25 - b, 0.2 - c, a * b * c

    pieces, _ = pieces_of(field, state=("x", "y", "z", "w"))
    heights = [known.height for known in pieces.surfaces.known]
    number = dict(zip("xyz", map(heights.index, pieces.surfaces.symbols.x[:3]), strict=True))
    on = sorted("xyz", key=lambda name: (name == last, name))
    flow = pieces.flow({number[name]: 0 for name in on})
    assert value(pieces, flow, np.zeros(4)) == pytest.approx([0.0, 0.0, 0.0, rate], abs=1e-15)


def solutions(corners):
    """Shares ``a, b`` and the determinant of the derivatives, where both rates vanish."""
    mm, mp, pm, pp = corners
    constant, by_a, by_b, by_both = (
        (mm + mp + pm + pp) / 4,
        (pm + pp - mm - mp) / 4,
        (mp + pp - mm - pm) / 4,
        (mm + pp - mp - pm) / 4,
    )
    (p0, q0), (p1, q1), (p2, q2), (p3, q3) = constant, by_a, by_b, by_both
    found = []
    for b in np.roots([q2 * p3 - q3 * p2, q0 * p3 + q2 * p1 - q1 * p2 - q3 * p0, q0 * p1 - q1 * p0]):
        if b.imag:
            continue
        b = b.real
        a = -(p0 + p2 * b) / (p1 + p3 * b)
        found.append((a, b, (p1 + p3 * b) * (q2 + q3 * a) - (p2 + p3 * a) * (q1 + q3 * b)))
    return found


class TestIntersection:
    """Velocities in the quadrants of the plane are parameters, and so are rates of a third state."""

    NAMES = tuple(f"{name}{k}" for name in "uvw" for k in range(4))

    @pytest.fixture(scope="class")
    @classmethod
    def pieces(cls):
        def field(t, x, p):
            def of(name):
                below, above = (
                    np.where(x.y > 0, getattr(p, f"{name}{k + 1}"), getattr(p, f"{name}{k}")) for k in (0, 2)
                )
                return np.where(x.x > 0, above, below)

            return of("u"), of("v"), of("w")

        return pieces_of(field, state=("x", "y", "z"), parameters=dict.fromkeys(cls.NAMES, 1.0))[0]

    def test_shares_solve_the_bilinear_equations(self, pieces):
        """Of two solutions the one with a positive determinant counts, as is known of blended fields."""
        x, y = numbers(pieces)
        shares = pieces.shares({x: 0, y: 0})
        functions = [scalar(each) for each in (shares.of[x], shares.of[y], shares.unique)]
        rng, counted = np.random.default_rng(8), 0
        for _ in range(200):
            corners = rng.uniform(-1.0, 1.0, (4, 3))
            given = ((0.0, 0.0, 0.0), corners.T.ravel())
            known = [each for each in solutions(corners[:, :2]) if each[2] > 0]
            a, b, unique = (value(pieces, each, *given) for each in functions)
            if not known:
                assert unique is None or unique[0] < 0
                continue
            [(wanted_a, wanted_b, _)] = known
            counted += 1
            assert unique[0] > 0
            np.testing.assert_allclose([a[0], b[0]], [wanted_a, wanted_b], rtol=1e-8)
            weights = [(1 + i * a[0]) * (1 + j * b[0]) / 4 for i in (-1, 1) for j in (-1, 1)]
            rates = value(pieces, shares.flow, *given)
            size = np.abs(weights).max()
            np.testing.assert_allclose(rates, weights @ corners, atol=1e-9 * size)
            np.testing.assert_allclose(rates[:2], 0.0, atol=1e-9 * size)
        assert counted > 50

    def test_there_are_none_on_other_cells(self, pieces):
        assert pieces.shares({0: 0, 1: 1}) is None
        assert pieces.shares({0: -1, 1: 1}) is None
        additive, _ = pieces_of(lambda t, x, p: (-np.sign(x.x) + 0.3 * np.sign(x.y), -2.0 * np.sign(x.y)))
        assert additive.shares({0: 0, 1: 0}) is None
