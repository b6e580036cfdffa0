"""The facts and the code that tracing found for a system; plain data.

A fact has one place, a field of ``Emitted``. What is stored on disk follows from the types of the fields, and
a fact that kernels read is an array of the same name in their model.
"""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.compiler.opaque import OpaqueFunction
from hybrid.compiler.statements.code import Statement
from hybrid.kernels.types.codes import IN_TIME, PROPAGATORS

# What marks a fact that kernels read as an array of whole numbers.
FOR_KERNELS = {"read by kernels": True}


@attrs.frozen
class Series:
    """The series of a mode as statements, and the columns that they fill.

    Attributes
    ----------
    statements, tangent_statements
        Body of the mode in the functions ``series`` and ``tangent_series``. ``table`` and ``vectors`` in it
        are the first columns of its table and of the tangent vectors.
    columns, table_columns, tangent_columns
        Numbers of columns for the state and what it is made of, for a table that stays, and for four tangent
        vectors.
    """

    statements: tuple[Statement, ...] = ()
    tangent_statements: tuple[Statement, ...] = ()
    columns: int = 0
    table_columns: int = 0
    tangent_columns: int = 0


NO_SERIES = Series()


@attrs.frozen
class Propagator:
    """How a mode is advanced, and why.

    Attributes
    ----------
    kind
        A code of ``hybrid.kernels.types.codes``: RUNGE_KUTTA, TAYLOR, EXACT, DESINGULARISED or
        ROOTED.
    degree
        Degree in time of every solution, and of every guard along it, if those are polynomials, else 0.
    reason
        What tracing found.
    series
        The series of its solutions; nothing for RUNGE_KUTTA.
    guards
        By transition that leaves the mode: whether the series hold its guard in a column.
    fragile
        Whether the series may be undefined where the field is defined, as that of a root at zero.
    root
        The order of the root of guards that the series hold.
    abreast
        The series for runs abreast; None if there is none.
    """

    kind: int
    degree: int
    reason: str
    series: Series = NO_SERIES
    guards: tuple[bool, ...] = ()
    fragile: bool = False
    root: int = 1
    abreast: Series | None = None

    def __str__(self) -> str:
        return f"{PROPAGATORS[self.kind]} ({self.reason})"


@attrs.frozen
class Programs:
    """The interval programs of a system: of all guards, then of the forcings, then of the residues.

    Attributes
    ----------
    rows
        Operations with their operands (see ``hybrid.kernels.arithmetic.operations``). Operands count from the
        start of their own program.
    checked
        By row: 1 for the rows of a forcing that could hide a pulse.
    numbers
        The numbers that the operations refer to.
    first
        By transition, then by forcing, then by residue, then by transition for the residues of guards: the
        first of its rows, and behind them the number of all rows. A guard without rows is affine, or could
        not be traced.
    """

    rows: tuple[tuple[int, int, int, int], ...]
    checked: tuple[int, ...]
    numbers: tuple[float, ...]
    first: tuple[int, ...]

    @property
    def longest(self) -> int:
        """Rows of the longest program."""
        return max((b - a for a, b in zip(self.first, self.first[1:], strict=False)), default=0)


