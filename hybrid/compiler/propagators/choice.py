"""The propagator of a mode: the first in the list that applies, else the steps of the solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs

from hybrid.compiler.emitted import Propagator
from hybrid.compiler.propagators.abreast import write_abreast
from hybrid.compiler.propagators.affine import affine
from hybrid.compiler.propagators.desingularised import desingularised
from hybrid.compiler.propagators.equations import Boundary, Equations, equations_of
from hybrid.compiler.propagators.polynomial import polynomial
from hybrid.compiler.propagators.rooted import rooted
from hybrid.compiler.propagators.taylor import taylor
from hybrid.compiler.taylor.series import NoSeries
from hybrid.expression.nodes import Expression
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import RUNGE_KUTTA

# Each strategy returns a propagator, or the reason why it does not apply. NoSeries means that none applies.
Strategy = Callable[[Equations], Propagator | str]
STRATEGIES: list[Strategy] = [rooted, desingularised, polynomial, affine, taylor]


def propagator(
    field: Sequence[Expression] | None, boundaries: Sequence[Boundary], symbols: Symbols
) -> Propagator:
    """The propagator of a mode from its traced field (None if it could not be traced) and its guards."""
    if field is None:
        return Propagator(RUNGE_KUTTA, 0, "its field is not traced")
    reason = ""
    try:
        mode = equations_of(field, boundaries, symbols)
        for strategy in STRATEGIES:
            found = strategy(mode)
            if isinstance(found, Propagator):
                return attrs.evolve(found, abreast=write_abreast(field, boundaries, symbols, found))
            reason = found
    except NoSeries as refusal:
        reason = str(refusal)
    except RecursionError:
        reason = "its functions are nested too deeply for a series"
    return Propagator(RUNGE_KUTTA, 0, reason)
