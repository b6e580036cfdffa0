"""Values and derivatives of what a system has a name for, components and outputs, at points of a result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError, ModelError
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.tracing import Symbols, model_symbols, trace
from hybrid.system.derivatives import COMPLEX_STEP, complex_step_error, evaluate
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem
from hybrid.system.members import shared_names
from hybrid.system.variables import Variables


def quantity(title: str, name: object, system: HybridSystem) -> str:
    """The name of a component or of an output, or an ArgumentError that begins with ``title``."""
    what, kind = words_for(bool(system.outputs))
    return arguments.known(f"{title}{what}", name, system.quantity_names, kind)


def members(name: object, system: HybridSystem) -> tuple[str, ...]:
    """The components or outputs of all members that a name such as ``cell.soc`` stands for; else none."""
    return shared_names(system.quantity_names).get(name, ()) if isinstance(name, str) else ()


def output_names(title: str, given: object, system: HybridSystem) -> tuple[str, ...]:
    """Names of outputs, each once, or an ArgumentError that begins with the ``title`` of the argument."""
    names = arguments.items(title, given, "be a list of names of outputs")
    for name in names:
        arguments.known(f"{title}: Output", name, system.outputs, "Outputs")
    return tuple(dict.fromkeys(names))


def words_for(has_outputs: bool) -> tuple[str, str]:
    """What a name may be that of, in the singular and in the plural."""
    if has_outputs:
        return "State component or output", "State components and outputs"
    return "State component", "State components"


class Asked:
    """Base of results that are asked for components and outputs by name."""

    __slots__ = ()
    system: HybridSystem

    def __getitem__(self, name: str) -> np.ndarray:
        """A component of the state or an output at the points, ``(N,)``.

        An output is nan in modes in which it has no value. A name for all members of a repeat, such as
        ``cell.soc``, gives ``(N, members)``.

        Raises
        ------
        ArgumentError
            If there is no component and no output of that name.
        """
        of_members = members(name, self.system)
        if of_members:
            return self._table(of_members)
        return self._table([quantity("", name, self.system)])[:, 0]

    def _table(self, names: Iterable[str]) -> np.ndarray:
        """Components and outputs at the points, ``(N, len(names))``."""
        raise NotImplementedError


def mode_indices(system: HybridSystem, names: np.ndarray) -> np.ndarray:
    """Indices ``(N,)`` of modes from their names."""
    known, place = np.unique(names, return_inverse=True)
    return np.array([system.mode_index(str(name)) for name in known], dtype=np.int64)[place.ravel()]


def values_of(
    system: HybridSystem, name: str, t: np.ndarray, x: np.ndarray, mode: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """A component or an output ``(N,)`` at points; nan where the mode gives the output no value.

    Parameters
    ----------
    name
        One of ``system.quantity_names``, or a name for all members of a repeat, which gives ``(N, members)``.
    t, x, mode
        Times ``(N,)``, states ``(N, n)``, indices of the modes ``(N,)``.
    parameters
        Their values, ``(m,)``, or ``(N, m)`` if they differ from point to point.
    """
    of_members = members(name, system)
    if of_members:
        return table_of(system, of_members, t, x, mode, parameters)
    return Evaluator(system, name)(t, x, mode, parameters)


@attrs.frozen(eq=False)
class Evaluator:
    """A component or an output that is asked for at points again and again: its functions are traced once."""

    system: HybridSystem
    name: str
    _programs: dict[int, Program | None] = attrs.field(factory=dict, init=False)

    def __call__(self, t: np.ndarray, x: np.ndarray, mode: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Values ``(N,)`` at points; as ``values_of``."""
        if self.name in self.system.state_names:
            return x[:, self.system.state_names.index(self.name)]
        found = np.full(len(t), np.nan)
        for function, rows in _functions(self.system, self.name, mode):
            found[rows] = self._evaluated(function, t[rows], x[rows], _rows_of(parameters, rows))
        return found

    def has_value_in(self, mode: int) -> bool:
        """Whether the quantity has a value in a mode, which its index gives."""
        if self.name in self.system.state_names:
            return True
        own = self.system.modes[mode]
        return self.system.outputs[self.name].in_mode(own.name, own.part_of) is not None

    def _evaluated(
        self, function: Callable[..., Any], t: np.ndarray, x: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """Values ``(N,)`` of a function: at all points at once if it can be traced, else point by point."""
        variables = self.system.variables
        if id(function) not in self._programs:
            try:
                traced = trace(function, variables.components, variables.parameter_names)
            except ModelError:
                self._programs[id(function)] = None
            else:
                self._programs[id(function)] = Program(traced)
        program = self._programs[id(function)]
        if program is not None:
            return _run(variables, program, t, x, parameters)[:, 0]
        vectors = np.broadcast_to(parameters, (len(t), parameters.shape[-1]))
        values = [
            evaluate(variables, function, *point, finite=False) for point in zip(t, x, vectors, strict=True)
        ]
        return np.array([np.nan if each is None else each[0] for each in values], dtype=float)


def table_of(
    system: HybridSystem,
    names: Sequence[str],
    t: np.ndarray,
    x: np.ndarray,
    mode: np.ndarray,
    parameters: np.ndarray,
) -> np.ndarray:
    """Several components and outputs at points, ``(N, len(names))``; as ``values_of``."""
    columns = [values_of(system, name, t, x, mode, parameters) for name in names]
    return np.column_stack(columns) if columns else np.empty((len(t), 0))


def slopes_of(
    system: HybridSystem, name: str, t: np.ndarray, x: np.ndarray, mode: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Derivatives ``(N, n + m)`` of a component or an output in the state and in the parameters.

    The points are those of ``values_of``, with one parameter vector ``(m,)``. Functions that cannot be traced
    are differentiated by the complex step.

    Raises
    ------
    ArgumentError
        If an output can neither be traced nor be computed with complex numbers.
    """
    n, m = system.dimension, len(system.parameters)
    if name in system.state_names:
        return np.tile(np.eye(1, n + m, system.state_names.index(name)), (len(t), 1))
    found = np.full((len(t), n + m), np.nan)
    for function, rows in _functions(system, name, mode):
        found[rows] = _slopes(system.variables, name, function, t[rows], x[rows], parameters)
    return found


def _functions(
    system: HybridSystem, name: str, mode: np.ndarray
) -> Iterator[tuple[Callable[..., Any], np.ndarray]]:
    """Each function of an output, with the points at which it counts."""
    output, found = system.outputs[name], dict[int, tuple[Callable[..., Any], list[int]]]()
    for index in np.unique(mode).tolist():
        own = system.modes[index]
        function = output.in_mode(own.name, own.part_of)
        if function is not None:
            found.setdefault(id(function), (function, []))[1].append(index)
    for function, indices in found.values():
        yield function, np.flatnonzero(np.isin(mode, indices))


def _rows_of(parameters: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return parameters if parameters.ndim == 1 else parameters[rows]


def _run(
    variables: Variables, program: Program, t: np.ndarray, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Values ``(N, k)`` of the expressions of a program at all points."""
    symbols = _symbols(variables)
    known = dict(zip((symbols.t, *symbols.x, *symbols.p), (t, *x.T, *parameters.T), strict=True))
    with np.errstate(all="ignore"):
        columns = program.run(known)
    return np.column_stack([np.broadcast_to(np.asarray(each, dtype=float), t.shape) for each in columns])


def _symbols(variables: Variables) -> Symbols:
    return model_symbols(variables.dimension, len(variables.parameter_names))


def _slopes(
    variables: Variables,
    name: str,
    function: Callable[..., Any],
    t: np.ndarray,
    x: np.ndarray,
    parameters: np.ndarray,
) -> np.ndarray:
    try:
        expressions = trace(function, variables.components, variables.parameter_names)
    except ModelError as why:
        _check_complex(variables, name, function, why)
        return np.array(
            [_complex_row(variables, function, *point, parameters) for point in zip(t, x, strict=True)]
        )
    symbols = _symbols(variables)
    [row] = jacobian_of(expressions, [*symbols.x, *symbols.p])
    return _run(variables, Program(row), t, x, parameters)


def _check_complex(variables: Variables, name: str, function: Callable[..., Any], why: Exception) -> None:
    called = ModelFunction(f"Output {name!r}", "function", function, "", None, None)
    error = complex_step_error(variables, called)
    if error is not None:
        raise ArgumentError(
            f"Output {name!r} has no derivative: its function cannot be traced ({why}), and the complex step "
            f"fails ({error}). Write it with NumPy functions of the state, the time and the parameters."
        ) from why


def _complex_row(
    variables: Variables, function: Callable[..., Any], t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Derivatives ``(n + m,)`` at one point by the complex step."""
    point = np.concatenate([x, parameters])
    found = np.empty(len(point))
    for i, shift in enumerate(COMPLEX_STEP * np.eye(len(point))):
        z = point + 1j * shift
        state, p = variables.state_view(z[: len(x)].tolist()), variables.parameter_view(z[len(x) :].tolist())
        with np.errstate(all="ignore"):
            found[i] = np.imag(function(complex(t), state, p)) / COMPLEX_STEP
    return found
