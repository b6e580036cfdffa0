"""States and parameters with labels: read by name, in any order, with names as Python reads them."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import hybrid
import lyapunov
import models
from hybrid import ArgumentError, HybridSystem, Mode, ModelError, simulate

OSCILLATOR = models.impact_oscillator()
LABELLED = {
    "dict": {"v": 0.5, "x": 0.25},
    "Series": pd.Series({"v": 0.5, "x": 0.25}),
    "DataArray": xr.DataArray([0.5, 0.25], dims="state", coords={"state": ["v", "x"]}),
    "Dataset": xr.Dataset({"v": 0.5, "x": 0.25}),
}
UNLABELLED = [pd.Series([0.25, 0.5]), xr.DataArray([0.25, 0.5], dims="i")]


def ends(x0):
    """What each call makes of a start."""
    yield simulate(OSCILLATOR, x0, (0.0, 3.0)).x[-1]
    yield hybrid.stroboscopic_section(OSCILLATOR, x0, periods=1).x[-1]
    yield hybrid.poincare_section(
        OSCILLATOR, x0, hybrid.Guard(lambda t, x, p: x.x, direction=-1), points=1
    ).x[-1]
    yield hybrid.periodic_orbit(OSCILLATOR, x0).x0
    yield lyapunov.lyapunov_spectrum(OSCILLATOR, x0, intervals=1, transient=0).x
    yield lyapunov.chart(OSCILLATOR, {"c": [0.1]}, x0, intervals=1, transient=0, executor=1).x_end.values[0]


@pytest.mark.parametrize("x0", [*LABELLED.values(), *UNLABELLED], ids=[*LABELLED, "plain Series", "no names"])
def test_a_start_is_read_by_its_labels(x0):
    for found, wanted in zip(ends(x0), ends((0.25, 0.5)), strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_many_starts_are_read_by_their_labels():
    wanted = hybrid.simulate_many(OSCILLATOR, [(0.25, 0.5), (0.1, 0.0)], (0.0, 3.0))
    frame = pd.DataFrame({"v": [0.5, 0.0], "x": [0.25, 0.1]})
    for starts in (frame, wanted.x0, wanted.x0[:, ::-1], wanted.x0.T):
        found = hybrid.simulate_many(OSCILLATOR, starts, (0.0, 3.0))
        np.testing.assert_array_equal(found.x_end, wanted.x_end)


@pytest.mark.parametrize(
    ("x0", "text"),
    [
        (pd.Series({"v": 0.5}), "x0 lacks x. The state is x, v"),
        (pd.Series({"v": 0.5, "y": 1.0}), "State component 'y' does not exist. State components: x, v"),
        (pd.Series([1.0, 2.0], index=["x", "x"]), "x0: 'x' is given twice"),
        (pd.Series([1.0, 2.0], index=[1, 0]), r"x0 has the labels \[1, 0\], which are not names"),
        (xr.DataArray([1.0], dims="s", coords={"s": ["x"]}), "x0 lacks v"),
    ],
)
def test_labels_that_do_not_fit_are_refused(x0, text):
    calls = (
        lambda: simulate(OSCILLATOR, x0, (0.0, 1.0)),
        lambda: hybrid.simulate_many(OSCILLATOR, x0, (0.0, 1.0)),
        lambda: hybrid.periodic_orbit(OSCILLATOR, x0),
        lambda: lyapunov.chart(OSCILLATOR, {"c": [0.1]}, x0),
    )
    for call in calls:
        with pytest.raises(ArgumentError, match=text):
            call()


def test_names_are_those_that_python_reads():
    """Python reads the micro sign in source text as the Greek letter."""
    micro, mu = "\u00b5", "\u03bc"
    system = HybridSystem(
        state=("q",), parameters={micro: 2.0}, units={micro: "1/s"}, modes=[Mode("m", lambda t, x, p: (p.µ,))]
    )
    assert dict(system.parameters) == {mu: 2.0}
    for name in (micro, mu):
        assert simulate(system, (0.0,), (0.0, 1.0), parameters={name: 3.0}).x[-1, 0] == pytest.approx(3.0)
        chart = lyapunov.chart(system, {name: [1.0, 4.0]}, (0.0,), intervals=1, transient=0, interval=1.0)
        assert chart.x_end.values[:, 0] == pytest.approx([1.0, 4.0])
    with pytest.raises(ArgumentError, match="'μ' is given twice"):
        simulate(system, (0.0,), (0.0, 1.0), parameters={micro: 3.0, mu: 4.0})
    state = HybridSystem(state=(micro,), modes=[Mode("m", lambda t, x, p: (-x.µ,))])
    arc = simulate(state, {micro: 1.0}, (0.0, 1.0))
    np.testing.assert_array_equal(arc[micro], arc[mu])


def test_a_name_means_one_thing():
    with pytest.raises(ModelError, match="'q' is the name of a state and of a parameter"):
        HybridSystem(state=("q",), parameters={"q": 1.0}, modes=[Mode("m", lambda t, x, p: (x.q,))])


@pytest.mark.parametrize(
    ("field", "text"),
    [
        (lambda t, x, p: (p["k"],), r"p\['k'\] is written p.k"),
        (lambda t, x, p: (x["q"],), r"x\['q'\] is written x.q"),
        (lambda t, x, p: (p["kk"],), "Parameter 'kk' does not exist. Parameters: k. Did you mean 'k'"),
    ],
)
def test_a_name_in_brackets_is_answered_with_the_attribute(field, text):
    with pytest.raises(ModelError, match=text):
        HybridSystem(state=("q",), parameters={"k": 1.0}, modes=[Mode("m", field)])
