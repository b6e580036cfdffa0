"""Gaps and slips as expressions: their rates in the velocities, and what of their accelerations is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from hybrid.errors import ModelError, unknown_name
from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import mentions
from hybrid.expression.linear import Vector, dot
from hybrid.expression.nodes import ZERO, Expression, add, node
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.equations import Space


@attrs.frozen(eq=False)
class Row:
    """A relative velocity that forces act on: ``speed = weights u + drift``, ``rate = weights a + bias``."""

    weights: Vector
    drift: Expression
    bias: Expression

    def speed(self, velocities: Any) -> Expression:
        """The relative velocity."""
        return add(node(dot(self.weights, velocities)), self.drift)


@attrs.frozen(eq=False)
class Kinematics:
    """A contact in terms of the state.

    Attributes
    ----------
    contact
        What the author gave.
    gap
        The distance.
    normal, tangential
        Rates of gap and slip; ``tangential`` is None without friction.
    slip
        The tangential velocity, if a function tells it.
    restitution, friction, static
        The coefficients.
    """

    contact: Contact
    gap: Expression
    normal: Row
    tangential: Row | None
    restitution: Expression
    friction: Expression
    static: Expression

    @property
    def rows(self) -> list[Row]:
        """Those of normal and of tangential direction."""
        return [self.normal] if self.tangential is None else [self.normal, self.tangential]


def kinematics_of(space: Space, contact: Contact) -> Kinematics:
    """A contact in terms of the state.

    Raises
    ------
    ModelError
        If a function cannot be traced, the gap depends on velocities, the slip is not affine in them, or a
        coefficient names no parameter.
    """
    gap = space.one(f"{contact.title}: gap", contact.gap)
    [gap] = space.without_velocities(
        f"{contact.title}: gap must depend on coordinates and time alone; it depends on velocities.", [gap]
    )
    weights = [derivative(gap, each) for each in space.q]
    if all(each is ZERO for each in weights):
        raise ModelError(f"{contact.title}: gap depends on no coordinate, so no force can keep it open.")
    drift = derivative(gap, space.t)
    normal = Row(weights, drift, space.rate(add(node(dot(weights, space.u)), drift)))
    tangential = None
    if contact.slip is not None and contact.has_friction:
        tangential = _slip_row(space, contact, contact.slip)
    kinetic = _coefficient(space, contact, "friction", contact.friction)
    static = kinetic if contact.static is None else _coefficient(space, contact, "static", contact.static)
    _check_static(space, contact, static, kinetic)
    restitution = _coefficient(space, contact, "restitution", contact.restitution)
    return Kinematics(contact, gap, normal, tangential, restitution, kinetic, static)


def _slip_row(space: Space, contact: Contact, slip: Callable[..., Any]) -> Row:
    speed = space.one(f"{contact.title}: slip", slip)
    if not mentions(speed, space.u):
        raise ModelError(f"{contact.title}: slip depends on no velocity, so no friction can change it.")
    weights = space.without_velocities(
        f"{contact.title}: slip must be affine in the velocities, a sum of multiples of them.",
        [derivative(speed, each) for each in space.u],
    )
    if all(each is ZERO for each in weights):
        raise ModelError(f"{contact.title}: slip must be affine in the velocities.")
    drift = speed - dot(weights, space.u)
    [drift] = space.without_velocities(f"{contact.title}: slip must be affine in the velocities.", [drift])
    return Row(weights, drift, space.rate(add(node(dot(weights, space.u)), drift)))


def _coefficient(space: Space, contact: Contact, what: str, value: Any) -> Expression:
    if isinstance(value, str):
        names = space.variables.parameter_names
        if value not in names:
            raise ModelError(unknown_name(f"{contact.title}: {what}: parameter", value, names, "Parameters"))
        return space.p[names.index(value)]
    return space.one(f"{contact.title}: {what}", value) if callable(value) else node(value)


def _check_static(space: Space, contact: Contact, static: Expression, kinetic: Expression) -> None:
    if static is kinetic:
        return
    for least, value in space.samples([kinetic, static]):
        if value < least:
            raise ModelError(
                f"{contact.title}: static friction must be no smaller than kinetic friction; at default "
                f"parameters it is {value:g} and {least:g}."
            )
