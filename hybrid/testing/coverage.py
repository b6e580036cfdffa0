"""What the runs of a model reach: its modes, its transitions, and both sides of each condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import attrs
import numpy as np

from hybrid.expression.reads import names_read
from hybrid.expression.values import TraceError
from hybrid.simulation.arc import HybridArc
from hybrid.status import StatusCode
from hybrid.system.clocks import Clock
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function, Guard, Mode, Transition
from hybrid.system.functions import field_function
from hybrid.system.graph import HybridSystem
from hybrid.system.watched import is_of_library
from hybrid.testing.case import MOST_OF_WHOLE, Case
from hybrid.testing.contacts import GAPS, gains_on
from hybrid.testing.errors import PropertyError
from hybrid.testing.run import lasting
from hybrid.testing.starts import nearest_zero, start_in
from hybrid.testing.symmetry import is_mirrored
from hybrid.transform.contacts.growth import contacts_of
from hybrid.transform.deciding import decided_by

FIRES = "Every guard can fire, and no condition refuses every crossing"
# States are also drawn from the ranges times powers of ten between these.
WIDER = (-3.0, 3.0)
# Number of states at which a guard is evaluated that no run has made fire, and from which zeros are sought.
STATES = 500
STARTS = 100
# Number of cases that are aimed at a transition that no run took; how far outside of the drawn starts they
# may begin, as a share of the range; and how long before the transition, as a share of their time.
AIMED = 3
ROOM = 0.25
MOMENT = 0.02
# A mode that never lasts is told after this many visits.
FEW = 3
# A condition refuses every crossing if it refuses this many places on the guard, and allows none.
PLACES = 20
# A guard is zero at a jump if it is at most this share of its size on the run.
ON_GUARD = 1e-9
# How runs end that reach the end of their span, or an end that the model provides.
AS_MEANT = (StatusCode.SUCCESS, StatusCode.START_BEYOND, StatusCode.TERMINAL)


# What a run is to show of a contact.
IMPACTS_OF = "impacts of contact {!r}"


@attrs.frozen(eq=False)
class Coverage:
    """Counts over whole runs, none of which is cut.

    Attributes
    ----------
    jumps, visits
        How often each transition was taken, and each mode entered or started in, by name.
    refused
        How often a guard with a condition was crossed in its direction without firing, by name.
    ends
        How runs ended before the end of their span, by what is said of it.
    lasting
        Modes in which a run has stayed for some time.
    gains
        How often an impact has gained energy as the law of impacts allows, by transition.
    """

    system: HybridSystem
    jumps: Counter[str]
    visits: Counter[str]
    refused: Counter[str]
    ends: Counter[str]
    lasting: set[str] = attrs.field(factory=set)
    cases: list[Case] = attrs.field(factory=list)
    gains: Counter[str] = attrs.field(factory=Counter)

    @classmethod
    def of(cls, system: HybridSystem) -> Coverage:
        """Nothing seen yet of a system."""
        # A transition at the start corrects the mode of a start, and drawn starts need none.
        flown = [each for each in system.transitions if not each.guard.at_start]
        if decided_by(system) is not None:
            # Modes and transitions are made when runs need them, so none is missed; a contact may be.
            growth = contacts_of(system)
            names = [] if growth is None else [IMPACTS_OF.format(each.name) for each in growth.contacts]
            return cls(system, Counter(dict.fromkeys(names, 0)), Counter(), Counter(), Counter())
        conditional = [each.name for each in flown if each.guard.when is not None and _is_users(each)]
        zeros = ([each.name for each in flown], system.mode_names, conditional)
        jumps, visits, refused = (Counter(dict.fromkeys(names, 0)) for names in zeros)
        return cls(system, jumps, visits, refused, Counter())

    def see(self, case: Case) -> None:
        """Count the run of a case."""
        self.cases.append(case)
        arc = case.whole_if_any
        if arc is None:
            return
        self.jumps.update(jump.transition for jump in arc.jumps if jump.kind != "limit")
        if contacts_of(self.system) is not None:
            self.jumps.update(IMPACTS_OF.format(name) for name in impacts_of(case, arc))
            self.gains.update(gains_on(case))
        self.lasting.update(str(mode) for mode in np.unique(arc.mode[lasting(arc)]))
        self.visits.update([str(arc.mode[0]), *(jump.target for jump in arc.jumps if jump.target)])
        for transition in self.system.transitions:
            if transition.name in self.refused:
                self.refused[transition.name] += _refusals(case, arc, transition)
        if arc.status.code == StatusCode.MAX_JUMPS:
            self.ends[f"after {MOST_OF_WHOLE} jumps (MAX_JUMPS)"] += 1
        elif arc.status.code not in AS_MEANT:
            last = f" of {arc.jumps.transition[-1]}" if len(arc.jumps) else ""
            self.ends[f"with {arc.status.code.name}{last}"] += 1

    def check_starts(self) -> None:
        """Fail if a contact overlaps at some drawn starts, and is open at none.

        Raises
        ------
        PropertyError
            If the ranges of states and the gap of a contact exclude each other.
        """
        growth = contacts_of(self.system)
        assert growth is not None, "this is asked of systems with contacts"
        at = growth.mechanics.at
        gaps = np.array([at(case.t0, np.array(case.x0), case.values).gaps for case in self.cases])
        for contact, values in zip(growth.contacts, gaps.T, strict=True):
            if np.any(values < 0.0) and not np.any(values > growth.judge.together):
                self._fail(
                    f"the gap of contact {contact.name!r} is negative at {int(np.sum(values < 0.0))} of "
                    f"{len(values)} drawn starts, and positive at none",
                    f"gap= of contact {contact.name!r} has the wrong sign: it is positive where the bodies "
                    "are apart; or ranges of states in which they overlap.",
                    GAPS,
                )

    @property
    def never_seen(self) -> tuple[str, ...]:
        """Transitions that no run took and modes that no run visited."""
        return tuple(name for count in (self.jumps, self.visits) for name in count if not count[name])

    @property
    def one_sided(self) -> tuple[str, ...]:
        """Transitions that were taken, and whose condition has refused no crossing."""
        return tuple(name for name, refused in self.refused.items() if self.jumps[name] and not refused)

    @property
    def dead_ends(self) -> tuple[str, ...]:
        """Modes that nothing leaves though the state moves there, that nothing enters, that never last."""
        system = self.system
        if decided_by(system) is not None:
            return ()
        left = {each.source for each in system.transitions}
        entered = {name for each in system.transitions for name in (each.target, each.accumulates_to)}
        found = [
            f"NEVER LEFT: no transition leaves mode {mode.name!r}, in which the state moves."
            for mode in system.modes
            if len(system.modes) > 1 and mode.name not in left and self._moves(mode)
        ]
        found += [
            f"NEVER ENTERED: no transition leads to mode {name!r}."
            for name in system.mode_names
            if len(system.modes) > 1 and name not in entered and name != system.start
        ]
        found += [
            f"NEVER LASTS: each of {visits} runs left mode {name!r} at the instant at which it entered."
            for name, visits in self.visits.items()
            if visits >= FEW and name not in self.lasting
        ]
        return tuple(found)

    def _moves(self, mode: Mode) -> bool:
        variables = self.system.variables
        places = ((case.t0, np.array(case.x0), case.values) for case in self.cases)
        found = (evaluate(variables, field_function(mode, variables).value, *place) for place in places)
        return any(rates is not None and rates.any() for rates in found)

    def aimed(self) -> Iterator[Case]:
        """Cases that take a transition which no run took: they start just before a place where it fires.

        The places are among the drawn starts, and the new starts are where the laws allow them.
        """
        starts = np.array([case.x0 for case in self.cases if case.mode is not None])
        if not len(starts):
            return
        low, high = starts.min(axis=0), starts.max(axis=0)
        room, rng = ROOM * (high - low), np.random.default_rng(20240507)
        places = [
            (self.cases[i % len(self.cases)], rng.uniform(low, high), rng.uniform()) for i in range(STATES)
        ]
        for transition in self.system.transitions:
            if self.jumps[transition.name] or transition.guard.at_start or not _is_users(transition):
                continue
            found = 0
            for case, x, share in places:
                t = case.t0 + share * (case.t1 - case.t0)
                zero = nearest_zero(case, [transition.guard.function], t, x)
                if zero is None or np.any(zero < low - room) or np.any(zero > high + room):
                    continue
                aimed = _just_before(transition, case, t, zero)
                if aimed is not None:
                    yield aimed
                    found += 1
                if found == AIMED:
                    break

    def check(self) -> None:
        """Fail if the guard of a transition that no run took has one sign, or its condition allows nothing.

        The mirror image of a transition that was taken is right where that one is.

        Raises
        ------
        PropertyError
            If there is no place on the guard, among many states in the ranges and far beyond, where the
            transition could fire.
        """
        taken = [each for each in self.system.transitions if self.jumps[each.name]]
        for transition in self.system.transitions:
            if self.jumps[transition.name] or transition.guard.at_start or not _is_users(transition):
                continue
            if not is_mirrored(transition, taken, self.cases):
                self._check_guard(transition)

    def _check_guard(self, transition: Transition) -> None:
        name, guard = transition.name, transition.guard
        places = list(self._places())
        sides = {side for case, t, x in places for side in _side(case, guard, t, x)}
        found = ((case, t, nearest_zero(case, [guard.function], t, x)) for case, t, x in places[:STARTS])
        zeros = [(case, t, x) for case, t, x in found if x is not None]
        if len(sides) == 1 and not zeros:
            told = {1.0: "positive", -1.0: "negative", 0.0: "zero"}[sides.pop()]
            self._fail(
                f"guard of {name!r} is {told} at all {len(places)} states that were tried, in the ranges and "
                "far beyond; no run took it",
                f"a wrong sign, or a wrong threshold, in the guard of {name!r}: it never crosses zero.",
            )
        ways = [way for place in zeros for way in _ways(transition, *place)]
        if guard.direction and len(ways) >= PLACES and guard.direction not in ways:
            told, other = ("rises", "falls") if guard.direction < 0 else ("falls", "rises")
            self._fail(
                f"guard of {name!r} {told} at all {len(ways)} places that were tried, in the ranges and far "
                f"beyond, and fires where it {other}; no run took it",
                f"the wrong direction of {name!r}, or a wrong sign in its guard.",
            )
        if guard.when is None or self._is_discrete(guard.when):
            return
        allowed = [answer for place in zeros for answer in _answers(transition, *place)]
        if len(allowed) >= PLACES and not any(allowed):
            self._fail(
                f"condition of {name!r} refuses the crossing of its guard at all {len(allowed)} places that "
                "were tried, in the ranges and far beyond; no run took it",
                f"a wrong sign in the condition of {name!r}, or the wrong direction of its guard.",
            )

    def _is_discrete(self, condition: Function) -> bool:
        """Whether a condition reads a component that no field moves: drawn values say nothing of it."""
        system = self.system
        places = [(case.t0, np.array(case.x0), case.values) for case in self.cases]
        rates = [
            evaluate(system.variables, field_function(mode, system.variables).value, *place)
            for mode in system.modes
            for place in places
        ]
        moved = np.any([each != 0.0 for each in rates if each is not None], axis=0)
        try:
            read = names_read(system, condition)
        except TraceError:
            return True
        return any(name in read for name, moves in zip(system.state_names, moved, strict=True) if not moves)

    def _places(self) -> Iterator[tuple[Case, float, np.ndarray]]:
        """Times and states in the ranges and far beyond."""
        rng = np.random.default_rng(20240507)
        for i in range(STATES if self.cases else 0):
            case = self.cases[i % len(self.cases)]
            x, t = np.array(case.x0), rng.uniform() * (case.t1 - case.t0)
            if i >= len(self.cases):
                x *= 10.0 ** rng.uniform(*WIDER, x.shape) * rng.choice([-1.0, 1.0], x.shape)
                t *= 10.0 ** rng.uniform(*WIDER) * rng.choice([-1.0, 1.0])
            yield case, case.t0 + t, x

    def _fail(self, line: str, hint: str, told: str = FIRES) -> None:
        name = self.system.name or "the system"
        raise PropertyError(f"{told}: this does not hold for {name}.\n  {line}\n  likely: {hint}")


def impacts_of(case: Case, arc: HybridArc) -> Iterator[str]:
    """The contacts that close at the jumps of a run, one after another; none without contacts."""
    growth = contacts_of(case.system)
    known = [] if growth is None else [each.name for each in growth.contacts]
    for jump in arc.jumps:
        title = arc.system.transitions[arc.system.transition_index(jump.transition)].part_of or ""
        yield from (name for name in title.split("+") if name in known)


def _side(case: Case, guard: Guard | Clock, t: float, x: np.ndarray) -> list[float]:
    """The sign of a guard, or nothing where it has no value."""
    values = evaluate(case.system.variables, guard.function, t, x, case.values)
    return [] if values is None else [float(np.sign(values[0]))]


def _ways(transition: Transition, case: Case, t: float, x: np.ndarray) -> list[float]:
    """The sign of a guard after a place on it, in the mode that it ends; nothing if it is not crossed."""
    guard = transition.guard
    rates = evaluate(case.system.variables, case.rates_of(transition.source), t, x, case.values)
    if rates is None:
        return []
    moment = 1e-6 * (case.t1 - case.t0)
    sides = [side for h in (-moment, moment) for side in _side(case, guard, t + h, x + h * rates)]
    return [sides[1]] if len(sides) == 2 and sides[0] * sides[1] < 0.0 else []


def _answers(transition: Transition, case: Case, t: float, x: np.ndarray) -> list[bool]:
    """Whether the condition holds at a place on the guard; nothing if the flow does not cross it so."""
    guard = transition.guard
    allowed = [1.0] if guard.when is None else evaluate(case.system.variables, guard.when, t, x, case.values)
    crosses = any(guard.direction in (0, way) for way in _ways(transition, case, t, x))
    return [bool(allowed[0] > 0.0)] if crosses and allowed is not None else []


def _just_before(transition: Transition, case: Case, t: float, x: np.ndarray) -> Case | None:
    """A case that starts shortly before a place on a guard at which the transition fires; or None."""
    if _answers(transition, case, t, x) != [True]:
        return None
    moment = MOMENT * (case.t1 - case.t0)
    rates = evaluate(case.system.variables, case.rates_of(transition.source), t, x, case.values)
    before = tuple((x - moment * rates).tolist())
    aimed = attrs.evolve(case, mode=None, x0=before, t0=t - moment, t1=t - moment + case.t1 - case.t0)
    start = start_in(aimed, transition.source)
    return None if start is None else attrs.evolve(aimed, mode=transition.source, x0=start)


def _refusals(case: Case, arc: HybridArc, transition: Transition) -> int:
    """How often a guard changes sign in its direction between two rows of one stay, without an event."""
    guard, sides = transition.guard, np.zeros(len(arc.t))
    for i in np.flatnonzero(arc.mode == transition.source):
        sides[i] = sum(_side(case, guard, arc.t[i], arc.x[i]))
    # A stay ends on a guard, by rounding on either side of it.
    ends = np.append(arc.j[1:] != arc.j[:-1], False)
    sides[ends] = 0.0
    crossed = (arc.j[1:] == arc.j[:-1]) & (sides[1:] * sides[:-1] < 0.0)
    refused = int(np.sum(crossed & ((guard.direction == 0) | (sides[1:] == guard.direction))))
    # Of two guards with opposite conditions one fires where the other refuses.
    others = [
        each for each in arc.jumps if each.source == transition.source and each.transition != transition.name
    ]
    values = [
        evaluate(case.system.variables, guard.function, each.t, each.x_minus, case.values) for each in others
    ]
    on_guard = ON_GUARD * case.guard_size(transition)
    return refused + sum(value is not None and abs(value[0]) <= on_guard for value in values)


def _is_users(transition: Transition) -> bool:
    """Whether guard and condition are the user's own: those that the library derives may be idle."""
    guard = transition.guard
    return not (is_of_library(guard.function) or (guard.when is not None and is_of_library(guard.when)))
