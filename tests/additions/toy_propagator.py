"""A propagator in one file: a mode in which nothing moves."""

from hybrid.compiler.emitted import Propagator
from hybrid.compiler.propagators.equations import Equations
from hybrid.compiler.propagators.writing import write_series
from hybrid.kernels.types.codes import EXACT


def at_rest(mode: Equations) -> Propagator | str:
    """The constant solution of a field that is zero."""
    if any(rate != 0 for rate in mode.field):
        return "something in it moves"
    written = write_series(mode.field, mode.guards, mode.symbols)
    return Propagator(EXACT, 1, "at rest", written, tuple(mode.held))
