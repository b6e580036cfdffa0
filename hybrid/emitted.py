"""What tracing has found out about a system, apart from SymPy, which found it."""

from __future__ import annotations

import attrs

from hybrid.kernels.codes import PROPAGATORS


@attrs.frozen
class Propagator:
    """How a mode is advanced, and why.

    Attributes
    ----------
    kind
        A code of ``hybrid.kernels.codes``: RUNGE_KUTTA, TAYLOR, EXACT or DESINGULARISED.
    degree
        Degree in time of every solution, and of every guard along it, if those are polynomials, else 0.
    reason
        What tracing found.
    statements
        Body of the mode in the role ``series``. ``table`` and ``vectors`` in it are the first columns of its
        table and of the tangent vectors.
    columns, table_columns, tangent_columns
        Columns that the series need for the state and what it is made of, for a table that stays, and for
        four tangent vectors.
    """

    kind: int
    degree: int
    reason: str
    statements: tuple[str, ...] = ()
    columns: int = 0
    table_columns: int = 0
    tangent_columns: int = 0

    def __str__(self) -> str:
        return f"{PROPAGATORS[self.kind]} ({self.reason})"


@attrs.frozen
class Emitted:
    """What the compiler needs to know of a system.

    Parameters
    ----------
    source
        Text of a module with the functions ``flow``, ``flow_jacobian``, ``variational_flow``, ``guard``,
        ``guard_gradient``, ``reset`` and ``reset_jacobian``, to be compiled with IEEE division. Behind the
        guards, ``guard`` has their conditions; for a guard without one it leaves ``out`` alone. The same
        model gives the same text, in any process.
    opaque
        What the text refers to by name: the model functions that tracing could not follow, to be
        compiled themselves, and the named tuples they take. Empty if all were traced.
    affine_guard
        By transition: whether the guard's gradient, its slope in time included, is proved to depend on
        parameters only.
    affine_mode
        By mode: whether the field's derivative in the state is proved not to depend on the state.
    autonomous
        By mode: whether the field is proved not to depend on time.
    propagators
        By mode: how it is best advanced.
    tangent_start
        The first column of tangent vectors in series.
    """

    source: str
    opaque: dict[str, object]
    affine_guard: tuple[bool, ...]
    affine_mode: tuple[bool, ...]
    autonomous: tuple[bool, ...]
    propagators: tuple[Propagator, ...]
    tangent_start: int
