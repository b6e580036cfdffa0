"""What decides at a state: speeds and accelerations at the contacts, and how forces act on them.

As expressions, and as their values at a state.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.expression.evaluation import Program, scalar
from hybrid.expression.graph import all_replaced
from hybrid.expression.linear import dot
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.expression.operations import Absolute, Maximum, sqrt
from hybrid.system.outputs import Formula, Output
from hybrid.transform.contacts.equations import Equations, Space
from hybrid.transform.contacts.kinematics import Kinematics, Row
from hybrid.transform.contacts.problem import Level
from hybrid.transform.contacts.statuses import FREE

# Names of the forces of a contact.
FORCES = "normal", "tangential"


@attrs.frozen(eq=False)
class View:
    """Speeds and accelerations at contacts; rows are the normal and tangential directions of all contacts.

    Attributes
    ----------
    gaps
        By contact.
    speeds, accelerations
        By rows, without forces and impulses of contacts.
    fast, strong
        By rows: how large they could be at the same kinetic energy, or effort of the forces (Cauchy-Schwarz);
        a small share of that is rounding.
    restitution, friction, static
        Coefficients by contact.
    delassus
        ``W M^-1 W^T`` by rows.
    effects
        ``M^-1 W^T`` by rows: the accelerations that a unit of force gives.
    velocities, free
        The velocities, and the accelerations of the coordinates without forces of contacts.
    """

    gaps: list[Any]
    speeds: list[Any]
    accelerations: list[Any]
    fast: list[Any]
    strong: list[Any]
    restitution: list[Any]
    friction: list[Any]
    static: list[Any]
    delassus: list[list[Any]]
    effects: list[list[Any]]
    velocities: list[Any]
    free: list[Any]

    @property
    def listed(self) -> list[Any]:
        """All entries in one list."""
        found: list[Any] = []
        for name in attrs.asdict(self, recurse=False):
            for each in getattr(self, name):
                found += each if isinstance(each, list) else [each]
        return found

    def filled(self, values: Sequence[Any]) -> View:
        """The view with other entries, in the order of ``listed``."""
        source = iter(values)
        made = []
        for name in attrs.asdict(self, recurse=False):
            made.append(
                [
                    [next(source) for _ in each] if isinstance(each, list) else next(source)
                    for each in getattr(self, name)
                ]
            )
        return View(*made)

    def moved(self, forces: Sequence[Any], rows: Sequence[int], start: Sequence[Any]) -> list[Any]:
        """Velocities or accelerations ``start`` with impulses or forces on rows."""
        own = [self.effects[row] for row in rows]
        return [each + dot([effect[i] for effect in own], forces) for i, each in enumerate(start)]


@attrs.frozen(eq=False)
class Mechanics:
    """The equations of motion and the contacts, as expressions."""

    space: Space
    equations: Equations
    contacts: tuple[Kinematics, ...]

    @cached_property
    def places(self) -> list[tuple[int, int | None]]:
        """By contact: the rows of its normal and its tangential direction."""
        found, row = [], 0
        for each in self.contacts:
            across = None if each.tangential is None else row + 1
            found.append((row, across))
            row += len(each.rows)
        return found

    @cached_property
    def rows(self) -> list[Row]:
        """The directions of all contacts."""
        return [row for each in self.contacts for row in each.rows]

    @cached_property
    def view(self) -> View:
        """What decides, as expressions."""
        space = self.space
        free, *effects = self.equations.accelerations(
            [self.equations.forces, *(row.weights for row in self.rows)]
        )
        u = [*space.u]
        delassus = [[node(dot(row.weights, effect)) for effect in effects] for row in self.rows]
        energy = dot(u, [dot(row, u) for row in self.equations.mass])
        effort = dot(free, self.equations.forces)
        return View(
            gaps=[each.gap for each in self.contacts],
            speeds=[row.speed(u) for row in self.rows],
            accelerations=[node(dot(row.weights, free)) + row.bias for row in self.rows],
            fast=[_length(delassus[i][i], energy) + Absolute(row.drift) for i, row in enumerate(self.rows)],
            strong=[_length(delassus[i][i], effort) + Absolute(row.bias) for i, row in enumerate(self.rows)],
            restitution=[each.restitution for each in self.contacts],
            friction=[each.friction for each in self.contacts],
            static=[each.static for each in self.contacts],
            delassus=delassus,
            effects=effects,
            velocities=u,
            free=free,
        )

    @property
    def outputs(self) -> dict[str, Output]:
        """What is told of contacts, in the mode without any that is closed."""
        found = {}
        for each in self.contacts:
            name = each.contact.name
            found[f"{name}.gap"] = Output(f"{name}.gap", (Formula(None, scalar(each.gap)),))
            for what in FORCES if each.contact.has_friction else FORCES[:1]:
                found[f"{name}.{what}"] = Output(f"{name}.{what}", (Formula(FREE, scalar(ZERO)),))
        return found

    @property
    def given(self) -> list[Expression]:
        """What the author gives: masses, forces, gaps, slips and coefficients."""
        found = [*(each for row in self.equations.mass for each in row), *self.equations.forces]
        for each in self.contacts:
            found += [each.gap, each.restitution, each.friction, each.static]
            for row in each.rows:
                found += [*row.weights, row.drift]
        return found

    @cached_property
    def _program(self) -> Program:
        return Program(self.view.listed)

    def at(self, t: float, x: np.ndarray, parameters: np.ndarray) -> View:
        """What decides at a state, in numbers."""
        with np.errstate(all="ignore"):
            values = self._program.run(self.space.values(t, x, parameters))
        return self.view.filled([float(each) for each in values])

    def with_velocities(self, velocities: Sequence[Expression]) -> View:
        """What decides if the velocities are these."""
        changed = dict(zip(self.space.u, velocities, strict=True))
        return self.view.filled(all_replaced(self.view.listed, changed))

    def rows_of(self, contacts: Sequence[int]) -> list[int]:
        """The rows of some contacts."""
        return [row for i in contacts for row in self.places[i] if row is not None]

    def closing(self, view: View, contacts: Sequence[int]) -> Level:
        """The problem of moving the coordinates so that gaps are closed."""
        gaps = [each for i in contacts for each in [view.gaps[i], *[0.0] * (len(self.contacts[i].rows) - 1)]]
        return attrs.evolve(self.forces(view, contacts), before=gaps)

    def impacts(self, view: View, contacts: Sequence[int], restitution: Sequence[Any]) -> Level:
        """The problem of velocities of some contacts, each with a coefficient of restitution.

        It is zero for a contact that does not approach: its rate afterwards is not negative.
        """
        speeds = [view.speeds[self.places[i][0]] for i in contacts]
        targets = [0.0 if e == 0 else -(e * speed) for e, speed in zip(restitution, speeds, strict=True)]
        return self._level(view, contacts, view.speeds, view.fast, targets)

    def forces(self, view: View, contacts: Sequence[int]) -> Level:
        """The problem of accelerations of some contacts."""
        return self._level(view, contacts, view.accelerations, view.strong, [0.0] * len(contacts))

    def _level(
        self,
        view: View,
        contacts: Sequence[int],
        before: Sequence[Any],
        noise: Sequence[Any],
        targets: Sequence[Any],
    ) -> Level:
        rows = self.rows_of(contacts)
        delassus = [[view.delassus[row][column] for column in rows] for row in rows]
        places = [
            (rows.index(normal), None if across is None else rows.index(across))
            for normal, across in (self.places[i] for i in contacts)
        ]
        return Level(
            places=places,
            delassus=delassus,
            before=[before[row] for row in rows],
            targets=targets,
            stops=[0.0] * len(contacts),
            noise=[noise[row] for row in rows],
            given=[0.0] * len(contacts),
            friction=[view.friction[i] for i in contacts],
            static=[view.static[i] for i in contacts],
        )


def _length(delassus: Expression, squared: Any) -> Expression:
    return sqrt(Maximum(delassus * node(squared), ZERO))
