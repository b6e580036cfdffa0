"""Contacts of a mechanical system: what must hold along its runs and at its impacts."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import attrs
import numpy as np

from hybrid.expression.evaluation import Program
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.run import lasting
from hybrid.testing.words import jump_told
from hybrid.transform.contacts.decide import POISSON
from hybrid.transform.contacts.growth import SETTLING, ContactGrowth, contacts_of
from hybrid.transform.contacts.statuses import OPEN
from hybrid.transform.contacts.view import View

GAPS = "No gap is negative, and the gap of a held contact stays zero"
FORCES = "Contacts push, and friction keeps to Coulomb's law"
IMPACTS = "Impulses act along the contacts that close, and add no energy"
COEFFICIENTS = "Restitution, friction and slip of each contact are possible"

# Errors are judged as shares of the sizes of what is added.
TOLERANCE = 1e-8
# Gaps are judged as shares of the sizes of the coordinates.
CLOSED = 1e-9
# A slip is the rate of its gap if the two directions differ by less than this share.
PARALLEL = 1e-9
# The first rows of a run are judged: more of them show nothing new.
MOST_ROWS = 300


@attrs.frozen(eq=False)
class Touching:
    """A run of a system with contacts, and what decides at its points."""

    case: Case
    arc: HybridArc
    growth: ContactGrowth

    @classmethod
    def of(cls, case: Case) -> Touching:
        """The run of a case; the example is discarded if its system has no contacts."""
        growth = contacts_of(as_case(case).system)
        if growth is None:
            discard("the system is not made by mechanics")
        return cls(case, case.whole, growth)

    def view(self, t: float, x: np.ndarray) -> View:
        """Speeds, accelerations and coefficients at a point."""
        return self.growth.mechanics.at(t, x, self.case.values)

    def rows(self) -> Iterator[tuple[int, View]]:
        """The rows of the run in which it stays for some time."""
        yield from self._views.items()

    @cached_property
    def _views(self) -> dict[int, View]:
        arc = self.arc
        rows = np.flatnonzero(lasting(arc)[:MOST_ROWS]).tolist()
        return {i: self.view(arc.t[i], arc.x[i]) for i in rows}

    @cached_property
    def fastest(self) -> np.ndarray:
        """By rows of contact directions: the largest speed that the energy on the run allows."""
        return np.max([each.fast for each in self._views.values()], axis=0)

    def impacts(self) -> Iterator[Jump]:
        """The jumps at which gaps close, but for the limits of chatters."""
        names = {each.name for each in self.growth.contacts}
        for jump in self.arc.jumps:
            transitions = self.arc.system.transitions
            title = transitions[self.arc.system.transition_index(jump.transition)].part_of or ""
            if jump.kind != "limit" and jump.source != SETTLING and names.issuperset(title.split("+")):
                yield jump

    def place_told(self, i: int) -> str:
        """Where a row is, in words."""
        arc = self.arc
        return f"at t = {arc.t[i]:.8g}, {self.case.state_told(arc.x[i])}, in mode {str(arc.mode[i])!r}"

    def size_of_gap(self, k: int, t: float, x: np.ndarray) -> float:
        """Size of the terms of a gap: its slopes times the sizes of the coordinates on the run."""
        space = self.growth.mechanics.space
        slopes = self._slopes[k].run(space.values(t, x, self.case.values))
        return float(np.abs(np.array(slopes, dtype=float)) @ np.abs(self.arc.x[:, : space.size]).max(axis=0))

    @cached_property
    def _slopes(self) -> list[Program]:
        return [Program(each.normal.weights) for each in self.growth.mechanics.contacts]


def check_gaps(case: Case) -> None:
    """No gap is negative on the run, and in a mode that holds a contact its gap stays zero.

    Raises
    ------
    PropertyError
        If a gap is negative, or a held contact opens.

    Examples
    --------
    >>> from hybrid import Contact, mechanics
    >>> from hybrid.testing import Case, check_gaps
    >>> ball = mechanics(
    ...     coordinates=("y",),
    ...     velocities=("v",),
    ...     mass=lambda t, x, p: (1.0,),
    ...     forces=lambda t, x, p: (-9.81,),
    ...     contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution=0.5)],
    ... )
    >>> check_gaps(Case(ball, {}, "free", (1.0, 0.0), 0.0, 3.0))
    """
    run = Touching.of(case)
    together = run.growth.judge.together
    for i, view in run.rows():
        statuses = run.growth.statuses_in(str(run.arc.mode[i]))
        for k, (contact, status) in enumerate(zip(run.growth.contacts, statuses, strict=True)):
            allowed = together + CLOSED * run.size_of_gap(k, run.arc.t[i], run.arc.x[i])
            gap = view.gaps[k]
            if gap < -allowed or (status != OPEN and gap > allowed):
                case.fail(
                    GAPS,
                    f"the gap of contact {contact.name!r} is {gap:.8g} {run.place_told(i)}",
                    hint=f"gap= of contact {contact.name!r}: it is positive where the bodies are apart, and "
                    "may not jump; or contacts that cannot all be closed.",
                    time=run.arc.t[i],
                )


def check_contact_forces(case: Case) -> None:
    """Normal forces push, and friction opposes the slip and keeps within Coulomb's bound.

    Forces that are not determined are passed over.

    Raises
    ------
    PropertyError
        If a contact pulls, friction drives, or friction is larger than Coulomb's law allows.

    Examples
    --------
    >>> from hybrid import Contact, mechanics
    >>> from hybrid.testing import Case, check_contact_forces
    >>> floor = Contact("floor", gap=lambda t, x, p: x.y, slip=lambda t, x, p: x.u, friction=0.3)
    >>> block = mechanics(
    ...     coordinates=("x", "y"),
    ...     velocities=("u", "v"),
    ...     mass=lambda t, x, p: (1.0, 1.0),
    ...     forces=lambda t, x, p: (0.0, -9.81),
    ...     contacts=[floor],
    ... )
    >>> check_contact_forces(Case(block, {}, "free", (0.0, 1.0, 2.0, 0.0), 0.0, 3.0))
    """
    run, seen = Touching.of(case), False
    forces = [
        {what: run.arc[f"{each.name}.{what}"] for what in ("normal", "tangential")[: 1 + each.has_friction]}
        for each in run.growth.contacts
    ]
    for i, view in run.rows():
        statuses = run.growth.statuses_in(str(run.arc.mode[i]))
        for k, (contact, status) in enumerate(zip(run.growth.contacts, statuses, strict=True)):
            if status == OPEN:
                continue
            seen = True
            fault = _force_fault(run, view, k, {what: float(values[i]) for what, values in forces[k].items()})
            if fault is not None:
                case.fail(
                    FORCES,
                    f"contact {contact.name!r}: {fault}, {run.place_told(i)}",
                    hint=f"friction= or static= of contact {contact.name!r} that is negative somewhere, or a "
                    "mass that is not positive there.",
                    time=run.arc.t[i],
                )
    if not seen:
        discard("no contact was held")


def _force_fault(run: Touching, view: View, k: int, forces: dict[str, float]) -> str | None:
    """What is wrong with the forces of a contact; None if nothing is, or they are not determined."""
    normal, tangential = forces["normal"], forces.get("tangential", 0.0)
    row, across = run.growth.mechanics.places[k]
    noise = TOLERANCE * max(abs(normal), view.strong[row] / view.delassus[row][row])
    if normal < -noise:
        return f"its normal force is {normal:.8g}: it pulls"
    if across is None or not np.isfinite([normal, tangential]).all():
        return None
    slip = view.speeds[across]
    if tangential * slip > noise * abs(slip) + TOLERANCE * abs(tangential) * run.fastest[across]:
        return f"its friction is {tangential:.8g} at a slip of {slip:.8g}: it drives"
    most = max(view.friction[k], view.static[k]) * normal
    across_noise = TOLERANCE * (abs(tangential) + view.strong[across] / view.delassus[across][across])
    if abs(tangential) > most + noise + across_noise:
        return f"its friction is {tangential:.8g}, and at most {most:.8g} is possible"
    return None


def check_impacts(case: Case) -> None:
    """The change of momentum at an impact is a sum of impulses along its contacts, which add no energy.

    The work of surfaces that move in time does not count. By Newton's law impacts with friction, or with
    several coefficients of restitution at once, may gain energy; then nothing is said.

    Raises
    ------
    PropertyError
        If the momentum changes in another direction, or kinetic energy is gained.

    Examples
    --------
    >>> from hybrid import Contact, mechanics
    >>> from hybrid.testing import Case, PropertyError, check_impacts
    >>> lively = Contact("floor", gap=lambda t, x, p: x.y, restitution=lambda t, x, p: 1.2 + x.y)
    >>> ball = mechanics(
    ...     coordinates=("y",),
    ...     velocities=("v",),
    ...     mass=lambda t, x, p: (1.0,),
    ...     forces=lambda t, x, p: (-9.81,),
    ...     contacts=[lively],
    ... )
    >>> try:
    ...     check_impacts(Case(ball, {}, "free", (1.0, 0.0), 0.0, 1.0))
    ... except PropertyError as error:
    ...     print("gained" in str(error))
    True
    """
    run, seen = Touching.of(case), False
    for jump in run.impacts():
        seen = True
        view = run.view(jump.t, jump.x_minus)
        closed = _closed(run, view, jump.t, jump.x_minus)
        off, gain, energy = _momentum(run, view, jump, closed)
        if off > TOLERANCE:
            case.fail(
                IMPACTS,
                f"a share of {off:.3g} of the change of momentum is not along the contacts",
                jump_told(case, jump),
                hint="a mass that depends on velocities, or one that is not finite there.",
                time=jump.t,
            )
        if gain > TOLERANCE * energy and not _may_gain(run, view, closed):
            names = ", ".join(f"{view.restitution[k]:.6g} at {run.growth.contacts[k].name!r}" for k in closed)
            case.fail(
                IMPACTS,
                f"kinetic energy of {gain:.6g} is gained, and it was {energy:.6g}; restitution is {names}",
                jump_told(case, jump),
                hint="restitution= that is larger than 1 there.",
                time=jump.t,
            )
    if not seen:
        discard("no impact on the run")


def discard_what_rounding_decides(case: Case) -> None:
    """Discard the example if on its run a contact that stuck begins to slip, or several close at once.

    The mode that held the slip leaves it at zero but for rounding, whose sign the next mode sees: in a system
    that is written differently it is another one. Which of several gaps closes first is rounding, too.
    """
    growth = contacts_of(case.system)
    if growth is None:
        return
    names = [each.name for each in growth.contacts]
    titles = [case.transition(jump).part_of or "" for jump in case.run.arc.jumps]
    if not {f"{name} slips" for name in names}.isdisjoint(titles):
        discard("a contact that stuck begins to slip, where its slip is zero but for rounding")
    if any(title.count("+") and {*title.split("+")} <= {*names} for title in titles):
        discard("several contacts close at once, in an order that rounding decides")


def gains_on(case: Case) -> Iterator[str]:
    """The impacts of a run that gain energy as the law of impacts allows, by the name of the transition."""
    run = Touching.of(case)
    for jump in run.impacts():
        view = run.view(jump.t, jump.x_minus)
        closed = _closed(run, view, jump.t, jump.x_minus)
        _, gain, energy = _momentum(run, view, jump, closed)
        if gain > TOLERANCE * energy and _may_gain(run, view, closed):
            yield str(jump.transition)


def _closed(run: Touching, view: View, t: float, x: np.ndarray) -> list[int]:
    """The contacts that are closed at a point."""
    together = run.growth.judge.together
    return [k for k, gap in enumerate(view.gaps) if abs(gap) <= together + CLOSED * run.size_of_gap(k, t, x)]


def _momentum(run: Touching, view: View, jump: Jump, closed: list[int]) -> tuple[float, float, float]:
    """The share of the momentum that no contact explains, the energy gained, and the energy before.

    With ``M (u+ - u-) = W f`` the gain without the work of moving surfaces is ``f (v+ + v-) / 2``, where
    ``v`` are the speeds at the contacts. Sizes are those in the metric of the masses.
    """
    mechanics, t, values = run.growth.mechanics, float(jump.t), run.case.values
    n = mechanics.space.size
    root = np.linalg.cholesky(run.growth.mass_at(t, jump.x_minus, values)).T
    rows = mechanics.rows_of(closed)
    before, after = (np.asarray(x)[n:] for x in (jump.x_minus, jump.x_plus))
    change = root @ (after - before)
    directions = root @ np.array([view.effects[row] for row in rows]).reshape(-1, n).T
    impulses = np.linalg.lstsq(directions, change, rcond=None)[0]
    off = np.linalg.norm(change - directions @ impulses)
    size = np.linalg.norm(root @ before) + np.linalg.norm(root @ after)
    # An impact moves coordinates by rounding at most, so that directions are those before.
    speeds = [
        view.speeds[row] + run.view(t, np.array([*jump.x_minus[:n], *after])).speeds[row] for row in rows
    ]
    energy = 0.5 * float(np.sum((root @ before) ** 2))
    return float(off / size) if size > 0.0 else 0.0, 0.5 * float(impulses @ speeds), energy


def _may_gain(run: Touching, view: View, closed: list[int]) -> bool:
    """Whether the law of impacts allows a gain though no restitution is larger than 1."""
    found = {view.restitution[k] for k in closed}
    rough = any(run.growth.contacts[k].has_friction and view.friction[k] > 0.0 for k in closed)
    possible = all(0.0 <= each <= 1.0 for each in found)
    return possible and run.growth.judge.law != POISSON and (rough or len(found) > 1)


def check_coefficients(case: Case) -> None:
    """Restitution lies between 0 and 1, friction is not negative, and static friction is no smaller.

    Restitution is read where a contact closes, friction where it is closed. A slip is not the rate of the gap
    of its contact.

    Raises
    ------
    PropertyError
        If a coefficient is out of range, or a slip is a multiple of the rate of the gap.

    Examples
    --------
    >>> from hybrid import Contact, mechanics
    >>> from hybrid.testing import Case, check_coefficients
    >>> ball = mechanics(
    ...     coordinates=("y",),
    ...     velocities=("v",),
    ...     mass=lambda t, x, p: (1.0,),
    ...     forces=lambda t, x, p: (-9.81,),
    ...     contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution=0.5)],
    ... )
    >>> check_coefficients(Case(ball, {}, "free", (1.0, 0.0), 0.0, 1.0))
    """
    run = Touching.of(case)
    found: list[tuple[float, str, str | None]] = []
    for jump in run.impacts():
        view = run.view(jump.t, jump.x_minus)
        for k in _closed(run, view, jump.t, jump.x_minus):
            found.append((jump.t, jump_told(case, jump), _coefficient_fault(run, view, k, impact=True)))
    arc, last = run.arc, len(run.arc.t) - 1
    view = run.view(arc.t[last], arc.x[last])
    for k in _closed(run, view, arc.t[last], arc.x[last]):
        # An impact at which nothing is possible ends the run.
        fault = _coefficient_fault(run, view, k, impact=not arc.status.ok)
        found.append((float(arc.t[last]), run.place_told(last), fault))
    for i, view in run.rows():
        for k, status in enumerate(run.growth.statuses_in(str(run.arc.mode[i]))):
            if status != OPEN:
                fault = _coefficient_fault(run, view, k, impact=False)
                found.append((float(run.arc.t[i]), run.place_told(i), fault))
    if not found:
        discard("no contact was closed")
    faults = [(t, where, fault) for t, where, fault in found if fault is not None]
    if faults:
        t, where, fault = min(faults)
        case.fail(
            COEFFICIENTS,
            fault,
            where,
            hint="a function or a parameter with the wrong sign or size; or parameters= needs narrower "
            "ranges; or a slip that is not along the surface.",
            time=t,
        )


def _coefficient_fault(run: Touching, view: View, k: int, *, impact: bool) -> str | None:
    """What is impossible about a contact at a state; None if nothing is."""
    title, restitution = f"contact {run.growth.contacts[k].name!r}", view.restitution[k]
    if impact and not 0.0 <= restitution <= 1.0:
        return f"{title}: restitution is {restitution:.8g}, and must lie between 0 and 1"
    if not view.friction[k] >= 0.0:
        return f"{title}: friction is {view.friction[k]:.8g}, and must not be negative"
    if not view.static[k] >= view.friction[k]:
        return (
            f"{title}: static friction is {view.static[k]:.8g}, and must be no smaller than kinetic "
            f"friction, {view.friction[k]:.8g}"
        )
    row, across = run.growth.mechanics.places[k]
    if across is not None:
        G = view.delassus
        if G[row][across] ** 2 >= (1.0 - PARALLEL) * G[row][row] * G[across][across]:
            return f"{title}: slip is a multiple of the rate of the gap, and must be tangential"
    return None
