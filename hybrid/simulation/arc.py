"""Solutions over hybrid time: smooth pieces joined by jumps (Goebel, Sanfelice and Teel 2012)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, overload

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.display.tables import counted, html_table
from hybrid.errors import ArgumentError
from hybrid.simulation.labelled import Names, attributes
from hybrid.simulation.saltation import matrices_at
from hybrid.status import Status
from hybrid.system.elements import END
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

# In the order of the kernel's codes.
KINDS = ("transverse", "grazing", "limit")
# Dense output is evaluated at so many times per call of a kernel.
TIMES_AT_ONCE = 100_000
# Jumps that a notebook shows.
MOST_SHOWN = 20


@attrs.frozen(eq=False)
class Jump:
    """One fired transition at hybrid time ``(t, j)``.

    Attributes
    ----------
    t, j
        Time, and the number of jumps before this one.
    transition, source, target
        Names of the transition and of the modes before and after; ``target`` is None where it ended the run.
    x_minus, x_plus
        States ``(n,)`` before and after.
    transversality
        ``D_t g + D_x g f_minus``, the guard's speed at the crossing; near zero the crossing grazes and the
        saltation matrix grows without bound, unless the jump was set off by another.
    kind
        ``"transverse"``, ``"grazing"`` for a crossing so shallow that the tolerances cannot tell it from a
        touch, ``"limit"`` for the end of a chatter.
    """

    t: float
    j: int
    transition: str
    source: str
    target: str | None
    x_minus: np.ndarray
    x_plus: np.ndarray
    transversality: float
    kind: str
    _all: Jumps = attrs.field(repr=False)

    @property
    def saltation(self) -> np.ndarray:
        """Saltation matrix ``(n, n)``: what the jump does to tangent vectors, to first order.

        If a jump triggers others at the same instant, by landing beyond their guards, all of them happen at
        the time of its own guard. The product of the matrices is the tangent map of all these jumps, provided
        that the matrices before the last one can be inverted.
        """
        return self._all.saltation[self.j]


@attrs.frozen(eq=False)
class Grazing:
    """A touch: a guard that comes so close to zero that the tolerances cannot tell the sides, and turns back.

    Attributes
    ----------
    t, j
        Time, and the number of jumps before.
    transition
        Name of the transition that did not fire.
    x
        State ``(n,)``.
    value, acceleration
        The guard and its second derivative along the flow there; its speed is zero.
    """

    t: float
    j: int
    transition: str
    x: np.ndarray
    value: float
    acceleration: float


@attrs.frozen(eq=False, repr=False)
class Jumps(Sequence[Jump]):
    """The jumps of an arc in order; ``jumps["impact"]`` are those of one transition, or of all its copies.

    Each :class:`Jump` is made when it is looked at; the arrays hold all of them.

    Attributes
    ----------
    transversality
        As in :class:`Jump`, ``(jumps,)``.
    """

    system: HybridSystem
    _parameters: np.ndarray
    _period: float
    _phase: np.ndarray
    _cycle: np.ndarray
    _transition: np.ndarray
    transversality: np.ndarray
    _kind: np.ndarray
    _has_matrix: np.ndarray
    _states: np.ndarray
    _recorded: np.ndarray

    @cached_property
    def t(self) -> np.ndarray:
        """Times ``(jumps,)``."""
        return self._cycle * self._period + self._phase

    @property
    def transition_index(self) -> np.ndarray:
        """Indices ``(jumps,)`` of the transitions in the system."""
        return self._transition

    @cached_property
    def transition(self) -> np.ndarray:
        """Names of the transitions, ``(jumps,)``."""
        return np.array(self.system.transition_names, dtype=str)[self.transition_index]

    @cached_property
    def kind(self) -> np.ndarray:
        """As in :class:`Jump`, ``(jumps,)``."""
        return np.array(KINDS)[self._kind]

    @property
    def x_minus(self) -> np.ndarray:
        """States before the jumps, ``(jumps, n)``."""
        return self._states[:, 0]

    @property
    def x_plus(self) -> np.ndarray:
        """States after the jumps, ``(jumps, n)``."""
        return self._states[:, 1]

    @cached_property
    def saltation(self) -> np.ndarray:
        """As in :class:`Jump`, ``(jumps, n, n)``; those that the run did not need are made when looked at."""
        missing = np.flatnonzero(self._has_matrix == 0)
        if not missing.size:
            return self._recorded
        fired, phases = self.transition_index[missing].tolist(), self._phase[missing].tolist()
        parameters = dict(zip(self.system.parameters, self._parameters.tolist(), strict=True))
        model = compile_system(self.system).model(parameters)
        matrices = np.empty((len(self), *self._recorded.shape[1:]))
        matrices[self._has_matrix == 1] = self._recorded
        matrices[missing], _ = matrices_at(
            self.system, model, fired, phases, np.ascontiguousarray(self.x_minus[missing])
        )
        return matrices

    def to_xarray(self) -> xarray.Dataset:
        """The jumps over the axis ``jump``: times, transitions, kinds, states before and after."""
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables = {
            "t": ("jump", self.t, names.of("t")),
            "transition": ("jump", self.transition),
            "kind": ("jump", self.kind),
            "x_minus": (("jump", "state"), self.x_minus, names.states),
            "x_plus": (("jump", "state"), self.x_plus, names.states),
            "transversality": ("jump", self.transversality),
        }
        return xarray.Dataset(variables, names.coords(), attributes("jumps", system=self.system))

    def __len__(self) -> int:
        return len(self._phase)

    def __repr__(self) -> str:
        return f"<{counted(len(self), 'jump')}>"

    def _repr_html_(self) -> str:
        """The first jumps as a table for a notebook."""
        names = ("t", "transition", "from", "to", "kind", "transversality")
        rows = [
            [
                f"{jump.t:.9g}",
                jump.transition,
                jump.source,
                END if jump.target is None else jump.target,
                jump.kind,
                f"{jump.transversality:.6g}",
            ]
            for jump in self[:MOST_SHOWN]
        ]
        left = len(self) - len(rows)
        more = f"\n<p>and {left} more</p>" if left else ""
        return f"<p>{escape(repr(self))}</p>\n{html_table(names, rows)}{more}"

    @overload
    def __getitem__(self, index: int) -> Jump: ...
    @overload
    def __getitem__(self, index: slice | str) -> list[Jump]: ...
    def __getitem__(self, index: int | slice | str) -> Jump | list[Jump]:
        if isinstance(index, str):
            fired = np.isin(self.transition_index, self.system.copies_of(index))
            return [self._jump(i) for i in np.flatnonzero(fired).tolist()]
        if isinstance(index, slice):
            return [self._jump(i) for i in range(*index.indices(len(self)))]
        whole = arguments.whole_number(index)
        if whole is None:
            raise arguments.refusal(
                "jumps: the index", "be a whole number, a slice or the name of a transition", index
            )
        if not -len(self) <= whole < len(self):
            raise IndexError(f"jump {whole} of an arc with {len(self)} jumps")
        return self._jump(whole % len(self))

    def __iter__(self) -> Iterator[Jump]:
        return (self._jump(i) for i in range(len(self)))

    def _jump(self, i: int) -> Jump:
        transition = self.system.transitions[self.transition_index[i]]
        kind = KINDS[self._kind[i]]
        target = transition.accumulates_to if kind == "limit" else transition.target
        return Jump(
            float(self.t[i]),
            i,
            transition.name,
            transition.source,
            target or transition.target,
            self.x_minus[i],
            self.x_plus[i],
            float(self.transversality[i]),
            kind,
            self,
        )


@attrs.frozen(eq=False)
class Pieces:
    """The smooth steps of a run: ``S`` polynomials, each in a variable on ``[0, 1]``.

    Attributes
    ----------
    blocks
        The polynomials of successive steps, ``(steps of a block, d + 1, n + 1)`` each: coefficients of
        ``1, theta, theta^2, ...`` of the state and, in the last column, of the time since the start of the
        step. In a desingularised mode the time is not proportional to ``theta``.
    t, low, h
        Start of each step, the rounding error of that start, and the length of the step, ``(S,)``.
    mode, j
        Mode index and jump count of each, ``(S,)``.
    """

    blocks: list[np.ndarray]
    t: np.ndarray
    low: np.ndarray
    h: np.ndarray
    mode: np.ndarray
    j: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """States at the starts of the steps, ``(S, n)``."""
        return np.concatenate([block[:, 0, :-1] for block in self.blocks])

    @property
    def coefficients(self) -> np.ndarray:
        """The polynomials in one array, ``(S, d + 1, n + 1)``.

        They are joined when somebody first asks: of a long run, that takes longer than the run.
        """
        if len(self.blocks) > 1:
            self.blocks[:] = [np.concatenate(self.blocks)]
        return self.blocks[0]

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States ``(len(times), n)``, and the steps they are taken from; at a jump, the state after it."""
        coefficients = self.coefficients
        states = np.empty((len(times), coefficients.shape[2] - 1))
        index = np.empty(len(times), dtype=np.int64)
        kernel = load_kernels("hybrid.kernels.steps.dense").states_at
        times = np.ascontiguousarray(times)
        # Between two calls Ctrl-C is heard.
        for first in range(0, len(times), TIMES_AT_ONCE):
            part = slice(first, first + TIMES_AT_ONCE)
            kernel(times[part], self.t, self.low, self.h, coefficients, states[part], index[part])
        return states, index


