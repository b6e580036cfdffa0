"""Random right-hand sides: their pieces, their split, and the orbits of both."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import Mode, Taylor, from_equations, simulate
from hybrid.system.graph import HybridSystem
from hybrid.testing import fields, piecewise_affine_fields
from hybrid.transform.splitter import Splitter
from tests.reference.piecewise_affine import System, solve

TIGHT = Taylor(rtol=1e-12, atol=1e-14)
points = st.lists(st.integers(-200, 200).map(lambda i: i / 97), min_size=3, max_size=3)


def table(field):
    """The reference's table of pieces."""
    pieces = [field.piece(sides) for sides in product((-1, 1), repeat=len(field.forms))]
    shape = (2,) * len(field.forms)
    matrices, constants = (np.array(each) for each in zip(*pieces, strict=True))
    return System(
        field.normals,
        field.levels,
        matrices.reshape(*shape, *matrices.shape[1:]),
        constants.reshape(*shape, -1),
    )


class TestPieces:
    @given(piecewise_affine_fields(), points)
    def test_equal_the_field(self, field, point):
        x = np.array(point[: len(field.constant)])
        heights = field.heights(x)
        if np.abs(heights).min() < 1e-12:
            return
        matrix, constant = field.piece(tuple(np.sign(heights).astype(int)))
        rates = np.array(field(0.0, x, None), dtype=float)
        np.testing.assert_allclose(rates, matrix @ x + constant, atol=1e-13)

    @settings(max_examples=15)
    @given(piecewise_affine_fields(), st.lists(points, min_size=4, max_size=4))
    def test_split_equals_the_field(self, field, several):
        n = len(field.constant)
        splitter = Splitter(HybridSystem(state=n, modes=[Mode("plain", field)]))
        [pieces] = splitter.pieces
        for point in several:
            x = np.array(point[:n])
            if np.abs(field.heights(x)).min() < 1e-12:
                continue
            cell = splitter._cell_at(pieces, splitter._values(0.0, x, np.empty(0)))
            part = pieces.flow(dict(cell.branches))(0.0, x, ())
            np.testing.assert_allclose(
                np.array(part, dtype=float), np.array(field(0.0, x, None), float), atol=1e-12
            )


class TestRuns:
    @settings(max_examples=3)
    @given(piecewise_affine_fields(dimensions=(2, 2), switches=(1, 1)), points)
    def test_agree_with_the_reference(self, field, point):
        x0 = point[:2]
        samples = np.linspace(0.0, 2.0, 9)
        reference = solve(table(field), x0, 2.0, samples)
        if reference.status != "ended":
            return
        if np.abs(field.heights(np.array(x0))).min() < 1e-12:
            return
        arc = simulate(from_equations(field, state=2), x0, (0.0, 2.0), solver=TIGHT)
        assert arc.status.ok
        np.testing.assert_allclose([arc(t) for t in samples], reference.states, atol=1e-9)


def test_a_row_of_zeros_is_zero():
    """Factors of zero are left out: the product with what is not a number would be none."""
    assert fields._sum(np.array([0.0, 0.0]), [np.nan, 5.0]) == 0.0
    assert fields._sum(np.array([0.0, -2.0]), [np.nan, 5.0]) == -10.0
    assert fields._sum(np.array([3.0, -2.0]), [1.0, 5.0]) == -7.0
