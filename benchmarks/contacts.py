"""Contacts from gaps and masses: error against time beside Moreau's time stepping, and what they cost.

    python -m benchmarks.contacts

A tilted beam falls onto its two feet, with restitution: the bounces of one foot are over in the air of the
other, and both are over at 0.9393. The scheme of Moreau and Jean, compiled by Numba, steps over the impacts;
its difference from the run by events is that of the state at 0.9, before both are over. The run by events is
checked against SciPy's by hand in the tests. Then the bounces of a ball, whose floor is a gap or a guard, and
the first run of a machine of six coupled coordinates that holds two contacts: its modes are derived and
compiled in it.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from benchmarks.common import heading, least_in_turns, least_time, table
from hybrid import Contact, Guard, HybridSystem, Mode, Reset, Transition, mechanics, simulate

B, J, E, G = 1.0, 0.9, 0.3, 9.81
START, END = (1.0, 0.3, 0.0, 0.0), 0.9
STEPS = 1e-2, 1e-3, 1e-4, 1e-5, 1e-6
REPEATS = 20


def beam() -> HybridSystem:
    """A beam on two feet."""
    return mechanics(
        coordinates=("y", "phi"),
        velocities=("v", "w"),
        mass=lambda t, x, p: (1.0, J),
        forces=lambda t, x, p: (-G, 0.0),
        contacts=[
            Contact(name, gap=lambda t, x, p, s=s: x.y + s * B * x.phi, restitution=E)
            for name, s in (("left", -1.0), ("right", 1.0))
        ],
    )


@njit
def moreau(start, end, h):
    """The state at the end by Moreau's scheme with steps ``h``; Newton's law for the closed gaps."""
    y, phi, v, w = start
    count = round(end / h)
    same, other = 1.0 + B * B / J, 1.0 - B * B / J
    for _ in range(count):
        # The gaps in the middle of the step tell which are closed.
        left, right = y + 0.5 * h * v - B * (phi + 0.5 * h * w), y + 0.5 * h * v + B * (phi + 0.5 * h * w)
        before = v - B * w, v + B * w
        v -= G * h
        rates = v - B * w + E * before[0], v + B * w + E * before[1]
        first, second = 0.0, 0.0
        if left <= 0.0 and right <= 0.0:
            determinant = same * same - other * other
            first = (-rates[0] * same + rates[1] * other) / determinant
            second = (-rates[1] * same + rates[0] * other) / determinant
            if first < 0.0 or second < 0.0:
                alone = max(-rates[0] / same, 0.0), max(-rates[1] / same, 0.0)
                first, second = (alone[0], 0.0) if second < 0.0 else (0.0, alone[1])
        elif left <= 0.0:
            first = max(-rates[0] / same, 0.0)
        elif right <= 0.0:
            second = max(-rates[1] / same, 0.0)
        v, w = v + first + second, w + B / J * (second - first)
        y, phi = y + h * v, phi + h * w
    return y, phi, v, w


def by_hand() -> HybridSystem:
    """A ball whose floor is a guard and a reset."""
    return HybridSystem(
        state=("y", "v"),
        parameters={"e": 0.5},
        modes=[Mode("free", lambda t, x, p: (x.v, -G)), Mode("floor", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "free",
                "free",
                Guard(lambda t, x, p: x.y, -1),
                Reset(lambda t, x, p: {"v": -p.e * x.v}),
                accumulates_to="floor",
            )
        ],
    )


def from_gap() -> HybridSystem:
    """The same ball from its gap."""
    return mechanics(
        coordinates=("y",),
        velocities=("v",),
        parameters={"e": 0.5},
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-G,),
        contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution="e")],
    )


def machine(inertia: float) -> HybridSystem:
    """Six coordinates, each coupled to each by its mass, and two curved contacts."""
    count, coupling, gravity = 6, 0.15, 9.81

    def mass(t: Any, x: Any, p: Any) -> Any:
        return [
            [2.0 + i * inertia if i == j else coupling * np.cos(x[i] - x[j]) for j in range(count)]
            for i in range(count)
        ]

    def forces(t: Any, x: Any, p: Any) -> Any:
        q, u = x[:count], x[count:]
        found = []
        for i in range(count):
            turning = [np.sin(q[i] - q[j]) * u[j] ** 2 for j in range(count) if j != i]
            found.append(-q[i] - 0.1 * u[i] - coupling * sum(turning) - (gravity if i in (0, 3) else 0.0))
        return found

    return mechanics(
        coordinates=tuple(f"q{i}" for i in range(count)),
        velocities=tuple(f"u{i}" for i in range(count)),
        mass=mass,
        forces=forces,
        contacts=[
            Contact("a", gap=lambda t, x, p: x.q0 + 0.1 * np.sin(x.q1), restitution=0.3),
            Contact("b", gap=lambda t, x, p: x.q3 + 0.05 * x.q4**2, restitution=0.3),
        ],
    )


def first_run() -> list[str]:
    """Seconds of the processor for a first run of a machine, and for the same run again."""
    # No run before has compiled a machine of this inertia.
    system = machine(0.3 + time.time() % 1e-3)
    start = np.zeros(12)
    start[:5] = -0.1 * np.sin(0.3), 0.3, 0.0, -0.05 * 0.2**2, 0.2
    begin = time.process_time()
    simulate(system, start, (0.0, 5.0))
    first = time.process_time() - begin
    again = least_time(lambda: simulate(system, start, (0.0, 5.0)), REPEATS)
    return [f"{first:.2g}", f"{again:.2g}"]


def main() -> None:
    """Print the tables."""
    system = beam()
    arc = simulate(system, START, (0.0, END))
    heading("A beam on two feet until t = 0.9: error of the state against time")
    rows = [["events", "", "", f"{least_time(lambda: simulate(system, START, (0.0, END)), REPEATS):.2g}"]]
    for h in STEPS:
        error = np.abs(np.array(moreau(START, END, h)) - arc.x[-1]).max()
        rows.append(
            ["Moreau", f"{h:g}", f"{error:.1e}", f"{least_time(lambda h=h: moreau(START, END, h)):.2g}"]
        )
    table(["method", "step", "difference", "seconds"], rows)
    heading("Bounces of a ball: from its gap, and by hand")
    rows = []
    for restitution, end in ((0.985, 100.0), (0.9999, 40.0), (0.9995, 400.0)):
        options: dict[str, Any] = {"mode": "free", "parameters": {"e": restitution}}
        runs = [
            partial(simulate, each, (1.0, 0.0), (0.0, end), **options) for each in (from_gap(), by_hand())
        ]
        jumps = len(runs[0]().jumps)
        made, hand = least_in_turns(runs, REPEATS)
        rows.append([f"{restitution}", f"{jumps}", f"{made:.2g}", f"{hand:.2g}", f"{made / hand:.2f}"])
    table(["restitution", "jumps", "from its gap, s", "by hand, s", "ratio"], rows)
    heading("Six coordinates with two contacts that are held until t = 5")
    table(["first run, s", "again, s"], [first_run()])


if __name__ == "__main__":
    main()
