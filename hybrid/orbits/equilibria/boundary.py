"""Where an equilibrium reaches a guard: it goes on in another mode, or vanishes with one of another mode."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.errors import ArgumentError, ModelError
from hybrid.orbits.equilibria.equations import ON_IT, Barrier, Equations, Reduced, reduced
from hybrid.orbits.equilibria.smooth import row_lengths

# The rates of another mode are zero at a boundary if they are to this share of their terms.
ZERO = 1e-8
# Directions in which the rates of a mode do not change.
SINGULAR = 1e-10


@attrs.frozen(eq=False)
class Neighbour:
    """An equilibrium of a mode that lies on a guard.

    Attributes
    ----------
    equations
        Those of its mode.
    u, onward
        The unknowns ``(n + 1,)`` there, and their derivatives in the parameter.
    side
        On which side of the parameter it is admissible: 1 for larger values, -1 for smaller ones, 0 for
        neither.
    """

    equations: Equations
    u: np.ndarray
    onward: np.ndarray
    side: int


def neighbour_of(equations: Equations, u: np.ndarray, sizes: np.ndarray) -> Neighbour | None:
    """The equilibrium of a mode at a point where its rates are zero.

    None if it does not go on from there, as at a fold, or is excluded. The unknowns have rounding errors of
    these ``sizes``.
    """
    rows = reduced(equations, u).jacobian(u)
    if not np.isfinite(rows).all():
        return None
    # The least motion, where equilibria are not alone, as those of a mass at rest.
    scaled = rows * sizes
    scaled = scaled / row_lengths(scaled)[:, None]
    moved = np.linalg.lstsq(scaled[:, :-1], -scaled[:, -1], rcond=SINGULAR)[0]
    onward = np.append(moved, 1.0) * sizes / sizes[-1]
    if np.any(np.abs(rows @ onward) > ZERO * (np.abs(rows) @ sizes) / sizes[-1]):
        return None
    known, sides = equations.known(u), {1, -1}
    for barrier in equations.barriers:
        if barrier.excludes(known, sizes):
            return None
        if barrier.height_beside(known, sizes) == 0.0 and barrier.counts(known):
            slopes = barrier.height.jacobian(known)[0]
            speed = float(slopes @ onward)
            if abs(speed) > ON_IT * float(np.abs(slopes) @ sizes) / sizes[-1]:
                sides -= {int(np.sign(barrier.beyond * speed))}
    return Neighbour(equations, u, onward, sides.pop() if len(sides) == 1 else 0)


def neighbours(equations: Equations, u: np.ndarray, sizes: np.ndarray) -> list[Neighbour]:
    """The equilibria of other modes at a point."""
    found, vector = [], np.array([*equations.parameters(u).values()])
    for mode in equations.system.mode_names:
        if mode == equations.mode:
            continue
        try:
            other = Equations(equations.system, mode, equations.names, equations.state(u), vector)
        except (ArgumentError, ModelError):
            continue
        if _is_at_rest(reduced(other, u), u, sizes):
            neighbour = neighbour_of(other, u, sizes)
            if neighbour is not None:
                found.append(neighbour)
    return found


def _is_at_rest(part: Reduced, u: np.ndarray, sizes: np.ndarray) -> bool:
    """Whether the equations of a mode hold at a point, up to rounding."""
    rows, values = part.jacobian(u), part.residual(u)
    if not (np.isfinite(rows).all() and np.isfinite(values).all()):
        return False
    return bool(np.all(np.abs(values) <= ZERO * (np.abs(rows) @ sizes)))


def told(own: Neighbour | None, others: list[Neighbour], barrier: Barrier, name: str) -> str:
    """What happens to an equilibrium that reaches a guard, in words."""
    guard = f"the equilibrium reaches the guard of {barrier.names[0]!r}"
    if own is None or own.side == 0:
        return guard
    side = "larger" if own.side > 0 else "smaller"
    beyond = "smaller" if own.side > 0 else "larger"
    words = []
    for other in others:
        mode = f"mode {other.equations.mode!r}"
        if other.side == -own.side:
            words.append(f"persistence: it goes on in {mode} for {beyond} {name}")
        elif other.side == own.side:
            words.append(
                f"nonsmooth fold: it and one of {mode} meet and vanish, both exist for {side} {name}"
            )
    if not words:
        return f"{guard}; no other mode has an equilibrium there, it exists for {side} {name}"
    return "; ".join(words)
