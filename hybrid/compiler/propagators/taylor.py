"""Analytic fields: a Taylor series whose steps and order follow from the tolerances."""

from __future__ import annotations

from hybrid.compiler.emitted import Propagator
from hybrid.compiler.propagators.equations import Equations
from hybrid.compiler.propagators.writing import write_series
from hybrid.expression.graph import is_whole, nodes
from hybrid.expression.operations import Hypot
from hybrid.kernels.types.codes import TAYLOR


def taylor(mode: Equations) -> Propagator | str:
    """The series of an analytic field, of variable step."""
    if mode.bases:
        return "it has fractional powers of more than one guard"
    reason = "affine, its forcing has no short series" if mode.is_affine else "smooth, nonlinear in the state"
    written = write_series(mode.field, mode.guards, mode.symbols)
    return Propagator(TAYLOR, 0, reason, written, tuple(mode.held), fragile=_has_roots(mode))


def _has_roots(mode: Equations) -> bool:
    """Whether the field has fractional powers or lengths of the state: they have no series at zero."""
    return any(
        (node.is_power and not is_whole(node.exponent)) or isinstance(node, Hypot)
        for entry in mode.field
        for node in nodes(entry)
    )
