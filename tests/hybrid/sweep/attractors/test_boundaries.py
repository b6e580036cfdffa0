"""Entropy and dimension of basins whose boundaries are known sets."""

import numpy as np
import pytest

import models
from hybrid import ArgumentError, basin_entropy, basins, uncertainty_exponent

LEVELS = 12


def cantor(levels=LEVELS):
    """Labels of an interval by the parity of the step at which the middle thirds take a point out."""
    x, labels = (np.arange(3**levels) + 0.5) / 3**levels, np.zeros(3**levels, dtype=int)
    for level in range(levels):
        x = 3.0 * x
        middle = (x > 1.0) & (x < 2.0) & (labels == 0)
        labels[middle] = 1 + level % 2
        x = x % 1.0
    labels[labels == 0] = 1 + levels % 2
    return labels


def test_the_boundary_of_middle_thirds_is_the_cantor_set():
    """A box of length 3^-k touches the set if it begins in one of 2^k pieces, or less than 3^-k before."""
    steps = np.arange(5, 10)
    found = uncertainty_exponent(cantor(), sizes=3 ** (LEVELS - steps))
    np.testing.assert_allclose(found.shares, (2.0 ** (steps + 1) - 1) / (3.0**steps - 1), rtol=0.03)
    assert found.dimension == pytest.approx(np.log(2) / np.log(3), abs=0.003)


def test_stripes_over_a_cantor_set_have_one_more_dimension():
    lines = np.repeat(cantor(7)[:, None], 3**5, axis=1)
    found = uncertainty_exponent(lines, sizes=[9, 27, 81])
    assert found.dimension == pytest.approx(1.0 + np.log(2.0) / np.log(3.0), abs=0.02)


def test_a_map_with_four_branches_of_a_fifth():
    """Labels tell the parity of the step at which a start falls into the middle fifth."""
    levels = 8
    x = (np.arange(5**levels) + 0.5) / 5**levels
    labels = np.zeros(len(x), dtype=int)
    for level in range(levels):
        out = (np.floor(5.0 * x) == 2) & (labels == 0)
        labels[out] = 1 + level % 2
        x = 5.0 * x % 1.0
    labels[labels == 0] = 1 + levels % 2
    found = uncertainty_exponent(labels, sizes=[5**k for k in (2, 3, 4, 5)])
    assert found.dimension == pytest.approx(np.log(4.0) / np.log(5.0), abs=0.01)


def test_a_smooth_boundary_has_one_dimension_less():
    disc = 1 + (np.hypot(*np.mgrid[-1:1:1024j, -1:1:1024j]) < 0.7)
    found = uncertainty_exponent(disc)
    assert found.sizes[0] == 1
    assert (found.sizes[-1] + 1) * 16 <= 1024
    assert uncertainty_exponent(disc, sizes=[1, 2, 4, 8, 16]).dimension == pytest.approx(1.0, abs=0.02)
    halves = uncertainty_exponent(np.repeat([1, 2], 5000), sizes=[1, 2, 4, 8, 16])
    assert halves.dimension == pytest.approx(0.0, abs=0.01)


def test_entropy_of_boxes():
    """Boxes of 4 cells, a quarter with one cell of another label, have the entropy of these shares."""
    labels = np.ones((20, 20), dtype=int)
    labels[::4, ::4] = 2
    one = -(0.25 * np.log(0.25) + 0.75 * np.log(0.75))
    found = basin_entropy(labels, size=2)
    assert found.entropy == pytest.approx(one / 4)
    assert found.boundary == pytest.approx(one)
    assert not found.is_fractal
    three = 1 + np.indices((30, 30)).sum(axis=0) % 3
    assert basin_entropy(three, size=3).boundary == pytest.approx(np.log(3.0))
    assert basin_entropy(three, size=3).is_fractal
    assert np.isnan(basin_entropy(np.ones((10, 10), dtype=int)).boundary)


def test_starts_without_an_attractor_are_left_out():
    labels = np.repeat([[1, 2, 0, -1]], 4, axis=0)
    assert basin_entropy(labels, size=2).entropy == pytest.approx(np.log(2.0))
    with pytest.raises(ArgumentError, match="no box without a start"):
        basin_entropy(labels[:, 2:], size=2)


def test_a_dataset_of_basins():
    found = basins(
        models.impact_oscillator(), {"x": np.linspace(-1.0, 0.9, 12), "v": np.linspace(-1.0, 1.0, 12)}
    )
    assert basin_entropy(found, size=3).entropy == 0.0
    with pytest.raises(ArgumentError, match="a slope takes two sizes"):
        uncertainty_exponent(found)


@pytest.mark.parametrize("wrong", [np.ones((3, 3)), "labels", np.int64(1)])
def test_what_has_no_labels_is_refused(wrong):
    with pytest.raises(ArgumentError, match="found must be a dataset of basins"):
        basin_entropy(wrong)
