"""What a run says of its end: the status, from what the kernels have counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

import attrs
import numpy as np

from hybrid.display.tables import counted
from hybrid.kernels.types import codes
from hybrid.kernels.types.notes import MOST_LATENESS, carries_plainly, is_plain
from hybrid.simulation.end import ArcEnd, end_of
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
)
from hybrid.system.clocks import fault_of, numbers_of
from hybrid.system.entries import enters_itself, whole_mode
from hybrid.system.functions import guard_function
from hybrid.system.growth import Unexplored

# What helps where a level runs dry.
LOWER = (
    "Lower atol, or write the exponents as 1/2, 1/3, 2/3 or 3/4: with Taylor, such powers have a series "
    "without this error."
)

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
    if complete and is_plain(trajectory.model, trajectory.run, len(trajectory.beyond)):
        return SUCCESS
    status = _status(trajectory, code)
    notes = _notes(trajectory, code)
    if status.code != StatusCode.START_BEYOND:
        notes = [*_start_beyond(trajectory), *notes]
    if status.code != StatusCode.DISCONTINUOUS_FIELD:
        notes += _kinks(trajectory)
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


def has_tangents(trajectory: Trajectory) -> bool:
    """Whether the model of a run has tangent vectors everywhere."""
    return trajectory.compiled.is_smooth and not trajectory.system.switching


def _notes(trajectory: Trajectory, code: int) -> list[str]:
    """What is told besides the status, with or without tangent vectors; ``is_plain`` names the reasons."""
    notes = [*_turned(trajectory), *_restarted(trajectory), *_miscounted(trajectory), *_held(trajectory)]
    notes += _run_dry(trajectory, code)
    return [*notes, *_unproved(trajectory), *_unresolved(trajectory), *_unbounded(trajectory)]


def _grow(trajectory: Trajectory, code: int) -> None:
    """Unexplored if a transition or a chatter at the end of the run leads to a mode that is not made yet."""
    growth, run = trajectory.system.growth, trajectory.run
    if growth is None or code not in (StatusCode.TERMINAL, StatusCode.ACCUMULATION) or run.last_fired < 0:
        return
    in_turn = code == StatusCode.ACCUMULATION and not run.at_rest
    for last in _recent(trajectory, run.round) if in_turn else [run.last_fired]:
        name = trajectory.system.transition_names[last]
        if growth.leads_on(name):
            growth.extend(name)
            raise Unexplored(name)


def _never_fired(trajectory: Trajectory) -> list[str]:
    """The transitions whose guards the start lies beyond, and that have not fired since, by their names."""
    system, fires = trajectory.system, trajectory.run.fires
    parts = {each.name: each.part_of or each.name for each in system.transitions}
    names = dict.fromkeys(parts[name] for name in trajectory.beyond)
    return [name for name in names if not fires[system.copies_of(name)].any()]


def _start_beyond(trajectory: Trajectory) -> Iterator[str]:
    """A note on guards that the start lies beyond."""
    if trajectory.beyond:
        names = ", ".join(map(repr, trajectory.beyond))
        yield (
            f"The start lies beyond the guard of {names}. This guard counts as crossed, so only its next "
            "crossing fires. For an event before the mode is entered, give the mode before a transition with "
            "the same guard."
        )


def _turned(trajectory: Trajectory) -> Iterator[str]:
    """A note on ticks at which two transitions fired whose conditions exclude each other."""
    run, system = trajectory.run, trajectory.system
    if run.turned and not system.listed_order:
        ticks, name = counted(run.turned, "tick"), system.transition_names[run.turned_to]
        yield (
            f"At {ticks} two transitions of one clock fired whose conditions (when=) exclude each other: the "
            f"reset of the first one made the condition of {name!r} true. A "
            "condition is evaluated at the state after the resets before it. If one transition per tick is "
            "meant, write a single one whose reset chooses, with np.where. If both are meant, declare "
            "HybridSystem(listed_order=True)."
        )


def _restarted(trajectory: Trajectory) -> Iterator[str]:
    """A note on clocks that jumps from their mode to itself have begun anew, and that have never fired."""
    run, system = trajectory.run, trajectory.system
    clocks = {each.part_of or each.name: each for each in system.transitions if each.clock}
    for name, transition in clocks.items():
        clock = transition.clock
        assert clock is not None
        if not (clock.counts_from_entry and clock.restarts) or run.fires[system.copies_of(name)].any():
            continue
        mode, fires = whole_mode(system, transition.source), Counter[str]()
        for i, each in enumerate(system.transitions):
            if enters_itself(system, each) and whole_mode(system, each.source) == mode:
                fires[each.part_of or each.name] += int(run.fires[i])
        if fires.total():
            names = ", ".join(repr(name) for name, count in fires.items() if count)
            yield (
                f"The clock After of {name!r} never fired: {counted(fires.total(), 'jump')} of {names} from "
                f"mode {mode!r} to itself began it anew. If it is to count from the entry from another mode, "
                "write After(..., restarts=False)."
            )


def _miscounted(trajectory: Trajectory) -> Iterator[str]:
    """A note on counters that a run has made other than whole numbers."""
    system = trajectory.system
    counts = trajectory.x[system.tangent_dimension :].tolist()
    told = [
        f"{name!r} is {count:.6g}"
        for name, count in zip(system.counters, counts, strict=True)
        if not count.is_integer()
    ]
    if told:
        yield (
            f"A counter is a whole number, and {', '.join(told)} at the end. It has no tangent vectors and "
            "no tolerance: make it one of the held components."
        )


def _held(trajectory: Trajectory) -> Iterator[str]:
    """A note on components without a limit where jumps have accumulated, such as counters."""
    held = trajectory.run.trail[codes.HELD, :-1]
    if held.any():
        names = ", ".join(
            repr(name) for name, one in zip(trajectory.system.state_names, held, strict=True) if one
        )
        yield (
            f"Each of the infinitely many jumps of a chatter changes {names}. Such a component has no limit: "
            "it keeps its value after the last jump that was made."
        )


def _run_dry(trajectory: Trajectory, code: int) -> Iterator[str]:
    """A note on a level that comes to rest at its guard, where the slope of its field is infinite.

    Steps in time do not know the level below the absolute tolerance, and may take long to lead it to zero.
    """
    run, atol, system = trajectory.run, trajectory.method.atol, trajectory.system
    if run.unknown_time and code != codes.DONE:
        yield f"{_uncertain(trajectory)} {LOWER}"
    powers = _steep_in_time(trajectory, run.mode)
    if powers:
        for index, transition in enumerate(system.transitions):
            if transition.source != trajectory.mode or run.on_guard[index] > 0:
                continue
            guard = guard_function(transition)
            parameters = trajectory.parameters
            [value] = trajectory.compiled.value(guard, index, run.phase, trajectory.x, parameters)
            if abs(value) <= atol:
                yield (
                    f"The guard of {transition.name!r} is below atol where the slope of {powers} is "
                    f"infinite: whether and when it reached zero is not known to the tolerances. {LOWER}"
                )


def _uncertain(trajectory: Trajectory) -> str:
    """What is not known of the time at which a level ran dry."""
    run, system = trajectory.run, trajectory.system
    transition = system.transitions[run.ran_dry]
    powers = _steep_in_time(trajectory, system.mode_index(transition.source))
    return (
        f"The time of transition {transition.name!r} may be off by {run.unknown_time:.1g}: its guard comes "
        f"to rest where the slope of {powers} is infinite, and steps in time do not control its level below "
        "the tolerances."
    )


def _steep_in_time(trajectory: Trajectory, mode: int) -> str:
    """The powers with an infinite slope at a guard of a mode that steps in time follow; else nothing."""
    in_time = trajectory.model.propagator[mode] == codes.RUNGE_KUTTA
    return trajectory.compiled.emitted.steep[mode] if in_time else ""


def _unproved(trajectory: Trajectory) -> Iterator[str]:
    """A note on guards whose crossings are not proved."""
    steps, is_sampled = trajectory.run.unproved, trajectory.compiled.emitted.is_sampled
    names = [(i, repr(name)) for i, name in enumerate(trajectory.system.transition_names) if steps[i]]
    sampled = [name for i, name in names if is_sampled(i)]
    if sampled:
        yield (
            f"The crossings of {', '.join(sampled)} are not proved: the guard could not be traced, so it "
            "was sampled on each step. Write it with NumPy functions (np.sin, np.where)."
        )
    bounded = [name for i, name in names if not is_sampled(i)]
    if bounded:
        yield (
            f"Not all crossings of {', '.join(bounded)} are proved: the guard stays so close to zero that "
            "its signs at the ends of pieces of a step decided, and two crossings between them may be "
            "missed. Shorten the steps with max_step= of the solver, or write the guard such that it crosses "
            "zero at a steeper angle."
        )


def _unresolved(trajectory: Trajectory) -> Iterator[str]:
    """A note on steps on which the forcing could not be resolved."""
    run = trajectory.run
    steps = run.unresolved + run.coarse
    if steps:
        yield (
            f"On {steps} steps the forcing is not resolved: it changes, or its bounds are wide, over times "
            "as short as the rounding of time. A pulse may have been stepped over there."
        )


def _unbounded(trajectory: Trajectory) -> Iterator[str]:
    """A note on modes of the run whose forcing cannot be bounded."""
    model, run = trajectory.model, trajectory.run
    for mode, name in enumerate(trajectory.system.mode_names):
        if not model.bounded[mode] and (mode == run.mode or run.stay[mode] > 0.0):
            yield (
                f"The forcing of mode {name!r} cannot be bounded. The solver sees its field at single points "
                "of each step, so a pulse or a jump between them may have been stepped over. Write the field "
                "with NumPy functions (np.where, np.clip), or shorten the steps with max_step= of the solver."
            )


def _kinks(trajectory: Trajectory) -> Iterator[str]:
    """A note on fields with kinks inside of their mode, where tangent vectors lose digits."""
    if trajectory.tangents:
        for mode, names in trajectory.system.switching.items():
            yield (
                f"The field of mode {mode!r} has kinks ({', '.join(names)}): tangent vectors lose digits at "
                "each. hybrid.split(system) makes guards of them."
            )


def _status(trajectory: Trajectory, code: int) -> Status:
    if code in (StatusCode.INTERRUPTED, StatusCode.OUT_OF_MEMORY):
        return run_status(code, _place(trajectory), None, bare_time=False)
    run = trajectory.run
    singular = run.singular_jumps
    ambiguous = 0 if trajectory.system.listed_order else run.order_mattered
    grazed = run.ill_conditioned if trajectory.tangents else 0
    if trajectory.tangents and singular:
        return Status(
            StatusCode.SINGULAR_SALTATION,
            f"{singular} of {trajectory.jumps} jumps had no saltation matrix: they grazed exactly, or were "
            "the limit of several transitions that accumulate in turn.",
            "The tangent vectors are not valid after these jumps. Move the parameters away from the grazing.",
        )
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
        return Status(
            StatusCode.INDISTINCT_TANGENTS,
            f"{run.indistinct} times the tangent vectors became parallel to rounding; the exponents after "
            "the first are not known.",
            "Shorten the steps by max_step= of the solver, or ask for fewer exponents.",
        )
    if code == codes.DONE and run.unknown_time:
        return Status(StatusCode.INFINITE_SLOPE, f"Reached the end. {_uncertain(trajectory)}", LOWER)
    if code == codes.DONE and run.lateness > MOST_LATENESS:
        return late_status(run.lateness, declared=trajectory.model.period > 0.0)
    if code == codes.DONE and ambiguous:
        jumps = trajectory.jumps
        also = f" Besides, {grazed} of {jumps} jumps grazed within the tolerances." if grazed else ""
        return Status(
            StatusCode.AMBIGUOUS_ORDER,
            f"{ambiguous} times two guards were reached together and the order of their transitions "
            f"mattered; the one listed first was fired first.{also}",
            "Choose the order in which the transitions are listed and declare "
            "HybridSystem(listed_order=True), or add one for the corner.",
        )
    if code == codes.DONE and grazed:
        return _grazed(trajectory, grazed)
    if code == codes.DONE:
        waiting = _never_fired(trajectory)
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
    last = run.last_fired
    if code in (codes.STEP_TOO_SMALL, codes.NON_FINITE):
        failed = _failed(trajectory, code)
        if failed is not None:
            return failed
    bare_time = trajectory.model.period == 0.0 and trajectory.model.timed.item(run.mode) == 1
    name, derived = (names[last], _is_derived(trajectory, last)) if last >= 0 else (None, False)
    return run_status(code, where, name, bare_time=bare_time, derived=derived)


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
