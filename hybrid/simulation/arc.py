"""Solutions over hybrid time: smooth pieces joined by jumps (Goebel, Sanfelice and Teel 2012)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.tables import counted, html_table
from hybrid.errors import ArgumentError
from hybrid.simulation.jumps import Grazing, Jumps, Sensitivities, known
from hybrid.simulation.labelled import Names, attributes, with_counters
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

# Dense output is evaluated at so many times per call of a kernel.
TIMES_AT_ONCE = 100_000


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
        Times ``(N,)``, jump counts ``(N,)``, states ``(N, n)`` with held components and counters last.
    jump_count
        Number of jumps, also of those that were not kept.
    grazings
        Each :class:`Grazing`, in order.
    status
        How the run ended. A run that ended early keeps its results up to there.
    fundamental
        ``(n, k)`` tangent vectors at the end, carried by the variational equation and the saltation matrices,
        without rows for counters; None if the run had none.
    propagators
        How each mode was advanced, by its name: ``"exact"``, ``"Taylor series"``, ``"Taylor series,
        desingularised"``, ``"Taylor series, with the root of a guard"`` or ``"Runge-Kutta pair"``. If
        every mode is exact, a crossing can only be missed if rounding hides it.
    steps, rejected
        Number of attempted steps, and how many of them the error control rejected.

    Examples
    --------
    >>> import hybrid, models
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), tangent=True)
    >>> len(arc.jumps), arc.status.ok
    (1, True)
    >>> arc(0.3).round(4), arc["q"].shape == arc.t.shape
    (array([ 0.5586, -2.943 ]), True)
    >>> arc.fundamental.shape
    (2, 2)
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
    _sensitivities: Sensitivities | None = None

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
    def sensitivity(self) -> np.ndarray:
        """Derivatives ``(n, m)`` of the last state in the parameters that ``sensitivities=`` names, in order.

        They are those at a fixed time, with the same start: parameters move fields, guards, resets and the
        forcing. They obey the variational equation with the derivatives of the field in the parameters, and
        the saltation matrices of the extended state (x, p).

        Raises
        ------
        ArgumentError
            If the run had no ``sensitivities``.

        References
        ----------
        S. Galan, W. F. Feehery, P. I. Barton, "Parametric sensitivity functions for hybrid
        discrete/continuous systems", Applied Numerical Mathematics 31(1), 17-47, 1999.
        doi:10.1016/S0168-9274(98)00125-1
        """
        return known(self._sensitivities).end

    @property
    def sampled_sensitivity(self) -> np.ndarray:
        """Derivatives ``(N, n, m)`` of the samples in the parameters; as ``sensitivity``."""
        return self._sampled()[:, :, self.system.tangent_dimension :]

    @property
    def sampled_fundamental(self) -> np.ndarray:
        """Derivatives ``(N, n, n)`` of the samples in the start; as ``sensitivity``."""
        return self._sampled()[:, :, : self.system.tangent_dimension]

    def _sampled(self) -> np.ndarray:
        found = known(self._sensitivities)
        if found.samples is None:
            raise ArgumentError("This arc has no samples. Run simulate with samples= and sensitivities=.")
        return found.sampled

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
            rows = with_counters(self.fundamental, self.system.dimension)
            variables["fundamental"] = (("state", "tangent"), rows)
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
        inside = arguments.within(times, self.t[0], self.t[-1])
        if inside is None:
            raise ArgumentError(
                f"t must lie in the run, [{self.t[0]}, {self.t[-1]}]; got {times.min()} to {times.max()}."
            )
        flat = inside.ravel()
        if len(self._pieces.t) == 0:
            return np.broadcast_to(self.x[-1], (*times.shape, self.system.dimension)).copy()
        states, _ = self._pieces.at(flat)
        # A step ends at its jump, but the end of the run may be after it.
        states[flat >= self.t[-1]] = self.x[-1]
        return states.reshape(*times.shape, self.system.dimension)


def without_component(arc: HybridArc, i: int, system: HybridSystem) -> HybridArc:
    """The arc of a system that lacks component ``i``, which has tangent vectors, of that of the run."""
    fundamental, jumps, pieces = arc.fundamental, arc._jumps, arc._pieces
    if pieces is not None:
        pieces = attrs.evolve(pieces, blocks=[np.delete(each, i, axis=2) for each in pieces.blocks])
    return attrs.evolve(
        arc,
        system=system,
        x=np.delete(arc.x, i, axis=1),
        jumps=None if jumps is None else jumps.without_component(i, system),
        grazings=tuple(attrs.evolve(each, x=np.delete(each.x, i)) for each in arc.grazings),
        fundamental=None if fundamental is None else np.delete(fundamental, i, axis=0),
        pieces=pieces,
    )


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
