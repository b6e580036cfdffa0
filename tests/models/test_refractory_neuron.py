"""The neuron compared with the closed form of its rate."""

import numpy as np
import pytest

import hybrid
from hybrid.testing import Case, check_laws
from models import refractory_neuron

P = refractory_neuron().parameters


def interval(p):
    drive = p["u_rest"] + p["R"] * p["I"]
    return p["t_ref"] + p["tau"] * np.log((drive - p["u_r"]) / (drive - p["theta"]))


@pytest.mark.parametrize("given", [{}, {"I": 1.6}, {"I": 10.0}, {"t_ref": 0.5}, {"u_r": -70.0}])
def test_the_rate(given):
    p = {**P, **given}
    arc = hybrid.simulate(refractory_neuron(), {"u": p["u_r"]}, (0.0, 500.0), parameters=given)
    spikes = np.array([jump.t for jump in arc.jumps["spike"]])
    exact = interval(p) - p["t_ref"] + interval(p) * np.arange(len(spikes))
    np.testing.assert_allclose(spikes, exact, rtol=1e-12)
    assert arc["n"][-1] == len(spikes) == 1 + np.floor((500.0 - exact[0]) / interval(p))


def test_the_dwell_time_is_exact():
    arc = hybrid.simulate(refractory_neuron(), {"u": -65.0}, (0.0, 200.0))
    spikes, ends = arc.jumps["spike"], arc.jumps["recover"]
    for spike, end in zip(spikes, ends, strict=False):
        assert end.t - spike.t == pytest.approx(4.0, abs=1e-13)


def test_below_the_rheobase_there_are_no_spikes():
    rheobase = (P["theta"] - P["u_rest"]) / P["R"]
    arc = hybrid.simulate(refractory_neuron(), {"u": -65.0}, (0.0, 1e3), parameters={"I": 0.999 * rheobase})
    assert len(arc.jumps) == 0


def test_the_refractory_time_bounds_the_rate():
    arc = hybrid.simulate(refractory_neuron(), {"u": -65.0}, (0.0, 400.0), parameters={"I": 1e5})
    assert 99 <= arc["n"][-1] <= 400.0 / P["t_ref"] + 1


def test_laws():
    system = refractory_neuron()
    check_laws(Case(system, system.parameters, "integrate", (-65.0, 0.0), 0.0, 60.0))
