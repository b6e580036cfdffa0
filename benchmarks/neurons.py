"""Random integrate-and-fire neurons: spikes compared with SciPy, and no false accumulation of jumps.

    python -m benchmarks.neurons [number of neurons of each kind]

Adaptive exponential neurons (Brette and Gerstner 2005, doi:10.1152/jn.00686.2005) and those of Izhikevich
(2003, doi:10.1109/TNN.2003.820440). Their resets leave the guard, so their jumps never accumulate, even if
the intervals of a burst are short. Times are in ms, voltages in mV.
"""

import sys
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate

END = 400.0
# Spikes are different if their times differ by more than this share of the run.
CLOSE = 1e-3
# Tolerances of the reference. A neuron whose reference changes as much at the tighter ones is chaotic: there
# is nothing to compare.
TOLERANCE, TIGHTER = 1e-10, 1e-12


@cache
def adaptive_exponential():
    """``C V' = -gL (V - EL) + gL D exp((V - VT) / D) - w + I``, ``tau w' = a (V - EL) - w``."""

    def field(t, x, p):
        leak = -p.gL * (x.V - p.EL) + p.gL * p.D * np.exp((x.V - p.VT) / p.D)
        return (leak - x.w + p.I) / p.C, (p.a * (x.V - p.EL) - x.w) / p.tau

    return HybridSystem(
        state=("V", "w"),
        parameters={
            "C": 200.0, "gL": 10.0, "EL": -70.0, "VT": -50.0, "D": 2.0, "a": 2.0, "tau": 30.0,
            "I": 500.0, "Vr": -58.0, "b": 60.0, "peak": -20.0,
        },
        modes=[Mode("rise", field)],
        transitions=[
            Transition(
                "rise", "rise", Guard(lambda t, x, p: x.V - p.peak, +1),
                Reset(lambda t, x, p: (p.Vr, x.w + p.b)), name="spike",
            )
        ],
        name="adaptive exponential",
    )  # fmt: skip


@cache
def izhikevich():
    """``v' = 0.04 v^2 + 5 v + 140 - u + I``, ``u' = a (b v - u)``."""
    return HybridSystem(
        state=("v", "u"),
        parameters={"a": 0.02, "b": 0.2, "c": -65.0, "d": 8.0, "I": 10.0, "peak": 30.0},
        modes=[
            Mode(
                "rise",
                lambda t, x, p: (0.04 * x.v**2 + 5 * x.v + 140 - x.u + p.I, p.a * (p.b * x.v - x.u)),
            )
        ],
        transitions=[
            Transition(
                "rise", "rise", Guard(lambda t, x, p: x.v - p.peak, +1),
                Reset(lambda t, x, p: (p.c, x.u + p.d)), name="spike",
            )
        ],
        name="Izhikevich",
    )  # fmt: skip


def draw(system, rng):
    """Random parameters, and a start.

    An exponential spike counts once its exponent is 15: what is left of it takes less than 1e-5 ms, too short
    a time for the steps of ``solve_ivp``.
    """
    if system is izhikevich():
        p = {
            "a": rng.uniform(0.01, 0.15), "b": rng.uniform(0.1, 0.3), "c": rng.uniform(-70.0, -40.0),
            "d": rng.uniform(0.05, 10.0), "I": rng.uniform(0.0, 40.0),
        }  # fmt: skip
        return dict(system.parameters) | p, (-65.0, -65.0 * p["b"])
    p = {
        "C": rng.uniform(50.0, 300.0), "gL": rng.uniform(2.0, 20.0), "D": rng.uniform(0.8, 5.0),
        "a": rng.uniform(-10.0, 15.0), "tau": rng.uniform(10.0, 200.0), "I": rng.uniform(100.0, 1200.0),
        "Vr": rng.uniform(-70.0, -40.0), "b": rng.uniform(0.0, 150.0),
    }  # fmt: skip
    parameters = dict(system.parameters) | p
    parameters["peak"] = min(parameters["peak"], parameters["VT"] + 15.0 * p["D"])
    return parameters, (-70.0, 0.0)


def independent_spikes(system, parameters, start, end, tolerance=TOLERANCE):
    """Times of the spikes by ``solve_ivp``, with one call per spike.

    Beyond the peak the voltage rises steadily: the exponential would overflow within a trial step.
    """
    names = type("Values", (), {})
    state, p = names(), names()
    vars_of = dict(parameters)
    for name, value in vars_of.items():
        setattr(p, name, value)
    (mode,), (spike,) = system.modes, system.transitions

    def at(x):
        for name, value in zip(system.state_names, x, strict=True):
            setattr(state, name, value)
        return state

    def rates(t, x):
        return mode.field(t, at((min(x[0], p.peak + 1.0), x[1])), p)

    def event(t, x):
        return spike.guard.function(t, at(x), p)

    event.terminal, event.direction = True, 1
    t, x, times = 0.0, np.array(start), []
    while t < end:
        run = solve_ivp(rates, (t, end), x, "DOP853", rtol=tolerance, atol=tolerance, events=event)
        if not len(run.t_events[0]):
            break
        t = float(run.t_events[0][0])
        times.append(t)
        x = np.array(spike.reset.function(t, at(run.y_events[0][0]), p), dtype=float)
    return np.array(times)


def compare(system, rng, end=END):
    """How both methods compare on a random neuron, the spikes of both, and the run's status."""
    parameters, start = draw(system, rng)
    arc = simulate(system, start, (0.0, end), mode="rise", parameters=parameters)
    wanted = independent_spikes(system, parameters, start, end)
    verdict = (
        "same" if arc.status.code == StatusCode.SUCCESS and _same(arc.jumps.t, wanted, end) else "differs"
    )
    if verdict == "differs" and arc.status.code == StatusCode.SUCCESS:
        tighter = independent_spikes(system, parameters, start, end, TIGHTER)
        if _same(arc.jumps.t, tighter, end):
            verdict, wanted = "same", tighter
        elif not _same(wanted, tighter, end):
            verdict = "chaotic"
    return verdict, len(arc.jumps), len(wanted), arc.status


def _same(found, wanted, end):
    """Whether two trains of spikes are the same."""
    common = min(len(found), len(wanted))
    close = bool(np.all(np.abs(found[:common] - wanted[:common]) < CLOSE * end))
    return close and abs(len(found) - len(wanted)) <= _at_end(wanted, end)


def _at_end(times, end):
    """1 if a spike is so near the end that the two methods may differ, else 0."""
    return int(len(times) > 0 and end - times[-1] < CLOSE)


def main(count):
    """Print the number of neurons of each kind that differ."""
    for system in (adaptive_exponential(), izhikevich()):
        rng = np.random.default_rng(0)
        results = [compare(system, rng) for _ in range(count)]
        false = sum(status.code == StatusCode.ACCUMULATION for *_, status in results)
        spikes = sum(wanted for _, _, wanted, _ in results)
        differ = [each[1:] for each in results if each[0] == "differs"]
        chaotic = sum(verdict == "chaotic" for verdict, *_ in results)
        print(
            f"{system.name}: {count} neurons, {spikes} spikes, {false} false limits, {len(differ)} differ, "
            f"{chaotic} are chaotic",
            flush=True,
        )
        for each in differ[:10]:
            print("   ", *each)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
