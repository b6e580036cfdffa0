"""What is told of a run besides its status: what may be uncertain, or not as its author expected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from hybrid.display.tables import counted
from hybrid.kernels.types import codes
from hybrid.simulation.trajectory import Trajectory
from hybrid.system.entries import enters_itself, whole_mode
from hybrid.system.functions import guard_function

# What helps where a level runs dry.
LOWER = (
    "Lower atol, or write the exponents as 1/2, 1/3, 2/3 or 3/4: with Taylor, such powers have a series "
    "without this error."
)


def notes_of(trajectory: Trajectory, code: int) -> list[str]:
    """What is told besides the status, with or without tangent vectors; ``is_plain`` names the reasons."""
    notes = [*_turned(trajectory), *_restarted(trajectory), *_miscounted(trajectory), *_held(trajectory)]
    notes += _run_dry(trajectory, code)
    return [*notes, *_unproved(trajectory), *_unresolved(trajectory), *_unbounded(trajectory)]


def never_fired(trajectory: Trajectory) -> list[str]:
    """The transitions whose guards the start lies beyond, and that have not fired since, by their names."""
    system, fires = trajectory.system, trajectory.run.fires
    parts = {each.name: each.part_of or each.name for each in system.transitions}
    names = dict.fromkeys(parts[name] for name in trajectory.beyond)
    return [name for name in names if not fires[system.copies_of(name)].any()]


def start_beyond(trajectory: Trajectory) -> Iterator[str]:
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
        yield f"{uncertain(trajectory)} {LOWER}"
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


def uncertain(trajectory: Trajectory) -> str:
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


def kinks(trajectory: Trajectory) -> Iterator[str]:
    """A note on fields with kinks inside of their mode, where tangent vectors lose digits."""
    if trajectory.tangents:
        for mode, names in trajectory.system.switching.items():
            yield (
                f"The field of mode {mode!r} has kinks ({', '.join(names)}): tangent vectors lose digits at "
                "each. hybrid.split(system) makes guards of them."
            )
