"""The Hopf point at which the orbits of an autonomous system have shrunk to an equilibrium."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.place import Place, place_of
from hybrid.orbits.continuation.route import Loop
from hybrid.orbits.equilibria.equations import Equations, reduced
from hybrid.orbits.equilibria.equilibrium import solved
from hybrid.orbits.equilibria.normal_forms import Hopf, critical_pair, hopf_at

# The period of the orbits and that of the equilibrium agree to this share.
SAME_PERIOD = 0.05
# The real part of the pair is zero to this share of the imaginary part, after so many steps at most.
ON_THE_AXIS, MOST_STEPS = 1e-14, 20
# A pair that moves by less than this share over the range of the parameter is that of a centre.
CENTRE = 1e-8


def hopf_end(place: Place) -> Place | None:
    """The equilibrium, as an orbit of no size, at the Hopf point near small orbits; None if there is none."""
    try:
        found = _hopf_point(place)
    except ArgumentError:
        return None
    if found is None:
        return None
    equations, u, hopf = found
    loop, period = place.orbit.loop, 2.0 * np.pi / hopf.omega
    if abs(period - loop.period) > SAME_PERIOD * period:
        return None
    times = loop.times[0] + (loop.times - loop.times[0]) * (period / loop.period)
    x = np.tile(u[: equations.n], (len(loop.x), 1))
    orbit = place.family.around(Loop(x, times, u[-1:]))
    return None if orbit is None else place_of(orbit, place.tangents, place.sizes)


def first_lyapunov(place: Place) -> float:
    """The first Lyapunov coefficient at a Hopf point."""
    equations = _equations(place, place.orbit.loop.x[0])
    u = equations.start()
    return hopf_at(equations, u, _onward(equations, u)).first


def _equations(place: Place, x: np.ndarray) -> Equations:
    family, values = place.family, place.values
    state = place.orbit.whole(0, x)
    return Equations(family.system, family.route[0].mode, family.names, state, family.vector(values))


def _onward(equations: Equations, u: np.ndarray) -> np.ndarray:
    """The direction of the branch of equilibria ``(n + 1,)``."""
    rows = reduced(equations, u).jacobian(u)
    return np.append(np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=None)[0], 1.0)


def _hopf_point(place: Place) -> tuple[Equations, np.ndarray, Hopf] | None:
    """The Hopf point near the middle of an orbit, by Newton's method in the parameter."""
    shares = np.linspace(0.0, 1.0, 9)[:-1]
    stays = np.diff(place.orbit.loop.times)
    middle = np.average([flow.at(shares).mean(axis=0) for flow in place.orbit.flows], axis=0, weights=stays)
    equations = _equations(place, middle[: place.family.n])
    before = np.inf
    for _ in range(MOST_STEPS):
        system, mode = equations.system, equations.mode
        rest = solved(Equations(system, mode, (), equations.x, equations.vector))
        if not rest.status.ok:
            return None
        u = np.append(rest.x[: equations.n], equations.vector[equations.places])
        pair = critical_pair(equations.within(u))
        if not np.isfinite(pair.imag):
            return None
        hopf = hopf_at(equations, u, _onward(equations, u))
        if abs(hopf.speed) * float(place.sizes[0]) <= CENTRE * hopf.omega:
            return None
        off = abs(pair.real) / pair.imag
        if off <= ON_THE_AXIS or off >= before:
            return equations, u, hopf
        before = off
        vector = equations.vector.copy()
        vector[equations.places] -= pair.real / hopf.speed
        equations = Equations(system, mode, equations.names, rest.x, vector)
    return None
