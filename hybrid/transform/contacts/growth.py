"""A mechanical system that makes its modes and transitions as runs need them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.expression.evaluation import Program, expressed, scalar
from hybrid.expression.linear import dot
from hybrid.expression.nodes import ONE, ZERO, Expression, node
from hybrid.system.elements import Guard, Mode, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Place
from hybrid.system.outputs import Formula, Output
from hybrid.transform.contacts.cases import Happening
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.decide import NONE, SEQUENTIAL, SEVERAL_CASES, Decision, Judge, Undecided
from hybrid.transform.contacts.events import BREAKS, IMPACT, JAMS, OPENS, SETTLES, STOPS, ContactEvent
from hybrid.transform.contacts.modes import Held, held
from hybrid.transform.contacts.order import order_matters
from hybrid.transform.contacts.problem import Combination
from hybrid.transform.contacts.solutions import is_shared
from hybrid.transform.contacts.starts import Starts
from hybrid.transform.contacts.statuses import (
    IDLE,
    OPEN,
    SIGNS,
    Statuses,
    mode_name,
    statuses_of,
)
from hybrid.transform.contacts.view import FORCES
from hybrid.transform.deciding import Deciding, Origin, Watch, decided_by
from hybrid.transform.stages import numbered

SETTLING, BEGINNING = "settles", "begins"
# A gain of kinetic energy below this share is rounding.
GAIN = 1e-9
# Forces grow beyond all bounds where their equations become singular; this near, a million-fold.
SINGULAR = 1e-6


@attrs.frozen(eq=False)
class Made:
    """A mode that has been made."""

    mode: Mode
    forces: Held
    watches: list[Watch]


class ContactGrowth(Deciding):
    """Makes the modes of a mechanical system and the transitions between them, as runs need them."""

    def __init__(
        self, judge: Judge, original: HybridSystem, origin: Origin, start: str | None = None
    ) -> None:
        super().__init__(original, origin)
        self.judge, self.start = judge, start
        self.mechanics = judge.mechanics
        self.made: dict[Combination, Made] = {}
        self.notes: dict[str, None] = {}
        self.doubtful: dict[str, str] = {}
        self.starts = Starts(self.mechanics, judge.together)
        self.begins = False
        count = len(self.mechanics.contacts)
        always = Guard(scalar(ONE), +1, at_start=True)
        nothing = Combination.of([OPEN] * count)
        self.beginning = Watch(BEGINNING, nothing, ContactEvent(IMPACT), always, "begin")
        self.settling = Watch(
            SETTLING,
            nothing,
            ContactEvent(SETTLES),
            always,
            "settle",
        )
        sample = self.original.variables
        anywhere = 0.0, np.ones(sample.dimension), sample.defaults
        self.free = self._make(nothing, anywhere)
        # A mode that lasts no time may have any field.
        self.still = expressed([ZERO] * sample.dimension)

    @property
    def ambiguous(self) -> Mapping[str, str]:
        """Impacts whose order would matter, each with the names of the contacts."""
        return self.doubtful

    @property
    def given(self) -> list[Expression]:
        """Masses, forces, gaps, slips and coefficients."""
        return self.mechanics.given

    @property
    def contacts(self) -> list[Contact]:
        """What the author gave."""
        return [each.contact for each in self.mechanics.contacts]

    def _decided(self, watch: Watch, place: Place) -> Decision | Undecided:
        if watch.event.kind != JAMS:
            return self.judge.decide(watch.event, watch.now, *place)
        closed = tuple(i for i, each in enumerate(watch.now.statuses) if each != OPEN)
        return Undecided(NONE, closed, False)

    def _follow(self, watch: Watch, decision: Decision, place: Place) -> None:
        for each in self._alike(watch, decision):
            if decision not in each.decisions:
                self._write(each, decision, place)
        self._remark(watch, decision, place)

    def _remark(self, watch: Watch, decision: Decision, place: Place) -> None:
        """Note what is doubtful about an impact: the order of several, a gain of energy."""
        if watch.event.kind != IMPACT:
            return
        transition, names = watch.cases[-1][0], [self.contacts[i].name for i in decision.closed]
        view = self.mechanics.at(*place)
        if self.judge.law != SEQUENTIAL and order_matters(self.mechanics, view, decision.closed):
            for each in self._alike(watch, decision):
                self.doubtful[each.cases[-1][0].name] = ", ".join(map(repr, names))
        before, after = (self._energy(x, place) for x in (place[1], self._after(transition, place)))
        if after - before > GAIN * before:
            self.notes[
                f"{transition.name}: this impact gains energy, {after - before:.3g} of {before:.3g} at "
                f't = {place[0]:g}: Newton\'s law with friction may. mechanics(impacts="poisson") may not.'
            ] = None

    def _after(self, transition: Transition, place: Place) -> np.ndarray:
        t, x, parameters = place
        assert transition.reset is not None, "an impact has a reset"
        return np.array(transition.reset.function(t, x, parameters), dtype=float)

    def _energy(self, x: np.ndarray, place: Place) -> float:
        """Kinetic energy."""
        t, _, parameters = place
        return float(self._kinetic.run(self.mechanics.space.values(t, x, parameters))[0])

    def statuses_in(self, mode: str) -> Statuses:
        """What holds at each contact in a mode that has been made."""
        known = (now.statuses for now, each in self.made.items() if each.mode.name == mode)
        return next(known, (OPEN,) * len(self.contacts))

    def mass_at(self, t: float, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """The mass matrix ``(n, n)``."""
        values = self._mass.run(self.mechanics.space.values(t, x, parameters))
        return np.array(values, dtype=float).reshape(self.mechanics.space.size, -1)

    @cached_property
    def _mass(self) -> Program:
        return Program([each for row in self.mechanics.equations.mass for each in row])

    @cached_property
    def _kinetic(self) -> Program:
        u = [*self.mechanics.space.u]
        return Program([node(0.5 * dot(u, [dot(row, u) for row in self.mechanics.equations.mass]))])

    def _alike(self, watch: Watch, decision: Decision) -> list[Watch]:
        """The events that a decision is about: several contacts that change have one each."""
        if watch.source in (SETTLING, BEGINNING):
            return [watch]
        made = next(each for each in self.made.values() if each.mode.name == watch.source)
        after = decision.target(len(self.contacts)).statuses
        changed = [i for i, each in enumerate(watch.now.statuses) if each != after[i]]
        concerned = decision.closed if watch.event.kind == IMPACT else changed
        return [
            each
            for each in made.watches
            if each is watch or (each.event.kind == watch.event.kind and each.event.contact in concerned)
        ]

    def _write(self, watch: Watch, decision: Decision, place: Place) -> None:
        """Make the transition of a decision."""
        watch.decisions.append(decision)
        case = Happening(self.judge, watch.event, watch.now, decision).written(place)
        if case.state is not None:
            t, x, parameters = place
            after = Program(case.state).run(self.mechanics.space.values(t, x, parameters))
            place = t, np.array(after, dtype=float), parameters
        to = self._make(decision.target(len(self.contacts)), place).mode.name
        limit = SETTLING if watch.event.kind == IMPACT else None
        self._add(watch, case, to, self._title(watch, decision), limit)

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Make the mode in which a run starts; whether it was to be made.

        Raises
        ------
        ArgumentError
            If a gap is negative, or several things may happen.
        """
        with self.lock:
            self._start(t, x, parameters, mode)
            return self.stage is None

    def mode_at(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> str:
        """The mode in which a run starts."""
        if mode is not None:
            return mode
        with self.lock:
            return self._start(t, x, parameters, mode)

    def _start(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> str:
        place, mode = (t, x, parameters), self.start if mode is None else mode
        if mode in (SETTLING, BEGINNING):
            return mode
        known = {each.mode.name: now for now, each in self.made.items()}
        statuses = None
        if mode is not None:
            statuses = known[mode].statuses if mode in known else statuses_of(self.contacts, mode)
        closes = self.starts.closes(place, statuses)
        if statuses is None:
            return self._closed_start(place) if closes else self.free.mode.name
        if mode is not None and mode in known:
            return mode
        return self._make(self.judge.named(statuses, *place), place).mode.name

    def _closed_start(self, place: Place) -> str:
        """The mode of a start at which gaps are closed."""
        view = self.mechanics.at(*place)
        if self.judge.is_hit(view):
            # A gap that is negative by rounding is not seen to close: the impact is at the start.
            self.stage = self.stage if self.begins else None
            self.begins = True
            return BEGINNING
        decision = self.judge.start(view)
        if isinstance(decision, Undecided):
            if decision.name == SEVERAL_CASES:
                raise ArgumentError(
                    f"x0 = {tuple(map(float, place[1]))} may go on in more than one mode: "
                    f"{self._cases(decision)}. Choose one with mode=."
                )
            return SETTLING
        return self._make(decision.target(len(self.contacts)), place).mode.name

    def _make(self, now: Combination, place: Place) -> Made:
        """The mode in which ``now`` holds."""
        if now not in self.made:
            name = mode_name(self.contacts, now.statuses)
            taken = {each.mode.name for each in self.made.values()}
            name = next(each for each in numbered(name) if each not in taken)
            forces = held(self.mechanics, now, place)
            mode = Mode(name, forces.field, holds=forces.holds)
            self.made[now] = Made(mode, forces, [*self._watches(name, now, forces)])
            if forces.undetermined:
                self.notes[f"{name}: some contact forces are not determined there; the motion is."] = None
            self.stage = None
        return self.made[now]

    def _watches(self, source: str, now: Combination, forces: Held) -> Iterator[Watch]:
        """What a mode looks out for."""
        view, gaps = self.mechanics.view, self._gaps
        if forces.solvability is not None:
            guard = Guard(scalar(forces.solvability - SINGULAR), -1)
            yield Watch(source, now, ContactEvent(JAMS), guard, NONE)
        for i, (contact, status) in enumerate(zip(self.contacts, now.statuses, strict=True)):
            name = contact.name

            def watch(kind: str, guard: Guard, title: str, i: int = i) -> Watch:
                return Watch(source, now, ContactEvent(kind, i), guard, title)

            if status == OPEN:
                yield watch(IMPACT, gaps[i], name)
                continue
            if status == IDLE:
                continue
            yield watch(OPENS, Guard(scalar(forces.normal[i]), -1), f"{name} opens")
            row = self.mechanics.places[i][1]
            if now.sticks(i):
                for sign in (1, -1):
                    room = forces.bounds[i] - sign * forces.tangential[i]
                    yield watch(BREAKS, Guard(scalar(room), -1), f"{name} slips")
            elif status in SIGNS:
                assert row is not None, "a contact slips along a direction"
                yield watch(STOPS, Guard(scalar(SIGNS[status] * view.speeds[row]), -1), f"{name} stops")

    @cached_property
    def _gaps(self) -> list[Guard]:
        return [Guard(scalar(each), -1) for each in self.mechanics.view.gaps]

    def _title(self, watch: Watch, decision: Decision) -> str:
        """What happens, in names of transitions."""
        if watch.event.kind == IMPACT:
            hit = [i for i in decision.closed if watch.now.statuses[i] == OPEN]
            return "+".join(self.contacts[i].name for i in hit)
        if watch.event.kind == BREAKS and is_shared(decision.forces, watch.now.of_closed(decision.resting)):
            return f"{self.contacts[watch.event.contact].name} shares"
        return watch.title

    def _all_watches(self) -> Iterator[Watch]:
        yield self.settling
        if self.begins:
            yield self.beginning
        for each in self.made.values():
            yield from each.watches

    def _assembled(self) -> HybridSystem:
        """The system of what has been made."""
        modes = [each.mode for each in self.made.values()]
        moments = [Mode(name, self.still) for name in self._moments]
        return self._with_modes([*modes, *moments], self.notes)

    @property
    def _moments(self) -> list[str]:
        """The modes that last no time."""
        return [SETTLING, BEGINNING] if self.begins else [SETTLING]

    def _outputs(self) -> dict[str, Output]:
        """Gap and forces of each contact, in the modes that have been made."""
        found = {}
        modes = [(each.mode.name, each.forces) for each in self.made.values()]
        modes += [(name, self.free.forces) for name in self._moments]
        for i, contact in enumerate(self.contacts):
            for what in FORCES if contact.has_friction else FORCES[:1]:
                name = f"{contact.name}.{what}"
                formulas = [
                    Formula(mode, scalar(getattr(forces, what)[i]))
                    for mode, forces in modes
                    if (i, what) not in forces.undetermined
                ]
                found[name] = Output(name, tuple(formulas))
            gap = f"{contact.name}.gap"
            found[gap] = Output(gap, (Formula(None, self._gaps[i].function),))
        return found

    def _why(self, watch: Watch, undecided: Undecided, place: Place) -> str:
        view = self.mechanics.at(*place)
        names = ", ".join(repr(self.contacts[i].name) for i in undecided.contacts)
        what = "impulses" if undecided.sudden else "accelerations"
        friction = ", ".join(
            f"{view.friction[i]:g} at {self.contacts[i].name!r}"
            for i in undecided.contacts
            if self.contacts[i].has_friction
        )
        where = "where a run starts or settles" if watch.source == SETTLING else f"in mode {watch.source!r}"
        text = f"contact {names} {where}" + (f", with friction {friction}" if friction else "")
        if undecided.name == NONE:
            return f"No {what} agree with Coulomb's law there (Painleve's paradox): {text}."
        return f"Several {what} are consistent there: {text}; {self._cases(undecided)}."

    def _cases(self, undecided: Undecided) -> str:
        """What is consistent, as names of modes."""
        names = []
        for case in undecided.cases:
            statuses = [OPEN] * len(self.contacts)
            for i, status in zip(undecided.contacts, case, strict=True):
                statuses[i] = status
            names.append(repr(mode_name(self.contacts, tuple(statuses))))
        return " or ".join(names)


def contacts_of(system: HybridSystem) -> ContactGrowth | None:
    """What makes the modes of a system with contacts, or made those that it has; None for other systems."""
    found = decided_by(system)
    return found if isinstance(found, ContactGrowth) else None
