"""Charts and sweeps of systems that get their modes when a run needs them."""

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid.simulation.identity import facts_of
from hybrid.transform import splitter

STEPS = (-0.6, 0.0, 0.6)
START = (0.05, 0.0)
SHORT = {"intervals": 20, "transient": 5, "solver": hybrid.DOP853(rtol=1e-7, atol=1e-9)}


@pytest.fixture(autouse=True)
def _few_modes_at_first(monkeypatch):
    monkeypatch.setattr(splitter, "MOST_WHOLE", 2)


def staircase():
    """A spring whose force jumps at three places; a weak drive passes few of them."""

    def field(t, x, p):
        force = sum(0.1 * np.sign(x.q - step) for step in STEPS)
        return x.v, -x.q - 0.3 * x.v - force + p.A * np.cos(t)

    modes = [hybrid.Mode("on", field)]
    system = hybrid.HybridSystem(state=("q", "v"), parameters={"A": 0.1}, modes=modes, period=2 * np.pi)
    split = hybrid.split(system)
    assert split.growth is not None
    return split


@pytest.mark.parametrize("options", [{}, {"continue_from": "A", "at": hybrid.Guard(lambda t, x, p: x.v)}])
def test_rows_make_the_modes_that_they_need(options):
    over = {"A": [0.1, 1.0, 1.5]}
    system = staircase()
    chart = lyapunov.chart(system, over, START, section=2, executor=2, **options, **SHORT)
    assert not chart.status.any()
    assert np.isfinite(chart.section).all()
    if not options:
        for A in over["A"]:
            row = lyapunov.lyapunov_spectrum(system, START, parameters={"A": A}, **SHORT)
            np.testing.assert_allclose(chart.x_end.sel(A=A), row.x, atol=1e-9)


def test_the_modes_made_so_far_are_no_other_model():
    system = staircase()

    def task(p):
        return {"q": hybrid.simulate(system, START, (0.0, 20.0), parameters=p).x[-1, 0]}

    before = facts_of(task)
    swept = hybrid.sweep(task, {"A": np.linspace(0.1, 2.0, 12)}, executor=2)
    assert facts_of(task) == before
    assert not swept.status.any()
    np.testing.assert_array_equal(swept.q, [task({"A": A})["q"] for A in swept.A.values])
