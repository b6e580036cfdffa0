"""The runs of the work-precision charts: four systems, their exact answers, and models for the peers."""

from __future__ import annotations

import json
from typing import Any

import attrs
import numpy as np
from scipy.linalg import expm

import models
from benchmarks.common import ROOT
from benchmarks.peers.problem import Problem
from hybrid import Answer, Guard, HybridSystem, Laws, Mode, Reset, Transition


def problems() -> dict[str, Problem]:
    """Problems by short name; the part before the first dash is the name of the chart."""
    founding = {}
    for D in ("0", "0.05"):
        facts = stored("founding_system")["transients"][D]
        system = attrs.evolve(
            models.vibroimpact(), parameters={**models.vibroimpact().parameters, "D": float(D)}
        )
        period = system.forcing_period()
        shape = {"system": system, "x0": facts["x0"], "mode": "free", "straight": always_touching(system)}
        ten, hundred = {"t_span": (0.0, 10 * period)}, {"t_span": (0.0, 100 * period)}
        title, times = f"Founding system, D = {D} m", facts["times10"]
        matrix = Answer(facts["x10"], times=times, fundamental=facts["fundamental10"])
        founding |= {
            f"founding-10-{D}": Problem(
                f"{title}, 10 periods", reference=Answer(facts["x10"], times=times), **shape, **ten
            ),
            f"founding-tangent-{D}": Problem(
                f"{title}, fundamental matrix of 10 periods", reference=matrix, tangent=True, **shape, **ten
            ),
            f"founding-100-{D}": Problem(
                f"{title}, 100 periods", reference=Answer(facts["x100"]), **shape, **hundred
            ),
        }
    # Sort the long runs to the end.
    made = dict(sorted(founding.items(), key=lambda item: item[1].t_span[1]))
    return made | {
        "impact": _impact_oscillator(),
        "buck": _buck_converter(),
        "stick_slip": _stick_slip(),
    }


def stored(name: str) -> Any:
    return json.loads((ROOT / "tests" / "reference" / f"{name}.json").read_text(encoding="utf-8"))


def always_touching(system: HybridSystem) -> HybridSystem:
    """The field of the contact everywhere; its force is zero where the bodies are apart."""
    contact = next(mode for mode in system.modes if mode.name == "contact")
    return attrs.evolve(system, modes=[contact], transitions=[], outputs={}, units={}, laws=Laws())


def _impact_oscillator() -> Problem:
    flight = stored("impact_oscillator")["long_flight"]
    return Problem(
        "Impact oscillator, 200 impacts from rest",
        models.impact_oscillator(),
        flight["x0"],
        (0.0, flight["t_end"]),
        Answer(flight["x_end"], times=flight["t"]),
    )


def _buck_converter() -> Problem:
    """Two hundred ramps along the orbit at 20 V, and a quarter ramp with the switch open."""
    facts, ramps = stored("buck_converter")[1], 200
    p = {**models.buck_converter().parameters, "E": facts["E"]}
    model = attrs.evolve(models.buck_converter(), parameters=p)
    A = np.array([[-1 / (p["R"] * p["C"]), 1 / p["C"]], [-1 / p["L"], 0.0]])
    end = expm(0.25 * p["T"] * A) @ facts["x0"]
    closings = [(k + facts["off_fraction"]) * p["T"] for k in range(ramps)]
    ends = [(k + 1) * p["T"] for k in range(ramps)]

    def ramp_ends() -> Guard:
        return Guard(lambda t, x, p: x.tau - 1, direction=+1)

    # On this orbit the switch opens only where the ramp ends.
    restart = Reset(lambda t, x, p: (x.v, x.i, 0.0))
    plain = attrs.evolve(
        model,
        transitions=[
            model.transitions[0],
            Transition("off", "off", ramp_ends(), restart, name="off again"),
            Transition("on", "off", ramp_ends(), restart, name="end of ramp"),
        ],
    )

    def switched(t, x, p):
        ramp = p.V_L + (p.V_U - p.V_L) * np.mod(t / p.T, 1.0)
        on = np.where(p.a * (x.v - p.V_ref) < ramp, p.E, 0.0)
        return (x.i - x.v / p.R) / p.C, (on - x.v) / p.L

    return Problem(
        f"Buck converter at 20 V, {ramps} ramps",
        model,
        (*facts["x0"], 0.0),
        (0.0, (ramps + 0.25) * p["T"]),
        Answer((*end, 0.25), times=sorted(closings + ends)),
        mode="off",
        peers=plain,
        straight=HybridSystem(state=("v", "i"), parameters=p, modes=[Mode("all", switched)]),
        left_out=(0.25,),
    )


def _stick_slip() -> Problem:
    """Forty slips of the limit cycle, from one stick phase to another."""
    facts, slips = stored("stick_slip"), 40
    belt, Fs = 0.2, 1.0
    released = [(Fs - 0.5) / belt + k * facts["period"] for k in range(slips)]
    caught = [t + facts["slip"] for t in released]
    t_end = caught[-1] + 3.0
    end = (facts["x_restick"] + belt * (t_end - caught[-1]), belt)
    model = models.stick_slip()

    def slip(t, x, p):
        return x.v, p.Fs / (1 + p.delta * (p.belt - x.v)) - x.x

    peers = HybridSystem(
        state=("x", "v"),
        parameters=model.parameters,
        modes=[Mode("sliding", lambda t, x, p: (p.belt, 0.0)), Mode("slip", slip)],
        transitions=[
            Transition("sliding", "slip", Guard(lambda t, x, p: x.x - p.Fs, direction=+1)),
            Transition(
                "slip",
                "sliding",
                Guard(lambda t, x, p: x.v - p.belt, direction=+1),
                Reset(lambda t, x, p: (x.x, p.belt)),
            ),
        ],
    )

    def friction(t, x, p):
        speed = x.v - p.belt
        return x.v, -p.Fs * np.sign(speed) / (1 + p.delta * np.abs(speed)) - x.x

    return Problem(
        f"Stick-slip, {slips} slips",
        model,
        (0.5, belt),
        (0.0, t_end),
        Answer(end, times=sorted(released + caught)),
        mode="sliding",
        peers=peers,
        straight=HybridSystem(state=("x", "v"), parameters=model.parameters, modes=[Mode("all", friction)]),
    )
