"""Jumps and touches of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Protocol, overload

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.display.tables import counted, html_table
from hybrid.errors import ArgumentError
from hybrid.kernels.types.codes import AT
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.quantities import members, quantity, values_of
from hybrid.simulation.saltation import matrices_at
from hybrid.system.elements import END
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

# In the order of the kernel's codes.
KINDS = ("transverse", "grazing", "limit")
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
    row
        Of the listed times of an `At`, or of its table, the number of the one that fired; None for others.

    Examples
    --------
    >>> import hybrid, models
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    >>> jump = arc.jumps[0]
    >>> jump.transition, round(jump.t, 4), jump.kind
    ('bounce', 0.4515, 'transverse')
    >>> jump.saltation.round(3)
    array([[-0.8  ,  0.   ],
           [ 3.987, -0.8  ]])
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
    row: int | None
    _all: Jumps = attrs.field(repr=False)

    @property
    def saltation(self) -> np.ndarray:
        """Saltation matrix ``(n, n)``: what the jump does to tangent vectors, to first order.

        Counters have no rows and columns in it.

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

    Examples
    --------
    >>> import hybrid
    >>> ceiling = hybrid.Guard(lambda t, x, p: x.q, direction=+1)
    >>> toss = hybrid.HybridSystem(
    ...     state=("q", "v"),
    ...     modes=[hybrid.Mode("flight", lambda t, x, p: (x.v, -1.0))],
    ...     transitions=[hybrid.Transition("flight", None, ceiling, name="ceiling")],
    ... )
    >>> arc = hybrid.simulate(toss, (-0.5, 1.0), (0.0, 2.0))
    >>> touch = arc.grazings[0]
    >>> touch.transition, round(touch.t, 6), round(touch.acceleration, 6), len(arc.jumps)
    ('ceiling', 1.0, -1.0, 0)
    """

    t: float
    j: int
    transition: str
    x: np.ndarray
    value: float
    acceleration: float


class Sensitivities(Protocol):
    """What knows the derivatives of a run: `hybrid.simulation.sensitivity`."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        ...

    @property
    def samples(self) -> np.ndarray | None:
        """Times of the samples, if there are any."""
        ...

    @property
    def end(self) -> np.ndarray:
        """Derivatives ``(n, m)`` of the last state in the parameters."""
        ...

    @property
    def sampled(self) -> np.ndarray:
        """Derivatives ``(N, n, n + m)`` of the samples in the start and in the parameters."""
        ...

    @property
    def times(self) -> np.ndarray:
        """Derivatives ``(jumps, n + m)`` of the times of jumps."""
        ...


def known(sensitivities: Sensitivities | None) -> Sensitivities:
    """The derivatives of a run, or an ArgumentError if it has none."""
    if sensitivities is None:
        raise ArgumentError("This run has no derivatives in parameters. Run simulate with sensitivities=.")
    return sensitivities


@attrs.frozen(eq=False, repr=False)
class Jumps(Sequence[Jump]):
    """The jumps of an arc in order; ``jumps["impact"]`` are those of one transition, or of all its copies.

    ``jumps["cell.empty"]`` are those of all members of a repeat, ``jumps["cell[3].empty"]`` those of one.

    Each :class:`Jump` is made when it is looked at; the arrays hold all of them.

    Attributes
    ----------
    t
        Times ``(jumps,)``.
    transversality
        As in :class:`Jump`, ``(jumps,)``.
    """

    system: HybridSystem
    _parameters: np.ndarray
    t: np.ndarray
    _phase: np.ndarray
    _transition: np.ndarray
    transversality: np.ndarray
    _kind: np.ndarray
    _has_matrix: np.ndarray
    _row: np.ndarray
    _states: np.ndarray
    _recorded: np.ndarray
    _sensitivities: Sensitivities | None = None

    @property
    def t_sensitivity(self) -> np.ndarray:
        """Derivatives ``(jumps, m)`` of the times in the parameters that ``sensitivities=`` names.

        Each is ``-(D_x g X + D_p g) / (D_t g + D_x g f)`` with the derivatives ``X`` of the state before the
        jump; nan for the limit of a chatter.

        Raises
        ------
        ArgumentError
            If the run had no ``sensitivities``.
        """
        return known(self._sensitivities).times[:, self.system.tangent_dimension :]

    @property
    def t_gradient(self) -> np.ndarray:
        """Derivatives ``(jumps, n)`` of the times in the start; as ``t_sensitivity``."""
        return known(self._sensitivities).times[:, : self.system.tangent_dimension]

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

    def before(self, name: str) -> np.ndarray:
        """A component or an output before the jumps, in the modes that they leave, ``(jumps,)``.

        A name for all members of a repeat gives ``(jumps, members)``.

        Raises
        ------
        ArgumentError
            If there is no such name.
        """
        sources = [self.system.mode_index(each.source) for each in self.system.transitions]
        return self._quantity(name, self.x_minus, np.array(sources, dtype=np.int64)[self._transition])

    def after(self, name: str) -> np.ndarray:
        """A component or an output after the jumps, in the modes that they lead to, ``(jumps,)``.

        After a jump that ends the run, this is the mode before it.

        Raises
        ------
        ArgumentError
            If there is no such name.
        """
        targets = [self.system.mode_index(each.target or each.source) for each in self]
        return self._quantity(name, self.x_plus, np.array(targets, dtype=np.int64))

    def _quantity(self, name: str, x: np.ndarray, mode: np.ndarray) -> np.ndarray:
        if not members(name, self.system):
            quantity("name: ", name, self.system)
        return values_of(self.system, name, self.t, x, mode, self._parameters)

    @cached_property
    def saltation(self) -> np.ndarray:
        """As in :class:`Jump`, ``(jumps, n, n)``; those that the run did not need are made when looked at."""
        missing, k = np.flatnonzero(self._has_matrix == 0), self.system.tangent_dimension
        recorded = self._recorded[:, :k, :k]
        if not missing.size:
            return recorded
        fired, phases = self.transition_index[missing].tolist(), self._phase[missing].tolist()
        parameters = dict(zip(self.system.parameters, self._parameters.tolist(), strict=True))
        model = compile_system(self.system).model(parameters)
        matrices = np.empty((len(self), k, k))
        matrices[self._has_matrix == 1] = recorded
        states, rows = np.ascontiguousarray(self.x_minus[missing]), self._row[missing].tolist()
        matrices[missing], _ = matrices_at(self.system, model, fired, phases, states, rows)
        return matrices

    @cached_property
    def row(self) -> np.ndarray:
        """As in :class:`Jump`, ``(jumps,)``; -1 for None."""
        listed = [each.clock is not None and each.clock.number == AT for each in self.system.transitions]
        return np.where(np.array(listed)[self.transition_index], self._row, -1)

    def without_component(self, i: int, system: HybridSystem) -> Jumps:
        """The jumps of a system that lacks component ``i``, which has tangent vectors, of that of the run."""
        matrices = np.delete(np.delete(self._recorded, i, axis=1), i, axis=2)
        return attrs.evolve(self, system=system, states=np.delete(self._states, i, axis=2), recorded=matrices)

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
        if np.any(self.row >= 0):
            variables["row"] = ("jump", self.row)
        found = xarray.Dataset(variables, names.coords(), attributes("jumps", system=self.system))
        sides = {"outputs_minus": self.before, "outputs_plus": self.after}
        tables = {
            variable: (("jump",), np.array([side(name) for name in self.system.outputs]).T)
            for variable, side in sides.items()
        }
        return with_outputs(found, self.system, tables)

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
            None if self.row[i] < 0 else int(self.row[i]),
            self,
        )