@attrs.frozen(eq=False, repr=False)
class HybridArc:
    """A solution over hybrid time ``(t, j)``; ``arc["q"]`` is one component of the state over it.

    Without ``samples`` the points are the solver's own: both sides of every jump and the ends of every step.
    With ``samples`` the points are at those times; at a jump, the state is the one after it.

    Attributes
    ----------
    system, parameters
        The model, and the values of all its parameters in the run, by name.
    t, j, x
        Times ``(N,)``, jump counts ``(N,)``, states ``(N, n)``.
    jump_count
        Number of jumps, also of those that were not kept.
    grazings
        Each :class:`Grazing`, in order.
    status
        How the run ended. A run that ended early keeps its results up to there.
    fundamental
        ``(n, k)`` tangent vectors at the end, carried by the variational equation and the saltation matrices;
        None if the run had none.
    propagators
        How each mode was advanced, by its name: ``"exact"``, ``"Taylor series"``, ``"Taylor series,
        desingularised"``, ``"Taylor series, with the root of a guard"`` or ``"Runge-Kutta pair"``. If
        every mode is exact, a crossing can only be missed if rounding hides it.
    steps, rejected
        Number of attempted steps, and how many of them the error control rejected.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    t: np.ndarray
    j: np.ndarray
    x: np.ndarray
    _mode_index: np.ndarray
    _jumps: Jumps | None
    jump_count: int
    grazings: tuple[Grazing, ...]
    status: Status
    fundamental: np.ndarray | None
    propagators: dict[str, str]
    steps: int
    rejected: int
    _pieces: Pieces | None

    @property
    def jumps(self) -> Jumps:
        """Sequence of :class:`Jump`.

        Raises
        ------
        ArgumentError
            If the run did not keep its jumps, as with ``samples`` unless ``keep_jumps`` is True.
        """
        if self._jumps is None:
            raise ArgumentError(
                f"This arc did not keep its jumps, of which there were {self.jump_count}. Run simulate with "
                "keep_jumps=True."
            )
        return self._jumps

    @property
    def keeps_jumps(self) -> bool:
        """Whether the run kept its jumps, so that ``jumps`` holds them."""
        return self._jumps is not None

    @cached_property
    def mode(self) -> np.ndarray:
        """Names of the modes, ``(N,)``."""
        return np.array(self.system.mode_names)[self._mode_index]

    @cached_property
    def part_of(self) -> np.ndarray:
        """Names of the modes before the system was split, ``(N,)``."""
        return np.array([mode.part_of or mode.name for mode in self.system.modes])[self._mode_index]

    def to_xarray(self) -> xarray.Dataset:
        """The points of the arc over time: ``x`` (axes ``t`` and ``state``), ``j``, ``mode``.

        Without ``samples`` a time occurs twice at each jump, with both states; ``arc.jumps.to_xarray()``
        has the jumps. ``.to_netcdf(path)`` or ``.to_zarr(path)`` saves the dataset, and `open_store` reads
        it.
        """
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables: dict[str, Any] = {
            "x": (("t", "state"), self.x, names.states),
            "j": ("t", self.j),
            "mode": ("t", self.mode),
        }
        if self.fundamental is not None:
            variables["fundamental"] = (("state", "tangent"), self.fundamental)
        coords = {"t": ("t", self.t, names.of("t")), **names.coords()}
        made_by = attributes("arc", self.status, self.system, self.parameters)
        return xarray.Dataset(variables, coords, made_by)

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:.6g} to {self.t[-1]:.6g}" if len(self.t) else "no points"
        return f"<HybridArc {span}, {counted(self.jump_count, 'jump')}, {self.status.brief}>"

    def _repr_html_(self) -> str:
        """The arc for a notebook: how it ended, and its end by name."""
        if not len(self.t):
            return f"<p>{escape(repr(self))}</p>"
        names = ("t", "mode", *self.system.state_names)
        ends = [
            [f"{self.t[i]:.6g}", str(self.mode[i]), *(f"{value:.6g}" for value in self.x[i])] for i in (0, -1)
        ]
        return f"<p>{escape(repr(self))}</p>\n<p>{escape(str(self.status))}</p>\n{html_table(names, ends)}"

    def __getitem__(self, component: str) -> np.ndarray:
        """A component of the state at the points of the arc, ``(N,)``.

        Raises
        ------
        ArgumentError
            If the state has no component of that name.
        """
        names = self.system.state_names
        return self.x[
            :, names.index(arguments.known("State component", component, names, "State components"))
        ]

    def __call__(self, t: ArrayLike) -> np.ndarray:
        """State at time ``t``, a scalar or an array, from the dense output: ``t.shape + (n,)``.

        At the time of a jump this is the state after it.

        Raises
        ------
        ArgumentError
            If a time lies outside the run, or the run kept samples only.
        """
        times = arguments.numbers("t", t, "be a time or an array of times")
        if self._pieces is None:
            raise ArgumentError(
                "This arc keeps samples only. Run simulate without samples= for dense output."
            )
        if times.size and not (times.min() >= self.t[0] and times.max() <= self.t[-1]):
            raise ArgumentError(
                f"t must lie in the run, [{self.t[0]}, {self.t[-1]}]; got {times.min()} to {times.max()}."
            )
        flat = times.ravel()
        if len(self._pieces.t) == 0:
            return np.broadcast_to(self.x[-1], (*times.shape, self.system.dimension)).copy()
        states, _ = self._pieces.at(flat)
        # A step ends at its jump, but the end of the run may be after it.
        states[flat >= self.t[-1]] = self.x[-1]
        return states.reshape(*times.shape, self.system.dimension)


def hybrid_points(
    system: HybridSystem, pieces: Pieces, jumps: Jumps, end: tuple[float, np.ndarray, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times, jump counts, states, mode indices in order: step starts, states before jumps, the end."""
    t_end, x_end, mode_end = end
    count = np.arange(len(jumps))
    # The state before a jump follows the starts of all steps with as many jumps.
    before = np.searchsorted(pieces.j, count, side="right") + count
    starts = np.ones(len(pieces.t) + len(jumps) + 1, dtype=bool)
    starts[before] = starts[-1] = False

    def in_order(of_steps: np.ndarray, of_jumps: np.ndarray, at_end: Any) -> np.ndarray:
        column = np.empty((len(starts), *of_steps.shape[1:]), of_steps.dtype)
        column[starts], column[before], column[-1] = of_steps, of_jumps, at_end
        return column

    sources = np.array([system.mode_index(tr.source) for tr in system.transitions], dtype=np.int64)
    return (
        in_order(pieces.t, jumps.t, t_end),
        in_order(pieces.j, count, len(jumps)),
        in_order(pieces.starts, jumps.x_minus, x_end),
        in_order(pieces.mode, sources[jumps.transition_index], mode_end),
    )


def join(chunks: list[tuple[Any, ...]]) -> tuple[np.ndarray, ...]:
    """Concatenate the columns of rows of arrays."""
    if len(chunks) == 1:
        return chunks[0]
    return tuple(np.concatenate(column) for column in zip(*chunks, strict=True))
