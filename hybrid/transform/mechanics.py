"""Mechanical systems with contacts: coordinates, masses, forces and gaps become a hybrid system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Unpack

from hybrid import arguments
from hybrid.errors import HybridError, ModelError
from hybrid.shared import shares
from hybrid.system.checks import check_cyclic
from hybrid.system.declared import as_parameters, as_state
from hybrid.system.elements import Function, Mode
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem
from hybrid.system.outputs import as_outputs
from hybrid.system.variables import Variables
from hybrid.system.watched import Watched
from hybrid.transform.asked import DescribedWithShifts, passed_on
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.statuses import FREE, statuses_of

# What coordinates and velocities are.
NAMES = "be names that can be written as attributes, one or several"


@shares(DescribedWithShifts)
def mechanics(
    *,
    coordinates: Iterable[str],
    velocities: Iterable[str],
    contacts: Iterable[Contact],
    mass: Function | None = None,
    forces: Function | None = None,
    kinetic: Function | None = None,
    potential: Function | None = None,
    parameters: Mapping[str, float] | None = None,
    impacts: str = "newton",
    together: float = 1e-9,
    start: str | None = None,
    **asked: Unpack[DescribedWithShifts],
) -> HybridSystem:
    """The hybrid system of bodies with unilateral contacts and dry friction.

    The equations of motion ``M a = h`` follow from masses and forces, or from energies by Lagrange's
    equations. Which contacts are closed, stick or slip, what an impact does and which mode follows is derived
    from the gaps (see Notes). The result is an ordinary `HybridSystem`, whose modes are made when a run first
    needs them.

    Parameters
    ----------
    coordinates, velocities
        Names of the ``n`` coordinates and of their rates, in the same order. The state is both.
    contacts
        `Contact` objects.
    mass
        ``M(t, x, p)``: ``n`` numbers, the diagonal, or ``n`` rows. It may depend on coordinates and time.
    forces
        ``h(t, x, p)``: ``n`` generalised forces, all but those of contacts, gyroscopic ones included.
    kinetic, potential
        In the place of ``mass``: the kinetic energy ``T(t, x, p)``, quadratic in the velocities, and the
        potential energy ``V(t, x, p)``; ``forces`` are then the others.
    parameters
        Default values by name.
    impacts
        ``"newton"``: each rate after an impact is at least ``-e`` times the rate before. ``"poisson"``: the
        impulses of compression come back ``e``-fold. ``"sequential"``: Newton's law for one contact after
        another, in listed order, where several close together.
    together
        Gaps below this count as closed when another contact closes: they take part in its impact.
    start
        As for `HybridSystem`.
    cyclic
        As for `HybridSystem`. Along a cyclic coordinate the accelerations without contacts, all gaps, slips
        and coefficients are the same.

    Returns
    -------
    HybridSystem
        Modes are named by what holds: ``free``, ``left``, ``left sticks``, ``left slips +``, ``left+right``.
        Outputs ``left.gap``, ``left.normal``, ``left.tangential`` are the gap and the contact forces.
        ``arc.jumps["left"]`` are the impacts of a contact. A run ends (TERMINAL) with a jump ``painleve``
        where no accelerations agree with Coulomb's law, and with ``not unique`` where several do.

    Raises
    ------
    ModelError
        If a function cannot be traced or has the wrong number of values, the mass matrix is not symmetric and
        positive definite, the kinetic energy is not quadratic in the velocities, or a slip is not affine in
        them.

    Notes
    -----
    *Impacts*: with ``u' = u + M^-1 W f``, each closed contact has an impulse ``f >= 0`` or a rate after the
    impact that is larger than ``-e`` times the one before, and Coulomb's law holds for the impulses (Moreau).
    *Forces*: each closed contact whose rate is zero has a force ``f >= 0`` or an acceleration of its gap, and
    Coulomb's law holds. All cases are tried at the state at which this is asked, so that none and several are
    seen.

    References
    ----------
    C. Glocker, Set-Valued Force Laws, Springer, 2001, doi:10.1007/978-3-540-44479-4.
    B. Brogliato, Nonsmooth Mechanics, 3rd edition, Springer, 2016, doi:10.1007/978-3-319-28664-2.

    Examples
    --------
    >>> from hybrid import Contact, mechanics, simulate
    >>> ball = mechanics(
    ...     coordinates=("y",),
    ...     velocities=("v",),
    ...     parameters={"g": 9.81, "e": 0.5},
    ...     mass=lambda t, x, p: (1.0,),
    ...     forces=lambda t, x, p: (-p.g,),
    ...     contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution="e")],
    ... )
    >>> arc = simulate(ball, {"y": 1.0, "v": 0.0}, (0.0, 3.0))
    >>> str(arc.mode[-1]), float(arc["floor.normal"][-1])
    ('floor', 9.81)
    """
    # SymPy is slow to import, so it is not imported with the library.
    from hybrid.expression.evaluation import expressed
    from hybrid.transform.contacts.decide import LAWS, Judge
    from hybrid.transform.contacts.equations import Space, equations_of
    from hybrid.transform.contacts.growth import ContactGrowth
    from hybrid.transform.contacts.kinematics import kinematics_of
    from hybrid.transform.contacts.view import Mechanics
    from hybrid.transform.deciding import Origin

    q, u = (_names(what, value) for what, value in (("coordinates", coordinates), ("velocities", velocities)))
    if set(q) & set(u):
        raise ModelError(f"mechanics: velocities must not have names of coordinates; got {', '.join(u)}.")
    if len(q) != len(u):
        raise ModelError(
            "mechanics: coordinates and velocities must be as many, since these are the rates of those; got "
            f"{len(q)} and {len(u)}."
        )
    for what, given in (("mass", mass), ("forces", forces), ("kinetic", kinetic), ("potential", potential)):
        if given is not None:
            arguments.function(f"mechanics: {what}", given, "(t, x, p)")
    arguments.one_of("mechanics: impacts", impacts, LAWS)
    touching = tuple(
        arguments.items("mechanics: contacts", contacts, "be a list of Contact objects", least=1)
    )
    for i, each in enumerate(touching):
        arguments.instance(f"mechanics: contacts[{i}]", each, Contact)
    names = [each.name for each in touching]
    if len(set(names)) < len(names):
        raise ModelError(f"mechanics: contacts must have names of their own; got {', '.join(names)}.")
    values = as_parameters({} if parameters is None else parameters)
    space = Space(Variables((*q, *u), values))
    equations = equations_of(space, mass, forces, kinetic, potential)
    system = Mechanics(space, equations, tuple(kinematics_of(space, each) for each in touching))
    if start is not None:
        statuses_of(touching, arguments.instance("mechanics: start", start, str), "mechanics: start mode")
    judge = Judge(system, arguments.positive("mechanics: together", together), impacts)
    free = expressed([*space.u, *system.view.free])
    functions = [mass, forces, kinetic, potential]
    for each in touching:
        functions += [each.gap, each.slip, each.restitution, each.friction, each.static]
    given_outputs = {} if asked["outputs"] is None else asked["outputs"]
    own = as_outputs(given_outputs, "mechanics")
    taken = sorted(own.keys() & system.outputs.keys())
    if taken:
        raise ModelError(f"mechanics: outputs: {taken[0]!r} is told of a contact. Choose another name.")
    original = HybridSystem(
        state=(*q, *u),
        parameters=values,
        modes=[Mode(FREE, free)],
        transitions=[],
        **{**passed_on(asked), "outputs": {**own, **system.outputs}},
        derived_from=Watched([each for each in functions if callable(each)]),
    )
    check_cyclic(original.variables, _moved_by(free, touching), original.is_cyclic)
    called = {
        **{"coordinates": q, "velocities": u, "contacts": touching, "parameters": parameters},
        **{"mass": mass, "forces": forces, "kinetic": kinetic, "potential": potential},
        **{"impacts": impacts, "together": together, "start": start},
        **asked,
    }
    return ContactGrowth(judge, original, Origin(mechanics, called), start).current


def _moved_by(free: Function, contacts: Iterable[Contact]) -> list[ModelFunction]:
    """What the motion depends on: the accelerations without contacts, gaps, slips and coefficients."""
    found = [ModelFunction("mechanics", "motion without contacts", free, "", None, None)]
    for each in contacts:
        for what in ("gap", "slip", "restitution", "friction", "static"):
            function = getattr(each, what)
            if callable(function):
                found.append(ModelFunction(each.title, what, function, "", None, None))
    return found


def _names(what: str, value: Iterable[str]) -> tuple[str, ...]:
    """Names of coordinates or of velocities."""
    names = arguments.items(f"mechanics: {what}", value, NAMES, least=1)
    try:
        found = as_state(tuple(names))
    except HybridError:
        raise arguments.refusal(f"mechanics: {what}", NAMES, value) from None
    assert not isinstance(found, int), "names are not their number"
    return found
