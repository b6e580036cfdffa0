"""Roots of guards that are smooth in time, such as the level of a tank that empties."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.propagators.equations import Boundary, Equations, in_terms_of_root
from hybrid.compiler.propagators.writing import Body, names_of_state, seeds_of
from hybrid.compiler.statements.code import get
from hybrid.compiler.taylor.coefficients import ONE_THEN_ZERO
from hybrid.compiler.taylor.roots import Root, in_roots, regular_root
from hybrid.expression.derivatives import directional, divergence
from hybrid.expression.nodes import Expression
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import ROOTED


def rooted(mode: Equations) -> Propagator | str:
    """Series in time of the state and of those roots of guards that are smooth in time."""
    roots = regular_roots(mode)
    if not roots:
        return "no root of a guard in it is smooth in time"
    written = write_rooted(mode.field, mode.boundaries, mode.guards, roots, mode.symbols)
    powers = "half-integer" if all(root.order == 2 for root in roots) else "fractional"
    reason = f"{powers} powers of a guard, whose root is smooth"
    largest = max(root.order for root in roots)
    # The roots of other guards have no series at zero: those of a tank that the first one feeds, say.
    fragile = len(roots) < len(mode.bases)
    return Propagator(ROOTED, 0, reason, written, tuple(mode.held), fragile=fragile, root=largest)


def regular_roots(mode: Equations) -> list[Root]:
    """The roots of guards that are smooth in time."""
    candidates = (
        regular_root(mode.field, z, order, place, mode.symbols)
        for place, (z, order) in enumerate(mode.bases.items())
    )
    return [root for root in candidates if root is not None]


def write_rooted(
    field: Sequence[Expression],
    boundaries: Sequence[Boundary],
    guards: Sequence[Expression],
    roots: Sequence[Root],
    symbols: Symbols,
    body_of: Callable[..., Body] = Body,
) -> Series:
    """Series in time of the states and of the roots; powers of the roots replace fractional powers."""
    body = body_of(symbols, guards, [root.symbol for root in roots], lambda _: ONE_THEN_ZERO)
    seeds = seeds_of(symbols)

    def in_all_roots(expression: Expression) -> Expression:
        for root in roots:
            expression = in_roots(expression, root.base, root.order, root.symbol)
        return expression

    signed: dict[int, Expression] = {}
    names = [get(f"root_{root.symbol.label}") for root in roots]
    for name, root in zip(names, roots, strict=True):
        places = in_terms_of_root(boundaries, root.base, root.symbol, symbols)
        body.start_root(name, root.base, root.order, min(places), goes_on=False)
        signed |= places
    crossing = [signed.get(place, in_all_roots(guard)) for place, guard in enumerate(guards)]
    columns, starts = names_of_state(symbols)
    trace = divergence(field, symbols.variables)
    return body.assemble(
        [*symbols.x, *(root.symbol for root in roots)],
        [*columns, *body.rows.values()],
        [*starts, *names],
        [*(in_all_roots(rate) for rate in field), *(in_all_roots(root.rate) for root in roots)],
        crossing,
        in_all_roots(trace),
        [in_all_roots(along) for along in directional(field, seeds)],
        seeds,
    )