@attrs.frozen
class Emitted:
    """What the compiler needs to know of a system.

    Parameters
    ----------
    texts
        By part of ``hybrid.compiler.parts``: the functions of the part as text (``hybrid.compiler.cases``).
        Those of ``LATER`` may be missing (``hybrid.compiler.emit.text_of``).
        Behind the guards, ``guard`` has their conditions; for a guard without one it leaves ``out`` alone.
        The same model gives the same text, in any process.
    affine_guard
        By transition: whether the guard's gradient, its slope in time included, is proved to depend on
        parameters only.
    plain_guard
        By transition: whether the guard is compiled in a plain form of the same sign.
    guard_in_series
        By transition: whether the series of its mode hold its guard in a column, which is a polynomial then.
    programs
        The guards that are neither affine nor opaque, and the forcings, as lists of operations.
    first_forcing
        By mode: the first of its forcings, and behind them the number of all.
    forcing_component
        By forcing: the component of the state whose rate it is a term of, or -1.
    forcing_kind
        By forcing: a part in time, terms in the state, or the arguments of exponentials in these.
    first_residue
        By mode: the first of its residues, which are rates that may cancel to their rounding, and behind them
        the number of all.
    residue_component
        By residue: the component of the state whose rate it is.
    slope_columns
        By mode and component: the columns of the state in which its row of the Jacobian may have entries.
    traced_field
        By mode: whether tracing could follow the field.
    surface, orientation
        By transition: the number of the guard's zero set, the same for guards that differ by a constant
        factor, and the sign of that factor.
    abrupt
        By mode: whether its field may change abruptly although no jump is known.
    autonomous
        By mode: whether the field is proved not to depend on time.
    discontinuities
        By mode: where the field jumps in the state, in words; empty where it is proved to be continuous.
    proved_period
        Whether every function is proved to have the declared period, whatever the parameters.
    timed_guard, timed_reset
        By transition: whether the guard, or the reset, may depend on time.
    read_by
        By mode and component: BY_GUARD if a guard or a condition depends on it, BY_FLOW if another rate or
        another component of a reset does, else BY_NOTHING, as for a counter.
    keeps_state
        By transition: whether its reset is proved to be the identity.
    jumping_reset
        By transition: whether its reset is not proved to be continuous.
    steep
        By mode: the powers of guards in its field, in words, whose slope may be infinite at the guard.
    steep_inside
        By mode: such powers of what switches inside of the mode.
    crossing
        By transition: the numbers of the fields before and behind it, at the crossing. They are those of its
        modes, or of fields behind those of all modes, with steep powers that are exactly zero. The last is
        NO_MODE if the run ends.
    propagators
        By mode: how it is best advanced.
    tangent_start, tangent_start_abreast
        The first column of tangent vectors in series, and in those of runs abreast.
    moving, mover
        Places of the numbers of clocks that resets may change, among those of all clocks, and the
        transitions of these clocks.
    row
        Where functions read the row of a schedule that fires, behind the parameters; -1 if none does.
    tables
        The numbers of all tables, as text (``hybrid.compiler.tables``).
    opaque
        The model functions that tracing could not follow, by their names in the code; not stored.
    """

    texts: dict[str, str]
    affine_guard: tuple[bool, ...] = attrs.field(metadata=FOR_KERNELS)
    plain_guard: tuple[bool, ...]
    guard_in_series: tuple[bool, ...] = attrs.field(metadata=FOR_KERNELS)
    programs: Programs
    first_forcing: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    forcing_component: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    forcing_kind: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    first_residue: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    residue_component: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    slope_columns: tuple[tuple[tuple[int, ...], ...], ...]
    traced_field: tuple[bool, ...]
    surface: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    orientation: tuple[int, ...] = attrs.field(metadata=FOR_KERNELS)
    abrupt: tuple[bool, ...] = attrs.field(metadata=FOR_KERNELS)
    autonomous: tuple[bool, ...]
    discontinuities: tuple[str, ...]
    proved_period: bool
    timed_guard: tuple[bool, ...]
    timed_reset: tuple[bool, ...]
    read_by: tuple[tuple[int, ...], ...] = attrs.field(metadata=FOR_KERNELS)
    keeps_state: tuple[bool, ...] = attrs.field(metadata=FOR_KERNELS)
    jumping_reset: tuple[bool, ...] = attrs.field(metadata=FOR_KERNELS)
    steep: tuple[str, ...]
    steep_inside: tuple[str, ...]
    crossing: tuple[tuple[int, int], ...]
    propagators: tuple[Propagator, ...]
    tangent_start: int
    tangent_start_abreast: int
    moving: tuple[int, ...] = attrs.field(default=(), metadata=FOR_KERNELS)
    mover: tuple[int, ...] = attrs.field(default=(), metadata=FOR_KERNELS)
    row: int = -1
    tables: str = ""
    opaque: dict[str, OpaqueFunction] = attrs.field(factory=dict)

    def arrays(self) -> dict[str, np.ndarray]:
        """The facts that kernels read, by name."""
        named = (each.name for each in attrs.fields(Emitted) if each.metadata == FOR_KERNELS)
        return {name: np.array(getattr(self, name), dtype=np.int64) for name in named}

    def is_sampled(self, transition: int) -> bool:
        """Whether the crossings of a guard are only sampled, because the guard could not be traced."""
        first = self.programs.first
        return not self.affine_guard[transition] and first[transition] == first[transition + 1]

    def has_forcing(self, mode: int) -> bool:
        """Whether the field of a mode has parts that depend on time alone and are bounded over each step."""
        return any(self.forcing_kind[i] == IN_TIME for i in self._forcings(mode))

    def is_fragile(self, mode: int) -> bool:
        """Whether the series of a mode may fail where its field does not.

        Terms of a forcing overflow far from its pulse, as ``cosh`` in ``1 / cosh``; roots have no series at
        zero. A Runge-Kutta step leads on from there.
        """
        return self.propagators[mode].fragile or len(self._forcings(mode)) > 0

    def _forcings(self, mode: int) -> range:
        return range(self.first_forcing[mode], self.first_forcing[mode + 1])

    def pulses_excluded(self, mode: int) -> bool:
        """Whether all forcing of a mode can be bounded, so that no pulse in time is stepped over."""
        first, guards = self.programs.first, len(self.affine_guard)
        return self.traced_field[mode] and all(
            first[guards + i] < first[guards + i + 1] or self.forcing_kind[i] != IN_TIME
            for i in self._forcings(mode)
        )
