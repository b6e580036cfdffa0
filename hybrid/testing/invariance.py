"""Runs must not change when a system is written or run differently."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.testing.case import Case, as_case
from hybrid.testing.contacts import discard_what_rounding_decides
from hybrid.testing.errors import discard
from hybrid.testing.events import BEYOND
from hybrid.testing.run import Run, mode_after
from hybrid.testing.variants import AGAIN, altered, new_name, renamed, reordered
from hybrid.testing.words import matrix_told
from hybrid.transform.contacts.growth import SETTLING, contacts_of

CUT = "Cutting a flow by an identity transition changes nothing"
NAMES = "The names of modes and transitions do not matter"
ORDER = "The order in which transitions are listed does not matter"
SCALE = "A positive factor of the guards does not matter"
SPLIT = "A run that is split and resumed goes on as if it had not been"
SAMPLES = "Samples, also exactly at an event, change nothing and are the states after it"
# A jump of a run backwards is one of the start if it is made in the last part of the run, of this share.
LAST_INSTANT = 1e-9
# Runs that differ only by rounding must agree to this, relative to the size of the state.
ROUNDING = 1e-9


def check_cut(case: Case) -> None:
    """An identity transition on a plane across the flow changes neither the run nor its tangents.

    Raises
    ------
    PropertyError
        If the run changes, or a saltation matrix at the plane is not the identity.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_cut
    >>> system = models.impact_oscillator()
    >>> case = Case(system, system.parameters, "flight", (0.0, 0.0), 0.0, 20.0)
    >>> check_cut(case)
    """
    as_case(case)
    settles = None if contacts_of(case.system) is None else SETTLING
    if any(case.is_passed(each) for each in case.system.transitions if each.source != settles):
        discard("a transition that the state passes would fire again in the copy of its mode")
    run = case.run
    if any(case.follows_at_once(jump) for jump in run.arc.jumps):
        discard("several jumps at one instant may cross the cut together")
    times = [case.t0, *run.arc.jumps.t, run.t1]
    j = int(case.fraction * (len(times) - 1))
    if not times[j + 1] > times[j]:
        discard("two jumps meet where the run would be cut")
    t = times[j] + case.fraction * (times[j + 1] - times[j])
    x, mode = run.arc(t), _mode_after(case, j)
    speed = case.evaluate(case.rates_of(mode), t, x) / run.scale
    if not np.linalg.norm(speed) * case.duration > ROUNDING:
        discard("the state is at rest where the run would be cut")
    normal = speed / np.linalg.norm(speed) / run.scale
    offset = float(normal @ x)
    height = float(normal @ np.array(case.x0)) - offset
    if abs(height) < 1e-3:
        discard("the start lies on the cut")
    assert case.mode is not None
    start = case.mode + AGAIN if height > 0.0 else case.mode
    variant = altered(case.system)
    arc = case.simulate(
        run.t1,
        system=variant.system,
        start=(case.t0, case.x0, start),
        extra=variant.cut(normal, offset),
    )
    if arc.grazings:
        discard("the run touches the cut")
    cuts = [jump for jump in arc.jumps if jump.transition in variant.cuts]
    if not cuts:
        case.fail(CUT, f"the cut at t = {t:.10g} was never crossed", hint="the solver misses events.")
    for cut in cuts:
        k = len(cut.saltation)
        scale = run.scale[:k]
        if not np.all(np.abs(cut.saltation - np.eye(k)) * scale / scale[:, None] <= ROUNDING):
            case.fail(
                CUT,
                f"wanted the identity as saltation matrix at the cut, t = {cut.t:.10g}",
                f"got {matrix_told(cut.saltation)}",
                hint="a term of the saltation matrix that does not vanish where the field is continuous.",
            )
    fired = [variant.original[name] for name in _fired(arc) if name not in variant.cuts]
    hint = "an event that changes more than its reset says."
    compare(case, CUT, arc, fired, variant.original[str(arc.mode[-1])], hint)


def check_names(case: Case) -> None:
    """Different names of modes and transitions give the same run.

    Raises
    ------
    PropertyError
        If the run changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_names
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_names(case)
    """
    as_case(case)
    run, system = case.run, renamed(case.system)
    assert case.mode is not None
    start = (case.t0, case.x0, new_name(case.system.mode_names, case.mode))
    arc = case.simulate(run.t1, system=system, start=start)
    fired = [name.split(" ", 1)[1] for name in _fired(arc)]
    compare(case, NAMES, arc, fired, str(arc.mode[-1]).split(" ", 1)[1], "something looks modes up by name.")


def check_order(case: Case) -> None:
    """The reverse order of the transitions gives the same run, unless two guards are reached together.

    Raises
    ------
    PropertyError
        If the run changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_order
    >>> circuit = models.chua_circuit()
    >>> case = Case(circuit, circuit.parameters, "inner", (0.5, 0.0, 0.0), 0.0, 5.0)
    >>> check_order(case)
    """
    as_case(case)
    if len(case.system.transitions) < 2:
        discard("there are no two transitions")
    if any(_guards_beyond(case, jump) > 1 for jump in case.run.arc.jumps):
        discard("a reset leads beyond two guards, of which the first listed fires")
    arc = case.simulate(case.run.t1, system=reordered(case.system))
    hint = "the first guard listed wins, not the first guard reached; or two guards overlap."
    compare(case, ORDER, arc, _fired(arc), str(arc.mode[-1]), hint)


def _guards_beyond(case: Case, jump: Jump) -> int:
    """Number of guards beyond which a jump leaves the state."""
    found = 0
    for transition in case.system.transitions:
        if transition.source == jump.target and transition.guard.direction:
            value = case.evaluate(transition.guard.function, jump.t, jump.x_plus)[0]
            found += bool(transition.guard.direction * value > BEYOND * case.guard_size(transition))
    return found


def check_scale(case: Case) -> None:
    """Guards multiplied by a positive number, from 1/1000 to 1000, give the same run.

    Raises
    ------
    PropertyError
        If the run changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_scale
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_scale(case)
    """
    as_case(case)
    variant = altered(case.system)
    if variant.resets_stay:
        discard("a model function cannot be traced, so it cannot be changed")
    factor = 10.0 ** (6.0 * case.fraction - 3.0)
    arc = case.simulate(case.run.t1, system=variant.system, extra=variant.scaled(factor))
    hint = f"events found with an absolute tolerance on the guard; all guards are multiplied by {factor:.3g}."
    compare(case, SCALE, arc, _fired(arc), str(arc.mode[-1]), hint)


def check_split(case: Case) -> None:
    """A run that is split at any time, also at an event, and resumed equals the run in one piece.

    The run is not split at the event of a passable transition, nor where several jumps at one instant lead
    back to a mode: the state after them does not show that they have happened.

    Raises
    ------
    PropertyError
        If an event is lost or fires twice, or the end changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_split
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_split(case)
    """
    as_case(case)
    run = case.run
    times = [case.t0 + case.fraction * case.duration]
    if len(run.arc.jumps) and not _hides(case, case.the_jump()):
        times.append(case.the_jump().t)
    for t in times:
        first = case.simulate(t)
        second = case.simulate(run.t1, start=(t, first.x[-1], str(first.mode[-1])))
        fired = [*_fired(first), *_fired_since(case, second)]
        doubled = Counter(fired) != Counter(_fired(run.arc))
        hint = (
            "events fire twice or are lost near a start"
            if doubled
            else "a state that the start does not show"
        )
        hint += f"; the run was split at t = {t:.17g}."
        compare(case, SPLIT, second, fired, str(second.mode[-1]), hint)


def _hides(case: Case, jump: Jump) -> bool:
    """Whether the state after a jump, and those at its instant, does not show that they have happened.

    Nor does it where the state passes the guard: a guard of time alone, a counter.
    """
    at_once = [each for each in case.run.arc.jumps if each.t == jump.t]
    returns = len(at_once) > 1 and any(each.source == at_once[-1].target for each in at_once)
    passed = case.is_passed(case.transition(jump))
    return passed or returns


def check_samples(case: Case) -> None:
    """Samples change neither the events nor the end, and a sample at an event is the state after it.

    Raises
    ------
    PropertyError
        If an event or the end changes, or if a sample is wrong.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_samples
    >>> system = models.impact_oscillator()
    >>> case = Case(system, system.parameters, "flight", (0.0, 0.0), 0.0, 20.0)
    >>> check_samples(case)
    """
    as_case(case)
    run = case.run
    jumps = {jump.t: jump.x_plus for jump in run.arc.jumps}
    times = np.unique([case.t0 + case.fraction * case.duration, *jumps, run.t1])
    arc = case.simulate(run.t1, samples=times, keep_jumps=True)
    hint = "samples that change the steps, or are taken on the wrong side of an event."
    compare(case, SAMPLES, arc, _fired(arc), str(arc.mode[-1]), hint)
    for t, x in zip(arc.t, arc.x, strict=True):
        wanted = jumps.get(float(t), run.arc(t))
        if not np.all(np.abs(x - wanted) <= run.tolerance):
            case.fail(
                SAMPLES,
                f"wanted {case.state_told(wanted)} at t = {t:.17g}",
                f"got {case.state_told(x)}",
                hint=hint,
            )


def _mode_after(case: Case, j: int) -> str:
    """Mode of the run after ``j`` jumps."""
    assert case.mode is not None
    return case.mode if j == 0 else mode_after(case.run.arc.jumps[j - 1])


def _fired(arc: HybridArc) -> list[str]:
    """The transitions of a run, without those that follow another at once and change nothing."""
    jumps = list(arc.jumps)
    idle = {
        jump.j
        for before, jump in pairwise(jumps)
        if jump.t == before.t and jump.source == jump.target and np.array_equal(jump.x_minus, jump.x_plus)
    }
    return [jump.transition for jump in jumps if jump.j not in idle]


def _fired_since(case: Case, arc: HybridArc) -> list[str]:
    """The events after a start, without a correction of its mode that the next events undo at once.

    A state on a surface is, by rounding, on either side of it.
    """
    jumps = list(arc.jumps)
    at_once = [jump for jump in jumps if jump.t == arc.t[0]]
    corrected = bool(at_once) and case.transition(at_once[0]).guard.at_start
    undone = corrected and at_once[-1].target == at_once[0].source
    return [jump.transition for jump in (jumps[len(at_once) :] if undone else jumps)]


def compare(case: Case, property_name: str, arc: HybridArc, fired: list[str], mode: str, hint: str) -> None:
    """Fail unless a run has the same events, final mode and final state as the run of the case."""
    run: Run = case.run
    wanted = _fired(run.arc)
    end = run.arc.x[-1]
    same = Counter(fired) == Counter(wanted) and mode == run.arc.mode[-1]
    if same and arc.status.ok and np.all(np.abs(arc.x[-1] - end) <= run.tolerance):
        return
    discard_what_rounding_decides(case)
    case.fail(
        property_name,
        f"wanted {case.state_told(end)} in mode {str(run.arc.mode[-1])!r} after {_list_told(wanted)}",
        f"got {case.state_told(arc.x[-1])} in mode {mode!r} after {_list_told(fired)}; "
        f"{arc.status.code.name}",
        hint=hint,
    )


def _list_told(names: list[str]) -> str:
    return ", ".join(names) if names else "no event"
