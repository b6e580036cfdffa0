"""What a run says of its end: the status, from what the kernels have counted."""

from __future__ import annotations

import math
from collections.abc import Mapping

import attrs
import numpy as np

from hybrid.kernels.types import codes
from hybrid.kernels.types.notes import MOST_LATENESS, carries_plainly, is_plain
from hybrid.simulation.end import ArcEnd, end_of
from hybrid.simulation.notes import LOWER, kinks, never_fired, notes_of, start_beyond, uncertain
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import (
    SUCCESS,
    Status,
    StatusCode,
    beyond_status,
    chatter_status,
    discontinuous_status,
    late_status,
    run_status,
    steep_status,
    stuck_status,
    told,
)
from hybrid.system.clocks import fault_of, numbers_of
from hybrid.system.growth import Unexplored

# A state above this size grows beyond all numbers.
HUGE = 1e100
# A state that doubles within this share of the stay in its mode grows without bound, unless it slows down.
SOON = 1e-6


def status_of(trajectory: Trajectory, code: int) -> Status:
    """Status of a run after its ``advance`` returned ``code``."""
    _grow(trajectory, code)
    complete = code == codes.DONE
    if trajectory.tangents:
        complete = complete and has_tangents(trajectory) and carries_plainly(trajectory.run)
    doubtful = trajectory.system.growth is not None and trajectory.system.growth.ambiguous
    if complete and not doubtful and is_plain(trajectory.model, trajectory.run, len(trajectory.beyond)):
        return SUCCESS
    status = _status(trajectory, code)
    notes = notes_of(trajectory, code)
    if status.code != StatusCode.START_BEYOND:
        notes = [*start_beyond(trajectory), *notes]
    if status.code != StatusCode.DISCONTINUOUS_FIELD:
        notes += kinks(trajectory)
    return attrs.evolve(status, message=" ".join([status.message, *notes])) if notes else status


class Ending:
    """How a run ended: its status, and what the next run may go on from; both are made when somebody asks.

    Until then it holds a copy of what the run has been, since the memory goes to the next run. The status
    of a run that did not reach its end is made at once: it may look further than at the run.
    """

    def __init__(self, trajectory: Trajectory, code: int) -> None:
        self._status: Status | None = None
        self._memory: ArcEnd | None = None
        self._held: tuple[Trajectory, np.ndarray] | None = trajectory, trajectory.words()
        if code != codes.DONE or trajectory.system.growth is not None:
            self._status = status_of(trajectory, code)

    @property
    def status(self) -> Status:
        """The status."""
        # Another thread may ask too: the status is there before what it is made of goes.
        held = self._held
        if self._status is None:
            assert held is not None
            trajectory, words = held
            before = trajectory.as_it_was(words)
            self._status = status_of(before, codes.DONE)
            before.release()
            if trajectory.tangents:
                # The tangent vectors may be large, and no run goes on with them.
                self._remember()
        return self._status

    def end(self, t: float, parameters: Mapping[str, float]) -> ArcEnd:
        """The end, with the time and the parameters as they are told of the run."""
        self._remember()
        assert self._memory is not None
        return attrs.evolve(self._memory, t=t, parameters=parameters)

    def _remember(self) -> None:
        """Make what the next run may go on from, and let go of the copy that it is made of."""
        held, status = self._held, self.status
        if self._memory is None and held is not None:
            trajectory, words = held
            before = trajectory.as_it_was(words)
            told = before.t, before.named_parameters, status.code
            self._memory = end_of(before.system, before.run, *told, before.plan.by_steps)
            before.release()
        self._held = None


NO_WAY_ON = (
    "Change the parameters (of contacts: less friction), or the start; the result holds everything up to "
    "that time."
)


def has_tangents(trajectory: Trajectory) -> bool:
    """Whether the model of a run has tangent vectors everywhere."""
    return trajectory.compiled.is_smooth and not trajectory.system.switching


