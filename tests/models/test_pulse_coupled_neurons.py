"""The neurons compared with their map, and with the closed form of each interval."""

import numpy as np
import pytest

from hybrid import ArgumentError, simulate
from models import pulse_coupled_neurons

P = pulse_coupled_neurons().parameters


def firings(u, t_end, eps=P["eps"], a=P["S"] / P["gamma"]):
    """Times and members of all firings, each interval in closed form; those at one instant in order."""
    u, t, found = np.array(u, dtype=float), 0.0, []
    while True:
        wait = np.log((a - u.max()) / (a - 1.0)) / P["gamma"]
        t += wait
        if t > t_end:
            return found
        u = a - (a - u) * np.exp(-P["gamma"] * wait)
        u[u.argmax()] = 1.0
        fired = np.zeros(len(u), dtype=bool)
        while np.any((u >= 1.0) & ~fired):
            i = int(np.argmax((u >= 1.0) & ~fired))
            fired[i] = True
            u = np.where(fired, 0.0, u + eps)
            found.append((t, i))


def test_a_neuron_without_pulses_has_the_period_of_its_closed_form():
    arc = simulate(pulse_coupled_neurons(2), {"neuron.u": [0.0, 0.5]}, (0.0, 10.0), parameters={"eps": 0.0})
    times = [jump.t for jump in arc.jumps["neuron[0].fire"]]
    period = np.log(P["S"] / (P["S"] - P["gamma"])) / P["gamma"]
    np.testing.assert_allclose(times, period * np.arange(1, len(times) + 1), rtol=1e-12)


def test_two_neurons_obey_their_map():
    arc = simulate(pulse_coupled_neurons(2), {"neuron.u": [0.0, 0.3]}, (0.0, 8.0))
    others = [jump.x_minus[int(jump.transition == "neuron[0].fire")] for jump in arc.jumps]
    a = P["S"] / P["gamma"]
    mapped = [a - a * (a - 1.0) / (a - u - P["eps"]) for u in others[:-1]]
    assert len(others) > 20
    np.testing.assert_allclose(others[1:], mapped, rtol=1e-10)


@pytest.mark.parametrize("count", [3, 10])
def test_many_fire_as_computed_interval_by_interval(count):
    start = np.random.default_rng(count).uniform(0.05, 0.95, count)
    exact = firings(start, 12.0)
    arc = simulate(pulse_coupled_neurons(count), {"neuron.u": start}, (0.0, 12.0))
    assert len(arc.jumps) == len(exact)
    np.testing.assert_allclose(arc.jumps.t, [t for t, _ in exact], rtol=1e-10)
    for t in np.unique(np.round(arc.jumps.t, 6)):
        here = np.abs(arc.jumps.t - t) < 1e-5
        together = set(arc.jumps.transition[here])
        assert together == {f"neuron[{i}].fire" for s, i in exact if abs(s - t) < 1e-5}


def test_they_fall_into_step_and_stay():
    arc = simulate(pulse_coupled_neurons(), {"neuron.u": np.linspace(0.0, 0.9, 10)}, (0.0, 30.0))
    assert len(set(arc["neuron.u"][0])) == 10
    assert len(set(arc["neuron.u"][-1])) == 1
    last = arc.jumps.t > 25.0
    assert np.all(np.bincount(np.searchsorted(np.unique(arc.jumps.t[last]), arc.jumps.t[last])) == 10)


def test_neurons_that_are_exchanged_exchange_their_runs():
    system, start = pulse_coupled_neurons(5), np.array([0.1, 0.35, 0.5, 0.72, 0.9])
    order = np.array([3, 0, 4, 2, 1])
    one = simulate(system, {"neuron.u": start}, (0.0, 10.0), samples=[4.0, 10.0])
    other = simulate(system, {"neuron.u": start[order]}, (0.0, 10.0), samples=[4.0, 10.0])
    np.testing.assert_allclose(other["neuron.u"], one["neuron.u"][:, order], rtol=1e-10, atol=1e-12)


def test_there_are_two_or_more():
    with pytest.raises(ArgumentError, match="count must be a whole number of at least 2; got 1"):
        pulse_coupled_neurons(1)
