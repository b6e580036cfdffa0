"""Shares of starts against lengths of intervals, and attractors followed through folds."""

import numpy as np
import pytest

import hybrid
from tests.hybrid.sweep.attractors.test_attractors import double_well

FOLD = 2 / (3 * np.sqrt(3))


def test_shares_of_two_equilibria():
    found = hybrid.basin_fractions(double_well(), {"x": (-1.0, 3.0)}, starts=400)
    shares, errors = found.fraction, found.standard_error
    assert float(shares.sum()) == pytest.approx(1.0)
    for label, exact in ((1, 0.25), (2, 0.75)):
        assert abs(float(shares.sel(label=label)) - exact) < 4 * float(errors.sel(label=label))
    assert float(errors.sel(label=1)) == pytest.approx(np.sqrt(0.25 * 0.75 / 400), rel=0.1)
    assert found.kind.values.tolist() == ["", "", "equilibrium", "equilibrium"]


def test_attractors_appear_and_die_at_folds():
    """The lower equilibrium lives below the one fold, the upper one above the other fold."""
    values = np.linspace(-0.6, 0.6, 13)
    found = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, along={"h": values}, starts=60)
    assert found.fraction.dims == ("h", "label")
    assert found.label.values.tolist() == [-1, 0, 1, 2]
    assert float(found["first"].sel(label=1)) == values[0]
    assert float(found["last"].sel(label=1)) == values[values < FOLD].max()
    assert float(found["first"].sel(label=2)) == values[values > -FOLD].min()
    assert float(found["last"].sel(label=2)) == values[-1]
    np.testing.assert_allclose(found.fraction.sum("label"), 1.0)
    assert (np.diff(found.fraction.sel(label=1)) <= 0).all()


def test_a_store_of_the_values(tmp_path):
    given = {"along": {"h": [0.0, 0.5]}, "starts": 20, "store": tmp_path / "shares.zarr"}
    first = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, **given)
    again = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, **given)
    np.testing.assert_array_equal(first.fraction, again.fraction)


@pytest.mark.parametrize(
    ("along", "text"),
    [
        ({"nope": [1.0]}, "along: Parameter 'nope' does not exist"),
        ({}, "along must be None, or map one parameter"),
        ({"h": [np.nan]}, r"along\['h'\] must be finite values"),
    ],
)
def test_what_is_no_parameter_is_told(along, text):
    with pytest.raises(hybrid.ArgumentError, match=text):
        hybrid.basin_fractions(double_well(), {"x": (-1.0, 1.0)}, along=along)
    with pytest.raises(hybrid.ArgumentError, match="'h' is given twice"):
        hybrid.basin_fractions(double_well(), {"x": 0.0}, along={"h": [0.0]}, parameters={"h": 0.1})