def _grow(trajectory: Trajectory, code: int) -> None:
    """Unexplored if a transition or a chatter at the end of the run leads to a mode that is not made yet."""
    growth, run = trajectory.system.growth, trajectory.run
    if growth is None or code not in (StatusCode.TERMINAL, StatusCode.ACCUMULATION) or run.last_fired < 0:
        return
    in_turn = code == StatusCode.ACCUMULATION and not run.at_rest
    for last in _recent(trajectory, run.round) if in_turn else [run.last_fired]:
        name = trajectory.system.transition_names[last]
        place = trajectory.t, trajectory.x, trajectory.parameters
        if growth.leads_on(name) and growth.extend(name, place, trajectory.system.transition_names):
            raise Unexplored(name)


def _status(trajectory: Trajectory, code: int) -> Status:
    if code in (StatusCode.INTERRUPTED, StatusCode.OUT_OF_MEMORY):
        return run_status(code, _place(trajectory), None, bare_time=False)
    run = trajectory.run
    singular = run.singular_jumps
    ambiguous = 0 if trajectory.system.listed_order else run.order_mattered
    grazed = run.ill_conditioned if trajectory.tangents else 0
    if trajectory.tangents and singular:
        return told(StatusCode.SINGULAR_SALTATION, count=singular, jumps=trajectory.jumps)
    steep = _steep(trajectory, code)
    if steep is not None:
        return steep
    if trajectory.tangents and code == codes.DONE and any(trajectory.compiled.emitted.discontinuities):
        jumping = zip(trajectory.system.mode_names, trajectory.compiled.emitted.discontinuities, strict=True)
        return discontinuous_status({mode: f"where {where}" for mode, where in jumping if where})
    if trajectory.tangents and code == codes.DONE and run.field_jumps:
        within = f"within {run.field_jumps} steps, or is steeper there than the steps resolve"
        return discontinuous_status({trajectory.system.mode_names[run.jumped_in]: within})
    if trajectory.tangents and code == codes.DONE and run.indistinct:
        return told(StatusCode.INDISTINCT_TANGENTS, count=run.indistinct)
    if code == codes.DONE and run.unknown_time:
        return Status(StatusCode.INFINITE_SLOPE, f"Reached the end. {uncertain(trajectory)}", LOWER)
    if code == codes.DONE and run.lateness > MOST_LATENESS:
        return late_status(run.lateness, declared=trajectory.model.period > 0.0)
    if code == codes.DONE and ambiguous:
        jumps = trajectory.jumps
        also = f" Besides, {grazed} of {jumps} jumps grazed within the tolerances." if grazed else ""
        status = told(StatusCode.AMBIGUOUS_ORDER, count=ambiguous)
        return attrs.evolve(status, message=status.message + also)
    together = _impacts_in_doubt(trajectory) if code == codes.DONE else None
    if together is not None:
        return together
    if code == codes.DONE and grazed:
        return _grazed(trajectory, grazed)
    if code == codes.DONE:
        waiting = never_fired(trajectory)
        return beyond_status(waiting) if waiting else SUCCESS
    where = _place(trajectory)
    names = trajectory.system.transition_names
    if code == codes.STUCK:
        fired = _round(trajectory)
        transitions = [trajectory.system.transitions[i] for i in fired]
        return stuck_status(where, transitions, _faces(trajectory, fired))
    if code == codes.ACCUMULATION and not run.at_rest:
        fired = _recent(trajectory, run.round)
        derived = all(_is_derived(trajectory, i) for i in fired)
        return chatter_status(where, [names[i] for i in fired], derived=derived)
    if code == codes.TERMINAL and trajectory.system.growth is not None:
        why = trajectory.system.growth.told.get(names[run.last_fired])
        if why is not None:
            return Status(
                StatusCode.TERMINAL, f"Ended by {names[run.last_fired]!r} {where}. {why}", NO_WAY_ON
            )
    full = _full(trajectory) if code == codes.NON_FINITE else None
    if full is not None:
        return full
    last = run.last_fired
    if code in (codes.STEP_TOO_SMALL, codes.NON_FINITE):
        failed = _failed(trajectory, code)
        if failed is not None:
            return failed
    bare_time = trajectory.model.period == 0.0 and trajectory.model.timed.item(run.mode) == 1
    name, derived = (names[last], _is_derived(trajectory, last)) if last >= 0 else (None, False)
    return run_status(code, where, name, bare_time=bare_time, derived=derived)


