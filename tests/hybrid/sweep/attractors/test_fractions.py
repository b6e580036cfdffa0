"""Shares of starts against lengths of intervals, and attractors followed through folds."""

import re
import signal

import numpy as np
import pytest

import hybrid
from hybrid.compiler.interrupts import CtrlC
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


class Pressed:
    """Ctrl-C, pressed when the calls have asked for it a number of times."""

    def __init__(self, monkeypatch, question):
        self.asked, answer = 0, CtrlC.is_set

        def is_set(stop):
            self.asked += 1
            if self.asked == question:
                signal.raise_signal(signal.SIGINT)
            return answer(stop)

        monkeypatch.setattr(CtrlC, "is_set", is_set)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
def test_shares_after_ctrl_c_are_those_of_the_starts_that_were_decided(
    monkeypatch, python_hears_interrupts, share
):
    def found():
        return hybrid.basin_fractions(double_well(), {"x": (-1.0, 3.0)}, starts=3000)

    whole = Pressed(monkeypatch, question=0)
    found()
    monkeypatch.undo()
    Pressed(monkeypatch, question=1 + int(share * whole.asked))
    part = found()
    monkeypatch.undo()
    assert part.attrs["status"] == "INTERRUPTED"
    decided = int(re.search(r"first (\d+) of 3000 random starts", part.attrs["message"])[1])
    assert 0 <= decided < 3000
    assert (decided == 0) == bool(np.isnan(part.fraction).all())
    if decided:
        assert float(part.fraction.sum()) == pytest.approx(1.0)
        assert float(part.fraction.sel(label=0)) == 0.0
        assert abs(float(part.fraction.sel(label=1)) - 0.25) < 5 * np.sqrt(0.25 * 0.75 / decided)


def test_shares_of_a_grid_after_ctrl_c_are_those_of_its_complete_lines(monkeypatch, python_hears_interrupts):
    def found():
        return hybrid.basins(double_well(), {"x": np.linspace(-1.0, 3.0, 400)}, executor=1)

    whole = Pressed(monkeypatch, question=0)
    found()
    monkeypatch.undo()
    Pressed(monkeypatch, question=int(0.7 * whole.asked))
    part = found()
    monkeypatch.undo()
    complete = part.status != hybrid.StatusCode.NOT_RUN
    assert part.attrs["status"] == "INTERRUPTED"
    for label in part.attractor.values:
        there = (part.label == label).sum() / max(1, complete.sum())
        assert float(part.fraction.sel(attractor=label)) == pytest.approx(float(there))
