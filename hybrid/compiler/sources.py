"""What the facts of a system are found from: its functions as statements, their guards, their series."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import attrs

from hybrid.compiler.bounds.forcing import Forcing, forcings
from hybrid.compiler.bounds.residues import Residue, residues
from hybrid.compiler.emitted import NO_SERIES, Propagator, Series
from hybrid.compiler.places import Places, places_of
from hybrid.compiler.propagators.choice import propagator
from hybrid.compiler.propagators.equations import Boundary, known_positive
from hybrid.compiler.readers import is_free
from hybrid.compiler.rows import place_of_row
from hybrid.compiler.steep import fields_at_crossings, steep_at_guards
from hybrid.compiler.tables import Tables
from hybrid.compiler.traced import period_of
from hybrid.compiler.writer import Writer
from hybrid.compiler.written import Written, beyond_guards
from hybrid.expression.graph import nodes_of
from hybrid.expression.nodes import Expression, Symbol
from hybrid.expression.operations import JUMPING
from hybrid.expression.periodicity import is_periodic
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.tracing import Symbols
from hybrid.system.functions import (
    condition_function,
    field_function,
    guard_function,
    number_functions,
    reset_function,
)

if TYPE_CHECKING:
    from hybrid.system.elements import Transition
    from hybrid.system.graph import HybridSystem


@attrs.frozen(eq=False)
class Sources:
    """What the facts of a system are found from; each is found when a fact first asks for it.

    Attributes
    ----------
    system, writer
        The system, and what makes statements of its functions.
    """

    system: HybridSystem
    writer: Writer

    @property
    def symbols(self) -> Symbols:
        """The symbols of all functions."""
        return self.writer.symbols

    @cached_property
    def fields(self) -> list[Written]:
        """By mode."""
        return [self.writer.write(field_function(mode, self.system.variables)) for mode in self.system.modes]

    @cached_property
    def guards(self) -> list[Written]:
        """By transition."""
        return [self.writer.write(guard_function(each)) for each in self.system.transitions]

    @cached_property
    def conditions(self) -> list[Written]:
        """By transition; nothing where there is none."""
        functions = map(condition_function, self.system.transitions)
        return [Written([], [], []) if each is None else self.writer.condition(each) for each in functions]

    @cached_property
    def resets(self) -> list[Written]:
        """By transition; the identity where there is none."""
        functions = (reset_function(each, self.system.variables) for each in self.system.transitions)
        return [self.writer.identity() if each is None else self.writer.write(each) for each in functions]

    @cached_property
    def numbers(self) -> list[Written]:
        """The numbers of the clocks that move."""
        functions = number_functions(self.system.transitions, self.system.variables)
        return [self.writer.condition(each) for each in functions]

    @cached_property
    def boundaries(self) -> list[list[Boundary]]:
        """By mode: the guards that are searched in it."""
        pairs = [*zip(self.system.transitions, self.guards, strict=True)]
        return [
            [
                Boundary(
                    None if written.expressions is None else written.expressions[0],
                    -transition.guard.direction if _ends_mode(transition) else 0,
                    is_affine(written, self.symbols.variables),
                )
                for transition, written in pairs
                if transition.source == mode.name and transition.is_searched
            ]
            for mode in self.system.modes
        ]

    @cached_property
    def propagators(self) -> list[Propagator]:
        """By mode."""
        return [
            self.writer.remembered(
                ("propagator", id(mode.field), tuple(around)),
                partial(propagator, field.expressions, around, self.symbols),
            )
            for mode, field, around in self._by_mode
        ]

    @cached_property
    def evaluated(self) -> list[Written]:
        """The fields as they are evaluated, also beyond the guards of their modes."""
        return [
            self.writer.remembered(
                ("beyond", id(mode.field), id(mode.jacobian), tuple(around)),
                partial(beyond_guards, field, around, self.symbols),
            )
            for mode, field, around in self._by_mode
        ]

    @cached_property
    def steep(self) -> list[list[Expression]]:
        """By mode: what has an infinite slope at its guards."""
        return [
            self.writer.remembered(
                ("steep", id(mode.field), tuple(around)),
                partial(steep_at_guards, field.expressions, around, self.symbols),
            )
            for mode, field, around in self._by_mode
        ]

    @property
    def _by_mode(self) -> list[tuple[Any, Written, list[Boundary]]]:
        return [*zip(self.system.modes, self.fields, self.boundaries, strict=True)]

    @cached_property
    def rates(self) -> list[tuple[Written, Any]]:
        """By mode: its field, and what is known to be positive inside the mode."""
        return [(field, known_positive(around)) for _, field, around in self._by_mode]

    @cached_property
    def crossing(self) -> tuple[Any, Any]:
        """The fields before and behind each transition, and the statements of further ones."""
        return fields_at_crossings(
            self.system, self.fields, self.steep, self.guards, self.resets, self.boundaries, self.symbols
        )

    @cached_property
    def clocks(self) -> list[bool]:
        """By transition: whether it is a clock, whose zeros are known: only its gradient is asked for."""
        return [transition.clock is not None for transition in self.system.transitions]

    @cached_property
    def crossed(self) -> list[Written]:
        """The guards that are no clocks."""
        return [guard for clock, guard in zip(self.clocks, self.guards, strict=True) if not clock]

    @cached_property
    def affine(self) -> tuple[bool, ...]:
        """By transition: whether the gradient of the guard depends on parameters alone."""
        pairs = zip(self.clocks, self.guards, strict=True)
        return tuple(clock or is_affine(guard, self.symbols.variables) for clock, guard in pairs)

    @cached_property
    def traced(self) -> list[Expression | None]:
        """By transition: the guard as an expression; None if it was not traced."""
        return [None if guard.expressions is None else guard.expressions[0] for guard in self.guards]

    @cached_property
    def series(self) -> list[Series]:
        """By mode."""
        return [each.series for each in self.propagators]

    @cached_property
    def abreast(self) -> list[Series]:
        """By mode: the series of several runs at once."""
        return [each.abreast or NO_SERIES for each in self.propagators]

    @cached_property
    def places(self) -> Places:
        """Where the columns of the series lie."""
        return places_of(self.series, with_room=self.system.growth is not None)

    @cached_property
    def places_abreast(self) -> Places:
        """Where the columns of the series of several runs lie."""
        return places_of(self.abreast, with_room=self.system.growth is not None, whole=1)

    @cached_property
    def surfaces(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """By transition: the number of the zero set of its guard, and the sign of that there."""
        return self.writer.surfaces(self.traced)

    @cached_property
    def forcings(self) -> list[Sequence[Forcing]]:
        """By mode: the terms of its field in which a pulse may hide."""
        return [forcings(field.expressions, known, self.symbols) for field, known in self.rates]

    @cached_property
    def residues(self) -> list[Sequence[Residue]]:
        """By mode: its rates that may cancel to their rounding."""
        return [
            residues(field.expressions, self._gradients(mode.name), self.symbols)
            for field, mode in zip(self.fields, self.system.modes, strict=True)
        ]

    def _gradients(self, mode: str) -> list[Sequence[Expression] | None]:
        """The gradients of the guards in a mode; None for one that is not traced."""
        pairs = zip(self.system.transitions, self.guards, strict=True)
        written = [guard for transition, guard in pairs if transition.source == mode and not transition.clock]
        return [None if guard.jacobian is None or guard.given else guard.jacobian[0] for guard in written]

    @cached_property
    def row(self) -> int:
        """The place of the row of a schedule behind the parameters; -1 if none is read."""
        return place_of_row([*self.guards, *self.conditions, *self.resets], len(self.system.parameters))

    @cached_property
    def tables(self) -> Tables:
        """The numbers of tables, which lie behind the parameters."""
        return Tables(len(self.system.parameters) + (self.row >= 0))

    @property
    def has_proved_period(self) -> bool:
        """Whether all traced functions are proved to have the declared period, at any parameters."""
        if self.system.period is None:
            return True
        period = period_of(self.system, self.writer.traces)
        if period is None:
            return False
        written = [*self.fields, *self.crossed, *self.conditions, *self.resets]
        t = self.symbols.t
        return all(
            each.expressions is not None and is_periodic(each.expressions, t, period) for each in written
        )

    @property
    def guards_in_series(self) -> tuple[bool, ...]:
        """By transition: whether the series of its mode hold its guard; none follow guards of a start."""
        pairs = zip(self.system.mode_names, self.propagators, strict=True)
        held = {mode: iter(each.guards) for mode, each in pairs}
        return tuple(each.is_searched and next(held[each.source], False) for each in self.system.transitions)


def first_of(groups: Sequence[Sequence[Any]]) -> tuple[int, ...]:
    """The first number of each group, if all are counted on, and behind them the number of all."""
    return tuple(accumulate(map(len, groups), initial=0))


def _ends_mode(transition: Transition) -> bool:
    """Whether no state beyond the guard stays in the mode."""
    return transition.source != transition.target and transition.guard.when is None


def is_affine(written: Written, variables: Sequence[Symbol]) -> bool:
    """Whether the derivative in the variables, which come first, is proved to depend on none of them."""
    if written.expressions is None or written.jacobian is None:
        return False
    # A floor or a sign has slope zero on both sides of its jumps.
    jumps = nodes_of((*JUMPING, Tabulated), *written.expressions)
    entries = [entry for row in written.jacobian for entry in row[: len(variables)]]
    return is_free(jumps, variables) and is_free(entries, variables)