def _impacts_in_doubt(trajectory: Trajectory) -> Status | None:
    """Status of a run in which contacts closed together whose order would matter; else None."""
    growth, names = trajectory.system.growth, trajectory.system.transition_names
    if growth is None or trajectory.system.listed_order or not growth.ambiguous:
        return None
    fired = [names[i] for i in np.flatnonzero(trajectory.run.fires) if names[i] in growth.ambiguous]
    if not fired:
        return None
    contacts = " and ".join(dict.fromkeys(growth.ambiguous[name] for name in fired))
    return Status(
        StatusCode.AMBIGUOUS_ORDER,
        f"Contacts closed together, {contacts}: their impacts were solved at once, and one after another "
        "they would lead elsewhere, by their order.",
        'Start beside this case, or say mechanics(impacts="sequential"): the contact listed first is first.',
    )


def _is_derived(trajectory: Trajectory, transition: int) -> bool:
    """Whether a transition comes from a switch in the equations: between parts of one mode of the user's."""
    system = trajectory.system
    each = system.transitions[transition]
    return each.part_of is None and system.modes[system.mode_index(each.source)].part_of is not None


def _failed(trajectory: Trajectory, code: int) -> Status | None:
    """Status of a run whose steps led nowhere, if the field tells why; else None."""
    run, where, kind = trajectory.run, _place(trajectory), StatusCode(code)
    if _grows_without_bound(trajectory):
        return Status(
            kind,
            f"The solution grows without bound {where}.",
            "Check the model, or end the run before: a transition whose target is None ends it at a guard.",
        )
    if code == codes.NON_FINITE:
        return _clock_fault(trajectory)
    emitted, mode = trajectory.compiled.emitted, trajectory.mode
    names = [*trajectory.system.switching.get(mode, ()), emitted.steep_inside[run.mode]]
    names = [*dict.fromkeys(name for name in names if name)]
    stalled = run.stretch_moved == 0 and run.steps - run.stretch_steps >= codes.MANY_STEPS
    if names:
        return Status(
            kind,
            f"The steps became too short to get on {where}, where its field jumps or has an infinite slope "
            f"({', '.join(names)}).",
            "hybrid.split(system), or hybrid.from_equations, makes modes of the pieces of the field.",
        )
    if not stalled:
        return None
    return Status(
        kind,
        f"The last {codes.MANY_STEPS} steps moved neither the time nor the state {where}: the field is stiff "
        "or not smooth there.",
        "If the field is smooth, RadauIIA() takes longer steps. If it is not, as a quotient is where its "
        "denominator vanishes, add a transition to a mode in which the state rests.",
    )


def _full(trajectory: Trajectory) -> Status | None:
    """Status of a run that ended as a delay had no place left; None if it ended for another reason."""
    system, x = trajectory.system, trajectory.x
    view, p = system.variables.state_view(x), system.variables.parameter_view(trajectory.parameters)
    for transition in system.transitions:
        clock = transition.clock
        if clock is not None and clock.number == codes.UNDER_WAY:
            *places, last = numbers_of(clock, view, p)
            if float(last) == math.inf:
                return told(
                    StatusCode.DELAY_FULL,
                    where=_place(trajectory),
                    name=transition.name,
                    places=len(places),
                    told=clock.told,
                )
    return None


