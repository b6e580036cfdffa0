"""Fractional powers of one guard, such as a Hertz contact, on a clock of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.propagators.equations import Boundary, Equations, in_terms_of_root
from hybrid.compiler.propagators.writing import CLOCK, Body, harmonics_of, names_of_state, power_of, seeds_of
from hybrid.compiler.statements.code import get
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.roots import ROOT, in_roots, is_crossed, on_clock, slope_along
from hybrid.compiler.taylor.series import NoSeries
from hybrid.expression.derivatives import derivative, directional, divergence
from hybrid.expression.graph import all_replaced, replaced
from hybrid.expression.nodes import Expression
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import DESINGULARISED


def desingularised(mode: Equations) -> Propagator | str:
    """Series on the clock ``dt = w**(q-1) ds``, where ``w`` is the root of the guard of the order ``q``."""
    if not mode.bases:
        return "it has no fractional power of a guard"
    if len(mode.bases) > 1:
        return "it has fractional powers of more than one guard"
    [(z, order)] = mode.bases.items()
    if order > 2 and not is_crossed(mode.field, z, order, mode.symbols):
        # On the clock the root would fall exponentially, and never reach zero.
        raise NoSeries("it has fractional powers of a guard whose rate may vanish with the guard")
    written = write_desingularised(mode.field, mode.boundaries, mode.guards, z, order, mode.symbols)
    powers, clock = ("half-integer powers", "w") if order == 2 else ("fractional powers", f"w^{order - 1}")
    reason = f"{powers} of a guard, on the clock dt = {clock} ds"
    return Propagator(DESINGULARISED, 0, reason, written, tuple(mode.held), root=order)


def write_desingularised(
    field: Sequence[Expression],
    boundaries: Sequence[Boundary],
    guards: Sequence[Expression],
    z: Expression,
    order: int,
    symbols: Symbols,
    body_of: Callable[..., Body] = Body,
) -> Series:
    """Series on the clock ``dt = w**(q-1) ds``, ``z = w**q``, where powers of ``z`` are powers of ``w``.

    All fields are multiplied by ``w**(q-1)``, and ``dw/ds = (dz/dt)/q``. The slope of a power of ``z`` is no
    worse than ``w**(1-q)``, so tangent vectors are smooth too, where that slope is infinite in time.

    A guard is a small difference of states, and its rounding is felt: by the energy, and a thousandfold by
    the tangent vectors. The root has none of that. So a step goes on with the root that the last one ended
    with, ``z`` is its square, and only a root that has drifted from the states is taken from them again.
    """
    harmonics = harmonics_of(field, symbols)
    field = all_replaced(field, harmonics)
    # The time since the start is advanced too, in the column after the states.
    body = body_of(
        symbols, guards, [ROOT, *harmonics.values()], lambda prefix: get(f"{prefix}y{len(symbols.x)}")
    )
    clock, (root, *driven) = body.column(CLOCK), body.rows.values()
    seeds = seeds_of(symbols)
    slope = replaced(slope_along(field, z, symbols), harmonics)
    # Where z vanishes, its root crosses zero with a nonzero slope.
    roots = in_terms_of_root(boundaries, z, ROOT, symbols)
    crossing = [roots.get(place, in_roots(guard, z, order)) for place, guard in enumerate(guards)]
    columns, starts = names_of_state(symbols)
    body.start_root(get("root"), z, order, min(roots), goes_on=True)
    # A guard that moves with the forcing has the harmonics in its powers in the field, too.
    z = replaced(z, harmonics)
    body.at_start[z] = power_of(get("root"), order)
    rates = [on_clock(rate, z, order) for rate in field]
    tangents = [on_clock(along, z, order) for along in directional(field, seeds)]
    trace = on_clock(divergence(field, symbols.variables), z, order)
    pace = ROOT ** (order - 1)
    turning = [pace * replaced(derivative(function, symbols.t), harmonics) for function in harmonics]
    begun = [get(f"start{i}") for i in range(len(harmonics))]
    body.preamble += assignments(begun, list(harmonics))
    return body.assemble(
        [*symbols.x, None, ROOT, *harmonics.values()],
        [*columns, clock, root, *driven],
        [*starts, 0.0, get("root"), *begun],
        [*rates, pace, in_roots(slope / order, z, order), *turning],
        crossing,
        trace,
        tangents,
        seeds,
    )
