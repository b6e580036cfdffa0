"""From a model to machine code: a few small functions per model, which the shared kernels call."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from threading import RLock
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.agreement import check_agreement
from hybrid.compiler.arrays import graph_arrays, indices
from hybrid.compiler.cache.folder import announced
from hybrid.compiler.cache.loader import Absent, load_kernels
from hybrid.compiler.emission import emitted_of, text_of
from hybrid.compiler.parts import EVENTS, FIELDS, SERIES, SLOPES, TANGENT_SERIES, VARIATIONAL
from hybrid.compiler.tables import Knots, unpacked
from hybrid.errors import ArgumentError, ModelError
from hybrid.kernels.types.codes import DESINGULARISED, NARROW, ROOTED, RUNGE_KUTTA
from hybrid.kernels.types.layout import Model, Programs
from hybrid.system.functions import CLOCK, CONDITION, NUMBER, ModelFunction
from hybrid.system.graph import HybridSystem, as_system, functions_of, watched_by
from hybrid.system.periodicity import period_at, period_fault
from hybrid.system.watched import Watched

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted

# The functions of a model as ``hybrid.kernels.evaluate`` numbers them.
FUNCTION_NUMBERS = {"field": 0, "guard": 1, CLOCK: 1, CONDITION: 1, NUMBER: 1, "reset": 2}
# So many times all transitions come before the functions of a kind.
BEFORE = {CONDITION: 1, NUMBER: 2}
GRADIENT = 3
UNBOUNDED = "its forcing cannot be bounded: a pulse in time that is narrower than a step may be stepped over"
# Threads that meet a new system compile it once; stages of a growing system share what is written.
_COMPILING = RLock()
# Number of parameter vectors to remember.
REMEMBERED = 10_000
UNCARRIED = "steps resolve it, tangent vectors are not valid beyond it"


@attrs.frozen(eq=False, repr=False)
class CompiledSystem:
    """A system's functions as machine code and its graph as index arrays; one for all parameter values.

    Attributes
    ----------
    system
        The model.
    emitted
        The generated source and what tracing could prove of the model.
    watched
        The globals and other values that the model functions had read, for which this was compiled.
    parts
        The compiled functions by name, for each part of ``hybrid.compiler.parts`` that was needed so far.
    plans
        What runs by one solver have in common, kept here by those who make runs.
    periodic_at
        Parameter vectors at which the declared period was found to be one, where that is not proved.
    last_model
        The functions at a point, at the parameter vector of the last call.

    Examples
    --------
    >>> import hybrid, models
    >>> print(hybrid.compile_system(models.bouncing_ball()))
    CompiledSystem of bouncing ball: 2 states
      mode flight: exact (polynomials of degree 2)
      transition bounce: affine guard, its crossings are isolated on each step
    """

    system: HybridSystem
    emitted: Emitted
    watched: Watched = attrs.field(factory=Watched)
    parts: dict[str, Any] = attrs.field(factory=dict, init=False)
    plans: dict[Any, Any] = attrs.field(factory=dict, init=False)
    periodic_at: set[bytes] = attrs.field(factory=set, init=False)
    last_model: dict[tuple[bytes, int], Any] = attrs.field(factory=dict, init=False)

    def __repr__(self) -> str:
        system = self.system
        lines = [f"CompiledSystem of {system.name or 'a system'}: {system.dimension} states"]
        modes = zip(system.mode_names, self.emitted.propagators, self.emitted.discontinuities, strict=True)
        for mode, (name, propagator, jumps) in enumerate(modes):
            lines.append(f"  mode {name}: {propagator}")
            if not self.emitted.pulses_excluded(mode):
                lines.append(f"    {UNBOUNDED}")
            elif self.emitted.has_forcing(mode):
                lines.append("    its forcing is bounded on each step, no pulse in time is stepped over")
            if jumps:
                lines.append(f"    its field jumps where {jumps}: {UNCARRIED}")
        for index, name in enumerate(system.transition_names):
            lines.append(f"  transition {name}: {self._crossings_of(index)}")
        return "\n".join(lines)

    def _crossings_of(self, transition: int) -> str:
        """How the crossings of a guard are found, in words."""
        emitted = self.emitted
        if self.system.transitions[transition].clock is not None:
            return "clock, its ticks are known"
        if emitted.affine_guard[transition]:
            return "affine guard, its crossings are isolated on each step"
        if emitted.is_sampled(transition):
            return "guard sampled on each step: its crossings are not proved"
        return "guard bounded on each step, its crossings are proved"

    def value(
        self,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
        row: int = 0,
    ) -> np.ndarray:
        """A compiled function of the mode or transition of that index, ``(rows,)``; nan if it fails.

        ``row`` is that of a schedule that fires.
        """
        out = np.full(function.rows, np.nan)
        offset = BEFORE.get(function.kind, 0) * len(self.system.transitions)
        model = self._model_at(parameters, row)
        self._call("vector_function", model, FUNCTION_NUMBERS[function.kind], index + offset, t, x, out)
        return out

    def derivative(
        self,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
        row: int = 0,
    ) -> np.ndarray:
        """The derivative ``(rows, n + 1)`` of a function; the last column is the derivative in time."""
        out = np.full((function.rows, self.system.dimension + 1), np.nan)
        model = self._model_at(parameters, row)
        if function.size is None:
            self._call("vector_function", model, GRADIENT, index, t, x, out[0])
        else:
            self._call("matrix_function", model, FUNCTION_NUMBERS[function.kind], index, t, x, out)
        return out

    def _model_at(self, parameters: np.ndarray, row: int) -> Any:
        """The functions at a point, at a parameter vector; the last one is kept for the next call."""
        values = np.array(parameters, dtype=float)
        key = values.tobytes(), row
        found = self.last_model.get(key)
        if found is None:
            found = self._model.replace(parameters=self.with_tables(values, row))
            self.last_model.clear()
            self.last_model[key] = found
        return found

    @staticmethod
    def _call(kernel: str, model: Any, number: int, index: int, t: float, x: Any, out: np.ndarray) -> None:
        call = vars(load_kernels("hybrid.kernels.evaluate"))[kernel]
        call(model, number, index, float(t), np.array(x, dtype=float), out)

    def __reduce__(self) -> tuple[Any, ...]:
        return compile_system, (self.system,)

    def __copy__(self) -> CompiledSystem:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> CompiledSystem:
        return self

    def functions(self, part: str) -> dict[str, Any]:
        """The compiled functions of a part of ``hybrid.compiler.parts`` by name, each with its ``address``.

        Raises
        ------
        ModelError
            If a function that tracing could not follow cannot be compiled as it is.
        """
        if part not in self.parts:
            # LLVM is imported only when a model is compiled.
            from hybrid.compiler.llvm.functions import compiled_part, compiled_stage

            growth = self.system.growth
            with announced(f"hybrid: compiling {self.system.name or 'the model'} ..."):
                if growth is None or self._own:
                    self.parts[part] = compiled_part(self._text(part), part, self._own)
                else:
                    transitions = 2 * len(self.system.transitions)
                    # Behind the fields of all modes there are two for a crossing at most.
                    indices = len(self.system.modes) + transitions + len(self.emitted.moving)
                    self.parts[part] = compiled_stage(self._text(part), part, growth.written, indices)
        found: dict[str, Any] = self.parts[part]
        return found

    def _text(self, part: str) -> str:
        if part not in self.emitted.texts:
            self.emitted.texts[part] = text_of(self.system, part)
        return self.emitted.texts[part]

    @cached_property
    def _own(self) -> Any:
        from hybrid.compiler.llvm.functions import own_functions

        return own_functions(self.emitted)

    def moving(self, kinds: Sequence[int], tangents: int) -> dict[str, Any]:
        """The functions that advance modes by propagators of these kinds, by their names in a model."""
        needed: dict[str, Any] = {}
        if any(kind != RUNGE_KUTTA for kind in kinds):
            part = TANGENT_SERIES if tangents else SERIES
            [needed["series"]] = self.functions(part).values()
        if tangents and self.takes_steps(kinds):
            needed |= self.functions(VARIATIONAL)
        return needed

    def needs_series(self, mode: int) -> bool:
        """Whether tangent vectors need the series of a mode, since the slope of its field may be infinite."""
        return bool(self.emitted.steep[mode]) and self.emitted.propagators[mode].kind in (
            DESINGULARISED,
            ROOTED,
        )

    def takes_steps(self, kinds: Sequence[int]) -> bool:
        """Whether runs by propagators of these kinds may need steps of a Runge-Kutta method."""
        return any(kind == RUNGE_KUTTA or self.emitted.is_fragile(mode) for mode, kind in enumerate(kinds))

    def series_columns(self, tangents: int) -> int:
        """Number of columns that the series of all modes need together."""
        groups = -(-arguments.count("tangents", tangents, 0) // NARROW)
        widest = max(each.series.tangent_columns for each in self.emitted.propagators)
        return self.emitted.tangent_start + groups * widest

    def model(self, parameters: Mapping[str, float] | None = None) -> Any:
        """The model as kernels get it: functions at a point, parameter values, graph."""
        return self.at(parameters, self._model)

    def moved_by(self, moving: Mapping[str, Any], propagator: np.ndarray) -> Any:
        """A model at its default parameters, with the functions from ``moving`` and these propagators.

        Its period is nan if the default parameters have none; runs at other parameters may have one.
        """
        model = self._model.replace(**moving, propagator=propagator)
        try:
            return self.at(None, model)
        except ArgumentError:
            return model.replace(period=math.nan)

    def given(self, parameters: Mapping[str, float] | None, model: Any) -> Any:
        """A model from ``moved_by`` at parameter values; itself for None."""
        shared = parameters is None and model.period >= 0.0 and self.emitted.row < 0
        return model if shared else self.at(parameters, model)

    def own(self, model: Any) -> Any:
        """The same model for one thread alone, if runs write into it: the row of a schedule that fires."""
        return model if self.emitted.row < 0 else model.replace(parameters=model.parameters.copy())

    def at(self, parameters: Mapping[str, float] | None, model: Any) -> Any:
        """A model at parameter values."""
        values = self.system.parameter_values(parameters)
        period = self.period_at(values, given=bool(parameters))
        changes: dict[str, Any] = {"period": period, **self.knots_at(values)}
        values = changes["parameters"] = self.with_tables(values)
        if self.emitted.programs.rows:
            changes["programs"] = self._programs.replace(parameters=values)
        found = model.replace(**changes)
        # Runs may share a model, but for one that they write rows into.
        values.flags.writeable = self.emitted.row >= 0
        return found

    def period_at(self, values: np.ndarray, *, given: bool = True) -> float:
        """The forcing period, or 0, at a parameter vector; ``given`` if these are not the default values."""
        period = period_at(self.system.period, self.system.variables, values) or 0.0
        if given and not self.emitted.proved_period:
            self._check_period(values, period)
        return period

    def _check_period(self, values: np.ndarray, period: float) -> None:
        """ArgumentError unless the functions have the period at these values, which are remembered."""
        key = values.tobytes()
        if key in self.periodic_at:
            return
        fault = period_fault(
            self.system.variables, [function for _, function in functions_of(self.system)], values, period
        )
        if fault is not None:
            raise ArgumentError(fault)
        if len(self.periodic_at) >= REMEMBERED:
            self.periodic_at.clear()
        self.periodic_at.add(key)

    @cached_property
    def _programs(self) -> Any:
        programs = self.emitted.programs
        return Programs(
            rows=np.array(programs.rows, dtype=np.int64).reshape(-1, 4),
            checked=indices(programs.checked),
            numbers=np.array(programs.numbers, dtype=float),
            first=indices(programs.first),
            parameters=self.with_tables(self.system.parameter_values()),
        )

    @cached_property
    def _tables(self) -> np.ndarray:
        return unpacked(self.emitted.tables)

    @cached_property
    def _knots(self) -> Knots:
        return Knots(self.system)

    def with_tables(self, values: np.ndarray, row: int = 0) -> np.ndarray:
        """A parameter vector as kernels get it, with the row that fires and the tables behind it."""
        if not self.emitted.tables and self.emitted.row < 0:
            return values
        return np.concatenate([values, *([[float(row)]] if self.emitted.row >= 0 else []), self._tables])

    def knots_at(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """The times at which tables of time have their points, as fields of a model that has any."""
        return self._knots.at(values) if self.emitted.tables else {}

    @cached_property
    def _model(self) -> Any:
        values = self.system.parameter_values()
        modes = len(self.system.modes)
        return Model(
            **self.functions(FIELDS),
            **self.functions(EVENTS),
            **self.functions(SLOPES),
            variational_field=Absent(),
            series=Absent(),
            **self.emitted.arrays(),
            **graph_arrays(self.system, self.emitted),
            row=self.emitted.row,
            parameters=self.with_tables(values),
            **{**_no_knots(modes), **self.knots_at(values)},
            programs=self._programs,
            **_program_runners(bool(self.emitted.programs.rows)),
            tangent_start=self.emitted.tangent_start,
            period=0.0,
        )

    @cached_property
    def is_smooth(self) -> bool:
        """Whether no field jumps or has an infinite slope inside of its mode."""
        return not any(self.emitted.discontinuities) and not any(self.emitted.steep_inside)

    @property
    def is_timed(self) -> bool:
        """Whether a field, a guard or a reset may depend on time, a clock not being one."""
        emitted = self.emitted
        return not all(emitted.autonomous) or any(emitted.timed_guard) or any(emitted.timed_reset)


def _program_runners(needed: bool) -> dict[str, Any]:
    """The kernels that run interval programs; they are loaded only if there are programs."""
    if not needed:
        return {"bound": Absent(), "spread": Absent()}
    bounds = load_kernels("hybrid.kernels.events.bounds")
    return {"bound": bounds.bound_guard, "spread": bounds.spread_by_rounding}


def _no_knots(modes: int) -> dict[str, np.ndarray]:
    """The knots of a model without tables in time."""
    firsts = {"first_group": np.zeros(modes + 1, dtype=np.int64), "first_knot": np.zeros(1, dtype=np.int64)}
    return {**firsts, **{name: np.empty(0) for name in ("repeat", "knots", "before_knots")}}


def compile_system(system: HybridSystem) -> CompiledSystem:
    """Trace, differentiate and compile a model; repeated calls return the first result.

    Values that model functions take from globals, closures, objects and tables, also through functions that
    they call, belong to what is compiled: after a change of one of them the model is compiled again.
    Parameters are the quick way to change a value.

    Raises
    ------
    ModelError
        If a function can be neither traced nor compiled, nor differentiated, or the compiled function is not
        the Python function.
    ArgumentError
        If ``system`` is not a HybridSystem.

    Examples
    --------
    >>> import models
    >>> from hybrid import compile_system
    >>> print(compile_system(models.bouncing_ball()))
    CompiledSystem of ...: 2 states
      mode flight: exact (polynomials of degree 2)...
    """
    as_system("system", system)
    compiled: CompiledSystem | None = system._compiled
    if not _is_current(compiled):
        load_kernels()
        with _COMPILING:
            compiled = system._compiled
            if not _is_current(compiled):
                watched = _watched(system)
                compiled = CompiledSystem(system, emitted_of(system), watched)
                check_agreement(compiled)
                object.__setattr__(system, "_compiled", compiled)
    assert compiled is not None
    return compiled


def _is_current(compiled: CompiledSystem | None) -> bool:
    """Whether the functions have been compiled for the values that they read now."""
    if compiled is None:
        return False
    return compiled.watched.holds() and compiled.system.derived_from.holds()


def _watched(system: HybridSystem) -> Watched:
    """What the functions of a system read now."""
    if not system.derived_from.holds():
        raise ModelError(
            f"{system.name or 'The system'} was derived from model functions that read a global, a closure "
            "or a table which has changed since. Derive the system again (split, from_equations, filippov), "
            "or make the value a parameter."
        )
    # A field is looked at once for jumps, which may be others now.
    with suppress(AttributeError):
        object.__delattr__(system, "switching")
    return watched_by(system)
