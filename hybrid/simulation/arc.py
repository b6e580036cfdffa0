"""Solutions over hybrid time: smooth pieces joined by jumps (Goebel, Sanfelice and Teel 2012)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from html import escape
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.display.tables import counted, html_table
from hybrid.errors import ArgumentError
from hybrid.simulation.end import ArcEnd, end_without_component
from hybrid.simulation.jumps import Grazing, Jumps, Sensitivities, known
from hybrid.simulation.labelled import Names, attributes, with_counters, with_outputs
from hybrid.simulation.points import Pieces, Samples, Steps
from hybrid.simulation.quantities import Asked, members, quantity, slopes_of, table_of, values_of
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

# The fields that are made when somebody asks, and where they are found.
MADE_LATER = {
    "parameters": attrgetter("course.parameters"),
    "t": attrgetter("t"),
    "j": attrgetter("j"),
    "x": attrgetter("x"),
    "_mode_index": attrgetter("mode"),
    "_jumps": attrgetter("jumps"),
    "status": attrgetter("course.status"),
    "_pieces": attrgetter("pieces"),
    "end": attrgetter("course.go_on"),
}


@attrs.frozen(eq=False, repr=False, slots=False)
class HybridArc(Asked):
    """A solution over hybrid time ``(t, j)``; ``arc["q"]`` is one component of the state, or an output.

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
    end
        Where the run ended, for a run that goes on from there: :class:`ArcEnd`.

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
    end: ArcEnd
    _sensitivities: Sensitivities | None = None

    @classmethod
    def of_run(cls, points: Steps | Samples, **known: Any) -> HybridArc:
        """The arc of a run from what it kept: all fields that are not ``known`` are made of this."""
        arc = object.__new__(cls)
        arc.__dict__.update(known, _sensitivities=None, _made_of=points)
        return arc

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A field that is made later, when somebody first asks for it."""
            made_of = self.__dict__.get("_made_of")
            if made_of is None or name not in MADE_LATER:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            # Another thread may have made it too: all see one object.
            return self.__dict__.setdefault(name, MADE_LATER[name](made_of))

    def __getstate__(self) -> dict[str, Any]:
        """All fields, made by now: what they are made of stays where the run was."""
        return {field.name: getattr(self, field.name) for field in attrs.fields(type(self))}

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

    def fundamental_of(self, name: str) -> np.ndarray:
        """Derivatives ``(k,)`` of a component or an output at the end along the tangent vectors.

        Those of an output are ``D_x h`` times ``fundamental``.

        Raises
        ------
        ArgumentError
            If the run had no tangent vectors, or there is no such name.
        """
        quantity("name: ", name, self.system)
        if self.fundamental is None:
            raise ArgumentError("This arc has no tangent vectors. Run simulate with tangent=True.")
        return self._along(name, self.fundamental[None], slice(-1, None))[0]

    def sensitivity_of(self, name: str) -> np.ndarray:
        """Derivatives ``(m,)`` of a component or an output at the end in the parameters; as ``sensitivity``.

        Those of an output are ``D_x h`` times ``sensitivity``, plus ``D_p h``.

        Raises
        ------
        ArgumentError
            If the run had no ``sensitivities``, or there is no such name.
        """
        return self._in_parameters(name, self.sensitivity[None], slice(-1, None))[0]

    def sampled_fundamental_of(self, name: str) -> np.ndarray:
        """Derivatives ``(N, n)`` of a component or an output at the samples in the start."""
        return self._along(name, self.sampled_fundamental)

    def sampled_sensitivity_of(self, name: str) -> np.ndarray:
        """Derivatives ``(N, m)`` of a component or an output at the samples in the parameters."""
        return self._in_parameters(name, self.sampled_sensitivity)

    def _along(self, name: str, tangents: np.ndarray, points: slice = slice(None)) -> np.ndarray:
        """Derivatives ``(N, k)`` of a name along tangent vectors ``(N, n, k)`` at points of the arc."""
        slopes = self._slopes(name, points)[:, : self.system.tangent_dimension]
        return np.einsum("ij,ijk->ik", slopes, tangents)

    def _in_parameters(self, name: str, tangents: np.ndarray, points: slice = slice(None)) -> np.ndarray:
        own = [*self.system.parameters]
        places = [self.system.dimension + own.index(each) for each in known(self._sensitivities).names]
        return self._along(name, tangents, points) + self._slopes(name, points)[:, places]

    def _slopes(self, name: str, points: slice) -> np.ndarray:
        """Derivatives ``(N, n + m)`` of a name in the state and in the parameters."""
        quantity("name: ", name, self.system)
        places = self.t[points], self.x[points], self._mode_index[points]
        return slopes_of(self.system, name, *places, self._values)

    def _sampled(self) -> np.ndarray:
        found = known(self._sensitivities)
        if found.samples is None:
            raise ArgumentError("This arc has no samples. Run simulate with samples= and sensitivities=.")
        return found.sampled

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """What measures have found of the components and outputs that they were asked for, by name."""
        return {}

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

        If the system has outputs they are in ``outputs`` (axes ``t`` and ``output``). Without ``samples`` a
        time occurs twice at each jump, with both states; ``arc.jumps.to_xarray()`` has the jumps.
        ``.to_netcdf(path)`` or ``.to_zarr(path)`` saves the dataset, and `open_store` reads it.
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
        found = xarray.Dataset(variables, coords, made_by)
        return with_outputs(found, self.system, {"outputs": (("t",), self._table(self.system.outputs))})

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:.6g} to {self.t[-1]:.6g}" if len(self.t) else "no points"
        return f"<HybridArc {span}, {counted(self.jump_count, 'jump')}, {self.status.brief}>"

    def _repr_html_(self) -> str:
        """The arc for a notebook: how it ended, and its end by name."""
        if not len(self.t):
            return f"<p>{escape(repr(self))}</p>"
        names = self.system.quantity_names
        table = self._table(names, np.array([0, -1]))
        ends = [
            [f"{self.t[i]:.6g}", str(self.mode[i]), *(f"{value:.6g}" for value in table[i])] for i in (0, -1)
        ]
        names = ("t", "mode", *names)
        return f"<p>{escape(repr(self))}</p>\n<p>{escape(str(self.status))}</p>\n{html_table(names, ends)}"

    def _table(self, names: Iterable[str], points: Any = slice(None)) -> np.ndarray:
        """Components and outputs at points of the arc, ``(N, len(names))``."""
        places = self.t[points], self.x[points], self._mode_index[points]
        return table_of(self.system, [*names], *places, self._values)

    @property
    def _values(self) -> np.ndarray:
        """The parameter vector ``(m,)``."""
        return self.system.parameter_values(self.parameters)

    def __call__(self, t: ArrayLike, name: str | None = None) -> np.ndarray:
        """State at time ``t``, a scalar or an array, from the dense output: ``t.shape + (n,)``.

        At the time of a jump this is the state after it. With the ``name`` of a component or of an output it
        is that one alone, ``t.shape``; a name for all members of a repeat gives ``t.shape + (members,)``.

        Raises
        ------
        ArgumentError
            If a time lies outside the run, the run kept samples only, or there is no such name.
        """
        times = arguments.numbers("t", t, "be a time or an array of times")
        if name is not None and not members(name, self.system):
            quantity("name: ", name, self.system)
        if self._pieces is None:
            raise ArgumentError(
                "This arc keeps samples only. Run simulate without samples= for dense output."
            )
        inside = arguments.within(times, self.t[0], self.t[-1])
        if inside is None:
            raise ArgumentError(
                f"t must lie in the run, [{self.t[0]}, {self.t[-1]}]; got {times.min()} to {times.max()}."
            )
        states, modes = self._dense(inside.ravel())
        if name is None:
            return states.reshape(*times.shape, self.system.dimension)
        found = values_of(self.system, name, inside.ravel(), states, modes, self._values)
        return found.reshape(times.shape + found.shape[1:])

    def _dense(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States ``(N, n)`` and indices of the modes ``(N,)`` at times in the run."""
        assert self._pieces is not None
        if len(self._pieces.t) == 0:
            ends = np.full(len(times), -1)
            return self.x[ends], self._mode_index[ends]
        states, steps = self._pieces.at(times)
        modes = self._pieces.mode[steps]
        # A step ends at its jump, but the end of the run may be after it.
        states[times >= self.t[-1]], modes[times >= self.t[-1]] = self.x[-1], self._mode_index[-1]
        return states, modes


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
        end=end_without_component(arc.end, i),
    )
