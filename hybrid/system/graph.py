"""The model as a graph: modes are nodes with smooth fields, transitions are edges with guards and resets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError, unknown_name
from hybrid.system.checks import authored, check_angles, check_cyclic, check_functions
from hybrid.system.declared import as_counters, as_cyclic, as_held, as_parameters, as_state
from hybrid.system.delayed import check_under_way, has_delays, written_out
from hybrid.system.described import described, described_in_html
from hybrid.system.elements import END, Mode, Transition
from hybrid.system.expansion import as_repeats, expanded
from hybrid.system.functions import ModelFunction, functions_in
from hybrid.system.given import (
    as_listed_order,
    as_modes,
    as_notes,
    as_period,
    as_transitions,
    as_under_way,
    check_derived_from,
    check_growth,
    check_laws,
    check_name,
)
from hybrid.system.growth import Growth
from hybrid.system.joined import check_elements, check_joined
from hybrid.system.laws import Laws, placed
from hybrid.system.members import shared_name
from hybrid.system.moving import moving_numbers
from hybrid.system.outputs import Output, as_outputs, check_outputs
from hybrid.system.periodicity import Period, period_at
from hybrid.system.portable import Portable
from hybrid.system.repeat import Repeat
from hybrid.system.switching import switching_inside
from hybrid.system.variables import Variables
from hybrid.system.watched import Watched

if TYPE_CHECKING:
    import networkx as nx


@attrs.frozen(eq=False, repr=False)
class HybridSystem(Portable):
    """A hybrid (piecewise-smooth) dynamical system: modes joined by transitions.

    Model functions are plain Python on scalars, ``f(t, x, p)``, with ``x.q`` and ``p.e`` by name and
    NumPy functions for mathematics. They must be pure: they are traced once, not called in the loop. A field
    should be smooth in its mode: tangent vectors are not valid beyond a jump of the field.

    Parameters
    ----------
    state
        Names of the components that fields move, or their number ``n`` (model functions then get a plain
        array). A field returns one rate for each of these, and for no other component.
    held
        Names of components without a field, such as a sampled control: they stay as they are until a reset
        changes them. Model functions read them from ``x``, behind the state, and tangent vectors have them.
    counters
        Names of whole numbers that resets alone change. Model functions read them from ``x``, last of all.
        They have no tangent vectors: no exponent or multiplier belongs to them, and orbits close whatever
        they count.
    parameters
        Default values by name; any call may override them.
    modes, transitions
        Nodes and edges. If guards are crossed at the same time, the transition listed first fires.
    listed_order
        Whether the order of ``transitions`` is meant to decide where guards are reached together. Otherwise
        the status of a run says AMBIGUOUS_ORDER if another order would have led elsewhere.
    start
        Name of the mode that a run starts in if the call names none. In a system that has been split it may
        be a mode from before: the run starts in the part that the state lies in.
    period
        Forcing period, a number or a function of ``p``. Every model function must have this period in
        ``t``, which is checked. Time is then stored as a number of whole periods and a phase.
    name
        For reports and figures.
    repeats
        Many of a kind, from `repeat`: their members become ordinary components, parameters and transitions
        when the system is made, behind those given here; a field given here returns the rates of ``state``
        alone. The attribute is empty afterwards: names such as ``cell[3].soc`` tell the members.
    units
        Units by name, of components of the state, of parameters, of outputs, and of time under the name
        ``"t"``; any may be left out. Results as datasets and pictures show them, and `hybrid.testing` checks
        that functions fit them; no run uses them.
    angles
        Components that are angles, with the length of a turn: ``{"phi": 2 * np.pi}``. A turn further the
        functions must be the same, which is checked; a reset may add whole turns. Orbits close, and
        attractors are near, up to whole turns. The state itself is never wrapped.
    cyclic
        Names of components along which the model is the same everywhere, such as a walker's position. A shift
        of one of them must change no field, guard and condition, and resets must shift with it, which is
        checked. Orbits close, and attractors are near, up to shifts (``orbit.shift``).
    outputs
        Quantities that follow from time, state and parameters, such as a contact force, by name:
        ``{"energy": lambda t, x, p: ...}``, or with a function for some of the modes,
        ``{"force": {"contact": lambda t, x, p: ...}}``; in a mode without one the output is nan. Their names
        work where the names of components do: ``arc["force"]``, pictures, datasets, `Laws`, ``units``. They
        are computed from results when asked for; a run never evaluates them.
    laws
        What the author knows of the runs, such as a conserved energy: `Laws`. The checks of
        `hybrid.testing` use them, and say so if one does not fit the system. `periodic_orbit` holds what is
        conserved at its value at the guess; no other calculation uses laws.

    Raises
    ------
    ModelError
        If names clash or do not exist, a mode cannot be reached, a function has the wrong arity or the
        wrong number of values, is not pure, or does not have the declared period.

    Examples
    --------
    >>> import hybrid
    >>> ball = hybrid.HybridSystem(
    ...     state=("q", "v"),
    ...     parameters={"g": 9.81, "e": 0.8},
    ...     modes=[hybrid.Mode("flight", lambda t, x, p: (x.v, -p.g))],
    ...     transitions=[
    ...         hybrid.Transition(
    ...             "flight",
    ...             "flight",
    ...             hybrid.Guard(lambda t, x, p: x.q, direction=-1),
    ...             hybrid.Reset(lambda t, x, p: {"v": -p.e * x.v}),
    ...             name="bounce",
    ...         )
    ...     ],
    ... )
    >>> len(hybrid.simulate(ball, (1.0, 0.0), (0.0, 3.0)).jumps)
    6

    A control that is sampled each 0.1, and the number of samples:

    >>> loop = hybrid.HybridSystem(
    ...     state=("x",),
    ...     held=("u",),
    ...     counters=("n",),
    ...     parameters={"k": 2.0},
    ...     modes=[hybrid.Mode("run", lambda t, x, p: (x.x + x.u,))],
    ...     transitions=[
    ...         hybrid.Transition(
    ...             "run",
    ...             "run",
    ...             hybrid.Every(0.1),
    ...             hybrid.Reset(lambda t, x, p: {"u": -p.k * x.x, "n": x.n + 1}),
    ...         )
    ...     ],
    ... )
    >>> arc = hybrid.simulate(loop, {"x": 1.0}, (0.0, 1.0), tangent=True)
    >>> arc["n"][-1].item(), arc.x.shape[1], arc.fundamental.shape
    (10.0, 3, (2, 2))
    """

    state: tuple[str, ...] | int = attrs.field(default=(), kw_only=True, converter=as_state)
    held: tuple[str, ...] = attrs.field(default=(), kw_only=True, converter=as_held)
    counters: tuple[str, ...] = attrs.field(default=(), kw_only=True, converter=as_counters)
    parameters: Mapping[str, float] = attrs.field(factory=dict, kw_only=True, converter=as_parameters)
    modes: tuple[Mode, ...] = attrs.field(kw_only=True, converter=as_modes)
    transitions: tuple[Transition, ...] = attrs.field(default=(), kw_only=True, converter=as_transitions)
    # It decides no result, but what the status says of one.
    listed_order: bool = attrs.field(default=False, kw_only=True, converter=as_listed_order, repr=False)
    period: Period = attrs.field(default=None, kw_only=True, converter=as_period)
    start: str | None = attrs.field(default=None, kw_only=True)
    name: str = attrs.field(default="", kw_only=True, validator=check_name)
    angles: Mapping[str, float] = attrs.field(factory=dict, kw_only=True, repr=False)
    cyclic: tuple[str, ...] = attrs.field(default=(), kw_only=True, converter=as_cyclic, repr=False)
    # Units decide no result, so systems that differ in them are the same model.
    units: Mapping[str, str] = attrs.field(factory=dict, kw_only=True, eq=False, repr=False)
    # Nor do outputs and laws.
    outputs: Mapping[str, Output] = attrs.field(
        factory=dict, kw_only=True, converter=as_outputs, eq=False, repr=False
    )
    laws: Laws = attrs.field(factory=Laws, kw_only=True, eq=False, repr=False, validator=check_laws)
    repeats: tuple[Repeat, ...] = attrs.field(
        default=(), kw_only=True, converter=as_repeats, eq=False, repr=False
    )
    # Lines for `repr`: what short names in a derived system stand for.
    notes: tuple[str, ...] = attrs.field(default=(), kw_only=True, converter=as_notes, repr=False)
    # Components that hold what delays have under way, which no author names.
    under_way: tuple[str, ...] = attrs.field(default=(), kw_only=True, converter=as_under_way, repr=False)
    # What makes further modes, for a system that is made in stages.
    growth: Growth | None = attrs.field(default=None, kw_only=True, validator=check_growth, repr=False)
    # What the functions read that this system was derived from.
    derived_from: Watched = attrs.field(
        factory=Watched, kw_only=True, validator=check_derived_from, eq=False, repr=False
    )
    # Cache of compile_system, with the lifetime of the system.
    _compiled: Any = attrs.field(default=None, init=False, repr=False)
    # The system with the time since the entry of a mode as a component, with the same lifetime.
    _aged: Any = attrs.field(default=None, init=False, repr=False)
    # The function that has made this system from another one, and its arguments, that one first.
    _made_by: Any = attrs.field(default=None, init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        if self.repeats:
            for name, value in {**expanded(self), "repeats": ()}.items():
                object.__setattr__(self, name, value)
        if not self.state:
            raise ModelError("HybridSystem: state needs at least one component; got an empty sequence.")
        if has_delays(self.transitions):
            self._write_out_delays()
        elif self.under_way:
            check_under_way(self.under_way, self.state_names, self.transitions)
        check_outputs(self.outputs, self.variables)
        object.__setattr__(self, "units", self.variables.as_units(self.units, self.outputs))
        self._check_graph()
        for output in self.outputs.values():
            output.check_modes(_written(self, "modes"))
        object.__setattr__(self, "angles", self.variables.as_angles(self.angles))
        object.__setattr__(self, "cyclic", self.variables.cyclic_names(self.cyclic, self.angles))
        unchecked = self._unchecked()
        check_functions(self.variables, unchecked, self.period)
        check_angles(self.variables, unchecked, self.turn_lengths)
        check_cyclic(self.variables, authored(unchecked) if self.cyclic else [], self.is_cyclic)

    def _write_out_delays(self) -> None:
        """Check what the author wrote, and put components for what is under way into the state."""
        own = Variables(self.state, self.parameters, self.held, self.counters)
        self._check_graph()
        functions = [each for _, each in functions_in(self.modes, self.transitions, own)]
        check_functions(own, functions, self.period)
        turns = own.as_angles(self.angles)
        check_angles(own, functions, np.array([turns.get(name, 0.0) for name in own.state_names]))
        cyclic = own.cyclic_names(self.cyclic, turns)
        check_cyclic(own, authored(functions), np.array([name in cyclic for name in own.state_names]))
        for name, value in written_out(self, own).items():
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._made_by is None:
            return Portable.__reduce__(self)
        function, *arguments = self._made_by
        return function, tuple(arguments)

    @property
    def is_whole(self) -> bool:
        """Whether the system has all its modes; one that grows may lack some that no run has reached."""
        growth = self.growth
        return growth is None or not any(
            each.target is None and growth.leads_on(each.name) for each in self.transitions
        )

    def _unchecked(self) -> list[ModelFunction]:
        """Every model function once, without those of earlier stages of a system that grows."""
        checked = {} if self.growth is None else self.growth.written
        functions = (function for _, function in functions_of(self))
        return [each for each in functions if checked.setdefault(("checked", *each.identity), each) is each]

    def __repr__(self) -> str:
        """The system in one table: state, parameters, modes and transitions."""
        return described(self)

    def _repr_html_(self) -> str:
        """The table of the system for a notebook."""
        return described_in_html(self)

    @cached_property
    def switching(self) -> dict[str, list[str]]:
        """By mode: the switching functions that its field applies to the state, away from its guards."""
        values = self.parameter_values()
        found: dict[str, list[str]] = {}
        for mode in self.modes:
            leaving = [each for each in self.transitions if each.source == mode.name and not each.clock]
            guards = [each.guard.function for each in leaving]
            names = switching_inside(self.variables, mode.field, guards, values)
            found |= {mode.name: names} if names else {}
        return found

    @cached_property
    def variables(self) -> Variables:
        """The state and the parameters, with the views of them that model functions get."""
        return Variables(self.state, self.parameters, self.held, self.counters, self.under_way)

    @property
    def dimension(self) -> int:
        """Number of components ``n`` of ``x``: those with a field, those held, counters."""
        return self.variables.dimension

    @property
    def tangent_dimension(self) -> int:
        """Number of components of a tangent vector: those of the state with a field, and those held."""
        return self.variables.tangent_dimension

    @cached_property
    def turn_lengths(self) -> np.ndarray:
        """Length of a turn of each component ``(n,)``, 0 for one that is no angle; read-only."""
        lengths = np.array([self.angles.get(name, 0.0) for name in self.state_names])
        lengths.flags.writeable = False
        return lengths

    @cached_property
    def is_cyclic(self) -> np.ndarray:
        """Whether each component ``(n,)`` is cyclic; read-only."""
        found = np.array([name in self.cyclic for name in self.state_names])
        found.flags.writeable = False
        return found

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of all components of ``x``; ``x0, x1, ...`` if only their number was given."""
        return self.variables.state_names

    @property
    def own_names(self) -> tuple[str, ...]:
        """Names of the components without those that hold what delays have under way."""
        return tuple(name for name in self.state_names if name not in self.under_way)

    @property
    def quantity_names(self) -> tuple[str, ...]:
        """Names of all components of ``x`` and of the outputs: what results may be asked for."""
        return (*self.state_names, *self.outputs)

    @cached_property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the modes in the order of their indices."""
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def transition_names(self) -> tuple[str, ...]:
        """Names of the transitions in the order of their indices."""
        return tuple(transition.name for transition in self.transitions)

    @cached_property
    def first_tick(self) -> tuple[int, ...]:
        """By transition: the place of the first number of its clock among those of all, and their count."""
        counts = (0 if each.clock is None else len(each.clock.quantities) for each in self.transitions)
        return tuple(accumulate(counts, initial=0))

    @cached_property
    def moving(self) -> tuple[tuple[int, ...], ...]:
        """By transition: the places among the numbers of its clock of those that resets may change."""
        return tuple(moving_numbers(each, self.variables) for each in self.transitions)

    @cached_property
    def aging(self) -> frozenset[str]:
        """Names of the modes, or of those that they are parts of, whose clocks count from the entry."""
        whole = {mode.name: mode.part_of or mode.name for mode in self.modes}
        return frozenset(
            whole[each.source] for each in self.transitions if each.clock and each.clock.counts_from_entry
        )

    @cached_property
    def age(self) -> int | None:
        """The component of the state that is the time since the entry of the mode, if there is one."""
        return next((each.clock.age for each in self.transitions if each.clock and each.clock.age), None)

    @cached_property
    def graph(self) -> nx.MultiDiGraph:
        """The modes and transitions as a networkx graph, to inspect, check or draw.

        Nodes have the attribute ``mode``. Edges have the transition's name as key and the attribute
        ``transition``. Transitions that end the run lead to the node ``"(end)"``, which has no mode.
        """
        import networkx as nx

        graph = nx.MultiDiGraph(name=self.name)
        for mode in self.modes:
            graph.add_node(mode.name, mode=mode)
        for transition in self.transitions:
            target = END if transition.target is None else transition.target
            graph.add_edge(transition.source, target, key=transition.name, transition=transition)
            if transition.accumulates_to is not None:
                limit = f"limit of {transition.name}"
                graph.add_edge(transition.source, transition.accumulates_to, key=limit, transition=transition)
        return graph

    def mode_index(self, name: str) -> int:
        """Index of a mode; an unknown name raises a ModelError that lists the modes."""
        if not isinstance(name, str) or name not in self.mode_names:
            raise ModelError(unknown_name("Mode", name, self.mode_names, "Modes"))
        return self.mode_names.index(name)

    def parts_of(self, name: str) -> list[int]:
        """Indices of the modes that are parts of a mode, or of the one mode of that name."""
        parts = self._parts.get(name) if isinstance(name, str) else None
        return [self.mode_index(name)] if parts is None else list(parts)

    @cached_property
    def _parts(self) -> dict[str, list[int]]:
        """Indices of the modes by their names, and by the names of what they are parts of."""
        found: dict[str, list[int]] = {}
        for i, mode in enumerate(self.modes):
            for name in filter(None, dict.fromkeys((mode.name, mode.part_of))):
                found.setdefault(name, []).append(i)
        return found

    @cached_property
    def whole_modes(self) -> tuple[str, ...]:
        """Names of the modes before the system was split, in order."""
        return tuple(dict.fromkeys(mode.part_of or mode.name for mode in self.modes))

    def copies_of(self, name: str) -> list[int]:
        """Indices of the transitions that are copies of a transition, or of the one of that name.

        ``cell.empty`` is the name for those of all members of a repeat.
        """
        copies = []
        if isinstance(name, str):
            copies = [
                i
                for i, each in enumerate(self.transitions)
                if name in (each.name, each.part_of, shared_name(each.part_of or each.name))
            ]
        return copies or [self.transition_index(name)]

    def transition_index(self, name: str | Transition) -> int:
        """Index of a transition, by name or object; a ModelError lists the names if it does not exist."""
        key = name.name if isinstance(name, Transition) else name
        if not isinstance(key, str) or key not in self.transition_names:
            raise ModelError(unknown_name("Transition", key, self.transition_names, "Transitions"))
        return self.transition_names.index(key)

    def parameter_values(self, overrides: Mapping[str, float] | None = None) -> np.ndarray:
        """Parameter vector ``(m,)`` with the overrides applied; unknown names raise an ArgumentError."""
        return self.variables.parameter_values(overrides)

    def forcing_period(self, overrides: Mapping[str, float] | None = None) -> float | None:
        """Forcing period at the given parameters, or None if the system declares none."""
        if self.period is None:
            return None
        return period_at(self.period, self.variables, self.parameter_values(overrides))

    def _check_graph(self) -> None:
        check_elements(self.modes, self.transitions)
        if self.start is not None:
            check_mode(self, self.start, "HybridSystem: start mode")
        if self.is_whole:
            # The modes between those of a stage may not have been made yet.
            check_joined(self.mode_names, self.transitions)


def check_mode(system: HybridSystem, name: object, what: str = "Mode") -> None:
    """ModelError unless a run may start in a mode of that name; ``what`` begins the text."""
    names = _written(system, "modes")
    if not isinstance(name, str) or name not in names:
        raise ModelError(unknown_name(what, name, names, "Modes"))


def laws_of(system: HybridSystem, given: Laws | None = None) -> Laws:
    """The laws that a system carries, and others, with their names looked up.

    Raises
    ------
    ArgumentError, ModelError
        If a law does not fit the system, or names an output that the system does not have.
    """
    if given is not None:
        arguments.instance("laws", given, Laws, "Write Laws(conserved=...), or leave it out.")
    laws = system.laws if given is None else system.laws.joined(given)
    names = _written(system, "modes"), _written(system, "transitions")
    return placed(laws, system.variables, system.outputs, *names)


def _written(system: HybridSystem, what: str) -> dict[str, None]:
    """Names of the modes or transitions, and of those that they are parts of."""
    elements = getattr(system, what)
    names = [*(each.name for each in elements), *(each.part_of for each in elements if each.part_of)]
    if system.growth is not None and system.growth.original is not None:
        # No part of a mode may have been made yet.
        names += [each.name for each in getattr(system.growth.original, what)]
    return dict.fromkeys(names)


def starting_mode(system: HybridSystem, mode: str | None) -> str | None:
    """The mode that a call names, or the only one, or ``start``; None if the guards choose it."""
    if mode is not None:
        return mode
    return system.mode_names[0] if len(system.modes) == 1 and system.is_whole else system.start


def functions_of(system: HybridSystem) -> Iterator[tuple[int, ModelFunction]]:
    """Every model function with the index of its mode or transition, fields first."""
    return functions_in(system.modes, system.transitions, system.variables)


def watched_by(system: HybridSystem) -> Watched:
    """The values that the functions of a system read now from elsewhere."""
    functions = [function for _, function in functions_of(system)]
    period = system.period if callable(system.period) else None
    return Watched([*(each.function for each in functions), *(each.derivative for each in functions), period])


def watched_below(system: HybridSystem) -> Watched:
    """The values that decide a system that is made from this one: what this one and those below it read."""
    return watched_by(system).joined(system.derived_from)


def as_system(name: str, value: object) -> HybridSystem:
    """A system, or an ArgumentError that begins with the name of the argument."""
    return arguments.instance(name, value, HybridSystem, "Call the model's factory first.")
