"""Values that carry units are refused wherever numbers are taken: NumPy would drop the units."""

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid import HybridSystem, Mode, Table, simulate
from hybrid.errors import ArgumentError, ModelError

pint = pytest.importorskip("pint")
xarray = pytest.importorskip("xarray")
U = pint.UnitRegistry()
SPRING = HybridSystem(
    state=("q", "v"),
    parameters={"k": 1.0},
    units={"q": "m", "v": "m/s"},
    period=1.0,
    modes=[Mode("run", lambda t, x, p: (x.v, -p.k * x.q))],
)


def many(*values):
    return np.array(values) * U.mm


CALLS = {
    "an array": lambda: simulate(SPRING, many(1000.0, 0.0), (0.0, 1.0)),
    "a tuple": lambda: simulate(SPRING, (1000.0 * U.mm, 0.0 * U.mm), (0.0, 1.0)),
    "names": lambda: simulate(SPRING, {"q": 1000.0 * U.mm, "v": 0.0}, (0.0, 1.0)),
    "a DataArray": lambda: simulate(
        SPRING,
        xarray.DataArray(many(1000.0, 0.0), coords={"state": ["q", "v"]}, dims="state"),
        (0.0, 1.0),
    ),
    "many starts": lambda: hybrid.simulate_many(SPRING, {"q": many(1.0, 2.0), "v": 0.0}, (0.0, 1.0)),
    "a parameter": lambda: simulate(SPRING, (1.0, 0.0), (0.0, 1.0), parameters={"k": 1.0 * U.Hz}),
    "a declared parameter": lambda: HybridSystem(
        state=("q",), parameters={"k": np.array(1.0) * U.s}, modes=[Mode("run", lambda t, x, p: (p.k,))]
    ),
    "a time span": lambda: simulate(SPRING, (1.0, 0.0), np.array([0.0, 1000.0]) * U.ms),
    "a pair of times": lambda: simulate(SPRING, (1.0, 0.0), (0.0 * U.ms, 1000.0 * U.ms)),
    "samples": lambda: simulate(SPRING, (1.0, 0.0), (0.0, 1.0), samples=np.array([0.0, 0.5]) * U.ms),
    "a table": lambda: Table(np.array([0.0, 1.0]) * U.s, many(0.0, 1000.0)),
    "values of a table": lambda: Table([0.0, 1.0], many(0.0, 1000.0)),
    "a place in a table": lambda: Table([0.0, 1.0], [0.0, 1.0])(np.array([0.5]) * U.s),
    "a chart": lambda: lyapunov.chart(SPRING, {"k": np.array([1.0, 2.0]) * U.Hz}, (1.0, 0.0)),
    "a sweep": lambda: hybrid.sweep(
        lambda point: {"a": 1.0}, {"k": xarray.DataArray(np.array([1.0, 2.0]) * U.Hz, dims="k")}
    ),
    "a grid of starts": lambda: hybrid.basins(SPRING, {"q": many(1.0, 2.0), "v": 0.0}),
    "times in an arc": lambda: simulate(SPRING, (1.0, 0.0), (0.0, 1.0))(np.array([0.5]) * U.s),
}


@pytest.mark.parametrize("name", CALLS)
def test_values_with_units_are_refused(name):
    with pytest.raises(ArgumentError, match=r"(?s)Quantit.*Give plain numbers in the units of the model"):
        CALLS[name]()


@pytest.mark.parametrize("times", [np.array([0.5, 1.0]) * U.s, [0.5 * U.s, 1.0 * U.s]])
def test_ticks_with_units_are_refused(times):
    with pytest.raises(ModelError, match=r"times\[0\] must be a finite number"):
        hybrid.At(times)


def test_a_unit_that_is_a_mere_attribute_is_no_harm():
    """Datasets of this library name the units of their arrays, and start runs."""
    start = xarray.DataArray([1.0, 0.0], coords={"state": ["q", "v"]}, dims="state", attrs={"units": "m"})
    assert simulate(SPRING, start, (0.0, 1.0)).x[-1, 0] == pytest.approx(np.cos(1.0))