def _clock_fault(trajectory: Trajectory) -> Status | None:
    """Status of a run in which a reset has given a clock a number that it cannot have; else None."""
    system, x = trajectory.system, trajectory.x
    view, p = system.variables.state_view(x), system.variables.parameter_view(trajectory.parameters)
    for transition, moving in zip(system.transitions, system.moving, strict=True):
        clock = transition.clock
        if clock is not None and moving:
            with np.errstate(all="ignore"):
                fault = fault_of(clock, tuple(map(float, numbers_of(clock, view, p))), moving=True)
            if fault:
                return Status(
                    StatusCode.NON_FINITE,
                    f"The clock of {transition.name!r} cannot go on {_place(trajectory)}: {fault}.",
                    "A reset has changed what the clock reads. Limit it there, with np.clip for instance.",
                )
    return None


def _grows_without_bound(trajectory: Trajectory) -> bool:
    """Whether the state grows as fast as ever at any size, or has no number for its size any more."""
    x = trajectory.x
    if np.abs(x).max(initial=0.0) > HUGE:
        return True
    run = trajectory.run
    with np.errstate(all="ignore"):
        here, beyond = trajectory.field(), trajectory.field(2.0 * x)
        moments = np.abs(x) / np.abs(here)
        fastest = int(np.argmin(np.where(here * x > 0.0, moments, np.inf)))
        soon = moments[fastest] <= SOON * max(run.since_entry, run.longest_step)
        return bool(soon and here[fastest] * x[fastest] > 0.0 and beyond[fastest] / here[fastest] >= 1.0)


def _steep(trajectory: Trajectory, code: int) -> Status | None:
    """Status of a run whose tangent vectors met the infinite slope of a field in steps in time, else None."""
    if not trajectory.tangents:
        return None
    emitted, modes = trajectory.compiled.emitted, trajectory.system.mode_names
    powers = {mode: words for mode, words in zip(modes, emitted.steep, strict=True) if words}
    inside = {mode: words for mode, words in zip(modes, emitted.steep_inside, strict=True) if words}
    failed = code in (codes.NON_FINITE, codes.STEP_TOO_SMALL)
    where = f"The run stopped {_place(trajectory)}." if failed else "Reached the end."
    if trajectory.run.steep_jumps or (failed and trajectory.mode in powers):
        return steep_status(where, powers, inside=False)
    if inside and (code == codes.DONE or (failed and trajectory.mode in inside)):
        return steep_status(where, inside, inside=True)
    return None


def _place(trajectory: Trajectory) -> str:
    return f"at t = {trajectory.t:.12g} in mode {trajectory.mode!r}"


def _grazed(trajectory: Trajectory, grazed: int) -> Status:
    largest = trajectory.run.largest_saltation
    return Status(
        StatusCode.SUCCESS,
        f"Reached the end. {grazed} of {trajectory.jumps} jumps grazed within the tolerances: their "
        f"saltation matrices, with entries up to {largest:.2g}, are unreliable, because grazing makes the "
        "map non-differentiable.",
        "Tighten the tolerances to resolve them, or move the parameters away.",
    )


def _recent(trajectory: Trajectory, number: int) -> list[int]:
    """The last transitions that fired, in order, as far as the run remembers them."""
    jumps, recent = int(trajectory.run.jumps), trajectory.run.recent
    number = min(number, jumps, len(recent))
    return [int(recent[j % len(recent)]) for j in range(jumps - number, jumps)]


def _round(trajectory: Trajectory) -> list[int]:
    """The transitions that go round at the end of the run, in order; all that are remembered if none do."""
    fired = _recent(trajectory, len(trajectory.run.recent))
    for length in range(1, len(fired) // 2 + 1):
        if fired[length:] == fired[:-length]:
            return fired[-length:]
    return fired


def _faces(trajectory: Trajectory, fired: list[int]) -> bool:
    """Whether two modes send the state back to each other across one guard, without resets."""
    transitions, emitted = trajectory.system.transitions, trajectory.compiled.emitted
    if len(fired) != 2 or any(transitions[i].reset for i in fired):
        return False
    towards = [transitions[i].guard.direction * emitted.orientation[i] for i in fired]
    one, other = fired
    return emitted.surface[one] == emitted.surface[other] and towards[0] != towards[1]
